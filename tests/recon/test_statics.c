/* SPDX-License-Identifier: MIT */
/* Static corrections of columns that stand a little beside a line: a path on the line and
 * its shift are the path that sound really takes to the target. */
#include "tests/recon/near.h"

#include <errno.h>
#include <string.h>

#include "recon/coherent/statics.h"

enum { SPEAKERS = 5, MICROPHONES = 4, POSITIONS = 20 };

struct world {
    struct geometry geometry;
    double speakers_m[SPEAKERS][3], microphones_m[MICROPHONES][3];
    double positions_m[POSITIONS];
};

static const double target_m[3] = {0.7, 0.3, 1.9};

/* Speakers every 0.1 m along y, microphones every 0.05 m, 2 cm before and behind z = 0.1;
 * each element up to 4 mm beside its place. */
static void build(struct world *w, size_t n_positions)
{
    memset(w, 0, sizeof *w);
    for (size_t j = 0; j < SPEAKERS; j++)
        memcpy(w->speakers_m[j], (double[3]){0.3, 0.1 * (double)j, 0.12},
               sizeof(double[3]));
    for (size_t i = 0; i < MICROPHONES; i++)
        memcpy(w->microphones_m[i], (double[3]){0.34, 0.12 + 0.05 * (double)i, 0.08},
               sizeof(double[3]));
    for (size_t e = 0; e < SPEAKERS + MICROPHONES; e++) {
        double *at = e < SPEAKERS ? w->speakers_m[e] : w->microphones_m[e - SPEAKERS];
        for (int a = 0; a < 3; a++)
            at[a] += 0.004 * sin(7.0 * (double)e + 3.0 * a);
    }
    for (size_t k = 0; k < n_positions; k++)
        w->positions_m[k] = 0.05 * (double)k;
    w->geometry = (struct geometry){.sound_speed_m_s = 343.0,
                                    .n_speakers = SPEAKERS,
                                    .n_microphones = MICROPHONES,
                                    .n_positions = n_positions,
                                    .speakers_m = w->speakers_m,
                                    .microphones_m = w->microphones_m,
                                    .stage_axis = {1.0, 0.0, 0.0},
                                    .stage_positions_m = w->positions_m};
}

static struct statics *correct(const struct world *w)
{
    struct statics *s;
    const char *why = "";

    if (statics_create(&s, &w->geometry, target_m, &why))
        fail_msg("%s", why);
    return s;
}

static double path_s(const struct geometry *g, size_t position, size_t pair)
{
    double speaker[3], microphone[3];

    geometry_speaker(g, position, pair / MICROPHONES, speaker);
    geometry_microphone(g, position, pair / MICROPHONES, pair % MICROPHONES, microphone);
    return (geometry_distance(speaker, target_m) +
            geometry_distance(microphone, target_m)) /
           343.0;
}

static void a_path_on_the_line_and_its_shift_are_the_path(void **state)
{
    struct world w;

    (void)state;
    build(&w, 8);
    struct statics *s = correct(&w);
    assert_int_equal(s->n_groups, 8);
    for (size_t k = 0; k < 8; k++)
        for (size_t p = 0; p < SPEAKERS * MICROPHONES; p++)
            assert_near(path_s(&s->line, k, p) + s->shift_s[statics_group(s, k) + p],
                        path_s(&w.geometry, k, p), 1e-12);
    statics_destroy(s);
}

/* Positions that are more than groups share shifts with their neighbours. */
static void a_group_has_the_mean_of_its_positions(void **state)
{
    struct world w;

    (void)state;
    build(&w, POSITIONS);
    struct statics *s = correct(&w);
    assert_in_range(s->n_groups, 2, POSITIONS - 1);
    for (size_t p = 0; p < SPEAKERS * MICROPHONES; p++) {
        for (size_t begin = 0, end; begin < POSITIONS; begin = end) {
            double sum = 0.0;
            for (end = begin;
                 end < POSITIONS && statics_group(s, end) == statics_group(s, begin);
                 end++)
                sum += path_s(&w.geometry, end, p) - path_s(&s->line, end, p);
            assert_near(s->shift_s[statics_group(s, begin) + p],
                        sum / (double)(end - begin), 1e-12);
        }
    }
    assert_int_equal(statics_group(s, POSITIONS - 1),
                     (s->n_groups - 1) * SPEAKERS * MICROPHONES);
    statics_destroy(s);
}

