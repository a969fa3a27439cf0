/* Arrays and air as small, thin, cold and hot as they come, for every method. */
#include "tests/recon/near.h"

#include <stdlib.h>

#include "tests/recon/hard.h"

static struct hard hard;

static void expect_paths(const char *method)
{
    float *image = hard_image(&hard, method, NULL);
    if (image)
        hard_expect_paths(&hard, method, image);
    free(image);
}

static void expect_point(const char *method)
{
    float *image = hard_image(&hard, method, NULL);
    assert_non_null(image); /* an array that every method accepts */
    hard_expect_point(&hard, method, image);
    free(image);
}

/* Maxima lie where the paths over them are those over the point, to half a wavelength
 * (to 5 to 30 mm for powers). */
static void expect_explained(size_t n_positions, size_t n_speakers, size_t n_microphones)
{
    hard_create(&hard, 343.0, n_positions, n_speakers, n_microphones);
    hard_every_method(expect_paths);
    hard_clear(&hard);
}

static void one_stage_position_is_explained(void **state)
{
    (void)state;
    expect_explained(1, 8, 8);
}

static void one_speaker_is_explained(void **state)
{
    (void)state;
    expect_explained(10, 1, 8);
    expect_explained(1, 1, 8);
}

static void one_microphone_is_explained(void **state)
{
    (void)state;
    expect_explained(10, 8, 1);
    expect_explained(1, 8, 1);
}

static void one_speaker_and_one_microphone_are_explained(void **state)
{
    (void)state;
    expect_explained(10, 1, 1);
}

static void a_single_trace_is_explained(void **state)
{
    (void)state;
    expect_explained(1, 1, 1);
}

/* On voxels that the stage's steps are whole numbers of, and on others: methods may take
 * another way then. */
static void a_point_is_where_it_is_at_speeds_of_sound_from_300_to_360(void **state)
{
    (void)state;
    static const double speeds_m_s[4] = {300.0, 319.0, 343.0, 360.0};
    for (int q = 0; q < 8; q++) {
        hard_create(&hard, speeds_m_s[q / 2], 10, 8, 8);
        hard.rig.grid.step_m[0] = q % 2 ? 0.0125 : 0.012;
        hard_every_method(expect_point);
        hard_clear(&hard);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_stage_position_is_explained),
        cmocka_unit_test(one_speaker_is_explained),
        cmocka_unit_test(one_microphone_is_explained),
        cmocka_unit_test(one_speaker_and_one_microphone_are_explained),
        cmocka_unit_test(a_single_trace_is_explained),
        cmocka_unit_test(a_point_is_where_it_is_at_speeds_of_sound_from_300_to_360),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
