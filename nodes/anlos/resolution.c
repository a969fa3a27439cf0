/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/file.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_chart.h"
#include "recon/planning/resolution.h"
#include "recon/processing.h"

#define LATERAL_M 0.5 /* of Fig. 4: from the confocal pair to the scatterer */
#define FAR_M     5.0
#define STEPS     200

static const char help[] =
    "anlos resolution -- how close two scatterers may be to be told apart\n"
    "\n"
    "usage: anlos resolution --survey FILE [--out DIR]\n"
    "\n"
    "Prints for places before the middle of an array, or for the middle of the volume "
    "of\n"
    "pings with places of their own, the resolution by the times of the echoes alone\n"
    "(Lindell 2019, Eq. 15, gamma = 1 / 2B, the finest of all pairs) and the -6 dB "
    "widths\n"
    "of a point in the coherent image of all pairs.\n"
    "\n"
    "  --survey FILE   the array, the band and the speed of sound\n"
    "  --out DIR       also draws the lateral resolution over distance as\n"
    "                  resolution.svg and resolution.png: sweeps of 5, 9.5 and 18 kHz\n"
    "                  against light of 60 ps (Fig. 4, right: 0.5 m aside), and this "
    "array\n"
    "  --help          this text\n"
    "\n"
    "example\n"
    "  anlos resolution --survey /tmp/corner/survey.yaml --out /tmp/corner/resolution\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or survey\n";

static const struct usage_option options[] = {
    {"survey", USAGE_VALUE('s')},
    {"out", USAGE_VALUE('o')},
    {.name = NULL},
};

struct subject {
    struct geometry geometry; /* borrows the survey's arrays */
    double band_hz[2];
    double low[3], high[3]; /* of the aperture */
};

static void set_subject(struct subject *x, const struct survey *s)
{
    processing_geometry(&x->geometry, s);
    x->band_hz[0] = fmin(s->chirp_start_hz, s->chirp_stop_hz);
    x->band_hz[1] = fmax(s->chirp_start_hz, s->chirp_stop_hz);
    geometry_aperture(&x->geometry, x->low, x->high);
}

static void print_cm(double m)
{
    if (isfinite(m))
        printf(" %8.2f", 100.0 * m);
    else
        printf(" %8s", "-");
}

static void print_row(const struct subject *x, const double at[3], double range_m)
{
    double times[3], image[3];
    resolution_finest_m(&x->geometry, resolution_gamma_s(x->band_hz), at, times);
    geometry_resolution_at(&x->geometry, x->band_hz, at, image);
    if (isfinite(range_m))
        printf("%9.2f", range_m);
    else
        printf("%9s", "middle");
    for (int a = 0; a < 3; a++)
        print_cm(times[a]);
    printf("   ");
    for (int a = 0; a < 3; a++)
        print_cm(image[a]);
    printf("\n");
}

static void print_table(const struct subject *x, const struct survey *s)
{
    static const double ranges_m[] = {0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0};
    double at[3];
    printf("band %g to %g Hz, %.1f m/s, midpoints over %.2f x %.2f x %.2f m\n",
           x->band_hz[0], x->band_hz[1], x->geometry.sound_speed_m_s,
           x->high[0] - x->low[0], x->high[1] - x->low[1], x->high[2] - x->low[2]);
    printf("%9s %26s   %27s\n", "", "Eq. 15, times alone", "coherent image, -6 dB");
    printf("%9s %8s %8s %8s    %8s %8s %8s\n", "range m", "x cm", "y cm", "z cm", "x cm",
           "y cm", "z cm");
    if (s->pings_m && s->has_volume) {
        for (int a = 0; a < 3; a++)
            at[a] = 0.5 * (s->volume_m[a][0] + s->volume_m[a][1]);
        print_row(x, at, NAN);
        return;
    }
    for (size_t i = 0; i < sizeof ranges_m / sizeof *ranges_m; i++) {
        at[0] = 0.5 * (x->low[0] + x->high[0]);
        at[1] = 0.5 * (x->low[1] + x->high[1]);
        at[2] = 0.5 * (x->low[2] + x->high[2]) + ranges_m[i];
        print_row(x, at, ranges_m[i]);
    }
}

