/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "hal/alsa/slot_plan.h"

enum { SLOT = 100, TAIL = 30, CHIRP = 40, SLOTS = 4 };

static struct slot_plan make(size_t n_slots, uint64_t frame)
{
    struct slot_plan p;
    assert_int_equal(slot_plan_create(&p, SLOT, TAIL, SLOTS), 0);
    slot_plan_load(&p, n_slots);
    slot_plan_place(&p, frame);
    return p;
}

/* Walks transfers of `step` frames from 0 to `end`, and marks in map[end] the emission's
 * sample + 1 of slot k as 1000 k + sample + 1. */
static void emit(const struct slot_plan *p, size_t step, int *map, size_t end)
{
    for (size_t frame = 0; frame < end; frame += step) {
        size_t slot, after;
        for (slot_plan_sounding(p, frame, step, CHIRP, &slot, &after); slot < after;
             slot++) {
            struct slot_piece piece = slot_plan_emission(p, slot, frame, step, CHIRP);
            assert_true(piece.n > 0 && piece.slot == slot);
            for (size_t i = 0; i < piece.n; i++)
                map[frame + piece.at + i] =
                    (int)(1000 * piece.slot + piece.offset + i + 1);
        }
    }
}

/* The first emission within these frames; n is 0 without one. */
static struct slot_piece sounding(const struct slot_plan *p, uint64_t frame, size_t n)
{
    size_t slot, end;
    slot_plan_sounding(p, frame, n, CHIRP, &slot, &end);
    return slot < end ? slot_plan_emission(p, slot, frame, n, CHIRP)
                      : (struct slot_piece){.n = 0};
}

static void
emissions_follow_each_other_a_slot_apart_however_they_are_transferred(void **state)
{
    static const size_t steps[] = {1, 7, 40, 100, 250, 700};
    (void)state;
    for (size_t s = 0; s < sizeof steps / sizeof *steps; s++) {
        int map[1400] = {0};
        struct slot_plan p = make(3, 123);
        emit(&p, steps[s], map, 700 / steps[s] * steps[s]);
        for (size_t f = 0; f < 700 / steps[s] * steps[s]; f++) {
            size_t at = f - 123, k = at / SLOT, i = at % SLOT;
            bool sounds = f >= 123 && k < 3 && i < CHIRP;
            assert_int_equal(map[f], sounds ? (int)(1000 * k + i + 1) : 0);
        }
        slot_plan_clear(&p);
    }
}

static void the_recording_is_the_slots_and_the_last_ones_tail(void **state)
{
    static const size_t steps[] = {1, 13, 100, 600};
    (void)state;
    for (size_t s = 0; s < sizeof steps / sizeof *steps; s++) {
        size_t n = 0, step = steps[s];
        struct slot_plan p = make(2, 50);
        for (size_t f = 0; f < 600; f += step) {
            struct slot_piece piece = slot_plan_recording(&p, f, step);
            if (!piece.n)
                continue;
            assert_int_equal(piece.offset, n); /* without a gap */
            assert_int_equal(f + piece.at, 50 + n);
            n += piece.n;
        }
        assert_int_equal(n, 2 * SLOT + TAIL);
        slot_plan_clear(&p);
    }
}

static void a_slot_is_settled_when_its_tail_is_heard(void **state)
{
    struct slot_plan p = make(2, 50);
    (void)state;
    assert_int_equal(slot_plan_heard(&p, 50 + SLOT + TAIL - 1), 0);
    assert_int_equal(p.n_settled, 0);
    assert_int_equal(slot_plan_heard(&p, 50 + SLOT + TAIL), 0);
    assert_int_equal(p.n_settled, 1);
    assert_int_equal(slot_plan_heard(&p, 50 + SLOT + TAIL), 0);
    assert_int_equal(p.n_settled, 1);
    assert_int_equal(slot_plan_heard(&p, 10000), 0);
    assert_int_equal(p.n_settled, 2);
    assert_true(p.valid[0] && p.valid[1]);
    assert_false(p.placed);
    assert_int_equal(slot_plan_recording(&p, 200, 10).n, 0);
    assert_int_equal(sounding(&p, 150, 10).n, 0);
    slot_plan_clear(&p);
}

