/* SPDX-License-Identifier: MIT */
/* Arrays whose elements stand elsewhere than the survey says: what the arrivals tell is
 * found, and what they do not tell is left alone and called unknown.  Ways are those of
 * the mirrored microphone here. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <errno.h>

#include "hal/random.h"
#include "hal/survey/element_places.h"
#include "tests/nodes/near.h"

#define RATE_HZ   48e3
#define SPEED_M_S 343.2
#define LATENCY_S 2.5e-3
#define PLACED_M  0.01

enum { N = 8, ELEMENTS = 2 * N, MOST = 8 * N * N };

struct world {
    double surveyed_m[ELEMENTS][3], really_m[ELEMENTS][3];
    struct element_plane planes[2], guesses[2];
    size_t n_planes, n;
    double speed_m_s;
    struct element_arrival arrivals[MOST];
    struct random random;
};

/* A column of 1 m, microphones 8 cm beside the speakers. */
static void stand(struct world *w, double off_m, uint64_t seed)
{
    memset(w, 0, sizeof *w);
    random_seed(&w->random, &seed, 1);
    w->speed_m_s = SPEED_M_S;
    for (int e = 0; e < ELEMENTS; e++) {
        const double at[3] = {e < N ? 0.0 : 0.08, (e % N) / 7.0, 0.0};
        for (int a = 0; a < 3; a++) {
            w->surveyed_m[e][a] = at[a];
            w->really_m[e][a] = at[a] + off_m * random_normal(&w->random);
        }
    }
}

static double apart(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static void hear(struct world *w, uint32_t plane, double carried_x_m, double noise_m)
{
    for (uint32_t s = 0; s < N; s++)
        for (uint32_t m = 0; m < N; m++) {
            struct element_arrival *a = &w->arrivals[w->n++];
            double speaker[3], microphone[3];
            memcpy(speaker, w->really_m[s], sizeof speaker);
            memcpy(microphone, w->really_m[N + m], sizeof microphone);
            speaker[0] += carried_x_m;
            microphone[0] += carried_x_m;
            if (plane != ELEMENT_PLACES_STRAIGHT) {
                const struct element_plane *p = &w->planes[plane];
                double d = p->normal[0] * microphone[0] + p->normal[1] * microphone[1] +
                           p->normal[2] * microphone[2] - p->distance_m;
                for (int k = 0; k < 3; k++)
                    microphone[k] -= 2.0 * d * p->normal[k];
            }
            double way = apart(speaker, microphone) + noise_m * random_normal(&w->random);
            *a = (struct element_arrival){
                s, m, plane, {carried_x_m, 0, 0}, LATENCY_S + way / w->speed_m_s};
        }
}

/* A wall turned about the upright axis, guessed wrong by 3 cm and 2 degrees. */
static void add_plane(struct world *w, double turned_rad, double distance_m)
{
    struct element_plane *p = &w->planes[w->n_planes], *g = &w->guesses[w->n_planes++];
    *p = (struct element_plane){{sin(turned_rad), 0.0, cos(turned_rad)}, distance_m};
    turned_rad += 0.035;
    *g = (struct element_plane){{sin(turned_rad), 0.0, cos(turned_rad)},
                                distance_m + 0.03};
}

static struct element_places_config config_of(const struct world *w)
{
    return (struct element_places_config){
        .n_speakers = N,
        .n_microphones = N,
        .speakers_m = (const double(*)[3])w->surveyed_m,
        .microphones_m = (const double(*)[3])w->surveyed_m + N,
        .placed_sigma_m = PLACED_M,
        .sound_speed_m_s = SPEED_M_S,
        .sound_speed_sigma_m_s = 0.3,
        .latency_s = LATENCY_S + 5.0 / RATE_HZ,
        .channel_sigma_s = 1e-7,
        .n_planes = w->n_planes,
        .planes = w->guesses,
        .lean_sigma_rad = 0.035,
    };
}

static void fit(const struct world *w, const struct element_places_config *cfg,
                struct element_places *out)
{
    struct error why = {.text = ""};
    if (element_places_fit(out, cfg, w->arrivals, w->n, &why))
        fail_msg("%s", why.text);
}

/* What is left of the places' errors, as far as they are of the shape. */
static void errors_of(const struct world *w, const struct element_places *p,
                      double (*out)[3])
{
    for (int e = 0; e < ELEMENTS; e++)
        for (int a = 0; a < 3; a++)
            out[e][a] = p->elements_m[e][a] - w->really_m[e][a];
    assert_int_equal(
        element_places_shape(ELEMENTS, (const double(*)[3])p->elements_m, out), 0);
}

static double rms(const double (*x)[3], int axis)
{
    double sum = 0.0;
    for (int e = 0; e < ELEMENTS; e++)
        sum += x[e][axis] * x[e][axis];
    return sqrt(sum / ELEMENTS);
}

/* Two walls, heard from both ends of the stage. */
static void hear_all(struct world *w, double noise_m)
{
    add_plane(w, 0.45, 1.5);
    add_plane(w, -0.45, 1.4);
    hear(w, ELEMENT_PLACES_STRAIGHT, 0.0, noise_m);
    hear(w, ELEMENT_PLACES_STRAIGHT, 1.0, noise_m);
    for (uint32_t p = 0; p < 2; p++) {
        hear(w, p, 0.0, noise_m);
        hear(w, p, 1.0, noise_m);
    }
}

static void two_walls_tell_where_everything_stands(void **state)
{
    struct world w;
    struct element_places p;
    double errors[ELEMENTS][3];
    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        stand(&w, PLACED_M, seed);
        hear_all(&w, 2e-4);
        struct element_places_config cfg = config_of(&w);
        fit(&w, &cfg, &p);
        errors_of(&w, &p, errors);
        for (int a = 0; a < 3; a++)
            assert_true(rms((const double(*)[3])errors, a) < 1e-3);
        assert_true(p.before_rms_m > 5e-3);
        assert_near(p.rms_m, 2e-4, 4e-5);
        assert_near(p.latency_s, LATENCY_S, 0.1 / RATE_HZ);
        element_places_clear(&p);
    }
}

