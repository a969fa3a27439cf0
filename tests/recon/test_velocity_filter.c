/* SPDX-License-Identifier: MIT */
/* What moves by itself, of recordings that take no step of standing still while sound is
 * under way; and, ping by ping, the echoes that it is told from. */
#include "tests/recon/near.h"

#include <complex.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/static_array/velocity_filter.h"
#include "tests/recon/bumper.h"
#include "tests/recon/reference.h"

enum { PINGS = 8, MICROPHONES = 16, NX = 76, NZ = 151, VOXELS = NX * NZ };

static const double degree = M_PI / 180.0;

struct scene { /* do not copy; the array frame is that of the newest ping */
    struct bumper bumper;
    struct frames *frames;
    float image[VOXELS];
    struct velocities found;
};

/* -- a product's array, on a vehicle ----------------------------------------------------
 */

/* Nothing there yet. */
static void scene_default(struct scene *s, size_t speakers, double speed_m_s)
{
    struct bumper *b = &s->bumper;
    s->found.n_movers = s->found.n_ambiguous = 0;
    bumper_default(b);
    bumper_elements(b, speakers, MICROPHONES);
    b->cfg.n_pings = PINGS;
    b->cfg.sum = FRAMES_POWER;
    b->cfg.grid = (struct grid){
        .origin_m = {-1.5, 0.0, 0.5}, .step_m = {0.04, 0.1, 0.02}, .n = {NX, 1, NZ}};
    b->reach_m = 4.2;
    b->world.level_db = -INFINITY;
    b->world.speed_m_s = speed_m_s;
    b->noise = 0.1;
    b->seed = 5;
    bumper_drive(b);
}

static void scene_stop(struct scene *s)
{
    frames_destroy(s->frames);
    bumper_stop(&s->bumper);
}

/* Pings, and their image. */
static void scene_image(struct scene *s, size_t pings)
{
    struct frames_made made;
    bumper_start(&s->bumper);
    s->frames = bumper_frames(&s->bumper);
    bumper_add(&s->bumper, s->frames, pings);
    frames_image(s->frames, &s->bumper.motion, s->image, &made);
    assert_int_equal(made.pings, pings);
    assert_int_equal(made.unknown, 0);
}

static struct velocity_filter_config filter_config(const struct bumper *b)
{
    return (struct velocity_filter_config){.grid = b->cfg.grid,
                                           .n_pings = b->cfg.n_pings,
                                           .turns_per_m = b->cfg.format.carrier_hz /
                                                          b->world.sound_speed_m_s,
                                           .sound_speed_m_s = b->world.sound_speed_m_s};
}

static void scene_look(struct scene *s, size_t pings, bool taken)
{
    scene_image(s, pings);
    const struct velocity_filter_config cfg = filter_config(&s->bumper);
    struct velocity_filter *v;
    assert_int_equal(velocity_filter_create(&v, &cfg), 0);
    velocity_filter_find(v, s->frames, s->image, taken, &s->found);
    velocity_filter_destroy(v);
    scene_stop(s);
}

/* What moves in the image of so many pings. */
static void scene_find(struct scene *s, size_t pings)
{
    scene_look(s, pings, false);
    assert_int_equal(s->found.n_courses, 0);
    assert_true(s->found.n_movers <= VOLUME_MOVERS);
    assert_true(s->found.n_ambiguous <= VOLUME_MOVERS);
    for (size_t m = 0; m < s->found.n_movers; m++)
        assert_true(volume_mover_is_sound(&s->found.movers[m]));
    for (size_t m = 0; m < s->found.n_ambiguous; m++)
        assert_true(volume_mover_is_sound(&s->found.ambiguous[m]));
}

/* -- what is there ----------------------------------------------------------------------
 */

static double newest_s(const struct scene *s)
{
    return bumper_time_s(&s->bumper, PINGS - 1);
}

static double range_m(const double p[3])
{
    return sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
}

/* From the array's axes (left, up, forward) to those of the ground, of a vehicle that
 * does not turn. */
static void turn_to_ground(const double v[3], double out[3])
{
    out[0] = v[2];
    out[1] = v[0];
    out[2] = v[1];
}

