/* SPDX-License-Identifier: MIT */
#include "recon/static_array/velocity_filter.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "dsp/vector.h"

#define BRIGHT      20.0 /* over the median of the image of the ping in the middle */
#define POWER       10.0 /* over that median, of all pings in phase: bright enough */
#define RESTS       0.56 /* of the power of single pings: in phase for the most part */
#define OVER_REST   2.5  /* times as bright along a course: moves, */
#define SLOWEST_M_S 0.5  /* if it is faster */
#define FASTEST_M_S 2.4

/* Of what stands out where what stands was taken away: */
#define DRIVES_M_S 6.0
#define DRIVES_S   0.11 /* of the newest pings */
enum { BRIGHTEST = 4 }; /* places */

/* How often a course is right: the logarithm of its odds, by how much brighter it is than
 * the brightest that is another one, and by how bright it is.  (1900 courses of cars and
 * cyclists in another simulator.) */
#define OTHER_ALONG_M_S  0.3
#define OTHER_ACROSS_M_S 1.2
#define SURE             0.4
#define SURE_BRIGHTER    3.6
#define SURE_POWER       0.46
#define SURE_OF          100.0
#define MOST_SURE        0.98

/* About a place, across and along the sight of it.  Along, a third of a wavelength apart
 * at 20 kHz; a course's two ends are laid out in the same way. */
#define ACROSS_RAD 0.015 /* half of a wave at 11 kHz over a metre of microphones */
#define ACROSS_M   0.06  /* at most, */
#define FINEST_M   0.03  /* and at least */
#define END_ACROSS 0.8   /* of that */
enum { ALONG_MM = 5, END_ALONG_MM = 6 };
#define ALONG_M     (1e-3 * ALONG_MM)
#define END_ALONG_M (1e-3 * END_ALONG_MM)
enum { ACROSS = 2, ALONG = 4, N_ACROSS = 2 * ACROSS + 1, N_ALONG = 2 * ALONG + 1 };
enum { ENDS_ACROSS = 24, ENDS_ALONG = 96 };

/* What rests shows courses within so many steps of its own. */
#define REST_STEPS 0.8

#define HEIGHT_M 0.2
enum { HEIGHTS = 11 };

#define TURN_RAD 0.03
#define PLANE_M  0.012
enum { TURNS = 9, PLANES = 17 };

#define LOBE     2.0 /* so much brighter, and so near in range */
#define LOBE_M   0.08
#define FAR_LOBE 12.0 /* the same of what may be nearer or farther */
#define SAME_M   0.3
enum { PLACES_MAX = 64, PEAK_X = 3, PEAK_Z = 6 };

/* The part of the image that all courses of a place lie in, and where these bend. */
#define NEAREST_M 0.5
enum { BENT_MM = 200 };
#define BENT_M (1e-3 * BENT_MM)
enum { COLUMNS = 2 * (ACROSS + 3 + ENDS_ACROSS * 4 / 5) };
enum { ROWS = 2 * (ALONG + 3 + (ENDS_ALONG * END_ALONG_MM + BENT_MM) / ALONG_MM) };
enum { PATCH = COLUMNS * ROWS };
enum { LANES = 8 }; /* N_ACROSS of them count */

struct velocity_filter {
    struct velocity_filter_config cfg;
    struct frames_look *looks;
    size_t n_looks;
    bool taken; /* what stands: what stands out may drive */
    double middle_s, half_s;
    double aside_m; /* of a ping's middle from that of all, at most */
    double
        unlike_s; /* of the instants that chirps that run up and down are heard as of */
    float *alone, *scratch;             /* [voxels] */
    double (*at_m)[3];                  /* [PATCH] */
    float *echoes;                      /* [n_pings][re, im][PATCH] */
    float (*patch)[2][COLUMNS + LANES]; /* [ROWS] of one ping */
    float (*mixed)[2][LANES];           /* [ROWS] between columns of it */
    float (*sums)[2][LANES];            /* [courses][N_ALONG] */
};