/* Straight, even, in one plane, and in the middle of what it stands for. */
static void check_row(const double (*line)[3], const double (*at)[3], size_t n,
                      double pitch_m, double plane_m)
{
    double middle[2][3] = {{0.0}};

    for (size_t e = 0; e < n; e++) {
        assert_near(line[e][0], line[0][0], 1e-12);
        assert_near(line[e][1], line[0][1] + pitch_m * (double)e, 1e-12);
        assert_near(line[e][2], plane_m, 1e-12);
        for (int a = 0; a < 3; a++) {
            assert_near(line[e][a], at[e][a], STATICS_MOST_M);
            middle[0][a] += line[e][a] / (double)n;
            middle[1][a] += at[e][a] / (double)n;
        }
    }
    assert_near(middle[0][0], middle[1][0], 1e-12);
    assert_near(middle[0][1], middle[1][1], 1e-12);
}

static void the_line_is_even_in_one_plane_and_where_the_elements_are(void **state)
{
    struct world w;
    double middle_m[2] = {0.0, 0.0};

    (void)state;
    build(&w, 1);
    struct statics *s = correct(&w);
    for (size_t j = 0; j < SPEAKERS; j++)
        middle_m[0] += w.speakers_m[j][2] / SPEAKERS;
    for (size_t i = 0; i < MICROPHONES; i++)
        middle_m[1] += w.microphones_m[i][2] / MICROPHONES;
    double plane_m = 0.5 * (middle_m[0] + middle_m[1]);
    double pitch_m = s->line.microphones_m[1][1] - s->line.microphones_m[0][1];
    assert_near(pitch_m, 0.05, 0.003);
    check_row(s->line.microphones_m, w.geometry.microphones_m, MICROPHONES, pitch_m,
              plane_m);
    check_row(s->line.speakers_m, w.geometry.speakers_m, SPEAKERS, 2.0 * pitch_m,
              plane_m);
    statics_destroy(s);
}

static void what_stands_on_its_line_is_not_shifted(void **state)
{
    struct world w;

    (void)state;
    build(&w, 3);
    for (size_t j = 0; j < SPEAKERS; j++)
        memcpy(w.speakers_m[j], (double[3]){0.3, 0.1 * (double)j, 0.1},
               sizeof(double[3]));
    for (size_t i = 0; i < MICROPHONES; i++)
        memcpy(w.microphones_m[i], (double[3]){0.34, 0.12 + 0.05 * (double)i, 0.1},
               sizeof(double[3]));
    struct statics *s = correct(&w);
    for (size_t q = 0; q < 3 * SPEAKERS * MICROPHONES; q++)
        assert_near(s->shift_s[q], 0.0, 1e-14);
    statics_destroy(s);
}

static void what_is_no_column_is_refused_with_what_it_lacks(void **state)
{
    struct world w;
    struct statics *s;
    const char *why = "";

    (void)state;
    build(&w, 3);
    w.speakers_m[2][0] += 0.05; /* more than 3 cm beside what would be its line */
    assert_int_equal(statics_create(&s, &w.geometry, target_m, &why), -ENOTSUP);
    assert_non_null(strstr(why, "3 cm"));
    build(&w, 3);
    w.geometry.stage_axis[2] = 0.1;
    assert_int_equal(statics_create(&s, &w.geometry, target_m, &why), -ENOTSUP);
    assert_non_null(strstr(why, "stage"));
    build(&w, 3);
    w.geometry.n_microphones = 2; /* two are always on a line */
    assert_int_equal(statics_create(&s, &w.geometry, target_m, &why), -ENOTSUP);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_path_on_the_line_and_its_shift_are_the_path),
        cmocka_unit_test(a_group_has_the_mean_of_its_positions),
        cmocka_unit_test(the_line_is_even_in_one_plane_and_where_the_elements_are),
        cmocka_unit_test(what_stands_on_its_line_is_not_shifted),
        cmocka_unit_test(what_is_no_column_is_refused_with_what_it_lacks),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
