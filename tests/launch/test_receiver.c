/* SPDX-License-Identifier: MIT */
/* The receiver for the vehicle's side (launch/receiver), against a sensor that is played
 * here: every fault of AUTOSAR's E2E tables, lists that are not whole, time-outs, and
 * values that are not available. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>

#include <cmocka.h>

#include "launch/receiver/anlos_receiver.h"
#include "tests/launch/receiver_frames.h"

#define ACTIVE   2
#define DEGRADED 3

struct bench {
    struct anlos_receiver r;
    struct sensor s;
    uint32_t now_ms;
    struct anlos_view view;
};

/* A receiver and a sensor that have just begun. */
static void restart(struct bench *b)
{
    *b = (struct bench){.s = {.first_id = 0x400, .capture_s = 1000}};
    assert_int_equal(anlos_receiver_init(&b->r, NULL), 0);
}

static int open_bench(void **state)
{
    static struct bench b;

    restart(&b);
    *state = &b;
    return 0;
}

static uint32_t hear(struct bench *b, struct sensor_frame f)
{
    return anlos_receiver_frame(&b->r, f.id, f.data, f.length, b->now_ms);
}

static uint32_t send(struct bench *b, struct sensor_frame f)
{
    return hear(b, sensor_next(&b->s, f));
}

static const struct anlos_view *look(struct bench *b)
{
    anlos_receiver_get(&b->r, b->now_ms, &b->view);
    return &b->view;
}

static const struct anlos_counts *counts(struct bench *b)
{
    return &look(b)->counts;
}

static void send_object(struct bench *b, unsigned id)
{
    for (unsigned kind = STATE; kind <= QUALITY; kind++)
        send(b, sensor_object(&b->s, kind, id));
}

static void open_list(struct bench *b, unsigned number)
{
    b->s.list = (b->s.list + 1) % 4096;
    b->s.capture_s++;
    send(b, sensor_header(&b->s, number));
    send(b, sensor_time(&b->s));
}

/* Objects 1, 2, ... */
static void send_list(struct bench *b, unsigned number)
{
    open_list(b, number);
    for (unsigned i = 0; i < number; i++)
        send_object(b, i + 1);
}

/* A sensor that is well: all kinds of frames have proven themselves. */
static void get_going(struct bench *b)
{
    for (int i = 0; i < 2; i++) {
        send(b, sensor_status(&b->s, ACTIVE, ANLOS_SOURCE_LIVE));
        send_list(b, 1);
    }
    send_list(b, 1);
    assert_non_null(look(b)->list);
    assert_int_equal(b->view.trust, ANLOS_TRUST_FULL);
    b->r.counts = (struct anlos_counts){0};
}

/* ---- Protection ------------------------------------------------------------------- */

/* AUTOSAR SWS_CRCLibrary, tables of example data of Crc_CalculateCRC8 (SAE J1850) and
 * Crc_CalculateCRC16 (CCITT-FALSE). */
static void the_crcs_that_are_tested_with_are_autosars(void **state)
{
    static const struct {
        size_t n;
        uint8_t data[9];
        uint32_t crc8, crc16;
    } rows[] = {
        {4, {0x00, 0x00, 0x00, 0x00}, 0x59, 0x84C0},
        {3, {0xF2, 0x01, 0x83}, 0x37, 0xD374},
        {4, {0x0F, 0xAA, 0x00, 0x55}, 0x79, 0x2023},
        {4, {0x00, 0xFF, 0x55, 0x11}, 0xB8, 0xB8F9},
        {9, {0x33, 0x22, 0x55, 0xAA, 0xBB, 0xCC, 0xDD, 0xEE, 0xFF}, 0xCB, 0xF53F},
        {3, {0x92, 0x6B, 0x55}, 0x8C, 0x0745},
        {4, {0xFF, 0xFF, 0xFF, 0xFF}, 0x74, 0x1D0F},
        {9, {'1', '2', '3', '4', '5', '6', '7', '8', '9'}, 0x4B, 0x29B1},
    };

    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const uint8_t *d = rows[i].data;
        size_t n = rows[i].n;
        assert_int_equal(sensor_crc(8, 0x1D, 0xFF, d, n) ^ 0xFF, rows[i].crc8);
        assert_int_equal(sensor_crc(16, 0x1021, 0xFFFF, d, n), rows[i].crc16);
    }
}

/* AUTOSAR PRS_E2EProtocol, examples of profile 11: data ID 0x123, nibble, data of zeros.
 */
static void frames_that_autosar_prints_are_good(void **state)
{
    static const uint8_t first[8] = {0x2A, 0x10}, second[8] = {0x77, 0x11};
    static const uint8_t both[8] = {0xCC, 0x00}; /* of another mode of the data ID */
    struct bench *b = *state;
    struct anlos_config cfg;

    anlos_config_default(&cfg);
    cfg.first_id = 0x120;
    assert_int_equal(anlos_receiver_init(&b->r, &cfg), 0);
    assert_int_equal(anlos_receiver_frame(&b->r, 0x123, first, 8, 0), 0);
    assert_int_equal(anlos_receiver_frame(&b->r, 0x123, second, 8, 0), 0);
    assert_int_equal(counts(b)->frames_good, 2);
    assert_int_equal(anlos_receiver_frame(&b->r, 0x123, both, 8, 0), ANLOS_EVENT_WRONG);
    assert_int_equal(counts(b)->frames_damaged, 1);
}

static void a_frame_with_any_bit_wrong_is_not_used(void **state)
{
    struct bench *b = *state;
    struct sensor_frame frames[] = {
        sensor_next(&b->s, sensor_status(&b->s, ACTIVE, 0)),
        sensor_next(&b->s, sensor_header(&b->s, 1)),
        sensor_next(&b->s, sensor_object(&b->s, FD, 7)),
    };

    for (size_t i = 0; i < sizeof frames / sizeof *frames; i++) {
        for (unsigned bit = 0; bit < 8u * frames[i].length; bit++) {
            struct sensor_frame f = frames[i];
            f.data[bit / 8] ^= (uint8_t)(1u << bit % 8);
            assert_int_equal(hear(b, f), ANLOS_EVENT_WRONG);
        }
        for (unsigned length = 0; length <= 64; length++) {
            struct sensor_frame f = frames[i];
            f.length = (uint8_t)length;
            if (length != frames[i].length)
                assert_int_equal(hear(b, f), ANLOS_EVENT_WRONG);
        }
    }
    assert_int_equal(counts(b)->frames_good, 0);
    assert_int_equal(counts(b)->frames_damaged, 64 + 64 + 512 + 3 * 64);
    assert_int_equal(look(b)->status_link, ANLOS_NODATA);
}

/* What is right under one identifier is wrong under every other one. */
static void a_frame_of_another_sensor_or_kind_is_not_used(void **state)
{
    struct bench *b = *state;

    for (uint32_t first_id = 0; first_id <= 0x7F0; first_id += 0x10)
        for (unsigned kind = STATUS; kind <= QUALITY; kind++) {
            struct sensor other = {.first_id = first_id};
            struct sensor_frame f = sensor_next(&other, sensor_blank(&other, kind));
            if (f.id == 0x400)
                continue;
            f.id = 0x400;
            assert_int_equal(hear(b, f), ANLOS_EVENT_WRONG);
        }
    assert_int_equal(counts(b)->frames_good, 0);
    assert_int_equal(counts(b)->frames_damaged, 128 * 7 - 1);
}

static void a_counter_of_15_is_none(void **state)
{
    struct bench *b = *state;
    struct sensor_frame f = sensor_status(&b->s, ACTIVE, 0);

    sensor_protect(&f, 15);
    assert_int_equal(hear(b, f), ANLOS_EVENT_WRONG);
    assert_int_equal(counts(b)->frames_damaged, 1);
}