/* Slots begin at 50, 150, 250, 350, and are whole at 180, 280, 380, 480. */
static void a_break_voids_what_had_begun_and_the_rest_is_placed_anew(void **state)
{
    static const struct {
        uint64_t frame;
        size_t good, bad;
    } cases[] = {{0, 0, 0},   {50, 0, 0},  {51, 0, 1},  {150, 0, 1},
                 {151, 0, 2}, {179, 0, 2}, {180, 1, 1}, {251, 1, 2},
                 {351, 2, 2}, {379, 2, 2}, {479, 3, 1}, {480, 4, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct slot_plan p = make(4, 50);
        size_t n = cases[i].good + cases[i].bad;
        assert_int_equal(slot_plan_break(&p, cases[i].frame), cases[i].bad);
        assert_int_equal(p.n_settled, n);
        for (size_t k = 0; k < n; k++)
            assert_int_equal(p.valid[k], k < cases[i].good);
        assert_int_equal(sounding(&p, 0, 1000).n, 0);
        slot_plan_place(&p, 20);
        struct slot_piece piece = sounding(&p, 0, 1000);
        assert_int_equal(piece.n, n < 4 ? CHIRP : 0);
        if (n < 4) {
            assert_int_equal(piece.at, 20);
            assert_int_equal(piece.slot, n);
            piece = slot_plan_recording(&p, 0, 10000);
            assert_int_equal(piece.at, 20);
            assert_int_equal(piece.offset, n * SLOT);
            assert_int_equal(piece.n, (4 - n) * SLOT + TAIL);
            assert_int_equal(slot_plan_heard(&p, 20 + (4 - n) * SLOT + TAIL), 0);
        }
        assert_int_equal(p.n_settled, 4);
        slot_plan_clear(&p);
    }
}

static void nothing_sounds_before_a_shot_is_placed(void **state)
{
    struct slot_plan p;
    (void)state;
    assert_int_equal(slot_plan_create(&p, SLOT, TAIL, SLOTS), 0);
    slot_plan_place(&p, 10); /* there is none */
    assert_false(p.placed);
    slot_plan_load(&p, 2);
    assert_int_equal(sounding(&p, 0, 1000).n, 0);
    assert_int_equal(slot_plan_recording(&p, 0, 1000).n, 0);
    assert_int_equal(slot_plan_heard(&p, 1000), 0);
    assert_int_equal(p.n_settled, 0);
    slot_plan_clear(&p);
}

static void frames_count_on_for_days(void **state)
{
    uint64_t days = UINT64_C(192000) * 86400 * 30; /* over 32 bits */
    struct slot_plan p = make(2, days + 5);
    (void)state;
    struct slot_piece piece = sounding(&p, days, 200);
    assert_int_equal(piece.at, 5);
    assert_int_equal(piece.n, CHIRP);
    assert_int_equal(slot_plan_heard(&p, days + 5 + SLOT + TAIL), 0);
    assert_int_equal(p.n_settled, 1);
    slot_plan_clear(&p);
}

/* Slots of 30, emissions of 40: at frame 30 k + 5 both of k and k-1 sound. */
static void emissions_longer_than_a_slot_sound_together(void **state)
{
    enum { SHORT = 30 };
    static const size_t steps[] = {1, 11, 30, 64, 200};
    struct slot_plan p;
    (void)state;
    assert_int_equal(slot_plan_create(&p, SHORT, SHORT + TAIL, 8), 0);
    slot_plan_load(&p, 5);
    slot_plan_place(&p, 17);
    for (size_t s = 0; s < sizeof steps / sizeof *steps; s++) {
        int heard[5][CHIRP] = {{0}};
        for (size_t frame = 0; frame < 300; frame += steps[s]) {
            size_t slot, end;
            slot_plan_sounding(&p, frame, steps[s], CHIRP, &slot, &end);
            for (; slot < end; slot++) {
                struct slot_piece piece =
                    slot_plan_emission(&p, slot, frame, steps[s], CHIRP);
                for (size_t i = 0; i < piece.n; i++) {
                    size_t sample = frame + piece.at + i - 17 - SHORT * slot;
                    assert_int_equal(piece.offset + i, sample);
                    heard[slot][sample]++;
                }
            }
        }
        for (size_t k = 0; k < 5; k++)
            for (size_t i = 0; i < CHIRP; i++)
                assert_int_equal(heard[k][i], 1);
    }
    /* Whole when its own tail is over, which is longer than a slot. */
    slot_plan_heard(&p, 17 + 2 * SHORT + TAIL - 1);
    assert_int_equal(p.n_settled, 0);
    slot_plan_heard(&p, 17 + 3 * SHORT + TAIL);
    assert_int_equal(p.n_settled, 2);
    slot_plan_clear(&p);
}

static void an_endless_shot_goes_on_after_a_break_without_skipping_a_slot(void **state)
{
    struct slot_plan p = make(SLOT_PLAN_ENDLESS, 50);
    (void)state;
    slot_plan_heard(&p, 50 + 1000 * SLOT + TAIL);
    assert_int_equal(p.n_settled, 1000);
    assert_int_equal(slot_plan_break(&p, 50 + 1001 * SLOT + TAIL + 1), 1);
    assert_int_equal(p.n_settled, 1002);
    assert_true(p.valid[1000 % SLOTS]);
    assert_false(p.valid[1001 % SLOTS]);
    slot_plan_place(&p, 7);
    assert_int_equal(sounding(&p, 0, 50).slot, 1002);
    struct slot_piece piece = slot_plan_recording(&p, 0, 50);
    assert_int_equal(piece.offset, 1002 * SLOT);
    assert_int_equal(piece.n, 43);
    assert_int_equal(slot_plan_heard(&p, 7 + SLOT + TAIL), 0);
    assert_int_equal(p.n_settled, 1003);
    slot_plan_clear(&p);
}

/* Emission, recording and their places in the transfers go by the start of each slot,
 * before a break and after. */
static void slots_of_an_endless_shot_need_not_be_of_one_length(void **state)
{
    static const struct firing_slots kinds[] = {
        {.slot_samples = SLOT, .stagger_samples = 9, .seed = 5},
        {.slot_samples = SLOT, .jitter_samples = 20, .seed = 6}};
    static const size_t steps[] = {1, 13, 100, 700};
    static int map[7000];
    (void)state;
    for (size_t i = 0; i < 8; i++) {
        const struct firing_slots *slots = &kinds[i % 2];
        size_t step = steps[i / 2];
        struct slot_plan p;
        assert_int_equal(slot_plan_create(&p, SLOT, TAIL, SLOTS), 0);
        p.endless = *slots;
        slot_plan_load(&p, SLOT_PLAN_ENDLESS);
        slot_plan_place(&p, 50);
        slot_plan_break(&p, 51); /* slot 0 is void, slot 1 is placed anew */
        slot_plan_place(&p, 77);
        memset(map, 0, sizeof map);
        emit(&p, step, map, 7000 / step * step);
        uint64_t first = firing_start(slots, 1), end = 0;
        for (size_t k = 1; end < 6500; k++) {
            size_t start = (size_t)(77 + firing_start(slots, k) - first);
            for (size_t f = 0; f < CHIRP && start + f < 6500; f++)
                assert_int_equal(map[start + f], 1000 * k + f + 1);
            for (size_t f = start > 77 ? (size_t)end : 77; f < start; f++)
                assert_int_equal(map[f], 0);
            end = start + CHIRP;
            struct slot_piece piece = slot_plan_recording(&p, start, 10);
            assert_true(piece.n == 10 && !piece.at && piece.slot == k);
            assert_int_equal(piece.offset, firing_start(slots, k));
            assert_int_equal(slot_plan_recording(&p, start - 1, 10).slot,
                             k > 1 ? k - 1 : 1);
            slot_plan_heard(&p, start + SLOT + TAIL - 1);
            assert_int_equal(p.n_settled, k);
            slot_plan_heard(&p, start + SLOT + TAIL);
            assert_int_equal(p.n_settled, k + 1);
        }
        slot_plan_clear(&p);
    }
}

/* Slot 2 is 200 to 330 with its tail, slot 3 is 300 to 430. */
static void slots_that_lost_frames_are_void_and_counted(void **state)
{
    static const struct {
        size_t from, n, first_bad, n_bad;
    } cases[] = {{199, 1, 1, 1}, {200, 1, 1, 2},   {230, 10, 2, 1},
                 {329, 1, 2, 2}, {300, 100, 2, 2}, {230, 0, 0, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct slot_plan p = make(4, 0);
        slot_plan_heard(&p, SLOT + TAIL);
        for (size_t n = 0; n < cases[i].n; n++) /* piece by piece */
            slot_plan_lose(&p, cases[i].from + n, 1);
        assert_int_equal(slot_plan_heard(&p, 10000), cases[i].n_bad);
        for (size_t k = 0; k < 4; k++)
            assert_int_equal(p.valid[k], k < cases[i].first_bad ||
                                             k >= cases[i].first_bad + cases[i].n_bad);
        slot_plan_clear(&p);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(
            emissions_follow_each_other_a_slot_apart_however_they_are_transferred),
        cmocka_unit_test(the_recording_is_the_slots_and_the_last_ones_tail),
        cmocka_unit_test(a_slot_is_settled_when_its_tail_is_heard),
        cmocka_unit_test(a_break_voids_what_had_begun_and_the_rest_is_placed_anew),
        cmocka_unit_test(nothing_sounds_before_a_shot_is_placed),
        cmocka_unit_test(frames_count_on_for_days),
        cmocka_unit_test(emissions_longer_than_a_slot_sound_together),
        cmocka_unit_test(an_endless_shot_goes_on_after_a_break_without_skipping_a_slot),
        cmocka_unit_test(slots_of_an_endless_shot_need_not_be_of_one_length),
        cmocka_unit_test(slots_that_lost_frames_are_void_and_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
