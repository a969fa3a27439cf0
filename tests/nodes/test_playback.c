/* SPDX-License-Identifier: MIT */
/* A bag is played to nodes that the test plays: it says what they would, and when. */
#include "tests/nodes/played_bag.h"

#include <errno.h>
#include <math.h>

#include "msgs/bus.h"
#include "msgs/vehicle.pb-c.h"
#include "nodes/play/playback.h"

#define MS INT64_C(1000000)

struct rig {
    struct scratch *scratch;
    struct playback *p;
    struct playback_config cfg;
    int64_t now_ns;
    int64_t used_ns; /* up to there all nodes get */
    uint64_t round;  /* of the newest progress of play's, */
    int64_t told_ns; /* which is up to there */
    char bag[600];
};

static const char *const all[] = {"play", "dsp", "recon", "track"};

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scratch_open((void **)&r->scratch))
        return -1;
    snprintf(r->bag, sizeof r->bag, "%s", scratch_path(r->scratch, "a.mcap"));
    r->now_ns = 5000000 * MS;
    r->used_ns = INT64_MAX;
    r->cfg = (struct playback_config){.bag_iterator = {.bag = r->bag, .end_s = INFINITY},
                                      .run_dir = r->scratch->folder,
                                      .nodes = all,
                                      .n_nodes = 4,
                                      .window = 4,
                                      .timeout_s = 5.0};
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;

    playback_destroy(r->p);
    free(r);
    return scratch_close(&scratch);
}

static struct playback_status status_of(const struct rig *r)
{
    struct playback_status s;

    playback_status(r->p, &s);
    return s;
}

static void say_health(struct rig *r)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;

    h.state = ANLOS__HEALTH__STATE__READY;
    for (size_t i = 1; i < r->cfg.n_nodes; i++)
        playback_health(r->p, r->cfg.nodes[i], 7, &h, r->now_ns);
}

/* All have used everything up to there, as far as it was sent. */
static void say_progress(struct rig *r, int64_t time_ns)
{
    Anlos__Progress told, p = ANLOS__PROGRESS__INIT;
    Anlos__Sent sent[16], *list[16];
    char *nodes[16];

    p.time_ns = time_ns;
    if (playback_tells(r->p, &told, sent, list, nodes, 16, r->now_ns)) {
        r->round = told.round;
        r->told_ns = told.time_ns;
    }
    p.round = r->round;
    if (r->told_ns < time_ns)
        p.time_ns = r->told_ns;
    for (size_t i = 1; i < r->cfg.n_nodes; i++)
        playback_progress(r->p, r->cfg.nodes[i], &p);
}

/* As long as something goes out, and time passes. */
static void turn(struct rig *r, int64_t for_ns)
{
    struct error why = {""};
    int64_t due_ns, end_ns = r->now_ns + for_ns;

    do {
        if (playback_step(r->p, r->now_ns, &due_ns, &why))
            fail_msg("%s", why.text);
        say_progress(r, r->used_ns);
        if (due_ns > r->now_ns)
            r->now_ns = due_ns < end_ns ? due_ns : end_ns;
    } while (r->now_ns < end_ns);
}

/* All are ready, and nothing has been played: what the bag holds comes after this. */
static void create(struct rig *r)
{
    struct error why = {""};

    if (playback_create(&r->p, &r->cfg, 3, &why))
        fail_msg("%s", why.text);
    playback_hears(r->p, true);
    assert_int_equal(status_of(r).phase, PLAYBACK_WAITS);
    turn(r, 100 * MS);
    say_health(r);
}

static void answer(struct rig *r, uint32_t scan, uint32_t i)
{
    Anlos__Receipt receipt = ANLOS__RECEIPT__INIT;

    receipt.scan = scan;
    receipt.pass = ANLOS__PASS__SCENE;
    receipt.position = i / N_SPEAKERS;
    receipt.speaker = i % N_SPEAKERS;
    receipt.usable = true;
    playback_receipt(r->p, &receipt, r->now_ns);
}

