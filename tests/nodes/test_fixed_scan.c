/* SPDX-License-Identifier: MIT */
/* The scan of an array that stands against an array that does what it is asked. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/convert.h"
#include "nodes/scan/fixed_scan.h"
#include "recon/survey.h"

#define MS         1000000LL
#define SLOT_MS    25
#define N_SPEAKERS 6
#define ROUND_MS   (N_SPEAKERS * SLOT_MS)

struct world {
    struct fixed_scan *scan;
    struct survey survey;
    int64_t now_ns;
    int64_t array_epoch, dsp_epoch;
    Anlos__FireCommand fired; /* the newest that the array heard */
    uint32_t speakers[N_SPEAKERS];
    unsigned n_commands;
    uint64_t n_pings; /* of that command */
    bool deaf, mute, away;
};

static const char *const needs[] = {"array", "dsp"};

static void create(struct world *w, const uint32_t *speakers, size_t n, unsigned frames)
{
    const struct scan_config cfg = {.speakers = speakers,
                                    .n_speakers = n,
                                    .background = frames > 0,
                                    .background_frames = frames,
                                    .timeout_s = 2.0,
                                    .silence_s = 5.0,
                                    .needs = needs,
                                    .n_needs = 2};

    fixed_scan_destroy(w->scan);
    assert_int_equal(fixed_scan_create(&w->scan, &cfg), 0);
}

static int setup(void **state)
{
    static double elements[N_SPEAKERS][3], position;
    struct world *w = calloc(1, sizeof *w);

    if (!w)
        return -1;
    for (int i = 0; i < N_SPEAKERS; i++)
        elements[i][0] = 0.1 * i;
    w->survey = (struct survey){.sound_speed_m_s = 343,
                                .temperature_c = 20,
                                .sample_rate_hz = 48000,
                                .chirp_start_hz = 2000,
                                .chirp_stop_hz = 20000,
                                .chirp_duration_s = 0.0625,
                                .slot_samples = 48 * SLOT_MS,
                                .n_speakers = N_SPEAKERS,
                                .n_microphones = 1,
                                .n_positions = 1,
                                .speakers_m = elements,
                                .microphones_m = elements,
                                .stage_axis = {1, 0, 0},
                                .stage_positions_m = &position,
                                .has_gate = true,
                                .gate_m = {0.3, 4}};
    w->array_epoch = w->dsp_epoch = 1;
    w->now_ns = 1000 * MS;
    *state = w;
    return 0;
}

static int teardown(void **state)
{
    struct world *w = *state;

    fixed_scan_destroy(w->scan);
    free(w);
    return 0;
}

