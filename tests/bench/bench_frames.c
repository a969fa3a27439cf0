/* SPDX-License-Identifier: MIT */
/* A fixed array's frame rate against what its images are worth: speakers a frame, slots,
 * chirps, chirps that overlap or sound together, pings added by phase or by power, of a
 * point that stands and of one that walks 1.5 m/s, 45 degrees towards the array.  Then
 * the cost of an image.  Recordings are made sample by sample (tests/recon/moving.h).
 *
 *     bench_frames [quality|cost]...        default: both */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "recon/detection/peak.h"
#include "tests/recon/bumper.h"

enum { NEAR = 61, WIDE = 175, SUMS = 3 };

static const double walk_m_s = 1.5;

struct setting {
    size_t speakers;
    double chirp_s, slot_s;
    size_t together;
    bool alternates;
};

static const struct setting settings[] = {
    {1, 5e-3, 24e-3, 1, false},      {2, 5e-3, 24e-3, 1, false},
    {4, 5e-3, 24e-3, 1, false},      {8, 5e-3, 24e-3, 1, false},
    {16, 5e-3, 24e-3, 1, false},     {1, 2e-3, 24e-3, 1, false},
    {1, 10e-3, 24e-3, 1, false},     {1, 20e-3, 24e-3, 1, false},
    {1, 62.5e-3, 62.5e-3, 1, false}, {16, 62.5e-3, 62.5e-3, 1, false},
    {16, 62.5e-3, 24e-3, 1, false},  {16, 20e-3, 24e-3, 1, false},
    {16, 5e-3, 31.25e-3, 1, false},  {2, 5e-3, 24e-3, 1, true},
    {16, 5e-3, 24e-3, 1, true},      {2, 5e-3, 24e-3, 2, true},
    {2, 10e-3, 24e-3, 2, true},      {2, 20e-3, 24e-3, 2, true},
    {16, 5e-3, 24e-3, 2, true},      {16, 20e-3, 24e-3, 2, true},
};

struct look { /* by one way of adding pings */
    double level, off_m, late_off_m, width_m[2], sidelobe_db;
};

