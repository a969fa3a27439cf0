/* SPDX-License-Identifier: MIT */
/* A diagnostic tester on the CAN interface of a real kernel: frame by frame, by cansend
 * and candump, and by ISO-TP sockets of the test's own. */
#include "candump.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/isotp.h>
#include <net/if.h>
#include <sys/socket.h>

#include "hal/clock.h"
#include "msgs/bus.h"
#include "msgs/health.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/topics.h"

#define REQUEST    0x7e0
#define RESPONSE   0x7e8
#define FUNCTIONAL 0x7df

struct rig {
    char folder[64], launch[80];
    struct candump dump;
    pid_t node;
    struct bus *bus, *scan; /* of the array, of the scan */
    int tester, to_all;     /* sockets */
};

static int64_t now(void)
{
    return clock_now_ns(clock_system());
}

static void write_launch(struct rig *r, const char *diagnosis)
{
    FILE *f = fopen(r->launch, "w");

    assert_non_null(f);
    fprintf(f,
            "nodes: [can]\n"
            "array: {uri: \"sim:%s/launch/scenes/corner.yaml\"}\n"
            "can: {uri: \"socketcan:can0\"%s}\n",
            SOURCE_DIR, diagnosis);
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

static int open_tester(uint32_t sends, uint32_t hears, uint32_t flags)
{
    struct sockaddr_can a = {.can_family = AF_CAN,
                             .can_ifindex = (int)if_nametoindex("can0")};
    const struct can_isotp_options options = {.flags = flags};
    int fd = socket(PF_CAN, SOCK_DGRAM, CAN_ISOTP);

    assert_true(fd >= 0);
    a.can_addr.tp.tx_id = sends;
    a.can_addr.tp.rx_id = hears;
    assert_int_equal(
        setsockopt(fd, SOL_CAN_ISOTP, CAN_ISOTP_OPTS, &options, sizeof options), 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&a, sizeof a), 0);
    return fd;
}

static void open_testers(struct rig *r)
{
    r->tester = open_tester(REQUEST, RESPONSE, 0);
    r->to_all = open_tester(FUNCTIONAL, 0, CAN_ISOTP_SF_BROADCAST);
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

static void ask(int fd, const char *request)
{
    uint8_t data[64];
    size_t n = from_hex(request, data);

    assert_int_equal(write(fd, data, n), n);
}

/* The next answer, or NULL: none for so long. */
static const char *hear(struct rig *r, int timeout_ms)
{
    static char text[1024];
    uint8_t data[320];
    struct pollfd p = {.fd = r->tester, .events = POLLIN};

    if (poll(&p, 1, timeout_ms) <= 0)
        return NULL;
    ssize_t n = read(r->tester, data, sizeof data);
    if (n < 0)
        return NULL;
    text[0] = '\0';
    for (ssize_t i = 0; i < n; i++)
        sprintf(text + strlen(text), "%s%02X", i ? " " : "", data[i]);
    return text;
}

static void check(struct rig *r, const char *request, const char *answer)
{
    ask(r->tester, request);
    const char *heard = hear(r, DEADLINE_MS);
    assert_non_null(heard);
    assert_string_equal(heard, answer);
}

/* Until the node listens, or listens again; answers to older requests come before. */
static void join(struct rig *r)
{
    const char *heard = NULL;

    for (int64_t end = now() + DEADLINE_MS * 1000000LL; !heard;) {
        if (now() > end)
            fail_msg("nobody answers");
        if (write(r->tester, "\x3e", 2) == 2)
            heard = hear(r, 100);
    }
    while (heard)
        heard = hear(r, 100);
}

/* The fault "array_away" is there, or not, of an array that is scanned. */
static void tell_array(struct rig *r, bool away)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__ScanStatus scan = ANLOS__SCAN_STATUS__INIT;
    Anlos__Fault fault = ANLOS__FAULT__INIT, *faults[] = {&fault};

    scan.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    scan.pass = ANLOS__PASS__SCENE;
    h.node = (char *)"array";
    h.state = ANLOS__HEALTH__STATE__READY;
    fault.name = (char *)"array_away";
    fault.count = fault.of = 1;
    h.faults = faults;
    h.n_faults = away;
    assert_int_equal(
        bus_publish_message(r->scan, topic_scan_status(), now(), now(), &scan.base), 0);
    assert_int_equal(bus_publish_message(r->bus, topic_health(), now(), now(), &h.base),
                     0);
}

