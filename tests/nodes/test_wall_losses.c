/* SPDX-License-Identifier: MIT */
/* Somebody walks to and fro behind a corner while the wall that mirrors him is lost again
 * and again: simulated sound through all steps to CAN frames, at simulated time. */
#include "tests/hal/scratch.h"

#include <math.h>

#include "msgs/convert.h"
#include "nodes/anlos/doctor/drive_pipe.h"
#include "nodes/anlos/score/drive_score.h"
#include "nodes/can/sender.h"

#ifdef __SANITIZE_ADDRESS__ /* ten times slower: what is wrong in memory shows early */
#define LOSSES 6
#else
#define LOSSES 20
#endif
#define WALL_X  5.8  /* for the vehicle: 3.6 and 2.2 m */
#define ROUNDED 0.02 /* a frame rounds to so much; lists do not */
#define KNOWN_S 0.4  /* then it is lost */

static const char scene[] =
    "array: bumper\n"
    "temperature_c: 20\n"
    "wall: {normal: [0, 0, 1], distance_m: 2.2}\n"
    "mount: {origin_m: [3.6, 0, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"
    "gate_m: [1.5, 4.1]\n"
    "volume: {x_m: [-2.4, 2.4, 0.06], y_m: [0, 0, 0.1], z_m: [2.4, 4.1, 0.06]}\n"
    "drive: {period_s: 8}\n"
    "objects:\n"
    "  - name: person\n"
    "    kind: person\n"
    "    path:\n"
    "      - {t_s: 0, position_m: [-1.8, 0, 1.3]}\n"
    "      - {t_s: 4, position_m: [1.8, 0, 1.3]}\n"
    "      - {t_s: 8, position_m: [-1.8, 0, 1.3]}\n"
    "seed: 3\n"
    "level: 0.03\n"
    "wall_sound: {reflectivity: 0.95, echo: 0.5}\n"
    "noise: {snr_db: 10, at_m: 4}\n";

static const char settings[] = "nodes: [array, scan, dsp, recon, wall, track]\n"
                               "array: {uri: 'sim:scene.yaml'}\n"
                               "scan: {mode: fixed, speakers: [0, 5, 10, 15]}\n"
                               "dsp: {background: adaptive, background_s: 10}\n"
                               "recon: {frames: {pings: 4, sum: power, every: ping}}\n"
                               "wall: {from: echoes, every_s: 0.2}\n";

/* So long it cannot be heard, in turn; then it has to be heard twice. */
static const double deaf_s[] = {0.0, 0.4, 1.4};

struct rig {
    struct drive_pipe pipe;
    struct launchfile *launch;
    struct sender sender;
    size_t lists, losses, placed, without_place, beyond, frames_beyond, doubles, wrong;
};

static bool is_known(const struct rig *r)
{
    const struct wall_tracks *t =
        &wall_finder_map(pipeline_finder(r->pipe.pipeline))->tracks;
    bool known = false;

    for (size_t i = 0; i < t->n; i++)
        known |= t->list[i].confirmed;
    return known;
}

static void count_frames(struct rig *r, const Anlos__DetectionList *list, double t_s)
{
    struct sender_list out;
    int64_t at_ns = (int64_t)(1e9 * (1.0 + t_s));

    sender_list(&r->sender, list, at_ns, &out);
    sender_finalize(&r->sender, &out, at_ns + 50000000, 0);
    for (size_t i = 0; i < out.n_picked; i++)
        r->frames_beyond += out.objects[out.picked[i]].position_m[0] > WALL_X + ROUNDED;
    sender_sent(&r->sender, &out);
}

static void count(struct rig *r, const Anlos__DetectionList *list, double t_s)
{
    struct room_truth truth;
    size_t placed = 0;

    assert_int_equal(room_truth(r->pipe.world.room, t_s, &truth, 1), 1);
    for (size_t i = 0; i < list->n_detections; i++) {
        const Anlos__Detection *d = list->detections[i];
        if (d->measurement == ANLOS__MEASUREMENT__DELETED)
            continue;
        if (!d->position_m) {
            r->without_place++;
            continue;
        }
        placed++;
        r->beyond += d->position_m->x > WALL_X;
        r->wrong += hypot(d->position_m->x - truth.position_m[0],
                          d->position_m->y - truth.position_m[1]) > 0.6;
    }
    r->lists++;
    r->placed += placed > 0;
    r->doubles += placed > 1;
    count_frames(r, list, t_s);
}

static void take_image(struct rig *r, double *t_s)
{
    struct drive_image image;
    struct error why = {""};

    if (drive_pipe_next(&r->pipe, &image, &why))
        fail_msg("%s", why.text);
    count(r, image.tracks, image.t_s);
    *t_s = image.t_s;
    detections_free(image.tracks);
    detections_free(image.detections);
}

static void walk(struct rig *r)
{
    double t_s = 0.0, until_s;

    while (r->losses <= LOSSES) {
        while (!is_known(r))
            take_image(r, &t_s);
        for (until_s = t_s + KNOWN_S; t_s < until_s;)
            take_image(r, &t_s);
        if (r->losses++ == LOSSES)
            return;
        until_s = t_s + deaf_s[r->losses % (sizeof deaf_s / sizeof *deaf_s)];
        do {
            wall_finder_map(pipeline_finder(r->pipe.pipeline))->tracks.n = 0;
            take_image(r, &t_s);
        } while (t_s < until_s);
    }
}

static void through_all_losses_nobody_is_told_beyond_the_wall(void **state)
{
    struct scratch *scratch = *state;
    const struct sender_config can = {.base_id = 0x400, .bus = {.fd = true}};
    struct rig *r = calloc(1, sizeof *r);
    struct error why = {""};
    const char *path = scratch_write(scratch, "scene.yaml", scene);

    assert_non_null(r);
    sender_init(&r->sender, &can);
    assert_int_equal(
        launchfile_parse(&r->launch, "settings", settings, sizeof settings - 1, &why), 0);
    if (drive_pipe_create(&r->pipe, r->launch, path, 0, 1, &why))
        fail_msg("%s", why.text);
    walk(r);
    print_message("%zu lists, %zu losses, %zu with a place, %zu objects without; beyond "
                  "the wall %zu, on CAN %zu; doubles %zu, wrong %zu\n",
                  r->lists, r->losses - 1, r->placed, r->without_place, r->beyond,
                  r->frames_beyond, r->doubles, r->wrong);
    assert_int_equal(r->beyond, 0);
    assert_int_equal(r->frames_beyond, 0);
    assert_int_equal(r->doubles, 0);
    assert_int_equal(r->wrong, 0);
    assert_true(r->placed > r->lists / 4 && r->without_place > r->lists / 4);
    drive_pipe_clear(&r->pipe);
    launchfile_destroy(r->launch);
    free(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(through_all_losses_nobody_is_told_beyond_the_wall,
                                        scratch_open, scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
