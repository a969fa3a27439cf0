/* SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "msgs/envelope.h"
#include "msgs/health.pb-c.h"
#include "msgs/shuffle.h"
#include "nodes/dsp/dsp.h"
#include "nodes/recon/recon.h"
#include "recon/detection/detector.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/messages.h"
#include "tests/fuzz/seeds.h"
#include "tests/nodes/scene.h"

/* A scan of mini.yaml as its nodes would publish it. */
struct scan {
    struct scene scene;
    struct dsp *dsp;
    struct recon *recon;
    struct detector detector;
    struct bytes_buffer all, sound, image; /* all messages; those to and from recon */
};

static void publish(struct bytes_buffer *to, const struct topic *topic,
                    const ProtobufCMessage *m)
{
    size_t size = protobuf_c_message_get_packed_size(m);
    uint8_t *bytes = malloc(size + 1);

    FUZZ_REQUIRE(bytes);
    protobuf_c_message_pack(m, bytes);
    messages_put(to, topic, (struct bytes){bytes, size});
    free(bytes);
}

static void publish_survey(struct scan *s)
{
    struct error why = {""};
    const struct frontend_config dsp = {.window = WINDOW_HANN,
                                        .background = BACKGROUND_RECORDED};
    const struct scan_imager_config recon = {.method = "backprojection", .threads = 1};
    struct survey survey;
    const struct detector_config detector = {.threshold_db = 3.0, .min_existence = 0.01};

    FUZZ_REQUIRE(!dsp_create(&s->dsp, NULL, &dsp) &&
                 !recon_create(&s->recon, NULL, &recon));
    detector_init(&s->detector, &detector);
    if (dsp_survey(s->dsp, s->scene.survey, &why) ||
        recon_survey(s->recon, s->scene.survey, &why) ||
        survey_from_message(&survey, s->scene.survey, &why))
        fuzz_fail(__FILE__, __LINE__, why.text);
    FUZZ_REQUIRE(!detector_survey(&s->detector, &survey));
    survey_clear(&survey);
    publish(&s->all, topic_survey(), &s->scene.survey->base);
    publish(&s->sound, topic_survey(), &s->scene.survey->base);
    publish(&s->image, topic_survey(), &s->scene.survey->base);
}

static void publish_ping(struct scan *s, Anlos__Pass pass, uint32_t position,
                         uint32_t speaker)
{
    struct dsp_output out;
    Anlos__Receipt receipt;
    Anlos__Ping ping;
    char note[256];

    scene_ping(&s->scene, pass, position, speaker, &ping);
    publish(&s->all, topic_ping(), &ping.base);
    publish(&s->sound, topic_ping(), &ping.base);
    dsp_ping(s->dsp, &ping, 0, &out);
    if (!out.has_traces) {
        publish(&s->all, topic_receipt(), &out.receipt.base);
        return;
    }
    publish(&s->all, topic_traces(), &out.traces.base);
    publish(&s->image, topic_traces(), &out.traces.base);
    recon_traces(s->recon, &out.traces, 1, 2, &receipt, note, sizeof note);
    FUZZ_REQUIRE(receipt.usable);
}

static void publish_image(struct scan *s)
{
    struct error why = {""};
    Anlos__Volume volume;
    Anlos__DetectionList *list;
    struct object_list objects;
    struct volume image;

    recon_image(s->recon, false, &volume);
    publish(&s->all, topic_volume(), &volume.base);
    publish(&s->image, topic_volume(), &volume.base);
    volume_from_message(&image, &volume, 1);
    FUZZ_REQUIRE(!detector_volume(&s->detector, &image, NULL, &objects, &why));
    FUZZ_REQUIRE(!detections_from_objects(&list, &objects));
    publish(&s->all, topic_detections(), &list->base);
    publish(&s->image, topic_detections(), &list->base);
    detections_free(list);
}

static void publish_states(struct scan *s)
{
    Anlos__TopicCount count = ANLOS__TOPIC_COUNT__INIT, *counts[] = {&count};
    Anlos__DeviceCount device = ANLOS__DEVICE_COUNT__INIT, *devices[] = {&device};
    Anlos__Health health = ANLOS__HEALTH__INIT;
    Anlos__ScanStatus status = ANLOS__SCAN_STATUS__INIT;

    count.topic = "ping";
    count.messages = 4;
    device.name = "overruns";
    health.node = "dsp";
    health.text = "well";
    health.n_topics = 1;
    health.topics = counts;
    health.n_device = 1;
    health.device = devices;
    status.state = ANLOS__SCAN_STATUS__STATE__DONE;
    status.scan = 1;
    status.text = "done";
    publish(&s->all, topic_health(), &health.base);
    publish(&s->image, topic_health(), &health.base);
    publish(&s->all, topic_scan_status(), &status.base);
    publish(&s->image, topic_scan_status(), &status.base);
}

