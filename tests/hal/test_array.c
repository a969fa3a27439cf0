/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/array.h"
#include "hal/recording/recording.h"
#include "hal/room/room.h"
#include "hal/survey/file.h"

#define SCENE SOURCE_DIR "/launch/scenes/point.yaml"

static struct array *open_array(const char *uri, struct fake_clock *clock)
{
    struct error why = {.text = ""};
    struct array *a;
    fake_clock_set(clock, INT64_C(1700000000000000000));
    if (array_open(&a, uri, &clock->source, &why))
        fail_msg("%s", why.text);
    return a;
}

static struct room *open_room(void)
{
    struct error why = {.text = ""};
    struct room *r;
    if (room_load(&r, SCENE, &why))
        fail_msg("%s", why.text);
    return r;
}

static void fire(struct array *a, enum pass pass, size_t position,
                 const uint32_t *speakers, size_t n)
{
    struct array_shot shot = {
        .pass = pass, .position = position, .speakers = speakers, .n_speakers = n};
    assert_int_equal(array_fire(a, &shot), 0);
}

static void assert_is_slice(const struct array_ping *p, const struct survey *s,
                            const float *samples, size_t n_frames, size_t slot)
{
    for (size_t m = 0; m < s->n_microphones; m++)
        assert_memory_equal(p->samples + m * p->n_samples,
                            samples + m * n_frames + slot * s->slot_samples,
                            p->n_samples * sizeof *samples);
}

static void pings_are_the_slots_of_the_room_with_their_tails(void **state)
{
    static const uint32_t speakers[] = {3, 1};
    struct fake_clock clock;
    struct error why;
    struct array_ping ping;
    struct array *a = open_array("sim:" SCENE, &clock);
    struct room *r = open_room();
    const struct survey *s = array_survey(a);
    size_t n = room_frames(r, 2);
    float *samples = malloc(s->n_microphones * n * sizeof *samples);
    (void)state;
    assert_non_null(samples);
    assert_int_equal(survey_id(s), survey_id(room_survey(r)));
    assert_int_equal(room_record(r, PASS_SCENE, 4, speakers, 2, 0, samples), 0);
    fire(a, PASS_SCENE, 4, speakers, 2);
    for (size_t j = 0; j < 2; j++) {
        assert_int_equal(array_next(a, &ping, &why), 0);
        assert_int_equal(ping.shot_index, j);
        assert_int_equal(ping.n_samples, s->slot_samples + room_tail(r));
        assert_true(ping.valid && ping.clipped[0] == 0 && ping.not_finite[0] == 0);
        assert_is_slice(&ping, s, samples, n, j);
    }
    assert_int_equal(array_next(a, &ping, &why), -ENODATA);
    free(samples);
    room_destroy(r);
    array_close(a);
}

static void a_retake_has_noise_of_its_own(void **state)
{
    static const uint32_t speaker = 0;
    struct fake_clock clock;
    struct error why;
    struct array_ping ping;
    struct array *a = open_array("sim:" SCENE, &clock);
    float first = 0;
    (void)state;
    for (int take = 0; take < 2; take++) {
        fire(a, PASS_SCENE, 0, &speaker, 1);
        assert_int_equal(array_next(a, &ping, &why), 0);
        if (take == 0)
            first = ping.samples[100];
        else
            assert_true(ping.samples[100] != first &&
                        fabsf(ping.samples[100] - first) < 0.01f);
    }
    array_close(a);
}

/* 1500 samples of slot at 48 kHz: 31.25 ms. */
static void at_the_true_pace_a_ping_comes_when_it_has_been_recorded(void **state)
{
    static const uint32_t speakers[] = {0, 1, 2};
    struct fake_clock clock;
    struct error why;
    struct array_ping ping;
    struct array *a = open_array("sim:" SCENE "?pace=real", &clock);
    int64_t start_ns = clock.now_ns;
    (void)state;
    fire(a, PASS_SCENE, 0, speakers, 3);
    for (size_t j = 0; j < 3; j++) {
        if (j == 1) {
            clock.interrupted = 1;
            assert_int_equal(array_next(a, &ping, &why), -EINTR);
        }
        assert_int_equal(array_next(a, &ping, &why), 0);
        assert_int_equal(ping.shot_index, j);
        int64_t t0_ns = start_ns + (int64_t)j * 31250000;
        assert_true(llabs((long long)(ping.t0_ns - t0_ns)) < 10);
        int64_t end_ns = t0_ns + (int64_t)((double)ping.n_samples / 48000 * 1e9);
        assert_true(llabs((long long)(clock.now_ns - end_ns)) < 10);
    }
    array_close(a);
}

