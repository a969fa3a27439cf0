/* SPDX-License-Identifier: MIT */
/* The diagnostic server between a tester and the sensor, with a link of the test's own in
 * the place of the kernel's (--wrap); what is asked and answered, byte by byte, is
 * test_uds.c's. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/can/uds_server.h"
#include "tests/nodes/near.h"

#define S 1000000000LL

static struct link {
    const char *requests[12]; /* each ends with "" */
    size_t sizes[12], n, taken;
    bool functional;
    int send_err;
    size_t n_sent;
    uint8_t sent[12][64];
    size_t sent_sizes[12];
} tester;

int __wrap_isotp_receive(struct isotp *t, uint8_t *data, size_t size, size_t *n,
                         bool *functional, int64_t now_ns);
int __wrap_isotp_receive(struct isotp *t, uint8_t *data, size_t size, size_t *n,
                         bool *functional, int64_t now_ns)
{
    (void)t;
    (void)now_ns;
    if (tester.taken == tester.n)
        return -EAGAIN;
    *n = tester.sizes[tester.taken];
    assert_true(*n <= size);
    memcpy(data, tester.requests[tester.taken++], *n);
    *functional = tester.functional;
    return 0;
}

int __wrap_isotp_send(struct isotp *t, const uint8_t *data, size_t n);
int __wrap_isotp_send(struct isotp *t, const uint8_t *data, size_t n)
{
    (void)t;
    if (tester.send_err)
        return tester.send_err;
    assert_true(tester.n_sent < 12 && n <= sizeof tester.sent[0]);
    memcpy(tester.sent[tester.n_sent], data, n);
    tester.sent_sizes[tester.n_sent++] = n;
    return 0;
}

uint64_t __wrap_isotp_broken(const struct isotp *t);
uint64_t __wrap_isotp_broken(const struct isotp *t)
{
    (void)t;
    return 7;
}

struct world {
    struct watch watch;
    struct diagnosis diagnosis;
    struct uds_server server;
};

static int setup(void **state)
{
    static struct world w;
    static uint8_t somewhere;
    const struct watch_config cfg = {.fixed = true};

    memset(&w, 0, sizeof w);
    memset(&tester, 0, sizeof tester);
    watch_init(&w.watch, &cfg);
    diagnosis_init(&w.diagnosis, 1);
    trouble_init(&w.server.memory, watch_tested(&w.watch));
    w.server.link = (struct isotp *)(void *)&somewhere; /* nobody looks there */
    *state = &w;
    return 0;
}

static void ask(const char *bytes, size_t n)
{
    tester.requests[tester.n] = bytes;
    tester.sizes[tester.n++] = n;
}

static int step(struct world *w, int64_t now_ns)
{
    return uds_server_step(&w->server, &w->watch, &w->diagnosis, now_ns, 5 * S);
}

static uint64_t count_of(const struct world *w, const char *name)
{
    struct device_count counts[UDS_SERVER_COUNTS];

    assert_int_equal(uds_server_counts(&w->server, counts), UDS_SERVER_COUNTS);
    for (size_t i = 0; i < UDS_SERVER_COUNTS; i++)
        if (!strcmp(counts[i].name, name))
            return counts[i].value;
    fail_msg("%s is not counted", name);
    return 0;
}

static void what_was_asked_is_answered_in_its_order_and_counted(void **state)
{
    struct world *w = *state;

    ask("\x3e\x00", 2);
    ask("\x27\x01", 2); /* a service that it does not have */
    ask("\x14\xff\xff\xff", 4);
    assert_int_equal(step(w, S), 0);
    assert_int_equal(tester.n_sent, 3);
    assert_memory_equal(tester.sent[0], "\x7e\x00", 2);
    assert_memory_equal(tester.sent[1], "\x7f\x27\x11", 3);
    assert_memory_equal(tester.sent[2], "\x54", 1);
    assert_int_equal(count_of(w, "diagnosis_requests"), 3);
    assert_int_equal(count_of(w, "diagnosis_refused"), 1);
    assert_int_equal(count_of(w, "diagnosis_unsent"), 0);
    assert_int_equal(count_of(w, "diagnosis_broken"), 7);
    assert_int_equal(w->server.cleared, 1);
}

