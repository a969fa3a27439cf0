/* SPDX-License-Identifier: MIT */
/* `anlos can decode` on files of candump. */
#include "tests/hal/scratch.h"

#include <fcntl.h>
#include <jansson.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/can/e2e.h"
#include "msgs/can/frames.h"
#include "nodes/anlos/commands.h"
#include "tests/nodes/command.h"

struct log {
    FILE *f;
    struct can_protection protection;
    int64_t at_us;
};

static struct log begin(struct scratch *s, uint32_t base)
{
    struct log l = {.f = fopen(scratch_path(s, "can.candump"), "w"),
                    .protection = {.base = base},
                    .at_us = 1764000000250000};
    assert_non_null(l.f);
    return l;
}

/* A tenth of a second after the one before, as `candump -L` writes it. */
static void put_raw(struct log *l, const struct can_frame_data *f)
{
    fprintf(l->f, "(%lld.%06lld) can0 %03X#%s", (long long)(l->at_us / 1000000),
            (long long)(l->at_us % 1000000), f->id, f->fd ? "#1" : "");
    for (int i = 0; i < f->size; i++)
        fprintf(l->f, "%02X", f->data[i]);
    putc('\n', l->f);
    l->at_us += 100000;
}

static void put(struct log *l, struct can_frame_data f)
{
    can_protect(&l->protection, &f);
    can_protection_sent(&l->protection, &f);
    put_raw(l, &f);
}

static struct can_frame_data status(uint32_t base)
{
    struct can_frame_data f;
    can_pack_status(&f, base,
                    &(struct can_status){.state = CAN_DEGRADED,
                                         .source = CAN_SIMULATION,
                                         .faults = 1 << CAN_FAULT_WALL_LOST |
                                                   1 << CAN_FAULT_INTERFERENCE,
                                         .temperature_c = NAN,
                                         .sound_speed_m_s = 343.2,
                                         .range_m = 2.6});
    return f;
}

static struct can_frame_data state(double x)
{
    struct can_frame_data f;
    const struct can_object o = {
        .id = 7, .position_m = {x, -1.5, NAN}, .measurement = CAN_MEASURED};
    can_pack_object_state(&f, 0x400, &o);
    return f;
}

static void decode(struct command_result *r, struct scratch *s, struct log *l,
                   const char *a, const char *b)
{
    char *words[] = {"can", "decode", s->path, (char *)a, (char *)b, NULL};
    if (l)
        assert_int_equal(fclose(l->f), 0);
    command_run(r, command_can, words);
}

static void assert_has(const char *text, const char *part)
{
    if (!strstr(text, part))
        fail_msg("\"%s\" is not in\n%s", part, text);
}

static void a_frame_is_a_line_with_names_and_units(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    put(&l, status(0x400));
    put(&l, state(3.2));
    decode(&r, *s, &l, NULL, NULL);
    assert_int_equal(r.code, 0);
    assert_has(r.out, "1764000000.250000  can0  400 Status          ok ");
    assert_has(r.out, " State Degraded, Source Simulation, Faults WallLost+Interference, "
                      "Temperature NotAvailable, SoundSpeed 343.2 m/s, Range 2.6 m, "
                      "Shutdown No\n");
    assert_has(r.out, "1764000000.350000  can0  404 ObjectState     ok ");
    assert_has(r.out, " Id 7, Counter 0, Measurement Measured, X 3.20 m, Y -1.50 m, Z "
                      "NotAvailable\n");
    assert_has(r.out, "400 Status                1 frames\n");
    assert_string_equal(r.err, "");
}

static void an_fd_frame_is_a_line_too(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    struct can_frame_data f;
    const struct can_object o = {.id = 9,
                                 .position_m = {1.0 / 3, NAN, 0},
                                 .covariance_m2 = {0.01, -2e-5, 0, 0, 0, 0},
                                 .class = CAN_PLATE,
                                 .in_free_view = true,
                                 .wall = 3};
    can_pack_object_fd(&f, 0x400, &o);
    put(&l, f);
    decode(&r, *s, &l, NULL, NULL);
    assert_int_equal(r.code, 0);
    assert_has(r.out, " 408 ObjectFD        ok ");
    assert_has(r.out, " InFreeView Yes, Class Plate, ");
    assert_has(r.out, " WallId 3, X 0.3333333 m, Y NotAvailable, Z 0 m, ");
    assert_has(r.out, " CovarianceXX 0.01 m^2, CovarianceXY -2e-05 m^2,");
}