static void list(struct rig *r, uint32_t scan, bool preview)
{
    Anlos__DetectionList l = ANLOS__DETECTION_LIST__INIT;

    l.scan = scan;
    l.preview = preview;
    playback_list(r->p, &l);
}

static void nothing_is_played_before_all_are_ready(void **state)
{
    struct rig *r = *state;
    struct error why = {""};

    played_bag_write(r->bag, true);
    assert_int_equal(playback_create(&r->p, &r->cfg, 3, &why), 0);
    turn(r, 10000 * MS);
    struct playback_status s = status_of(r);
    assert_int_equal(s.phase, PLAYBACK_WAITS);
    assert_int_equal(s.messages, 0);
    assert_string_equal(s.text, "waits for dsp, recon, track");
    say_health(r);
    turn(r, 1000 * MS);
    assert_string_equal(status_of(r).text, "waits for connections");
    playback_hears(r->p, true);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).pings.played, 4);
}

static void no_more_pings_are_under_way_than_the_window_has(void **state)
{
    struct rig *r = *state;

    played_bag_write(r->bag, true);
    create(r);
    turn(r, 1000 * MS);
    struct playback_status s = status_of(r);
    assert_int_equal(s.pings.played, 4);
    assert_int_equal(s.messages, 6);
    assert_string_equal(s.text, "waits for 4 receipts");
    answer(r, 1, 0);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).pings.played, 5);
}

static void the_end_of_a_scan_waits_for_its_pings_and_the_rest_for_its_list(void **state)
{
    struct rig *r = *state;

    r->cfg.window = 32;
    played_bag_write(r->bag, true);
    create(r);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).messages, 2 + N_PINGS);
    for (uint32_t i = 0; i < N_PINGS - 1; i++)
        answer(r, 1, i);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).messages, 2 + N_PINGS);
    answer(r, 1, N_PINGS - 1);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).messages, 2 + N_PINGS + 1); /* the first DONE */
    list(r, 1, true);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).messages, 2 + N_PINGS + 1);
    list(r, 1, false);
    turn(r, 1000 * MS);
    struct playback_status s = status_of(r);
    assert_int_equal(s.messages, 2 + N_PINGS + 2);
    assert_int_equal(s.phase, PLAYBACK_ENDED);
    assert_int_equal(s.pings.used, N_PINGS);
    assert_null(playback_note(r->p));
}

static void what_nobody_answers_is_given_up_counted_and_said(void **state)
{
    struct rig *r = *state;

    played_bag_write(r->bag, true);
    create(r);
    turn(r, 20000 * MS);
    /* Nobody has said anything since: they may be busy, and not even that is known. */
    assert_int_equal(status_of(r).pings.missing, 0);
    say_health(r);
    turn(r, 100 * MS);
    assert_int_equal(status_of(r).pings.missing, 4);
    assert_contains(playback_note(r->p), "4 pings were played, and in 5 s nobody said");
    assert_int_equal(status_of(r).pings.played, N_PINGS);
}

static void messages_are_due_by_their_stamps_and_the_rate(void **state)
{
    struct rig *r = *state;

    r->cfg.rate = 0.5;
    r->cfg.n_nodes = 1; /* nobody is waited for */
    played_bag_write(r->bag, true);
    create(r);
    turn(r, 300 * MS);
    int64_t start_ns = r->now_ns;
    while (status_of(r).messages < 6)
        turn(r, 1 * MS);
    /* the sixth has its stamp 0.5 s after the first, which went out at once */
    double after_s = 1e-9 * (double)(r->now_ns - start_ns);
    assert_true(after_s > 0.9 && after_s < 1.06);
    playback_rate(r->p, 0.0, r->now_ns);
    turn(r, 10 * MS);
    assert_int_equal(status_of(r).messages, 2 + N_PINGS + 2);
}

