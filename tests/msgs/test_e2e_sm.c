/* SPDX-License-Identifier: MIT */
/* What a receiver makes of sequences of frames, by the rules of PRS E2EProtocol, for both
 * profiles.  A sequence has a letter for each thing that happens; below each that is a
 * check stands the state after it, worked out by hand:
 *   .  the next frame          R  the last one once more     L  a frame gets lost
 *   X  the next one, damaged   M  one of another data ID     S  two frames are swapped
 *   O  one from five before    -  nothing came               |  silence: a reset
 * n, i, v, x: NODATA, INIT, VALID, INVALID; a blank: no check; S takes two. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <string.h>

#include "msgs/can/e2e.h"

#define ID    0x123
#define DELTA 3

/* Of 4 frames 3 good to begin with and to go on, one of them damaged at most; all 4 to
 * come back. */
static const struct e2e_sm_config rules = {.window = 4,
                                           .min_ok_init = 3,
                                           .max_error_init = 0,
                                           .min_ok_valid = 3,
                                           .max_error_valid = 1,
                                           .min_ok_invalid = 4,
                                           .max_error_invalid = 0};

struct profile {
    const char *name;
    unsigned n_counters;
    size_t size;
    void (*protect)(uint8_t *data, size_t size, uint16_t data_id, uint8_t counter);
    enum e2e_verdict (*check)(struct e2e_check *c, const uint8_t *data, size_t size,
                              uint16_t data_id, uint8_t max_delta);
};

static const struct profile profiles[] = {
    {"P11", E2E_P11_COUNTERS, 8, e2e_p11_protect, e2e_p11_check},
    {"P05", E2E_P05_COUNTERS, 64, e2e_p05_protect, e2e_p05_check},
};

struct line {
    const struct profile *profile;
    struct e2e_check check;
    struct e2e_sm sm;
    unsigned counter; /* of the next frame */
};

static enum e2e_state hear(struct line *l, unsigned counter, uint16_t id, uint8_t damage)
{
    const struct profile *p = l->profile;
    uint8_t data[64] = {[5] = 77};

    p->protect(data, p->size, id, (uint8_t)(counter % p->n_counters));
    data[5] ^= damage;
    return e2e_sm_check(&l->sm, &rules, p->check(&l->check, data, p->size, ID, DELTA));
}

static enum e2e_state hear_nothing(struct line *l)
{
    return e2e_sm_check(&l->sm, &rules, l->profile->check(&l->check, NULL, 0, ID, DELTA));
}

static char letter(enum e2e_state s)
{
    return "nivx"[s];
}

/* Writes the states of what it is. */
static char *happen(struct line *l, char what, char *out)
{
    /* Far from 0, so that what was before can be told. */
    unsigned c = l->counter;

    switch (what) {
    case '.':
        *out++ = letter(hear(l, l->counter++, ID, 0));
        break;
    case 'R':
        *out++ = letter(hear(l, c - 1, ID, 0));
        break;
    case 'L':
        l->counter++;
        *out++ = ' ';
        break;
    case 'X':
        *out++ = letter(hear(l, l->counter++, ID, 4));
        break;
    case 'M':
        *out++ = letter(hear(l, c, ID ^ 0x10, 0));
        break;
    case 'S':
        *out++ = letter(hear(l, c + 1, ID, 0));
        *out++ = letter(hear(l, c, ID, 0));
        l->counter += 2;
        break;
    case 'O':
        *out++ = letter(hear(l, c - 5, ID, 0));
        break;
    case '-':
        *out++ = letter(hear_nothing(l));
        break;
    case '|':
        e2e_sm_reset(&l->sm);
        l->check = (struct e2e_check){0};
        *out++ = letter(l->sm.state);
        break;
    default:
        fail_msg("%c", what);
    }
    return out;
}

