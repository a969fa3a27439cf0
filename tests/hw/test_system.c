/* SPDX-License-Identifier: MIT */
/* The whole system on the drivers of the guest: a sound card whose far end is the
 * simulated room, a stage on GPIO lines, a CAN interface that candump listens to. */
#include "tests/hal/scratch.h"

#include <fcntl.h>
#include <jansson.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/array.pb-c.h"
#include "msgs/bus.h"
#include "msgs/health.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/topics.h"
#include "tests/hw/card.h"
#include "tests/hw/far_end.h"
#include "tests/hw/gpio_rail.h"
#include "tests/hw/room_answer.h"

/* The rail steps by 5 mm, slowly, because each look at its line is dear; its home switch
 * closes at 100, 0 of the stage is 1 above. */
#define STAGE                                                                            \
    "step=sim0&direction=sim1&enable=sim2&home=sim3&limit=sim4&estop=sim5"               \
    "&steps_per_m=200&max=0.25&speed=0.1&acceleration=0.5&home_speed=0.1"                \
    "&pulse_us=20000&settle=0.02"
enum { RAIL_STEPS_PER_M = 200, RAIL_PULSE_US = 20000 };
enum { RAIL_START = 104, RAIL_HOME_AT = 100, RAIL_LIMIT_AT = 160, RAIL_ZERO = 101 };

enum { CHANNELS = 8, AHEAD = 24000, BUFFER_MS = 600, DEADLINE_S = 200 };
static const size_t inputs[] = {3, 2, 1, 0};

/* The geometry of launch/scenes/point.yaml.  A slot holds what comes AHEAD frames late.
 */
#define ARRAY                                                                            \
    "sound_speed_m_s: 343\n"                                                             \
    "sample_rate_hz: 48000\n"                                                            \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03125, phase: cosine}\n"      \
    "slot_samples: 26400\n"                                                              \
    "speakers_m: [[0, 0, 0], [0, 0.08, 0], [0, 0.16, 0], [0, 0.24, 0]]\n"                \
    "microphones_m: [[0.04, 0, 0], [0.04, 0.08, 0], [0.04, 0.16, 0], [0.04, 0.24, 0]]\n" \
    "stage: {axis: [1, 0, 0], positions_m: [0, 0.07, 0.14, 0.21]}\n"                     \
    "wall: {normal: [0, 0, 1], distance_m: 0.8}\n"                                       \
    "gate_m: [0.5, 1.8]\n"                                                               \
    "volume: {x_m: [0.02, 0.24, 0.02], y_m: [0, 0.22, 0.02], z_m: [0.9, 1.5, 0.01]}\n"   \
    "mount: {origin_m: [0, 0, 0.3], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"

static void write_files(struct scratch *s)
{
    char text[1200];
    scratch_write(s, "scene.yaml",
                  ARRAY "seed: 1\nlevel: 0.02\nnoise: {snr_db: 30}\n"
                        "objects:\n  - {name: point, kind: point, "
                        "position_m: [0.13, 0.11, 0.4], scattering_length_m: 0.05}\n");
    snprintf(text, sizeof text,
             ARRAY "latency_samples: %d\n"
                   "device: {format: S32, buffer_ms: %d, inputs: [3, 2, 1, 0]}\n",
             AHEAD, BUFFER_MS);
    scratch_write(s, "rig.yaml", text);
    snprintf(text, sizeof text,
             "nodes: [stage, array, scan, dsp, recon, track, can, report]\n"
             "array: {uri: 'alsa:hw:Loopback,0,0?rig=rig.yaml'}\n"
             "stage: {uri: 'gpiod:%s?" STAGE "'}\n"
             "scan: {background: true}\n"
             "can: {uri: 'socketcan:vcan0'}\n"
             "report: {folder: %s/out}\n",
             getenv("GUEST_GPIOCHIP"), s->folder);
    scratch_write(s, "launch.yaml", text);
}

extern char **environ;

static pid_t start(char *const *argv, const char *output)
{
    pid_t pid;
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, output,
                                     O_WRONLY | O_CREAT | O_TRUNC, 0666);
    posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
    assert_int_equal(posix_spawnp(&pid, argv[0], &files, NULL, argv, environ), 0);
    posix_spawn_file_actions_destroy(&files);
    return pid;
}

