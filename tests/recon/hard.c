/* SPDX-License-Identifier: MIT */
#include "tests/recon/hard.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "tests/recon/near.h"

#define POSITIONS 10
#define PLACES    8

/* Of PLACES around the middle, from the inside out: 0, 1, -1, 2, ... */
static double from_inside(size_t e, double pitch_m)
{
    double steps = (double)((e + 1) / 2);
    return pitch_m * (e % 2 ? steps : -steps);
}

void hard_create(struct hard *h, double sound_speed_m_s, size_t n_positions,
                 size_t n_speakers, size_t n_microphones)
{
    struct rig *r = &h->rig;
    rig_default(r);
    r->geometry.sound_speed_m_s = sound_speed_m_s;
    r->geometry.n_positions = n_positions;
    r->geometry.n_speakers = n_speakers;
    r->geometry.n_microphones = n_microphones;
    for (size_t k = 0; k < POSITIONS; k++)
        r->positions_m[k] = from_inside(k, 0.06);
    for (size_t e = 0; e < PLACES; e++) {
        r->speakers_m[e][0] = -0.015;
        r->microphones_m[e][0] = 0.015;
        r->speakers_m[e][1] = r->microphones_m[e][1] = from_inside(e, 0.07);
    }
    rig_listen(r, 0.7, 1.75);
    rig_look_at(r, 0.02, -0.01, 1.1, 13, 0.0125);
    r->grid.step_m[2] = 0.006;
    r->grid.origin_m[2] = 1.1 - 6 * 0.006;
    h->point = (struct scatterer){{0.023, -0.018, 1.103}, 1.0};
    h->traces =
        malloc(hard_pings(h) * n_microphones * r->format.n_samples * sizeof *h->traces);
    assert_non_null(h->traces);
    for (size_t p = 0; p < hard_pings(h); p++)
        rig_ping(r, p / n_speakers, p % n_speakers, &h->point, 1, hard_trace(h, p, 0));
}

void hard_clear(struct hard *h)
{
    free(h->traces);
}

size_t hard_pings(const struct hard *h)
{
    return h->rig.geometry.n_positions * h->rig.geometry.n_speakers;
}

float complex *hard_trace(const struct hard *h, size_t ping, size_t microphone)
{
    size_t trace = ping * h->rig.geometry.n_microphones + microphone;
    return h->traces + trace * h->rig.format.n_samples;
}

float *hard_image(const struct hard *h, const char *method, const bool *masked)
{
    size_t n_speakers = h->rig.geometry.n_speakers;
    struct pool *pool;
    struct imager *im = NULL;
    const char *why = "";
    float *image = NULL;
    assert_int_equal(pool_create(&pool, 1), 0);
    int err = rig_try(&h->rig, method, pool, &im, &why);
    if (err) {
        if (err != -ENOTSUP || strlen(why) < 10)
            fail_msg("%s: %s (%s)", method, strerror(-err), why);
    } else {
        for (size_t p = 0; p < hard_pings(h); p++)
            assert_true(imager_add(im, p / n_speakers, p % n_speakers,
                                   hard_trace(h, p, 0), masked));
        image = malloc(grid_size(&h->rig.grid) * sizeof *image);
        assert_non_null(image);
        imager_image(im, image);
    }
    imager_destroy(im);
    pool_destroy(pool);
    return image;
}

void hard_every_method(void (*check)(const char *method))
{
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
        check(m);
}

void hard_limits(const char *method, struct hard_limits *out)
{
    static const struct {
        const char *method;
        struct hard_limits limits;
    } known[] = {
        /* Half the shortest wave: of a lone pair all waves within the volume's cone are
         * in phase deeper than its echo is, by r sin(a)^2 / 4. */
        {"fast", {0.001, 0.0005, 0.001, 0.006, 0.0086}},
        {"confocal",
         {0.08, 0.006, 0.030, 0.030, 0.030}}, /* shows a point as seen, not focused */
        {"lct", {0.015, 0.003, 0.005, 0.005, 0.005}},
        {"paper", {0.015, 0.003, 0.005, 0.010, 0.010}},
        {"incoherent", {0.006, 0.001, 0.002, 0.004, 0.004}},
        /* Half a voxel and a little; the PSF wants an aperture in both axes. */
        {"iterative", {0.0075, 0.0035, 0.0075, 0.015, 0.015}},
        {"sparse", {0.0075, 0.0035, 0.0075, 0.0075, 0.0075}},
    };
    *out = (struct hard_limits){0.001, 0.0005, 0.001, 0.006, 0.006};
    for (size_t q = 0; q < sizeof known / sizeof *known; q++)
        if (strcmp(known[q].method, method) == 0)
            *out = known[q].limits;
}

/* Fails the test, naming the method. */
static void expect_below(const char *method, const char *what, double value, double limit)
{
    if (!(value <= limit))
        fail_msg("%s: %s %.3g, not within %.3g", method, what, value, limit);
}

static void expect_image(const struct hard *h, const char *method, const float *image,
                         double peak_m[3])
{
    struct peak_fit fit;
    size_t best = 0;
    for (size_t v = 0; v < grid_size(&h->rig.grid); v++) {
        if (!(isfinite(image[v]) && image[v] >= 0.0f))
            fail_msg("%s: voxel %zu is %g", method, v, image[v]);
        best = image[v] > image[best] ? v : best;
    }
    if (!(image[best] > 0.0f))
        fail_msg("%s: the image is dark", method);
    peak_fit(&h->rig.grid, image, best, 1000.0, PEAK_ZERO_EMPTY, NULL, &fit);
    memcpy(peak_m, fit.position_m, 3 * sizeof *peak_m);
}

static double path_error_m(const struct hard *h, const double at_m[3])
{
    const struct geometry *g = &h->rig.geometry;
    double sum = 0.0;
    for (size_t p = 0; p < hard_pings(h); p++) {
        for (size_t i = 0; i < g->n_microphones; i++) {
            double s[3], m[3];
            for (int a = 0; a < 3; a++) {
                double moved = g->stage_axis[a] * g->stage_positions_m[p / g->n_speakers];
                s[a] = g->speakers_m[p % g->n_speakers][a] + moved;
                m[a] = g->microphones_m[i][a] + moved;
            }
            const double *truth = h->point.at_m;
            double error = reference_distance(s, at_m) + reference_distance(m, at_m) -
                           reference_distance(s, truth) - reference_distance(m, truth);
            sum += error * error;
        }
    }
    return sqrt(sum / (double)(hard_pings(h) * g->n_microphones));
}

void hard_expect_paths(const struct hard *h, const char *method, const float *image)
{
    struct hard_limits limits;
    double peak_m[3];
    hard_limits(method, &limits);
    expect_image(h, method, image, peak_m);
    bool lone = hard_pings(h) * h->rig.geometry.n_microphones == 1;
    expect_below(method, "path", path_error_m(h, peak_m),
                 lone ? limits.pair_path_m : limits.thin_path_m);
}

void hard_expect_point(const struct hard *h, const char *method, const float *image)
{
    struct hard_limits limits;
    double peak_m[3];
    hard_limits(method, &limits);
    expect_image(h, method, image, peak_m);
    for (int a = 0; a < 3; a++)
        expect_below(method, a < 2 ? "lateral" : "depth",
                     fabs(peak_m[a] - h->point.at_m[a]),
                     a < 2 ? limits.lateral_m : limits.depth_m);
    expect_below(method, "path", path_error_m(h, peak_m), limits.path_m);
}
