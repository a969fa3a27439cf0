/* SPDX-License-Identifier: MIT */
/* Drives side by side. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <signal.h>

#include "nodes/rt/stop.h"
#include "tests/bench/drive_jobs.h"

/* Nothing hides; half a second. */
static const char scene[] =
    "array: bumper\n"
    "temperature_c: 20\n"
    "wall: {normal: [0, 0, 1], distance_m: 2.2}\n"
    "mount: {origin_m: [3.6, 0, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"
    "gate_m: [1.5, 4.1]\n"
    "volume: {x_m: [-2.4, 2.4, 0.1], y_m: [0, 0, 0.1], z_m: [2.4, 3.8, 0.1]}\n"
    "drive: {period_s: 0.5}\n"
    "seed: 1\n"
    "level: 0.03\n"
    "clutter: {points: 10, scattering_length_m: 0.1, near_m: 1.0, far_m: 5.0}\n"
    "noise: {rms: 0.001}\n";

static const char settings[] = "nodes: [array, scan, dsp, recon, wall, track]\n"
                               "array: {uri: 'sim:nothing.yaml'}\n"
                               "scan: {mode: fixed}\n"
                               "recon: {frames: {pings: 4, sum: power, every: ping}}\n"
                               "wall: {from: topic}\n";

enum { N = 5 };

struct rig {
    struct scratch *scratch;
    struct launchfile *launch;
    char *scene;
    size_t n_told, interrupt_after; /* 0: never */
};

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    void *scratch = NULL;

    if (!r || scratch_open(&scratch))
        return -1;
    r->scratch = scratch;
    r->scene = strdup(scratch_write(r->scratch, "nothing.yaml", scene));
    interrupt_catch();
    *state = r;
    return launchfile_parse(&r->launch, "settings", settings, sizeof settings - 1, NULL);
}

static int teardown(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;

    launchfile_destroy(r->launch);
    free(r->scene);
    free(r);
    return scratch_close(&scratch);
}

static int told(void *context, struct drive_job *job, struct error *why)
{
    struct rig *r = context;

    (void)why;
    assert_true(job->done);
    if (++r->n_told == r->interrupt_after)
        raise(SIGINT);
    return 0;
}

static struct drive_jobs make(struct rig *r, size_t side_by_side)
{
    struct drive_jobs jobs = {.list = calloc(N, sizeof *jobs.list),
                              .n = N,
                              .side_by_side = side_by_side,
                              .done = told,
                              .context = r};

    assert_non_null(jobs.list);
    for (size_t i = 0; i < N; i++)
        jobs.list[i] = (struct drive_job){
            .run = {r->launch, r->scene, (uint32_t)(i % (N - 1)), 1, 1},
            .keeps_moments = i == 1};
    r->n_told = 0;
    return jobs;
}

static void side_by_side_they_are_what_they_are_alone(void **state)
{
    struct rig *r = *state;
    struct drive_jobs alone = make(r, 1), beside;
    struct error why = {""};

    assert_int_equal(drive_jobs_run(&alone, &why), 0);
    assert_int_equal(r->n_told, N);
    beside = make(r, 3);
    assert_int_equal(drive_jobs_run(&beside, &why), 0);
    assert_int_equal(r->n_told, N);
    for (size_t i = 0; i < N; i++) {
        const struct drive_outcome *a = &alone.list[i].outcome;
        const struct drive_outcome *b = &beside.list[i].outcome;
        assert_true(a->result.n_lists > 10);
        assert_memory_equal(&a->result, &b->result, sizeof a->result);
        assert_int_equal(a->moments.n, i == 1 ? a->result.n_lists : 0);
        assert_int_equal(a->moments.n, b->moments.n);
        assert_memory_equal(a->moments.at, b->moments.at,
                            a->moments.n * sizeof *a->moments.at);
    }
    drive_jobs_clear(&alone);
    drive_jobs_clear(&beside);
}

static void after_ctrl_c_what_is_done_is_there(void **state)
{
    struct rig *r = *state;

    for (size_t side_by_side = 1; side_by_side <= 2; side_by_side++) {
        struct drive_jobs jobs = make(r, side_by_side);
        struct error why = {""};
        interrupt_catch();
        r->interrupt_after = 1;
        assert_int_equal(drive_jobs_run(&jobs, &why), -EINTR);
        assert_true(jobs.list[0].done || jobs.list[1].done);
        assert_true(r->n_told >= 1 && r->n_told <= 2 * side_by_side);
        assert_false(jobs.list[N - 1].done);
        drive_jobs_clear(&jobs);
    }
}

static void the_error_of_one_ends_all(void **state)
{
    struct rig *r = *state;

    for (size_t side_by_side = 1; side_by_side <= 2; side_by_side++) {
        struct drive_jobs jobs = make(r, side_by_side);
        struct error why = {""};
        jobs.list[1].run.scene = "/nowhere.yaml";
        assert_int_equal(drive_jobs_run(&jobs, &why), -ENOENT);
        assert_non_null(strstr(why.text, "/nowhere.yaml"));
        assert_false(jobs.list[1].done);
        drive_jobs_clear(&jobs);
    }
}

/* How many lists a drive has when the array is named so. */
static size_t lists_of(const struct rig *r, const char *uri)
{
    struct launchfile *l = NULL;
    struct drive_outcome outcome;
    char text[400];

    snprintf(text, sizeof text,
             "nodes: [array, scan, dsp, recon, wall, track]\n"
             "array: {uri: '%s'}\n"
             "scan: {mode: fixed}\n"
             "recon: {frames: {pings: 4, sum: power, every: ping}}\n"
             "wall: {from: topic}\n",
             uri);
    assert_int_equal(launchfile_parse(&l, "settings", text, strlen(text), NULL), 0);
    const struct drive_run run = {l, r->scene, 0, 1, 1};
    drive_run(&run, &outcome);
    if (outcome.err)
        fail_msg("%s: %s", uri, outcome.why.text);
    free(outcome.moments.at);
    launchfile_destroy(l);
    return outcome.result.n_lists;
}

/* Slots of 48 ms in the place of the scene's 24. */
static void the_launch_file_says_how_the_speakers_fire(void **state)
{
    struct rig *r = *state;
    size_t n = lists_of(r, "sim:nothing.yaml");

    assert_in_range(2 * lists_of(r, "sim:nothing.yaml?slot_samples=2304"), n - 3, n + 3);
}

/* Two pings of one instant make one image. */
static void speakers_that_sound_together_make_an_image_a_slot(void **state)
{
    struct rig *r = *state;
    size_t n = lists_of(r, "sim:nothing.yaml");

    assert_in_range(lists_of(r, "sim:nothing.yaml?together=2&alternates=yes"), n - 2,
                    n + 2);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(side_by_side_they_are_what_they_are_alone),
        TEST(after_ctrl_c_what_is_done_is_there),
        TEST(the_error_of_one_ends_all),
        TEST(the_launch_file_says_how_the_speakers_fire),
        TEST(speakers_that_sound_together_make_an_image_a_slot),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