static void json_has_an_object_a_line_and_null_for_the_unknown(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    put(&l, status(0x400));
    decode(&r, *s, &l, "--json", NULL);
    assert_int_equal(r.code, 0);
    char *second = strchr(r.out, '\n') + 1;
    second[-1] = '\0';
    json_t *frame = json_loads(r.out, 0, NULL), *sum = json_loads(second, 0, NULL);
    json_t *signals = json_object_get(frame, "signals");
    assert_non_null(signals);
    assert_string_equal(json_string_value(json_object_get(frame, "name")), "Status");
    assert_string_equal(json_string_value(json_object_get(frame, "e2e")), "ok");
    assert_int_equal(json_integer_value(json_object_get(frame, "id")), 0x400);
    assert_true(json_integer_value(json_object_get(frame, "time_ns")) ==
                1764000000250000000);
    assert_true(json_is_null(json_object_get(signals, "Temperature")));
    assert_true(fabs(json_number_value(json_object_get(signals, "SoundSpeed")) - 343.2) <
                1e-6);
    assert_string_equal(json_string_value(json_object_get(signals, "State")), "Degraded");
    json_t *faults = json_object_get(signals, "Faults");
    assert_int_equal(json_array_size(faults), 2);
    assert_string_equal(json_string_value(json_array_get(faults, 0)), "WallLost");
    assert_string_equal(json_string_value(json_array_get(faults, 1)), "Interference");
    json_t *of_all = json_object_get(json_object_get(sum, "summary"), "messages");
    json_t *of_status = json_object_get(of_all, "Status");
    assert_int_equal(json_integer_value(json_object_get(of_status, "frames")), 1);
    json_decref(sum);
    json_decref(frame);
}

/* Five of a rate of 10 Hz; one repeated, one damaged, three lost: more than two. */
static void what_is_wrong_with_the_protection_is_told_and_counted(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    struct can_frame_data f = status(0x400);
    put(&l, f);
    can_protection_sent(&l.protection, &f);
    put(&l, f);
    l.protection.counters[CAN_ID_STATUS]--;
    put(&l, f);
    for (int i = 0; i < 3; i++)
        can_protection_sent(&l.protection, &f);
    put(&l, f);
    can_protect(&l.protection, &f);
    f.data[7] ^= 1;
    put_raw(&l, &f);
    decode(&r, *s, &l, NULL, NULL);
    assert_int_equal(r.code, 1);
    assert_has(r.out, " some lost ");
    assert_has(r.out, " repeated ");
    assert_has(r.out, " wrong sequence ");
    assert_has(r.out, " wrong CRC ");
    assert_has(r.out,
               "400 Status                5 frames, every 100.0 ms, 1 some lost, 1 "
               "repeated, 1 wrong sequence, 1 wrong CRC\n");
}

static void frames_lost_before_one_are_no_failure(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    struct can_frame_data f = status(0x400);
    put(&l, f);
    can_protection_sent(&l.protection, &f);
    put(&l, f);
    decode(&r, *s, &l, NULL, NULL);
    assert_int_equal(r.code, 0);
    assert_has(r.out, ", 1 some lost\n");
}

static void a_frame_of_another_size_is_said_and_not_read(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    struct can_frame_data f = status(0x400);
    f.size = 5;
    put_raw(&l, &f);
    decode(&r, *s, &l, NULL, NULL);
    assert_int_equal(r.code, 1);
    assert_has(r.out, "wrong size      5 bytes, expected 8\n");
    assert_has(r.out, "1 frames, 1 wrong size\n");
}

