/* SPDX-License-Identifier: MIT */
/* Arrivals by Pythagoras, in air that warms and blows, with the noise of a clock. */
#include "recon/frontend/displacement.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "near.h"
#include "tests/recon/dice.h"

enum { N = 16 };
#define SOUND_M_S 343.0

struct world {
    struct survey survey;
    double speakers_m[N][3], microphones_m[N][3];       /* as surveyed */
    double speakers_at_m[N][3], microphones_at_m[N][3]; /* as they stand */
    bool deaf[N];
    double sound_m_s, wind_m_s[3], zero_s, noise_m;
    struct wall_gate wall;           /* id 0: none */
    double off_m, off_rad, jitter_m; /* of the wall that is told, one sigma: in each
                                        round, and in each ping besides */
    unsigned long long seed;
    struct displacement *d;
};

static void settle(struct world *w)
{
    memcpy(w->speakers_at_m, w->speakers_m, sizeof w->speakers_m);
    memcpy(w->microphones_at_m, w->microphones_m, sizeof w->microphones_m);
    w->survey = (struct survey){.n_speakers = N,
                                .n_microphones = N,
                                .speakers_m = w->speakers_m,
                                .microphones_m = w->microphones_m,
                                .sound_speed_m_s = SOUND_M_S};
    assert_int_equal(displacement_create(&w->d, &w->survey), 0);
}

/* A bumper's: along 1 m, in turn. */
static void start_line(struct world *w)
{
    *w = (struct world){.sound_m_s = SOUND_M_S, .noise_m = 1e-4, .seed = 5};
    for (int i = 0; i < N; i++) {
        w->microphones_m[i][0] = -0.5 + i / 15.5;
        w->speakers_m[i][0] = w->microphones_m[i][0] + 0.5 / 15.5;
    }
    settle(w);
}

/* 4 x 4 of each, half a metre square, the speakers 10 cm in front. */
static void start_square(struct world *w)
{
    *w = (struct world){.sound_m_s = SOUND_M_S, .noise_m = 1e-4, .seed = 5};
    for (int i = 0; i < N; i++) {
        w->microphones_m[i][0] = 0.15 * (i % 4);
        w->microphones_m[i][1] = 0.15 * (i / 4);
        w->speakers_m[i][0] = w->microphones_m[i][0] + 0.05;
        w->speakers_m[i][1] = w->microphones_m[i][1] + 0.07;
        w->speakers_m[i][2] = 0.1;
    }
    settle(w);
}

/* Sound that wind carries: of speed c in the air, which goes at v. */
static double delay_s(const struct world *w, const double from[3], const double to[3])
{
    double way = 0.0, along = 0.0, wind = 0.0;

    for (int k = 0; k < 3; k++) {
        way += (to[k] - from[k]) * (to[k] - from[k]);
        along += (to[k] - from[k]) * w->wind_m_s[k];
        wind += w->wind_m_s[k] * w->wind_m_s[k];
    }
    double left = w->sound_m_s * w->sound_m_s - wind;
    return (sqrt(along * along + left * way) - along) / left;
}

/* The wall is told as somebody estimates it, who errs. */
static void hear_wall(struct world *w, size_t j, const double off[3], double echo_s[N])
{
    const double change[3] = {off[0], 0.0, off[2] + w->jitter_m * dice_normal(&w->seed)};
    struct wall_gate told = w->wall;
    const double *n = w->wall.plane.normal, *at = w->speakers_at_m[j];
    double beyond =
        2.0 * (w->wall.plane.distance_m - n[0] * at[0] - n[1] * at[1] - n[2] * at[2]);
    double image_m[3];

    for (int k = 0; k < 3; k++)
        image_m[k] = at[k] + beyond * n[k];
    for (int i = 0; i < N; i++)
        echo_s[i] = w->deaf[i] ? NAN
                               : delay_s(w, image_m, w->microphones_at_m[i]) + w->zero_s +
                                     2.0 * w->noise_m / SOUND_M_S * dice_normal(&w->seed);
    wall_turn(&w->wall.plane, change, &told.plane);
    displacement_wall(w->d, &told);
}