/* Counters as they come, and what becomes of them: MaxDeltaCounter is 3. */
static void each_sequence_of_counters_is_judged_as_autosar_does(void **state)
{
    static const struct {
        const char *what;
        int counters[40]; /* ends at -1 */
        unsigned good, lost, repeated, out;
    } rows[] = {
        {"in order", {0, 1, 2, 3, -1}, 4, 0, 0, 0},
        {"wraps around",
         {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 0, 1, -1},
         17,
         0,
         0,
         0},
        {"one lost", {0, 2, 3, -1}, 3, 1, 0, 0},
        {"two lost", {0, 3, 4, -1}, 3, 2, 0, 0},
        {"two lost across the wrap", {12, 13, 14, 2, -1}, 4, 2, 0, 0},
        {"three lost", {0, 4, 5, -1}, 2, 0, 0, 1},
        {"repeated", {0, 0, 1, 1, 1, -1}, 2, 0, 3, 0},
        {"stuck", {0, 1, 1, 1, 1, 1, 1, 1, -1}, 2, 0, 6, 0},
        {"swapped", {0, 2, 1, 3, -1}, 3, 2, 0, 1}, /* 1 is 14 ahead of 2 */
        {"an old one put in", {5, 6, 7, 2, 8, 9, -1}, 4, 0, 0, 2},
        {"its sender restarted", {7, 8, 9, 0, 1, 2, -1}, 5, 0, 0, 1},
        {"heard from the middle on", {9, 10, 11, -1}, 3, 0, 0, 0},
        {"backwards", {3, 2, 1, 0, -1}, 1, 0, 0, 3},
        {"a loop of 14",
         {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 0, 1, -1},
         16,
         1,
         0,
         0}, /* as if one were lost */
        {"a loop of 11", {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0, 1, -1}, 12, 0, 0, 1},
        /* 15 frames that come again and again are a counter that goes on: not detectable
         * by the protection alone. */
        {"a loop of 15",
         {0, 1, 2, 3, 4, 5, 6, 7, 8, 9,  10, 11, 12, 13, 14, 0,
          1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, -1},
         30,
         0,
         0,
         0},
    };

    struct bench *b = *state;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        restart(b);
        for (const int *counter = rows[i].counters; *counter >= 0; counter++) {
            struct sensor_frame f = sensor_status(&b->s, ACTIVE, 0);
            sensor_protect(&f, (unsigned)*counter);
            hear(b, f);
        }
        const struct anlos_counts *c = counts(b);
        if (c->frames_good != rows[i].good || c->frames_lost != rows[i].lost ||
            c->frames_repeated != rows[i].repeated ||
            c->frames_out_of_sequence != rows[i].out || c->frames_damaged)
            fail_msg("%s: %u good, %u lost, %u repeated, %u out of sequence",
                     rows[i].what, c->frames_good, c->frames_lost, c->frames_repeated,
                     c->frames_out_of_sequence);
    }
}

/* g: good, e: damaged, r: repeated, j: out of sequence. */
static void a_kind_of_frames_goes_through_autosars_states(void **state)
{
    static const struct {
        const char *frames;
        enum anlos_link link;
    } rows[] = {
        {"", ANLOS_NODATA},
        {"e", ANLOS_NODATA},
        {"eeee", ANLOS_NODATA},
        {"g", ANLOS_INIT},
        {"j", ANLOS_INIT},
        {"grrrr", ANLOS_INIT}, /* stuck */
        {"gg", ANLOS_VALID},
        {"jg", ANLOS_VALID}, /* the first is good whatever its counter */
        {"gjjj", ANLOS_INIT},
        {"ge", ANLOS_INVALID},
        {"gge", ANLOS_VALID}, /* one of the newest six may be wrong */
        {"ggee", ANLOS_INVALID},
        {"egge", ANLOS_VALID}, /* what was before INIT does not count */
        {"ggegggge", ANLOS_INVALID},
        {"ggeggggge", ANLOS_VALID}, /* the first one has left the window */
        {"ggrrrr", ANLOS_VALID},
        {"ggrrrrr", ANLOS_VALID}, /* a good one is still in the window */
        {"ggrrrrrr", ANLOS_INVALID},
        {"gejjjjjj", ANLOS_INVALID},
        {"geggggg", ANLOS_INVALID},
        {"gegggggg", ANLOS_VALID},   /* six good ones in a row */
        {"gegggggr", ANLOS_INVALID}, /* five good ones of six */
        {"gegggggegggggg", ANLOS_VALID},
        {"gegggggeggggg", ANLOS_INVALID},
    };

    struct bench *b = *state;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        restart(b);
        unsigned counter = 14;
        for (const char *c = rows[i].frames; *c; c++) {
            struct sensor_frame f = sensor_status(&b->s, ACTIVE, 0);
            counter = (counter + (*c == 'g' ? 1 : *c == 'j' ? 7 : 0)) % 15;
            sensor_protect(&f, counter);
            f.data[0] ^= *c == 'e';
            hear(b, f);
        }
        if (look(b)->status_link != rows[i].link)
            fail_msg("%s: %d", rows[i].frames, look(b)->status_link);
        assert_int_equal(b->view.status.state, rows[i].link == ANLOS_VALID
                                                   ? ANLOS_STATE_ACTIVE
                                                   : ANLOS_STATE_UNKNOWN);
    }
}

/* ---- Lists ------------------------------------------------------------------------ */

static void a_list_is_handed_over_when_it_is_whole(void **state)
{
    struct bench *b = *state;

    get_going(b);
    b->s.list = 41;
    send(b, sensor_status(&b->s, ACTIVE, 0));
    open_list(b, 2);
    send_object(b, 200);
    send(b, sensor_status(&b->s, ACTIVE, 0));  /* may come in between */
    send(b, sensor_object(&b->s, QUALITY, 9)); /* in any order */
    send(b, sensor_object(&b->s, DYNAMICS, 9));
    assert_int_not_equal(look(b)->list->counter, 42);
    assert_int_equal(send(b, sensor_object(&b->s, STATE, 9)), ANLOS_EVENT_LIST);
    const struct anlos_list *l = look(b)->list;
    assert_int_equal(l->counter, 42);
    assert_int_equal(l->n_objects, 2);
    assert_int_equal(l->objects[0].id, 200);
    assert_int_equal(l->objects[1].id, 9);
    assert_int_equal(l->capture_s, b->s.capture_s);
    assert_int_equal(l->capture_fraction, 0x8000);
    assert_int_equal(counts(b)->lists_whole, 1);
}

static void a_full_list_fits_and_one_of_more_is_refused(void **state)
{
    struct bench *b = *state;

    get_going(b);
    send_list(b, 32);
    assert_int_equal(look(b)->list->n_objects, 32);
    assert_int_equal(b->view.list->objects[31].id, 32);
    for (unsigned number = 33; number < 64; number++) {
        b->s.list++;
        assert_int_equal(send(b, sensor_header(&b->s, number)), ANLOS_EVENT_DROPPED);
        send(b, sensor_time(&b->s));
    }
    assert_int_equal(counts(b)->lists_refused, 31);
    assert_int_equal(look(b)->list->n_objects, 32);
}

static void a_list_of_another_interface_version_is_refused(void **state)
{
    struct bench *b = *state;

    get_going(b);
    for (unsigned version = 0; version < 8; version++) {
        struct sensor_frame f = sensor_header(&b->s, 0);
        if (version == ANLOS_INTERFACE_VERSION)
            continue;
        sensor_put(&f, 61, 3, version);
        assert_int_equal(send(b, f), ANLOS_EVENT_DROPPED);
        send(b, sensor_time(&b->s));
    }
    assert_int_equal(counts(b)->lists_refused, 7);
    assert_int_equal(counts(b)->lists_whole, 0);
}

static void
the_first_list_is_not_believed_before_its_frames_have_proven_themselves(void **state)
{
    struct bench *b = *state;

    send_list(b, 0);
    assert_int_equal(counts(b)->lists_unproven, 1);
    send_list(b, 0);
    assert_int_equal(counts(b)->lists_whole, 1);
    send_list(b, 1);
    assert_int_equal(counts(b)->lists_unproven, 2);
    send_list(b, 1);
    assert_int_equal(counts(b)->lists_whole, 2);
    assert_int_equal(counts(b)->lists_lost, 0); /* they came */
}