/* Tells it until the tester is answered so.  Each question has one answer, and time
 * passes between two: the guest's clock goes on only while all wait. */
static void tell_array_until(struct rig *r, bool away, const char *request,
                             const char *answer)
{
    for (int64_t end = now() + DEADLINE_MS * 1000000LL;;) {
        tell_array(r, away);
        ask(r->tester, request);
        const char *heard = hear(r, DEADLINE_MS);
        assert_non_null(heard);
        if (!strcmp(heard, answer))
            return;
        if (now() > end)
            fail_msg("%s: expected %s, not %s", request, answer, heard);
        assert_null(hear(r, 20));
    }
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    struct error why = {""};

    if (!r)
        return -1;
    *state = r;
    strcpy(r->folder, "/tmp/anlos-uds-XXXXXX");
    if (!mkdtemp(r->folder))
        return -1;
    sprintf(r->launch, "%s/launch.yaml", r->folder);
    run("ip link add can0 type vcan && ip link set can0 up");
    write_launch(r, ", diagnosis: {request: 0x7e0, response: 0x7e8, functional: 0x7df}");
    candump_start(&r->dump, "can0");
    r->node = start_node(r);
    struct bus_config cfg = {.node = "scan", .run_dir = r->folder, .epoch_ns = now()};
    if (bus_create(&r->scan, &cfg, &why))
        return -1;
    cfg.node = "array";
    if (bus_create(&r->bus, &cfg, &why) || bus_subscribe(r->bus, topic_health()))
        return -1;
    open_testers(r);
    join(r);
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    kill(r->node, SIGKILL);
    waitpid(r->node, NULL, 0);
    candump_stop(&r->dump);
    close(r->tester);
    close(r->to_all);
    bus_destroy(r->bus);
    bus_destroy(r->scan);
    free(r);
    return system("ip link del can0");
}

/* The next answer's frame on the bus. */
static const char *read_frame(struct rig *r)
{
    while (strncmp(candump_read(&r->dump), "7E8#", 4))
        ;
    return r->dump.frame + 4;
}

/* ISO 15765-2: length before a single frame; 1, length and six bytes first, then, after
 * flow control (30), 2, sequence and seven bytes; padded. */
static void answers_are_cut_into_frames(void **state)
{
    struct rig *r = *state;

    close(r->tester); /* its flow control */
    r->tester = -1;
    run("cansend can0 7E0#0322F186");
    while (strcmp(read_frame(r), "0462F18601CCCCCC")) /* those of join are before */
        ;
    run("cansend can0 7E0#021001");
    assert_string_equal(read_frame(r), "065001003201F4CC");
    run("cansend can0 7E0#0522F197F186");
    assert_string_equal(read_frame(r), "100B62F197616E6C");
    run("cansend can0 7E0#300000");
    assert_string_equal(read_frame(r), "216F73F18601CCCC");
}

static void a_tester_is_answered_and_refused(void **state)
{
    struct rig *r = *state;

    check(r, "10 01", "50 01 00 32 01 F4");
    check(r, "22 F1 97 F1 86", "62 F1 97 61 6E 6C 6F 73 F1 86 01");
    check(r, "22 F1 86 F1 86 F1 86 F1 86", "62 F1 86 01 F1 86 01 F1 86 01 F1 86 01");
    check(r, "22 F1 8C", "7F 22 31");
    check(r, "11 01", "7F 11 11");
    check(r, "19 03", "7F 19 12");
    check(r, "14 FF", "7F 14 13");
    check(r,
          "22 00 01 00 02 00 03 00 04 00 05 00 06 00 07 00 08 00 09 00 0A 00 0B 00 0C "
          "00 0D 00 0E 00 0F 00 10 00 11 00 12 00 13 00 14",
          "7F 22 13");
    ask(r->tester, "3E 80"); /* no answer before the next one */
    check(r, "3E 00", "7E 00");
}