int velocity_filter_create(struct velocity_filter **out,
                           const struct velocity_filter_config *cfg)
{
    if (cfg->grid.n[1] != 1)
        return -ENOTSUP;
    struct velocity_filter *v = calloc(1, sizeof *v);
    if (!v)
        return -ENOMEM;
    v->cfg = *cfg;
    v->looks = calloc(cfg->n_pings, sizeof *v->looks);
    v->alone = calloc(grid_size(&cfg->grid), sizeof *v->alone);
    v->scratch = calloc(grid_size(&cfg->grid), sizeof *v->scratch);
    v->at_m = calloc(PATCH, sizeof *v->at_m);
    v->echoes = calloc(cfg->n_pings * 2 * (size_t)PATCH, sizeof *v->echoes);
    v->patch = calloc(ROWS, sizeof *v->patch);
    v->mixed = calloc(ROWS, sizeof *v->mixed);
    v->sums = calloc((size_t)(2 * ENDS_ACROSS + 1) * (2 * ENDS_ALONG + 1) * N_ALONG,
                     sizeof *v->sums);
    if (v->looks && v->alone && v->scratch && v->at_m && v->echoes && v->patch &&
        v->mixed && v->sums) {
        *out = v;
        return 0;
    }
    velocity_filter_destroy(v);
    return -ENOMEM;
}

void velocity_filter_destroy(struct velocity_filter *v)
{
    if (!v)
        return;
    free(v->looks);
    free(v->alone);
    free(v->scratch);
    free(v->at_m);
    free(v->echoes);
    free(v->patch);
    free(v->mixed);
    free(v->sums);
    free(v);
}

/* -- the sight of a place ---------------------------------------------------------------
 */

struct sight {
    double from_m[3]; /* the middle of the array in the middle of the pings' time */
    double y_m, range_m, angle_rad;
    double across_m, end_across_m; /* steps */
    double ego_m_s[2];             /* of the array over ground: across, along */
};

static void find_sight(const struct velocity_filter *v, const double at_m[3],
                       struct sight *out)
{
    double ego_m_s[3] = {0.0};

    *out = (struct sight){.y_m = at_m[1]};
    for (size_t k = 0; k < v->n_looks; k++)
        for (int a = 0; a < 3; a++) {
            out->from_m[a] += v->looks[k].middle_m[a] / (double)v->n_looks;
            ego_m_s[a] += v->looks[k].velocity_m_s[a] / (double)v->n_looks;
        }
    double x_m = at_m[0] - out->from_m[0], z_m = at_m[2] - out->from_m[2];
    out->range_m = hypot(x_m, z_m);
    out->angle_rad = atan2(x_m, z_m);
    out->across_m = fmin(fmax(ACROSS_RAD * out->range_m, FINEST_M), ACROSS_M);
    out->end_across_m = END_ACROSS * out->across_m;
    double sine = sin(out->angle_rad), cosine = cos(out->angle_rad);
    out->ego_m_s[0] = ego_m_s[0] * cosine - ego_m_s[2] * sine;
    out->ego_m_s[1] = ego_m_s[0] * sine + ego_m_s[2] * cosine;
}

/* As far from the array whatever its height over the plane of the image. */
static void place(const struct sight *s, double across_m, double along_m, double up_m,
                  double out[3])
{
    double range_m = s->range_m + along_m;
    double flat_m = sqrt(fmax(range_m * range_m - up_m * up_m, 0.0));
    double angle_rad = s->angle_rad + across_m / s->range_m;

    out[0] = s->from_m[0] + flat_m * sin(angle_rad);
    out[1] = s->y_m + up_m;
    out[2] = s->from_m[2] + flat_m * cos(angle_rad);
}

/* -- what stands ------------------------------------------------------------------------
 */