static void hear(struct world *w, int rounds)
{
    double heard_s[N], echo_s[N];

    for (int r = 0; r < rounds; r++) {
        const double off[3] = {w->off_rad * dice_normal(&w->seed), 0.0,
                               w->off_m * dice_normal(&w->seed)};
        for (size_t j = 0; j < N; j++) {
            if (w->wall.id)
                hear_wall(w, j, off, echo_s);
            for (int i = 0; i < N; i++) {
                double s = delay_s(w, w->speakers_at_m[j], w->microphones_at_m[i]) +
                           w->zero_s;
                heard_s[i] =
                    w->deaf[i] ? NAN : s + w->noise_m / SOUND_M_S * dice_normal(&w->seed);
            }
            displacement_take(w->d, j, heard_s, w->wall.id ? echo_s : NULL);
        }
    }
}

static const struct wall_gate wall_ahead = {
    .id = 3,
    .plane = {.normal = {0.0995037190209989, 0.0, 0.995037190209989}, .distance_m = 2.2}};

/* Of all elements, speakers first. */
static const struct displacement_of *of(const struct world *w, size_t e)
{
    return e < N ? displacement_speaker(w->d, e) : displacement_microphone(w->d, e - N);
}

static void check_moved(const struct world *w, size_t n, const size_t *elements)
{
    for (size_t e = 0; e < 2 * N; e++) {
        bool expected = false;
        for (size_t k = 0; k < n; k++)
            expected |= elements[k] == e;
        if (of(w, e)->moved != expected)
            fail_msg("element %zu: %d", e, of(w, e)->moved);
    }
}

static void an_element_of_a_plane_is_found_with_where_it_went(void **state)
{
    static const double by_m[][3] = {
        {0.02, 0, 0}, {0, -0.02, 0}, {0, 0, 0.02}, {0.05, 0, -0.02}, {0.004, 0.003, 0}};
    struct world w;

    (void)state;
    for (size_t k = 0; k < 5; k++)
        for (size_t e = 0; e < 2 * N; e += 5) {
            double off = 0.0;
            start_square(&w);
            hear(&w, 20);
            check_moved(&w, 0, NULL);
            double *at = e < N ? w.speakers_at_m[e] : w.microphones_at_m[e - N];
            for (int a = 0; a < 3; a++)
                at[a] += by_m[k][a];
            hear(&w, 20);
            check_moved(&w, 1, &e);
            for (int a = 0; a < 3; a++)
                off += pow(of(&w, e)->by_m[a] - by_m[k][a], 2);
            assert_below(sqrt(off), 1e-3);
            assert_near(of(&w, e)->across_m, 0.0, 0.0);
            displacement_destroy(w.d);
        }
}

/* All that a line hears of what goes across it is how far. */
static void along_a_line_across_is_told_without_its_side(void **state)
{
    struct world w;
    size_t e = N + 7;

    (void)state;
    start_line(&w);
    hear(&w, 20);
    w.microphones_at_m[7][0] += 0.01;
    w.microphones_at_m[7][1] += 0.012;
    w.microphones_at_m[7][2] -= 0.016;
    hear(&w, 20);
    check_moved(&w, 1, &e);
    assert_near(of(&w, e)->by_m[0], 0.01, 1e-3);
    assert_near(of(&w, e)->by_m[1], 0.0, 1e-6);
    assert_near(of(&w, e)->by_m[2], 0.0, 1e-6);
    assert_near(of(&w, e)->across_m, 0.02, 1e-3);
    assert_near(of(&w, e)->size_m, sqrt(5e-4), 1e-3);
    displacement_destroy(w.d);
}

/* What goes up or down stays open: no path over the wall is another by it. */
static void the_echo_of_a_wall_tells_to_which_side_of_a_line_it_went(void **state)
{
    static const double by_m[][3] = {{0.01, 0.012, -0.016}, {0, 0, 0.02},
                                     {0, 0, -0.02},         {0.02, 0, 0},
                                     {-0.01, -0.02, 0},     {0.004, 0, 0.025}};
    struct world w;

    (void)state;
    for (size_t k = 0; k < 6; k++)
        for (size_t e = 0; e < 2 * N; e += 4) {
            start_line(&w);
            w.wall = wall_ahead;
            w.deaf[3] = true;
            w.off_m = w.off_rad = 2e-3;
            w.jitter_m = e < N ? 1e-4 : 5e-3; /* the vehicle stands; it drives */
            hear(&w, 30);
            double *at = e < N ? w.speakers_at_m[e] : w.microphones_at_m[e - N];
            for (int a = 0; a < 3; a++)
                at[a] += by_m[k][a];
            hear(&w, 25);
            check_moved(&w, 1, &e);
            assert_true(of(&w, e)->placed);
            assert_near(of(&w, e)->by_m[0], by_m[k][0], 1e-3);
            assert_near(of(&w, e)->by_m[2], by_m[k][2], 1.5e-3);
            displacement_destroy(w.d);
        }
}

