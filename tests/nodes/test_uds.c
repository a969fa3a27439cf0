/* SPDX-License-Identifier: MIT */
/* Requests and answers byte by byte, as ISO 14229-1 lays them out: positive answers begin
 * with the service + 0x40 and repeat the sub-function, negative ones are 7F, service,
 * code. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/can/uds.h"

#define S 1000000000LL

/* 2023-11-14 22:13:20 UTC is 0x18bcfe56800 ms after 1970. */
static const struct freeze_frame well = {.unix_ms = 1700000000000,
                                         .state = CAN_ACTIVE,
                                         .latency_s = 0.1,
                                         .noise_db = -60.0,
                                         .snr_db = 25.6,
                                         .range_m = 4.0,
                                         .temperature_c = -12.5};

struct row {
    const char *request, *answer; /* hexadecimal; answer empty: none */
};

/* A sensor that tests the faults image stale (B1A01), channels dead (B1A04) and array
 * away (B1A09), and that has begun: channels were dead, are not any more; the array is
 * away. */
static void troubled(struct trouble_memory *m)
{
    struct freeze_frame f = well;

    trouble_init(m, 1u << CAN_FAULT_IMAGE_STALE | 1u << CAN_FAULT_CHANNELS_DEAD |
                        1u << CAN_FAULT_ARRAY_AWAY);
    f.faults = 1u << CAN_FAULT_CHANNELS_DEAD;
    f.state = CAN_DEGRADED;
    trouble_step(m, &f, true, 1 * S);
    f.faults = 1u << CAN_FAULT_ARRAY_AWAY;
    f.state = CAN_FAULT;
    f.unix_ms += 1000;
    f.latency_s = f.noise_db = f.snr_db = f.range_m = f.temperature_c = NAN;
    trouble_step(m, &f, true, 2 * S);
}

static size_t from_hex(const char *text, uint8_t *out)
{
    size_t n = 0;
    unsigned byte;
    int used;

    for (; sscanf(text, "%2x%n", &byte, &used) == 1; text += used)
        out[n++] = (uint8_t)byte;
    return n;
}

static void to_hex(const uint8_t *data, size_t n, char *out)
{
    *out = '\0';
    for (size_t i = 0; i < n; i++)
        out += sprintf(out, "%s%02X", i ? " " : "", data[i]);
}

static void check_row(struct trouble_memory *m, const struct row *row, bool functional)
{
    uint8_t request[64], answer[UDS_ANSWER_SIZE];
    char text[3 * UDS_ANSWER_SIZE];
    size_t n, size = from_hex(row->request, request);

    uds_answer(m, &well, request, size, functional, answer, &n);
    to_hex(answer, n, text);
    if (strcmp(text, row->answer))
        fail_msg("%s: expected \"%s\", not \"%s\"", row->request, row->answer, text);
}

static void check_rows(const struct row *rows, size_t n, bool functional)
{
    for (size_t i = 0; i < n; i++) {
        struct trouble_memory m;
        troubled(&m);
        check_row(&m, &rows[i], functional);
    }
}

#define CHECK(rows, functional) check_rows(rows, sizeof rows / sizeof *rows, functional)

static void a_tester_finds_the_default_session_alone(void **state)
{
    static const struct row rows[] = {
        {"10 01", "50 01 00 32 01 F4"}, /* 50 ms, and 500 times 10 ms */
        {"10 81", ""},
        {"10 02", "7F 10 12"}, /* programming */
        {"10 03", "7F 10 12"}, /* extended */
        {"10 83", "7F 10 12"},
        {"10 00", "7F 10 12"},
        {"10", "7F 10 13"},
        {"10 01 00", "7F 10 13"},
        {"3E 00", "7E 00"},
        {"3E 80", ""},
        {"3E 01", "7F 3E 12"},
        {"3E", "7F 3E 13"},
        {"3E 00 00", "7F 3E 13"},
        {"3E 80 00", "7F 3E 13"},
    };

    (void)state;
    CHECK(rows, false);
}

static void what_is_no_service_of_a_sensor_is_refused(void **state)
{
    static const struct row rows[] = {
        {"11 01", "7F 11 11"},       /* ECU reset */
        {"27 01", "7F 27 11"},       /* security access */
        {"28 00 01", "7F 28 11"},    /* communication control */
        {"2E F1 90 00", "7F 2E 11"}, /* write data */
        {"2F 01 02 03", "7F 2F 11"}, /* input output control */
        {"34 00 44", "7F 34 11"},    /* download */
        {"85 02", "7F 85 11"},       /* trouble code setting */
        {"00", "7F 00 11"},          /* reserved */
        {"3F", "7F 3F 11"},
        {"BF 01 02 03 04 05 06 07 08", "7F BF 11"},
        {"7F 10 12", ""}, /* answers, of whoever */
        {"50 01 00 32 01 F4", ""},
        {"FF", ""},
        {"", ""},
    };

    (void)state;
    CHECK(rows, false);
}

