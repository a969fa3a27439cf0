/* SPDX-License-Identifier: MIT */
/* Walls that bend, by geometry alone: ways over a line of heights, the shortest by
 * search. First what the wall finder tells of one, by 16 speakers and 16 microphones over
 * 1 m whose paths are off by 1 mm each: how often it is a wall, with what turn, and how
 * often round. Then how far off a plane shows whom such a wall mirrors, fitted to the
 * piece that an array of 1 m hears, or to all of it (its mean); and how far beyond what
 * is heard the wall would have to bend on to explain that by a turn: BEND_M of
 * recon/walls/wall_estimate.c.
 *
 *     bench_bends [DRAWS]        default: 20 */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "dsp/normal_equations.h"
#include "recon/walls/wall_estimate.h"

enum { ELEMENTS = 16, PAIRS = ELEMENTS * ELEMENTS, POINTS = 5001, WAVES = 100 };

#define FROM_M   (-4.0) /* along the wall, from the foot of the array */
#define STEP_M   0.002
#define LENGTH_M 0.3 /* of the Gaussian that makes a wavy wall of noise */

/* Heights away from the array, [POINTS]. */
struct facade {
    double height_m[POINTS];
};

static unsigned long long state = 1;

static double even(void)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return ((double)(state >> 11) + 0.5) / 9007199254740992.0;
}

static double normal(void)
{
    double u = even();
    return sqrt(-2.0 * log(u)) * cos(2.0 * M_PI * even());
}

static double along_m(size_t i)
{
    return FROM_M + STEP_M * (double)i;
}

/* curvature > 0: bulges towards the array. */
static void make_round(struct facade *f, double curvature)
{
    for (size_t i = 0; i < POINTS; i++) {
        double x = fmin(fabs(along_m(i) * curvature), 1.0);
        f->height_m[i] = curvature == 0.0 ? 0.0 : (1.0 - sqrt(1.0 - x * x)) / curvature;
    }
}

/* Waves of the spectrum that noise has which was smoothed by a Gaussian. */
static void make_wavy(struct facade *f, double rms_m)
{
    for (size_t i = 0; i < POINTS; i++)
        f->height_m[i] = 0.0;
    for (int k = 0; k < WAVES; k++) {
        double number = normal() / (M_SQRT2 * LENGTH_M), phase = 2.0 * M_PI * even();
        for (size_t i = 0; i < POINTS; i++)
            f->height_m[i] += rms_m * sqrt(2.0 / WAVES) *
                              cos(number * along_m(i) + phase);
    }
}

static double way_m(const struct facade *f, double distance_m, size_t i,
                    const double a[2], const double b[2])
{
    double x = along_m(i), z = distance_m + f->height_m[i];
    return hypot(x - a[0], z - a[1]) + hypot(x - b[0], z - b[1]);
}

/* The shortest way within reach_m of the foot, between points by a parabola; at: where.
 */
static double shortest_m(const struct facade *f, double distance_m, double reach_m,
                         const double a[2], const double b[2], size_t *at)
{
    size_t first = (size_t)((-reach_m - FROM_M) / STEP_M), best = first + 1;
    size_t last = (size_t)fmin((reach_m - FROM_M) / STEP_M, POINTS - 2);
    double least = INFINITY;

    for (size_t i = first + 1; i < last; i++) {
        double way = way_m(f, distance_m, i, a, b);
        best = way < least ? i : best;
        least = fmin(least, way);
    }
    double before = way_m(f, distance_m, best - 1, a, b);
    double after = way_m(f, distance_m, best + 1, a, b);
    double bend = before - 2.0 * least + after;
    if (at)
        *at = best;
    return least - 0.125 * (after - before) * (after - before) / bend;
}

/* -- what the finder tells --------------------------------------------------------------
 */
static void find(double radius_m, double distance_m, int draws)
{
    static struct facade f;
    struct wall_estimate_config cfg;
    double sigma = 0.0, error = 0.0;
    int n_walls = 0, n_round = 0;

    wall_estimate_default(&cfg);
    make_round(&f, isinf(radius_m) ? 0.0 : 1.0 / radius_m);
    for (int k = 0; k < draws; k++) {
        static struct wall_echo echoes[PAIRS];
        double off_m[2][ELEMENTS], turn = 0.3 * normal();
        double stands_m = distance_m + 0.2 * even();
        for (int i = 0; i < 2 * ELEMENTS; i++)
            off_m[i / ELEMENTS][i % ELEMENTS] = 1e-3 * normal();
        for (uint32_t i = 0; i < PAIRS; i++) {
            struct wall_echo *e = &echoes[i];
            *e = (struct wall_echo){.pair = i,
                                    .speaker = i / ELEMENTS,
                                    .microphone = i % ELEMENTS,
                                    .weight = 1.0};
            e->speaker_m[0] = -0.5 + (double)e->speaker / (ELEMENTS - 1);
            e->microphone_m[0] = -0.5 + ((double)e->microphone + 0.5) / ELEMENTS;
            /* in the frame of the wall's foot: the array is turned in place of the wall
             */
            const double s = e->speaker_m[0], m = e->microphone_m[0];
            const double from[2] = {s * cos(turn), s * sin(turn)};
            const double to[2] = {m * cos(turn), m * sin(turn)};
            e->path_m = shortest_m(&f, stands_m, 1.2, from, to, NULL) +
                        off_m[0][e->speaker] + off_m[1][e->microphone];
        }
        struct wall_estimates found;
        if (wall_estimate(&found, &cfg, echoes, PAIRS, PAIRS))
            exit(1);
        n_round += found.n_bent > 0;
        if (!found.n)
            continue;
        const struct wall *w = &found.list[0].wall;
        double off = atan2(w->normal[0], w->normal[2]) - turn;
        n_walls++;
        sigma += sqrt(w->covariance[0]);
        error += off * off;
    }
    const double degrees = 180.0 / M_PI;
    printf("%8.1f %8.0f %6d of %d %6d", radius_m, distance_m, n_walls, draws, n_round);
    if (n_walls)
        printf(" %12.2f %12.2f", degrees * sigma / n_walls,
               degrees * sqrt(error / n_walls));
    printf("\n");
}