static void base_and_sensor_choose_the_identifiers(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x520);
    struct can_frame_data other = status(0x400);
    put(&l, status(0x520));
    put_raw(&l, &other);
    assert_int_equal(fclose(l.f), 0);
    char *words[] = {"can",    "decode", ((struct scratch *)*s)->path,
                     "--base", "500",    "--sensor",
                     "2",      NULL};
    command_run(&r, command_can, words);
    assert_int_equal(r.code, 0);
    assert_has(r.out, " 520 Status          ok ");
    assert_has(r.out, "frames of other identifiers: 1\n");
    decode(&r, *s, NULL, "--base", "0x510");
    assert_int_equal(r.code, 1);
    assert_has(r.err, "no frame of a sensor at 510");
    decode(&r, *s, NULL, "--base", "1024"); /* as 0x1024 it would be too large */
    assert_has(r.out, "400 Status ");
}

static void only_what_is_asked_for_is_printed_but_all_counted(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    put(&l, status(0x400));
    put(&l, state(1));
    decode(&r, *s, &l, "--id", "404");
    assert_int_equal(r.code, 0);
    assert_null(strstr(r.out, "State Degraded"));
    assert_has(r.out, "Measurement Measured");
    assert_has(r.out, "400 Status                1 frames");
    decode(&r, *s, NULL, "--id", "Status");
    assert_has(r.out, "State Degraded");
    assert_null(strstr(r.out, "Measurement Measured"));
}

/* Header, time, and the frames of two objects, without one of them all. */
static void put_list(struct log *l, uint16_t counter, bool fd, int left)
{
    const struct can_object o = {.counter = counter};
    const struct can_list_header h = {.number = 2, .counter = counter};
    struct can_frame_data f[8];
    int n = 2;
    can_pack_list_header(&f[0], 0x400, &h);
    can_pack_time(&f[1], 0x400, 1);
    for (int i = 0; i < 2; i++) {
        if (fd) {
            can_pack_object_fd(&f[n++], 0x400, &o);
            continue;
        }
        can_pack_object_state(&f[n++], 0x400, &o);
        can_pack_object_dynamics(&f[n++], 0x400, &o);
        can_pack_object_quality(&f[n++], 0x400, &o);
    }
    for (int i = 0; i < n; i++)
        if (i != left)
            put(l, f[i]);
}

static void lists_are_found_whole_or_cut(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    struct can_frame_data f;
    put_list(&l, 4094, false, -1);
    put_list(&l, 4095, true, -1);
    can_pack_list_header(&f, 0x400, &(struct can_list_header){.number = 0});
    put(&l, f);
    can_pack_time(&f, 0x400, 1);
    put(&l, f);
    decode(&r, *s, &l, "--id", "Status");
    assert_int_equal(r.code, 0);
    assert_has(r.out, "\nlists: 3 whole, 0 cut\n");
    for (int left = 1; left < 8; left++) {
        l = begin(*s, 0x400);
        put_list(&l, 1, false, left);
        put_list(&l, 2, true, -1);
        decode(&r, *s, &l, "--id", "Status");
        assert_int_equal(r.code, 1);
        assert_has(r.out, "\nlists: 1 whole, 1 cut\n");
    }
}

static void an_object_of_another_list_does_not_complete_one(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    struct can_frame_data f;
    put_list(&l, 1, true, 3);
    can_pack_object_fd(&f, 0x400, &(struct can_object){.counter = 2});
    put(&l, f);
    put_list(&l, 2, true, -1);
    decode(&r, *s, &l, "--id", "Status");
    assert_int_equal(r.code, 1);
    assert_has(r.out, "\nlists: 1 whole, 1 cut\n");
}