/* To all servers at once: who cannot is silent, and that is no answer that was not sent.
 */
static void who_asks_all_hears_no_refusal(void **state)
{
    struct world *w = *state;

    tester.functional = true;
    ask("\x27\x01", 2);
    ask("\x3e\x00", 2);
    assert_int_equal(step(w, S), 0);
    assert_int_equal(tester.n_sent, 1);
    assert_int_equal(count_of(w, "diagnosis_refused"), 1);
    assert_int_equal(count_of(w, "diagnosis_unsent"), 0);
}

static void a_tester_that_asks_without_end_waits_for_the_next_step(void **state)
{
    struct world *w = *state;

    for (int i = 0; i < 12; i++)
        ask("\x3e\x00", 2);
    assert_int_equal(step(w, S), 0);
    assert_int_equal(tester.taken, 8);
    assert_int_equal(step(w, S), 0);
    assert_int_equal(tester.taken, 12);
    assert_int_equal(count_of(w, "diagnosis_requests"), 12);
}

static void an_answer_that_the_link_does_not_take_is_told_and_counted(void **state)
{
    struct world *w = *state;

    ask("\x3e\x00", 2);
    tester.send_err = -EBUSY;
    assert_int_equal(step(w, S), -EBUSY);
    assert_int_equal(count_of(w, "diagnosis_unsent"), 1);
    tester.send_err = 0;
    ask("\x3e\x00", 2);
    assert_int_equal(step(w, 2 * S), 0);
    assert_int_equal(tester.n_sent, 1);
    assert_int_equal(count_of(w, "diagnosis_unsent"), 1);
}

static void look(struct world *w, int64_t now_ns)
{
    watch_ambient(&w->watch, 11.0, now_ns);
    watch_step(&w->watch, now_ns);
    assert_int_equal(step(w, now_ns), 0);
}

/* Lists come every 0.1 s, of sound 0.25 s before, the last at 14.9 s; the one after it is
 * missed 0.1 s after it was due, by the vehicle's time, which is 5 s ahead, at 20.1 s. */
static void the_freeze_frame_is_how_the_sensor_did_when_it_failed(void **state)
{
    struct world *w = *state;
    Anlos__ScanStatus scan = ANLOS__SCAN_STATUS__INIT;
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    const struct trouble_code *code = &w->server.memory.codes[CAN_FAULT_IMAGE_STALE];
    int64_t now_ns = 10 * S;

    scan.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    watch_scan(&w->watch, &scan);
    list.mirrored = list.in_vehicle_frame = true;
    for (; now_ns < 15 * S; now_ns += S / 10) {
        watch_list(&w->watch, &list, now_ns - S / 4, now_ns);
        look(w, now_ns);
    }
    assert_false(code->has_frame);
    for (; !code->has_frame && now_ns < 30 * S; now_ns += S / 100)
        look(w, now_ns);
    assert_true(code->has_frame);
    assert_near(code->first.latency_s, 0.25, 1e-9);
    assert_near(code->first.temperature_c, 11.0, 1e-9);
    assert_int_equal(code->first.state, CAN_FAULT);
    assert_int_equal(code->first.faults, 1u << CAN_FAULT_IMAGE_STALE);
    assert_in_range(code->first.unix_ms, 20100, 20120);
}

static void nobody_is_answered_where_there_is_no_link(void **state)
{
    struct world *w = *state;
    struct device_count counts[UDS_SERVER_COUNTS];

    w->server.link = NULL;
    ask("\x3e\x00", 2);
    assert_int_equal(step(w, S), 0);
    assert_int_equal(tester.taken, 0);
    assert_int_equal(uds_server_counts(&w->server, counts), 0);
}

#define TEST(name) cmocka_unit_test_setup(name, setup)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_was_asked_is_answered_in_its_order_and_counted),
        TEST(who_asks_all_hears_no_refusal),
        TEST(a_tester_that_asks_without_end_waits_for_the_next_step),
        TEST(an_answer_that_the_link_does_not_take_is_told_and_counted),
        TEST(the_freeze_frame_is_how_the_sensor_did_when_it_failed),
        TEST(nobody_is_answered_where_there_is_no_link),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
