/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "msgs/can/e2e.h"

#define ID 0x123

/* Check values of the catalogue of parametrised CRC algorithms, of "123456789".  Profile
 * 11 begins with 0 where CRC-8/SAE-J1850 begins with 0xff and inverts what comes out:
 * what it has first is inverted, and so is the value.  Profile 5 ends with its data ID.
 */
static void the_checksums_are_those_of_the_catalogue(void **state)
{
    uint8_t p11[] = "__23456789", p05[] = "___234567";

    (void)state;
    e2e_p11_protect(p11, 10, 0xc00, 0xe);
    assert_int_equal(p11[1], '1' ^ 0xff);
    assert_int_equal(p11[0], 0x4b ^ 0xff);
    e2e_p05_protect(p05, 9, '9' << 8 | '8', '1');
    assert_int_equal(p05[1] << 8 | p05[0], 0x29b1);
}

static void profile_5_gives_the_bytes_of_the_vector(void **state)
{
    uint8_t data[8] = {0};

    (void)state;
    e2e_p05_protect(data, sizeof data, 0x1234, 0);
    assert_memory_equal(data, ((uint8_t[]){0x1c, 0xca, 0, 0, 0, 0, 0, 0}), 8);
}

static void profile_11_gives_the_bytes_of_the_vectors(void **state)
{
    uint8_t data[8] = {0};

    (void)state;
    e2e_p11_protect(data, sizeof data, ID, 0);
    assert_memory_equal(data, ((uint8_t[]){0x2a, 0x10, 0, 0, 0, 0, 0, 0}), 8);
    e2e_p11_protect(data, sizeof data, ID, 1);
    assert_memory_equal(data, ((uint8_t[]){0x77, 0x11, 0, 0, 0, 0, 0, 0}), 8);
}

static enum e2e_verdict hear_p11(struct e2e_check *c, uint8_t counter)
{
    uint8_t data[8] = {0, 0, 1, 2, 3, 4, 5, 6};

    e2e_p11_protect(data, sizeof data, ID, counter);
    assert_int_equal(data[1] & 0xf, counter);
    return e2e_p11_check(c, data, sizeof data, ID, 3);
}

static enum e2e_verdict hear_p05(struct e2e_check *c, uint8_t counter)
{
    uint8_t data[64] = {[63] = 7};

    e2e_p05_protect(data, sizeof data, ID, counter);
    return e2e_p05_check(c, data, sizeof data, ID, 3);
}

static void counters_go_round_without_a_gap(void **state)
{
    struct e2e_check p11 = {0}, p05 = {0};

    (void)state;
    for (unsigned i = 0; i < 40; i++)
        assert_int_equal(hear_p11(&p11, (uint8_t)(i % 15)), E2E_OK);
    for (unsigned i = 0; i < 600; i++)
        assert_int_equal(hear_p05(&p05, (uint8_t)i), E2E_OK);
}

static void the_first_frame_is_good_whatever_its_counter(void **state)
{
    (void)state;
    for (uint8_t i = 0; i < 15; i++) {
        struct e2e_check p11 = {0}, p05 = {0};
        assert_int_equal(hear_p11(&p11, i), E2E_OK);
        assert_int_equal(hear_p05(&p05, (uint8_t)(17 * i)), E2E_OK);
    }
}

static void as_many_may_get_lost_as_allowed_across_the_wrap(void **state)
{
    (void)state;
    for (uint8_t from = 0; from < 15; from++)
        for (uint8_t delta = 0; delta < 15; delta++) {
            struct e2e_check c = {0};
            hear_p11(&c, from);
            assert_int_equal(hear_p11(&c, (uint8_t)((from + delta) % 15)),
                             delta == 0   ? E2E_REPEATED
                             : delta == 1 ? E2E_OK
                             : delta <= 3 ? E2E_SOME_LOST
                                          : E2E_WRONG_SEQUENCE);
        }
    for (unsigned delta = 0; delta < 256; delta++) {
        struct e2e_check c = {0};
        hear_p05(&c, 254);
        assert_int_equal(hear_p05(&c, (uint8_t)(254 + delta)), delta == 0   ? E2E_REPEATED
                                                               : delta == 1 ? E2E_OK
                                                               : delta <= 3
                                                                   ? E2E_SOME_LOST
                                                                   : E2E_WRONG_SEQUENCE);
    }
}

static void after_a_jump_it_goes_on_from_there(void **state)
{
    struct e2e_check c = {0};

    (void)state;
    hear_p11(&c, 2);
    assert_int_equal(hear_p11(&c, 9), E2E_WRONG_SEQUENCE);
    assert_int_equal(hear_p11(&c, 10), E2E_OK);
    assert_int_equal(hear_p11(&c, 10), E2E_REPEATED);
    assert_int_equal(hear_p11(&c, 11), E2E_OK);
}

static void nothing_new_is_told_and_changes_nothing(void **state)
{
    struct e2e_check c = {0};

    (void)state;
    hear_p11(&c, 5);
    assert_int_equal(e2e_p11_check(&c, NULL, 0, ID, 3), E2E_NO_NEW_DATA);
    assert_int_equal(hear_p11(&c, 6), E2E_OK);
    assert_int_equal(e2e_p05_check(&c, NULL, 0, ID, 3), E2E_NO_NEW_DATA);
}

