/* SPDX-License-Identifier: MIT */
/* nodes/recon/steady.c in a process of its own; this one is its array and its dsp. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "msgs/bus.h"
#include "msgs/convert.h"
#include "msgs/tensor.h"
#include "msgs/topics.h"
#include "msgs/traces.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "nodes/recon/steady.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "recon/frontend/compressor.h"
#include "recon/survey.h"

enum { SPEAKERS = 4, MICROPHONES = 16, PINGS = 200, DEADLINE_S = 100 };

struct rig {
    struct scratch *scratch;
    pid_t recon;
    struct bus *array, *dsp, *listener;
    double speakers_m[SPEAKERS][3], microphones_m[MICROPHONES][3], position_m;
    struct survey survey;
    struct trace_format format;
    float complex *silence;
    uint64_t images, skipped, pings; /* as recon's health says */
    uint32_t frame;                  /* of the newest volume; 0: none yet */
    bool ready;
};

static int64_t now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static pid_t start_recon(const struct rig *r)
{
    char launch[512];
    snprintf(launch, sizeof launch, "%s",
             scratch_write(r->scratch, "a.yaml",
                           "nodes: [recon, dsp]\n"
                           "scan: {mode: fixed}\n"
                           "recon: {threads: 1, frames: {every: ping}}\n"));
    pid_t pid = fork();
    if (pid)
        return pid;
    char *argv[] = {(char *)"recon",     (char *)"--launch",         launch,
                    (char *)"--run-dir", (char *)r->scratch->folder, NULL};
    struct node *node;
    struct steady *steady = NULL;
    struct pipeline_config cfg;
    struct error why = {""};
    int err = node_create(&node, "recon", "Images.", 5, argv);
    if (!node)
        _exit(err);
    launchfile_pipeline(&cfg, node_launch(node));
    err = steady_create(&steady, node, &cfg.array);
    _exit(loop_main(node, &steady_loop, steady, err, &why));
}

static void describe(struct rig *r)
{
    struct processing p;
    struct compressor *c;
    for (int j = 0; j < SPEAKERS; j++)
        r->speakers_m[j][0] = j / 3.0 - 0.5;
    for (int i = 0; i < MICROPHONES; i++)
        r->microphones_m[i][0] = i / 15.0 - 0.5;
    r->survey =
        (struct survey){.source = SURVEY_SIMULATION,
                        .sound_speed_m_s = 343.0,
                        .temperature_c = 20.0,
                        .sample_rate_hz = 48000.0,
                        .chirp_start_hz = 2000.0,
                        .chirp_stop_hz = 20000.0,
                        .chirp_duration_s = 5e-3,
                        .slot_samples = 1152,
                        .n_speakers = SPEAKERS,
                        .n_microphones = MICROPHONES,
                        .n_positions = 1,
                        .speakers_m = r->speakers_m,
                        .microphones_m = r->microphones_m,
                        .stage_axis = {1.0, 0.0, 0.0},
                        .stage_positions_m = &r->position_m,
                        .has_volume = true,
                        .volume_m = {{-1.5, 1.5, 0.01}, {0, 0, 0.1}, {1.0, 3.5, 0.01}}};
    assert_int_equal(processing_plan(&p, &r->survey, NULL), 0);
    assert_int_equal(compressor_create(&c, &p, &r->survey, COMPRESSION_MATCHED_FILTER,
                                       WINDOW_HANN, NULL),
                     0);
    compressor_format(c, &r->format);
    compressor_destroy(c);
    r->silence = calloc(MICROPHONES * r->format.n_samples, sizeof *r->silence);
    assert_non_null(r->silence);
}

static struct bus *open_bus(const struct rig *r, const char *node)
{
    const struct bus_config cfg = {.node = node,
                                   .run_dir = r->scratch->folder,
                                   .epoch_ns = 1,
                                   .listen_only = node == NULL};
    struct bus *b = NULL;
    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    return b;
}