static double clock_s(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* -- quality ----------------------------------------------------------------------------
 */

static void lay_out(struct bumper *b, const struct setting *s, bool walks)
{
    bumper_default(b);
    bumper_elements(b, s->speakers, 16);
    b->world.chirp_s = s->chirp_s;
    b->slot_s = s->slot_s;
    b->together = s->together;
    b->alternates = s->alternates;
    b->crosstalk = true;
    b->reach_m = 4.0;
    b->world.at_m[0] = 3.5 + 2.5;
    if (walks) {
        b->world.velocity_m_s[0] = -sqrt(0.5) * walk_m_s;
        b->world.velocity_m_s[1] = -sqrt(0.5) * walk_m_s;
    }
}

/* The highest voxel that is farther from the peak than twice the widths. */
static double sidelobe_db(const struct bumper *b, const float *image,
                          const double peak_m[3], const double width_m[2], float level)
{
    const struct grid *g = &b->cfg.grid;
    float most = 0.0f;
    for (size_t v = 0; v < grid_size(g); v++) {
        double dx = g->origin_m[0] + g->step_m[0] * (double)(v % g->n[0]) - peak_m[0];
        double dz = g->origin_m[2] + g->step_m[2] * (double)(v / g->n[0]) - peak_m[2];
        double x = dx / (2.0 * width_m[0]), z = dz / (2.0 * width_m[1]);
        if (x * x + z * z > 1.0 && image[v] > most)
            most = image[v];
    }
    return 10.0 * log10(most / level);
}

/* Pings are imaged again and again from n recordings in memory. */
static void image(struct bumper *b, const struct frames_ping *pings, size_t n,
                  const struct frames_motion *motion, float *out)
{
    struct frames *f = bumper_frames(b);
    struct frames_made made;
    for (size_t k = 0; k < n; k++)
        frames_add(f, &pings[k]);
    frames_image(f, motion, out, &made);
    frames_destroy(f);
}

static double off_at(const struct bumper *b, double time_s, const double peak_m[3])
{
    double p[3];
    for (int a = 0; a < 3; a++)
        p[a] = b->world.at_m[a] + time_s * b->world.velocity_m_s[a];
    moving_to_array(&b->world, time_s, p, p);
    return hypot(p[0] - peak_m[0], p[2] - peak_m[2]);
}

static void look(struct bumper *b, const struct frames_ping *pings, size_t n,
                 const struct frames_motion *motion, struct look *out)
{
    static float near[NEAR * NEAR], wide[WIDE * WIDE];
    double at[3], peak[3], newest_s = bumper_time_s(b, n - 1);
    size_t best = 0;
    struct peak_fit fit;
    bumper_point(b, n - 1, at);
    bumper_look_at(b, at, NEAR, 0.01);
    image(b, pings, n, motion, near);
    for (size_t v = 0; v < NEAR * NEAR; v++)
        best = near[v] > near[best] ? v : best;
    peak_fit(&b->cfg.grid, near, best, 1e3, PEAK_ZERO_EMPTY, NULL, &fit);
    memcpy(peak, fit.position_m, sizeof peak);
    out->level = near[best];
    out->width_m[0] = fit.width_m[0];
    out->width_m[1] = fit.width_m[2];
    out->off_m = off_at(b, newest_s, peak);
    /* A ping shows what moves where it was when its delays are of, plus the way there. */
    double instant_s = 0.0;
    for (size_t k = 0; k < n; k++)
        instant_s +=
            (bumper_time_s(b, k) + frames_delay_instant_s(&b->cfg, pings[k].down)) /
            (double)n;
    out->late_off_m = off_at(
        b, instant_s + geometry_distance(at, (double[3]){0}) / b->world.sound_speed_m_s,
        peak);
    bumper_look_at(b, (const double[3]){0.0, at[1], 2.2}, WIDE, 0.02);
    image(b, pings, n, motion, wide);
    out->sidelobe_db = sidelobe_db(b, wide, peak, out->width_m, near[best]);
}

static struct frames_ping *record(struct bumper *b, size_t n)
{
    size_t size = b->geometry.n_microphones * b->cfg.format.n_samples;
    struct frames_ping *pings = calloc(n, sizeof *pings);
    for (size_t k = 0; pings && k < n; k++) {
        bumper_ping(b, k, &pings[k]);
        float complex *own = malloc(size * sizeof *own);
        if (!own)
            abort();
        memcpy(own, pings[k].traces, size * sizeof *own);
        pings[k].traces = own;
    }
    if (!pings)
        abort();
    return pings;
}

static void run(const struct setting *s, bool walks, const double standing[SUMS],
                double levels[SUMS])
{
    static const char *const names[SUMS] = {"coherent", "power", "velocity"};
    struct bumper b;
    lay_out(&b, s, walks);
    bumper_start(&b);
    struct frames_ping *pings = record(&b, s->speakers);
    for (int sum = 0; sum < (walks ? SUMS : 2); sum++) {
        struct look l;
        const double velocity[3] = {b.world.velocity_m_s[1], 0.0,
                                    b.world.velocity_m_s[0]};
        for (int a = 0; a < 3; a++)
            b.motion.velocity_m_s[a] = sum == 2 ? velocity[a] : 0.0;
        b.cfg.sum = sum == 1 ? FRAMES_POWER : FRAMES_COHERENT;
        look(&b, pings, s->speakers, &b.motion, &l);
        levels[sum] = l.level;
        printf("%4zu  %5.1f  %5.1f  %s  %5.1f  %5.1f  %-6s %-8s  %6.1f  %6.1f  %5.0f"
               "  %5.0f  %6.1f  %6.1f\n",
               s->speakers, 1e3 * s->chirp_s, 1e3 * s->slot_s,
               s->together > 1 ? "both"
               : s->alternates ? "u/d "
                               : "up  ",
               (double)s->together / s->slot_s,
               (double)s->together / s->slot_s / (double)s->speakers,
               walks ? "walks" : "stands", names[sum], 1e3 * l.off_m, 1e3 * l.late_off_m,
               1e3 * l.width_m[0], 1e3 * l.width_m[1], l.sidelobe_db,
               standing ? 10.0 * log10(l.level / standing[sum % 2]) : 0.0);
    }
    fflush(stdout);
    for (size_t k = 0; k < s->speakers; k++)
        free((void *)(uintptr_t)pings[k].traces);
    free(pings);
    bumper_stop(&b);
}

static void quality(void)
{
    printf("16 microphones on 1 m, point at 2.5 m; images/s: a ping, a frame; mm: off at "
           "the stamp,\nat the instant that pings show; -6 dB widths across, deep; dB: "
           "side lobes, against standing\n"
           "spk.  chirp   slot  dir.  ping/s  frm/s  point  added        off    then"
           "  width  depth   lobes   level\n");
    for (size_t s = 0; s < sizeof settings / sizeof *settings; s++) {
        double standing[SUMS], walking[SUMS];
        run(&settings[s], false, NULL, standing);
        run(&settings[s], true, standing, walking);
    }
}

/* -- cost -------------------------------------------------------------------------------
 */

struct cost {
    double wall_s, cpu_s;
};

/* Of an image for each new ping, the least of some. */
static struct cost cost_of(struct bumper *b, const struct frames_ping *ping,
                           const struct frames_motion *motion, float *out)
{
    struct frames *f = bumper_frames(b);
    struct cost least = {1e9, 1e9};
    for (size_t k = 0; k < b->cfg.n_pings + 40; k++) {
        struct frames_ping next = *ping;
        struct frames_made made;
        next.stamp_ns += (int64_t)k * 24000000;
        next.speaker = k % b->geometry.n_speakers;
        double wall = -clock_s(CLOCK_MONOTONIC), cpu = -clock_s(CLOCK_PROCESS_CPUTIME_ID);
        frames_add(f, &next);
        frames_image(f, motion, out, &made);
        wall += clock_s(CLOCK_MONOTONIC);
        cpu += clock_s(CLOCK_PROCESS_CPUTIME_ID);
        if (k < b->cfg.n_pings)
            continue;
        least.wall_s = fmin(least.wall_s, wall);
        least.cpu_s = fmin(least.cpu_s, cpu);
    }
    frames_destroy(f);
    return least;
}

static void cost(void)
{
    struct bumper b;
    struct frames_ping ping;
    lay_out(&b, &settings[4], false);
    b.world.speed_m_s = 2.0;
    bumper_drive(&b);
    bumper_start(&b);
    bumper_ping(&b, 0, &ping);
    bumper_look_at(&b, (const double[3]){0.0, 0.0, 2.0}, 200, 0.02);
    b.cfg.grid.n[2] = 330;
    b.cfg.grid.step_m[2] = 0.01;
    b.cfg.grid.origin_m[2] = 0.7;
    float *out = malloc(grid_size(&b.cfg.grid) * sizeof *out);
    if (!out)
        abort();
    printf("\ncost of an image of 200 x 330 voxels, 16 microphones, 2 threads\n"
           "pings  added     vehicle   ms wall  ms CPU  images/s of a core  G pairs/CPU "
           "s\n");
    for (size_t n = 1; n <= 16; n *= 2) {
        for (int k = 0; k < 4; k++) {
            bool drives = k % 2;
            b.cfg.n_pings = n;
            b.cfg.sum = k / 2 ? FRAMES_POWER : FRAMES_COHERENT;
            struct cost c = cost_of(&b, &ping, drives ? &b.motion : NULL, out);
            double pairs = (drives ? (double)n : 1.0) * 16.0 *
                           (double)grid_size(&b.cfg.grid);
            printf("%5zu  %-8s  %-8s  %7.2f  %6.2f  %18.0f  %13.2f\n", n,
                   k / 2 ? "power" : "coherent", drives ? "drives" : "stands",
                   1e3 * c.wall_s, 1e3 * c.cpu_s, 1.0 / c.cpu_s, 1e-9 * pairs / c.cpu_s);
            fflush(stdout);
        }
    }
    free(out);
    bumper_stop(&b);
}

static bool wanted(const char *name, int argc, char **argv)
{
    for (int i = 1; i < argc; i++)
        if (strcmp(argv[i], name) == 0)
            return true;
    return argc < 2;
}

int main(int argc, char **argv)
{
    if (wanted("quality", argc, argv))
        quality();
    if (wanted("cost", argc, argv))
        cost();
    return 0;
}