static void the_stated_sigma_is_that_of_the_errors(void **state)
{
    struct world w;
    struct element_places p;
    double errors[ELEMENTS][3], sum = 0.0;
    enum { SEEDS = 12 };
    (void)state;
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        stand(&w, PLACED_M, 100 + seed);
        w.speed_m_s += 0.3 * random_normal(&w.random); /* as config_of has it */
        hear_all(&w, 5e-4);
        struct element_places_config cfg = config_of(&w);
        fit(&w, &cfg, &p);
        errors_of(&w, &p, errors);
        for (int e = 0; e < ELEMENTS; e++)
            for (int a = 0; a < 3; a++)
                sum += errors[e][a] * errors[e][a] / (p.sigma_m[e][a] * p.sigma_m[e][a]);
        element_places_clear(&p);
    }
    /* 12 x 48 squares: one to 6 %, if they did not hang together. */
    assert_near(sum / (SEEDS * ELEMENTS * 3), 1.0, 0.25);
}

/* Nothing but the column itself: what is across it, out of the plane of speakers and
 * microphones, is not told, and what is along it is. */
static void what_is_not_told_stays_and_is_called_unknown(void **state)
{
    struct world w;
    struct element_places p;
    (void)state;
    stand(&w, 0.0, 7);
    hear(&w, ELEMENT_PLACES_STRAIGHT, 0.0, 2e-4);
    struct element_places_config cfg = config_of(&w);
    fit(&w, &cfg, &p);
    for (int e = 0; e < ELEMENTS; e++) {
        assert_near(p.elements_m[e][2], w.surveyed_m[e][2], 2e-3);
        assert_true(p.sigma_m[e][2] > 0.8 * PLACED_M);
        assert_true(p.sigma_m[e][1] < 0.15 * PLACED_M);
    }
    element_places_clear(&p);
}

/* What a stage tells, how the column stands about itself against walls of which nobody
 * knows how they are turned, is left open without one: all offsets across it turn with
 * them.  16 elements known to 10 mm on each side of 8 cm tell it to 0.1 rad or so, some
 * millimetres; what they are to each other is told to some tenths. */
static void how_a_column_is_turned_about_itself_is_in_its_sigma(void **state)
{
    struct world w;
    struct element_places p;
    double across_m = 0.0;
    (void)state;
    stand(&w, PLACED_M, 17);
    add_plane(&w, 0.45, 1.5);
    add_plane(&w, -0.45, 1.4);
    hear(&w, ELEMENT_PLACES_STRAIGHT, 0.0, 2e-4);
    for (uint32_t plane = 0; plane < 2; plane++)
        hear(&w, plane, 0.0, 2e-4);
    struct element_places_config cfg = config_of(&w);
    fit(&w, &cfg, &p);
    for (int e = 0; e < ELEMENTS; e++)
        across_m += p.sigma_m[e][2] / ELEMENTS;
    assert_true(across_m > 1e-3 && across_m < PLACED_M);
    element_places_clear(&p);
}