static void a_wait_is_not_made_up_for(void **state)
{
    struct rig *r = *state;

    r->cfg.rate = 1.0;
    r->cfg.window = 1;
    played_bag_write(r->bag, true);
    create(r);
    turn(r, 3000 * MS);
    assert_int_equal(status_of(r).pings.played, 1);
    for (uint32_t i = 0; i < 3; i++)
        answer(r, 1, i);
    turn(r, 60 * MS); /* the second goes at once, and the third 0.1 s later */
    assert_int_equal(status_of(r).pings.played, 2);
}

static void a_pause_lasts_until_it_ends_and_one_message_is_one(void **state)
{
    struct rig *r = *state;

    r->cfg.paused = true;
    played_bag_write(r->bag, true);
    create(r);
    turn(r, 2000 * MS);
    assert_int_equal(status_of(r).phase, PLAYBACK_PAUSES);
    assert_int_equal(status_of(r).messages, 0);
    playback_one(r->p);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).messages, 1);
    playback_pause(r->p, false, r->now_ns);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).pings.played, 4);
}

static void answer_all(struct rig *r, uint32_t scan)
{
    for (uint32_t i = 0; i < N_PINGS; i++) {
        turn(r, 100 * MS);
        answer(r, scan, i);
    }
    turn(r, 100 * MS);
    list(r, scan, false);
    turn(r, 100 * MS);
}

static void the_scans_of_a_loop_count_on(void **state)
{
    struct rig *r = *state;

    r->cfg.loop = true;
    played_bag_write(r->bag, true);
    create(r);
    turn(r, 300 * MS);
    for (uint32_t scan = 1; scan <= 3; scan++)
        answer_all(r, scan);
    struct playback_status s = status_of(r);
    assert_int_equal(s.rounds, 3);
    assert_int_equal(s.pings.used, 3 * N_PINGS);
    assert_int_equal(s.lists, 3);
    assert_int_equal(s.pings.missing + s.pings.unused, 0);
}

static void after_a_seek_old_receipts_count_for_nothing(void **state)
{
    struct rig *r = *state;

    played_bag_write(r->bag, true);
    create(r);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).pings.n, 4);
    playback_seek(r->p, FIRST_NS + 7 * STEP_NS);
    turn(r, 1000 * MS);
    struct playback_status s = status_of(r);
    assert_int_equal(s.pings.played, 5); /* the last one of the bag */
    assert_int_equal(s.pings.n, 1);
    answer(r, 1, N_PINGS - 1);
    assert_int_equal(status_of(r).pings.n, 1);
    answer(r, 2, N_PINGS - 1);
    assert_int_equal(status_of(r).pings.n, 0);
    assert_int_equal(status_of(r).pings.missing, 0);
}

/* A step, after which the first n_in of the nodes are in play's round; how much was sent
 * by then.  */
static uint64_t step_with(struct rig *r, size_t n_in)
{
    Anlos__Progress told, p = ANLOS__PROGRESS__INIT;
    Anlos__Sent sent[16], *list[16];
    struct error why = {""};
    int64_t due_ns;
    uint64_t n = 0;
    char *nodes[16];

    assert_int_equal(playback_step(r->p, r->now_ns, &due_ns, &why), 0);
    r->now_ns += 250 * MS; /* it repeats itself within this */
    assert_true(playback_tells(r->p, &told, sent, list, nodes, 16, r->now_ns));
    for (size_t i = 0; i < told.n_sent; i++)
        n += told.sent[i]->next;
    p.round = r->round = told.round;
    p.time_ns = told.time_ns;
    for (size_t i = 1; i <= n_in; i++)
        playback_progress(r->p, r->cfg.nodes[i], &p);
    return n;
}

