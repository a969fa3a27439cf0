/* SPDX-License-Identifier: MIT */
/* An image that somebody stops: at any of the places where it asks, it ends without one
 * question more, and the next one is as if that had not been. */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/imager_options.h"
#include "recon/planning/probe.h"
#include "tests/recon/rig.h"

#define PLACES 16 /* of all those where it asks */

static const struct scatterer points[] = {{{0.03, -0.02, 1.1}, 1.0},
                                          {{-0.05, 0.04, 1.13}, 0.8}};

struct way { /* of making an image */
    const char *method, *base;
};

static const struct way ways[] = {
    {"fast", NULL},      {"backprojection", NULL},
    {"confocal", NULL},  {"lct", NULL},
    {"paper", NULL},     {"incoherent", NULL},
    {"iterative", NULL}, {"iterative", "lct"},
    {"sparse", NULL},    {"iterative", "backprojection"},
};
enum { WAYS = sizeof ways / sizeof *ways };

struct stopper {
    size_t asked, at;
};

static bool stop_at(void *ctx)
{
    struct stopper *s = ctx;

    return s->asked++ >= s->at;
}

/* From now on, at the question number `at`, from 0. */
static void stop(struct pool *pool, struct stopper *s, size_t at)
{
    *s = (struct stopper){.at = at};
    pool_stop_by(pool, stop_at, s);
}

static void array_for(struct rig *r, const struct way *w)
{
    if (!strcmp(w->method, "confocal") || !strcmp(w->method, "lct"))
        rig_pairs(r);
    else
        rig_default(r);
    rig_look_at(r, 0.0, 0.0, 1.1, 9, 0.03);
}

static int create(struct imager **out, const struct rig *r, const struct way *w,
                  struct pool *pool)
{
    struct imager_config cfg = rig_config(r, w->method, pool);
    struct imager_options options;

    imager_options_default(&options);
    options.iterations = 40;
    if (w->base)
        options.base = w->base;
    cfg.options = &options;
    return imager_create(out, &cfg, NULL);
}

static size_t place(size_t i, size_t asked)
{
    return i < PLACES / 2 ? i : asked - 1 - (i - PLACES / 2) * asked / (PLACES / 2);
}

static void check_image(const struct way *w, size_t threads)
{
    struct rig r;
    struct pool *pool;
    struct imager *im;
    struct stopper s;

    array_for(&r, w);
    size_t size = grid_size(&r.grid) * sizeof(float);
    float *whole = malloc(size), *image = malloc(size);
    assert_non_null(whole);
    assert_non_null(image);
    assert_int_equal(pool_create(&pool, threads), 0);
    assert_int_equal(create(&im, &r, w, pool), 0);
    rig_add(&r, im, points, 2);
    assert_int_equal(imager_image(im, whole), 0);
    stop(pool, &s, SIZE_MAX);
    assert_int_equal(imager_image(im, image), 0);
    assert_memory_equal(image, whole, size);
    size_t asked = s.asked;
    assert_in_range(asked, threads > 1 ? 1 : 2, SIZE_MAX);
    for (size_t i = 0; i < PLACES; i++) {
        size_t at = threads > 1 ? i : place(i, asked); /* which of them ask, varies */
        if (at >= asked)
            continue;
        stop(pool, &s, at);
        int err = imager_image(im, image);
        if (threads == 1 && (err != -ECANCELED || s.asked != at + 1))
            fail_msg("%s, stopped at %zu of %zu: %d after %zu", w->method, at, asked, err,
                     s.asked);
        pool_stop_by(pool, NULL, NULL);
        assert_int_equal(imager_image(im, image), 0);
        if (memcmp(image, whole, size))
            fail_msg("%s: another image after one that was stopped at %zu of %zu",
                     w->method, at, asked);
    }
    imager_destroy(im);
    pool_destroy(pool);
    free(image);
    free(whole);
}

static void an_image_is_stopped_wherever_it_asks_and_leaves_no_trace(void **state)
{
    (void)state;
    for (size_t i = 0; i < WAYS; i++)
        check_image(&ways[i], 1);
}

static void so_it_is_with_several_threads(void **state)
{
    (void)state;
    for (size_t i = 0; i < WAYS; i++)
        check_image(&ways[i], 3);
}

static void a_plan_that_is_stopped_is_none(void **state)
{
    (void)state;
    for (size_t i = 0; i < WAYS; i++) {
        struct rig r;
        struct pool *pool;
        struct imager *im = NULL;
        struct stopper s;
        array_for(&r, &ways[i]);
        assert_int_equal(pool_create(&pool, 1), 0);
        stop(pool, &s, SIZE_MAX);
        assert_int_equal(create(&im, &r, &ways[i], pool), 0);
        imager_destroy(im);
        im = NULL;
        size_t asked = s.asked;
        for (size_t k = 0; k < PLACES; k++) {
            if (place(k, asked) >= asked)
                continue;
            stop(pool, &s, place(k, asked));
            assert_int_equal(create(&im, &r, &ways[i], pool), -ECANCELED);
            assert_null(im);
            assert_int_equal(s.asked, place(k, asked) + 1);
        }
        pool_destroy(pool);
    }
}

static void so_are_traces_and_a_look_at_them(void **state)
{
    struct rig r;
    struct pool *pool;
    struct imager *im;
    struct stopper s;
    struct probe probe;

    (void)state;
    rig_default(&r);
    assert_int_equal(pool_create(&pool, 1), 0);
    struct trace_set set = rig_traces(&r, points, 2);
    im = rig_imager(&r, "fast", pool);
    stop(pool, &s, 2);
    assert_int_equal(trace_set_feed(&set, im, pool), -ECANCELED);
    assert_int_equal(imager_pings(im), 2 * r.geometry.n_speakers);
    imager_destroy(im);
    stop(pool, &s, 0);
    assert_int_equal(probe_run(&probe, &set, &r.grid, NULL, pool), -ECANCELED);
    rig_free_traces(&set);
    pool_destroy(pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_image_is_stopped_wherever_it_asks_and_leaves_no_trace),
        cmocka_unit_test(so_it_is_with_several_threads),
        cmocka_unit_test(a_plan_that_is_stopped_is_none),
        cmocka_unit_test(so_are_traces_and_a_look_at_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