/* The brightest of n places, all pings in phase. */
static double brightest(struct velocity_filter *v, struct frames *f,
                        enum frames_thing thing, size_t n)
{
    double most = 0.0;

    frames_echoes(f, thing, v->at_m, n, v->echoes);
    for (size_t i = 0; i < n; i++) {
        double re = 0.0, im = 0.0;
        for (size_t k = 0; k < v->n_looks; k++) {
            re += (double)v->echoes[2 * k * n + i];
            im += (double)v->echoes[(2 * k + 1) * n + i];
        }
        most = fmax(most, re * re + im * im);
    }
    return most;
}

static double rests(struct velocity_filter *v, struct frames *f, const struct sight *s)
{
    size_t n = 0;

    for (int h = 0; h < HEIGHTS; h++)
        for (int across = -ACROSS; across <= ACROSS; across++)
            for (int along = -ALONG; along <= ALONG; along++)
                if (HEIGHT_M * h < s->range_m)
                    place(s, s->across_m * across, ALONG_M * along, HEIGHT_M * h,
                          v->at_m[n++]);
    return brightest(v, f, FRAMES_SCATTERER, n);
}

static double mirrors(struct velocity_filter *v, struct frames *f, const struct sight *s)
{
    size_t n = 0;

    for (int turn = -TURNS / 2; turn <= TURNS / 2; turn++)
        for (int along = -PLANES / 2; along <= PLANES / 2; along++)
            place(s, TURN_RAD * turn * s->range_m, PLANE_M * along, 0.0, v->at_m[n++]);
    return brightest(v, f, FRAMES_PLANE, n);
}

/* -- what moves -------------------------------------------------------------------------
 */

/* Courses, by the steps of their ends. */
struct courses {
    int across, along; /* to each side */
    int columns, rows; /* of the patch, to each side */
};

static int steps(double way_m, double step_m, int most)
{
    return (int)fmin(fmax(ceil(way_m / step_m), 1.0), most);
}

/* Across the sight is farther away. */
static double bent_m(const struct sight *s, double across_m)
{
    return 0.5 * across_m * across_m / s->range_m;
}

/* One column and row more than courses reach: they pass between them. */
static struct courses choose_courses(const struct velocity_filter *v,
                                     const struct sight *s)
{
    double way_m = (v->taken ? DRIVES_M_S : FASTEST_M_S) * v->half_s;
    double across_m = fmin(way_m, sqrt(2.0 * s->range_m * BENT_M) - s->end_across_m);
    struct courses c = {.across = steps(across_m, s->end_across_m, ENDS_ACROSS),
                        .along = steps(way_m, END_ALONG_M, ENDS_ALONG)};
    double end_across_m = s->end_across_m * c.across;
    double aside_m = bent_m(s, end_across_m) + DRIVES_M_S * v->unlike_s;
    int most = (int)((END_ALONG_M * ENDS_ALONG + BENT_M - aside_m) / END_ALONG_M);
    c.along = c.along < most ? c.along : most;
    double end_along_m = END_ALONG_M * c.along + aside_m;

    c.columns = ACROSS + 1 + steps(end_across_m, s->across_m, COLUMNS / 2);
    c.rows = ALONG + 1 + steps(end_along_m, ALONG_M, ROWS / 2);
    return c;
}

static void look_about(struct velocity_filter *v, struct frames *f, const struct sight *s,
                       const struct courses *c)
{
    size_t n = 0;

    for (int across = -c->columns; across <= c->columns; across++)
        for (int along = -c->rows; along <= c->rows; along++)
            place(s, s->across_m * across, ALONG_M * along, 0.0, v->at_m[n++]);
    frames_echoes(f, FRAMES_SCATTERER, v->at_m, n, v->echoes);
}

/* Turns of the phase from place to place, which are taken out between places and put back
 * along courses: what is left of it changes slowly. */
