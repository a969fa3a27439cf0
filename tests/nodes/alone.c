/* SPDX-License-Identifier: MIT */
#include "tests/nodes/alone.h"

#include "msgs/convert.h"
#include "tests/hal/scratch.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/topics.h"

#define DEADLINE_NS INT64_C(60000000000)

int64_t alone_now_ns(void)
{
    return clock_now_ns(clock_system());
}

struct bus *alone_bus(const char *folder, const char *node)
{
    const struct bus_config cfg = {
        .node = node, .run_dir = folder, .epoch_ns = 1, .listen_only = node == NULL};
    struct bus *b = NULL;

    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    return b;
}

bool alone_is_heard(struct bus *b, const struct topic *t)
{
    struct bus_count counts[24];
    size_t n = bus_counts(b, counts, 24);

    for (size_t i = 0; i < n; i++)
        if (counts[i].published && counts[i].topic == t)
            return counts[i].peers > 0;
    return false;
}

static void become(const struct alone *a, const char *program, const char *launch)
{
    int fd = open(a->log, O_WRONLY | O_CREAT | O_APPEND, 0666);

    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (fd < 0 || dup2(fd, STDERR_FILENO) < 0)
        _exit(127);
    execl(program, program, "--launch", launch, "--run-dir", a->folder, (char *)NULL);
    _exit(127);
}

void alone_start(struct alone *a, const char *folder, const char *node,
                 const char *launch)
{
    char program[512];

    snprintf(program, sizeof program, "%s/bin/anlos-%s", BINARY_DIR, node);
    alone_start_program(a, program, folder, node, launch);
}

void alone_start_program(struct alone *a, const char *program, const char *folder,
                         const char *node, const char *launch)
{
    char path[128];

    *a = (struct alone){
        .folder = folder, .node = node, .end_ns = alone_now_ns() + DEADLINE_NS};
    snprintf(a->log, sizeof a->log, "%s/log", folder);
    snprintf(path, sizeof path, "%s/launch.yaml", folder);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    assert_true(fputs(launch, f) >= 0);
    assert_int_equal(fclose(f), 0);
    a->pid = fork();
    assert_true(a->pid >= 0);
    if (!a->pid)
        become(a, program, path);
    a->listener = alone_bus(folder, NULL);
    assert_int_equal(bus_subscribe(a->listener, topic_health()), 0);
}

bool alone_hear(struct alone *a, struct bus_message *out)
{
    if (waitpid(a->pid, NULL, WNOHANG) || alone_now_ns() >= a->end_ns)
        fail_msg("%s does not go on: %s", a->node, alone_log(a));
    if (bus_receive(a->listener, out, 20))
        return false;
    if (out->topic != topic_health())
        return true;
    if (!strcmp(out->envelope.node, a->node)) {
        if (a->health)
            protobuf_c_message_free_unpacked(&a->health->base, NULL);
        a->health = (Anlos__Health *)bus_message_unpack(out);
        assert_non_null(a->health);
    }
    bus_message_free(out);
    return false;
}

uint64_t alone_device(const struct alone *a, const char *count)
{
    for (size_t i = 0; a->health && i < a->health->n_device; i++)
        if (!strcmp(a->health->device[i]->name, count))
            return a->health->device[i]->value;
    return 0;
}

bool alone_publishes_to(const struct alone *a, const char *topic)
{
    for (size_t i = 0; a->health && i < a->health->n_topics; i++)
        if (a->health->topics[i]->published &&
            !strcmp(a->health->topics[i]->topic, topic))
            return a->health->topics[i]->peers > 0;
    return false;
}

bool alone_is(const struct alone *a, Anlos__Health__State state)
{
    return a->health && a->health->state == state;
}

char *alone_log(const struct alone *a)
{
    char *text = calloc(1, 65536);
    FILE *f = fopen(a->log, "r");

    assert_non_null(text);
    assert_non_null(f);
    assert_true(fread(text, 1, 65535, f) < 65535);
    fclose(f);
    return text;
}

void alone_stop(struct alone *a)
{
    alone_end(a, 0);
}

void alone_end(struct alone *a, int exit_code)
{
    int status;

    kill(a->pid, SIGTERM);
    assert_int_equal(waitpid(a->pid, &status, 0), a->pid);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), exit_code);
    bus_destroy(a->listener);
    if (a->health)
        protobuf_c_message_free_unpacked(&a->health->base, NULL);
}

struct survey alone_survey(void)
{
    static double speakers_m[4][3], microphones_m[16][3], position_m;

    for (int i = 0; i < 4; i++)
        speakers_m[i][0] = i / 3.0 - 0.5;
    for (int i = 0; i < 16; i++)
        microphones_m[i][0] = i / 15.0 - 0.5;
    return (struct survey){.source = SURVEY_SIMULATION,
                           .sound_speed_m_s = 343.0,
                           .temperature_c = 20.0,
                           .sample_rate_hz = 48000.0,
                           .chirp_start_hz = 2000.0,
                           .chirp_stop_hz = 20000.0,
                           .chirp_duration_s = 5e-3,
                           .slot_samples = 1152,
                           .n_speakers = 4,
                           .n_microphones = 16,
                           .n_positions = 1,
                           .speakers_m = speakers_m,
                           .microphones_m = microphones_m,
                           .stage_axis = {1.0, 0.0, 0.0},
                           .stage_positions_m = &position_m,
                           .has_wall = true,
                           .wall_normal = {0.0, 0.0, 1.0},
                           .wall_distance_m = 0.8,
                           .has_volume = true,
                           .volume_m = {{-1, 1, 0.05}, {0, 0, 0.1}, {1, 3, 0.05}}};
}

void alone_tell_survey(struct bus *array, const struct survey *s)
{
    uint8_t *packed;
    size_t size;

    assert_int_equal(survey_pack(s, &packed, &size), 0);
    int err = bus_publish(array, topic_survey(), 0, alone_now_ns(), packed, size);
    free(packed);
    assert_int_equal(err, 0);
}