static void tell_survey(struct world *w)
{
    uint8_t *bytes;
    size_t size;

    assert_int_equal(survey_pack(&w->survey, &bytes, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    assert_int_equal(fixed_scan_survey(w->scan, m), 0);
    anlos__survey__free_unpacked(m, NULL);
    free(bytes);
}

static void tell_health(struct world *w, const char *name, int64_t epoch, bool ready)
{
    Anlos__Health health = ANLOS__HEALTH__INIT;

    health.node = (char *)name;
    health.state = ready ? ANLOS__HEALTH__STATE__READY : ANLOS__HEALTH__STATE__STARTING;
    if (fixed_scan_hear(w->scan, name, epoch, w->now_ns))
        fixed_scan_health(w->scan, name, &health);
}

static void send_ping(struct world *w)
{
    Anlos__Ping ping = ANLOS__PING__INIT;

    ping.scan = w->fired.scan;
    ping.pass = w->fired.pass;
    ping.frame = (uint32_t)(w->n_pings / w->fired.n_speakers + 1);
    ping.speaker = w->speakers[w->n_pings % w->fired.n_speakers];
    ping.valid = true;
    w->n_pings++;
    if (!w->mute && fixed_scan_hear(w->scan, "array", w->array_epoch, w->now_ns))
        fixed_scan_ping(w->scan, &ping, w->now_ns);
}

static void step(struct world *w)
{
    Anlos__FireCommand c;

    if (!fixed_scan_step(w->scan, w->now_ns, &c))
        return;
    w->n_commands++;
    assert_true(c.endless && c.position == 0);
    if (w->deaf || (w->fired.id == c.id && w->fired.n_speakers))
        return;
    memcpy(w->speakers, c.speakers, c.n_speakers * sizeof *c.speakers);
    w->fired = c;
    w->n_pings = 0;
}

static void run(struct world *w, int64_t ms)
{
    for (int64_t end = w->now_ns + ms * MS; w->now_ns < end; w->now_ns += SLOT_MS * MS) {
        tell_health(w, "array", w->array_epoch, !w->away);
        tell_health(w, "dsp", w->dsp_epoch, true);
        if (w->fired.n_speakers && !w->away)
            send_ping(w);
        step(w);
    }
}

static Anlos__ScanStatus status(struct world *w)
{
    Anlos__ScanStatus s;

    fixed_scan_status(w->scan, w->now_ns, &s);
    return s;
}

static void it_waits_for_nodes_and_survey_then_asks_once(void **state)
{
    struct world *w = *state;

    create(w, NULL, 0, 0);
    step(w);
    assert_int_equal(w->n_commands, 0);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__WAITING);
    run(w, 500);
    assert_int_equal(w->n_commands, 0);
    assert_string_equal(status(w).text, "waits for the survey");
    tell_survey(w);
    run(w, 5000);
    assert_int_equal(w->n_commands, 1);
    assert_int_equal(w->fired.n_speakers, N_SPEAKERS);
    assert_int_equal(w->fired.scan, 1);
    assert_int_equal(w->fired.pass, ANLOS__PASS__SCENE);
    Anlos__ScanStatus s = status(w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__RUNNING);
    assert_in_range(s.pings_done, 195, 200);
    assert_int_equal(s.pings_lost, 0);
    assert_int_equal(s.pings_expected, 0);
    assert_string_equal(s.text, "6.7 frames/s, 40.0 pings/s");
}

static void a_node_that_cannot_go_on_is_named_until_it_can(void **state)
{
    struct world *w = *state;
    Anlos__Health fault = ANLOS__HEALTH__INIT;

    create(w, NULL, 0, 0);
    tell_survey(w);
    run(w, 500);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__RUNNING);
    fault.state = ANLOS__HEALTH__STATE__FAULT;
    fault.text = (char *)"no memory";
    fixed_scan_health(w->scan, "dsp", &fault);
    step(w);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__FAILED);
    assert_string_equal(status(w).text, "dsp: no memory");
    run(w, 500);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__RUNNING);
}

static void a_command_that_got_lost_is_sent_again(void **state)
{
    struct world *w = *state;

    create(w, NULL, 0, 0);
    tell_survey(w);
    w->deaf = true;
    run(w, 1600);
    assert_in_range(w->n_commands, 3, 4);
    w->deaf = false;
    run(w, 3000);
    assert_in_range(w->n_commands, 4, 5);
    assert_int_equal(w->fired.scan, 1);
    assert_true(status(w).pings_done > 50);
}

static void the_speakers_are_those_asked_for_in_their_order(void **state)
{
    static const uint32_t speakers[] = {5, 0, 3};
    struct world *w = *state;

    create(w, speakers, 3, 0);
    tell_survey(w);
    run(w, 100);
    assert_int_equal(w->fired.n_speakers, 3);
    assert_memory_equal(w->speakers, speakers, sizeof speakers);
}

static void the_background_is_recorded_first_and_only_so_many_frames(void **state)
{
    struct world *w = *state;

    create(w, NULL, 0, 4);
    tell_survey(w);
    run(w, 3 * ROUND_MS);
    assert_int_equal(w->fired.pass, ANLOS__PASS__BACKGROUND);
    assert_int_equal(status(w).pass, ANLOS__PASS__BACKGROUND);
    run(w, 2 * ROUND_MS);
    assert_int_equal(w->fired.pass, ANLOS__PASS__SCENE);
    assert_int_equal(w->fired.scan, 1);
    assert_int_equal(w->n_commands, 2);
    w->dsp_epoch = 2; /* it has lost what was recorded */
    run(w, 3 * ROUND_MS);
    assert_int_equal(w->fired.pass, ANLOS__PASS__BACKGROUND);
    assert_int_equal(w->fired.scan, 2);
}

static void an_array_that_was_restarted_is_asked_anew_as_another_scan(void **state)
{
    struct world *w = *state;

    create(w, NULL, 0, 0);
    tell_survey(w);
    run(w, 1000);
    w->array_epoch = 2;
    w->fired.n_speakers = 0;
    run(w, 1000);
    assert_int_equal(w->fired.scan, 2);
    assert_int_equal(w->n_commands, 2);
    assert_int_equal(status(w).pings_lost, 0);
    assert_true(status(w).pings_done > 70);
}

