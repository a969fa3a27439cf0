/* SPDX-License-Identifier: MIT */
/* The track node's program, kept from its work while images come. */
#include "tests/hal/scratch.h"
#include "tests/nodes/alone.h"

#include <signal.h>
#include <sys/wait.h>

#include "msgs/detections.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/topics.h"
#include "msgs/volume.pb-c.h"

enum { NX = 41, NZ = 41, OLD = 9 };

#define MS_NS INT64_C(1000000)
#define STEP_NS                                                                          \
    (24 * MS_NS) /* from image to image; so all old ones are soon after one              \
                  */

struct rig {
    struct alone track;
    struct bus *array, *recon;
    struct survey survey;
    uint32_t frame;
    int64_t listed_ns; /* capture stamp of the newest list */
    uint32_t listed;   /* its frame */
};

static void image(struct rig *r, int64_t capture_ns)
{
    static const float dark[NZ * NX];
    struct tensor_view view;
    Anlos__Vec3 origin = ANLOS__VEC3__INIT, step = ANLOS__VEC3__INIT;
    Anlos__Volume v = ANLOS__VOLUME__INIT;

    origin.x = -1.0;
    origin.z = 1.0;
    step.x = step.y = step.z = 0.05;
    v.survey_id = survey_id(&r->survey);
    v.scan = 1;
    v.frame = ++r->frame;
    v.pings_used = v.pings_expected = 4;
    v.origin_m = &origin;
    v.step_m = &step;
    v.intensity = tensor_borrow_f32(&view, dark, 3, (size_t)NZ, (size_t)1, (size_t)NX);
    assert_int_equal(bus_publish_message(r->recon, topic_volume(), capture_ns,
                                         alone_now_ns(), &v.base),
                     0);
}

static void hear(struct rig *r)
{
    struct bus_message m;

    if (!alone_hear(&r->track, &m))
        return;
    Anlos__DetectionList *list = (Anlos__DetectionList *)bus_message_unpack(&m);
    assert_non_null(list);
    r->listed_ns = m.envelope.capture_ns;
    r->listed = list->frame;
    protobuf_c_message_free_unpacked(&list->base, NULL);
    bus_message_free(&m);
}

/* The first image is a second old, so that it is time for another list by now. */
static void start(struct rig *r, const struct scratch *s)
{
    *r = (struct rig){.survey = alone_survey()};
    r->array = alone_bus(s->folder, "array");
    r->recon = alone_bus(s->folder, "recon");
    alone_start(&r->track, s->folder, "track",
                "nodes: [recon, track]\nscan: {mode: fixed}\n");
    assert_int_equal(bus_subscribe(r->track.listener, topic_detections()), 0);
    while (!alone_is(&r->track, ANLOS__HEALTH__STATE__READY) ||
           !alone_publishes_to(&r->track, "detections") ||
           !alone_is_heard(r->recon, topic_volume())) {
        alone_tell_survey(r->array, &r->survey);
        hear(r);
    }
    image(r, alone_now_ns() - 1000 * MS_NS);
    while (r->listed != r->frame)
        hear(r);
}

static void stop(struct rig *r)
{
    alone_stop(&r->track);
    bus_destroy(r->recon);
    bus_destroy(r->array);
}

static void hold(const struct rig *r)
{
    int status;

    assert_int_equal(kill(r->track.pid, SIGSTOP), 0);
    assert_int_equal(waitpid(r->track.pid, &status, WUNTRACED), r->track.pid);
    assert_true(WIFSTOPPED(status));
}

static void kept_waiting_it_takes_the_newest_image_and_counts_those_it_skips(void **state)
{
    struct rig r;

    start(&r, *state);
    hold(&r);
    int64_t first_ns = r.listed_ns, newest_ns = alone_now_ns();
    for (int i = 1; i <= OLD; i++)
        image(&r, first_ns + i * STEP_NS);
    image(&r, newest_ns);
    assert_int_equal(kill(r.track.pid, SIGCONT), 0);
    while (r.listed_ns == first_ns)
        hear(&r);
    assert_int_equal(r.listed_ns, newest_ns);
    assert_int_equal(r.listed, r.frame);
    while (!alone_is(&r.track, ANLOS__HEALTH__STATE__DEGRADED)) {
        alone_tell_survey(r.array, &r.survey);
        hear(&r);
    }
    assert_contains(r.track.health->text, "images are skipped");
    assert_int_equal(alone_device(&r.track, "images skipped"), OLD);
    assert_int_equal(alone_device(&r.track, "lists"), 2);
    assert_int_equal(r.listed_ns, newest_ns);
    stop(&r);
}

static void who_keeps_up_again_is_no_longer_degraded(void **state)
{
    struct rig r;

    start(&r, *state);
    hold(&r);
    for (int i = 1; i <= OLD; i++)
        image(&r, r.listed_ns + i * STEP_NS);
    assert_int_equal(kill(r.track.pid, SIGCONT), 0);
    while (!alone_is(&r.track, ANLOS__HEALTH__STATE__DEGRADED)) {
        alone_tell_survey(r.array, &r.survey);
        hear(&r);
    }
    while (!alone_is(&r.track, ANLOS__HEALTH__STATE__READY)) {
        if (r.listed == r.frame || alone_now_ns() - r.listed_ns > 500 * MS_NS)
            image(&r, alone_now_ns());
        hear(&r);
    }
    stop(&r);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(kept_waiting_it_takes_the_newest_image_and_counts_those_it_skips),
        TEST(who_keeps_up_again_is_no_longer_degraded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
