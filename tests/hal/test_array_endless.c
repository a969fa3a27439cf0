/* SPDX-License-Identifier: MIT */
/* Shots without end: `alsa:` on a card of alsa-lib's own, and `wav:`. */
#include "alsa_card.h"

#include <sched.h>
#include <sys/ioctl.h>

#include "hal/recording/recording.h"

/* What the card hears from frame *fed on, to frame `until` at least: the file plugin
 * reads a buffer at a time, and must find it whole. */
static void feed_until(const struct card *c, size_t *fed, size_t until)
{
    unsigned char bytes[BUFFER * INPUTS * 4];
    fcntl(c->pipe, F_SETPIPE_SZ, 1 << 20);
    for (; *fed < until; *fed += BUFFER) {
        for (size_t i = 0; i < BUFFER; i++)
            for (size_t k = 0; k < INPUTS; k++)
                put(c, heard(*fed + i, k), bytes + (i * INPUTS + k) * c->bytes);
        ssize_t size = (ssize_t)(BUFFER * INPUTS * c->bytes);
        assert_int_equal(write(c->pipe, bytes, (size_t)size), size);
    }
}

static int count_bytes(const struct card *c)
{
    int n = 0;
    assert_int_equal(ioctl(c->pipe, FIONREAD, &n), 0);
    return n;
}

static uint64_t count_of(struct card *c, const char *name)
{
    struct device_count counts[DEVICE_MAX_COUNTS];
    size_t n = array_counts(c->array, counts);
    for (size_t i = 0; i < n; i++)
        if (!strcmp(counts[i].name, name))
            return counts[i].value;
    fail_msg("no count %s", name);
    return 0;
}

static void assert_heard(const struct array_ping *ping, size_t from)
{
    static const size_t inputs[] = {2, 0, 1};
    for (size_t m = 0; m < 3; m++)
        for (size_t i = 0; i < ping->n_samples; i++)
            assert_true(ping->samples[m * ping->n_samples + i] ==
                        (float)heard(from + i, inputs[m]) / 32768);
}

/* The card's frame with which the first ping begins; the sound comes again after 40000.
 */
static size_t find_start(const struct array_ping *ping)
{
    for (size_t n = 0; n < 40000; n++)
        if (ping->samples[0] == (float)heard(n, 2) / 32768)
            return n;
    fail_msg("no such sound");
    return 0;
}

/* The frames of a second and more go through a ring that holds not many more.  Pings
 * begin where their emissions are played: starts[k] frames from the first on; a slot is
 * `longer` longer at most. */
enum { PINGS = 90 };

static void go_round(void **state, const char *options, size_t longer,
                     size_t starts[PINGS])
{
    static const uint32_t speakers[] = {1, 0};
    static unsigned char out[(PINGS * (SLOT + 200) + 16000) * OUTPUTS * 2];
    const struct array_shot shot = {
        .speakers = speakers, .n_speakers = 2, .endless = true};
    struct array_ping ping;
    struct card c;
    size_t fed = 0, start = 0;
    card_open(&c, *state, "S16", "", options);
    assert_int_equal(array_fire(c.array, &shot), 0);
    for (size_t k = 0; k < PINGS; k++) {
        feed_until(&c, &fed, 4 * BUFFER + (k + 2) * (SLOT + longer)); /* with its tail */
        next(&c, &ping);
        size_t n = ping.n_samples;
        assert_true(ping.valid && n > SLOT && n < 2 * SLOT);
        assert_int_equal(ping.shot_index, k % 2);
        assert_int_equal(ping.frame, k / 2 + 1);
        assert_false(ping.down);
        size_t at = find_start(&ping); /* of 40000, round which the sound goes */
        start = k ? start : at;
        starts[k] =
            k ? starts[k - 1] + (at + 80000 - start - starts[k - 1] % 40000) % 40000 : 0;
        assert_heard(&ping, start + starts[k]);
    }
    assert_int_equal(count_of(&c, "slots_invalid"), 0);
    assert_int_equal(count_of(&c, "slots_skipped"), 0);
    card_close(&c);
    assert_int_equal(read_played(&c, out, sizeof out), start);
    for (size_t k = 0; k + 1 < PINGS; k++)
        for (size_t f = 0; f < starts[k + 1] - starts[k]; f++)
            for (size_t o = 0; o < OUTPUTS; o++) {
                double expected = o == (k % 2 ? 1u : 3u) && f < CHIRP ? chirp(f) : 0;
                double x = played(&c, out, start + starts[k] + f, o);
                assert_true(fabs(x - expected) <= 0x1p-15);
            }
}