static void each_kind_of_frames_has_to_be_valid(void **state)
{
    static const unsigned kinds[] = {HEADER, TIME, STATE, DYNAMICS, QUALITY};
    struct bench *b = *state;

    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        restart(b);
        get_going(b);
        for (int k = 0; k < 2; k++) {
            if (kinds[i] == TIME)
                send(b, sensor_header(&b->s, 0));
            struct sensor_frame f = sensor_next(&b->s, sensor_blank(&b->s, kinds[i]));
            f.data[7] ^= 1;
            assert_int_equal(hear(b, f), ANLOS_EVENT_WRONG);
        }
        assert_int_equal(look(b)->list_link, ANLOS_INVALID);
        assert_int_equal(b->view.trust, ANLOS_TRUST_NONE);
        for (unsigned k = 1; k <= 6; k++) {
            send_list(b, 1);
            assert_int_equal(counts(b)->lists_unproven, k < 6 ? k : 5);
        }
        assert_int_equal(look(b)->list_link, ANLOS_VALID);
        assert_int_equal(counts(b)->lists_whole, 1);
    }
    restart(b);
    get_going(b);
    for (unsigned k = 0; k < 2; k++) { /* FD's have to prove themselves, too */
        open_list(b, 1);
        assert_int_equal(send(b, sensor_object(&b->s, FD, 1)),
                         k ? ANLOS_EVENT_LIST : ANLOS_EVENT_DROPPED);
    }
}

static void each_frame_of_a_list_that_is_missing_costs_that_list_alone(void **state)
{
    struct bench *b = *state;

    for (unsigned missing = 0; missing < 2 + 3 * 3; missing++) {
        restart(b);
        for (int i = 0; i < 3; i++)
            send_list(b, 3);
        b->r.counts = (struct anlos_counts){0};
        struct sensor_frame frames[11];
        b->s.list++;
        frames[0] = sensor_next(&b->s, sensor_header(&b->s, 3));
        frames[1] = sensor_next(&b->s, sensor_time(&b->s));
        for (unsigned i = 0; i < 9; i++)
            frames[2 + i] =
                sensor_next(&b->s, sensor_object(&b->s, STATE + i % 3, 1 + i / 3));
        for (unsigned i = 0; i < 11; i++)
            if (i != missing)
                assert_int_equal(hear(b, frames[i]), 0);
        assert_int_equal(counts(b)->lists_whole, 0);
        send_list(b, 3);
        assert_int_equal(counts(b)->lists_whole, 1);
        assert_int_equal(counts(b)->lists_torn, missing ? 1 : 0);
        assert_int_equal(counts(b)->lists_lost, missing ? 0 : 1);
        assert_int_equal(counts(b)->frames_orphaned, missing ? 0 : 10);
        assert_int_equal(counts(b)->frames_lost, 1);
    }
}

static void a_list_that_was_cut_and_is_sent_again_comes_once(void **state)
{
    struct bench *b = *state;

    get_going(b);
    open_list(b, 2);
    send_object(b, 1);
    b->s.list--;
    b->s.capture_s--;
    send_list(b, 2);
    assert_int_equal(counts(b)->lists_whole, 1);
    assert_int_equal(counts(b)->lists_torn, 1);
    assert_int_equal(counts(b)->lists_lost, 0);
    b->s.list--;
    b->s.capture_s--;
    send_list(b, 2); /* it had come */
    assert_int_equal(counts(b)->lists_whole, 1);
    assert_int_equal(counts(b)->lists_repeated, 1);
}

static void objects_of_another_list_are_not_mixed_in(void **state)
{
    struct bench *b = *state;

    get_going(b);
    open_list(b, 2);
    send_object(b, 1);
    b->s.list++;
    assert_int_equal(send(b, sensor_object(&b->s, STATE, 2)), ANLOS_EVENT_DROPPED);
    assert_int_equal(counts(b)->lists_mixed, 1);
    assert_int_equal(send(b, sensor_object(&b->s, DYNAMICS, 2)), 0);
    assert_int_equal(counts(b)->frames_orphaned, 1);
}

static void a_part_that_comes_twice_or_of_an_object_too_many_spoils_the_list(void **state)
{
    struct bench *b = *state;

    get_going(b);
    open_list(b, 2);
    send(b, sensor_object(&b->s, STATE, 1));
    assert_int_equal(send(b, sensor_object(&b->s, STATE, 1)), ANLOS_EVENT_DROPPED);
    open_list(b, 2);
    send(b, sensor_object(&b->s, STATE, 1));
    send(b, sensor_object(&b->s, STATE, 2));
    assert_int_equal(send(b, sensor_object(&b->s, STATE, 3)), ANLOS_EVENT_DROPPED);
    open_list(b, 0);
    assert_int_equal(send(b, sensor_object(&b->s, STATE, 1)), 0); /* it was whole */
    assert_int_equal(counts(b)->lists_mixed, 2);
    assert_int_equal(counts(b)->lists_whole, 1);
}

static void a_list_has_one_kind_of_objects(void **state)
{
    struct bench *b = *state;

    get_going(b);
    open_list(b, 2);
    send_object(b, 1);
    assert_int_equal(send(b, sensor_object(&b->s, FD, 2)), ANLOS_EVENT_DROPPED);
    open_list(b, 2);
    send(b, sensor_object(&b->s, FD, 1));
    assert_int_equal(send(b, sensor_object(&b->s, STATE, 2)), ANLOS_EVENT_DROPPED);
    open_list(b, 2);
    send(b, sensor_object(&b->s, FD, 1));
    assert_int_equal(send(b, sensor_object(&b->s, FD, 2)), ANLOS_EVENT_LIST);
    assert_int_equal(counts(b)->lists_mixed, 2);
    assert_int_equal(look(b)->list->objects[1].fd, 1);
}

/* A's Time and B's header are lost: B's Time must not become A's. */
/* Course 90 degrees to the left, of the list and object that it names. */
static struct sensor_frame motion_of(const struct sensor *s, unsigned id)
{
    struct sensor_frame f = sensor_object(s, MOTION, id);

    sensor_put(&f, 28, 9, 90);
    return f;
}

static const struct anlos_object *object_of(struct bench *b, unsigned i)
{
    return &look(b)->list->objects[i];
}

static void a_list_is_whole_without_motions_and_takes_those_that_came(void **state)
{
    struct bench *b = *state;

    get_going(b);
    assert_int_equal(object_of(b, 0)->course_rad.quality, ANLOS_NOT_AVAILABLE);
    for (int i = 0; i < 3; i++) { /* believed from the second on */
        open_list(b, 2);
        assert_int_equal(send(b, motion_of(&b->s, 2)), 0);
        send_object(b, 1);
        send_object(b, 2);
        assert_int_equal(object_of(b, 0)->course_rad.quality, ANLOS_NOT_AVAILABLE);
        assert_int_equal(object_of(b, 1)->course_rad.quality,
                         i ? ANLOS_AVAILABLE : ANLOS_NOT_AVAILABLE);
    }
    assert_float_equal(object_of(b, 1)->course_rad.value, 1.5707963, 1e-6);
    open_list(b, 1);
    send(b, sensor_object(&b->s, STATE, 1));
    send(b, motion_of(&b->s, 1)); /* in any order */
    send(b, sensor_object(&b->s, DYNAMICS, 1));
    assert_int_equal(send(b, sensor_object(&b->s, QUALITY, 1)), ANLOS_EVENT_LIST);
    assert_int_equal(object_of(b, 0)->course_rad.quality, ANLOS_AVAILABLE);
    open_list(b, 1);
    send(b, motion_of(&b->s, 1));
    assert_int_equal(send(b, sensor_object(&b->s, FD, 1)), ANLOS_EVENT_DROPPED);
    open_list(b, 1);
    send(b, motion_of(&b->s, 1));
    assert_int_equal(send(b, sensor_object(&b->s, FD, 1)), ANLOS_EVENT_LIST);
    assert_int_equal(object_of(b, 0)->course_rad.quality, ANLOS_AVAILABLE);
    assert_int_equal(counts(b)->frames_orphaned, 0);
}

