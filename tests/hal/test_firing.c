/* SPDX-License-Identifier: MIT */
/* How an array's speakers fire, chosen by its URI. */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/array.h"
#include "hal/survey/firing.h"

/* Chirps of 10 ms in slots of 31.25 ms, heard to 3 m; for an array that stands. */
static const char scene[] = "sample_rate_hz: 48000\n"
                            "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.01}\n"
                            "slot_samples: 1500\n"
                            "speakers_m: [[0, 0, 0], [0.1, 0, 0]]\n"
                            "microphones_m: [[0.05, 0, 0]]\n"
                            "sound_speed_m_s: 340\n"
                            "wall: {normal: [0, 0, 1], distance_m: 1}\n"
                            "gate_m: [0.5, 3]\n";

static int open_with(struct scratch *s, const char *options, struct fake_clock *clock,
                     struct array **out, struct error *why)
{
    char uri[700];

    snprintf(uri, sizeof uri, "sim:%s%s", scratch_write(s, "scene.yaml", scene), options);
    fake_clock_set(clock, INT64_C(1700000000000000000));
    return array_open(out, uri, &clock->source, why);
}

static struct array *must_open(struct scratch *s, const char *options,
                               struct fake_clock *clock)
{
    struct error why = {""};
    struct array *a = NULL;

    if (open_with(s, options, clock, &a, &why))
        fail_msg("%s", why.text);
    return a;
}

static void without_options_the_file_says_all(void **state)
{
    struct fake_clock clock;
    struct array *a = must_open(*state, "?pace=real", &clock);
    const struct survey *s = array_survey(a);

    assert_int_equal(s->slot_samples, 1500);
    assert_int_equal(s->together, 0);
    assert_false(s->chirp_alternates);
    assert_true(s->chirp_duration_s == 0.01 && s->gate_m[0] == 0.5 && s->gate_m[1] == 3);
    array_close(a);
}

static void options_win_over_the_file(void **state)
{
    struct fake_clock clock;
    struct array *a = must_open(*state,
                                "?slot_samples=800&together=2&alternates=yes"
                                "&chirp_s=0.005&far_m=2",
                                &clock);
    const struct survey *s = array_survey(a);

    assert_int_equal(s->slot_samples, 800);
    assert_int_equal(s->together, 2);
    assert_true(s->chirp_alternates);
    assert_true(s->chirp_duration_s == 0.005);
    assert_true(s->gate_m[0] == 0.5 && s->gate_m[1] == 2);
    array_close(a);
}

static bool goes_on(struct scratch *s, const char *stage, const char *options)
{
    struct fake_clock clock;
    struct error why = {""};
    struct array *a = NULL;
    char uri[700], text[1000];

    snprintf(text, sizeof text,
             "%sstage: {axis: [1, 0, 0], positions_m: [0, 0.01, 0.02]%s}\n", scene,
             stage);
    snprintf(uri, sizeof uri, "sim:%s%s", scratch_write(s, "scene.yaml", text), options);
    fake_clock_set(&clock, INT64_C(1700000000000000000));
    if (array_open(&a, uri, &clock.source, &why))
        fail_msg("%s", why.text);
    bool on = array_survey(a)->continuous;
    array_close(a);
    return on;
}

static void a_stage_goes_on_or_stops_as_they_say(void **state)
{
    struct fake_clock clock;
    struct error why = {""};
    struct array *a = NULL;

    assert_false(goes_on(*state, "", ""));
    assert_true(goes_on(*state, "", "?continuous=yes"));
    assert_true(goes_on(*state, ", continuous: true", "?slot_samples=1600"));
    assert_false(goes_on(*state, ", continuous: true", "?continuous=no"));
    assert_int_equal(open_with(*state, "?continuous=yes", &clock, &a, &why), -EINVAL);
    assert_non_null(strstr(why.text, "one position"));
}

