/* SPDX-License-Identifier: MIT */
/* Emissions that ring into each other, and the array that makes an endless shot of them.
 */
#include "drive.h"

#include <errno.h>
#include <math.h>

#include "hal/array.h"
#include "hal/room/room.h"

#define RATE_HZ 48000.0

/* Two speakers, two microphones, a person on his way, and no noise. */
#define QUIET(chirp)                                                                     \
    "sound_speed_m_s: 340\nsample_rate_hz: 48000\n"                                      \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.02" chirp "}\n"               \
    "slot_samples: 1152\ngate_m: [0.2, 4]\n"                                             \
    "mount: {origin_m: [3.6, 0.2, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"         \
    "speakers_m: [[-0.1, 0, 0], [0.1, 0, 0]]\n"                                          \
    "microphones_m: [[-0.05, 0, 0], [0.05, 0, 0]]\n" DRIVE_WALL                          \
    "wall_sound: {reflectivity: 0.9, echo: 0.5}\n"                                       \
    "drive: {period_s: 3, ego: [{t_s: 0, speed_m_s: 0.2}]}\n"                            \
    "objects:\n  - name: p\n    kind: person\n    present_s: [0, 3]\n"                   \
    "    path: [{t_s: 0, position_m: [-1, 0, 0]}, {t_s: 3, position_m: [1, 0, 0]}]\n"
#define NOISE "noise: {snr_db: 0, at_m: 3}\n"

static const uint32_t both[] = {1, 0};

static struct room_stream *start(struct room *r, double start_s)
{
    struct room_stream *s;
    struct room_stream_config cfg = {
        .pass = PASS_SCENE, .speakers = both, .n_speakers = 2, .start_s = start_s};
    assert_int_equal(room_stream_create(&s, r, &cfg), 0);
    return s;
}

/* Adds emission k of a stream that began at start_s, as a ping of it hears that: from
 * sample `from` of the stream on. */
static void add_emission(struct room *r, double start_s, uint64_t k, uint64_t at,
                         bool down, uint64_t from, double *sum)
{
    size_t n = room_frames(r, 1);
    struct room_emission e = {
        .speaker = both[k % 2], .down = down, .t_s = start_s + (double)at / RATE_HZ};
    float *x = malloc(2 * n * sizeof *x);
    assert_non_null(x);
    assert_int_equal(room_emit(r, &e, x), 0);
    for (size_t i = 0; i < 2 * n; i++) {
        int64_t j = (int64_t)(i % n + at) - (int64_t)from;
        if (j >= 0 && j < (int64_t)n)
            sum[i / n * n + (size_t)j] += x[i];
    }
    free(x);
}

static void assert_sum(const float *x, const double *sum, size_t n)
{
    for (size_t i = 0; i < n; i++)
        assert_true(fabs(x[i] - sum[i]) < 1e-6);
}

/* Echoes of some 24 ms end within the slot after theirs. */
static void a_ping_holds_what_rings_on_and_what_begins_in_its_tail(void **state)
{
    struct room *r = drive_load(state, QUIET(""));
    struct room_stream *s = start(r, 2.9); /* the drive begins again meanwhile */
    size_t n = room_frames(r, 1);
    double *sum = calloc(2 * n, sizeof *sum);
    assert_non_null(sum);
    for (uint64_t k = 0; k < 6; k++) {
        const float *x;
        memset(sum, 0, 2 * n * sizeof *sum);
        assert_true(room_stream_start(s, k) == 1152 * k);
        for (uint64_t j = k ? k - 1 : 0; j <= k + 1; j++)
            add_emission(r, 2.9, j, 1152 * j, false, 1152 * k, sum);
        assert_int_equal(room_stream_ping(s, k, &x), 0);
        assert_sum(x, sum, 2 * n);
    }
    free(sum);
    room_stream_destroy(s);
    room_destroy(r);
}

static void two_that_share_a_slot_are_heard_together(void **state)
{
    struct room *r = drive_load(state, QUIET(", alternates: true") "together: 2\n");
    struct room_stream *s = start(r, 0.5);
    size_t n = room_frames(r, 1);
    double *sum = calloc(2 * n, sizeof *sum);
    const float *x;
    assert_non_null(sum);
    for (uint64_t k = 2; k < 8; k++)
        add_emission(r, 0.5, k, 1152 * (k / 2), k % 2, 1152 * 2, sum);
    for (uint64_t k = 4; k < 6; k++) {
        assert_true(room_stream_start(s, k) == 1152 * 2);
        assert_int_equal(room_stream_ping(s, k, &x), 0);
        assert_sum(x, sum, 2 * n);
    }
    free(sum);
    room_stream_destroy(s);
    room_destroy(r);
}

/* Three chirps sound at a time: 12.5 ms from one to the next of 20 ms. */
static void slots_shorter_than_the_chirp_overlap(void **state)
{
    struct room *r = drive_load(
        state, "sound_speed_m_s: 340\nsample_rate_hz: 48000\n"
               "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.02}\n"
               "slot_samples: 600\ngate_m: [0.2, 1.5]\n"
               "mount: {origin_m: [3.6, 0, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"
               "speakers_m: [[-0.1, 0, 0], [0.1, 0, 0]]\n"
               "microphones_m: [[-0.05, 0, 0], [0.05, 0, 0]]\n"
               "wall: {normal: [0, 0, 1], distance_m: 0.6}\n"
               "drive: {period_s: 3}\n"
               "objects:\n  - {name: p, kind: point, position_m: [0.1, 0, 0.3], "
               "scattering_length_m: 0.2}\n");
    struct room_stream *s = start(r, 1);
    size_t n = room_frames(r, 1);
    double *sum = calloc(2 * n, sizeof *sum);
    const float *x;
    assert_non_null(sum);
    assert_true(n > 1320);
    for (uint64_t j = 1; 600 * j < 600 * 4 + n; j++)
        add_emission(r, 1, j, 600 * j, false, 600 * 4, sum);
    assert_int_equal(room_stream_ping(s, 4, &x), 0);
    assert_sum(x, sum, 2 * n);
    free(sum);
    room_stream_destroy(s);
    room_destroy(r);
}

/* What was left out still rings on, and noise stays where it was. */
static void pings_may_be_left_out_but_not_taken_back(void **state)
{
    struct room *r = drive_load(state, QUIET("") NOISE);
    struct room_stream *all = start(r, 0), *some = start(r, 0);
    size_t n = 2 * room_frames(r, 1);
    float *copy = malloc(n * sizeof *copy);
    const float *x;
    assert_non_null(copy);
    for (uint64_t k = 0; k <= 9; k++)
        assert_int_equal(room_stream_ping(all, k, &x), 0);
    memcpy(copy, x, n * sizeof *copy);
    assert_int_equal(room_stream_ping(some, 1, &x), 0);
    assert_int_equal(room_stream_ping(some, 9, &x), 0);
    for (size_t i = 0; i < n; i++)
        assert_true(fabsf(copy[i] - x[i]) < 1e-6f);
    assert_int_equal(room_stream_ping(some, 9, &x), 0);
    for (size_t i = 0; i < n; i++)
        assert_true(fabsf(copy[i] - x[i]) < 1e-6f);
    assert_int_equal(room_stream_ping(some, 8, &x), -EINVAL);
    free(copy);
    room_stream_destroy(all);
    room_stream_destroy(some);
    room_destroy(r);
}

static struct array *open_array(void **state, const char *text, const char *options,
                                struct fake_clock *clock, int *err)
{
    struct error why = {.text = ""};
    struct array *a;
    char uri[600];
    snprintf(uri, sizeof uri, "sim:%s%s", scratch_write(*state, "scene.yaml", text),
             options);
    fake_clock_set(clock, INT64_C(1700000001234567890));
    *err = array_open(&a, uri, &clock->source, &why);
    return a;
}

static uint64_t count_of(struct array *a, const char *name)
{
    struct device_count counts[DEVICE_MAX_COUNTS];
    size_t n = array_counts(a, counts);
    for (size_t i = 0; i < n; i++)
        if (!strcmp(counts[i].name, name))
            return counts[i].value;
    fail_msg("%s is not counted", name);
    return 0;
}

/* World time is the wall clock's, modulo 3 s; a ping comes when its tail has been
 * recorded, 24 ms after the one before. */
static void an_endless_shot_is_the_stream_of_its_time(void **state)
{
    int err;
    struct fake_clock clock;
    struct error why;
    struct array *a = open_array(state, QUIET("") NOISE, "", &clock, &err);
    struct room *r = drive_load(state, QUIET("") NOISE);
    int64_t fired_ns = clock.now_ns;
    struct room_stream *s = start(r, (double)(fired_ns % INT64_C(3000000000)) / 1e9);
    struct array_shot shot = {.speakers = both, .n_speakers = 2, .endless = true};
    assert_int_equal(err, 0);
    assert_int_equal(array_fire(a, &shot), 0);
    for (uint64_t k = 0; k < 5; k++) {
        struct array_ping ping;
        const float *x;
        if (k == 3) {
            clock.interrupted = 1;
            assert_int_equal(array_next(a, &ping, &why), -EINTR);
        }
        assert_int_equal(array_next(a, &ping, &why), 0);
        assert_int_equal(room_stream_ping(s, k, &x), 0);
        assert_memory_equal(ping.samples, x, 2 * ping.n_samples * sizeof *x);
        assert_int_equal(ping.shot_index, k % 2);
        assert_int_equal(ping.frame, k / 2 + 1);
        int64_t t0_ns = fired_ns + (int64_t)k * 24000000;
        assert_true(llabs((long long)(ping.t0_ns - t0_ns)) < 10);
        int64_t end_ns = t0_ns + (int64_t)((double)ping.n_samples / RATE_HZ * 1e9);
        assert_true(llabs((long long)(clock.now_ns - end_ns)) < 10);
    }
    assert_int_equal(count_of(a, "pings_late"), 0);
    array_halt(a);
    assert_int_equal(array_fire(a, &shot), 0);
    room_stream_destroy(s);
    room_destroy(r);
    array_close(a);
}

/* 100 ms late, then a second: what nobody took is left out and counted. */
static void falling_behind_is_counted_and_caught_up(void **state)
{
    int err;
    struct fake_clock clock;
    struct error why;
    struct array_ping ping;
    struct array *a = open_array(state, QUIET(""), "", &clock, &err);
    int64_t fired_ns = clock.now_ns;
    struct array_shot shot = {.speakers = both, .n_speakers = 2, .endless = true};
    assert_int_equal(err, 0);
    assert_int_equal(array_fire(a, &shot), 0);
    assert_int_equal(array_next(a, &ping, &why), 0);
    clock.now_ns += 100000000;
    assert_int_equal(array_next(a, &ping, &why), 0);
    assert_true(ping.frame == 1 && ping.shot_index == 1);
    assert_int_equal(count_of(a, "pings_late"), 1);
    assert_int_equal(count_of(a, "pings_skipped"), 0);
    clock.now_ns = fired_ns + 1000000000;
    assert_int_equal(array_next(a, &ping, &why), 0);
    uint64_t k = 2 * (ping.frame - 1) + ping.shot_index;
    assert_true(llabs((long long)(ping.t0_ns - fired_ns - (int64_t)k * 24000000)) < 10);
    /* The first that had not ended: 24 k + 48 ms >= 1 s. */
    assert_int_equal(k, 40);
    assert_int_equal(count_of(a, "pings_skipped"), 38);
    assert_int_equal(count_of(a, "pings_late"), 1);
    array_close(a);
}

static void a_drive_does_not_hurry(void **state)
{
    int err;
    struct fake_clock clock;
    struct array *a = open_array(state, QUIET(""), "?pace=fast", &clock, &err);
    assert_int_equal(err, -EINVAL);
    a = open_array(state, QUIET(""), "?pace=real", &clock, &err);
    assert_int_equal(err, 0);
    array_close(a);
}

/* However late they are taken. */
static void a_shot_of_a_drive_ends_and_leaves_nothing_out(void **state)
{
    int err;
    struct fake_clock clock;
    struct error why;
    struct array_ping ping;
    struct array *a = open_array(state, QUIET(""), "", &clock, &err);
    struct array_shot shot = {.speakers = both, .n_speakers = 2};
    assert_int_equal(err, 0);
    assert_int_equal(array_fire(a, &shot), 0);
    for (size_t k = 0; k < 2; k++) {
        clock.now_ns += 2000000000;
        assert_int_equal(array_next(a, &ping, &why), 0);
        assert_true(ping.shot_index == k && ping.frame == 0);
    }
    assert_int_equal(array_next(a, &ping, &why), -ENODATA);
    array_close(a);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_ping_holds_what_rings_on_and_what_begins_in_its_tail),
        TEST(two_that_share_a_slot_are_heard_together),
        TEST(slots_shorter_than_the_chirp_overlap),
        TEST(pings_may_be_left_out_but_not_taken_back),
        TEST(an_endless_shot_is_the_stream_of_its_time),
        TEST(falling_behind_is_counted_and_caught_up),
        TEST(a_drive_does_not_hurry),
        TEST(a_shot_of_a_drive_ends_and_leaves_nothing_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