static void a_silent_array_is_asked_again_but_not_while_its_device_is_away(void **state)
{
    struct world *w = *state;

    create(w, NULL, 0, 0);
    tell_survey(w);
    run(w, 1000);
    w->away = true;
    run(w, 10000);
    assert_int_equal(w->n_commands, 1);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__WAITING);
    w->away = false;
    w->mute = true;
    run(w, 2200);
    w->mute = false;
    run(w, 1000);
    assert_int_equal(w->fired.scan, 2);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__RUNNING);
}

static void another_survey_is_another_scan(void **state)
{
    struct world *w = *state;

    create(w, NULL, 0, 0);
    tell_survey(w);
    run(w, 1000);
    tell_survey(w);
    run(w, 500);
    assert_int_equal(w->fired.scan, 1);
    w->survey.sound_speed_m_s = 344;
    tell_survey(w);
    run(w, 500);
    assert_int_equal(w->fired.scan, 2);
}

static void pings_that_got_lost_are_counted(void **state)
{
    struct world *w = *state;

    create(w, NULL, 0, 0);
    tell_survey(w);
    run(w, 1000);
    w->n_pings += 5;
    run(w, 1000);
    assert_int_equal(status(w).pings_lost, 5);
}

static void what_cannot_be_asked_for_fails_with_a_sentence(void **state)
{
    static const uint32_t unknown[] = {0, 7, 1}, few[] = {0, 1};
    static double positions[2] = {0, 0.1};
    struct world *w = *state;

    create(w, unknown, 3, 0);
    tell_survey(w);
    run(w, 500);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__FAILED);
    assert_string_equal(status(w).text,
                        "scan: scan.speakers: the survey has speakers 0 to 5, not 7");
    create(w, few, 2, 0); /* two slots of 25 ms are shorter than a chirp of 62.5 */
    tell_survey(w);
    run(w, 500);
    assert_non_null(strstr(status(w).text, "within the chirp of 0.0625 s"));
    create(w, few, 1, 0);
    w->survey.slot_samples = 3000;
    w->survey.chirp_alternates = true;
    w->survey.together = 2;
    tell_survey(w);
    run(w, 500);
    assert_non_null(strstr(status(w).text, "expected an even number"));
    create(w, NULL, 0, 0);
    w->survey.n_positions = 2;
    w->survey.stage_positions_m = positions;
    tell_survey(w);
    run(w, 500);
    assert_non_null(strstr(status(w).text, "2 positions of a stage"));
    assert_int_equal(w->n_commands, 0);
}

static void say_ended(struct world *w)
{
    Anlos__Health health = ANLOS__HEALTH__INIT;

    health.state = ANLOS__HEALTH__STATE__READY;
    health.ended = true;
    fixed_scan_health(w->scan, "array", &health);
    step(w);
}

/* The last pings of a recording come on another way than the news that it has ended. */
static void
a_recording_that_has_ended_is_done_when_its_last_ping_is_a_second_old(void **state)
{
    struct world *w = *state;

    create(w, NULL, 0, 0);
    tell_survey(w);
    run(w, 2000);
    uint32_t done = status(w).pings_done;
    say_ended(w);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__RUNNING);
    send_ping(w);
    w->now_ns += 999 * MS;
    say_ended(w);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__RUNNING);
    w->now_ns += MS;
    say_ended(w);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_string_equal(status(w).text, "the recording has ended");
    assert_int_equal(status(w).pings_done, done + 1);
    w->now_ns += 10000 * MS; /* nobody asks it anew */
    say_ended(w);
    assert_int_equal(w->n_commands, 1);
    assert_int_equal(status(w).state, ANLOS__SCAN_STATUS__STATE__DONE);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(it_waits_for_nodes_and_survey_then_asks_once),
        TEST(a_node_that_cannot_go_on_is_named_until_it_can),
        TEST(a_command_that_got_lost_is_sent_again),
        TEST(the_speakers_are_those_asked_for_in_their_order),
        TEST(the_background_is_recorded_first_and_only_so_many_frames),
        TEST(an_array_that_was_restarted_is_asked_anew_as_another_scan),
        TEST(a_silent_array_is_asked_again_but_not_while_its_device_is_away),
        TEST(another_survey_is_another_scan),
        TEST(pings_that_got_lost_are_counted),
        TEST(what_cannot_be_asked_for_fails_with_a_sentence),
        TEST(a_recording_that_has_ended_is_done_when_its_last_ping_is_a_second_old),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