/* They tell by it what is of the round before. */
static void after_a_seek_nothing_goes_out_before_all_are_in_the_new_round(void **state)
{
    struct rig *r = *state;

    played_bag_write(r->bag, true);
    create(r);
    turn(r, 1000 * MS);
    uint64_t round = r->round, before = step_with(r, 3);
    playback_seek(r->p, FIRST_NS);
    for (int i = 0; i < 40; i++) /* track is still at what was before */
        assert_int_equal(step_with(r, 2), before);
    assert_int_equal(r->round, round + 1);
    assert_string_equal(status_of(r).text, "waits for track");
    assert_int_equal(step_with(r, 3), before);
    assert_true(step_with(r, 3) > before);
}

static void a_dsp_that_starts_again_is_said(void **state)
{
    struct rig *r = *state;
    Anlos__Health h = ANLOS__HEALTH__INIT;

    played_bag_write(r->bag, true);
    create(r);
    turn(r, 1000 * MS);
    h.state = ANLOS__HEALTH__STATE__READY;
    playback_health(r->p, "dsp", 8, &h, r->now_ns);
    assert_contains(playback_note(r->p), "dsp was started again");
    assert_int_equal(status_of(r).pings.missing, 4);
}

static void a_scan_that_was_begun_again_has_another_number(void **state)
{
    struct rig *r = *state;
    struct played_bag b;

    r->cfg.window = 32;
    played_bag_open(&b, r->bag);
    played_bag_survey(&b);
    played_bag_status(&b, ANLOS__SCAN_STATUS__STATE__RUNNING);
    for (uint32_t i = 0; i < 3; i++)
        played_bag_ping(&b, i);
    b.epoch_ns = 2;
    played_bag_status(&b, ANLOS__SCAN_STATUS__STATE__RUNNING);
    for (uint32_t i = 0; i < N_PINGS; i++)
        played_bag_ping(&b, i);
    played_bag_status(&b, ANLOS__SCAN_STATUS__STATE__DONE);
    played_bag_close(&b);
    create(r);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).pings.played, 3);
    for (uint32_t i = 0; i < 3; i++)
        answer(r, 1, i);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).pings.played, 3 + N_PINGS);
    for (uint32_t i = 0; i < N_PINGS; i++)
        answer(r, 2, i);
    list(r, 2, false);
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).phase, PLAYBACK_ENDED);
    assert_int_equal(status_of(r).pings.used, 3 + N_PINGS);
    assert_false(status_of(r).heard);
}

static struct bus *listen(struct rig *r)
{
    const struct bus_config cfg = {.run_dir = r->scratch->folder, .listen_only = true};
    struct bus_count count;
    struct bus *b = NULL;
    int64_t due_ns;

    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b, topic_scan_status()), 0);
    do { /* its sockets stand once it has been created; the machine's time passes here */
        struct bus_message m;
        assert_int_equal(playback_step(r->p, r->now_ns, &due_ns, NULL), 0);
        if (!bus_receive(b, &m, 10))
            bus_message_free(&m);
        assert_int_equal(bus_counts(b, &count, 1), 1);
    } while (!count.peers);
    return b;
}

static void a_scan_of_which_nothing_can_be_used_has_failed(void **state)
{
    struct rig *r = *state;
    Anlos__Receipt refusal = ANLOS__RECEIPT__INIT;
    Anlos__ScanStatus *status = NULL;
    struct bus_message m;

    r->cfg.window = 32;
    played_bag_write(r->bag, true);
    create(r);
    struct bus *b = listen(r);
    turn(r, 1000 * MS);
    assert_true(status_of(r).heard);
    for (uint32_t i = 0; i < N_PINGS; i++) {
        refusal.scan = 1;
        refusal.pass = ANLOS__PASS__BACKGROUND; /* dsp asks for it */
        refusal.position = i / N_SPEAKERS;
        refusal.speaker = i % N_SPEAKERS;
        playback_receipt(r->p, &refusal, r->now_ns);
    }
    assert_contains(playback_note(r->p), "dsp has not heard its background");
    turn(r, 1000 * MS);
    assert_int_equal(status_of(r).phase, PLAYBACK_ENDED);
    assert_int_equal(status_of(r).pings.unused, N_PINGS);
    do {
        if (status)
            anlos__scan_status__free_unpacked(status, NULL);
        for (int i = 0; bus_receive(b, &m, 10); i++) {
            assert_true(i < 2000);
            turn(r, 1100 * MS); /* the last status is repeated */
        }
        status = (Anlos__ScanStatus *)bus_message_unpack(&m);
        bus_message_free(&m);
        assert_non_null(status);
        assert_int_not_equal(status->state, ANLOS__SCAN_STATUS__STATE__DONE);
    } while (status->state != ANLOS__SCAN_STATUS__STATE__FAILED);
    assert_string_equal(status->text, "not one ping of the scene could be used");
    anlos__scan_status__free_unpacked(status, NULL);
    bus_destroy(b);
}