static void data_is_read_by_identifiers(void **state)
{
    static const struct row rows[] = {
        {"22 F1 86", "62 F1 86 01"},
        {"22 F1 97", "62 F1 97 61 6E 6C 6F 73"}, /* "anlos" */
        {"22 FD 01", "62 FD 01 00 00 01 8B CF E5 68 00"},
        {"22 FD 02", "62 FD 02 02"},
        {"22 FD 03", "62 FD 03 00 00"},
        {"22 FD 04", "62 FD 04 00 64"}, /* 100 ms */
        {"22 FD 05", "62 FD 05 FD A8"}, /* -600 */
        {"22 FD 06", "62 FD 06 01 00"}, /* 256 */
        {"22 FD 07", "62 FD 07 01 90"}, /* 400 cm */
        {"22 FD 08", "62 FD 08 FF 83"}, /* -125 */
        {"22 FD 02 F1 86", "62 FD 02 02 F1 86 01"},
        {"22 F1 8C FD 02", "62 FD 02 02"}, /* what is supported of them */
        {"22 F1 8C", "7F 22 31"},          /* serial number: not known */
        {"22 F1 91", "7F 22 31"},          /* hardware number: not known */
        {"22 FD 00", "7F 22 31"},
        {"22 FD 09", "7F 22 31"},
        {"22 F1 90 F1 8C", "7F 22 31"},
        {"22", "7F 22 13"},
        {"22 F1", "7F 22 13"},
        {"22 F1 86 F1", "7F 22 13"},
    };

    (void)state;
    CHECK(rows, false);
}

static void the_software_version_is_text(void **state)
{
    struct trouble_memory m;
    uint8_t answer[UDS_ANSWER_SIZE];
    const uint8_t request[] = {0x22, 0xf1, 0x95};
    size_t n;

    (void)state;
    troubled(&m);
    assert_int_equal(uds_answer(&m, &well, request, sizeof request, false, answer, &n),
                     0);
    assert_int_equal(n, 3 + strlen(ANLOS_VERSION));
    assert_memory_equal(answer, "\x62\xf1\x95", 3);
    assert_memory_equal(answer + 3, ANLOS_VERSION, n - 3);
}

static void so_many_identifiers_fit_into_an_answer_and_no_more(void **state)
{
    struct trouble_memory m;
    uint8_t answer[UDS_ANSWER_SIZE], request[1 + 2 * (UDS_MAX_IDENTIFIERS + 1)] = {0x22};
    size_t n;

    (void)state;
    troubled(&m);
    for (size_t i = 1; i < sizeof request; i += 2) {
        request[i] = 0xfd;
        request[i + 1] = 0x01;
    }
    assert_int_equal(
        uds_answer(&m, &well, request, sizeof request - 2, false, answer, &n), 0);
    assert_int_equal(n, 1 + UDS_MAX_IDENTIFIERS * 10);
    assert_int_equal(uds_answer(&m, &well, request, sizeof request, false, answer, &n),
                     0x13);
}

static void what_is_not_known_or_beyond_its_number_is_said_so(void **state)
{
    const struct freeze_frame odd = {.latency_s = 1e9,
                                     .noise_db = -INFINITY,
                                     .snr_db = NAN,
                                     .range_m = 327.67,
                                     .temperature_c = NAN};
    const uint8_t request[] = {0x22, 0xfd, 4, 0xfd, 5, 0xfd, 6, 0xfd, 7, 0xfd, 8};
    struct trouble_memory m;
    uint8_t answer[UDS_ANSWER_SIZE];
    char text[3 * UDS_ANSWER_SIZE];
    size_t n;

    (void)state;
    troubled(&m);
    uds_answer(&m, &odd, request, sizeof request, false, answer, &n);
    to_hex(answer, n, text);
    assert_string_equal(text, "62 FD 04 7F FF FD 05 80 01 FD 06 80 00 FD 07 7F FF "
                              "FD 08 80 00");
}

/* B1A01 was tested and never failed: status 0.  B1A04 failed and passed: all of the past,
 * 02 + 04 + 08 + 20.  B1A09 fails: 01 too. */