static void a_list_is_whole_with_some_motions_or_none(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    struct can_frame_data f[5];
    const struct can_object o = {.counter = 7,
                                 .course_rad = acos(-1) / 2,
                                 .sigma_course_rad = NAN,
                                 .sigma_velocity_m_s = {0.12, 9},
                                 .velocity_correlation = 0.2};
    can_pack_list_header(&f[0], 0x400,
                         &(struct can_list_header){.number = 2, .counter = 7});
    can_pack_time(&f[1], 0x400, 1);
    can_pack_object_motion(&f[2], 0x400, &o);
    can_pack_object_fd(&f[3], 0x400, &o);
    can_pack_object_fd(&f[4], 0x400, &o);
    for (int i = 0; i < 5; i++)
        put(&l, f[i]);
    decode(&r, *s, &l, "--id", "ObjectMotion");
    assert_int_equal(r.code, 0);
    assert_has(r.out, "407 ObjectMotion    ok ");
    assert_has(r.out, "Course 90 deg");
    assert_has(r.out, "SigmaCourse NotAvailable");
    assert_has(r.out, "SigmaVx 0.15 m/s");
    assert_has(r.out, "SigmaVy 6.30 m/s");
    assert_has(r.out, "\nlists: 1 whole, 0 cut\n");
}

/* As candump 2021.08 wrote it, with -ta -x and without anything. */
static void lines_for_the_screen_are_read_too(void **s)
{
    struct command_result r;
    struct can_frame_data f = status(0x400);
    struct can_protection p = {.base = 0x400};
    char bytes[30] = "", text[1000];
    can_protect(&p, &f);
    for (int i = 0; i < 8; i++)
        sprintf(bytes + 3 * i, "%02X ", f.data[i]);
    bytes[23] = '\0';
    snprintf(text, sizeof text,
             " (1764000000.250000)  can0  RX - -  400   [8]  %s   'i@...{..'\n"
             "  can0  400   [8]  %s\n"
             "  can1  400   [8]  remote request\n"
             "  can1  20000004   [8]  00 01 00 00 00 00 00 00   ERRORFRAME\n"
             "  can0  123  [02]  AA BB\n",
             bytes, bytes);
    scratch_write(*s, "can.candump", text);
    decode(&r, *s, NULL, NULL, NULL);
    assert_int_equal(r.code, 1); /* the second one repeats the first */
    assert_has(r.out, "1764000000.250000  can0  400 Status          ok ");
    assert_has(r.out, "\ncan0  400 Status          repeated ");
    assert_has(r.out, "remote, error and 29-bit frames: 2\n");
    assert_has(r.out, "frames of other identifiers: 1\n");
    assert_null(strstr(r.out, "no frames"));
}

static void one_of_several_interfaces_is_chosen(void **s)
{
    struct command_result r;
    struct can_frame_data f = status(0x400);
    struct can_protection p = {.base = 0x400};
    char bytes[17] = "", text[300];
    can_protect(&p, &f);
    for (int i = 0; i < 8; i++)
        sprintf(bytes + 2 * i, "%02x", f.data[i]);
    snprintf(text, sizeof text, "(1.000000) can0 400#%s R\n(1.000100) can1 400#%s T\n",
             bytes, bytes);
    scratch_write(*s, "can.candump", text);
    decode(&r, *s, NULL, NULL, NULL);
    assert_int_equal(r.code, 1);
    decode(&r, *s, NULL, "--interface", "can1");
    assert_int_equal(r.code, 0);
    assert_has(r.out, "1.000100  can1  400 ");
    assert_has(r.out, "Status                1 frames\n");
}

/* Each is one line that is no frame. */
static const char *const nonsense[] = {
    "hello",
    "(1764000000.250000) can0",
    "(1764000000.250000) can0 400",
    "(1764000000.250000) can0 400#0",
    "(1764000000.250000) can0 400#001122334455667788",
    "(1764000000.250000) can0 400#00112233 4455",
    "(1764000000.250000) can0 400#00zz",
    "(1764000000.250000) can0 800#00",
    "(1764000000.250000) can0 40#00",
    "(1764000000.250000) can0 0400#00",
    "(1764000000.250000) can0 408##",
    "(1764000000.25000) can0 400#R99",
    "(17640000000.250000) can0 400#00",
    "(9999999999.250000) can0 400#00",
    "(-1.250000) can0 400#00",
    "(1764000000.) can0 400#00",
    "(1764000000.250000 can0 400#00",
    "(1764000000.250000) an-interface-too-long 400#00",
    "  can0  400   [9]  00 00 00 00 00 00 00 00 00",
    "  can0  400   [8]  00 00 00",
    "  can0  400   [2]  00 00 00",
    "  can0  408  [65]  00",
    "  can0  408  [99",
    "\x01\x02\xff\xfe",
    "(1.0) \x1b[31m 400#00",
};