struct turns {
    double across, along; /* per metre */
    double complex step;  /* from row to row */
};

static struct turns turns_of(const struct velocity_filter *v, const struct sight *s,
                             const struct frames_look *look)
{
    double aside_m = (look->middle_m[0] - s->from_m[0]) * cos(s->angle_rad) -
                     (look->middle_m[2] - s->from_m[2]) * sin(s->angle_rad);

    double along = 2.0 * v->cfg.turns_per_m;
    return (struct turns){.across = -along * aside_m / s->range_m,
                          .along = along,
                          .step = cexp(2.0 * M_PI * I * along * ALONG_M)};
}

static void take_patch(struct velocity_filter *v, const struct sight *s,
                       const struct courses *c, size_t look, const struct turns *turns)
{
    size_t rows = 2 * (size_t)c->rows + 1, columns = 2 * (size_t)c->columns + 1;
    const float *re = v->echoes + 2 * look * rows * columns, *im = re + rows * columns;

    for (size_t x = 0; x < columns; x++) {
        double across_m = s->across_m * ((double)x - c->columns);
        double complex back =
            cexp(-2.0 * M_PI * I *
                 (turns->across * across_m - turns->along * ALONG_M * c->rows));
        for (size_t z = 0; z < rows; z++, back *= conj(turns->step)) {
            double complex e = ((double)*re++ + I * (double)*im++) * back;
            v->patch[z][0][x] = (float)creal(e);
            v->patch[z][1][x] = (float)cimag(e);
        }
    }
}

/* The patch between columns, from ACROSS steps before across_m on, turned back. */
static void mix_columns(struct velocity_filter *v, const struct sight *s,
                        const struct courses *c, const struct turns *turns,
                        double across_m)
{
    double column = across_m / s->across_m + c->columns - ACROSS;
    size_t x = (size_t)column;
    float right = (float)(column - (double)x), turn_re[LANES], turn_im[LANES];

    double complex step = cexp(2.0 * M_PI * I * turns->across * s->across_m);
    double complex turn =
        cexp(2.0 * M_PI * I * turns->across * (across_m - s->across_m * ACROSS));
    for (int i = 0; i < LANES; i++, turn *= step) {
        turn_re[i] = (float)creal(turn);
        turn_im[i] = (float)cimag(turn);
    }
    for (size_t z = 0; z < 2 * (size_t)c->rows + 1; z++) {
        const float *re = v->patch[z][0] + x, *im = v->patch[z][1] + x;
        for (int i = 0; i < LANES; i++) {
            float a = re[i] + right * (re[i + 1] - re[i]);
            float b = im[i] + right * (im[i + 1] - im[i]);
            v->mixed[z][0][i] = a * turn_re[i] - b * turn_im[i];
            v->mixed[z][1][i] = a * turn_im[i] + b * turn_re[i];
        }
    }
}

/* To sums[N_ALONG], between rows. */
VECTOR_CLONES
static void add_rows(float (*restrict rows)[2][LANES], float far, const float (*turn)[2],
                     float (*restrict sums)[2][LANES])
{
    for (int a = 0; a < N_ALONG; a++)
        for (int i = 0; i < LANES; i++) {
            float re = rows[a][0][i] + far * (rows[a + 1][0][i] - rows[a][0][i]);
            float im = rows[a][1][i] + far * (rows[a + 1][1][i] - rows[a][1][i]);
            sums[a][0][i] += re * turn[a][0] - im * turn[a][1];
            sums[a][1][i] += re * turn[a][1] + im * turn[a][0];
        }
}

/* A chirp's echo is as far away as what made it was later than its phase tells, when it
 * ran up, and earlier when it ran down. */
static double later_s(const struct velocity_filter *v, size_t look)
{
    double hz = v->cfg.turns_per_m * v->cfg.sound_speed_m_s;

    return v->taken ? hz * (v->looks[look].sweep_s_hz - v->looks[0].sweep_s_hz) : 0.0;
}