static void no_motion_spoils_a_list(void **state)
{
    struct bench *b = *state;

    get_going(b);
    assert_int_equal(send(b, motion_of(&b->s, 1)), 0); /* its list is over */
    assert_int_equal(counts(b)->frames_orphaned, 1);
    open_list(b, 1);
    struct sensor_frame late = sensor_object(&b->s, MOTION, 1);
    sensor_put(&late, 24, 4, b->s.list - 1);
    send(b, late); /* of the list before */
    assert_int_equal(counts(b)->frames_orphaned, 2);
    send(b, motion_of(&b->s, 7)); /* of no object */
    send(b, motion_of(&b->s, 1)); /* one too many */
    assert_int_equal(counts(b)->frames_orphaned, 3);
    send_object(b, 1);
    assert_int_equal(look(b)->list->counter, b->s.list);
    assert_int_equal(object_of(b, 0)->course_rad.quality, ANLOS_NOT_AVAILABLE);
    for (int i = 0; i < 2; i++) {
        struct sensor_frame f = sensor_next(&b->s, motion_of(&b->s, 1));
        f.data[7] ^= 1;
        assert_int_equal(hear(b, f), ANLOS_EVENT_WRONG);
    }
    open_list(b, 1);
    send(b, motion_of(&b->s, 1)); /* not believed any more */
    send_object(b, 1);
    assert_int_equal(look(b)->list->counter, b->s.list);
    assert_int_equal(object_of(b, 0)->course_rad.quality, ANLOS_NOT_AVAILABLE);
    assert_int_equal(b->view.list_link, ANLOS_VALID);
    assert_int_equal(b->view.trust, ANLOS_TRUST_FULL);
}

static void begin_list(struct bench *b, unsigned number)
{
    b->s.list = (b->s.list + 1) % 4096;
    b->s.capture_s++;
    send(b, sensor_header(&b->s, number));
}

static void send_triangle(struct bench *b, unsigned area)
{
    static const int at[3][2] = {{50, -100}, {250, -100}, {250, 8191}};

    for (unsigned k = 0; k < 3; k++)
        assert_int_equal(send(b, sensor_corner(&b->s, area, k, 3, at[k][0], at[k][1])),
                         0);
}

static void a_list_has_the_field_of_view_that_came_with_it(void **state)
{
    struct bench *b = *state;

    get_going(b);
    assert_int_equal(look(b)->list->view_known, 0);
    for (unsigned n = 0; n < 2; n++) { /* with an object, and without */
        begin_list(b, n);
        send_triangle(b, 4);
        send_triangle(b, 0);
        send(b, sensor_time(&b->s));
        for (unsigned i = 0; i < n; i++)
            send_object(b, 1);
        const struct anlos_list *l = look(b)->list;
        assert_int_equal(l->counter, b->s.list);
        assert_int_equal(l->n_objects, n);
        assert_int_equal(l->view_known, 1);
        assert_int_equal(l->n_areas, 2);
        assert_int_equal(l->areas[0].wall_id, 3);
        assert_int_equal(l->areas[1].n_corners, 3);
        assert_float_equal(l->areas[1].x_m[0], 1.0, 1e-5);
        assert_float_equal(l->areas[1].y_m[1], -2.0, 1e-5);
        assert_float_equal(l->areas[1].y_m[2], 163.82, 1e-4);
    }
    begin_list(b, 0);
    send(b, sensor_corner(&b->s, 0, 0, 0, -8192, -8192)); /* nothing is seen */
    send(b, sensor_time(&b->s));
    assert_int_equal(look(b)->list->view_known, 1);
    assert_int_equal(look(b)->list->n_areas, 0);
    open_list(b, 0);
    assert_int_equal(look(b)->list->counter, b->s.list);
    assert_int_equal(look(b)->list->view_known, 0);
    assert_int_equal(counts(b)->frames_orphaned, 0);
}

/* Of three areas the first is whole, and the second is not: each time for another reason.
 */
static void an_area_that_is_not_whole_is_left_out(void **state)
{
    struct bench *b = *state;

    get_going(b);
    for (unsigned bad = 0; bad < 7; bad++) {
        begin_list(b, 0);
        send_triangle(b, 1);
        send(b, sensor_corner(&b->s, 2, 0, 3, 0, 0));
        send(b, sensor_corner(&b->s, 2, 1, 3, 100, 0));
        if (bad == 1) /* another number of corners */
            send(b, sensor_corner(&b->s, 2, 2, 4, 100, 100));
        else if (bad == 2) /* one that is not available */
            send(b, sensor_corner(&b->s, 2, 2, 3, -8192, 100));
        else if (bad == 3) /* a fourth of three */
            send(b, sensor_corner(&b->s, 2, 3, 3, 100, 100));
        else if (bad == 4) { /* of the list before */
            struct sensor_frame f = sensor_corner(&b->s, 2, 2, 3, 100, 100);
            sensor_put(&f, 16, 4, (b->s.list - 1) & 15);
            send(b, f);
        } else if (bad == 5) { /* by way of another wall */
            struct sensor_frame f = sensor_corner(&b->s, 2, 2, 3, 100, 100);
            sensor_put(&f, 20, 4, 4);
            send(b, f);
        } else if (bad == 6) /* an area of a number that there is none of */
            send(b, sensor_corner(&b->s, 15, 2, 3, 100, 100));
        send(b, sensor_time(&b->s));
        assert_int_equal(look(b)->list->counter, b->s.list);
        assert_int_equal(look(b)->list->n_areas, 1);
    }
    assert_int_equal(counts(b)->frames_orphaned, 1);
    for (int i = 0; i < 2; i++) {
        struct sensor_frame f = sensor_next(&b->s, sensor_corner(&b->s, 0, 0, 3, 0, 0));
        f.data[7] ^= 1;
        assert_int_equal(hear(b, f), ANLOS_EVENT_WRONG);
    }
    begin_list(b, 0);
    send_triangle(b, 1); /* not believed any more, and the list is */
    send(b, sensor_time(&b->s));
    assert_int_equal(look(b)->list->counter, b->s.list);
    assert_int_equal(look(b)->list->view_known, 0);
    assert_int_equal(b->view.trust, ANLOS_TRUST_FULL);
}

static void the_time_of_the_next_list_is_not_taken(void **state)
{
    struct bench *b = *state;

    get_going(b);
    uint32_t events = 0;
    b->s.list++;
    send(b, sensor_header(&b->s, 0));
    sensor_next(&b->s, sensor_time(&b->s));
    sensor_next(&b->s, sensor_header(&b->s, 0));
    events = send(b, sensor_time(&b->s));
    assert_int_equal(events, ANLOS_EVENT_DROPPED);
    assert_int_equal(counts(b)->lists_mixed, 1);
    send_list(b, 0);
    assert_int_equal(counts(b)->lists_whole, 1);
}

static void a_whole_list_that_gets_lost_costs_no_other(void **state)
{
    struct bench *b = *state;

    get_going(b);
    for (int lost = 1; lost <= 2; lost++) {
        b->r.counts = (struct anlos_counts){0};
        for (int i = 0; i < lost; i++) {
            b->s.list++;
            sensor_next(&b->s, sensor_header(&b->s, 0));
            sensor_next(&b->s, sensor_time(&b->s));
        }
        send_list(b, 1);
        assert_int_equal(counts(b)->lists_whole, 1);
        assert_int_equal(counts(b)->lists_lost, lost);
    }
}

/* The same after a Time that was out of sequence. */
static void no_time_of_before_makes_room_for_the_next_ones(void **state)
{
    struct bench *b = *state;

    get_going(b);
    b->s.list++;
    send(b, sensor_header(&b->s, 0));
    b->s.counters[TIME] = (b->s.counters[TIME] + 3) % 15;
    assert_int_equal(send(b, sensor_time(&b->s)), ANLOS_EVENT_WRONG);
    b->s.list++;
    assert_int_equal(send(b, sensor_header(&b->s, 0)), ANLOS_EVENT_DROPPED);
    sensor_next(&b->s, sensor_time(&b->s));
    sensor_next(&b->s, sensor_header(&b->s, 0));
    assert_int_equal(send(b, sensor_time(&b->s)), ANLOS_EVENT_DROPPED);
    assert_int_equal(counts(b)->lists_torn, 1);
    assert_int_equal(counts(b)->lists_mixed, 1);
}