static void assert_goes(const struct profile *p, const char *name, const char *sequence,
                        const char *states)
{
    for (unsigned from = 0; from < p->n_counters; from++) { /* wherever it wraps */
        struct line l = {.profile = p, .counter = p->n_counters * 2 + from};
        char got[128], *end = got;
        for (const char *s = sequence; *s; s++)
            end = happen(&l, *s, end);
        *end = '\0';
        if (strcmp(got, states))
            fail_msg("%s, %s from %u: %s\n gives    %s\n expected %s", p->name, name,
                     from, sequence, got, states);
    }
}

static const struct {
    const char *name, *sequence, *states;
} rows[] = {
    {"as it should", "......", "iiivvv"},
    {"nothing at all", "---", "nnn"},
    {"only damaged ones", "XXXX", "nnnn"},
    {"stuck from the start", ".RRRRRRRRR", "iiiiiiiiii"},
    {"stuck", ".....RRRRRR", "iiivvvxxxxx"},
    {"stuck, and well again", ".....RRR........", "iiivvvxxxxxvvvvv"},
    {"one repeated", ".....R....R...", "iiivvvvvvvvvvv"},
    {"each repeated", ".....R.R.R.R.R", "iiivvvvxxxxxxx"},
    {"one in two lost", ".L.L.L.L.L.", "i i i v v v"},
    {"two in three lost", ".LL.LL.LL.LL.", "i  i  i  v  v"},
    {"three in four lost", ".LLL.LLL.LLL.", "i   i   i   i"},
    {"three lost once", ".....LLL.....", "iiivv   vvvvv"},
    {"three lost twice", ".....LLL..LLL.....", "iiivv   vv   xxxxv"},
    {"two swapped", ".....S.....", "iiivvvvvvvvv"},
    {"two swapped, twice", ".....SS....", "iiivvvvvxxxxv"},
    {"an old one", ".....O.....", "iiivvvxxxxv"},
    {"one damaged", ".....X.....", "iiivvvvvvvv"},
    {"two damaged in four", ".....X.X.....", "iiivvvvxxxxvv"},
    {"damaged in INIT", "..X.....", "iixxxxvv"},
    {"one masquerades", ".....M.....", "iiivvvvvvvv"},
    {"one masquerades beside it", ".....M.M.M.M", "iiivvvvxxxxx"},
    {"one masquerades from the start", "M.M.M.M.M", "nixxxxxxx"},
    {"one check without a frame", ".....-.....", "iiivvvvvvvv"},
    {"two checks without a frame", ".....--......", "iiivvvxxxxvvv"},
    {"well now and then", ".....RR.R.R.R....", "iiivvvxxxxxxxxxxv"},
    {"silence", ".....|....", "iiivvniiiv"},
    {"silence while it is stuck", ".....RRR|.RRRRR", "iiivvvxxniiiiii"},
};

static void what_is_believed_after_each_of_a_sequence_of_frames(void **state)
{
    (void)state;
    for (size_t p = 0; p < 2; p++)
        for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
            assert_goes(&profiles[p], rows[i].name, rows[i].sequence, rows[i].states);
}

static void a_sender_that_counts_well_stays_believed_for_ever(void **state)
{
    (void)state;
    for (size_t p = 0; p < 2; p++) {
        struct line l = {.profile = &profiles[p]};
        for (int i = 0; i < 1000; i++) {
            enum e2e_state s = hear(&l, l.counter++, ID, 0);
            assert_int_equal(s, i < 3 ? E2E_INIT : E2E_VALID);
        }
    }
}

static void each_state_has_a_name(void **state)
{
    (void)state;
    assert_string_equal(e2e_state_text(E2E_NODATA), "no data");
    assert_string_equal(e2e_state_text(E2E_INIT), "init");
    assert_string_equal(e2e_state_text(E2E_VALID), "valid");
    assert_string_equal(e2e_state_text(E2E_INVALID), "invalid");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_believed_after_each_of_a_sequence_of_frames),
        cmocka_unit_test(a_sender_that_counts_well_stays_believed_for_ever),
        cmocka_unit_test(each_state_has_a_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
