#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
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
    for (size_t frame = 0; frame < end; frame += step)
        for (size_t done = 0; done < step;) {
            struct slot_piece piece =
                slot_plan_emission(p, frame + done, step - done, CHIRP);
            if (!piece.n)
                break;
            for (size_t i = 0; i < piece.n; i++)
                map[frame + done + piece.at + i] =
                    (int)(1000 * piece.slot + piece.offset + i + 1);
            done += piece.at + piece.n;
        }
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
    assert_false(slot_plan_heard(&p, 50 + SLOT + TAIL - 1));
    assert_int_equal(p.n_settled, 0);
    assert_true(slot_plan_heard(&p, 50 + SLOT + TAIL));
    assert_int_equal(p.n_settled, 1);
    assert_false(slot_plan_heard(&p, 50 + SLOT + TAIL));
    assert_true(slot_plan_heard(&p, 10000));
    assert_int_equal(p.n_settled, 2);
    assert_true(p.valid[0] && p.valid[1]);
    assert_false(p.placed);
    assert_int_equal(slot_plan_recording(&p, 200, 10).n, 0);
    assert_int_equal(slot_plan_emission(&p, 150, 10, CHIRP).n, 0);
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
        assert_int_equal(slot_plan_emission(&p, 0, 1000, CHIRP).n, 0);
        slot_plan_place(&p, 20);
        struct slot_piece piece = slot_plan_emission(&p, 0, 1000, CHIRP);
        assert_int_equal(piece.n, n < 4 ? CHIRP : 0);
        if (n < 4) {
            assert_int_equal(piece.at, 20);
            assert_int_equal(piece.slot, n);
            piece = slot_plan_recording(&p, 0, 10000);
            assert_int_equal(piece.at, 20);
            assert_int_equal(piece.offset, n * SLOT);
            assert_int_equal(piece.n, (4 - n) * SLOT + TAIL);
            assert_true(slot_plan_heard(&p, 20 + (4 - n) * SLOT + TAIL));
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
    assert_int_equal(slot_plan_emission(&p, 0, 1000, CHIRP).n, 0);
    assert_int_equal(slot_plan_recording(&p, 0, 1000).n, 0);
    assert_false(slot_plan_heard(&p, 1000));
    slot_plan_clear(&p);
}

static void frames_count_on_for_days(void **state)
{
    uint64_t days = UINT64_C(192000) * 86400 * 30; /* over 32 bits */
    struct slot_plan p = make(2, days + 5);
    (void)state;
    struct slot_piece piece = slot_plan_emission(&p, days, 200, CHIRP);
    assert_int_equal(piece.at, 5);
    assert_int_equal(piece.n, CHIRP);
    assert_true(slot_plan_heard(&p, days + 5 + SLOT + TAIL));
    slot_plan_clear(&p);
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
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