/* Not heard before, or another one since: it tells nothing of what went before. */
static void a_wall_that_is_new_places_nobody(void **state)
{
    struct world w;
    size_t e = N + 7;

    (void)state;
    for (int k = 0; k < 3; k++) {
        start_line(&w);
        w.wall = wall_ahead;
        w.wall.id = k == 0 ? 0 : 3;
        hear(&w, 30);
        w.microphones_at_m[7][0] += 0.01;
        w.microphones_at_m[7][2] -= 0.016;
        hear(&w, k == 2 ? 8 : 0); /* it is told by then */
        w.wall.id = 4;
        hear(&w, 40);
        check_moved(&w, 1, &e);
        assert_false(of(&w, e)->placed);
        displacement_destroy(w.d);
    }
}

/* It has a place again, and who else had moved has still moved; from there it may go on.
 */
static void who_stands_where_the_survey_has_it_by_now_has_not_moved(void **state)
{
    struct world w;
    size_t other = N + 3, both[] = {N + 3, N + 7};

    (void)state;
    start_line(&w);
    w.wall = wall_ahead;
    hear(&w, 30);
    w.microphones_at_m[7][0] += 0.01;
    w.microphones_at_m[7][2] -= 0.016;
    w.microphones_at_m[3][0] -= 0.02;
    hear(&w, 25);
    check_moved(&w, 2, both);
    memcpy(w.microphones_m[7], w.microphones_at_m[7], sizeof w.microphones_m[7]);
    displacement_stand(w.d, &w.survey);
    check_moved(&w, 1, &other);
    for (int r = 0; r < 20; r++) {
        hear(&w, 1);
        check_moved(&w, 1, &other);
    }
    assert_near(of(&w, other)->by_m[0], -0.02, 1e-3);
    w.microphones_at_m[7][2] -= 0.02;
    hear(&w, 25);
    check_moved(&w, 2, both);
    assert_true(of(&w, N + 7)->placed);
    assert_near(of(&w, N + 7)->by_m[0], 0.0, 1e-3);
    assert_near(of(&w, N + 7)->by_m[2], -0.02, 1.5e-3);
    displacement_destroy(w.d);
}

/* A speaker sounds once in a round: while the wall is off by centimetres from ping to
 * ping nobody knows whether it has moved or the vehicle. */
static void while_the_vehicle_drives_a_speaker_is_not_placed(void **state)
{
    struct world w;
    size_t e = 5;

    (void)state;
    start_line(&w);
    w.wall = wall_ahead;
    w.jitter_m = 0.02;
    hear(&w, 30);
    w.speakers_at_m[5][2] += 0.02;
    for (int r = 0; r < 40; r++) {
        hear(&w, 1);
        assert_false(of(&w, e)->placed);
    }
    check_moved(&w, 1, &e);
    displacement_destroy(w.d);
}

/* Somebody stood before it, and it has its id still. */
static void a_wall_that_is_back_tells_as_before(void **state)
{
    struct world w;
    size_t e = N + 7;

    (void)state;
    start_line(&w);
    w.wall = wall_ahead;
    hear(&w, 30);
    w.wall.id = 0;
    displacement_wall(w.d, NULL);
    hear(&w, 5);
    w.microphones_at_m[7][0] += 0.01;
    w.microphones_at_m[7][2] -= 0.016;
    hear(&w, 20);
    check_moved(&w, 1, &e);
    assert_false(of(&w, e)->placed);
    w.wall = wall_ahead;
    hear(&w, 20);
    assert_true(of(&w, e)->placed);
    assert_near(of(&w, e)->by_m[2], -0.016, 1.5e-3);
    displacement_destroy(w.d);
}

static void without_a_wall_who_is_told_wholly_is_placed(void **state)
{
    struct world w;
    size_t e = 6;

    (void)state;
    start_square(&w);
    hear(&w, 20);
    w.speakers_at_m[6][0] += 0.02;
    w.speakers_at_m[6][2] -= 0.01;
    hear(&w, 20);
    check_moved(&w, 1, &e);
    assert_true(of(&w, e)->placed);
    assert_near(of(&w, e)->by_m[0], 0.02, 1e-3);
    assert_near(of(&w, e)->by_m[2], -0.01, 1e-3);
    displacement_destroy(w.d);
}