static void a_list_has_one_time(void **state)
{
    struct bench *b = *state;

    get_going(b);
    open_list(b, 1);
    assert_int_equal(send(b, sensor_time(&b->s)), ANLOS_EVENT_DROPPED);
    assert_int_equal(counts(b)->lists_mixed, 1);
}

static void a_frame_that_comes_twice_does_not_spoil_its_list(void **state)
{
    struct bench *b = *state;

    get_going(b);
    b->s.list++;
    struct sensor_frame header = sensor_next(&b->s, sensor_header(&b->s, 1));
    hear(b, header);
    assert_int_equal(hear(b, header), ANLOS_EVENT_WRONG);
    send(b, sensor_time(&b->s));
    send_object(b, 1);
    assert_int_equal(counts(b)->lists_whole, 1);
    assert_int_equal(counts(b)->frames_repeated, 1);
}

/* The protection alone cannot tell a loop of 15 lists; their counters do. */
static void lists_that_are_replayed_are_dropped(void **state)
{
    struct sensor_frame frames[30];
    struct bench *b = *state;

    get_going(b);
    for (unsigned i = 0; i < 15; i++) {
        b->s.list++;
        b->s.capture_s++;
        frames[2 * i] = sensor_next(&b->s, sensor_header(&b->s, 0));
        frames[2 * i + 1] = sensor_next(&b->s, sensor_time(&b->s));
    }
    for (int again = 0; again < 3; again++)
        for (unsigned i = 0; i < 30; i++)
            hear(b, frames[i]);
    assert_int_equal(counts(b)->lists_whole, 15);
    assert_int_equal(counts(b)->lists_repeated, 30);
    assert_int_equal(counts(b)->frames_good, 90);
}

static void a_sensor_that_restarted_goes_on_with_its_first_lists(void **state)
{
    struct bench *b = *state;

    get_going(b);
    b->s.list = 100;
    send_list(b, 1);
    b->s.list = 4095;
    memset(b->s.counters, 0, sizeof b->s.counters);
    send_list(b, 1); /* 0: out of sequence, or not */
    send_list(b, 1);
    send_list(b, 1);
    assert_int_equal(look(b)->list->counter, 2);
}

static void the_counter_of_lists_wraps_around_and_tells_what_got_lost(void **state)
{
    struct bench *b = *state;

    get_going(b);
    b->s.list = 4093 - 1;
    b->r.header_seen = b->r.listed = 0;
    send_list(b, 0); /* 4093 */
    send_list(b, 0);
    send_list(b, 0); /* 4095 */
    send_list(b, 0);
    assert_int_equal(counts(b)->lists_lost, 0);
    assert_int_equal(counts(b)->lists_whole, 4);
    assert_int_equal(look(b)->list->counter, 0);
    b->s.list = 4094;
    b->s.capture_s = 0;
    send_list(b, 0); /* 4095 again: older */
    assert_int_equal(counts(b)->lists_repeated, 1);
    b->s.list = 2;
    b->s.capture_s = 2000;
    send_list(b, 0);
    assert_int_equal(look(b)->list->counter, 3);
    assert_int_equal(counts(b)->lists_lost, 3);
}

/* ---- Values ----------------------------------------------------------------------- */

/* A signal: where it is, what it means, and the raw value that is not available. */
struct signal {
    const char *name;
    size_t field; /* of the value in its struct */
    unsigned kind, start, length;
    bool negative;
    double step, offset;
    int64_t least, most, none;
    bool clamped;
};

#define DEGREE           (M_PI / 180)
#define OBJECT(field)    #field, offsetof(struct anlos_object, field)
#define LIST(field)      #field, offsetof(struct anlos_list, field)
#define OF_STATUS(field) #field, offsetof(struct anlos_status, field)

/* From msgs/can/anlos.dbc. */
static const struct signal object_signals[] = {
    {OBJECT(x_m), STATE, 30, 13, true, 0.02, 0, -4095, 4095, -4096, true},
    {OBJECT(y_m), STATE, 43, 12, true, 0.02, 0, -2047, 2047, -2048, true},
    {OBJECT(z_m), STATE, 55, 9, true, 0.05, 0, -255, 255, -256, true},
    {OBJECT(vx_m_s), DYNAMICS, 28, 11, true, 0.05, 0, -1023, 1023, -1024, true},
    {OBJECT(vy_m_s), DYNAMICS, 39, 11, true, 0.05, 0, -1023, 1023, -1024, true},
    {OBJECT(existence), DYNAMICS, 50, 7, false, 0.01, 0, 0, 100, 127, false},
    {OBJECT(sigma_x_m), QUALITY, 28, 7, false, 0.02, 0, 0, 126, 127, true},
    {OBJECT(sigma_y_m), QUALITY, 35, 7, false, 0.02, 0, 0, 126, 127, true},
    {OBJECT(correlation_xy), QUALITY, 42, 6, true, 0.04, 0, -25, 25, -32, false},
    {OBJECT(sigma_v_m_s), QUALITY, 48, 5, false, 0.1, 0, 0, 30, 31, true},
    {OBJECT(length_m), QUALITY, 53, 6, false, 0.1, 0, 0, 62, 63, true},
    {OBJECT(width_m), QUALITY, 59, 5, false, 0.1, 0, 0, 30, 31, true},
    {OBJECT(course_rad), MOTION, 28, 9, true, DEGREE, 0, -180, 180, -256, false},
    {OBJECT(sigma_course_rad), MOTION, 37, 6, false, DEGREE, 0, 0, 62, 63, true},
    {OBJECT(sigma_vx_m_s), MOTION, 43, 7, false, 0.05, 0, 0, 126, 127, true},
    {OBJECT(sigma_vy_m_s), MOTION, 50, 7, false, 0.05, 0, 0, 126, 127, true},
    {OBJECT(correlation_v), MOTION, 57, 6, true, 0.04, 0, -25, 25, -32, false},
    {OBJECT(shape_probability), FD, 55, 7, false, 0.01, 0, 0, 100, 127, false},
    {OBJECT(existence), FD, 62, 14, false, 0.0001, 0, 0, 10000, 16383, false},
    {OBJECT(sigma_v_m_s), FD, 76, 12, false, 0.01, 0, 0, 4094, 4095, true},
    {OBJECT(length_m), FD, 88, 12, false, 0.01, 0, 0, 4094, 4095, true},
    {OBJECT(width_m), FD, 100, 12, false, 0.01, 0, 0, 4094, 4095, true},
    {OBJECT(height_m), FD, 112, 12, false, 0.01, 0, 0, 4094, 4095, true},
    {OBJECT(unseen_s), FD, 124, 12, false, 0.01, 0, 0, 4094, 4095, true},
    {OBJECT(age_s), FD, 136, 16, false, 0.1, 0, 0, 65534, 65535, true},
};
static const struct signal list_signals[] = {
    {LIST(latency_s), HEADER, 36, 12, false, 0.001, 0, 0, 4094, 4095, true},
    {LIST(cycle_s), HEADER, 48, 12, false, 0.01, 0, 0, 4094, 4095, true},
};
static const struct signal status_signals[] = {
    {OF_STATUS(temperature_c), STATUS, 40, 8, false, 0.5, -40, 0, 254, 255, true},
    {OF_STATUS(sound_speed_m_s), STATUS, 48, 10, false, 0.1, 280, 0, 1022, 1023, false},
    {OF_STATUS(range_m), STATUS, 58, 6, false, 0.2, -0.2, 1, 63, 0, true},
};

/* What the receiver makes of a raw value of one signal, the rest of its frame being 0. */
static struct anlos_value heard(struct bench *b, const struct signal *s, int64_t raw)
{
    const void *from;
    struct anlos_value v;
    unsigned number = s->kind >= STATE, n = s->kind == STATUS ? 1 : 2;
    struct sensor_frame frames[6];