static void fewer_positions_go_as_far(void **state)
{
    const struct firing three = {.positions = 3}, all = {.positions = 5};
    const struct firing more = {.positions = 6}, one = {.positions = 1};
    double places_m[5] = {0.1, 0.12, 0.14, 0.16, 0.18};
    struct survey s = {.n_positions = 5, .stage_positions_m = places_m};
    struct error why = {""};

    (void)state;
    firing_apply(&s, &all, &why); /* nothing else of it is a survey */
    assert_true(s.n_positions == 5 && places_m[1] == 0.12);
    assert_int_equal(firing_apply(&s, &more, &why), -EINVAL);
    assert_non_null(strstr(why.text, "2 to the 5"));
    assert_int_equal(firing_apply(&s, &one, &why), -EINVAL);
    assert_int_equal(s.n_positions, 5);
    firing_apply(&s, &three, &why);
    assert_int_equal(s.n_positions, 3);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(places_m[k] - 0.1 - 0.04 * k) < 1e-12);
}

/* Slots of 1/60 s at the true pace: two pings begin in each. */
static void the_array_fires_as_they_say(void **state)
{
    static const uint32_t speakers[] = {0, 1};
    const struct array_shot shot = {
        .speakers = speakers, .n_speakers = 2, .endless = true};
    struct fake_clock clock;
    struct error why;
    struct array_ping ping;
    struct array *a = must_open(
        *state, "?slot_samples=800&together=2&alternates=yes&far_m=2&pace=real", &clock);
    int64_t first_ns = clock.now_ns;

    assert_int_equal(array_fire(a, &shot), 0);
    for (int k = 0; k < 6; k++) {
        assert_int_equal(array_next(a, &ping, &why), 0);
        assert_int_equal(ping.down, k % 2);
        assert_true(llabs(ping.t0_ns - first_ns - k / 2 * INT64_C(1000000000) / 60) <
                    1000);
    }
    array_close(a);
}

static struct firing_slots slots_of(const char *uri, bool staggers, uint64_t seed)
{
    const struct survey s = {.slot_samples = 1152};
    struct error why = {""};
    struct firing f;

    if (firing_from_uri(&f, uri, &why))
        fail_msg("%s", why.text);
    return firing_slots(&s, &f, staggers, seed);
}

/* By 1152 / 16 samples; which one is drawn, so that of two arrays both are not longer at
 * once for long. */
static void one_slot_of_each_eight_is_longer(void **state)
{
    const struct firing_slots a = slots_of("alsa:x", true, 1),
                              b = slots_of("sim:x?stagger=yes", false, 2);
    size_t at_once = 0;

    (void)state;
    assert_int_equal(firing_start(&a, 0), 0);
    for (uint64_t k = 0; k < 1600; k++) {
        uint64_t slot = firing_start(&a, k + 1) - firing_start(&a, k);
        uint64_t other = firing_start(&b, k + 1) - firing_start(&b, k);
        assert_true((slot == 1152 || slot == 1224) && (other == 1152 || other == 1224));
        at_once += slot > 1152 && other > 1152;
        if (k % 8 == 0)
            assert_int_equal(firing_start(&a, k), 1152 * k + 72 * (k / 8));
    }
    assert_true(at_once < 50); /* of 200, by chance 1 in 7 */
}

static void slots_are_of_one_length_where_it_is_said(void **state)
{
    (void)state;
    assert_int_equal(slots_of("alsa:x?stagger=no", true, 1).stagger_samples, 0);
    assert_int_equal(slots_of("sim:x", false, 1).stagger_samples, 0);
    const struct firing_slots jitter = slots_of("alsa:x?jitter_samples=9", true, 1);
    assert_true(jitter.jitter_samples == 9 && jitter.stagger_samples == 0);
}

static void slots_that_differ_are_refused_where_they_cannot(void **state)
{
    struct fake_clock clock;
    struct error why = {""};
    struct array *a = NULL;
    struct firing f;
    char text[1000], uri[700];

    assert_int_equal(firing_from_uri(&f, "sim:x?stagger=yes&jitter_samples=9", &why),
                     -EINVAL);
    assert_non_null(strstr(why.text, "stagger: not beside jitter_samples"));
    assert_int_equal(firing_from_uri(&f, "sim:x?stagger=no&jitter_samples=9", &why), 0);
    assert_int_equal(firing_from_uri(&f, "sim:x?stagger=maybe", &why), -EINVAL);

    snprintf(text, sizeof text, "%sstage: {axis: [1, 0, 0], positions_m: [0, 0.01]}\n",
             scene);
    const char *path = scratch_write(*state, "scene.yaml", text);
    fake_clock_set(&clock, INT64_C(1700000000000000000));
    snprintf(uri, sizeof uri, "sim:%s?stagger=yes", path);
    assert_int_equal(array_open(&a, uri, &clock.source, &why), -EINVAL);
    assert_non_null(strstr(why.text, "stagger: not of a scan with a stage"));
    snprintf(uri, sizeof uri, "sim:%s?jitter_samples=9", path);
    assert_int_equal(array_open(&a, uri, &clock.source, &why), -EINVAL);
    assert_non_null(strstr(why.text, "jitter_samples: not of a scan with a stage"));
}