/* -- where it shows whom ----------------------------------------------------------------
 */
struct plane { /* height_m + slope x */
    double height_m, slope, curvature_1_m;
};

/* The piece that the pairs of an array of 1 m hear, its middle by more of them. */
static struct plane piece_of(const struct facade *f)
{
    double a[9] = {0.0}, b[3] = {0.0};

    for (size_t i = 0; i < POINTS; i++) {
        double x = along_m(i), weight = 1.0 - 2.0 * fabs(x);
        const double terms[3] = {1.0, x, 0.5 * x * x};
        if (weight <= 0.0)
            continue;
        for (int p = 0; p < 3; p++) {
            b[p] += weight * terms[p] * f->height_m[i];
            for (int q = 0; q < 3; q++)
                a[3 * p + q] += weight * terms[p] * terms[q];
        }
    }
    normal_equations_solve(3, a, b, 0.0);
    return (struct plane){b[0], b[1], b[2]};
}

static void mirror(const struct plane *w, double distance_m, const double p[2],
                   double out[2])
{
    double length = hypot(1.0, w->slope);
    const double n[2] = {-w->slope / length, 1.0 / length};
    double beyond = n[0] * p[0] + n[1] * p[1] - (distance_m + w->height_m) / length;

    out[0] = p[0] - 2.0 * beyond * n[0];
    out[1] = p[1] - 2.0 * beyond * n[1];
}

static double apart_m(const double a[2], const double b[2])
{
    return hypot(a[0] - b[0], a[1] - b[1]);
}

static void place(const char *name, double radius_m, double rms_m, int draws)
{
    static struct facade f;
    static const struct plane mean = {0.0, 0.0, 0.0};
    static const double middle[2] = {0.0, 0.0};
    double by_piece = 0.0, by_mean = 0.0, turns = 0.0, bends = 0.0;
    int n = 0;

    make_round(&f, rms_m > 0.0 ? 0.0 : 1.0 / radius_m);
    for (int k = 0; k < 2 * draws; k++) {
        if (rms_m > 0.0)
            make_wavy(&f, rms_m);
        struct plane piece = piece_of(&f);
        double distance_m = 2.0 + 1.2 * even();
        for (int i = 1; i <= 5; i++, n++) {
            const double is_at[2] = {0.5 * i, distance_m - 0.8 - 0.8 * even()};
            double told[2], of_mean[2], of_turned[2];
            size_t at;
            double way = shortest_m(&f, distance_m, 4.0, middle, is_at, &at);
            double x = along_m(at), z = distance_m + f.height_m[at];
            const double imaged[2] = {way * x / hypot(x, z), way * z / hypot(x, z)};
            struct plane turned = piece;
            turned.slope += 0.01;
            mirror(&piece, distance_m, imaged, told);
            mirror(&mean, distance_m, imaged, of_mean);
            mirror(&turned, distance_m, imaged, of_turned);
            double turn = apart_m(told, is_at) / (apart_m(told, of_turned) / 0.01);
            by_piece += apart_m(told, is_at) * apart_m(told, is_at);
            by_mean += apart_m(of_mean, is_at) * apart_m(of_mean, is_at);
            turns += turn * turn;
            bends += piece.curvature_1_m * piece.curvature_1_m;
        }
    }
    printf("%-16s %10.1f %10.1f %12.3f %10.2f\n", name, 100.0 * sqrt(by_piece / n),
           100.0 * sqrt(by_mean / n), sqrt(bends / n), sqrt(turns / bends));
}

int main(int argc, char **argv)
{
    static const double radii_m[] = {INFINITY, 50.0, 20.0, 10.0, 5.0, 3.0,
                                     2.0,      1.0,  -20., -10., -6.7};
    char *end = NULL;
    long draws = argc > 1 ? strtol(argv[1], &end, 10) : 20;

    if (argc > 2 || draws < 1 || draws > 1000 || (end && *end)) {
        fprintf(stderr, "usage: bench_bends [DRAWS], 1 to 1000\n");
        return 2;
    }
    printf("radius, m  away, m   told a wall  round  its turn: sigma, error, degrees\n");
    for (size_t i = 0; i < sizeof radii_m / sizeof *radii_m; i++)
        for (int d = 1; d <= 3; d++)
            find(radii_m[i], d, (int)draws);
    printf("\na person shown off, cm:  by the piece  by the mean   curvature, 1/m   "
           "bends on, m\n");
    place("radius 3.3 m", 3.3, 0.0, (int)draws);
    place("radius 5 m", 5.0, 0.0, (int)draws);
    place("radius 10 m", 10.0, 0.0, (int)draws);
    place("radius -5 m", -5.0, 0.0, (int)draws);
    place("radius -10 m", -10.0, 0.0, (int)draws);
    place("wavy by 5 mm", 0.0, 0.005, (int)draws);
    place("wavy by 15 mm", 0.0, 0.015, (int)draws);
    return 0;
}