/* The system, and what stands around it. */
struct bench {
    struct room_answer room;
    struct gpio_rail *rail;
    struct far_end *far;
    pid_t system, listener; /* candump */
    struct bus *bus;
    pid_t array;    /* process; 0: not heard of */
    uint32_t fired; /* the shot under way */
    size_t before;  /* emissions heard before it */
    uint32_t done;  /* pings */
    bool away;      /* the array says so */
    int n_troubles; /* made so far */
};

/* When the scan fires: a person has taken the objects away, or brought them back, and the
 * rail has carried the array to one of its positions. */
static void set_up_room(struct bench *b, const Anlos__FireCommand *fire)
{
    const struct survey *s = room_survey(b->room.room);
    double at_m = (double)(b->rail->position - RAIL_ZERO) / RAIL_STEPS_PER_M;
    int position = -1;
    for (size_t k = 0; k < s->n_positions; k++)
        if (fabs(s->stage_positions_m[k] - at_m) < 1e-6)
            position = (int)k;
    if (position < 0)
        fail_msg("fired at %.3f m", at_m);
    atomic_store(&b->room.position, position);
    atomic_store(&b->room.pass, fire->pass);
    if (fire->id != b->fired)
        b->before = b->room.n_emissions;
    b->fired = fire->id;
}

static void take(struct bench *b, struct bus_message *m)
{
    ProtobufCMessage *content = bus_message_unpack(m);
    assert_non_null(content);
    if (m->topic == topic_fire()) {
        set_up_room(b, (const Anlos__FireCommand *)content);
    } else if (m->topic == topic_scan_status()) {
        b->done = ((const Anlos__ScanStatus *)content)->pings_done;
    } else {
        const Anlos__Health *health = (const Anlos__Health *)content;
        if (!strcmp(health->node, "array")) {
            b->array = (pid_t)health->pid;
            b->away = strstr(health->text, "it is gone; tries again") != NULL;
        }
    }
    protobuf_c_message_free_unpacked(content, NULL);
}

static void show(struct scratch *s, const char *name)
{
    char line[400];
    FILE *f = fopen(scratch_path(s, name), "r");
    while (f && fgets(line, sizeof line, f))
        print_message("%s", line);
    if (f)
        fclose(f);
}

static int64_t now_s(void)
{
    return clock_now_ns(clock_system()) / 1000000000;
}

/* Follows the system until it ends; its exit status. */
static int follow(struct scratch *s, struct bench *b, void (*trouble)(struct bench *b))
{
    const struct bus_config cfg = {
        .node = "test", .run_dir = s->folder, .listen_only = true};
    struct bus_message m;
    int status;
    assert_int_equal(bus_create(&b->bus, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b->bus, topic_fire()), 0);
    assert_int_equal(bus_subscribe(b->bus, topic_scan_status()), 0);
    assert_int_equal(bus_subscribe(b->bus, topic_health()), 0);
    int64_t end_s = now_s() + DEADLINE_S;
    while (!waitpid(b->system, &status, WNOHANG)) {
        if (now_s() > end_s) {
            show(s, "says");
            fail_msg("the system has not ended after %d s", DEADLINE_S);
        }
        if (!bus_receive(b->bus, &m, 20)) {
            take(b, &m);
            bus_message_free(&m);
        }
        if (trouble)
            trouble(b);
    }
    bus_destroy(b->bus);
    return status;
}

/* Bits of an Intel signal of the DBC, with a sign. */
static int signal_of(uint64_t frame, unsigned first, unsigned n)
{
    int64_t bits = (int64_t)(frame << (64 - first - n));
    return (int)(bits >> (64 - n));
}