/* A confocal pair at the origin and a scatterer LATERAL_M aside. */
static double confocal_cm(double gamma_s, double speed_m_s, double distance_m)
{
    static const double pair[3] = {0.0, 0.0, 0.0};
    const double at[3] = {LATERAL_M, 0.0, distance_m};
    return 100.0 * resolution_pair_m(gamma_s, speed_m_s, pair, pair, at, 0);
}

enum { ACOUSTIC = 3, CURVES = ACOUSTIC + 2 };

static int draw(const char *folder, const struct subject *x, struct error *why)
{
    static const double band_hz[ACOUSTIC] = {5e3, 9.5e3, 18e3};
    static const char *const names[CURVES] = {"sound, 5 kHz wide", "sound, 9.5 kHz",
                                              "sound, 18 kHz", "light, 60 ps",
                                              "this array, its finest pair, along x"};
    double distance_m[STEPS], resolution_cm[CURVES][STEPS];
    double c = x->geometry.sound_speed_m_s;
    struct chart_series series[CURVES];
    for (size_t i = 0; i < STEPS; i++) {
        double d = FAR_M * (double)(i + 1) / STEPS, own[3];
        const double at[3] = {0.5 * (x->low[0] + x->high[0]),
                              0.5 * (x->low[1] + x->high[1]),
                              0.5 * (x->low[2] + x->high[2]) + d};
        distance_m[i] = d;
        for (int k = 0; k < ACOUSTIC; k++)
            resolution_cm[k][i] = confocal_cm(0.5 / band_hz[k], c, d);
        resolution_cm[3][i] = confocal_cm(60e-12, RESOLUTION_LIGHT_M_S, d);
        resolution_finest_m(&x->geometry, resolution_gamma_s(x->band_hz), at, own);
        resolution_cm[4][i] = 100.0 * own[0];
    }
    for (int k = 0; k < CURVES; k++)
        series[k] = (struct chart_series){names[k],
                                          distance_m,
                                          resolution_cm[k],
                                          STEPS,
                                          k < ACOUSTIC ? CHART_LINE : CHART_DASHED,
                                          k == 4   ? 6
                                          : k == 3 ? 1
                                          : k == 1 ? 2
                                          : k == 2 ? 3
                                                   : 0};
    const struct chart chart = {
        .title = "Lateral resolution by the time of echoes, 0.5 m aside",
        .label = {"distance (m)", "lateral resolution (cm)"},
        .max = {FAR_M, ceil(resolution_cm[0][STEPS - 1] / 5.0) * 5.0},
        .series = series,
        .n_series = CURVES,
    };
    return export_chart(folder, "resolution", &chart, why);
}

static int draw_into(const char *out, const struct subject *x, struct error *why)
{
    struct export_stage stage;
    int err = export_stage_begin(&stage, out, why);
    if (err)
        return err;
    return export_stage_end(&stage, draw(stage.path, x, why), why);
}

int command_resolution(int argc, char **argv)
{
    struct usage usage = {.command = "resolution", .help = help, .options = options};
    const char *survey_path = NULL, *out = NULL;
    struct error why = {0};
    struct survey survey;
    struct subject x;
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        *(code == 's' ? &survey_path : &out) = optarg;
    if (code)
        return ~code;
    if (optind < argc)
        return usage_error("resolution", "%s: unexpected argument", argv[optind]);
    if (!survey_path)
        return usage_error("resolution", "--survey FILE is missing");
    int err = survey_load(&survey, survey_path, &why);
    if (!err) {
        set_subject(&x, &survey);
        print_table(&x, &survey);
        if (out)
            err = draw_into(out, &x, &why);
        if (out && !err)
            printf("%s: resolution.svg, resolution.png\n", out);
        survey_clear(&survey);
    }
    return usage_outcome("resolution", err, &why);
}
