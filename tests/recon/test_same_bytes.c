/* What a replay rests on: an image is a matter of the traces and their order alone. */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "tests/recon/rig.h"

static const struct scatterer points[] = {{{0.03, -0.02, 1.1}, 1.0},
                                          {{-0.05, 0.04, 1.13}, 0.8}};

/* What needs a microphone beside each speaker, which this array has not. */
static bool may_refuse(const char *method)
{
    return !strcmp(method, "confocal") || !strcmp(method, "lct");
}

/* NULL: the method cannot image this array. */
static float *image(const struct rig *r, const char *method, size_t threads, bool preview)
{
    struct pool *pool;
    struct imager *im = NULL;
    const char *why = NULL;
    float *out = NULL;

    assert_int_equal(pool_create(&pool, threads), 0);
    assert_int_equal(rig_try(r, method, pool, &im, &why),
                     may_refuse(method) ? -ENOTSUP : 0);
    if (im) {
        size_t n = r->geometry.n_positions * r->geometry.n_speakers;
        out = malloc(grid_size(&r->grid) * sizeof *out);
        assert_non_null(out);
        rig_add_some(r, im, points, 2, 0, n / 2);
        if (preview)
            imager_image(im, out);
        rig_add_some(r, im, points, 2, n / 2, n);
        imager_image(im, out);
    }
    imager_destroy(im);
    pool_destroy(pool);
    return out;
}

static void compare(const char *method, size_t threads, bool preview)
{
    struct rig r;

    rig_default(&r);
    rig_look_at(&r, 0.0, 0.0, 1.1, 9, 0.03);
    float *a = image(&r, method, 1, false), *b = image(&r, method, threads, preview);
    if (a && memcmp(a, b, grid_size(&r.grid) * sizeof *a) != 0)
        fail_msg("%s: another image with %zu threads%s", method, threads,
                 preview ? " and a preview" : "");
    free(a);
    free(b);
}

static void a_preview_leaves_the_final_image_as_it_is(void **state)
{
    (void)state;
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
        compare(m, 1, true);
}

static void the_number_of_threads_changes_nothing(void **state)
{
    (void)state;
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
        compare(m, 3, false);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_preview_leaves_the_final_image_as_it_is),
        cmocka_unit_test(the_number_of_threads_changes_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