static void trouble_codes_are_counted_and_listed_by_their_status(void **state)
{
    static const struct row rows[] = {
        {"19 01 FF", "59 01 7F 01 00 02"},
        {"19 01 08", "59 01 7F 01 00 02"},
        {"19 01 01", "59 01 7F 01 00 01"},
        {"19 01 50", "59 01 7F 01 00 00"},
        {"19 01 80", "59 01 7F 01 00 00"}, /* a bit that is not available */
        {"19 01 00", "59 01 7F 01 00 00"},
        {"19 02 FF", "59 02 7F 9A 04 00 2E 9A 09 00 2F"},
        {"19 02 01", "59 02 7F 9A 09 00 2F"},
        {"19 02 40", "59 02 7F"},
        {"19 02 00", "59 02 7F"},
        {"19 0A", "59 0A 7F 9A 01 00 00 9A 04 00 2E 9A 09 00 2F"},
        {"19 82 01", ""},
        {"19 8A", ""},
        {"19 03", "7F 19 12"},
        {"19 06 9A 04 00 FF", "7F 19 12"},
        {"19 00", "7F 19 12"},
        {"19", "7F 19 13"},
        {"19 01", "7F 19 13"},
        {"19 02", "7F 19 13"},
        {"19 02 FF 00", "7F 19 13"},
        {"19 82", "7F 19 13"},
        {"19 0A FF", "7F 19 13"},
    };

    (void)state;
    CHECK(rows, false);
}

static void a_freeze_frame_is_of_the_first_failure(void **state)
{
    static const struct row rows[] = {
        {"19 04 9A 04 00 01",
         "59 04 9A 04 00 2E 01 08 FD 01 00 00 01 8B CF E5 68 00 FD 02 03 FD 03 00 08 "
         "FD 04 00 64 FD 05 FD A8 FD 06 01 00 FD 07 01 90 FD 08 FF 83"},
        {"19 04 9A 09 00 FF", /* a second later, 0x3e8 */
         "59 04 9A 09 00 2F 01 08 FD 01 00 00 01 8B CF E5 6B E8 FD 02 04 FD 03 01 00 "
         "FD 04 80 00 FD 05 80 00 FD 06 80 00 FD 07 80 00 FD 08 80 00"},
        {"19 04 9A 01 00 01", "59 04 9A 01 00 00"}, /* never failed: no record */
        {"19 04 9A 01 00 FF", "59 04 9A 01 00 00"},
        {"19 84 9A 04 00 01", ""},
        {"19 04 9A 04 00 00", "7F 19 31"}, /* records that there cannot be */
        {"19 04 9A 04 00 02", "7F 19 31"},
        {"19 04 9A 04 01 01", "7F 19 31"}, /* no such code */
        {"19 04 9A 02 00 01", "7F 19 31"}, /* one that is not tested here */
        {"19 04 FF FF FF FF", "7F 19 31"},
        {"19 04 9A 04 00", "7F 19 13"},
        {"19 04 9A 04 00 01 00", "7F 19 13"},
        {"19 04", "7F 19 13"},
    };

    (void)state;
    CHECK(rows, false);
}

/* A cleared code was not tested since then: 10 + 40. */
static void codes_are_cleared_one_or_all(void **state)
{
    static const struct row one[] = {
        {"14 9A 04 00", "54"},
        {"19 0A", "59 0A 7F 9A 01 00 00 9A 04 00 50 9A 09 00 2F"},
        {"19 04 9A 04 00 FF", "59 04 9A 04 00 50"},
    };
    static const struct row all[] = {
        {"14 FF FF FF", "54"},
        {"19 0A", "59 0A 7F 9A 01 00 50 9A 04 00 50 9A 09 00 50"},
        {"19 01 2F", "59 01 7F 01 00 00"},
    };
    static const struct row refused[] = {
        {"14 9A 02 00", "7F 14 31"}, /* not tested here */
        {"14 00 00 00", "7F 14 31"}, /* emissions */
        {"14 9A 04 01", "7F 14 31"},
        {"14", "7F 14 13"},
        {"14 FF FF", "7F 14 13"},
        {"14 FF FF FF 00", "7F 14 13"},
        {"19 0A", "59 0A 7F 9A 01 00 00 9A 04 00 2E 9A 09 00 2F"},
    };
    struct trouble_memory m;

    (void)state;
    troubled(&m);
    for (size_t i = 0; i < 3; i++)
        check_row(&m, &one[i], false);
    troubled(&m);
    for (size_t i = 0; i < 3; i++)
        check_row(&m, &all[i], false);
    troubled(&m);
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++)
        check_row(&m, &refused[i], false);
}