/* One ping, along courses that end alike, heard so much farther away than there. */
static void add_courses(struct velocity_filter *v, const struct courses *c,
                        const struct turns *turns, double along_m, double farther_m,
                        float (*sums)[2][LANES])
{
    double row = (along_m + farther_m) / ALONG_M + c->rows - ALONG;
    size_t z = (size_t)row;
    double start = turns->along * (along_m - ALONG_M * ALONG);
    double complex turn = cexp(2.0 * M_PI * I * start);
    float turned[N_ALONG][2];

    for (int a = 0; a < N_ALONG; a++, turn *= turns->step) {
        turned[a][0] = (float)creal(turn);
        turned[a][1] = (float)cimag(turn);
    }
    add_rows(v->mixed + z, (float)(row - (double)z), turned, sums);
}

struct course {
    int end_across, end_along, across, along; /* steps */
    double power, other;                      /* of the brightest that is another one */
};

/* What rests over a line array's plane, under it or behind it comes nearer as slowly as
 * the cosine of its elevation has it: over ground it seems to go with the vehicle, up to
 * twice as fast as that.  All in steps, of which those along the sight are far finer. */
static bool may_rest(const struct velocity_filter *v, const struct sight *s, int across,
                     int along)
{
    double x = s->ego_m_s[0] * v->half_s / s->end_across_m;
    double z = s->ego_m_s[1] * v->half_s / END_ALONG_M;
    double way2 = x * x + z * z;
    double part = way2 > 0.0 ? (across * x + along * z) / way2 : 0.0;

    part = fmin(fmax(part, 0.0), 2.0);
    return fabs(across - part * x) < REST_STEPS && fabs(along - part * z) < REST_STEPS;
}

/* Of all places about one, along courses that end alike. */
VECTOR_CLONES
static float most_of(const float (*restrict sums)[2][LANES])
{
    float lanes[LANES] = {0.0f}, most = 0.0f;

    for (int a = 0; a < N_ALONG; a++)
        for (int i = 0; i < LANES; i++) {
            float power = sums[a][0][i] * sums[a][0][i] + sums[a][1][i] * sums[a][1][i];
            lanes[i] = power > lanes[i] ? power : lanes[i];
        }
    for (int i = 0; i < N_ACROSS; i++)
        most = lanes[i] > most ? lanes[i] : most;
    return most;
}

/* The place of that many. */
static void find_place(const float (*sums)[2][LANES], struct course *c)
{
    float most = -1.0f;

    for (int a = 0; a < N_ALONG; a++)
        for (int i = 0; i < N_ACROSS; i++) {
            float power = sums[a][0][i] * sums[a][0][i] + sums[a][1][i] * sums[a][1][i];
            if (power <= most)
                continue;
            most = power;
            c->across = i - ACROSS;
            c->along = a - ALONG;
        }
}

/* And the most of what may rest. */
static struct course brightest_course(const struct velocity_filter *v,
                                      const struct sight *s, const struct courses *c,
                                      double *at_rest)
{
    struct course best = {.power = -1.0};
    const float(*sums)[2][LANES] = (const void *)v->sums, (*where)[2][LANES] = sums;

    for (int x = -c->across; x <= c->across; x++)
        for (int z = -c->along; z <= c->along; z++, sums += N_ALONG) {
            double power = (double)most_of(sums);
            if (may_rest(v, s, x, z))
                *at_rest = fmax(*at_rest, power);
            if (power <= best.power)
                continue;
            best = (struct course){.end_across = x, .end_along = z, .power = power};
            where = sums;
        }
    find_place(where, &best);
    return best;
}