static void rounds_follow_each_other_without_a_break(void **state)
{
    size_t starts[PINGS];
    go_round(state, "&stagger=no", 0, starts);
    for (size_t k = 0; k < PINGS; k++)
        assert_int_equal(starts[k], k * SLOT);
}

/* By 1500 / 16 = 93 samples. */
static void one_slot_of_eight_is_longer(void **state)
{
    size_t starts[PINGS], last = 0;
    go_round(state, "", 93, starts);
    for (size_t k = 1; k < PINGS; k++) {
        size_t slot = starts[k] - starts[k - 1];
        assert_true(slot == SLOT || slot == SLOT + 93);
        assert_true(k - last < 16);
        last = slot > SLOT ? k : last;
    }
    for (size_t k = 0; k + 8 < PINGS; k += 8)
        assert_int_equal(starts[k + 8] - starts[k], 8 * SLOT + 93);
}

/* Even from 0 to 200: 90 of them span less than 150 once in a billion. */
static void with_jitter_emissions_begin_anywhere_in_it(void **state)
{
    size_t starts[PINGS];
    double least = 0, most = 0;
    go_round(state, "&jitter_samples=200", 200, starts);
    for (size_t k = 1; k < PINGS; k++) {
        double later = (double)starts[k] - (double)k * (SLOT + 200);
        least = fmin(least, later);
        most = fmax(most, later);
    }
    assert_true(most - least <= 200 && most - least > 150);
}

static void a_halted_shot_is_silent_before_the_next_one(void **state)
{
    static const uint32_t speakers[] = {0, 1}, other[] = {1};
    static unsigned char out[40000 * OUTPUTS * 2];
    const struct array_shot shot = {
        .speakers = speakers, .n_speakers = 2, .endless = true};
    const struct array_shot after = {.speakers = other, .n_speakers = 1};
    struct array_ping ping;
    struct error why;
    struct card c;
    size_t fed = 0;
    card_open(&c, *state, "S16", "", "&stagger=no");
    assert_int_equal(array_fire(c.array, &shot), 0);
    feed_until(&c, &fed, 4 * BUFFER + 3 * SLOT);
    for (size_t k = 0; k < 2; k++)
        next(&c, &ping);
    assert_int_equal(array_fire(c.array, &after), -EINVAL);
    array_halt(c.array);
    array_halt(c.array);
    assert_int_equal(array_next(c.array, &ping, &why), -ENODATA);
    assert_int_equal(array_fire(c.array, &after), 0);
    feed_until(&c, &fed, fed + 8 * BUFFER + 4 * SLOT);
    next(&c, &ping);
    assert_true(ping.valid);
    assert_int_equal(ping.frame, 0);
    assert_int_equal(ping.shot_index, 0);
    assert_int_equal(array_next(c.array, &ping, &why), -ENODATA);
    card_close(&c);
    /* The last emission on output 3 is the new shot's: a slot and tail of silence are
     * ahead of it. */
    read_played(&c, out, sizeof out);
    size_t last = 0, before = 0;
    for (size_t f = 0; f < 15000; f++)
        for (size_t o = 0; o < OUTPUTS; o++)
            if (played(&c, out, f, o) != 0) {
                if (f > last + SLOT)
                    before = f - last;
                last = f;
            }
    assert_true(before > SLOT + 100);
}

static void let_hear(struct card *c, size_t *fed, size_t n)
{
    feed_until(c, fed, *fed + n);
    while (count_bytes(c)) /* until the card has taken it */
        sched_yield();
}

/* The ring holds some 52000 frames: of 45000 the newest ping is taken and the others are
 * ignored; of 100000 more the newest found no room. */
static void
who_comes_late_goes_on_with_the_newest_and_what_was_lost_is_counted(void **state)
{
    static const uint32_t speakers[] = {0, 1};
    const struct array_shot shot = {
        .speakers = speakers, .n_speakers = 2, .endless = true};
    struct array_ping ping;
    struct card c;
    size_t fed = 0, n_void = 0;
    card_open(&c, *state, "S16", "", "&stagger=no");
    assert_int_equal(array_fire(c.array, &shot), 0);
    let_hear(&c, &fed, 45000);
    next(&c, &ping);
    size_t k = (ping.frame - 1) * 2 + ping.shot_index;
    assert_true(k > 15 && ping.valid);
    assert_int_equal(count_of(&c, "slots_skipped"), k);
    assert_int_equal(count_of(&c, "slots_invalid"), 0);
    assert_heard(&ping, find_start(&ping));
    let_hear(&c, &fed, 100000);
    for (next(&c, &ping); !ping.valid; next(&c, &ping), n_void++)
        let_hear(&c, &fed, SLOT);
    assert_in_range(n_void, 1, 4);
    assert_true(count_of(&c, "slots_skipped") > 50);
    assert_true(count_of(&c, "slots_invalid") > 20);
    assert_heard(&ping, find_start(&ping));
    card_close(&c);
}

