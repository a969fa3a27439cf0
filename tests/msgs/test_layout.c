/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "dbc.h"
#include "msgs/can/frames.h"

static const struct can_message *message(size_t i)
{
    size_t n;
    const struct can_message *m = can_messages(&n);

    return i < n ? &m[i] : NULL;
}

static void every_message_is_in_the_dbc_and_no_other(void **state)
{
    char line[4000], name[64], sender[64];
    unsigned id, size;

    (void)state;
    for (size_t i = 0; message(i); i++) {
        assert_true(dbc_line("BO_ ", i, line));
        assert_int_equal(
            sscanf(line, "BO_ %u %63[^:]: %u %63s", &id, name, &size, sender), 4);
        assert_string_equal(name, message(i)->name);
        assert_int_equal(id, CAN_BASE_DEFAULT + message(i)->id);
        assert_int_equal(size, message(i)->size);
        assert_string_equal(sender, message(i)->input ? "Vehicle" : "Anlos");
    }
    size_t n;
    can_messages(&n);
    assert_false(dbc_line("BO_ ", n, line));
}

/* "BA_ "Name" BO_ id value;" */
static long attribute(const char *name, uint32_t id)
{
    char line[4000], begin[100];

    snprintf(begin, sizeof begin, "BA_ \"%s\" BO_ %u ", name, id);
    if (!dbc_line(begin, 0, line))
        fail_msg("%s is missing", begin);
    return strtol(line + strlen(begin), NULL, 10);
}

static void attributes_say_cycle_format_and_protection(void **state)
{
    (void)state;
    for (size_t i = 0; message(i); i++) {
        uint32_t id = CAN_BASE_DEFAULT + message(i)->id;
        assert_int_equal(attribute("GenMsgCycleTime", id), message(i)->cycle_ms);
        assert_int_equal(attribute("VFrameFormat", id), message(i)->fd ? 14 : 0);
        assert_int_equal(attribute("E2EProfile", id),
                         message(i)->profile == CAN_PROFILE_05 ? 2 : 1);
        assert_int_equal(attribute("E2EDataId", id), id);
    }
}

/* In the DBC a range is physical; in the table it is raw. */
static void compare(const struct can_message *m, const struct can_signal *s,
                    const struct dbc_signal *d)
{
    bool is_float = s->kind == CAN_SIGNAL_FLOAT;

    if (strcmp(s->name, d->name) != 0 || strcmp(s->unit, d->unit) != 0 ||
        s->start != d->start || s->length != d->length || is_float != d->is_float ||
        (s->min < 0 || is_float) != (d->sign == '-') || s->factor != d->factor ||
        s->offset != d->offset ||
        fabs((double)s->min * s->factor + s->offset - d->min) > 1e-9 ||
        fabs((double)s->max * s->factor + s->offset - d->max) > 1e-9 ||
        strcmp(d->receiver, m->input ? "Anlos" : "Vehicle") != 0)
        fail_msg("%s.%s is not %s of the DBC", m->name, s->name, d->name);
}

static void every_signal_is_in_the_dbc_and_no_other(void **state)
{
    struct dbc_signal d;

    (void)state;
    for (size_t i = 0; message(i); i++) {
        for (size_t k = 0; k < message(i)->n_signals; k++) {
            assert_true(dbc_signal(message(i)->name, NULL, k, &d));
            compare(message(i), &message(i)->signals[k], &d);
        }
        assert_false(dbc_signal(message(i)->name, NULL, message(i)->n_signals, &d));
    }
}