static void who_asks_all_is_answered_by_who_can(void **state)
{
    struct rig *r = *state;

    ask(r->to_all, "11 01");
    ask(r->to_all, "3E 80");
    ask(r->to_all, "22 F1 86");
    assert_string_equal(hear(r, DEADLINE_MS), "62 F1 86 01");
}

/* 2F: fails, and has; 2E: has; 0x0100: the fault in the freeze frame, in which nobody has
 * told of sound. */
static void a_fault_becomes_a_trouble_code_until_it_is_cleared(void **state)
{
    struct rig *r = *state;
    char frame[400];

    tell_array_until(r, false, "19 04 9A 09 00 01", "59 04 9A 09 00 00");
    check(r, "19 02 2F", "59 02 7F");
    tell_array_until(r, true, "19 02 01", "59 02 7F 9A 09 00 2F");
    ask(r->tester, "19 04 9A 09 00 FF");
    const char *heard = hear(r, DEADLINE_MS);
    assert_non_null(heard);
    snprintf(frame, sizeof frame, "%s", heard);
    assert_memory_equal(frame, "59 04 9A 09 00 2F 01 08 FD 01 ", 30);
    assert_string_equal(frame + 30 + 3 * 8,
                        "FD 02 04 FD 03 01 00 FD 04 80 00 FD 05 80 00 "
                        "FD 06 80 00 FD 07 80 00 FD 08 80 00");
    tell_array_until(r, false, "19 02 08", "59 02 7F 9A 09 00 2E");
    check(r, "14 9A 09 00", "54");
    check(r, "19 02 08", "59 02 7F");
}

/* A tester that gives no flow control; the kernel waits a second for it. */
static void an_answer_that_nobody_takes_is_counted_and_the_next_one_comes(void **state)
{
    struct rig *r = *state;
    int64_t end = now() + DEADLINE_MS * 1000000LL;
    uint64_t broken = 0;

    close(r->tester);
    r->tester = open_tester(0x7e1, RESPONSE, CAN_ISOTP_LISTEN_MODE);
    run("cansend can0 7E0#0522F197F186");
    while (!broken) {
        struct bus_message m;
        assert_true(now() < end);
        if (bus_receive(r->bus, &m, 100))
            continue;
        Anlos__Health *h =
            m.topic == topic_health() ? (Anlos__Health *)bus_message_unpack(&m) : NULL;
        for (size_t i = 0; h && i < h->n_device; i++)
            if (!strcmp(h->device[i]->name, "diagnosis_broken"))
                broken = h->device[i]->value;
        if (h)
            anlos__health__free_unpacked(h, NULL);
        bus_message_free(&m);
    }
    close(r->tester);
    r->tester = open_tester(REQUEST, RESPONSE, 0);
    join(r);
    check(r, "22 F1 86", "62 F1 86 01");
}

static void an_interface_that_was_away_is_answered_on_again(void **state)
{
    struct rig *r = *state;

    run("ip link set can0 down; ip link set can0 up");
    join(r);
    close(r->tester);
    close(r->to_all);
    run("ip link del can0");
    candump_stop(&r->dump);
    run("ip link add can0 type vcan && ip link set can0 up");
    candump_start(&r->dump, "can0");
    open_testers(r);
    join(r);
    check(r, "10 01", "50 01 00 32 01 F4");
    ask(r->to_all, "22 F1 86");
    assert_string_equal(hear(r, DEADLINE_MS), "62 F1 86 01");
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(answers_are_cut_into_frames),
        TEST(a_tester_is_answered_and_refused),
        TEST(who_asks_all_is_answered_by_who_can),
        TEST(a_fault_becomes_a_trouble_code_until_it_is_cleared),
        TEST(an_answer_that_nobody_takes_is_counted_and_the_next_one_comes),
        TEST(an_interface_that_was_away_is_answered_on_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