/* None is passed by, whatever the slots. */
static void a_slot_before_a_sample_is_found(void **state)
{
    static const char *const uris[] = {"a:x?stagger=no", "a:x", "a:x?jitter_samples=500"};

    (void)state;
    for (size_t i = 0; i < 3; i++) {
        const struct firing_slots s = slots_of(uris[i], true, 3);
        assert_int_equal(firing_slot_before(&s, -1e6), 0);
        for (uint64_t k = 1; k < 1000; k++) {
            uint64_t start = firing_start(&s, k);
            uint64_t at = firing_slot_before(&s, (double)start);
            uint64_t after = firing_slot_before(&s, (double)start + 1);
            assert_true(at <= k && at + 2 >= k);
            assert_true(after <= k + 1);
        }
    }
}

static void what_does_not_go_together_is_refused(void **state)
{
    static const struct {
        const char *options, *part;
    } cases[] = {
        {"?together=2", "with the options of the array: together is 2"},
        {"?slot_samples=500", "gate_m: gate beyond the slot: far is 3 m"},
        {"?far_m=0.4", "expected 0 <= near < far"},
        {"?together=3", "option together=3: expected a number in 1..2"},
        {"?slot_samples=800.5", "option slot_samples=800.5: expected a whole number"},
        {"?alternates=maybe", "option alternates=maybe: expected no or yes"},
        {"?chirp_s=0", "option chirp_s=0"},
        {"?positions=2", "expected 2 to the 1 that there are"},
        {"?slot=800", "expected pace, calibrated, slot_samples"},
    };
    struct fake_clock clock;

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {""};
        struct array *a = NULL;
        assert_int_equal(open_with(*state, cases[i].options, &clock, &a, &why), -EINVAL);
        assert_null(a);
        if (!strstr(why.text, cases[i].part))
            fail_msg("%s: %s", cases[i].options, why.text);
    }
}

static void a_gate_ends_nearer_only_where_there_is_one(void **state)
{
    const struct firing nearer = {.far_m = 2};
    struct survey s = {.has_gate = false};
    struct error why = {""};

    (void)state;
    assert_int_equal(firing_apply(&s, &nearer, &why), -EINVAL);
    assert_non_null(strstr(why.text, "no gate_m"));
}

static void of_a_uri_only_its_own_options_count(void **state)
{
    struct error why = {""};
    struct firing f;

    (void)state;
    assert_int_equal(firing_from_uri(&f, "alsa:hw:1,0?rig=r.yaml&slot_samples=960", &why),
                     0);
    assert_true(f.slot_samples == 960 && f.together == 0 && f.chirp_s == 0);
    assert_true(f.chirps == FIRING_AS_THEY_ARE);
    assert_int_equal(firing_from_uri(&f, "sim:s.yaml?alternates=no", &why), 0);
    assert_true(f.chirps == FIRING_ONE_WAY && f.slot_samples == 0);
    assert_int_equal(firing_from_uri(&f, "sim:s.yaml?together=x", &why), -EINVAL);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(without_options_the_file_says_all),
        TEST(options_win_over_the_file),
        TEST(fewer_positions_go_as_far),
        TEST(a_stage_goes_on_or_stops_as_they_say),
        TEST(the_array_fires_as_they_say),
        TEST(one_slot_of_each_eight_is_longer),
        TEST(slots_are_of_one_length_where_it_is_said),
        TEST(slots_that_differ_are_refused_where_they_cannot),
        TEST(a_slot_before_a_sample_is_found),
        TEST(what_does_not_go_together_is_refused),
        TEST(a_gate_ends_nearer_only_where_there_is_one),
        TEST(of_a_uri_only_its_own_options_count),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