/* As "VAL_ 1024 State 0 "Init" ... 7 "NotAvailable" ;" or nothing. */
static void expected_values(const struct can_message *m, const struct can_signal *s,
                            char text[static 4000])
{
    unsigned id = CAN_BASE_DEFAULT + m->id;
    int n = snprintf(text, 4000, "VAL_ %u %s ", id, s->name), begin = n;

    if (s->kind == CAN_SIGNAL_CHOICE)
        for (int i = 0; s->names[i]; i++)
            n += snprintf(text + n, 100, "%d \"%s\" ", i, s->names[i]);
    if (s->missing != CAN_NEVER_MISSING)
        n += snprintf(text + n, 100, "%lld \"NotAvailable\" ", (long long)s->missing);
    snprintf(text + n, 100, ";\n");
    if (n == begin)
        text[0] = '\0';
}

static void values_have_the_names_of_the_dbc(void **state)
{
    char expected[4000], line[4000], begin[100];
    size_t n_expected = 0;

    (void)state;
    for (size_t i = 0; message(i); i++)
        for (size_t k = 0; k < message(i)->n_signals; k++) {
            const struct can_signal *s = &message(i)->signals[k];
            expected_values(message(i), s, expected);
            snprintf(begin, sizeof begin, "VAL_ %u %s ",
                     CAN_BASE_DEFAULT + (unsigned)message(i)->id, s->name);
            assert_int_equal(dbc_line(begin, 0, line), expected[0] != '\0');
            if (expected[0])
                assert_string_equal(line, expected);
            n_expected += expected[0] != '\0';
        }
    assert_true(dbc_line("VAL_ ", n_expected - 1, line));
    assert_false(dbc_line("VAL_ ", n_expected, line));
}

/* A value table cannot name bits: the comment does. */
static void fault_bits_are_named_in_the_comment(void **state)
{
    const struct can_signal *faults = &can_message_find(0, CAN_ID_STATUS)->signals[5];
    char line[4000], name[100];

    (void)state;
    assert_string_equal(faults->name, "Faults");
    assert_true(dbc_line("CM_ SG_ 1024 Faults ", 0, line));
    for (int i = 0; i < CAN_FAULTS; i++) {
        snprintf(name, sizeof name, " %d %s%s", i, faults->names[i],
                 i + 1 < CAN_FAULTS ? "," : ".");
        assert_non_null(strstr(line, name));
    }
    assert_null(faults->names[CAN_FAULTS]);
    assert_string_equal(faults->names[CAN_FAULT_IMAGE_STALE], "ImageStale");
    assert_string_equal(faults->names[CAN_FAULT_LISTS_DROPPED], "ListsDropped");
}

/* What a double can be, NaN, has a way to be sent. */
static void what_may_be_unknown_has_a_value_for_it(void **state)
{
    (void)state;
    for (size_t i = 0; message(i); i++)
        for (size_t k = 0; k < message(i)->n_signals; k++) {
            const struct can_signal *s = &message(i)->signals[k];
            if (s->member.type == CAN_MEMBER_DOUBLE && s->kind != CAN_SIGNAL_FLOAT)
                assert_true(s->missing < s->min || s->missing > s->max);
            if (s->kind == CAN_SIGNAL_CHOICE || s->kind == CAN_SIGNAL_BITS)
                assert_non_null(s->names);
        }
}

static void a_sensor_finds_its_own_frames_only(void **state)
{
    uint32_t base = CAN_BASE_DEFAULT + 2 * CAN_SENSOR_STEP;

    (void)state;
    assert_string_equal(can_message_find(base, 0x428)->name, "ObjectFD");
    assert_null(can_message_find(base, 0x408));
    assert_null(can_message_find(base, 0x42A));
    assert_null(can_message_find(base, 0x430));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_message_is_in_the_dbc_and_no_other),
        cmocka_unit_test(attributes_say_cycle_format_and_protection),
        cmocka_unit_test(every_signal_is_in_the_dbc_and_no_other),
        cmocka_unit_test(values_have_the_names_of_the_dbc),
        cmocka_unit_test(fault_bits_are_named_in_the_comment),
        cmocka_unit_test(what_may_be_unknown_has_a_value_for_it),
        cmocka_unit_test(a_sensor_finds_its_own_frames_only),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
