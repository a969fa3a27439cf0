/* SPDX-License-Identifier: MIT */
/* The can node on the CAN interfaces of a real kernel, seen by candump: lists of the
 * test's own are published, and the bus is disturbed. */
#include "candump.h"

#include <errno.h>
#include <math.h>

#include "hal/canbus.h"
#include "hal/clock.h"
#include "msgs/bus.h"
#include "msgs/can/e2e.h"
#include "msgs/detections.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/topics.h"
#include "msgs/vehicle.pb-c.h"

#define OBJECTS 3
#define JOINED  0x400 /* counters of lists to join with are below */

struct rig {
    char folder[64], launch[80];
    struct candump dump;
    pid_t node;
    struct bus *bus;
    Anlos__Health *health; /* the newest of the node, that was taken, */
    int64_t health_ns;     /* and when it was published */
    double speed_m_s;      /* the highest that was said while that was waited for */
    /* What a receiver has of a list, as README.md tells it to. */
    unsigned counter;   /* of the list that is read; 0: one to join with */
    unsigned low;       /* bits of it, as they are on the bus */
    unsigned n_joining; /* lists that were published to join with */
    size_t missing;
};

static int64_t now(void)
{
    return clock_now_ns(clock_system());
}

static void write_launch(struct rig *r, const char *uri)
{
    FILE *f = fopen(r->launch, "w");

    assert_non_null(f);
    fprintf(f,
            "nodes: [can]\n"
            "array: {uri: \"sim:%s/launch/scenes/corner.yaml\"}\n"
            "can: {uri: \"%s\"}\n",
            SOURCE_DIR, uri);
    assert_int_equal(fclose(f), 0);
}

static pid_t start_node(struct rig *r)
{
    char *argv[] = {
        BINARY_DIR "/bin/anlos-can", "--launch", r->launch, "--run-dir", r->folder, NULL};
    pid_t pid;

    assert_int_equal(posix_spawn(&pid, argv[0], NULL, NULL, argv, environ), 0);
    return pid;
}

/* A list of OBJECTS objects, or an empty one. */
/* Counters rise on the bus, so those of lists to join with, counter 0, come before. */
static void publish(struct rig *r, uint32_t counter, size_t n)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection d[CAN_MAX_OBJECTS], *pointers[CAN_MAX_OBJECTS];
    Anlos__Vec3 position = ANLOS__VEC3__INIT;

    position.x = 4.0;
    position.y = -1.5;
    position.z = 0.5;
    for (size_t i = 0; i < n; i++) {
        anlos__detection__init(&d[i]);
        d[i].id = (uint32_t)i + 1;
        d[i].position_m = &position;
        d[i].existence = 0.75;
        pointers[i] = &d[i];
    }
    list.counter = counter ? JOINED + counter : r->n_joining++;
    list.detections = pointers;
    list.n_detections = n;
    list.mirrored = list.in_vehicle_frame = true;
    assert_int_equal(
        bus_publish_message(r->bus, topic_detections(), 1500000000, now(), &list.base),
        0);
}

/* NaN: it is no motion of the vehicle. */
static double speed_of(const struct bus_message *m)
{
    double speed_m_s = NAN;

    if (m->topic != topic_ego())
        return speed_m_s;
    Anlos__EgoMotion *ego = (Anlos__EgoMotion *)bus_message_unpack(m);
    assert_non_null(ego);
    speed_m_s = ego->speed_m_s;
    anlos__ego_motion__free_unpacked(ego, NULL);
    return speed_m_s;
}

static void take_health(struct rig *r, int timeout_ms)
{
    struct bus_message m;

    if (bus_receive(r->bus, &m, timeout_ms))
        return;
    r->speed_m_s = fmax(r->speed_m_s, speed_of(&m));
    if (m.topic == topic_health() && !strcmp(m.envelope.node, "can")) {
        if (r->health)
            anlos__health__free_unpacked(r->health, NULL);
        r->health = (Anlos__Health *)bus_message_unpack(&m);
        assert_non_null(r->health);
        r->health_ns = m.envelope.publish_ns;
    }
    bus_message_free(&m);
}

/* Those that waited tell of earlier than now. */
static void take_news(struct rig *r)
{
    int64_t asked_ns = now(), end = asked_ns + DEADLINE_MS * 1000000LL;

    while (r->health_ns <= asked_ns) {
        assert_true(now() < end);
        take_health(r, 100);
    }
}

