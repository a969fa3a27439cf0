/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/can/diagnosis.h"
#include "tests/nodes/near.h"

#define S 1000000000LL

static void tell(struct diagnosis *d, const char *node, double cpu_s, int64_t now_ns)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;

    h.node = (char *)node;
    h.cpu_s = cpu_s;
    diagnosis_health(d, &h, now_ns);
}

static struct can_diagnosis next(struct diagnosis *d, const struct watch *w, int64_t now)
{
    struct can_diagnosis out;

    diagnosis_next(d, w, now, &out);
    return out;
}

/* Of 2 processors: one node uses half of one, the other a quarter, by the last second. */
static void the_load_is_that_of_all_nodes_over_all_processors(void **state)
{
    struct diagnosis d;
    struct watch w = {.faults = 0};

    (void)state;
    diagnosis_init(&d, 2);
    assert_true(isnan(next(&d, &w, 9 * S).cpu));
    tell(&d, "dsp", 7.0, 10 * S);
    tell(&d, "recon", 3.0, 10 * S);
    tell(&d, "dsp", 7.5, 11 * S);
    tell(&d, "dsp", 7.51, 11 * S + 1000); /* at once, as its state changed */
    tell(&d, "recon", 3.25, 11 * S);
    assert_near(next(&d, &w, 11 * S).cpu, 0.375, 1e-6);
    tell(&d, "dsp", 7.7, 12 * S); /* 0.2 */
    assert_near(next(&d, &w, 12 * S).cpu, 0.225, 1e-6);
}

static void a_node_that_was_started_again_or_is_gone_uses_nothing(void **state)
{
    struct diagnosis d;
    struct watch w = {.faults = 0};

    (void)state;
    diagnosis_init(&d, 1);
    tell(&d, "dsp", 7.0, 10 * S);
    tell(&d, "dsp", 7.5, 11 * S);
    tell(&d, "dsp", 0.1, 12 * S);
    assert_near(next(&d, &w, 12 * S).cpu, 0.0, 1e-9);
    tell(&d, "dsp", 0.6, 13 * S);
    assert_near(next(&d, &w, 13 * S).cpu, 0.5, 1e-6);
    assert_near(next(&d, &w, 17 * S).cpu, 0.0, 1e-9);
}

static void pings_that_got_lost_anywhere_are_counted(void **state)
{
    struct diagnosis d;
    struct watch w = {.faults = 0};
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__TopicCount counts[3], *pointers[3];
    static const char *const topics[] = {"ping", "traces", "ping"};
    Anlos__ScanStatus scan = ANLOS__SCAN_STATUS__INIT;

    (void)state;
    for (size_t i = 0; i < 3; i++) {
        anlos__topic_count__init(&counts[i]);
        counts[i].topic = (char *)topics[i];
        counts[i].gaps = 3;
        counts[i].dropped = 2;
        counts[i].published = i == 2;
        pointers[i] = &counts[i];
    }
    h.node = (char *)"dsp";
    h.topics = pointers;
    h.n_topics = 3;
    scan.pings_lost = 4;
    diagnosis_init(&d, 1);
    diagnosis_health(&d, &h, 1 * S);
    diagnosis_health(&d, &h, 2 * S); /* totals, not increments */
    diagnosis_scan(&d, &scan);
    assert_int_equal(next(&d, &w, 2 * S).dropped, 14);
    h.node = (char *)"view"; /* makes no images */
    diagnosis_health(&d, &h, 2 * S);
    assert_int_equal(next(&d, &w, 2 * S).dropped, 14);
}

static void pings_that_a_node_missed_before_its_restart_stay_counted(void **state)
{
    struct diagnosis d;
    struct watch w = {.faults = 0};
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__TopicCount count = ANLOS__TOPIC_COUNT__INIT, *pointer = &count;

    (void)state;
    count.topic = (char *)"traces";
    h.node = (char *)"recon";
    h.topics = &pointer;
    h.n_topics = 1;
    diagnosis_init(&d, 1);
    count.gaps = 7;
    diagnosis_health(&d, &h, 1 * S);
    count.gaps = 0;
    diagnosis_health(&d, &h, 2 * S);
    assert_int_equal(next(&d, &w, 2 * S).dropped, 7);
    count.gaps = 2;
    diagnosis_health(&d, &h, 3 * S);
    assert_int_equal(next(&d, &w, 3 * S).dropped, 9);
}

