/* SPDX-License-Identifier: MIT */
/* The dsp node's program: what a slam drowns is counted in its health, and the array's
 * self-test is told there. */
#include "tests/hal/scratch.h"
#include "tests/nodes/alone.h"

#include <math.h>

#include "dsp/chirp.h"
#include "hal/random.h"
#include "msgs/array.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/topics.h"
#include "recon/processing.h"
#include "recon/tail.h"

enum { MICROPHONES = 16, SAMPLES = 1152 * 2, SLOT_NS = 24000000 };

struct rig {
    struct alone dsp;
    struct bus *array;
    struct survey survey;
    struct random random;
    uint32_t frame;
};

/* Direct sound of one speaker, and of the next, at all microphones but one. */
static void add_direct(const struct rig *r, float *samples, size_t n, size_t speaker,
                       size_t dead)
{
    const struct survey *s = &r->survey;
    const struct chirp chirp = processing_chirp(s);
    static float heard[SAMPLES];
    size_t n_chirp = chirp_length(&chirp, s->sample_rate_hz);

    assert_true(n_chirp <= SAMPLES);
    chirp_generate(&chirp, s->sample_rate_hz, heard);
    for (size_t k = 0; k < 2; k++)
        for (size_t m = 0; m < MICROPHONES; m++) {
            const double *from_m = s->speakers_m[(speaker + k) % s->n_speakers];
            double path_m = geometry_distance(from_m, s->microphones_m[m]);
            size_t first = k * s->slot_samples +
                           (size_t)lround(s->latency_samples + path_m *
                                                                   s->sample_rate_hz /
                                                                   s->sound_speed_m_s);
            for (size_t i = 0; m != dead && i < n_chirp && first + i < n; i++)
                samples[m * n + first + i] += 0.01f / (0.1f + (float)path_m) * heard[i];
        }
}

/* Nothing but noise; or direct sound, too, of a speaker. */
static void ping_of(struct rig *r, float rms, bool sounds, size_t speaker, size_t dead)
{
    static float samples[MICROPHONES * SAMPLES];
    static uint32_t none[MICROPHONES];
    size_t n = r->survey.slot_samples + tail_samples(&r->survey);
    struct tensor_view view;
    Anlos__Ping p = ANLOS__PING__INIT;

    assert_true(n <= SAMPLES);
    memset(samples, 0, sizeof samples);
    if (sounds)
        add_direct(r, samples, n, speaker, dead);
    p.speaker = (uint32_t)speaker;
    random_add_noise(&r->random, samples, MICROPHONES * n, rms);
    p.survey_id = survey_id(&r->survey);
    p.scan = 1;
    p.valid = true;
    p.frame = ++r->frame;
    p.n_clipped = p.n_not_finite = MICROPHONES;
    p.clipped = p.not_finite = none;
    p.samples = tensor_borrow_f32(&view, samples, 2, (size_t)MICROPHONES, n);
    assert_int_equal(bus_publish_message(r->array, topic_ping(),
                                         (int64_t)r->frame * SLOT_NS, alone_now_ns(),
                                         &p.base),
                     0);
}

static void ping(struct rig *r, float rms)
{
    ping_of(r, rms, false, 0, 0);
}

static void hear(struct rig *r)
{
    struct bus_message m;

    if (alone_hear(&r->dsp, &m))
        bus_message_free(&m);
}

static void start(struct rig *r, const struct scratch *s)
{
    *r = (struct rig){.array = alone_bus(s->folder, "array"), .survey = alone_survey()};
    random_seed(&r->random, (uint64_t[]){1}, 1);
    alone_start(&r->dsp, s->folder, "dsp",
                "nodes: [dsp]\nscan: {mode: fixed}\ndsp: {background: adaptive}\n");
    while (!alone_is_heard(r->array, topic_ping()))
        hear(r);
    while (!alone_is(&r->dsp, ANLOS__HEALTH__STATE__READY)) {
        alone_tell_survey(r->array, &r->survey);
        hear(r);
    }
}

/* 0: it says nothing of it. */
static uint32_t fault(const struct rig *r, const char *name)
{
    for (size_t i = 0; r->dsp.health && i < r->dsp.health->n_faults; i++)
        if (!strcmp(r->dsp.health->faults[i]->name, name))
            return r->dsp.health->faults[i]->count;
    return 0;
}

static void a_drowned_ping_and_the_one_after_it_are_counted(void **state)
{
    const struct scratch *s = *state;
    struct rig r;

    start(&r, s);
    for (int k = 0; k < 6; k++)
        ping(&r, 1e-4f);
    ping(&r, 1e-2f);
    for (int k = 0; k < 4; k++)
        ping(&r, 1e-4f);
    while (alone_device(&r.dsp, "pings blanked") < 2)
        hear(&r);
    assert_int_equal(alone_device(&r.dsp, "pings blanked"), 2);
    alone_stop(&r.dsp);
    bus_destroy(r.array);
}

/* Three rounds of 24 ms slots are more than the 70 ms in which a microphone may miss what
 * others hear. */
static void a_microphone_that_hears_no_speaker_is_told(void **state)
{
    const struct scratch *s = *state;
    struct rig r;

    start(&r, s);
    for (size_t k = 0; k < 3 * r.survey.n_speakers; k++)
        ping_of(&r, 1e-4f, true, k % r.survey.n_speakers, 2);
    while (!fault(&r, "channels_silent") || !r.dsp.health->sensing ||
           isnan(r.dsp.health->sensing->noise_db))
        hear(&r);
    assert_int_equal(fault(&r, "channels_silent"), 1);
    assert_int_equal(fault(&r, "speakers_mute"), 0);
    char *log = alone_log(&r.dsp);
    assert_non_null(strstr(log, "microphone 3 hears no speaker"));
    free(log);
    alone_stop(&r.dsp);
    bus_destroy(r.array);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_drowned_ping_and_the_one_after_it_are_counted,
                                        scratch_open, scratch_close),
        cmocka_unit_test_setup_teardown(a_microphone_that_hears_no_speaker_is_told,
                                        scratch_open, scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