/* Waits until the node's health says so. */
static void wait_for_text(struct rig *r, const char *text)
{
    int64_t end = now() + DEADLINE_MS * 1000000LL;

    while (!r->health || !strstr(r->health->text, text)) {
        if (now() > end)
            fail_msg("\"%s\" is not in \"%s\"", text, r->health ? r->health->text : "");
        take_health(r, 100);
    }
}

static uint64_t count_of(const struct rig *r, const char *name)
{
    for (size_t i = 0; r->health && i < r->health->n_device; i++)
        if (!strcmp(r->health->device[i]->name, name))
            return r->health->device[i]->value;
    return 0;
}

static void wait_for_count(struct rig *r, const char *name, uint64_t value)
{
    int64_t end = now() + DEADLINE_MS * 1000000LL;

    while (count_of(r, name) < value) {
        if (now() > end)
            fail_msg("%s is %d", name, (int)count_of(r, name));
        take_health(r, 100);
    }
}

/* Takes in a frame; true: now a list is whole. */
static bool receive_frame(struct rig *r, const char *frame)
{
    unsigned id, data[8] = {0};
    int n = sscanf(frame, "%3x#%2x%2x%2x%2x%2x%2x%2x%2x", &id, &data[0], &data[1],
                   &data[2], &data[3], &data[4], &data[5], &data[6], &data[7]);

    if (n != 9 || id < 0x402 || id > 0x406)
        return false;
    if (id == 0x402) {
        r->missing = 1 + 3 * (data[2] & 0x3f);
        unsigned counter = data[3] | (data[4] & 0xf) << 8;
        r->counter = counter > JOINED ? counter - JOINED : 0;
        r->low = counter & 0xf;
    } else if (r->missing) {
        assert_true(id == 0x403 || (data[3] & 0xf) == r->low);
        return --r->missing == 0;
    }
    return false;
}

/* Reads up to the end of the next list that is whole; returns its counter. */
static unsigned read_list(struct rig *r)
{
    while (!receive_frame(r, candump_read(&r->dump)))
        ;
    return r->counter;
}

/* Until a list comes out at the other end. */
static void join(struct rig *r)
{
    for (int i = 0; i < JOINED; i++) {
        publish(r, 0, 0);
        while (candump_next(&r->dump, 20))
            if (receive_frame(r, r->dump.frame))
                return;
    }
    fail_msg("the node sends no list");
}

static unsigned read_list_after_joining(struct rig *r)
{
    unsigned counter = 0;

    while (!counter)
        counter = read_list(r);
    return counter;
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    struct error why = {""};

    if (!r)
        return -1;
    *state = r;
    strcpy(r->folder, "/tmp/anlos-can-XXXXXX");
    if (!mkdtemp(r->folder))
        return -1;
    sprintf(r->launch, "%s/launch.yaml", r->folder);
    run("ip link add can0 type vcan && ip link set can0 up");
    write_launch(r, "socketcan:can0");
    candump_start(&r->dump, "can0");
    r->node = start_node(r);
    const struct bus_config cfg = {
        .node = "track", .run_dir = r->folder, .epoch_ns = now()};
    if (bus_create(&r->bus, &cfg, &why) || bus_subscribe(r->bus, topic_health()))
        return -1;
    join(r);
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    kill(r->node, SIGKILL);
    waitpid(r->node, NULL, 0);
    candump_stop(&r->dump);
    bus_destroy(r->bus);
    if (r->health)
        anlos__health__free_unpacked(r->health, NULL);
    free(r);
    return system("ip link del can0");
}

/* Without the two bytes of the protection, which counts what went before. */
static void format_frame(char *text, const struct can_frame_data *f)
{
    text += sprintf(text, "%03X#", f->id);
    for (size_t i = 2; i < f->size; i++)
        text += sprintf(text, "%02X", f->data[i]);
}

/* The next frame of a list, likewise. */
static const char *read_frame(struct rig *r)
{
    char *frame = r->dump.frame;

    do
        candump_read(&r->dump);
    while (!strncmp(frame, "400#", 4) || !strncmp(frame, "401#", 4));
    receive_frame(r, frame);
    memmove(frame + 4, frame + 8, strlen(frame + 8) + 1);
    return frame;
}

/* Seconds in a time frame, in the text of read_frame(). */
static double read_time(const char *text)
{
    unsigned b[6] = {0};

    assert_int_equal(
        sscanf(text, "403#%2x%2x%2x%2x%2x%2x", &b[0], &b[1], &b[2], &b[3], &b[4], &b[5]),
        6);
    return b[0] + 256.0 * b[1] + 65536.0 * b[2] + (b[4] + 256.0 * b[5]) / 65536;
}