/* A point that is at at_m when the sound of the middle of the pings meets it. */
static struct moving *add_point(struct scene *s, const double at_m[3], const double v[3])
{
    const struct bumper *b = &s->bumper;
    struct moving *m = bumper_also(&s->bumper);
    double instant_s = b->world.chirp_s * b->world.chirp_hz[1] /
                       (b->world.chirp_hz[1] - b->world.chirp_hz[0]);
    double hit_s = 0.5 * newest_s(s) + instant_s +
                   range_m(at_m) / b->world.sound_speed_m_s;
    moving_to_ground(&b->world, newest_s(s), at_m, m->at_m);
    turn_to_ground(v, m->velocity_m_s);
    for (int a = 0; a < 3; a++)
        m->at_m[a] -= hit_s * m->velocity_m_s[a];
    m->level_db = 0.0;
    return m;
}

static struct moving *add_rest(struct scene *s, const double at_m[3])
{
    return add_point(s, at_m, (const double[3]){0.0, 0.0, 0.0});
}

/* A plane at rest, square to the way there. */
static void add_plane(struct scene *s, const double at_m[3])
{
    struct moving *m = add_rest(s, at_m);
    turn_to_ground(at_m, m->normal);
    for (int a = 0; a < 3; a++)
        m->normal[a] /= range_m(at_m);
}

/* -- what is told -----------------------------------------------------------------------
 */

struct course { /* array frame */
    const char *what;
    double at_m[3], velocity_m_s[3];
};

/* Lengths along the sight, and across it. */
static void split(const double at_m[3], const double off[3], double *along,
                  double *across)
{
    *along = 0.0;
    for (int a = 0; a < 3; a++)
        *along += off[a] * at_m[a] / range_m(at_m);
    *across = sqrt(fmax(pow(range_m(off), 2.0) - *along * *along, 0.0));
}

struct off {
    double along_m, across_m, along_m_s, across_m_s;
};

static struct off off_course(const struct course *c, const struct volume_mover *m)
{
    double at[3], v[3];
    struct off o;
    for (int a = 0; a < 3; a++) {
        at[a] = m->at_m[a] - c->at_m[a];
        v[a] = m->velocity_m_s[a] - c->velocity_m_s[a];
    }
    split(c->at_m, at, &o.along_m, &o.across_m);
    split(c->at_m, v, &o.along_m_s, &o.across_m_s);
    return o;
}

static bool is_course(const struct course *c, const struct volume_mover *m)
{
    const struct off o = off_course(c, m);
    return fabs(o.along_m) <= 0.03 && o.across_m <= 0.1 && fabs(o.along_m_s) <= 0.15 &&
           o.across_m_s <= 0.7;
}

static void say(const struct scene *s, const struct course *courses, size_t n)
{
    const struct bumper *b = &s->bumper;
    print_error("%zu movers, not %zu (%zu speakers, vehicle at %.1f m/s)\n",
                s->found.n_movers, n, b->geometry.n_speakers, b->world.speed_m_s);
    for (size_t c = 0; c < n; c++)
        print_error("  there: %s\n", courses[c].what);
    for (size_t m = 0; m < s->found.n_movers; m++) {
        const struct volume_mover *v = &s->found.movers[m];
        print_error("  told: at %.2f %.2f, %.2f %.2f m/s, power %.0f\n", v->at_m[0],
                    v->at_m[2], v->velocity_m_s[0], v->velocity_m_s[2], v->power);
        for (size_t c = 0; c < n; c++) {
            const struct off o = off_course(&courses[c], v);
            print_error("    off %zu by %.3f m along, %.3f across, %.2f m/s, %.2f\n", c,
                        o.along_m, o.across_m, o.along_m_s, o.across_m_s);
        }
    }
}