static void record(struct scan *s)
{
    FUZZ_REQUIRE(!scene_open(&s->scene, SOURCE_DIR "/tests/fuzz/mini.yaml"));
    publish_survey(s);
    for (unsigned i = 0; i < 8; i++)
        publish_ping(s, i < 4 ? ANLOS__PASS__BACKGROUND : ANLOS__PASS__SCENE, i % 4 / 2,
                     i % 2);
    publish_image(s);
    publish_states(s);
}

static void stop(struct scan *s)
{
    dsp_destroy(s->dsp);
    recon_destroy(s->recon);
    detector_clear(&s->detector);
    scene_close(&s->scene);
    bytes_free(&s->all);
    bytes_free(&s->sound);
    bytes_free(&s->image);
}

/* The smallest message of each topic, and one with every field of its own. */
static void put_each_topic(const struct seeds *s)
{
    static const uint8_t fields[] = {0x08, 1,    0x11, 0,    0, 0,    0, 0,    0, 0,
                                     0x40, 0x1a, 0,    0x22, 0, 0x28, 1, 0x32, 0};

    for (const struct topic *t = topics_all(); t->name; t++) {
        struct bytes_buffer b = {0};
        char name[64];
        snprintf(name, sizeof name, "topic-%td", t - topics_all());
        messages_put(&b, t, (struct bytes){fields, sizeof fields});
        seeds_put(s, "message", name, bytes_in(&b));
        seeds_put(s, "bag_export", name, bytes_in(&b));
        seeds_put(s, "show", name, bytes_in(&b));
        bytes_free(&b);
    }
}

/* A scan as a bag has it that was recorded with --shuffle. */
static struct bytes_buffer shuffle(struct bytes scan)
{
    struct bytes_buffer out = {0}, shuffled = {0};
    const struct topic *topic;
    struct bytes payload;

    while (messages_next(&scan, &topic, &payload)) {
        FUZZ_REQUIRE(!payload_shuffle(&shuffled, topic->schema, payload, true));
        messages_put(&out, topic, bytes_in(&shuffled));
    }
    bytes_free(&shuffled);
    FUZZ_REQUIRE(!out.failed);
    return out;
}

static void put_shuffled(const struct seeds *s, const struct scan *scan)
{
    struct bytes_buffer all = shuffle(bytes_in(&scan->all)),
                        sound = shuffle(bytes_in(&scan->sound)),
                        image = shuffle(bytes_in(&scan->image));

    seeds_put(s, "nodes", "sound-shuffled", bytes_in(&sound));
    seeds_put(s, "bag_export", "scan-shuffled", bytes_in(&all));
    seeds_put(s, "message", "scan-shuffled", bytes_in(&image));
    seeds_put(s, "show", "scan-shuffled", bytes_in(&image));
    bytes_free(&all);
    bytes_free(&sound);
    bytes_free(&image);
}

/* A ping of each type of tensor, of its whole numbers 1 and -2. */
static void put_each_tensor(const struct seeds *s)
{
    uint8_t samples[] = {2, 3, 0, 0, 0, 0, 0, 0};

    for (uint32_t type = 0; type <= ANLOS__TENSOR__TYPE__SHUFFLED_Q31; type++) {
        Anlos__Ping ping = ANLOS__PING__INIT;
        Anlos__Tensor tensor = ANLOS__TENSOR__INIT;
        struct bytes_buffer b = {0};
        char name[64];
        tensor.type = (Anlos__Tensor__Type)type;
        tensor.shape = (uint32_t[]){1, 2};
        tensor.n_shape = 2;
        tensor.data = (ProtobufCBinaryData){sizeof samples, samples};
        ping.samples = &tensor;
        snprintf(name, sizeof name, "tensor-%" PRIu32, type);
        publish(&b, topic_ping(), &ping.base);
        seeds_put(s, "message", name, bytes_in(&b));
        bytes_free(&b);
    }
}

static void put_envelope(const struct seeds *s)
{
    struct envelope e = {.topic = "ping", .node = "array", .epoch_ns = 1, .sequence = 7};
    uint8_t bytes[ENVELOPE_SIZE];

    envelope_pack(&e, bytes);
    seeds_put(s, "message", "envelope", (struct bytes){bytes, sizeof bytes});
}

void seeds_messages(const struct seeds *s)
{
    struct scan scan = {.dsp = NULL};

    record(&scan);
    seeds_put(s, "nodes", "sound", bytes_in(&scan.sound));
    seeds_put(s, "nodes", "image", bytes_in(&scan.image));
    seeds_put(s, "bag_export", "scan", bytes_in(&scan.all));
    seeds_put(s, "message", "scan", bytes_in(&scan.image));
    seeds_put(s, "show", "scan", bytes_in(&scan.image));
    put_shuffled(s, &scan);
    put_each_tensor(s);
    put_each_topic(s);
    put_envelope(s);
    stop(&scan);
}