/* All but the header, of which age and cycle are known when it goes out, and the time,
 * which is that of the vehicle, by a clock that may be ahead or behind by a little. */
static void a_list_is_on_the_bus_as_the_encoder_makes_it(void **state)
{
    struct rig *r = *state;
    struct can_object o = {.counter = 0x123 & 0xff,
                           .position_m = {4.0, -1.5, 0.5},
                           .measurement = CAN_NEW,
                           .existence = 0.75,
                           .velocity_m_s = {NAN, NAN},
                           .sigma_m = {NAN, NAN},
                           .sigma_v_m_s = NAN,
                           .correlation = NAN,
                           .length_m = NAN,
                           .width_m = NAN};
    struct can_frame_data f[3 * OBJECTS];
    char expected[40];

    for (uint8_t i = 0; i < OBJECTS; i++) {
        o.id = i + 1;
        can_pack_object_state(&f[3 * i], 0x400, &o);
        can_pack_object_dynamics(&f[3 * i + 1], 0x400, &o);
        can_pack_object_quality(&f[3 * i + 2], 0x400, &o);
    }
    publish(r, 0x123, OBJECTS);
    do
        read_frame(r);
    while (strncmp(r->dump.frame, "402#", 4) || r->counter != 0x123);
    assert_int_equal(r->missing, 1 + 3 * OBJECTS);
    assert_true(fabs(read_time(read_frame(r)) - 1.5) <= 0.01);
    for (size_t i = 0; i < sizeof f / sizeof *f; i++) {
        format_frame(expected, &f[i]);
        assert_string_equal(read_frame(r), expected);
    }
}

/* Another node on the bus. */
struct vehicle {
    struct canbus *bus;
    struct can_protection protection;
    struct can_frame_data frame; /* as it was sent last */
};

static void vehicle_open(struct vehicle *v)
{
    *v = (struct vehicle){.protection = {.base = 0x400}};
    assert_int_equal(canbus_open(&v->bus, "socketcan:can0", NULL), 0);
}

static void vehicle_tell(struct vehicle *v, double speed_m_s, uint8_t damage)
{
    const struct can_ego_motion ego = {.speed_m_s = speed_m_s,
                                       .yaw_rate_rad_s = 0.1,
                                       .standstill = CAN_ROLLS,
                                       .validity = CAN_VALID};

    can_pack_ego_motion(&v->frame, 0x400, &ego);
    can_protect(&v->protection, &v->frame);
    can_protection_sent(&v->protection, &v->frame);
    v->frame.data[7] ^= damage;
    assert_int_equal(canbus_send(v->bus, &v->frame, now()), 0);
}

/* Tells its motion every 20 ms, or nothing (NAN), until the node says it on. */
static void tell_until(struct rig *r, struct vehicle *v, double speed_m_s, bool valid)
{
    int64_t end = now() + DEADLINE_MS * 1000000LL;
    bool said = false;

    while (!said) {
        struct bus_message m;
        assert_true(now() < end);
        if (!isnan(speed_m_s))
            vehicle_tell(v, speed_m_s, 0);
        if (bus_receive(r->bus, &m, 20))
            continue;
        if (m.topic == topic_ego()) {
            Anlos__EgoMotion *ego = (Anlos__EgoMotion *)bus_message_unpack(&m);
            assert_non_null(ego);
            said = ego->valid == valid &&
                   (isnan(speed_m_s) || fabs(ego->speed_m_s - speed_m_s) < 0.006);
            anlos__ego_motion__free_unpacked(ego, NULL);
        }
        bus_message_free(&m);
    }
}

static void the_motion_of_the_vehicle_is_said_on_until_it_ends(void **state)
{
    struct rig *r = *state;
    struct vehicle v;

    assert_int_equal(bus_subscribe(r->bus, topic_ego()), 0);
    vehicle_open(&v);
    tell_until(r, &v, 1.25, true);
    tell_until(r, &v, -2.0, true);
    tell_until(r, &v, NAN, false); /* silence */
    tell_until(r, &v, 3.0, true);
    canbus_close(v.bus);
}