static int by_size(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* So faint beside the brightest that it may be a lobe of it: 27 dB. */
static bool is_faint(const struct scene *s, const struct volume_mover *m)
{
    static float sorted[VOXELS];
    memcpy(sorted, s->image, sizeof sorted);
    qsort(sorted, VOXELS, sizeof sorted[0], by_size);
    return (double)m->power * (double)sorted[VOXELS / 2] <
           0.002 * (double)sorted[VOXELS - 1];
}

/* These, each once, and no other. */
static void expect(const struct scene *s, const struct course *courses, size_t n)
{
    size_t bright = 0;
    for (size_t m = 0; m < s->found.n_movers; m++)
        bright += !is_faint(s, &s->found.movers[m]);
    bool good = bright == n;
    for (size_t c = 0; c < n; c++) {
        size_t told = 0;
        for (size_t m = 0; m < s->found.n_movers; m++)
            told += is_course(&courses[c], &s->found.movers[m]);
        good = good && told == 1;
    }
    if (!good)
        say(s, courses, n);
    assert_true(good);
}

static void expect_none(struct scene *s)
{
    scene_find(s, PINGS);
    expect(s, NULL, 0);
}

static const double drives_m_s[] = {0.0, 2.0};
static const size_t speaker_counts[] = {2, 8};

enum { DRIVES = 2, ARRAYS = 2 };

static void expect_told(const struct course *c)
{
    static struct scene s;
    for (size_t q = 0; q < DRIVES * ARRAYS; q++) {
        scene_default(&s, speaker_counts[q / DRIVES], drives_m_s[q % DRIVES]);
        add_point(&s, c->at_m, c->velocity_m_s);
        scene_find(&s, PINGS);
        expect(&s, c, 1);
    }
}

/* -- echoes ping by ping ----------------------------------------------------------------
 */

/* Of one place: the power of the echoes' sum, and what it is where all are in phase. */
static void echo_powers(struct frames *f, enum frames_thing thing, const double at_m[3],
                        double *sum, double *in_phase)
{
    struct frames_look looks[PINGS];
    float echoes[PINGS][2];
    double complex total = 0.0;
    size_t n = frames_looks(f, looks);
    assert_int_equal(n, PINGS);
    frames_echoes(f, thing, (const double(*)[3])at_m, 1, &echoes[0][0]);
    *in_phase = 0.0;
    for (size_t l = 0; l < n; l++) {
        double complex echo = echoes[l][0] + I * echoes[l][1];
        total += echo;
        *in_phase += (double)n * pow(cabs(echo), 2.0);
    }
    *sum = pow(cabs(total), 2.0);
}

/* Which makes up for spreading in images: of the elements, the mean square. */
static double range2(const struct bumper *b, const double at_m[3])
{
    const struct geometry *g = &b->geometry;
    double sum = 0.0;
    for (size_t j = 0; j < g->n_speakers; j++)
        sum += pow(reference_distance(b->speakers_m[j], at_m), 2.0);
    for (size_t i = 0; i < g->n_microphones; i++)
        sum += pow(reference_distance(b->microphones_m[i], at_m), 2.0);
    return sum / (double)(g->n_speakers + g->n_microphones);
}

static void the_pings_are_looked_at_from_where_the_array_stood(void **state)
{
    (void)state;
    static struct scene s;
    for (size_t q = 0; q < DRIVES * ARRAYS; q++) {
        const struct bumper *b = &s.bumper;
        struct frames_look looks[PINGS];
        bool seen[PINGS] = {false};
        scene_default(&s, speaker_counts[q / DRIVES], drives_m_s[q % DRIVES]);
        scene_image(&s, PINGS);
        assert_int_equal(frames_looks(s.frames, looks), PINGS);
        for (size_t l = 0; l < PINGS; l++) {
            size_t ago = (size_t)lround(looks[l].age_s / b->slot_s);
            assert_true(ago < PINGS && !seen[ago]);
            seen[ago] = true;
            double age_s = (double)ago * b->slot_s;
            size_t speaker = (PINGS - 1 - ago) % b->geometry.n_speakers;
            assert_near(looks[l].age_s, age_s, 1e-6);
            assert_near(looks[l].sweep_s_hz,
                        b->world.chirp_s / (b->world.chirp_hz[1] - b->world.chirp_hz[0]),
                        1e-12);
            /* its microphones have their middle at x = 0, and go on for 20 ms */
            assert_near(looks[l].middle_m[0], 0.5 * b->speakers_m[speaker][0], 1e-3);
            assert_near(looks[l].middle_m[1], 0.025, 1e-3);
            assert_near(looks[l].middle_m[2], -b->world.speed_m_s * age_s, 0.041);
        }
        scene_stop(&s);
    }
}

static void more_pings_than_came_are_not_looked_at(void **state)
{
    (void)state;
    static struct scene s;
    struct frames_look looks[PINGS];
    scene_default(&s, 2, 0.0);
    scene_image(&s, 3);
    assert_int_equal(frames_looks(s.frames, looks), 3);
    scene_stop(&s);
}

static void echoes_of_a_point_at_rest_are_in_phase_where_it_is(void **state)
{
    (void)state;
    static struct scene s;
    const size_t voxel[2] = {45, 80};
    const double at[3] = {0.3, 0.0, 2.1};
    const double off[3] = {at[0] * (1.0 + 0.2 / range_m(at)), 0.0,
                           at[2] * (1.0 + 0.2 / range_m(at))};
    for (size_t q = 0; q < DRIVES * ARRAYS; q++) {
        double sum, in_phase, sum_off, in_phase_off;
        scene_default(&s, speaker_counts[q / DRIVES], drives_m_s[q % DRIVES]);
        s.bumper.noise = 0.0;
        add_rest(&s, at);
        scene_image(&s, PINGS);
        echo_powers(s.frames, FRAMES_SCATTERER, at, &sum, &in_phase);
        echo_powers(s.frames, FRAMES_SCATTERER, off, &sum_off, &in_phase_off);
        float image = s.image[voxel[1] * NX + voxel[0]];
        scene_stop(&s);
        assert_true(in_phase > 0.0);
        assert_near(sum / in_phase, 1.0, 0.05);
        assert_near(range2(&s.bumper, at) * sum / (double)image, 1.0, 0.05);
        assert_below(sum_off / sum, 0.01);
    }
}

/* Sharp only along its course: half of a wave each way at 11 kHz is 16 mm. */
static void echoes_of_what_moves_are_not(void **state)
{
    (void)state;
    static struct scene s;
    const double at[3] = {0.0, 0.0, 2.1};
    double sum, in_phase;
    scene_default(&s, 2, 0.0);
    add_point(&s, at, (const double[3]){0.0, 0.0, -1.3});
    scene_image(&s, PINGS);
    echo_powers(s.frames, FRAMES_SCATTERER, at, &sum, &in_phase);
    scene_stop(&s);
    assert_below(sum / in_phase, 0.5);
}

static void expect_plane(const double at[3])
{
    static struct scene s;
    const double off[3] = {at[0] * (1.0 + 0.1 / range_m(at)), 0.0,
                           at[2] * (1.0 + 0.1 / range_m(at))};
    for (size_t q = 0; q < DRIVES * ARRAYS; q++) {
        double sum, in_phase, sum_off, in_phase_off;
        scene_default(&s, speaker_counts[q / DRIVES], drives_m_s[q % DRIVES]);
        s.bumper.noise = 0.0;
        add_plane(&s, at);
        scene_image(&s, PINGS);
        echo_powers(s.frames, FRAMES_PLANE, at, &sum, &in_phase);
        echo_powers(s.frames, FRAMES_PLANE, off, &sum_off, &in_phase_off);
        scene_stop(&s);
        assert_true(in_phase > 0.0);
        assert_near(sum / in_phase, 1.0, 0.05);
        assert_below(sum_off / sum, 0.01);
    }
}

static void echoes_of_a_plane_are_in_phase_where_it_is(void **state)
{
    (void)state;
    expect_plane((const double[3]){0.0, 0.0, 2.2});
    expect_plane((const double[3]){2.2 * sin(25 * degree), 0.0, 2.2 * cos(25 * degree)});
}

/* -- movers -----------------------------------------------------------------------------
 */

static void what_comes_towards_the_array_is_told(void **state)
{
    (void)state;
    expect_told(&(const struct course){"towards", {0.0, 0.0, 2.2}, {0.0, 0.0, -1.3}});
}

/* But where it goes with the vehicle it is ambiguous: so does what rests high over the
 * array. */
static void what_goes_away_is_told_or_ambiguous(void **state)
{
    (void)state;
    static struct scene s;
    const struct course away = {"away", {0.3, 0.0, 1.8}, {0.0, 0.0, 1.3}};
    for (size_t q = 0; q < DRIVES * ARRAYS; q++) {
        bool stands = drives_m_s[q % DRIVES] == 0.0;
        size_t told = 0;
        scene_default(&s, speaker_counts[q / DRIVES], drives_m_s[q % DRIVES]);
        add_point(&s, away.at_m, away.velocity_m_s);
        scene_find(&s, PINGS);
        expect(&s, &away, stands);
        for (size_t m = 0; m < s.found.n_ambiguous; m++)
            told += is_course(&away, &s.found.ambiguous[m]);
        assert_int_equal(told, !stands);
    }
}

/* Against the order of the speakers: with it goes the bright spot of a plane, too. */
static void what_crosses_is_told(void **state)
{
    (void)state;
    expect_told(&(const struct course){"across", {0.0, 0.0, 2.2}, {-1.8, 0.0, 0.0}});
}

/* Across the sight a velocity is known to 0.6 m/s: who walks across slowly is told all
 * the same from what rests overhead, which only goes along with the vehicle. */
static void who_walks_across_slowly_is_told_from_what_rests_overhead(void **state)
{
    (void)state;
    static struct scene s;
    double x = sin(20.0 * degree), z = cos(20.0 * degree);
    const struct course walks[ARRAYS] = {
        {"at 20 degrees", {2.2 * x, 0.0, 2.2 * z}, {0.8, 0.0, 0.0}},
        {"ahead", {0.0, 0.0, 2.2}, {-1.0, 0.0, 0.0}}};
    for (size_t q = 0; q < ARRAYS; q++) {
        scene_default(&s, speaker_counts[q], 2.0);
        add_point(&s, walks[q].at_m, walks[q].velocity_m_s);
        scene_find(&s, PINGS);
        expect(&s, &walks[q], 1);
    }
}

static void what_comes_obliquely_is_told(void **state)
{
    (void)state;
    expect_told(&(const struct course){"oblique", {-0.2, 0.0, 2.0}, {0.92, 0.0, -0.92}});
}

static void what_comes_from_one_side_is_told(void **state)
{
    (void)state;
    double x = sin(25.0 * degree), z = cos(25.0 * degree);
    expect_told(&(const struct course){
        "from the side", {2.2 * x, 0.0, 2.2 * z}, {-1.3 * x, 0.0, -1.3 * z}});
    expect_told(&(const struct course){
        "to the side", {-2.2 * x, 0.0, 2.2 * z}, {-0.92, 0.0, -0.92}});
}

/* 1 / (way there x way back), times the range. */
static void its_power_is_that_of_all_pings_in_phase_over_the_median(void **state)
{
    (void)state;
    static struct scene s;
    const double at[3] = {0.0, 0.0, 2.0}, v[3] = {0.0, 0.0, -1.0};
    scene_default(&s, 2, 0.0);
    add_point(&s, at, v);
    scene_find(&s, PINGS);
    assert_int_equal(s.found.n_movers, 1);
    qsort(s.image, VOXELS, sizeof s.image[0], by_size);
    double level = (double)s.found.movers[0].power * (double)s.image[VOXELS / 2];
    assert_near(10.0 * log10(level), -20.0 * log10(range_m(at)), 6.0);
}

static void two_movers_are_both_told(void **state)
{
    (void)state;
    static struct scene s;
    const struct course pairs[][2] = {
        {{"left", {0.5, 0.0, 2.2}, {0.0, 0.0, -1.3}},
         {"right", {-0.5, 0.0, 2.2}, {0.5, 0.0, -1.0}}},
        {{"near", {0.1, 0.0, 1.6}, {0.0, 0.0, -1.3}},
         {"far", {0.1, 0.0, 2.6}, {0.0, 0.0, -1.0}}},
    };
    for (size_t q = 0; q < 2 * DRIVES * ARRAYS; q++) {
        const struct course *pair = pairs[q % 2];
        scene_default(&s, speaker_counts[q / 2 / DRIVES], drives_m_s[q / 2 % DRIVES]);
        add_point(&s, pair[0].at_m, pair[0].velocity_m_s);
        add_point(&s, pair[1].at_m, pair[1].velocity_m_s);
        scene_find(&s, PINGS);
        expect(&s, pair, 2);
    }
}

/* Of two of 1 / (r r) the nearer is the brighter by the ranges' ratio. */
static void a_mover_beside_what_is_bright_and_at_rest_is_told(void **state)
{
    (void)state;
    static struct scene s;
    const struct course nearer = {"nearer", {0.2, 0.0, 1.5}, {0.3, 0.0, -1.3}};
    const struct course farther = {"farther", {0.2, 0.0, 2.8}, {0.3, 0.0, -1.3}};
    for (size_t q = 0; q < 2 * DRIVES * ARRAYS; q++) {
        const struct course *c = q % 2 ? &nearer : &farther;
        const double rest[3] = {0.0, 0.0, c->at_m[2] + (q % 2 ? 1.5 : -1.5)};
        scene_default(&s, speaker_counts[q / 2 / DRIVES], drives_m_s[q / 2 % DRIVES]);
        add_point(&s, c->at_m, c->velocity_m_s);
        add_rest(&s, rest)->level_db = 20.0 +
                                       20.0 * log10(range_m(rest) / range_m(c->at_m));
        scene_find(&s, PINGS);
        expect(&s, c, 1);
    }
}

/* -- what is no mover -------------------------------------------------------------------
 */

static void noise_is_no_mover(void **state)
{
    (void)state;
    static struct scene s;
    for (size_t seed = 1; seed <= 4; seed++)
        for (size_t q = 0; q < DRIVES * ARRAYS; q++) {
            scene_default(&s, speaker_counts[q / DRIVES], drives_m_s[q % DRIVES]);
            s.bumper.seed = seed;
            expect_none(&s);
        }
}

static void expect_rest_is_none(const double at_m[3])
{
    static struct scene s;
    const double levels_db[] = {0.0, 20.0};
    for (size_t q = 0; q < 2 * DRIVES * ARRAYS; q++) {
        scene_default(&s, speaker_counts[q / 2 / DRIVES], drives_m_s[q / 2 % DRIVES]);
        add_rest(&s, at_m)->level_db = levels_db[q % 2];
        expect_none(&s);
    }
}

static void a_point_at_rest_is_no_mover(void **state)
{
    (void)state;
    expect_rest_is_none((const double[3]){0.1, 0.0, 2.2});
}

static void a_point_at_rest_to_one_side_is_no_mover(void **state)
{
    (void)state;
    double x = sin(25.0 * degree), z = cos(25.0 * degree);
    expect_rest_is_none((const double[3]){2.2 * x, 0.0, 2.2 * z});
}

/* From a vehicle that comes nearer it seems to glide, as fast as the vehicle or twice. */
static void a_point_at_rest_elsewhere_is_no_mover(void **state)
{
    (void)state;
    double x = sin(25.0 * degree), z = cos(25.0 * degree);
    expect_rest_is_none((const double[3]){0.1, 1.0, 2.0});
    expect_rest_is_none((const double[3]){0.1, 1.9, 1.1});
    expect_rest_is_none((const double[3]){0.4, 0.0, -2.2}); /* behind */
    expect_rest_is_none((const double[3]){2.0 * x, 1.0, 2.0 * z});
}

/* Higher than is looked for at rest: across the sight its course is hardly known, along
 * it all the better. */
static void a_point_high_overhead_is_no_mover(void **state)
{
    (void)state;
    static struct scene s;
    const double at_m[][3] = {{-1.4, 2.4, 2.2}, {1.0, 2.6, 2.2}, {1.4, 2.6, 1.0}};
    for (size_t q = 0; q < 3; q++) {
        scene_default(&s, 8, -2.0);
        add_rest(&s, at_m[q]);
        expect_none(&s);
        assert_int_equal(s.found.n_ambiguous, 1);
    }
}

static void a_plane_at_rest_is_no_mover(void **state)
{
    (void)state;
    static struct scene s;
    double x = sin(25.0 * degree), z = cos(25.0 * degree);
    const double feet_m[][3] = {{0.0, 0.0, 2.2}, {2.2 * x, 0.0, 2.2 * z}};
    for (size_t q = 0; q < 2 * DRIVES * ARRAYS; q++) {
        scene_default(&s, speaker_counts[q / 2 / DRIVES], drives_m_s[q / 2 % DRIVES]);
        add_plane(&s, feet_m[q % 2]);
        expect_none(&s);
    }
}

static void what_is_slow_is_no_mover(void **state)
{
    (void)state;
    static struct scene s;
    const double slow_m_s[][3] = {{0.0, 0.0, -0.3}, {0.3, 0.0, 0.0}, {0.2, 0.0, 0.2}};
    for (size_t q = 0; q < 3 * DRIVES * ARRAYS; q++) {
        scene_default(&s, speaker_counts[q / 3 / DRIVES], drives_m_s[q / 3 % DRIVES]);
        add_point(&s, (const double[3]){0.1, 0.0, 2.2}, slow_m_s[q % 3]);
        expect_none(&s);
    }
}

/* -- how what stands out goes, where what stands was taken away -------------------------
 */

struct firing {
    double slot_s, chirp_s;
    bool alternates;
};

/* As fast as a car, alone.  An odd number of pings, or an even one, in 0.11 s. */
static void expect_course(const struct course *c, const struct firing *firing)
{
    static struct scene s;

    for (size_t q = 0; q < ARRAYS; q++) {
        size_t told = 0;
        scene_default(&s, speaker_counts[q], 0.0);
        s.bumper.slot_s = firing->slot_s;
        s.bumper.world.chirp_s = firing->chirp_s;
        s.bumper.alternates = firing->alternates;
        bumper_drive(&s.bumper);
        add_point(&s, c->at_m, c->velocity_m_s);
        scene_look(&s, PINGS, true);
        assert_int_equal(s.found.n_movers + s.found.n_ambiguous, 0);
        assert_true(s.found.n_courses <= VOLUME_MOVERS);
        for (size_t i = 0; i < s.found.n_courses; i++) {
            const struct volume_course *one = &s.found.courses[i];
            const struct off o = off_course(c, &one->mover);
            bool right = fabs(o.along_m_s) < 0.15 && o.across_m_s < 0.7;
            assert_true(volume_course_is_sound(one));
            told += one->sure > 0.9f && right;
            if (!right)
                print_error("%s: off by %.2f and %.2f m/s, sure %.2f\n", c->what,
                            o.along_m_s, o.across_m_s, (double)one->sure);
        }
        assert_int_equal(told, 1);
    }
}

static void how_fast_a_car_comes_is_told(void **state)
{
    (void)state;
    const struct course courses[] = {
        {"walks towards", {0.0, 0.0, 2.2}, {0.0, 0.0, -1.3}},
        {"drives towards", {0.0, 0.0, 2.2}, {0.0, 0.0, -4.0}},
        {"drives away", {0.2, 0.0, 2.2}, {0.0, 0.0, 4.0}},
        {"drives by", {0.2, 0.0, 2.4}, {4.0, 0.0, 0.0}},
        {"comes by", {-0.9, 0.0, 2.2}, {3.5, 0.0, -1.0}},
    };
    for (size_t i = 0; i < sizeof courses / sizeof *courses; i++) {
        expect_course(&courses[i], &(const struct firing){24e-3, 5e-3, false});
        expect_course(&courses[i], &(const struct firing){36e-3, 5e-3, false});
    }
}

/* 20 ms: what comes with 1.5 m/s is heard 4 cm nearer by the one than by the other. */
static void a_chirp_that_runs_down_is_heard_as_of_earlier(void **state)
{
    (void)state;
    expect_course(
        &(const struct course){"walks towards", {0.0, 0.0, 2.2}, {0.0, 0.0, -1.5}},
        &(const struct firing){36e-3, 20e-3, true});
}

static void pings_are_looked_at_as_far_back_as_is_asked_for(void **state)
{
    (void)state;
    static struct scene s;
    struct frames_look looks[PINGS];
    struct frames_made made;

    scene_default(&s, 2, 0.0);
    s.bumper.alternates = true;
    scene_image(&s, PINGS);
    frames_look_back(s.frames, 0.11);
    assert_int_equal(frames_looks(s.frames, looks), 5);
    for (size_t l = 0; l < 5; l++) {
        const struct moving *w = &s.bumper.world;
        bool down = lround(looks[l].age_s / s.bumper.slot_s) % 2 == 0;
        double sweep = w->chirp_s / (w->chirp_hz[1] - w->chirp_hz[0]);
        assert_true(looks[l].age_s < 0.11);
        assert_near(looks[l].sweep_s_hz, down ? -sweep : sweep, 1e-12);
    }
    frames_image(s.frames, &s.bumper.motion, s.image, &made);
    assert_int_equal(frames_looks(s.frames, looks), PINGS);
    scene_stop(&s);
}

static void noise_and_what_rests_have_no_course(void **state)
{
    (void)state;
    static struct scene s;

    for (int there = 0; there < 2; there++) {
        scene_default(&s, 8, 0.0);
        if (there)
            add_rest(&s, (const double[3]){0.1, 0.0, 2.2});
        scene_look(&s, PINGS, true);
        assert_int_equal(s.found.n_movers + s.found.n_ambiguous, 0);
        assert_int_equal(s.found.n_courses, 0);
    }
}

static void fewer_than_two_pings_tell_of_no_mover(void **state)
{
    (void)state;
    static struct scene s;
    for (size_t pings = 0; pings < 2; pings++) {
        scene_default(&s, 2, 0.0);
        add_point(&s, (const double[3]){0.0, 0.0, 2.2},
                  (const double[3]){0.0, 0.0, -1.3});
        scene_find(&s, pings);
        expect(&s, NULL, 0);
    }
}

static void images_that_are_no_plan_view_are_refused(void **state)
{
    (void)state;
    static struct scene s;
    scene_default(&s, 2, 0.0);
    bumper_start(&s.bumper);
    struct velocity_filter_config cfg = filter_config(&s.bumper);
    struct velocity_filter *v = NULL;
    cfg.grid.n[1] = 2;
    assert_int_equal(velocity_filter_create(&v, &cfg), -ENOTSUP);
    cfg.grid.n[1] = 1;
    assert_int_equal(velocity_filter_create(&v, &cfg), 0);
    velocity_filter_destroy(v);
    velocity_filter_destroy(NULL);
    bumper_stop(&s.bumper);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_pings_are_looked_at_from_where_the_array_stood),
        cmocka_unit_test(more_pings_than_came_are_not_looked_at),
        cmocka_unit_test(echoes_of_a_point_at_rest_are_in_phase_where_it_is),
        cmocka_unit_test(echoes_of_what_moves_are_not),
        cmocka_unit_test(echoes_of_a_plane_are_in_phase_where_it_is),
        cmocka_unit_test(what_comes_towards_the_array_is_told),
        cmocka_unit_test(what_goes_away_is_told_or_ambiguous),
        cmocka_unit_test(what_crosses_is_told),
        cmocka_unit_test(who_walks_across_slowly_is_told_from_what_rests_overhead),
        cmocka_unit_test(what_comes_obliquely_is_told),
        cmocka_unit_test(what_comes_from_one_side_is_told),
        cmocka_unit_test(its_power_is_that_of_all_pings_in_phase_over_the_median),
        cmocka_unit_test(two_movers_are_both_told),
        cmocka_unit_test(a_mover_beside_what_is_bright_and_at_rest_is_told),
        cmocka_unit_test(noise_is_no_mover),
        cmocka_unit_test(a_point_at_rest_is_no_mover),
        cmocka_unit_test(a_point_at_rest_to_one_side_is_no_mover),
        cmocka_unit_test(a_point_at_rest_elsewhere_is_no_mover),
        cmocka_unit_test(a_point_high_overhead_is_no_mover),
        cmocka_unit_test(a_plane_at_rest_is_no_mover),
        cmocka_unit_test(what_is_slow_is_no_mover),
        cmocka_unit_test(how_fast_a_car_comes_is_told),
        cmocka_unit_test(a_chirp_that_runs_down_is_heard_as_of_earlier),
        cmocka_unit_test(pings_are_looked_at_as_far_back_as_is_asked_for),
        cmocka_unit_test(noise_and_what_rests_have_no_course),
        cmocka_unit_test(fewer_than_two_pings_tell_of_no_mover),
        cmocka_unit_test(images_that_are_no_plan_view_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