    b->s.list = (b->s.list + 1) % 4096;
    b->s.capture_s++;
    frames[0] = s->kind == STATUS ? sensor_status(&b->s, ACTIVE, 0)
                                  : sensor_header(&b->s, number);
    frames[1] = sensor_time(&b->s);
    if (s->kind == MOTION)
        frames[n++] = sensor_object(&b->s, MOTION, 1);
    for (unsigned i = 0; number && i < (s->kind == FD ? 1 : 3); i++)
        frames[n++] = sensor_object(&b->s, s->kind == FD ? FD : STATE + i, 1);
    for (unsigned i = 0; i < n; i++) {
        if (frames[i].id - b->s.first_id == s->kind)
            sensor_put(&frames[i], s->start, s->length, raw);
        send(b, frames[i]);
    }
    look(b);
    from = s->kind == STATUS   ? (const void *)&b->view.status
           : s->kind == HEADER ? (const void *)b->view.list
                               : (const void *)&b->view.list->objects[0];
    if (s->kind != STATUS)
        assert_int_equal(b->view.list->counter, b->s.list);
    memcpy(&v, (const char *)from + s->field, sizeof v);
    return v;
}

/* Lists with objects of all kinds, whose frames are believed from then on. */
static void begin(struct bench *b)
{
    restart(b);
    send(b, sensor_status(&b->s, ACTIVE, 0));
    for (int i = 0; i < 2; i++) {
        open_list(b, 1);
        send(b, sensor_object(&b->s, MOTION, 1));
        send(b, sensor_object(&b->s, FD, 1));
        send_list(b, 1);
    }
}

static void check_signal(struct bench *b, const struct signal *s)
{
    const int64_t most = (INT64_C(1) << (s->length - s->negative)) - 1;
    const int64_t least = s->negative ? -most - 1 : 0;
    bool low_end = s->clamped && (s->least < 0 || s->offset < -1); /* range begins at 0 */

    begin(b);
    for (int64_t raw = least; raw <= most;
         raw += most > 500 && raw > least + 3 && raw < most - 9 ? 7 : 1) {
        struct anlos_value v = heard(b, s, raw);
        bool there = raw >= s->least && raw <= s->most && raw != s->none;
        bool end = (raw == s->most && s->clamped) || (raw == s->least && low_end);
        double value = there ? (double)raw * s->step + s->offset : 0.0;
        enum anlos_quality quality = !there ? ANLOS_NOT_AVAILABLE
                                     : end  ? ANLOS_AT_LIMIT
                                            : ANLOS_AVAILABLE;
        if (v.quality != quality || fabs((double)v.value - value) > 0.01 * s->step + 1e-4)
            fail_msg("%s of frame %u, raw %lld: %g (%d), not %g (%d)", s->name, s->kind,
                     (long long)raw, (double)v.value, v.quality, value, quality);
    }
}

static void every_signal_has_its_value_or_is_not_available(void **state)
{
    for (size_t i = 0; i < sizeof object_signals / sizeof *object_signals; i++)
        check_signal(*state, &object_signals[i]);
    for (size_t i = 0; i < sizeof list_signals / sizeof *list_signals; i++)
        check_signal(*state, &list_signals[i]);
    for (size_t i = 0; i < sizeof status_signals / sizeof *status_signals; i++)
        check_signal(*state, &status_signals[i]);
}

static void a_class_of_a_later_version_is_unknown(void **state)
{
    static const struct signal classes[] = {
        {.name = "Class", .kind = DYNAMICS, .start = 57, .length = 4},
        {.name = "Class", .kind = FD, .start = 48, .length = 4}};
    struct bench *b = *state;

    for (size_t i = 0; i < sizeof classes / sizeof *classes; i++) {
        begin(b);
        for (int raw = 0; raw < 16; raw++) {
            heard(b, &classes[i], raw);
            assert_int_equal(b->view.list->objects[0].shape,
                             raw <= ANLOS_MULTIPATH ? raw : ANLOS_CLASS_UNKNOWN);
        }
    }
}

static const struct anlos_object *hear_fd(struct bench *b, const float *values, size_t n,
                                          const unsigned *starts)
{
    for (int i = 0; i < 2; i++) {
        open_list(b, 1);
        struct sensor_frame f = sensor_object(&b->s, FD, 1);
        for (size_t k = 0; k < n; k++)
            sensor_put_float(&f, starts[k], values[k]);
        send(b, f);
    }
    return &look(b)->list->objects[0];
}

static void floats_are_taken_and_nan_or_what_cannot_be_is_not_available(void **state)
{
    static const unsigned starts[] = {160, 192, 224, 256, 288};
    static const float wrong[] = {NAN, INFINITY, -INFINITY, 1000.5f, -2e9f};
    static const float good[] = {4.5f, -3.25f, 1000.0f, -1000.0f, 1e-30f};
    struct bench *b = *state;

    get_going(b);
    const struct anlos_object *o = hear_fd(b, wrong, 5, starts);
    assert_int_equal(o->x_m.quality, ANLOS_NOT_AVAILABLE);
    assert_int_equal(o->y_m.quality, ANLOS_NOT_AVAILABLE);
    assert_int_equal(o->z_m.quality, ANLOS_NOT_AVAILABLE);
    assert_int_equal(o->vx_m_s.quality, ANLOS_NOT_AVAILABLE);
    assert_int_equal(o->vy_m_s.quality, ANLOS_NOT_AVAILABLE);
    assert_true(o->x_m.value == 0.0f && o->vy_m_s.value == 0.0f);
    o = hear_fd(b, good, 5, starts);
    assert_true(o->x_m.value == 4.5f && o->y_m.value == -3.25f &&
                o->vy_m_s.value == 1e-30f);
    assert_int_equal(o->x_m.quality, ANLOS_AVAILABLE);
    assert_int_equal(o->z_m.quality, ANLOS_AT_LIMIT);
    assert_int_equal(o->vx_m_s.quality, ANLOS_AT_LIMIT);
}

static void a_covariance_becomes_sigmas_and_correlations(void **state)
{
    static const unsigned starts[] = {320, 352, 384, 416, 448, 480};
    static const float some[] = {0.04f, 0.03f, -0.05f, 0.09f, 0.0f, 0.0f};
    static const float none[] = {NAN, 0.03f, 0.0f, -1.0f, 0.0f, 1e6f};
    struct bench *b = *state;

    get_going(b);
    const struct anlos_object *o = hear_fd(b, some, 6, starts);
    assert_float_equal(o->sigma_x_m.value, 0.2, 1e-6);
    assert_float_equal(o->sigma_y_m.value, 0.3, 1e-6);
    assert_float_equal(o->correlation_xy.value, 0.5, 1e-5);
    assert_int_equal(o->sigma_z_m.quality, ANLOS_AVAILABLE);
    assert_float_equal(o->sigma_z_m.value, 0.0, 1e-6);
    assert_int_equal(o->correlation_xz.quality, ANLOS_NOT_AVAILABLE); /* of no error */
    o = hear_fd(b, none, 6, starts);
    assert_int_equal(o->sigma_x_m.quality, ANLOS_NOT_AVAILABLE);
    assert_int_equal(o->sigma_y_m.quality, ANLOS_NOT_AVAILABLE);
    assert_int_equal(o->correlation_xy.quality, ANLOS_NOT_AVAILABLE);
    assert_int_equal(o->sigma_z_m.quality, ANLOS_AT_LIMIT);
    assert_float_equal(o->sigma_z_m.value, 1000.0, 1e-3);
}

