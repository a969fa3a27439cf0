/* SPDX-License-Identifier: MIT */
/* Arrays and air as small, thin, cold and hot as they come, for every method. */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "tests/recon/hard.h"

static struct hard hard;

/* Every method images them, but one: its PSF wants an aperture in x and y. */
static const struct small {
    size_t n_positions, n_speakers, n_microphones;
    const char *refused_by;
} smalls[] = {
    {1, 8, 8, ""}, {10, 1, 8, ""},          {1, 1, 8, ""},          {10, 8, 1, ""},
    {1, 8, 1, ""}, {10, 1, 1, "iterative"}, {1, 1, 1, "iterative"},
};
static const struct small *small;

static void expect_paths(const char *method)
{
    float *image = hard_image(&hard, method, NULL);
    if (image)
        hard_expect_paths(&hard, method, image);
    if (!image != !strcmp(small->refused_by, method))
        fail_msg("%s: %s %zu positions, %zu speakers, %zu microphones", method,
                 image ? "images" : "refuses", small->n_positions, small->n_speakers,
                 small->n_microphones);
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
static void one_position_speaker_or_microphone_is_imaged_and_explained(void **state)
{
    (void)state;
    for (size_t q = 0; q < sizeof smalls / sizeof *smalls; q++) {
        small = &smalls[q];
        hard_create(&hard, 343.0, small->n_positions, small->n_speakers,
                    small->n_microphones);
        hard_every_method(expect_paths);
        hard_clear(&hard);
    }
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
        cmocka_unit_test(one_position_speaker_or_microphone_is_imaged_and_explained),
        cmocka_unit_test(a_point_is_where_it_is_at_speeds_of_sound_from_300_to_360),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
