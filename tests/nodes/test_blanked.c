/* SPDX-License-Identifier: MIT */
/* The dsp node's program: what a slam drowns is counted in its health. */
#include "tests/hal/scratch.h"
#include "tests/nodes/alone.h"

#include "hal/random.h"
#include "msgs/array.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/topics.h"
#include "recon/tail.h"

enum { MICROPHONES = 16, SAMPLES = 1152 * 2, SLOT_NS = 24000000 };

struct rig {
    struct alone dsp;
    struct bus *array;
    struct survey survey;
    struct random random;
    uint32_t frame;
};

/* Nothing but noise. */
static void ping(struct rig *r, float rms)
{
    static float samples[MICROPHONES * SAMPLES];
    static uint32_t none[MICROPHONES];
    size_t n = r->survey.slot_samples + tail_samples(&r->survey);
    struct tensor_view view;
    Anlos__Ping p = ANLOS__PING__INIT;

    assert_true(n <= SAMPLES);
    memset(samples, 0, sizeof samples);
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

static void hear(struct rig *r)
{
    struct bus_message m;

    if (alone_hear(&r->dsp, &m))
        bus_message_free(&m);
}

static void a_drowned_ping_and_the_one_after_it_are_counted(void **state)
{
    const struct scratch *s = *state;
    struct rig r = {.array = alone_bus(s->folder, "array"), .survey = alone_survey()};

    random_seed(&r.random, (uint64_t[]){1}, 1);
    alone_start(&r.dsp, s->folder, "dsp",
                "nodes: [dsp]\nscan: {mode: fixed}\ndsp: {background: adaptive}\n");
    while (!alone_is_heard(r.array, topic_ping()))
        hear(&r);
    while (!alone_is(&r.dsp, ANLOS__HEALTH__STATE__READY)) {
        alone_tell_survey(r.array, &r.survey);
        hear(&r);
    }
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_drowned_ping_and_the_one_after_it_are_counted,
                                        scratch_open, scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