static void trouble_codes_fill_a_table(void **state)
{
    struct bench *b = *state;

    for (unsigned code = 0; code < 32; code++) {
        struct sensor_frame f = sensor_blank(&b->s, DIAGNOSIS);
        sensor_put(&f, 40, 4, 1);
        sensor_put(&f, 44, 5, 31);
        sensor_put(&f, 49, 5, 3);
        sensor_put(&f, 54, 5, code);
        sensor_put(&f, 59, 1, code % 2);
        sensor_put(&f, 60, 4, code % 16);
        send(b, f);
    }
    const struct anlos_diagnosis *g = &look(b)->diagnosis;
    assert_int_equal(b->view.diagnosis_link, ANLOS_VALID);
    assert_int_equal(g->version[0], 1);
    assert_int_equal(g->version[1], 31);
    assert_int_equal(g->version[2], 3);
    assert_int_equal(g->trouble_present, 0x5555); /* the odd codes are the even bits */
    for (unsigned code = 1; code <= 16; code++)
        assert_int_equal(g->trouble_count[code - 1], code % 16);
}

/* ---- Trust and time --------------------------------------------------------------- */

static void only_what_a_live_sensor_vouches_for_is_trusted(void **state)
{
    struct bench *b = *state;

    for (unsigned s = 0; s < 8; s++)
        for (unsigned source = 0; source < 4; source++) {
            enum anlos_trust trust = ANLOS_TRUST_NONE;
            if (source == ANLOS_SOURCE_LIVE && s == ACTIVE)
                trust = ANLOS_TRUST_FULL;
            if (source == ANLOS_SOURCE_LIVE && s == DEGRADED)
                trust = ANLOS_TRUST_OBJECTS;
            restart(b);
            for (int i = 0; i < 2; i++) {
                send(b, sensor_status(&b->s, s, source));
                send_list(b, 0);
            }
            assert_int_equal(look(b)->trust, trust);
            assert_int_equal(b->view.status.state, s);
            assert_int_equal(b->view.status.source, source);
        }
}

static void sources_are_trusted_as_they_are_configured(void **state)
{
    struct bench *b = *state;
    struct anlos_config cfg;

    anlos_config_default(&cfg);
    cfg.sources = 1u << ANLOS_SOURCE_SIMULATION;
    for (unsigned source = 0; source < 4; source++) {
        memset(&b->s.counters, 0, sizeof b->s.counters);
        assert_int_equal(anlos_receiver_init(&b->r, &cfg), 0);
        for (int i = 0; i < 2; i++) {
            send(b, sensor_status(&b->s, ACTIVE, source));
            send_list(b, 0);
        }
        assert_int_equal(look(b)->trust, source == ANLOS_SOURCE_SIMULATION
                                             ? ANLOS_TRUST_FULL
                                             : ANLOS_TRUST_NONE);
    }
}

static void an_absence_counts_only_in_a_complete_list_of_sound(void **state)
{
    struct bench *b = *state;
    struct sensor_frame f;

    get_going(b);
    b->s.list++;
    f = sensor_header(&b->s, 0);
    sensor_put(&f, 60, 1, 1); /* truncated */
    send(b, f);
    send(b, sensor_time(&b->s));
    assert_int_equal(look(b)->trust, ANLOS_TRUST_OBJECTS);
    b->s.list++;
    f = sensor_header(&b->s, 0);
    sensor_put(&f, 36, 12, 4095); /* of no sound */
    send(b, f);
    send(b, sensor_time(&b->s));
    assert_int_equal(look(b)->trust, ANLOS_TRUST_OBJECTS);
    assert_int_equal(b->view.age_known, 0);
}

static void a_list_gets_older_until_it_is_not_trusted(void **state)
{
    struct bench *b = *state;
    struct sensor_frame f;

    get_going(b);
    b->s.list++;
    f = sensor_header(&b->s, 0);
    sensor_put(&f, 36, 12, 700); /* ms */
    send(b, f);
    send(b, sensor_time(&b->s));
    b->now_ms += 300;
    assert_int_equal(look(b)->age_ms, 1000);
    assert_int_equal(b->view.trust, ANLOS_TRUST_FULL);
    b->now_ms += 1;
    assert_int_equal(look(b)->age_ms, 1001);
    assert_int_equal(b->view.trust, ANLOS_TRUST_NONE);
    assert_non_null(b->view.list);
}

static void each_silence_is_noticed_at_its_time_and_not_before(void **state)
{
    static const uint32_t starts_ms[] = {0, 12345, UINT32_MAX - 100, UINT32_MAX};
    struct bench *b = *state;

    for (size_t i = 0; i < sizeof starts_ms / sizeof *starts_ms; i++) {
        restart(b);
        b->now_ms = starts_ms[i];
        get_going(b);
        for (int k = 0; k < 2; k++)
            send(b, sensor_blank(&b->s, DIAGNOSIS));
        uint32_t base_ms = b->now_ms;
        b->now_ms = base_ms + 350;
        assert_int_equal(anlos_receiver_tick(&b->r, b->now_ms), 0);
        assert_int_equal(look(b)->trust, ANLOS_TRUST_FULL);
        assert_int_equal(anlos_receiver_tick(&b->r, base_ms + 351), ANLOS_EVENT_TIMEOUT);
        assert_int_equal(look(b)->trust, ANLOS_TRUST_NONE);
        assert_int_equal(b->view.status_link, ANLOS_NODATA);
        assert_int_equal(b->view.status.state, ANLOS_STATE_UNKNOWN);
        assert_non_null(b->view.list);
        assert_int_equal(anlos_receiver_tick(&b->r, base_ms + 600), 0);
        assert_int_equal(anlos_receiver_tick(&b->r, base_ms + 601), ANLOS_EVENT_TIMEOUT);
        b->now_ms = base_ms + 601;
        assert_null(look(b)->list);
        assert_int_equal(b->view.list_link, ANLOS_NODATA);
        assert_int_equal(b->view.diagnosis_link, ANLOS_VALID);
        assert_int_equal(anlos_receiver_tick(&b->r, base_ms + 3500), 0);
        assert_int_equal(anlos_receiver_tick(&b->r, base_ms + 3501), ANLOS_EVENT_TIMEOUT);
        assert_int_equal(look(b)->diagnosis_link, ANLOS_NODATA);
        assert_int_equal(counts(b)->timeouts, 3);
        b->now_ms = base_ms + 3501;
        memset(b->s.counters, 0, sizeof b->s.counters); /* the sensor began anew */
        b->s.list += 100;
        send_list(b, 0);
        send_list(b, 0);
        assert_int_equal(counts(b)->lists_lost, 0);
        get_going(b);
    }
}

static struct sensor_frame shutdown_of(const struct sensor *s)
{
    struct sensor_frame f = sensor_status(s, 7, 0);

    sensor_put(&f, 21, 1, 1);
    return f;
}

/* It says so, is silent, and starts again. */
static void what_was_stopped_in_order_does_not_time_out(void **state)
{
    struct bench *b = *state;

    get_going(b);
    send(b, sensor_blank(&b->s, DIAGNOSIS));
    send(b, shutdown_of(&b->s));
    assert_int_equal(look(b)->trust, ANLOS_TRUST_NONE);
    assert_int_equal(b->view.status.state, ANLOS_STATE_SHUTDOWN);
    for (int i = 0; i < 100; i++) {
        b->now_ms += 50;
        assert_int_equal(anlos_receiver_tick(&b->r, b->now_ms), 0);
        assert_int_equal(look(b)->status.state, ANLOS_STATE_SHUTDOWN);
        assert_int_equal(b->view.trust, ANLOS_TRUST_NONE);
    }
    assert_null(b->view.list);
    assert_int_equal(b->view.status_link, ANLOS_NODATA);
    assert_int_equal(b->view.counts.timeouts, 0);
    get_going(b);
    assert_int_equal(b->view.status.state, ANLOS_STATE_ACTIVE);
    b->now_ms += 5000;
    assert_int_equal(anlos_receiver_tick(&b->r, b->now_ms), ANLOS_EVENT_TIMEOUT);
    assert_int_equal(look(b)->status.state, ANLOS_STATE_UNKNOWN);
}

/* The first of a sensor that nobody heard before. */
static void one_frame_of_a_shutdown_alone_is_no_proof(void **state)
{
    struct bench *b = *state;

    send(b, shutdown_of(&b->s));
    assert_int_equal(look(b)->status.state, ANLOS_STATE_UNKNOWN);
    b->now_ms += 400;
    assert_int_equal(anlos_receiver_tick(&b->r, b->now_ms), ANLOS_EVENT_TIMEOUT);
}

