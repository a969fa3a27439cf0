/* SPDX-License-Identifier: MIT */
/* What a replay rests on: an image is a matter of the traces and their order alone. */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "tests/recon/rig.h"

static const struct scatterer points[] = {{{0.03, -0.02, 1.1}, 1.0},
                                          {{-0.05, 0.04, 1.13}, 0.8}};

static const struct scatterer others[] = {{{0.02, 0.05, 1.08}, 1.5}};

/* What is done besides adding all pings and imaging them. */
enum besides {
    NOTHING,
    PREVIEW, /* of half of them */
    HALF,    /* no more is added */
    RESET,   /* nor here, after other pings, all of them */
};

/* A method that needs a microphone beside each speaker has an array of pairs. */
static void array_for(struct rig *r, const char *method)
{
    if (!strcmp(method, "confocal") || !strcmp(method, "lct"))
        rig_pairs(r);
    else
        rig_default(r);
    rig_look_at(r, 0.0, 0.0, 1.1, 9, 0.03);
}

static float *image(const struct rig *r, const char *method, size_t threads,
                    enum besides besides)
{
    struct pool *pool;

    assert_int_equal(pool_create(&pool, threads), 0);
    struct imager *im = rig_imager(r, method, pool);
    size_t n = r->geometry.n_positions * r->geometry.n_speakers;
    float *out = malloc(grid_size(&r->grid) * sizeof *out);
    assert_non_null(out);
    if (besides == RESET) {
        rig_add(r, im, others, 1);
        imager_image(im, out);
        imager_reset(im);
    }
    rig_add_some(r, im, points, 2, 0, n / 2);
    if (besides == PREVIEW)
        imager_image(im, out);
    if (besides == NOTHING || besides == PREVIEW)
        rig_add_some(r, im, points, 2, n / 2, n);
    imager_image(im, out);
    imager_destroy(im);
    pool_destroy(pool);
    return out;
}

static void compare(const char *method, size_t threads, enum besides besides)
{
    static const char *const words[] = {
        [NOTHING] = "", [PREVIEW] = " and a preview", [RESET] = " and a reset"};
    struct rig r;

    array_for(&r, method);
    float *a = image(&r, method, 1, besides == RESET ? HALF : NOTHING);
    float *b = image(&r, method, threads, besides);
    if (memcmp(a, b, grid_size(&r.grid) * sizeof *a) != 0)
        fail_msg("%s: another image with %zu threads%s", method, threads, words[besides]);
    free(a);
    free(b);
}

static void a_preview_leaves_the_final_image_as_it_is(void **state)
{
    (void)state;
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
        compare(m, 1, PREVIEW);
}

static void the_number_of_threads_changes_nothing(void **state)
{
    (void)state;
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
        compare(m, 3, NOTHING);
}

static void after_a_reset_nothing_is_left_of_what_was_added(void **state)
{
    (void)state;
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
        compare(m, 1, RESET);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_preview_leaves_the_final_image_as_it_is),
        cmocka_unit_test(the_number_of_threads_changes_nothing),
        cmocka_unit_test(after_a_reset_nothing_is_left_of_what_was_added),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