static double brightest_other(const struct velocity_filter *v, const struct sight *s,
                              const struct courses *c, const struct course *best)
{
    const float(*sums)[2][LANES] = (const void *)v->sums;
    int across = (int)(OTHER_ACROSS_M_S * v->half_s / s->end_across_m);
    int along = (int)(OTHER_ALONG_M_S * v->half_s / END_ALONG_M);
    double most = 0.0;

    for (int x = -c->across; x <= c->across; x++)
        for (int z = -c->along; z <= c->along; z++, sums += N_ALONG)
            if (abs(x - best->end_across) > across || abs(z - best->end_along) > along)
                most = fmax(most, (double)most_of(sums));
    return most;
}

static struct course follow(struct velocity_filter *v, struct frames *f,
                            const struct sight *s, const struct courses *c,
                            double *at_rest)
{
    size_t n = (size_t)(2 * c->across + 1) * (size_t)(2 * c->along + 1) * N_ALONG;

    look_about(v, f, s, c);
    memset(v->sums, 0, n * sizeof *v->sums);
    for (size_t k = 0; k < v->n_looks; k++) {
        struct turns turns = turns_of(v, s, &v->looks[k]);
        double part = (v->middle_s - v->looks[k].age_s) / v->half_s;
        float(*to)[2][LANES] = v->sums;
        double later_m = END_ALONG_M / v->half_s * later_s(v, k);
        take_patch(v, s, c, k, &turns);
        for (int x = -c->across; x <= c->across; x++) {
            double across_m = part * s->end_across_m * x, bent = bent_m(s, across_m);
            mix_columns(v, s, c, &turns, across_m);
            for (int z = -c->along; z <= c->along; z++, to += N_ALONG)
                add_courses(v, c, &turns, part * END_ALONG_M * z + bent, later_m * z, to);
        }
    }
    struct course best = brightest_course(v, s, c, at_rest);
    best.other = v->taken ? brightest_other(v, s, c, &best) : 0.0;
    return best;
}

static bool has_course(const struct sight *s, const struct courses *c,
                       const struct course *best, double half_s)
{
    double speed_m_s =
        hypot(s->end_across_m * best->end_across, END_ALONG_M * best->end_along) / half_s;
    bool edge = abs(best->end_across) == c->across || abs(best->end_along) == c->along;

    return !edge && speed_m_s > SLOWEST_M_S;
}

struct judged {                    /* a place that stands out */
    double range_m, sine, at_rest; /* the most of what may stand there */
    double brighter;               /* than another course */
    bool has_course, may_rest;
    struct volume_mover mover;
};

static struct volume_mover mover_of(const struct velocity_filter *v,
                                    const struct sight *s, const struct course *best)
{
    double across_m_s = s->end_across_m * best->end_across / v->half_s;
    double along_m_s = END_ALONG_M * best->end_along / v->half_s;
    double sine = sin(s->angle_rad), cosine = cos(s->angle_rad), at_m[3];

    place(s, s->across_m * best->across, ALONG_M * best->along, 0.0, at_m);
    return (struct volume_mover){
        .at_m = {(float)at_m[0], (float)at_m[1], (float)at_m[2]},
        .velocity_m_s = {(float)(across_m_s * cosine + along_m_s * sine), 0.0f,
                         (float)(along_m_s * cosine - across_m_s * sine)},
        .power = (float)best->power};
}

/* power: of single pings in the mean. */
static struct judged judge(struct velocity_filter *v, struct frames *f,
                           const double at_m[3], double power)
{
    struct sight s;

    find_sight(v, at_m, &s);
    struct judged out = {.range_m = s.range_m, .sine = sin(s.angle_rad)};
    if (s.range_m < NEAREST_M)
        return out;
    out.at_rest = rests(v, f, &s);
    if (out.at_rest > RESTS * power)
        return out;
    out.at_rest = fmax(out.at_rest, mirrors(v, f, &s));
    if (out.at_rest > RESTS * power)
        return out;
    struct courses c = choose_courses(v, &s);
    struct course best = follow(v, f, &s, &c, &out.at_rest);
    out.has_course = has_course(&s, &c, &best, v->half_s);
    out.may_rest = best.power <= OVER_REST * out.at_rest;
    out.mover = mover_of(v, &s, &best);
    out.brighter = best.other > 0.0 ? best.power / best.other - 1.0 : 0.0;
    return out;
}