static void a_list_that_does_not_end_is_dropped(void **state)
{
    struct bench *b = *state;

    get_going(b);
    open_list(b, 1);
    send(b, sensor_object(&b->s, STATE, 1));
    assert_int_equal(anlos_receiver_tick(&b->r, b->now_ms + 200), 0);
    assert_int_equal(anlos_receiver_tick(&b->r, b->now_ms + 201), ANLOS_EVENT_DROPPED);
    send(b, sensor_object(&b->s, DYNAMICS, 1));
    send(b, sensor_object(&b->s, QUALITY, 1));
    assert_int_equal(counts(b)->lists_torn, 1);
    assert_int_equal(counts(b)->lists_whole, 0);
    assert_int_equal(counts(b)->frames_orphaned, 2);
}

/* What was wrong too often is not believed again because it was silent for a while. */
static void silence_does_not_make_the_invalid_believable(void **state)
{
    struct bench *b = *state;

    get_going(b);
    for (int i = 0; i < 2; i++) {
        struct sensor_frame f = sensor_next(&b->s, sensor_status(&b->s, ACTIVE, 0));
        f.data[5] ^= 1;
        hear(b, f);
    }
    assert_int_equal(look(b)->status_link, ANLOS_INVALID);
    b->now_ms += 10000;
    for (int i = 0; i < 6; i++) { /* the first of them is two ahead */
        assert_int_equal(look(b)->status_link, ANLOS_INVALID);
        send(b, sensor_status(&b->s, ACTIVE, 0));
    }
    assert_int_equal(look(b)->status_link, ANLOS_VALID);
}

static void a_clock_that_reads_a_little_back_ends_nothing(void **state)
{
    struct bench *b = *state;

    b->now_ms = 5000;
    get_going(b);
    b->now_ms = 4990; /* the reader had looked at the clock before the frame came */
    assert_int_equal(look(b)->trust, ANLOS_TRUST_FULL);
    assert_int_equal(b->view.age_ms, 60);
}

static void what_is_not_the_sensors_is_left_alone(void **state)
{
    struct bench *b = *state;
    uint8_t data[64] = {0};
    static const uint32_t others[] = {0,     0x3FF, 0x40A,      0x40C,     0x40F,
                                      0x410, 0x7FF, 0x80000400, UINT32_MAX};

    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        assert_int_equal(anlos_receiver_frame(&b->r, others[i], data, 8, 0),
                         ANLOS_EVENT_FOREIGN);
    assert_int_equal(anlos_receiver_frame(&b->r, 0x400, NULL, 0, 0), ANLOS_EVENT_WRONG);
    assert_int_equal(counts(b)->frames_damaged, 1);
}

static uint32_t draw(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*seed >> 33);
}

/* Half of the frames are protected as they should be, so that what is in them counts. */
static void whatever_comes_leaves_it_whole(void **state)
{
    struct bench *b = *state;
    uint64_t seed = 19;

    for (int i = 0; i < 200000; i++) {
        struct sensor_frame f = sensor_blank(&b->s, draw(&seed) % KINDS);
        for (unsigned k = 0; k < f.length; k++)
            f.data[k] = (uint8_t)draw(&seed);
        if (f.id == 0x402)
            sensor_put(&f, 61, 3, 2);
        f.length = draw(&seed) % 16 ? f.length : (uint8_t)(draw(&seed) % 65);
        b->now_ms += draw(&seed) % 64 ? draw(&seed) % 4 : draw(&seed);
        if (draw(&seed) % 2)
            send(b, f);
        else
            hear(b, f);
        look(b);
        assert_true(!b->view.list || b->view.list->n_objects <= ANLOS_OBJECTS);
        assert_true(b->view.list || b->view.trust == ANLOS_TRUST_NONE);
    }
    assert_true(counts(b)->frames_good > 10000 && counts(b)->frames_damaged > 10000);
}

static void a_configuration_that_cannot_be_is_refused(void **state)
{
    struct bench *b = *state;
    struct anlos_config good, cfg;

    anlos_config_default(&good);
    assert_int_equal(anlos_receiver_init(NULL, &good), -1);
    cfg = good;
    cfg.first_id = 0x7F0;
    assert_int_equal(anlos_receiver_init(&b->r, &cfg), 0);
    cfg.first_id = 0x800;
    assert_int_equal(anlos_receiver_init(&b->r, &cfg), -1);
    cfg.first_id = 0x401;
    assert_int_equal(anlos_receiver_init(&b->r, &cfg), -1);
    uint16_t *const times[] = {&cfg.status_ms, &cfg.list_ms, &cfg.diagnosis_ms,
                               &cfg.assembly_ms, &cfg.age_ms};
    for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
        cfg = good;
        *times[i] = 0;
        assert_int_equal(anlos_receiver_init(&b->r, &cfg), -1);
    }
}

#define TEST(name) cmocka_unit_test_setup(name, open_bench)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_crcs_that_are_tested_with_are_autosars),
        TEST(frames_that_autosar_prints_are_good),
        TEST(a_frame_with_any_bit_wrong_is_not_used),
        TEST(a_frame_of_another_sensor_or_kind_is_not_used),
        TEST(a_counter_of_15_is_none),
        TEST(each_sequence_of_counters_is_judged_as_autosar_does),
        TEST(a_kind_of_frames_goes_through_autosars_states),
        TEST(a_list_is_handed_over_when_it_is_whole),
        TEST(a_full_list_fits_and_one_of_more_is_refused),
        TEST(a_list_of_another_interface_version_is_refused),
        TEST(the_first_list_is_not_believed_before_its_frames_have_proven_themselves),
        TEST(each_kind_of_frames_has_to_be_valid),
        TEST(no_time_of_before_makes_room_for_the_next_ones),
        TEST(each_frame_of_a_list_that_is_missing_costs_that_list_alone),
        TEST(a_list_that_was_cut_and_is_sent_again_comes_once),
        TEST(objects_of_another_list_are_not_mixed_in),
        TEST(a_part_that_comes_twice_or_of_an_object_too_many_spoils_the_list),
        TEST(a_list_has_one_kind_of_objects),
        TEST(a_list_is_whole_without_motions_and_takes_those_that_came),
        TEST(no_motion_spoils_a_list),
        TEST(a_list_has_the_field_of_view_that_came_with_it),
        TEST(an_area_that_is_not_whole_is_left_out),
        TEST(the_time_of_the_next_list_is_not_taken),
        TEST(a_whole_list_that_gets_lost_costs_no_other),
        TEST(a_list_has_one_time),
        TEST(a_frame_that_comes_twice_does_not_spoil_its_list),
        TEST(lists_that_are_replayed_are_dropped),
        TEST(a_sensor_that_restarted_goes_on_with_its_first_lists),
        TEST(the_counter_of_lists_wraps_around_and_tells_what_got_lost),
        TEST(every_signal_has_its_value_or_is_not_available),
        TEST(a_class_of_a_later_version_is_unknown),
        TEST(floats_are_taken_and_nan_or_what_cannot_be_is_not_available),
        TEST(a_covariance_becomes_sigmas_and_correlations),
        TEST(trouble_codes_fill_a_table),
        TEST(only_what_a_live_sensor_vouches_for_is_trusted),
        TEST(sources_are_trusted_as_they_are_configured),
        TEST(an_absence_counts_only_in_a_complete_list_of_sound),
        TEST(a_list_gets_older_until_it_is_not_trusted),
        TEST(each_silence_is_noticed_at_its_time_and_not_before),
        TEST(what_was_stopped_in_order_does_not_time_out),
        TEST(one_frame_of_a_shutdown_alone_is_no_proof),
        TEST(a_list_that_does_not_end_is_dropped),
        TEST(silence_does_not_make_the_invalid_believable),
        TEST(a_clock_that_reads_a_little_back_ends_nothing),
        TEST(what_is_not_the_sensors_is_left_alone),
        TEST(whatever_comes_leaves_it_whole),
        TEST(a_configuration_that_cannot_be_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