static void wrong_arrivals_are_outvoted(void **state)
{
    struct world w;
    struct element_places p;
    double errors[ELEMENTS][3];
    (void)state;
    stand(&w, PLACED_M, 11);
    hear_all(&w, 2e-4);
    for (size_t i = 0; i < w.n; i += 10)
        w.arrivals[i].arrival_s += (i % 20 ? 0.06 : -0.04) / SPEED_M_S;
    struct element_places_config cfg = config_of(&w);
    fit(&w, &cfg, &p);
    errors_of(&w, &p, errors);
    for (int a = 0; a < 3; a++)
        assert_true(rms((const double(*)[3])errors, a) < 1e-3);
    assert_true(p.n_used <= w.n - (w.n + 9) / 10);
    assert_true(p.n_used > w.n * 8 / 10);
    element_places_clear(&p);
}

/* What a channel delays is not taken for a place, and is found. */
static void a_channel_may_be_late(void **state)
{
    struct world w;
    struct element_places p;
    double errors[ELEMENTS][3];
    (void)state;
    stand(&w, PLACED_M, 21);
    hear_all(&w, 1e-4);
    for (size_t i = 0; i < w.n; i++)
        w.arrivals[i].arrival_s += (w.arrivals[i].microphone == 3) * 3e-6;
    struct element_places_config cfg = config_of(&w);
    cfg.channel_sigma_s = 1e-6;
    fit(&w, &cfg, &p);
    errors_of(&w, &p, errors);
    for (int a = 0; a < 3; a++)
        assert_true(rms((const double(*)[3])errors, a) < 1e-3);
    assert_near(p.channel_s[N + 3] - p.channel_s[N + 2], 3e-6, 5e-7);
    element_places_clear(&p);
}

/* Elements that stand where they should tell the speed of sound instead. */
static void places_that_are_known_tell_the_speed(void **state)
{
    struct world w;
    struct element_places p;
    (void)state;
    stand(&w, 0.0, 5);
    w.speed_m_s = 1.01 * SPEED_M_S;
    hear_all(&w, 2e-4);
    struct element_places_config cfg = config_of(&w);
    cfg.placed_sigma_m = 5e-4;
    cfg.sound_speed_sigma_m_s = 5.0;
    fit(&w, &cfg, &p);
    assert_near(p.sound_speed_m_s, w.speed_m_s, 5e-4 * w.speed_m_s);
    assert_near(p.latency_s, LATENCY_S, 0.1 / RATE_HZ);
    assert_true(p.sound_speed_sigma_m_s < 5e-4 * SPEED_M_S);
    element_places_clear(&p);
}

static void bad_input_is_refused(void **state)
{
    struct world w;
    struct element_places p;
    struct error why = {.text = ""};
    (void)state;
    stand(&w, 0.0, 1);
    hear(&w, ELEMENT_PLACES_STRAIGHT, 0.0, 0.0);
    struct element_places_config good = config_of(&w), cfg = good;
    assert_int_equal(element_places_fit(&p, &cfg, w.arrivals, 0, &why), -ENODATA);
    cfg.n_speakers = ELEMENT_PLACES_MOST;
    assert_int_equal(element_places_fit(&p, &cfg, w.arrivals, w.n, &why), -EINVAL);
    cfg = good;
    cfg.placed_sigma_m = NAN;
    assert_int_equal(element_places_fit(&p, &cfg, w.arrivals, w.n, &why), -EINVAL);
    w.arrivals[3].plane = 0;
    assert_int_equal(element_places_fit(&p, &good, w.arrivals, w.n, &why), -EINVAL);
    w.arrivals[3].plane = ELEMENT_PLACES_STRAIGHT;
    w.arrivals[3].arrival_s = NAN;
    assert_int_equal(element_places_fit(&p, &good, w.arrivals, w.n, &why), -EINVAL);
}

/* Sound that has nothing to do with the array. */
static void arrivals_that_do_not_agree_scatter(void **state)
{
    struct world w;
    struct element_places p;
    (void)state;
    stand(&w, 0.0, 1);
    hear(&w, ELEMENT_PLACES_STRAIGHT, 0.0, 0.0);
    for (size_t i = 0; i < w.n; i++)
        w.arrivals[i].arrival_s += (i % 5 < 3) * 2e-3 * random_even(&w.random);
    struct element_places_config cfg = config_of(&w);
    fit(&w, &cfg, &p);
    assert_true(p.rms_m > 0.05); /* of up to 0.69 m */
    element_places_clear(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_walls_tell_where_everything_stands),
        cmocka_unit_test(the_stated_sigma_is_that_of_the_errors),
        cmocka_unit_test(what_is_not_told_stays_and_is_called_unknown),
        cmocka_unit_test(how_a_column_is_turned_about_itself_is_in_its_sigma),
        cmocka_unit_test(wrong_arrivals_are_outvoted),
        cmocka_unit_test(a_channel_may_be_late),
        cmocka_unit_test(places_that_are_known_tell_the_speed),
        cmocka_unit_test(bad_input_is_refused),
        cmocka_unit_test(arrivals_that_do_not_agree_scatter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