static void errors_are_as_large_as_they_are_stated(void **state)
{
    struct world w;
    double sum = 0.0;
    enum { DRAWS = 100 };

    (void)state;
    for (unsigned k = 0; k < DRAWS; k++) {
        start_square(&w);
        w.seed = 100 + k;
        w.noise_m = 1e-3;
        hear(&w, 20);
        w.microphones_at_m[5][0] += 0.03;
        hear(&w, 20);
        const struct displacement_of *is = displacement_microphone(w.d, 5);
        assert_true(is->moved);
        sum += pow((is->size_m - 0.03) / is->sigma_m, 2);
        displacement_destroy(w.d);
    }
    assert_true(sum / DRAWS > 0.3 && sum / DRAWS < 2.0);
}

/* 5 K, a wind of 5 m/s along and 3 across, and a clock that is late by half a sample. */
static void air_wind_and_time_zero_move_nobody(void **state)
{
    struct world w;

    (void)state;
    for (int square = 0; square < 2; square++) {
        (square ? start_square : start_line)(&w);
        hear(&w, 20);
        for (int step = 1; step <= 50; step++) {
            w.sound_m_s = SOUND_M_S * (1.0 + 0.0085 * step / 50.0);
            w.wind_m_s[0] = 5.0 * step / 50.0;
            w.wind_m_s[2] = 3.0 * step / 50.0;
            w.zero_s = 1e-5 * step / 50.0;
            hear(&w, 2);
            check_moved(&w, 0, NULL);
        }
        displacement_destroy(w.d);
    }
}

static void in_other_air_a_knock_is_as_long(void **state)
{
    struct world w;
    size_t e = N + 6;

    (void)state;
    for (int square = 0; square < 2; square++) {
        (square ? start_square : start_line)(&w);
        hear(&w, 20);
        w.sound_m_s = 1.0085 * SOUND_M_S;
        w.wind_m_s[0] = 5.0;
        w.zero_s = 1e-5;
        w.microphones_at_m[6][0] += 0.02;
        hear(&w, 20);
        check_moved(&w, 1, &e);
        assert_near(of(&w, e)->by_m[0], 0.02, 5e-4);
        displacement_destroy(w.d);
    }
}

/* The pair that is nearest to each other hears where both stood before, too: the survey
 * has them millimetres beside it.  Who was not knocked is not named. */
static void beside_a_knocked_one_nobody_else_is_named(void **state)
{
    (void)state;
    for (unsigned k = 0; k < 60; k++) {
        struct world w;
        size_t e = N + 9;
        start_line(&w);
        w.seed = 40 + k;
        for (int i = 0; i < N; i++)
            for (int a = 0; a < 3; a++) {
                w.speakers_at_m[i][a] += 2e-3 * dice_normal(&w.seed);
                w.microphones_at_m[i][a] += 2e-3 * dice_normal(&w.seed);
            }
        hear(&w, 20);
        w.microphones_at_m[9][0] += 0.01;
        w.microphones_at_m[9][1] += 0.005;
        w.microphones_at_m[9][2] += 0.016;
        for (int r = 0; r < 20; r++) {
            hear(&w, 1);
            for (size_t other = 0; other < 2 * N; other++)
                if (other != e && of(&w, other)->moved)
                    fail_msg("seed %u: element %zu", 40 + k, other);
        }
        check_moved(&w, 1, &e);
        displacement_destroy(w.d);
    }
}

static void two_that_were_knocked_are_both_named_and_one_that_is_back_is_not(void **state)
{
    struct world w;
    size_t both[] = {3, N + 4}, one = 3;

    (void)state;
    start_line(&w);
    hear(&w, 20);
    w.speakers_at_m[3][0] -= 0.015;
    w.microphones_at_m[4][0] += 0.02;
    hear(&w, 20);
    check_moved(&w, 2, both);
    assert_near(of(&w, 3)->by_m[0], -0.015, 1e-3);
    assert_near(of(&w, N + 4)->by_m[0], 0.02, 1e-3);
    w.microphones_at_m[4][0] -= 0.02;
    hear(&w, 20);
    check_moved(&w, 1, &one);
    displacement_destroy(w.d);
}

/* The median of the newest arrivals has it in more than half of their rounds, and as many
 * rounds as confirm it are one after the other then. */