static void damaged_and_foreign_frames_are_counted_and_not_said(void **state)
{
    struct rig *r = *state;
    struct vehicle v;

    assert_int_equal(bus_subscribe(r->bus, topic_ego()), 0);
    vehicle_open(&v);
    tell_until(r, &v, 1.0, true);
    for (int i = 0; i < 5; i++)
        vehicle_tell(&v, 9.0, 0x10);
    const struct can_frame_data other = {.id = 0x123, .size = 8};
    assert_int_equal(canbus_send(v.bus, &other, now()), 0);
    wait_for_count(r, "inputs_wrong", 5);
    assert_int_equal(count_of(r, "foreign_frames"), 0);
    assert_true(r->speed_m_s < 2.0);
    canbus_close(v.bus);
}

static void a_bus_with_errors_is_used_and_said(void **state)
{
    struct rig *r = *state;

    run("cansend can0 20000004#0008000000000000");
    wait_for_text(r, "can0 has many errors");
    assert_int_equal(r->health->state, ANLOS__HEALTH__STATE__DEGRADED);
    run("cansend can0 20000004#0020000000000000");
    wait_for_text(r, "can0 is error passive");
    publish(r, 1, OBJECTS);
    assert_int_equal(read_list_after_joining(r), 1);
    run("cansend can0 20000004#0040000000000000");
    wait_for_text(r, "ready");
    assert_int_equal(count_of(r, "error_warning"), 1);
    assert_int_equal(count_of(r, "error_passive"), 1);
}

/* From the bus-off on no frame of a list, until the controller restarts or, when that
 * took a second, a status frame tried whether it works. */
static void a_bus_that_is_off_gets_its_lists_after_the_restart(void **state)
{
    struct rig *r = *state;
    bool works = false;

    run("cansend can0 20000040#0000000000000000");
    wait_for_text(r, "can0 is bus-off");
    run("cansend can0 7FE#"); /* what is before this may have left before the node knew */
    publish(r, 1, OBJECTS);
    publish(r, 2, 0);
    run("cansend can0 20000100#0000000000000000");
    while (strncmp(candump_read(&r->dump), "20000040#", 9))
        ;
    while (strcmp(candump_read(&r->dump), "7FE#"))
        works = works || !strncmp(r->dump.frame, "400#", 4);
    do {
        candump_read(&r->dump);
        works = works || !strncmp(r->dump.frame, "20000100#", 9) ||
                !strncmp(r->dump.frame, "400#", 4);
        assert_true(works || r->dump.frame[0] != '4');
    } while (!receive_frame(r, r->dump.frame) || !r->counter);
    assert_int_equal(r->counter, 1);
    assert_int_equal(read_list(r), 2);
    wait_for_text(r, "ready");
    assert_int_equal(count_of(r, "bus_off"), 1);
    assert_int_equal(count_of(r, "restarts"), 1);
}

static void a_restart_that_nobody_tells_of_is_found_out(void **state)
{
    struct rig *r = *state;

    run("cansend can0 20000040#0000000000000000");
    wait_for_text(r, "can0 is bus-off");
    publish(r, 1, OBJECTS);
    assert_int_equal(read_list_after_joining(r), 1);
    wait_for_text(r, "ready");
    assert_int_equal(count_of(r, "restarts"), 0);
}

static void an_interface_that_was_down_gets_the_newest_lists_whole(void **state)
{
    struct rig *r = *state;

    wait_for_text(r, "ready");
    uint64_t sent = count_of(r, "lists_sent");
    run("ip link set can0 down");
    wait_for_text(r, "can0 is down");
    for (unsigned i = 1; i <= 6; i++)
        publish(r, i, OBJECTS);
    wait_for_count(r, "lists_dropped", 2);
    run("ip link set can0 up");
    for (unsigned i = 3; i <= 6; i++)
        assert_int_equal(read_list_after_joining(r), i);
    wait_for_count(r, "lists_sent", sent + 4);
    assert_int_equal(count_of(r, "link_down"), 1);
}

static void an_interface_that_was_deleted_is_found_again(void **state)
{
    struct rig *r = *state;

    run("ip link del can0");
    wait_for_text(r, "can0 is gone");
    candump_stop(&r->dump);
    run("ip link add can0 type vcan && ip link set can0 up");
    candump_start(&r->dump, "can0");
    wait_for_count(r, "reopened", 1);
    publish(r, 7, OBJECTS);
    assert_int_equal(read_list_after_joining(r), 7);
}

/* Ten frames in the queue, as of a real controller; of 20kbit 150 a second, with which
 * two lists take more than a second. */
static void make_slow(const char *rate)
{
    run("tc qdisc add dev can0 root tbf rate %s burst 64 limit 160", rate);
}