#define SHORT_SURVEY                                                                     \
    "temperature_c: 20\n"                                                                \
    "sample_rate_hz: 48000\n"                                                            \
    "slot_samples: 300\n"                                                                \
    "together: 2\n"                                                                      \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.00625, alternates: true}\n"   \
    "speakers_m: [[0, 0, 0], [0.1, 0, 0]]\n"                                             \
    "microphones_m: [[0, 0.1, 0], [0.1, 0.1, 0], [0.2, 0.1, 0]]\n"                       \
    "gate_m: [0.3, 0.9]\n"

/* Two at a time, one upward, one downward, over all 300 samples of each slot. */
static void two_speakers_sound_together_in_opposite_directions(void **state)
{
    enum { TOGETHER = 300, ROUNDS = 6 };
    static const uint32_t speakers[] = {0, 1};
    static unsigned char out[12000 * OUTPUTS * 2];
    const struct array_shot shot = {
        .speakers = speakers, .n_speakers = 2, .endless = true};
    struct array_ping ping;
    struct card c;
    size_t fed = 0, start = 0;
    card_open_survey(&c, *state, SHORT_SURVEY, "S16", "", "&stagger=no");
    assert_int_equal(array_fire(c.array, &shot), 0);
    feed_until(&c, &fed, 5000);
    for (size_t k = 0; k < 2 * ROUNDS; k++) {
        next(&c, &ping);
        assert_int_equal(ping.shot_index, k % 2);
        assert_int_equal(ping.frame, k / 2 + 1);
        assert_int_equal(ping.down, k % 2);
        start = k ? start : find_start(&ping);
        assert_heard(&ping, start + k / 2 * TOGETHER);
    }
    card_close(&c);
    assert_int_equal(read_played(&c, out, sizeof out), start);
    for (size_t f = 0; f < ROUNDS * TOGETHER; f++) {
        double t = (double)(f % TOGETHER) / 48000, bend = 0.5 * 18000 / 0.00625;
        double up = cos(2 * M_PI * (2000 + bend * t) * t);
        double down = cos(2 * M_PI * (20000 - bend * t) * t);
        assert_true(fabs(played(&c, out, start + f, 1) - up) <= 0x1p-15);
        assert_true(fabs(played(&c, out, start + f, 3) - down) <= 0x1p-15);
    }
}

/* -- recordings, on a clock that goes as far as anybody waits ---------------------------
 */

enum { RECORDED = 5 }; /* slots, and half of one */

struct player {
    int64_t now_ns;
    struct array *array;
    float samples[3][RECORDED * SLOT + SLOT / 2];
};

static int64_t now_of(void *state)
{
    return ((const struct player *)state)->now_ns;
}

static int wait_until(void *state, int64_t t_ns)
{
    struct player *p = state;
    p->now_ns = t_ns > p->now_ns ? t_ns : p->now_ns;
    return 0;
}

static void play(struct player *p, struct scratch *s, const char *options,
                 const char *table)
{
    const size_t n = RECORDED * SLOT + SLOT / 2;
    const struct clock_source clock = {now_of, wait_until, p};
    static struct clock_source kept;
    struct error why = {.text = ""};
    char uri[600];
    for (size_t m = 0; m < 3; m++)
        for (size_t i = 0; i < n; i++)
            p->samples[m][i] = (float)(20000 * m + i) / 65536;
    scratch_folder(s, "rec");
    scratch_write(s, "rec/survey.yaml", RIG_SURVEY "gate_m: [0.3, 4]\n");
    if (table)
        scratch_write(s, "rec/emissions.csv", table);
    assert_int_equal(
        recording_write(scratch_path(s, "rec"), 0, 3, n, 48000, p->samples[0], &why), 0);
    snprintf(uri, sizeof uri, "wav:%s%s", scratch_path(s, "rec"), options);
    kept = clock;
    if (array_open(&p->array, uri, &kept, &why))
        fail_msg("%s", why.text);
}

static void fire_all(struct player *p, const uint32_t *speakers, size_t n)
{
    const struct array_shot shot = {
        .speakers = speakers, .n_speakers = n, .endless = true};
    p->now_ns = 7000000000;
    assert_int_equal(array_fire(p->array, &shot), 0);
}