/* -- all that stands out ----------------------------------------------------------------
 */

static double median_of(struct velocity_filter *v, const float *intensity)
{
    size_t n = 0;

    for (size_t i = 0; i < grid_size(&v->cfg.grid); i++)
        if (intensity[i] > 0.0f)
            v->scratch[n++] = intensity[i];
    return n ? (double)rank_smallest(v->scratch, n, n / 2 + 1) : 0.0;
}

static bool is_peak(const struct grid *g, const float *intensity, size_t x, size_t z)
{
    size_t nx = g->n[0], nz = g->n[2];
    float top = intensity[z * nx + x];

    for (size_t b = z < PEAK_Z ? 0 : z - PEAK_Z; b < nz && b <= z + PEAK_Z; b++)
        for (size_t a = x < PEAK_X ? 0 : x - PEAK_X; a < nx && a <= x + PEAK_X; a++)
            if (intensity[b * nx + a] > top)
                return false;
    return true;
}

/* What moves is there in its image, and nowhere else. */
static size_t middle_look(const struct velocity_filter *v)
{
    size_t best = 0;

    for (size_t k = 1; k < v->n_looks; k++)
        if (fabs(v->looks[k].age_s - v->middle_s) <
            fabs(v->looks[best].age_s - v->middle_s))
            best = k;
    return best;
}

/* What drives is elsewhere half a ping later. */
static void find_middle(struct velocity_filter *v)
{
    double oldest_s = 0.0, left_m = INFINITY, right_m = -INFINITY;

    v->middle_s = 0.0;
    for (size_t k = 0; k < v->n_looks; k++) {
        v->middle_s += v->looks[k].age_s / (double)v->n_looks;
        oldest_s = fmax(oldest_s, v->looks[k].age_s);
        left_m = fmin(left_m, v->looks[k].middle_m[0]);
        right_m = fmax(right_m, v->looks[k].middle_m[0]);
    }
    if (v->taken && v->n_looks)
        v->middle_s = v->looks[middle_look(v)].age_s;
    v->half_s = fmax(v->middle_s, oldest_s - v->middle_s);
    v->aside_m = 0.5 * (right_m - left_m);
    v->unlike_s = 0.0;
    for (size_t k = 0; k < v->n_looks; k++)
        v->unlike_s = fmax(v->unlike_s, fabs(later_s(v, k)));
}

/* The lobes of what is brighter go with the speakers that sound in turn, and seem to
 * move. They are as far away as it is, or, of speakers beside the middle, nearer or
 * farther by their place times the difference of the sines. */
static bool is_lobe_of(const struct velocity_filter *v, const struct judged *one,
                       const struct judged *other)
{
    double power = fmax(other->at_rest, (double)other->mover.power);
    double off_m = fabs(one->range_m - other->range_m);
    double turn = fabs(one->sine - other->sine);

    return (off_m < LOBE_M && power > LOBE * (double)one->mover.power) ||
           (off_m < LOBE_M + 2.0 * turn * v->aside_m &&
            power > FAR_LOBE * (double)one->mover.power);
}

/* Two bright spots of one that moves, which smears, lead to the same course. */
static bool is_same(const struct judged *one, const struct judged *other)
{
    const float *a = one->mover.at_m, *b = other->mover.at_m;

    return other->has_course && other->may_rest <= one->may_rest &&
           hypot((double)(a[0] - b[0]), (double)(a[2] - b[2])) < SAME_M &&
           other->mover.power > one->mover.power;
}