/* Two rounds of an array that stands, and no end. */
static void write_rounds(const struct rig *r)
{
    struct played_bag b;

    played_bag_open(&b, r->bag);
    played_bag_survey(&b);
    played_bag_status(&b, ANLOS__SCAN_STATUS__STATE__RUNNING);
    played_bag_round(&b, 1);
    played_bag_round(&b, 2);
    played_bag_close(&b);
}

static void a_recording_of_an_array_that_stands_ends_well(void **state)
{
    struct rig *r = *state;
    struct bus_message m;
    struct bus *b = NULL;
    Anlos__ScanStatus *s = NULL;
    const struct bus_config cfg = {.run_dir = r->scratch->folder, .listen_only = true};

    write_rounds(r);
    r->cfg.fixed = true;
    r->cfg.window = 6;
    create(r);
    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b, topic_scan_status()), 0);
    turn(r, 5000 * MS);
    assert_int_equal(status_of(r).pings.played, 6);
    for (uint32_t i = 0; i < 6; i++) { /* the second round first: dsp overtakes recon */
        Anlos__Receipt receipt = ANLOS__RECEIPT__INIT;

        receipt.scan = 1;
        receipt.pass = ANLOS__PASS__SCENE;
        receipt.frame = i < 3 ? 2 : 1;
        receipt.speaker = i % 3;
        receipt.usable = i >= 3;
        playback_receipt(r->p, &receipt, r->now_ns);
    }
    turn(r, 400 * MS);
    assert_string_equal(status_of(r).text, "waits for the last lists");
    list(r, 1, false);
    for (int i = 0; i < 1000 && (!s || s->state != ANLOS__SCAN_STATUS__STATE__DONE);
         i++) {
        turn(r, 500 * MS);
        while (!bus_receive(b, &m, 10)) {
            if (s)
                anlos__scan_status__free_unpacked(s, NULL);
            s = (Anlos__ScanStatus *)bus_message_unpack(&m);
            bus_message_free(&m);
        }
    }
    assert_non_null(s);
    assert_int_equal(s->state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s->pings_expected, 0);
    assert_int_equal(s->pings_done, 3);
    assert_int_equal(status_of(r).pings.missing, 0);
    assert_int_equal(status_of(r).phase, PLAYBACK_ENDED);
    anlos__scan_status__free_unpacked(s, NULL);
    bus_destroy(b);
}

static void a_recording_is_played_only_to_nodes_of_its_mode(void **state)
{
    struct rig *r = *state;
    struct error why = {""};
    int64_t due_ns;
    int err = 0;

    write_rounds(r);
    create(r);
    for (int i = 0; i < 1000 && !err; i++, r->now_ns += 100 * MS)
        err = playback_step(r->p, r->now_ns, &due_ns, &why);
    assert_int_equal(err, -EINVAL);
    assert_contains(why.text, "of an array that stands");
    assert_contains(why.text, "scan.mode: fixed");
}

