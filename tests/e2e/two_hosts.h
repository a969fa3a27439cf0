/* SPDX-License-Identifier: MIT */
/* tests/e2e/two_hosts.h -- a system on two hosts, vehicle and computer, with the
 * simulated scene of one point: starts it, and looks at what came of it.  Files are in
 * the scratch folder: HOST.run, HOST.says, and the results of the report in computer. */
#ifndef ANLOS_TESTS_E2E_TWO_HOSTS_H
#define ANLOS_TESTS_E2E_TWO_HOSTS_H

#include "tests/e2e/point.h"

#include <sys/wait.h>
#include <unistd.h>

#include "msgs/bus.h"
#include "msgs/keys.h"
#include "msgs/scan.pb-c.h"

#define DEADLINE_MS 60000

static inline void write_launch(struct scratch *s, const char *vehicle,
                                const char *computer, unsigned port, bool keys)
{
    char text[1024];

    snprintf(text, sizeof text,
             "nodes: [stage, array, scan, dsp, recon, track, can, report]\n"
             "hosts:\n"
             "  - {name: vehicle, endpoint: 'tcp://%s:%u',%s\n"
             "     nodes: [stage, array, scan, can]}\n"
             "  - {name: computer, endpoint: 'tcp://%s:%u',%s\n"
             "     nodes: [dsp, recon, track, report]}\n"
             "array: {uri: 'sim:" SCENE "?pace=real'}\n"
             "stage: {uri: 'sim:?pace=fast'}\n"
             "scan: {background: true}\n",
             vehicle, port, keys ? " keys: keys/vehicle," : "", computer, port,
             keys ? " keys: keys/computer," : "");
    scratch_write(s, "launch.yaml", text);
}

/* What `anlos keys new` makes on each host, and one file of peers for both. */
static inline void make_host_keys(struct scratch *s)
{
    static const char *const names[] = {"vehicle", "computer"};
    char text[256] = "";

    for (size_t i = 0; i < 2; i++) {
        char public[KEYS_TEXT_SIZE], folder[128];
        struct error why = {""};
        snprintf(folder, sizeof folder, "%s/keys/%s", s->folder, names[i]);
        if (keys_create(folder, names[i], public, &why))
            fail_msg("%s", why.text);
        size_t n = strlen(text);
        snprintf(text + n, sizeof text - n, "%s %s\n", names[i], public);
    }
    scratch_write(s, "keys/vehicle/peers", text);
    scratch_write(s, "keys/computer/peers", text);
}

/* `anlos launch --host HOST` in a network namespace, or NULL: in ours. */
static inline pid_t start_in(struct scratch *s, const char *namespace, const char *host)
{
    char launch[128], run_dir[128], out[128], says[128];
    pid_t pid = fork();

    assert_true(pid >= 0);
    if (pid)
        return pid;
    snprintf(launch, sizeof launch, "%s/launch.yaml", s->folder);
    snprintf(run_dir, sizeof run_dir, "%s/%s.run", s->folder, host);
    snprintf(out, sizeof out, "%s/%s", s->folder, host);
    snprintf(says, sizeof says, "%s/%s.says", s->folder, host);
    if (!freopen(says, "a", stdout) || dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
        _exit(98);
    if (namespace)
        execlp("ip", "ip", "netns", "exec", namespace, BINARY_DIR "/bin/anlos", "launch",
               launch, "--host", host, "--run-dir", run_dir, "--out", out, NULL);
    else
        execl(BINARY_DIR "/bin/anlos", "anlos", "launch", launch, "--host", host,
              "--run-dir", run_dir, "--out", out, NULL);
    _exit(99);
}

static inline void read_says(struct scratch *s, const char *host, char *text, size_t size)
{
    char name[64];

    snprintf(name, sizeof name, "%s.says", host);
    FILE *f = fopen(scratch_path(s, name), "r");
    assert_non_null(f);
    text[fread(text, 1, size - 1, f)] = '\0';
    fclose(f);
}

static inline void assert_ends(struct scratch *s, const char *host, pid_t pid, int code)
{
    char text[8192];
    int status;

    assert_int_equal(waitpid(pid, &status, 0), pid);
    read_says(s, host, text, sizeof text);
    if (!WIFEXITED(status) || WEXITSTATUS(status) != code || strstr(text, "Sanitizer") ||
        strstr(text, "runtime error"))
        fail_msg("%s ended with status %x: %s", host, (unsigned)status, text);
}

static inline void assert_says(struct scratch *s, const char *host, const char *part)
{
    char text[8192];

    read_says(s, host, text, sizeof text);
    assert_contains(text, part);
}

static inline json_t *read_json(struct scratch *s, const char *name)
{
    json_error_t error;
    json_t *o = json_load_file(scratch_path(s, name), 0, &error);

    if (!o)
        fail_msg("%s: %s", s->path, error.text);
    return o;
}

static inline void assert_detections(struct scratch *s)
{
    json_t *o = read_json(s, "computer/detections.json");

    assert_point_found(o);
    json_decref(o);
}

/* Every ping was imaged in the end; report.json, to be freed. */
static inline json_t *read_report(struct scratch *s)
{
    json_t *o = read_json(s, "computer/report.json");
    const json_t *pings = json_object_get(o, "pings");
    json_int_t done = json_integer_value(json_object_get(pings, "done"));

    assert_string_equal(json_string_value(json_object_get(o, "state")), "done");
    assert_true(done > 0);
    assert_int_equal(done, json_integer_value(json_object_get(pings, "expected")));
    assert_int_equal(json_integer_value(json_object_get(pings, "lost")), 0);
    return o;
}

/* Until so many pings of the scan are done, by word of a host's run folder. */
static inline void wait_for_pings(struct scratch *s, const char *folder, uint32_t n)
{
    const struct bus_config cfg = {.run_dir = scratch_path(s, folder),
                                   .listen_only = true};
    struct bus *b = NULL;
    uint32_t done = 0;

    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b, topic_scan_status()), 0);
    while (done < n) {
        struct bus_message m;
        assert_int_equal(bus_receive(b, &m, DEADLINE_MS), 0);
        ProtobufCMessage *content = bus_message_unpack(&m);
        assert_non_null(content);
        done = ((const Anlos__ScanStatus *)content)->pings_done;
        protobuf_c_message_free_unpacked(content, NULL);
        bus_message_free(&m);
    }
    bus_destroy(b);
}

#endif