static void a_self_test_is_started_and_tells_what_it_found(void **state)
{
    static const struct row rows[] = {
        {"31 03 F0 01", "7F 31 24"}, /* it was not started */
        {"31", "7F 31 13"},
        {"31 01 F0", "7F 31 13"},
        {"31 01 F0 01 00", "7F 31 13"},
        {"31 02 F0 01", "7F 31 12"}, /* it ends by itself */
        {"31 01 F0 02", "7F 31 31"},
        {"31 01 F0 01", "71 01 F0 01"},
        {"31 81 F0 01", ""},
    };
    static const struct {
        int64_t at_ns;
        uint16_t faults;
        bool begun;
        struct row row;
    } steps[] = {
        /* Ten seconds before the sensor has begun; a stale image is none of the elements.
         */
        {10 * S, 0, false, {"31 03 F0 01", "71 03 F0 01 02 00 00"}},
        {20 * S,
         1u << CAN_FAULT_IMAGE_STALE,
         true,
         {"31 03 F0 01", "71 03 F0 01 02 00 00"}},
        {24 * S, 0, true, {"31 03 F0 01", "71 03 F0 01 02 00 00"}},
        {25 * S, 0, true, {"31 03 F0 01", "71 03 F0 01 00 00 00"}},
        /* What comes later is none of it, until it is started again. */
        {26 * S,
         1u << CAN_FAULT_CHANNELS_DEAD,
         true,
         {"31 03 F0 01", "71 03 F0 01 00 00 00"}},
        {27 * S, 0, true, {"31 01 F0 01", "71 01 F0 01"}},
        {28 * S,
         1u << CAN_FAULT_CHANNELS_DEAD,
         true,
         {"31 03 F0 01", "71 03 F0 01 02 00 08"}},
        {29 * S, 0, true, {"31 03 F0 01", "71 03 F0 01 02 00 08"}},
        {33 * S, 0, true, {"31 03 F0 01", "71 03 F0 01 01 00 08"}},
    };
    struct trouble_memory m;
    struct freeze_frame f = well;

    (void)state;
    CHECK(rows, false);
    troubled(&m);
    check_row(&m, &rows[6], false);
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        f.faults = steps[i].faults;
        trouble_step(&m, &f, steps[i].begun, steps[i].at_ns);
        check_row(&m, &steps[i].row, false);
    }
    trouble_init(&m, 0); /* of a replay */
    check_row(&m, &(struct row){"31 01 F0 01", "7F 31 22"}, false);
    check_row(&m, &(struct row){"31 03 F0 01", "7F 31 24"}, false);
}

/* Not supported (11), sub-function not supported (12) and out of range (31) are not said
 * to who asked all; what was done is, and what was wrong in itself. */
static void who_asks_all_hears_of_those_alone_that_can(void **state)
{
    static const struct row rows[] = {
        {"10 01", "50 01 00 32 01 F4"},
        {"10 81", ""},
        {"10 03", ""},
        {"3E 00", "7E 00"},
        {"3E 80", ""},
        {"3E 01", ""},
        {"3E 00 00", "7F 3E 13"},
        {"11 01", ""},
        {"22 F1 8C", ""},
        {"22 F1 86", "62 F1 86 01"},
        {"22 F1", "7F 22 13"},
        {"14 FF FF FF", "54"},
        {"14 9A 02 00", ""},
        {"19 02 01", "59 02 7F 9A 09 00 2F"},
        {"19 03", ""},
        {"19 04 9A 02 00 01", ""},
    };

    (void)state;
    CHECK(rows, true);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tester_finds_the_default_session_alone),
        cmocka_unit_test(what_is_no_service_of_a_sensor_is_refused),
        cmocka_unit_test(data_is_read_by_identifiers),
        cmocka_unit_test(the_software_version_is_text),
        cmocka_unit_test(so_many_identifiers_fit_into_an_answer_and_no_more),
        cmocka_unit_test(what_is_not_known_or_beyond_its_number_is_said_so),
        cmocka_unit_test(trouble_codes_are_counted_and_listed_by_their_status),
        cmocka_unit_test(a_freeze_frame_is_of_the_first_failure),
        cmocka_unit_test(codes_are_cleared_one_or_all),
        cmocka_unit_test(a_self_test_is_started_and_tells_what_it_found),
        cmocka_unit_test(who_asks_all_hears_of_those_alone_that_can),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