static bool is_mover(const struct velocity_filter *v, const struct judged *all, size_t n,
                     size_t which)
{
    const struct judged *one = &all[which];

    if (!one->has_course || !((double)one->mover.power > POWER))
        return false;
    for (size_t i = 0; i < n; i++)
        if (i != which && (is_lobe_of(v, one, &all[i]) || is_same(one, &all[i])))
            return false;
    return true;
}

static void tell_course(const struct judged *one, struct velocities *out)
{
    double odds = exp(SURE + SURE_BRIGHTER * one->brighter) *
                  pow((double)one->mover.power / SURE_OF, SURE_POWER);

    if (out->n_courses < VOLUME_MOVERS)
        out->courses[out->n_courses++] = (struct volume_course){
            .mover = one->mover, .sure = (float)fmin(odds / (1.0 + odds), MOST_SURE)};
}

static void tell(const struct judged *one, struct velocities *out)
{
    struct volume_mover *list = one->may_rest ? out->ambiguous : out->movers;
    size_t *n = one->may_rest ? &out->n_ambiguous : &out->n_movers;

    if (*n < VOLUME_MOVERS)
        list[(*n)++] = one->mover;
}

struct peak {
    size_t x, z;
    double bright;
};

static void place_of(const struct grid *g, const struct peak *p, double out[3])
{
    out[0] = g->origin_m[0] + g->step_m[0] * (double)p->x;
    out[1] = g->origin_m[1];
    out[2] = g->origin_m[2] + g->step_m[2] * (double)p->z;
}

/* In the order of rows, of the image of the ping in the middle. */
static size_t find_peaks(const struct velocity_filter *v, double bright,
                         struct peak out[PLACES_MAX])
{
    const struct grid *g = &v->cfg.grid;
    size_t n = 0;

    for (size_t z = 0; z < g->n[2]; z++)
        for (size_t x = 0; x < g->n[0] && n < PLACES_MAX; x++) {
            double level = (double)v->alone[z * g->n[0] + x];
            if (level > bright && is_peak(g, v->alone, x, z))
                out[n++] = (struct peak){x, z, level};
        }
    return n;
}

static int by_brightness(const void *a, const void *b)
{
    const struct peak *p = a, *q = b;

    return p->bright != q->bright ? (p->bright < q->bright ? 1 : -1) : 0;
}

void velocity_filter_find(struct velocity_filter *v, struct frames *f,
                          const float *intensity, bool taken, struct velocities *out)
{
    const struct grid *g = &v->cfg.grid;
    struct judged judged[PLACES_MAX];
    struct peak peaks[PLACES_MAX];

    out->n_movers = out->n_ambiguous = out->n_courses = 0;
    v->taken = taken;
    if (taken)
        frames_look_back(f, DRIVES_S);
    v->n_looks = frames_looks(f, v->looks);
    find_middle(v);
    if (!(v->half_s > 0.0))
        return;
    double median = median_of(v, intensity);
    frames_alone(f, middle_look(v), v->alone);
    size_t n = find_peaks(v, BRIGHT * median_of(v, v->alone), peaks);
    if (taken) {
        qsort(peaks, n, sizeof *peaks, by_brightness);
        n = n < BRIGHTEST ? n : BRIGHTEST;
    }
    for (size_t i = 0; i < n; i++) {
        double at_m[3];
        place_of(g, &peaks[i], at_m);
        double level = taken ? peaks[i].bright
                             : (double)intensity[peaks[i].z * g->n[0] + peaks[i].x];
        double range2 = at_m[0] * at_m[0] + at_m[2] * at_m[2];
        judged[i] = judge(v, f, at_m, level / range2);
        judged[i].at_rest *= range2 / median;
        judged[i].mover.power *= (float)(range2 / median);
    }
    for (size_t i = 0; i < n; i++) {
        if (!is_mover(v, judged, n, i))
            continue;
        if (taken)
            tell_course(&judged[i], out);
        else
            tell(&judged[i], out);
    }
}