static void a_bus_that_is_too_slow_gets_whole_lists_in_order(void **state)
{
    enum { N = 12 };
    struct rig *r = *state;
    unsigned last = 0;
    size_t n = 0;

    wait_for_text(r, "ready");
    make_slow("20kbit");
    for (unsigned i = 1; i <= N; i++)
        publish(r, i, 20);
    while (last < N) {
        unsigned counter = read_list_after_joining(r);
        assert_true(counter > last);
        assert_int_equal(r->missing, 0);
        last = counter;
        n++;
    }
    wait_for_count(r, "lists_sent", n);
    wait_for_count(r, "lists_dropped", N - n);
    take_news(r);
    assert_int_equal(count_of(r, "lists_dropped"), N - n);
    assert_true(n < N);
    assert_true(count_of(r, "no_buffer") > 0);
    assert_int_equal(count_of(r, "lists_cut"), 0);
    assert_int_equal(count_of(r, "frames_unconfirmed"), 0);
}

/* The queue of the interface is thrown away with what is in it.  All of the list takes
 * three seconds. */
static void a_list_that_was_torn_is_sent_again_whole(void **state)
{
    struct rig *r = *state;

    make_slow("4kbit");
    publish(r, 1, 20);
    do
        candump_read(&r->dump);
    while (strncmp(r->dump.frame, "404#", 4));
    run("ip link set can0 down");
    wait_for_text(r, "can0 is down");
    run("tc qdisc del dev can0 root; ip link set can0 up");
    assert_int_equal(read_list_after_joining(r), 1);
    wait_for_text(r, "ready");
    assert_true(count_of(r, "frames_unconfirmed") > 0);
}

/* As when no other node acknowledges: the controller sends the same frame for ever. */
static void a_bus_that_lets_nothing_through_is_said_and_tried_again(void **state)
{
    struct rig *r = *state;

    run("tc qdisc add dev can0 root tbf rate 8bit burst 16 limit 160");
    publish(r, 1, OBJECTS);
    wait_for_text(r, "can0 let no frame through for a second");
    publish(r, 2, OBJECTS);
    run("tc qdisc del dev can0 root");
    assert_int_equal(read_list_after_joining(r), 1);
    assert_int_equal(read_list(r), 2);
    wait_for_text(r, "ready");
}

static int end_of(pid_t pid)
{
    int status;

    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* Lists wait, and can wait for a long time. */
static void a_node_ends_at_once_when_the_bus_is_dead(void **state)
{
    struct rig *r = *state;

    make_slow("4kbit");
    for (unsigned i = 1; i <= 8; i++)
        publish(r, i, CAN_MAX_OBJECTS);
    wait_for_count(r, "lists_dropped", 1);
    int64_t t = now();
    kill(r->node, SIGINT);
    assert_int_equal(end_of(r->node), 0);
    assert_true(now() - t < 10000000000); /* the lists take 13 s, and 100 ms is allowed */
    r->node = start_node(r);
    run("ip link set can0 down");
    wait_for_text(r, "can0 is down");
    kill(r->node, SIGTERM);
    assert_int_equal(end_of(r->node), 0);
    r->node = start_node(r);
}

static void an_interface_that_never_was_there_is_a_mistake(void **state)
{
    struct rig *r = *state;

    kill(r->node, SIGTERM);
    end_of(r->node);
    write_launch(r, "socketcan:can7");
    assert_int_equal(end_of(start_node(r)), 2);
    r->node = start_node(r);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_list_is_on_the_bus_as_the_encoder_makes_it),
        TEST(the_motion_of_the_vehicle_is_said_on_until_it_ends),
        TEST(damaged_and_foreign_frames_are_counted_and_not_said),
        TEST(a_bus_with_errors_is_used_and_said),
        TEST(a_bus_that_is_off_gets_its_lists_after_the_restart),
        TEST(a_restart_that_nobody_tells_of_is_found_out),
        TEST(an_interface_that_was_down_gets_the_newest_lists_whole),
        TEST(an_interface_that_was_deleted_is_found_again),
        TEST(a_bus_that_is_too_slow_gets_whole_lists_in_order),
        TEST(a_list_that_was_torn_is_sent_again_whole),
        TEST(a_bus_that_lets_nothing_through_is_said_and_tried_again),
        TEST(a_node_ends_at_once_when_the_bus_is_dead),
        TEST(an_interface_that_never_was_there_is_a_mistake),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