static void without_a_pace_pings_take_no_time(void **state)
{
    static const uint32_t speakers[] = {0, 1};
    struct fake_clock clock;
    struct error why;
    struct array_ping ping;
    struct array *a = open_array("sim:" SCENE, &clock);
    int64_t start_ns = clock.now_ns;
    (void)state;
    fire(a, PASS_SCENE, 0, speakers, 2);
    for (int j = 0; j < 2; j++) {
        assert_int_equal(array_next(a, &ping, &why), 0);
        assert_true(ping.t0_ns == start_ns && clock.now_ns == start_ns);
    }
    array_close(a);
}

static void shots_that_cannot_be_fired_are_refused(void **state)
{
    static const uint32_t good[] = {0, 1}, bad[] = {4};
    struct fake_clock clock;
    struct error why;
    struct array_ping ping;
    struct array *a = open_array("sim:" SCENE, &clock);
    struct array_shot shots[] = {{.position = 6, .speakers = good, .n_speakers = 1},
                                 {.position = 0, .speakers = bad, .n_speakers = 1},
                                 {.position = 0, .speakers = good, .n_speakers = 0},
                                 {.position = 0, .speakers = good, .n_speakers = 5}};
    (void)state;
    assert_int_equal(array_next(a, &ping, &why), -ENODATA);
    for (size_t i = 0; i < 4; i++)
        assert_int_equal(array_fire(a, &shots[i]), -EINVAL);
    fire(a, PASS_SCENE, 0, good, 2);
    assert_int_equal(array_next(a, &ping, &why), 0);
    struct array_shot early = {.speakers = good, .n_speakers = 1};
    assert_int_equal(array_fire(a, &early), -EINVAL);
    assert_int_equal(array_next(a, &ping, &why), 0);
    assert_int_equal(array_fire(a, &early), 0);
    array_close(a);
}

/* Records the scene into FOLDER/wav and, without the survey, FOLDER/wav_bg. */
static void record_scene(struct scratch *scratch, struct room *r)
{
    static const uint32_t speakers[] = {0, 1, 2, 3};
    static const char *const folders[] = {"wav", "wav_bg"};
    struct error why = {.text = ""};
    const struct survey *s = room_survey(r);
    size_t n = room_frames(r, 4);
    float *samples = malloc(s->n_microphones * n * sizeof *samples);
    assert_non_null(samples);
    for (int pass = 0; pass < 2; pass++) {
        scratch_folder(scratch, folders[pass]);
        for (size_t k = 0; k < s->n_positions; k++) {
            assert_int_equal(room_record(r, (enum pass)pass, k, speakers, 4, 0, samples),
                             0);
            assert_int_equal(recording_write(scratch_path(scratch, folders[pass]), k,
                                             s->n_microphones, n, s->sample_rate_hz,
                                             samples, &why),
                             0);
        }
    }
    free(samples);
}