/* A CRC of n bits knows every burst that is not longer than it. */
static void every_flipped_bit_is_known_and_forgotten(void **state)
{
    struct e2e_check c = {0};
    uint8_t p11[8] = {0, 0, 9, 8, 7, 6, 5, 4}, p05[64] = {[5] = 200, [63] = 1};

    (void)state;
    hear_p11(&c, 5);
    e2e_p11_protect(p11, sizeof p11, ID, 6);
    for (unsigned bit = 0; bit < 64; bit++) {
        p11[bit / 8] ^= (uint8_t)(1 << bit % 8);
        assert_int_equal(e2e_p11_check(&c, p11, sizeof p11, ID, 3), E2E_WRONG_CRC);
        p11[bit / 8] ^= (uint8_t)(1 << bit % 8);
    }
    assert_int_equal(e2e_p11_check(&c, p11, sizeof p11, ID, 3), E2E_OK);
    memset(&c, 0, sizeof c);
    e2e_p05_protect(p05, sizeof p05, ID, 6);
    for (unsigned bit = 0; bit < 512; bit++) {
        p05[bit / 8] ^= (uint8_t)(1 << bit % 8);
        assert_int_equal(e2e_p05_check(&c, p05, sizeof p05, ID, 3), E2E_WRONG_CRC);
        p05[bit / 8] ^= (uint8_t)(1 << bit % 8);
    }
    assert_int_equal(e2e_p05_check(&c, p05, sizeof p05, ID, 3), E2E_OK);
}

/* Each of the 12 and 16 bits of a data ID tells frames apart. */
static void a_frame_of_another_data_id_is_not_taken(void **state)
{
    uint8_t data[8] = {0};
    struct e2e_check c = {0};

    (void)state;
    for (unsigned bit = 0; bit < 12; bit++) {
        e2e_p11_protect(data, sizeof data, (uint16_t)(ID ^ 1 << bit), 3);
        assert_int_equal(e2e_p11_check(&c, data, sizeof data, ID, 3), E2E_WRONG_CRC);
    }
    for (unsigned bit = 0; bit < 16; bit++) {
        e2e_p05_protect(data, sizeof data, (uint16_t)(ID ^ 1 << bit), 3);
        assert_int_equal(e2e_p05_check(&c, data, sizeof data, ID, 3), E2E_WRONG_CRC);
    }
}

static void a_counter_of_15_is_never_sent_and_not_taken(void **state)
{
    uint8_t data[8] = {0, 0x1f}, protected[8] = {0};
    struct e2e_check c = {0};

    (void)state;
    const uint8_t covered[] = {0x23, 0, 0x1f, 0, 0, 0, 0, 0, 0};
    uint8_t crc = 0; /* a table-free second one, from the polynomial */
    for (size_t i = 0; i < sizeof covered * 8; i++) {
        unsigned in = covered[i / 8] >> (7 - i % 8) & 1u;
        unsigned out = crc >> 7;
        crc = (uint8_t)((crc << 1) ^ (in != out ? 0x1d : 0));
    }
    data[0] = crc;
    assert_int_equal(e2e_p11_check(&c, data, sizeof data, ID, 3), E2E_WRONG_CRC);
    e2e_p11_protect(protected, sizeof protected, ID, 15);
    assert_int_equal(protected[1] & 0xf, 0);
}

static void what_is_too_short_is_damaged(void **state)
{
    const uint8_t data[3] = {0};
    struct e2e_check c = {0};

    (void)state;
    assert_int_equal(e2e_p11_check(&c, data, 0, ID, 3), E2E_WRONG_CRC);
    assert_int_equal(e2e_p11_check(&c, data, 1, ID, 3), E2E_WRONG_CRC);
    assert_int_equal(e2e_p05_check(&c, data, 2, ID, 3), E2E_WRONG_CRC);
}

static void the_shortest_frames_are_a_checksum_and_a_counter(void **state)
{
    uint8_t p11[2] = {0}, p05[3] = {0};
    struct e2e_check of_p11 = {0}, of_p05 = {0};

    (void)state;
    e2e_p11_protect(p11, sizeof p11, ID, 3);
    e2e_p05_protect(p05, sizeof p05, ID, 3);
    assert_int_equal(e2e_p11_check(&of_p11, p11, sizeof p11, ID, 3), E2E_OK);
    assert_int_equal(e2e_p05_check(&of_p05, p05, sizeof p05, ID, 3), E2E_OK);
}

static void only_ok_and_some_lost_may_be_used(void **state)
{
    (void)state;
    for (int v = E2E_OK; v <= E2E_WRONG_CRC; v++) {
        assert_int_equal(e2e_is_usable((enum e2e_verdict)v),
                         v == E2E_OK || v == E2E_SOME_LOST);
        assert_true(strlen(e2e_verdict_text((enum e2e_verdict)v)) > 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_checksums_are_those_of_the_catalogue),
        cmocka_unit_test(profile_5_gives_the_bytes_of_the_vector),
        cmocka_unit_test(profile_11_gives_the_bytes_of_the_vectors),
        cmocka_unit_test(counters_go_round_without_a_gap),
        cmocka_unit_test(the_first_frame_is_good_whatever_its_counter),
        cmocka_unit_test(as_many_may_get_lost_as_allowed_across_the_wrap),
        cmocka_unit_test(after_a_jump_it_goes_on_from_there),
        cmocka_unit_test(nothing_new_is_told_and_changes_nothing),
        cmocka_unit_test(every_flipped_bit_is_known_and_forgotten),
        cmocka_unit_test(a_frame_of_another_data_id_is_not_taken),
        cmocka_unit_test(a_counter_of_15_is_never_sent_and_not_taken),
        cmocka_unit_test(what_is_too_short_is_damaged),
        cmocka_unit_test(the_shortest_frames_are_a_checksum_and_a_counter),
        cmocka_unit_test(only_ok_and_some_lost_may_be_used),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