static void start(struct rig *r, void **state)
{
    *r = (struct rig){.scratch = *state};
    r->recon = start_recon(r);
    assert_true(r->recon > 0);
    describe(r);
    r->array = open_bus(r, "array");
    r->dsp = open_bus(r, "dsp");
    r->listener = open_bus(r, NULL);
    assert_int_equal(bus_subscribe(r->listener, topic_volume()), 0);
    assert_int_equal(bus_subscribe(r->listener, topics_find("health")), 0);
}

static void stop(struct rig *r)
{
    int status;
    kill(r->recon, SIGTERM);
    assert_int_equal(waitpid(r->recon, &status, 0), r->recon);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    bus_destroy(r->listener);
    bus_destroy(r->dsp);
    bus_destroy(r->array);
    free(r->silence);
}

static void read_health(struct rig *r, const Anlos__Health *h)
{
    if (strcmp(h->node, "recon") != 0)
        return;
    r->ready = r->ready || h->state == ANLOS__HEALTH__STATE__READY;
    for (size_t i = 0; i < h->n_device; i++) {
        if (!strcmp(h->device[i]->name, "images"))
            r->images = h->device[i]->value;
        if (!strcmp(h->device[i]->name, "images skipped"))
            r->skipped = h->device[i]->value;
    }
    for (size_t i = 0; i < h->n_topics; i++)
        if (!strcmp(h->topics[i]->topic, "traces"))
            r->pings = h->topics[i]->messages;
}

/* Takes what recon says for 50 ms, or less when something comes. */
static void hear(struct rig *r)
{
    struct bus_message m;
    if (bus_receive(r->listener, &m, 50))
        return;
    bool is_volume = m.topic == topic_volume();
    ProtobufCMessage *content = bus_message_unpack(&m);
    assert_non_null(content);
    if (is_volume) {
        r->frame = ((Anlos__Volume *)content)->frame;
    } else {
        read_health(r, (Anlos__Health *)content);
    }
    protobuf_c_message_free_unpacked(content, NULL);
    bus_message_free(&m);
}

static void tell_survey(struct rig *r)
{
    uint8_t *packed;
    size_t size;
    assert_int_equal(survey_pack(&r->survey, &packed, &size), 0);
    int err = bus_publish(r->array, topic_survey(), 0, now_ns(), packed, size);
    free(packed);
    assert_int_equal(err, 0);
}

static void tell_traces(struct rig *r, uint32_t k)
{
    struct tensor_view view;
    protobuf_c_boolean masked[MICROPHONES] = {0};
    Anlos__Traces t = ANLOS__TRACES__INIT;
    t.survey_id = survey_id(&r->survey);
    t.scan = 1;
    t.frame = 1 + k / SPEAKERS;
    t.speaker = k % SPEAKERS;
    t.samples =
        tensor_borrow_c64(&view, r->silence, 2, (size_t)MICROPHONES, r->format.n_samples);
    t.t0_s = r->format.t0_s;
    t.rate_hz = r->format.rate_hz;
    t.carrier_hz = r->format.carrier_hz;
    t.n_masked = MICROPHONES;
    t.masked = masked;
    assert_int_equal(bus_publish_message(r->dsp, topic_traces(), 24000000LL * (k + 1),
                                         now_ns(), &t.base),
                     0);
}

static void pings_faster_than_images_skip_images_not_pings(void **state)
{
    struct rig r;
    int64_t end_ns = now_ns() + DEADLINE_S * 1000000000LL;
    start(&r, state);
    while (r.frame == 0) { /* all are connected then */
        assert_true(now_ns() < end_ns);
        tell_survey(&r);
        if (r.ready)
            tell_traces(&r, 0);
        hear(&r);
    }
    for (uint32_t k = SPEAKERS; k < SPEAKERS + PINGS; k++)
        tell_traces(&r, k);
    while (r.pings < PINGS || r.images + r.skipped < r.pings ||
           r.frame < PINGS / SPEAKERS + 1) {
        assert_true(now_ns() < end_ns);
        hear(&r);
    }
    assert_true(r.skipped > 0);
    assert_int_equal(r.images + r.skipped, r.pings);
    stop(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(pings_faster_than_images_skip_images_not_pings,
                                        scratch_open, scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