static void what_runs_beside_it_is_not_played(void **state)
{
    static const char *const everybody[] = {"array", "scan", "dsp"};
    struct rig *r = *state;
    struct error why = {""};

    played_bag_write(r->bag, true);
    r->cfg.nodes = everybody;
    r->cfg.n_nodes = 3;
    assert_int_equal(playback_create(&r->p, &r->cfg, 3, &why), -EINVAL);
    assert_contains(why.text, "nothing is left to play");
    r->cfg.nodes = all;
    r->cfg.n_nodes = 4;
    r->cfg.topics = "pong";
    assert_int_equal(playback_create(&r->p, &r->cfg, 3, &why), -EINVAL);
    assert_contains(why.text, "no topic is called \"pong\"");
}

/* An array that stands: dsp and recon have answered for every ping, track works still. */
static void no_more_goes_out_than_the_last_of_the_chain_keeps_up_with(void **state)
{
    struct rig *r = *state;
    struct played_bag b;
    struct error why = {""};
    int64_t due_ns, first_ns = FIRST_NS + 2 * STEP_NS; /* of the pings */

    played_bag_open(&b, r->bag);
    played_bag_survey(&b);
    played_bag_status(&b, ANLOS__SCAN_STATUS__STATE__RUNNING);
    for (uint32_t frame = 1; frame <= 4; frame++)
        played_bag_round(&b, frame);
    played_bag_close(&b);
    r->cfg.fixed = true;
    r->cfg.window = 5;
    r->used_ns = FIRST_NS - 1; /* they have begun */
    create(r);
    for (int i = 0; i < 100; i++) {
        if (playback_step(r->p, r->now_ns, &due_ns, &why))
            fail_msg("%s", why.text);
        for (uint32_t k = 0; k < 12; k++) {
            Anlos__Receipt receipt = ANLOS__RECEIPT__INIT;
            receipt.scan = 1;
            receipt.pass = ANLOS__PASS__SCENE;
            receipt.frame = 1 + k / 3;
            receipt.speaker = k % 3;
            receipt.usable = true;
            playback_receipt(r->p, &receipt, r->now_ns);
        }
        r->now_ns += 10 * MS;
        say_progress(r, r->used_ns);
    }
    assert_int_equal(status_of(r).pings.played, 5);
    assert_contains(status_of(r).text, "waits for ");
    r->used_ns = first_ns + 1 * STEP_NS; /* two of them */
    turn(r, 500 * MS);
    assert_int_equal(status_of(r).pings.played, 7);
    assert_int_equal(status_of(r).lost, 0);
}

/* Nobody takes a message before all earlier ones and those of its own stamp are there:
 * of more than there is room for, those that went out are let go on. */
static void
more_of_one_stamp_than_there_is_room_for_do_not_hold_each_other_up(void **state)
{
    struct rig *r = *state;
    struct played_bag b;

    played_bag_open(&b, r->bag);
    played_bag_survey(&b);
    played_bag_status(&b, ANLOS__SCAN_STATUS__STATE__RUNNING);
    for (int i = 0; i < 200; i++) {
        Anlos__EgoMotion ego = ANLOS__EGO_MOTION__INIT;
        played_bag_put(&b, "can", topic_ego(), 0, &ego.base);
        b.at_ns -= STEP_NS;
    }
    played_bag_close(&b);
    r->used_ns = INT64_MAX;
    create(r);
    turn(r, 4000 * MS);
    assert_int_equal(status_of(r).messages, 202);
    assert_int_equal(status_of(r).lost, 0);
}

static void who_comes_no_further_is_given_up_counted_and_said(void **state)
{
    struct rig *r = *state;

    played_bag_write(r->bag, true);
    create(r);
    r->used_ns = FIRST_NS;
    turn(r, 4000 * MS);
    assert_int_equal(status_of(r).lost, 0);
    for (int i = 0; i < 5; i++) {
        turn(r, 5000 * MS);
        say_health(r);
    }
    turn(r, 5000 * MS);
    assert_contains(playback_note(r->p), "did not get on with the recording in 20 s");
    assert_int_equal(status_of(r).lost, 3); /* dsp, recon and track, once each */
}