static void the_signal_to_noise_is_of_the_strongest_object(void **state)
{
    struct diagnosis d;
    struct watch w = {.faults = 0};
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection a = ANLOS__DETECTION__INIT, b = ANLOS__DETECTION__INIT;
    Anlos__Detection *pointers[] = {&a, &b};

    (void)state;
    diagnosis_init(&d, 1);
    assert_true(isnan(next(&d, &w, S).snr_db));
    a.level_db = 14.0;
    b.level_db = 21.5;
    list.detections = pointers;
    list.n_detections = 2;
    diagnosis_list(&d, &list);
    assert_near(next(&d, &w, S).snr_db, 21.5, 1e-9);
    w.faults = 1u << CAN_FAULT_IMAGE_STALE; /* no list comes any more */
    assert_true(isnan(next(&d, &w, S).snr_db));
    w.faults = 0;
    assert_near(next(&d, &w, S).snr_db, 21.5, 1e-9);
    list.n_detections = 0;
    diagnosis_list(&d, &list);
    assert_true(isnan(next(&d, &w, S).snr_db));
}

static void every_fault_has_its_turn(void **state)
{
    struct diagnosis d;
    struct watch w = {.faults = 1u << CAN_FAULT_WALL_LOST};

    (void)state;
    diagnosis_init(&d, 1);
    assert_int_equal(next(&d, &w, S).trouble, 0);
    w.raised[CAN_FAULT_EGO_MISSING] = 3;
    w.raised[CAN_FAULT_WALL_LOST] = 1;
    for (int i = 0; i < 2; i++) {
        struct can_diagnosis out = next(&d, &w, S);
        assert_int_equal(out.trouble, 1 + CAN_FAULT_EGO_MISSING);
        assert_int_equal(out.trouble_count, 3);
        assert_false(out.trouble_present);
        out = next(&d, &w, S);
        assert_int_equal(out.trouble, 1 + CAN_FAULT_WALL_LOST);
        assert_true(out.trouble_present);
    }
}

static void the_version_is_that_of_the_program(void **state)
{
    struct diagnosis d;
    struct watch w = {.faults = 0};
    char text[32];

    (void)state;
    diagnosis_init(&d, 1);
    struct can_diagnosis out = next(&d, &w, S);
    snprintf(text, sizeof text, "%u.%u.%u", out.version_major, out.version_minor,
             out.version_patch);
    assert_string_equal(text, ANLOS_VERSION);
}

static void each_of_all_faults_has_its_turn(void **state)
{
    bool had[CAN_FAULTS + 1] = {false};
    struct diagnosis d;
    struct watch w = {.faults = 0};

    (void)state;
    diagnosis_init(&d, 1);
    memset(w.raised, 1, sizeof w.raised);
    for (int i = 0; i < CAN_FAULTS; i++)
        had[next(&d, &w, S).trouble] = true;
    for (int i = 1; i <= CAN_FAULTS; i++)
        assert_true(had[i]);
    for (int i = 0; i < CAN_FAULTS; i++) { /* and of one alone that one each time */
        memset(w.raised, 0, sizeof w.raised);
        w.raised[i] = 2;
        for (int k = 0; k < 3; k++)
            assert_int_equal(next(&d, &w, S).trouble, i + 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_load_is_that_of_all_nodes_over_all_processors),
        cmocka_unit_test(a_node_that_was_started_again_or_is_gone_uses_nothing),
        cmocka_unit_test(pings_that_got_lost_anywhere_are_counted),
        cmocka_unit_test(pings_that_a_node_missed_before_its_restart_stay_counted),
        cmocka_unit_test(the_signal_to_noise_is_of_the_strongest_object),
        cmocka_unit_test(every_fault_has_its_turn),
        cmocka_unit_test(each_of_all_faults_has_its_turn),
        cmocka_unit_test(the_version_is_that_of_the_program),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