static void lines_that_are_no_frames_are_counted_and_the_rest_is_read(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    const size_t n = sizeof nonsense / sizeof *nonsense;
    char text[100];
    put(&l, status(0x400));
    for (size_t i = 0; i < n; i++)
        fprintf(l.f, "%s\n", nonsense[i]);
    for (int i = 0; i < 100000; i++) /* one line */
        fputs("(1.0)", l.f);
    fwrite("\nA\0B\n\n", 1, 6, l.f);
    put(&l, status(0x400));
    fputs("(1764000000.250000) can0 400#", l.f); /* cut off */
    decode(&r, *s, &l, NULL, NULL);
    assert_int_equal(r.code, 1);
    snprintf(text, sizeof text, "lines that are no frames: %zu, the first is line 2\n",
             n + 2);
    assert_has(r.out, text);
    assert_has(r.out, "400 Status                3 frames");
    assert_has(r.out, "1 wrong size"); /* the one that was cut off */
}

static void put_text(char text[static 60], struct can_frame_data f)
{
    struct can_protection p = {.base = 0x400};
    char *at = text + sprintf(text, "(1.000000) can0 400#");

    can_protect(&p, &f);
    for (int i = 0; i < 8; i++)
        at += sprintf(at, "%02X", f.data[i]);
    strcpy(at, "\n");
}

/* The writer keeps the pipe open: nothing but the line itself makes it appear. */
static void a_line_through_a_pipe_is_shown_when_it_is_there(void **s)
{
    char line[60], seen[200] = "";
    const char *path = scratch_path(*s, "pipe");
    char *words[] = {"can", "decode", (char *)path, NULL};
    int out, err, code;
    assert_int_equal(mkfifo(path, 0600), 0);
    int fd = open(path, O_RDWR | O_CLOEXEC);
    assert_true(fd >= 0);
    put_text(line, status(0x400));
    pid_t pid = command_start(command_can, words, &out, &err);
    assert_int_equal(write(fd, line, strlen(line)), strlen(line));
    struct pollfd shown = {.fd = out, .events = POLLIN};
    assert_int_equal(poll(&shown, 1, 20000), 1);
    assert_true(read(out, seen, sizeof seen - 1) > 0);
    assert_has(seen, "1.000000  can0  400 Status          ok ");
    assert_int_equal(kill(pid, SIGINT), 0);
    assert_int_equal(waitpid(pid, &code, 0), pid);
    assert_int_equal(WEXITSTATUS(code), 130);
    close(out);
    close(err);
    close(fd);
}

static void an_empty_file_has_nothing_of_the_sensor(void **s)
{
    struct command_result r;
    scratch_write(*s, "can.candump", "");
    decode(&r, *s, NULL, NULL, NULL);
    assert_int_equal(r.code, 1);
    assert_has(r.err, "no frame of a sensor at 400, nor any other");
}

static void a_file_of_another_kind_is_told_from_another_sensors(void **s)
{
    struct command_result r;
    scratch_write(*s, "can.candump", "nodes: [array]\n\x89PNG\n");
    decode(&r, *s, NULL, NULL, NULL);
    assert_int_equal(r.code, 2);
    assert_has(r.err, "no line of it is a frame; expected lines as candump");
    assert_null(strstr(r.err, "--base"));
}