static void a_recording_plays_like_the_array_it_was_taken_with(void **state)
{
    static const uint32_t order[] = {2, 0}, all[] = {0, 1, 2, 3};
    struct scratch *scratch = *state;
    struct fake_clock clock;
    struct error why = {.text = ""};
    struct array_ping ping;
    struct room *r = open_room();
    const struct survey *s = room_survey(r);
    char uri[600];
    size_t n = room_frames(r, 4);
    float *samples = malloc(s->n_microphones * n * sizeof *samples);
    assert_non_null(samples);
    record_scene(scratch, r);
    assert_int_equal(survey_save(s, scratch_path(scratch, "survey.yaml"), NULL, &why), 0);
    snprintf(uri, sizeof uri, "wav:%s/wav?background=%s/wav_bg", scratch->folder,
             scratch->folder);
    struct array *a = open_array(uri, &clock);
    assert_int_equal(array_survey(a)->source, SURVEY_REPLAY);
    assert_int_equal(survey_id(array_survey(a)), survey_id(s));
    for (int pass = 0; pass < 2; pass++) {
        assert_int_equal(room_record(r, (enum pass)pass, 3, all, 4, 0, samples), 0);
        fire(a, (enum pass)pass, 3, order, 2);
        for (size_t j = 0; j < 2; j++) {
            assert_int_equal(array_next(a, &ping, &why), 0);
            assert_int_equal(ping.n_samples, s->slot_samples + room_tail(r));
            assert_is_slice(&ping, s, samples, n, order[j]);
        }
        assert_int_equal(array_next(a, &ping, &why), -ENODATA);
    }
    array_close(a);

    snprintf(uri, sizeof uri, "wav:%s/wav", scratch->folder);
    a = open_array(uri, &clock);
    struct array_shot shot = {.pass = PASS_BACKGROUND, .speakers = all, .n_speakers = 1};
    assert_int_equal(array_fire(a, &shot), -EINVAL);
    shot.pass = PASS_SCENE;
    assert_int_equal(array_fire(a, &shot), 0);
    /* The file goes before it is read: the ping fails, the array lives on. */
    snprintf(uri, sizeof uri, "%s/wav/pos00.wav", scratch->folder);
    assert_int_equal(remove(uri), 0);
    assert_true(array_next(a, &ping, &why) < 0);
    assert_contains(why.text, "pos00.wav");
    shot.position = 1;
    assert_int_equal(array_fire(a, &shot), 0);
    assert_int_equal(array_next(a, &ping, &why), 0);
    array_close(a);
    free(samples);
    room_destroy(r);
}

static void a_recording_is_not_its_own_background(void **state)
{
    struct scratch *scratch = *state;
    struct error why = {.text = ""};
    struct room *r = open_room();
    struct array *a;
    char uri[600];

    record_scene(scratch, r);
    assert_int_equal(
        survey_save(room_survey(r), scratch_path(scratch, "survey.yaml"), NULL, &why), 0);
    snprintf(uri, sizeof uri, "wav:%s/wav?background=%s/wav", scratch->folder,
             scratch->folder);
    assert_int_equal(array_open(&a, uri, clock_system(), &why), -EINVAL);
    assert_contains(why.text, "the same sound");
    room_destroy(r);
}

static void devices_that_do_not_exist_are_named(void **state)
{
    static const struct {
        const char *uri;
        int err;
        const char *part;
    } cases[] = {
        {"tape:reel", -ENODEV, "tape:reel: no such kind of array; expected sim:"},
        {"scene.yaml", -ENODEV, "no such kind of array"},
        {"sim:", -EINVAL, "expected a scene file"},
        {"sim:/nowhere.yaml", -ENOENT, "/nowhere.yaml: No such file"},
        {"sim:" SCENE "?pace=slow", -EINVAL, "expected fast or real"},
        {"sim:" SCENE "?speed=1", -EINVAL, "no option \"speed\"; expected pace"},
        {"wav:", -EINVAL, "expected a folder"},
        {"wav:/nowhere", -ENOENT, "/nowhere: No such file"},
        {"wav:/nowhere?survey=/nowhere.yaml", -ENOENT, "/nowhere.yaml: No such file"},
        {"wav:/tmp?rate=1", -EINVAL, "expected background, survey, calibrated or loop"},
    };
    struct fake_clock clock;
    (void)state;
    fake_clock_set(&clock, 0);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        struct array *a;
        assert_int_equal(array_open(&a, cases[i].uri, &clock.source, &why), cases[i].err);
        assert_null(a);
        assert_contains(why.text, cases[i].part);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(pings_are_the_slots_of_the_room_with_their_tails),
        TEST(a_retake_has_noise_of_its_own),
        TEST(at_the_true_pace_a_ping_comes_when_it_has_been_recorded),
        TEST(without_a_pace_pings_take_no_time),
        TEST(shots_that_cannot_be_fired_are_refused),
        TEST(a_recording_plays_like_the_array_it_was_taken_with),
        TEST(a_recording_is_not_its_own_background),
        TEST(devices_that_do_not_exist_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
