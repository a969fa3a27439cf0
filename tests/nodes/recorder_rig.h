/* SPDX-License-Identifier: MIT */
/* tests/nodes/recorder_rig.h -- a recorder without a bus: messages and times as the test
 * gives them. */
#ifndef ANLOS_TESTS_NODES_RECORDER_RIG_H
#define ANLOS_TESTS_NODES_RECORDER_RIG_H

#include "record_rig.h"

#include "hal/survey/file.h"
#include "msgs/convert.h"

#define MS 1000000LL

struct rig {
    struct scratch *scratch;
    struct choice choice;
    struct session session;
    char bag[128];
    char part[128]; /* named last */
    char said[2048];
};

static inline int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scratch_open((void **)&r->scratch) ||
        choice_make(&r->choice, "*", NULL, NULL))
        return -1;
    r->session.topics = "*";
    r->session.start_ns = 1700000000123456789;
    snprintf(r->bag, sizeof r->bag, "%s/a.mcap", r->scratch->folder);
    *state = r;
    return 0;
}

static inline int teardown(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;

    choice_clear(&r->choice);
    session_clear(&r->session);
    free(r);
    return scratch_close(&scratch);
}

static inline void hear(void *context, enum log_level level, const char *text)
{
    struct rig *r = context;
    size_t used = strlen(r->said);

    (void)level;
    snprintf(r->said + used, sizeof r->said - used, "%s\n", text);
}

static inline struct recorder_config config(struct rig *r)
{
    return (struct recorder_config){.path = r->bag,
                                    .topics = r->choice.topics,
                                    .n_topics = r->choice.n,
                                    .flush_ns = 1000 * MS,
                                    .session = &r->session,
                                    .say = hear,
                                    .context = r};
}

static inline struct recorder *start(const struct recorder_config *cfg)
{
    struct error why = {""};
    struct recorder *r;

    if (recorder_create(&r, cfg, 0, &why))
        fail_msg("%s", why.text);
    return r;
}

static inline const char *part_path(struct rig *r, unsigned number)
{
    snprintf(r->part, sizeof r->part, "%s/a_%04u.mcap", r->scratch->folder, number);
    return r->part;
}

/* A survey as the array sends it, with a curve for each microphone. */
static inline struct bus_message survey_message(struct rig *g, uint8_t **payload,
                                                uint64_t seq)
{
    struct bus_message m = {.topic = topic_survey()};
    struct error why = {""};
    struct survey s;
    size_t size;

    scratch_folder(g->scratch, "curves");
    scratch_write(g->scratch, "curves/15454.txt", "100 0.5\n1000 0\n20000 -1.25\n");
    scratch_write(g->scratch, "curves/15715.txt", "100 -0.5\n20000 2\n");
    if (survey_load(&s,
                    scratch_write(g->scratch, "survey.yaml",
                                  "temperature_c: 21.5\nsample_rate_hz: 48000\n"
                                  "chirp: {start_hz: 2000, stop_hz: 20000, "
                                  "duration_s: 0.0625}\nslot_samples: 3000\n"
                                  "speakers_m: [[0, 0, 0], [0, 0.1, 0]]\n"
                                  "microphones_m: [[0.1, 0, 0], [0.1, 0.1, 0]]\n"
                                  "calibration: {folder: curves, serials: "
                                  "[\"15454\", \"15715\"]}\n"
                                  "stage: {axis: [1, 0, 0], positions_m: [0, 0.25]}\n"),
                    &why))
        fail_msg("%s", why.text);
    assert_int_equal(survey_pack(&s, payload, &size), 0);
    survey_clear(&s);
    snprintf(m.envelope.topic, sizeof m.envelope.topic, "survey");
    snprintf(m.envelope.node, sizeof m.envelope.node, "array");
    m.envelope.epoch_ns = EPOCH_NS;
    m.envelope.sequence = seq;
    m.envelope.publish_ns = EPOCH_NS - 1000;
    m.envelope.payload_size = (uint32_t)size;
    m.payload = *payload;
    return m;
}

#define RIG_TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

#endif