/* The next ping: speaker, frame, and sound and time of a sample of the recording. */
static void expect_ping(struct player *p, size_t index, uint32_t frame, size_t sample,
                        size_t after)
{
    struct error why = {.text = ""};
    struct array_ping ping;
    if (array_next(p->array, &ping, &why))
        fail_msg("%s", why.text);
    assert_int_equal(ping.shot_index, index);
    assert_int_equal(ping.frame, frame);
    int64_t expected_ns = 7000000000 + (int64_t)(1e9 * (double)after / 48000);
    assert_true(llabs(ping.t0_ns - expected_ns) <= 1);
    for (size_t m = 0; m < 3; m++)
        for (size_t i = 0; i < ping.n_samples; i++) {
            size_t at = sample + i;
            float x = at < RECORDED * SLOT + SLOT / 2 ? p->samples[m][at] : 0.0f;
            assert_true(ping.samples[m * ping.n_samples + i] == x);
        }
}

static void expect_end(struct player *p)
{
    struct error why = {.text = ""};
    struct array_ping ping;
    assert_int_equal(array_next(p->array, &ping, &why), -ENODATA);
    assert_string_equal(why.text, "the recording has ended");
    assert_int_equal(array_next(p->array, &ping, &why), -ENODATA);
    array_close(p->array);
}

static struct player player;

static void a_recording_is_played_to_its_end_at_its_pace(void **state)
{
    static const uint32_t speakers[] = {0, 1};
    play(&player, *state, "", NULL);
    fire_all(&player, speakers, 2);
    for (size_t k = 0; k < RECORDED; k++)
        expect_ping(&player, k % 2, (uint32_t)(k / 2 + 1), k * SLOT, k * SLOT);
    expect_end(&player);
}

static void a_recording_begins_again_where_it_is_asked_to(void **state)
{
    static const uint32_t speakers[] = {0, 1};
    play(&player, *state, "?loop=yes", NULL);
    fire_all(&player, speakers, 2);
    for (size_t k = 0; k < 3 * RECORDED; k++)
        expect_ping(&player, k % RECORDED % 2,
                    (uint32_t)(k / RECORDED * 3 + k % RECORDED / 2 + 1),
                    k % RECORDED * SLOT, k * SLOT);
    array_close(player.array);
}

/* Those that were not asked for are ignored, in their time. */
static void some_of_the_speakers_are_played_when_they_sounded(void **state)
{
    static const uint32_t speakers[] = {1};
    play(&player, *state, "", NULL);
    fire_all(&player, speakers, 1);
    expect_ping(&player, 0, 1, SLOT, SLOT);
    expect_ping(&player, 0, 2, 3 * SLOT, 3 * SLOT);
    expect_end(&player);
}

static void a_table_says_what_sounded_when(void **state)
{
    static const uint32_t speakers[] = {0, 1};
    play(&player, *state, "",
         "sample;speaker;frame\n100;1;4\n1700;0;6\n1700;1;6\n8000;0;9\n");
    fire_all(&player, speakers, 2);
    expect_ping(&player, 1, 1, 100, 0);
    expect_ping(&player, 0, 3, 1700, 1600);
    expect_ping(&player, 1, 3, 1700, 1600);
    expect_ping(&player, 0, 6, 8000, 7900);
    expect_end(&player);
}

static void speakers_that_the_recording_has_not_are_refused(void **state)
{
    static const uint32_t speakers[] = {1};
    struct error why = {.text = ""};
    struct array_ping ping;
    play(&player, *state, "", "sample,speaker\n0,0\n1500,0\n");
    fire_all(&player, speakers, 1);
    assert_int_equal(array_next(player.array, &ping, &why), -EINVAL);
    assert_non_null(strstr(why.text, "none of the speakers"));
    array_close(player.array);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(rounds_follow_each_other_without_a_break),
        TEST(one_slot_of_eight_is_longer),
        TEST(with_jitter_emissions_begin_anywhere_in_it),
        TEST(a_halted_shot_is_silent_before_the_next_one),
        TEST(who_comes_late_goes_on_with_the_newest_and_what_was_lost_is_counted),
        TEST(two_speakers_sound_together_in_opposite_directions),
        TEST(a_recording_is_played_to_its_end_at_its_pace),
        TEST(a_recording_begins_again_where_it_is_asked_to),
        TEST(some_of_the_speakers_are_played_when_they_sounded),
        TEST(a_table_says_what_sounded_when),
        TEST(speakers_that_the_recording_has_not_are_refused),
    };
    return cmocka_run_group_tests(tests, card_set_up, card_tear_down);
}
