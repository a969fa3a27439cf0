/* SPDX-License-Identifier: MIT */
/* The steps of a drive are configured as the nodes are. */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/convert.h"
#include "nodes/anlos/doctor/drive_pipe.h"
#include "tests/nodes/near.h"

#define SCENE SOURCE_DIR "/tests/nodes/walker.yaml"

static const char settings[] = "nodes: [array, scan, dsp, recon, track]\n"
                               "array: {uri: 'sim:walker.yaml'}\n"
                               "scan: {mode: fixed, speakers: [0, 3, 1]}\n"
                               "recon: {frames: {every: frame}}\n";

/* A frame of three of the speakers, and its images follow each other by three slots. */
static void a_frame_is_of_the_speakers_that_the_launch_file_names(void **state)
{
    (void)state;
    struct drive_pipe pipe;
    struct drive_image image;
    struct launchfile *launch;
    struct error why = {""};
    double before_s = 0.0;

    assert_int_equal(
        launchfile_parse(&launch, "settings", settings, sizeof settings - 1, &why), 0);
    if (drive_pipe_create(&pipe, launch, SCENE, 0, 1, &why))
        fail_msg("%s", why.text);
    const struct survey *s = room_survey(pipe.world.room);
    assert_true(s->n_speakers > 3);
    for (int k = 0; k < 3; k++) {
        if (drive_pipe_next(&pipe, &image, &why))
            fail_msg("%s", why.text);
        if (k)
            assert_near(image.t_s - before_s,
                        3.0 * (double)s->slot_samples / s->sample_rate_hz, 1e-9);
        before_s = image.t_s;
        assert_int_equal(pipe.volume.pings_expected, 3);
        assert_int_equal(pipe.volume.frame, k + 1);
        detections_free(image.tracks);
        detections_free(image.detections);
    }
    drive_pipe_clear(&pipe);
    launchfile_destroy(launch);
}

static void pings_that_make_no_image_end_the_drive(void **state)
{
    (void)state;
    struct drive_pipe pipe;
    struct drive_image image;
    struct launchfile *launch;
    struct error why = {""};

    assert_int_equal(
        launchfile_parse(&launch, "settings", settings, sizeof settings - 1, &why), 0);
    launch->dsp.background = BACKGROUND_RECORDED; /* of a pass that there is not */
    if (drive_pipe_create(&pipe, launch, SCENE, 0, 1, &why))
        fail_msg("%s", why.text);
    assert_int_equal(drive_pipe_next(&pipe, &image, &why), -ENODATA);
    assert_null(image.tracks);
    assert_non_null(strstr(why.text, "has no background"));
    drive_pipe_clear(&pipe);
    launchfile_destroy(launch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_frame_is_of_the_speakers_that_the_launch_file_names),
        cmocka_unit_test(pings_that_make_no_image_end_the_drive),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