static void a_move_is_told_once_rounds_confirm_it_and_a_passing_one_never(void **state)
{
    const int seen = DISPLACEMENT_RING / 2;
    struct world w;
    size_t e = N + 6;

    (void)state;
    start_line(&w);
    hear(&w, 20);
    for (int k = 0; k < 3; k++) { /* it was somebody who went by */
        w.microphones_at_m[6][0] += 0.02;
        hear(&w, DISPLACEMENT_CONFIRM - 1);
        check_moved(&w, 0, NULL);
        w.microphones_at_m[6][0] -= 0.02;
        for (int round = 0; round < 6; round++) {
            hear(&w, 1);
            check_moved(&w, 0, NULL);
        }
    }
    w.microphones_at_m[6][0] += 0.02;
    hear(&w, seen + DISPLACEMENT_CONFIRM - 1);
    check_moved(&w, 0, NULL);
    hear(&w, 2);
    check_moved(&w, 1, &e);
    displacement_destroy(w.d);
}

/* Nor is one that was told before taken for well because nothing is heard of it. */
static void who_hears_nothing_is_not_called_moved(void **state)
{
    struct world w;
    size_t e = N + 9;

    (void)state;
    start_line(&w);
    hear(&w, 20);
    w.deaf[2] = true;
    hear(&w, 20);
    check_moved(&w, 0, NULL);
    w.microphones_at_m[9][0] += 0.02;
    hear(&w, 20);
    check_moved(&w, 1, &e);
    w.deaf[9] = true;
    hear(&w, 20);
    check_moved(&w, 1, &e);
    displacement_destroy(w.d);
}

/* A channel that is late by itself, as a microphone behind a cover is, has gone nowhere:
 * in the middle of a line no displacement makes all its paths longer alike. */
static void a_channel_that_is_late_has_not_moved(void **state)
{
    struct world w;
    double heard_s[N];

    (void)state;
    start_line(&w);
    hear(&w, 20);
    for (int r = 0; r < 20; r++)
        for (size_t j = 0; j < N; j++) {
            for (int i = 0; i < N; i++)
                heard_s[i] = delay_s(&w, w.speakers_m[j], w.microphones_m[i]) +
                             (i == 7 ? 3e-5 : 0.0);
            displacement_take(w.d, j, heard_s, NULL);
        }
    check_moved(&w, 0, NULL);
    displacement_destroy(w.d);
}

/* A bump while it was parked.  Also in air, with a wind and a clock that nobody knows. */
static void who_was_moved_before_the_start_is_named_with_where_it_stands(void **state)
{
    static const double by_m[][3] = {{0.02, 0, 0}, {0, -0.03, 0}, {0.03, 0, -0.02}};
    struct world w;

    (void)state;
    for (size_t k = 0; k < 3; k++)
        for (size_t e = 0; e < 2 * N; e += 5) {
            double off = 0.0;
            start_square(&w);
            w.sound_m_s = 1.0085 * SOUND_M_S;
            w.wind_m_s[0] = 3.0;
            w.zero_s = 5e-4;
            double *at = e < N ? w.speakers_at_m[e] : w.microphones_at_m[e - N];
            for (int a = 0; a < 3; a++)
                at[a] += by_m[k][a];
            hear(&w, 25);
            check_moved(&w, 1, &e);
            assert_true(of(&w, e)->at_start);
            assert_true(of(&w, e)->placed);
            for (int a = 0; a < 3; a++)
                off += pow(of(&w, e)->by_m[a] - by_m[k][a], 2);
            assert_below(sqrt(off), 1e-3);
            displacement_destroy(w.d);
        }
}