/* ObjectState (0x404) of the last list: X at bit 30, 13 bits of 0.02 m, Y at 43, 12 bits,
 * Z at 55, 9 bits of 0.05 m; msgs/can/anlos.dbc. */
static int read_object(struct scratch *s, double at[3])
{
    char line[200], data[32];
    unsigned id, n = 0;
    FILE *f = fopen(scratch_path(s, "candump"), "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f)) {
        uint64_t frame = 0;
        if (sscanf(line, "%*s vcan0 %x#%31s", &id, data) != 2)
            continue;
        if (id == 0x402)
            n = 0; /* a list begins */
        if (id != 0x404)
            continue;
        for (int i = 7; i >= 0; i--) {
            unsigned byte;
            assert_int_equal(sscanf(data + 2 * i, "%2x", &byte), 1);
            frame = frame << 8 | byte;
        }
        n++;
        at[0] = 0.02 * signal_of(frame, 30, 13);
        at[1] = 0.02 * signal_of(frame, 43, 12);
        at[2] = 0.05 * signal_of(frame, 55, 9);
    }
    fclose(f);
    return (int)n;
}

static json_t *read_report(struct scratch *s)
{
    json_error_t error;
    json_t *o = json_load_file(scratch_path(s, "out/report.json"), 0, &error);
    if (!o)
        fail_msg("%s: %s", s->path, error.text);
    return o;
}

static json_int_t pings(const json_t *report, const char *what)
{
    const json_t *n = json_object_get(json_object_get(report, "pings"), what);
    assert_true(json_is_integer(n));
    return json_integer_value(n);
}

/* What the array has counted. */
static json_int_t counted(const json_t *report, const char *what)
{
    const json_t *nodes = json_object_get(report, "nodes"), *node;
    size_t i;
    json_array_foreach(nodes, i, node)
    {
        const json_t *n = json_object_get(json_object_get(node, "device"), what);
        if (!strcmp(json_string_value(json_object_get(node, "node")), "array") && n)
            return json_integer_value(n);
    }
    fail_msg("the array does not say %s", what);
    return 0;
}

/* The rail has gone home and to each position in both passes; no ping is missing; the one
 * object is on the bus within 3 cm. */
static void check_all(struct scratch *s, const struct bench *b)
{
    const struct survey *survey = room_survey(b->room.room);
    const struct room_object *object;
    double at[3] = {NAN, NAN, NAN}, truth[3];
    json_t *report = read_report(s);
    assert_string_equal(json_string_value(json_object_get(report, "state")), "done");
    assert_int_equal(pings(report, "lost"), 0);
    json_decref(report);
    assert_true(b->room.n_emissions >= 2 * survey->n_positions * survey->n_speakers);
    assert_true(b->rail->steps >= 2 * RAIL_STEPS_PER_M * 0.21);
    assert_int_equal(b->rail->unpowered, 0);
    assert_int_equal(room_objects(b->room.room, &object), 1);
    survey_to_vehicle(survey, object->position_m, truth);
    assert_int_equal(read_object(s, at), 1);
    print_message("on the bus at %.2f %.2f %.2f, really at %.3f %.3f %.3f\n", at[0],
                  at[1], at[2], truth[0], truth[1], truth[2]);
    for (int a = 0; a < 3; a++)
        assert_true(fabs(at[a] - truth[a]) <= 0.03);
}