static void wrong_arguments_are_refused(void **s)
{
    struct command_result r;
    struct log l = begin(*s, 0x400);
    put(&l, status(0x400));
    assert_int_equal(fclose(l.f), 0);
    char *path = ((struct scratch *)*s)->path;
    char *none[] = {"can", NULL}, *verb[] = {"can", "encode", path, NULL};
    char *file[] = {"can", "decode", NULL};
    char *two[] = {"can", "decode", path, path, NULL};
    char *away[] = {"can", "decode", "/tmp/no/such/file", NULL};
    char *folder[] = {"can", "decode", "/tmp", NULL};
    char *scheme[] = {"can", "decode", "log:/tmp/no/such/file", NULL};
    char *base[] = {"can", "decode", path, "--base", "7f1", NULL};
    char *low[] = {"can", "decode", path, "--base", "f0", NULL};
    char *text[] = {"can", "decode", path, "--base", "-1", NULL};
    char *many[] = {"can", "decode", path, "--sensor", "64", NULL};
    char *id[] = {"can", "decode", path, "--id", "40a", NULL};
    char *name[] = {"can", "decode", path, "--id", "Statu", NULL};
    char *seconds[] = {"can", "decode", path, "--seconds", "0", NULL};
    char **all[] = {none, verb, file, two,  away, folder, scheme,
                    low,  base, text, many, id,   name,   seconds};
    static const char *const texts[] = {
        "decode is missing",
        "encode: expected decode",
        "expected one file",
        "expected one file",
        "there is no such file, and no interface",
        "directory",
        "expected the file or the interface alone, /tmp/no/such/file",
        "--base f0: expected a hexadecimal number, 100 to 7f0",
        "--base 7f1",
        "--base -1",
        "would end above 7ff",
        "--id 40a",
        "--id Statu",
        "--seconds 0"};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        command_run(&r, command_can, all[i]);
        assert_int_equal(r.code, 2);
        assert_has(r.err, texts[i]);
    }
}

/* As behind `| head` that has seen enough. */
static int decode_for_nobody(int argc, char **argv)
{
    int ends[2];

    if (pipe(ends) || close(ends[0]) || dup2(ends[1], STDOUT_FILENO) < 0)
        return 99;
    return command_can(argc, argv);
}

static void nobody_who_reads_is_no_error_to_talk_about(void **s)
{
    struct command_result r;

    for (int lines = 1; lines < 4000;
         lines += 3000) { /* fewer and more than are buffered */
        struct log l = begin(*s, 0x400);
        for (int i = 0; i < lines; i++)
            put(&l, status(0x400));
        assert_int_equal(fclose(l.f), 0);
        for (int json = 0; json < 2; json++) {
            char *words[] = {"can", "decode", ((struct scratch *)*s)->path,
                             json ? "--json" : NULL, NULL};
            command_run(&r, decode_for_nobody, words);
            assert_int_equal(r.code, 141);
            assert_string_equal(r.err, "");
        }
    }
}

static void help_is_on_stdout(void **s)
{
    (void)s;
    struct command_result r;
    char *words[] = {"can", "--help", NULL};
    command_run(&r, command_can, words);
    assert_int_equal(r.code, 0);
    assert_has(r.out, "exit codes");
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)
    const struct CMUnitTest tests[] = {
        TEST(a_frame_is_a_line_with_names_and_units),
        TEST(an_fd_frame_is_a_line_too),
        TEST(json_has_an_object_a_line_and_null_for_the_unknown),
        TEST(what_is_wrong_with_the_protection_is_told_and_counted),
        TEST(frames_lost_before_one_are_no_failure),
        TEST(a_frame_of_another_size_is_said_and_not_read),
        TEST(base_and_sensor_choose_the_identifiers),
        TEST(only_what_is_asked_for_is_printed_but_all_counted),
        TEST(lists_are_found_whole_or_cut),
        TEST(an_object_of_another_list_does_not_complete_one),
        TEST(a_list_is_whole_with_some_motions_or_none),
        TEST(lines_for_the_screen_are_read_too),
        TEST(one_of_several_interfaces_is_chosen),
        TEST(lines_that_are_no_frames_are_counted_and_the_rest_is_read),
        TEST(a_line_through_a_pipe_is_shown_when_it_is_there),
        TEST(an_empty_file_has_nothing_of_the_sensor),
        TEST(a_file_of_another_kind_is_told_from_another_sensors),
        TEST(wrong_arguments_are_refused),
        TEST(nobody_who_reads_is_no_error_to_talk_about),
        TEST(help_is_on_stdout),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