static void a_wall_tells_to_which_side_it_went_before_the_start(void **state)
{
    static const double by_m[][3] = {
        {0.01, 0.012, -0.016}, {0, 0, 0.02}, {0.02, 0, -0.02}};
    struct world w;

    (void)state;
    for (size_t k = 0; k < 3; k++)
        for (size_t e = 1; e < 2 * N; e += 10) {
            start_line(&w);
            w.wall = wall_ahead;
            w.off_m = w.off_rad = 2e-3;
            double *at = e < N ? w.speakers_at_m[e] : w.microphones_at_m[e - N];
            for (int a = 0; a < 3; a++)
                at[a] += by_m[k][a];
            hear(&w, 35);
            check_moved(&w, 1, &e);
            assert_true(of(&w, e)->placed);
            assert_near(of(&w, e)->by_m[0], by_m[k][0], 1e-3);
            assert_near(of(&w, e)->by_m[2], by_m[k][2], 1.5e-3);
            double *surveyed = e < N ? w.speakers_m[e] : w.microphones_m[e - N];
            for (int a = 0; a < 3; a++)
                surveyed[a] += of(&w, e)->by_m[a];
            displacement_stand(w.d, &w.survey);
            for (int r = 0; r < 20; r++) {
                hear(&w, 1);
                check_moved(&w, 0, NULL);
            }
            at[0] += 0.01; /* and is knocked again */
            at[2] -= 0.01;
            hear(&w, 25);
            check_moved(&w, 1, &e);
            assert_false(of(&w, e)->at_start);
            assert_true(of(&w, e)->placed);
            assert_near(of(&w, e)->by_m[0], 0.01, 1e-3);
            assert_near(of(&w, e)->by_m[2], -0.01, 1.5e-3);
            displacement_destroy(w.d);
        }
}

static void who_is_put_right_after_the_start_has_not_moved_any_more(void **state)
{
    struct world w;
    size_t e = N + 6;

    (void)state;
    start_line(&w);
    w.microphones_at_m[6][0] += 0.02;
    hear(&w, 25);
    check_moved(&w, 1, &e);
    w.microphones_at_m[6][0] -= 0.02;
    hear(&w, 20);
    check_moved(&w, 0, NULL);
    displacement_destroy(w.d);
}

/* 4 mm each axis, which is 7 of the whole way, and nobody is named; who stands far out of
 * these is, but where it is to a millimetre is not told then. */
static void places_measured_by_hand_are_what_they_are(void **state)
{
    size_t named = 0;

    (void)state;
    for (unsigned k = 0; k < 24; k++) {
        struct world w;
        size_t e = N + 9;
        (k % 2 ? start_line : start_square)(&w);
        w.seed = 40 + k;
        w.wall = wall_ahead;
        for (int i = 0; i < N; i++)
            for (int a = 0; a < 3; a++) {
                w.speakers_at_m[i][a] += 4e-3 * dice_normal(&w.seed);
                w.microphones_at_m[i][a] += 4e-3 * dice_normal(&w.seed);
            }
        if (k >= 16)
            w.microphones_at_m[9][0] += 0.05;
        hear(&w, 35); /* in which who stands among others is placed, above */
        named += of(&w, e)->moved;
        assert_false(of(&w, e)->placed);
        for (size_t other = 0; other < 2 * N; other++)
            if ((k < 16 || other != e) && of(&w, other)->moved)
                fail_msg("seed %u: element %zu", 40 + k, other);
        displacement_destroy(w.d);
    }
    assert_true(named >= 6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_element_of_a_plane_is_found_with_where_it_went),
        cmocka_unit_test(along_a_line_across_is_told_without_its_side),
        cmocka_unit_test(the_echo_of_a_wall_tells_to_which_side_of_a_line_it_went),
        cmocka_unit_test(a_wall_that_is_new_places_nobody),
        cmocka_unit_test(who_stands_where_the_survey_has_it_by_now_has_not_moved),
        cmocka_unit_test(while_the_vehicle_drives_a_speaker_is_not_placed),
        cmocka_unit_test(a_wall_that_is_back_tells_as_before),
        cmocka_unit_test(without_a_wall_who_is_told_wholly_is_placed),
        cmocka_unit_test(errors_are_as_large_as_they_are_stated),
        cmocka_unit_test(air_wind_and_time_zero_move_nobody),
        cmocka_unit_test(in_other_air_a_knock_is_as_long),
        cmocka_unit_test(beside_a_knocked_one_nobody_else_is_named),
        cmocka_unit_test(
            two_that_were_knocked_are_both_named_and_one_that_is_back_is_not),
        cmocka_unit_test(a_move_is_told_once_rounds_confirm_it_and_a_passing_one_never),
        cmocka_unit_test(who_hears_nothing_is_not_called_moved),
        cmocka_unit_test(a_channel_that_is_late_has_not_moved),
        cmocka_unit_test(who_was_moved_before_the_start_is_named_with_where_it_stands),
        cmocka_unit_test(a_wall_tells_to_which_side_it_went_before_the_start),
        cmocka_unit_test(who_is_put_right_after_the_start_has_not_moved_any_more),
        cmocka_unit_test(places_measured_by_hand_are_what_they_are),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