/* Two plays to nodes that live on: no round of the first is one of the second. */
static void rounds_of_a_later_play_come_after_those_of_an_earlier_one(void **state)
{
    struct rig *r = *state;
    struct error why = {""};

    played_bag_write(r->bag, true);
    create(r);
    for (int i = 0; i < 3; i++)
        playback_seek(r->p, FIRST_NS);
    turn(r, 500 * MS);
    uint64_t before = r->round;
    assert_true(before >= 3 && before < 1000);
    playback_destroy(r->p);
    assert_int_equal(playback_create(&r->p, &r->cfg, 1000, &why), 0);
    playback_hears(r->p, true);
    turn(r, 100 * MS);
    say_health(r);
    turn(r, 500 * MS);
    assert_true(r->round > before);
}

static void messages_that_got_lost_are_counted_and_said(void **state)
{
    struct rig *r = *state;
    Anlos__Progress p = ANLOS__PROGRESS__INIT;

    played_bag_write(r->bag, true);
    create(r);
    turn(r, 100 * MS);
    p.round = 1;
    p.time_ns = FIRST_NS;
    p.lost = 3;
    playback_progress(r->p, "track", &p);
    assert_contains(playback_note(r->p), "messages got lost on the way to track");
    assert_int_equal(status_of(r).lost, 3);
}

/* Those of a replay, and who only looks on, are an subscribers. */
static void a_folder_where_a_live_node_runs_is_refused_by_its_name(void **state)
{
    struct rig *r = *state;
    struct error why = {""};
    struct bus *b = NULL;
    struct bus_config cfg = {
        .node = "can", .run_dir = r->scratch->folder, .world = BUS_LIVE};

    played_bag_write(r->bag, true);
    r->cfg.alone = true;
    r->cfg.n_nodes = 0;
    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(playback_create(&r->p, &r->cfg, 3, &why), -EADDRINUSE);
    assert_contains(why.text, "the node \"can\" of a live system runs here");
    bus_destroy(b);
    cfg.world = BUS_REPLAY;
    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(playback_create(&r->p, &r->cfg, 3, &why), 0);
    playback_destroy(r->p);
    bus_destroy(b);
    cfg.node = "view";
    cfg.world = BUS_ANY;
    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(playback_create(&r->p, &r->cfg, 3, &why), 0);
    bus_destroy(b);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(nothing_is_played_before_all_are_ready),
        TEST(no_more_pings_are_under_way_than_the_window_has),
        TEST(the_end_of_a_scan_waits_for_its_pings_and_the_rest_for_its_list),
        TEST(what_nobody_answers_is_given_up_counted_and_said),
        TEST(messages_are_due_by_their_stamps_and_the_rate),
        TEST(a_wait_is_not_made_up_for),
        TEST(a_pause_lasts_until_it_ends_and_one_message_is_one),
        TEST(the_scans_of_a_loop_count_on),
        TEST(after_a_seek_old_receipts_count_for_nothing),
        TEST(after_a_seek_nothing_goes_out_before_all_are_in_the_new_round),
        TEST(a_dsp_that_starts_again_is_said),
        TEST(a_scan_that_was_begun_again_has_another_number),
        TEST(a_scan_of_which_nothing_can_be_used_has_failed),
        TEST(a_recording_of_an_array_that_stands_ends_well),
        TEST(a_recording_is_played_only_to_nodes_of_its_mode),
        TEST(what_runs_beside_it_is_not_played),
        TEST(no_more_goes_out_than_the_last_of_the_chain_keeps_up_with),
        TEST(more_of_one_stamp_than_there_is_room_for_do_not_hold_each_other_up),
        TEST(who_comes_no_further_is_given_up_counted_and_said),
        TEST(rounds_of_a_later_play_come_after_those_of_an_earlier_one),
        TEST(messages_that_got_lost_are_counted_and_said),
        TEST(a_folder_where_a_live_node_runs_is_refused_by_its_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