static void bench_open(struct bench *b, struct scratch *s)
{
    char launch[128], says[128], out[128];
    write_files(s);
    *b = (struct bench){.done = 0};
    snprintf(launch, sizeof launch, "%s/launch.yaml", s->folder);
    snprintf(says, sizeof says, "%s/says", s->folder);
    snprintf(out, sizeof out, "%s/candump", s->folder);
    char *const candump[] = {"candump", "-L", "vcan0", NULL};
    char *const system[] = {
        BINARY_DIR "/bin/anlos", "launch", launch, "--run-dir", s->folder, NULL};
    room_answer_create(&b->room, scratch_path(s, "scene.yaml"), CHANNELS, inputs,
                       pow(10, -6 / 20.0));
    b->rail =
        gpio_rail_start(RAIL_START, RAIL_HOME_AT, RAIL_LIMIT_AT, RAIL_PULSE_US, false);
    assert_non_null(b->rail);
    b->far = room_answer_start(&b->room, AHEAD);
    b->listener = start(candump, out);
    b->system = start(system, says);
}

static void bench_close(struct bench *b)
{
    gpio_rail_stop(b->rail);
    room_answer_clear(&b->room);
}

/* Runs it to its end; the far end, the newest where there were two, loses no frame. */
static void bench_run(struct bench *b, struct scratch *s,
                      void (*trouble)(struct bench *b))
{
    int status = follow(s, b, trouble);
    kill(b->listener, SIGTERM);
    waitpid(b->listener, NULL, 0);
    bool broke = far_end_broke(b->far);
    far_end_stop(b->far);
    show(s, "says");
    print_message("%zu emissions, %zu strange samples\n", (size_t)b->room.n_emissions,
                  (size_t)b->room.n_strange);
    assert_int_equal(status, 0);
    assert_false(broke);
}

/* Every sound was a chirp, at its speaker, and no frame was lost. */
static void what_hides_in_the_room_is_found_on_the_bus(void **state)
{
    static struct bench b; /* its threads run on when an assertion fails */
    bench_open(&b, *state);
    bench_run(&b, *state, NULL);
    check_all(*state, &b);
    assert_int_equal(b.room.n_strange, 0);
    json_t *report = read_report(*state);
    assert_int_equal(counted(report, "restarts"), 0);
    assert_int_equal(counted(report, "slots_invalid"), 0);
    assert_int_equal(pings(report, "retaken"), 0);
    json_decref(report);
    bench_close(&b);
}

/* First the array's process stands still for longer than its buffer; then the card is
 * unplugged, and plugged in again when the array has said so. */
static void make_trouble(struct bench *b)
{
    static pthread_t hand;
    bool amid = b->room.n_emissions == b->before + 2; /* of a shot of four */
    if (b->n_troubles == 0 && b->done >= 6 && amid && b->array) {
        kill(b->array, SIGSTOP);
        poll(NULL, 0, 2 * BUFFER_MS);
        kill(b->array, SIGCONT);
        b->n_troubles = 1;
    } else if (b->n_troubles == 1 && b->done >= 20 && amid) {
        assert_false(far_end_broke(b->far));
        card_unplug(&hand);
        b->n_troubles = 2;
    } else if (b->n_troubles == 2 && b->away) {
        far_end_stop(b->far);
        pthread_join(hand, NULL);
        room_answer_forget(&b->room);
        kill(b->array, SIGSTOP); /* the first to open the card chooses its channels */
        card_plug();
        b->far = room_answer_start(&b->room, AHEAD);
        kill(b->array, SIGCONT);
        b->n_troubles = 3;
    }
}

static void a_card_that_stalls_and_is_unplugged_costs_time_only(void **state)
{
    static struct bench b; /* its threads run on when an assertion fails */
    bench_open(&b, *state);
    bench_run(&b, *state, make_trouble);
    assert_int_equal(b.n_troubles, 3);
    check_all(*state, &b);
    json_t *report = read_report(*state);
    assert_true(counted(report, "restarts") > 0);
    assert_true(counted(report, "slots_invalid") > 0);
    assert_true(pings(report, "retaken") >= counted(report, "slots_invalid"));
    assert_int_equal(counted(report, "reopened"), 1);
    json_decref(report);
    bench_close(&b);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_hides_in_the_room_is_found_on_the_bus),
        TEST(a_card_that_stalls_and_is_unplugged_costs_time_only),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
