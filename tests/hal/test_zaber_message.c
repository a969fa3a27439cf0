/* SPDX-License-Identifier: MIT */
/* The checksums are those that the tests of other programs for the same devices have. */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "hal/stage/zaber_message.h"

static void a_reply_is_cut_into_its_parts(void **state)
{
    struct zaber_message m;
    (void)state;
    assert_int_equal(zaber_parse(&m, "@01 1 07 OK BUSY WR 12345"), 0);
    assert_int_equal(m.kind, ZABER_REPLY);
    assert_int_equal(m.device, 1);
    assert_int_equal(m.axis, 1);
    assert_int_equal(m.id, 7);
    assert_true(m.accepted && m.busy);
    assert_string_equal(m.warning, "WR");
    assert_string_equal(m.data, "12345");
    assert_false(m.has_checksum);
    assert_int_equal(zaber_parse(&m, "@12 0 RJ IDLE -- BADCOMMAND"), 0);
    assert_int_equal(m.device, 12);
    assert_int_equal(m.id, -1);
    assert_false(m.accepted || m.busy);
    assert_string_equal(m.data, "BADCOMMAND");
}

static void alerts_and_info_are_told_from_replies(void **state)
{
    struct zaber_message m;
    (void)state;
    assert_int_equal(zaber_parse(&m, "!01 1 IDLE FS"), 0);
    assert_int_equal(m.kind, ZABER_ALERT);
    assert_string_equal(m.warning, "FS");
    assert_int_equal(zaber_parse(&m, "#01 0 firmware 6.28"), 0);
    assert_int_equal(m.kind, ZABER_INFO);
    assert_string_equal(m.data, "firmware 6.28");
}

static void checksums_are_those_of_the_devices(void **state)
{
    static const char *const lines[] = {"@01 0 OK IDLE -- 0:8D", "@1 3 9 OK IDLE -- 0:61",
                                        "@01 0 OK IDLE -- 7z:0C"};
    struct zaber_message m;
    (void)state;
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        char wrong[64];
        assert_int_equal(zaber_parse(&m, lines[i]), 0);
        assert_true(m.has_checksum);
        strcpy(wrong, lines[i]);
        wrong[4] ^= 1;
        assert_int_equal(zaber_parse(&m, wrong), -EILSEQ);
    }
    assert_int_equal(zaber_parse(&m, "@01 0 OK IDLE -- 0:8"), -EILSEQ);
    assert_int_equal(zaber_parse(&m, "@01 0 OK IDLE -- 0:GG"), -EILSEQ);
}

static void noise_before_a_message_is_passed_over(void **state)
{
    struct zaber_message m;
    (void)state;
    assert_int_equal(zaber_parse(&m, "??x@01 1 03 OK IDLE -- 5"), 0);
    assert_int_equal(m.id, 3);
    /* half a line, and then a whole one */
    assert_int_equal(zaber_parse(&m, "@01 1 02 OK ID@01 1 03 OK IDLE -- 5"), 0);
    assert_int_equal(m.id, 3);
}

static void what_is_no_message_is_refused(void **state)
{
    static const char *const lines[] = {"",
                                        "hello",
                                        "@",
                                        "@01",
                                        "@01 1",
                                        "@01 1 07",
                                        "@01 1 07 OK",
                                        "@01 1 07 OK IDLE",
                                        "@01 1 07 OK IDLE -",
                                        "@01 1 07 OK IDLE --0",
                                        "@01 1 07 NO IDLE -- 0",
                                        "@01 1 07 OK MOVES -- 0",
                                        "@01 1 007 OK IDLE -- 0",
                                        "@123 1 07 OK IDLE -- 0",
                                        "@-1 1 07 OK IDLE -- 0",
                                        "! 1 IDLE --",
                                        ("@01 1 07 OK IDLE -- 0000000000000000000000000"
                                         "0000000000000000000000000000000000000000")};
    struct zaber_message m;
    (void)state;
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        if (zaber_parse(&m, lines[i]) != -EBADMSG)
            fail_msg("\"%s\" was taken for a message", lines[i]);
}

/* The sums by hand: bc of the ASCII codes between '/' and ':'. */
static void a_command_names_device_axis_and_id(void **state)
{
    char text[ZABER_COMMAND_SIZE], command[ZABER_COMMAND_SIZE + 1];
    (void)state;
    assert_int_equal(zaber_format(text, 1, 1, 7, "move abs 1000", false), 22);
    assert_string_equal(text, "/1 1 07 move abs 1000\n");
    assert_int_equal(zaber_format(text, 1, 1, 7, "move abs 1000", true), 25);
    assert_string_equal(text, "/1 1 07 move abs 1000:E9\n");
    memset(command, 'x', sizeof command - 1);
    command[sizeof command - 1] = '\0';
    assert_int_equal(zaber_format(text, 1, 1, 7, command, true), -EMSGSIZE);
}

static void flags_are_told_in_plain_words(void **state)
{
    static const struct {
        const char *flag;
        enum zaber_severity severity;
        const char *part;
    } cases[] = {
        {"--", ZABER_FINE, "nothing"},
        {"FS", ZABER_FAULT, "stalled"},
        {"FD", ZABER_FAULT, "driver"},
        {"WL", ZABER_FAULT, "limit switch"},
        {"WR", ZABER_UNHOMED, "no reference"},
        {"WH", ZABER_UNHOMED, "not homed"},
        {"WT", ZABER_NOTE, "hot"},
        {"NI", ZABER_NOTE, "interrupted"},
        {"FX", ZABER_FAULT, "not known here"},
        {"Q?", ZABER_NOTE, "not known here"},
    };
    const char *words;
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(zaber_warning(cases[i].flag, &words), cases[i].severity);
        assert_non_null(strstr(words, cases[i].part));
    }
    assert_non_null(strstr(zaber_rejection("BADDATA"), "out of its range"));
    assert_string_equal(zaber_rejection("NEWREASON"), "NEWREASON");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_reply_is_cut_into_its_parts),
        cmocka_unit_test(alerts_and_info_are_told_from_replies),
        cmocka_unit_test(checksums_are_those_of_the_devices),
        cmocka_unit_test(noise_before_a_message_is_passed_over),
        cmocka_unit_test(what_is_no_message_is_refused),
        cmocka_unit_test(a_command_names_device_axis_and_id),
        cmocka_unit_test(flags_are_told_in_plain_words),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
