/* SPDX-License-Identifier: MIT */
/* Messages to those who show them: as Foxglove has them, and on the page. */
#include <stdlib.h>

#include "msgs/unpack.h"
#include "msgs/volume.pb-c.h"
#include "nodes/foxglove/channels.h"
#include "nodes/view/view.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/messages.h"

#define MOST_VOXELS 20000 /* of an image, which takes its time to draw */

static void to_foxglove(struct setting *s, const struct foxglove_message *m)
{
    setting_take(s, m);
    for (size_t i = 0; i < channels_count(); i++) {
        struct channel c;
        uint8_t *data;
        size_t size;
        channel_get(i, &c);
        if (!c.convert || !channel_is_from(&c, m->topic))
            continue;
        if (!channel_pack(&c, s, m, &data, &size))
            free(data);
    }
}

static bool is_large(const struct topic *t, const ProtobufCMessage *m)
{
    const Anlos__Volume *v = (const Anlos__Volume *)m;

    return t == topic_volume() && v->intensity &&
           v->intensity->data.len / 4 > MOST_VOXELS;
}

static void set_right(const struct topic *t, ProtobufCMessage *m)
{
    struct survey s;

    if (t == topic_survey() && !messages_survey(&s, (Anlos__Survey *)m))
        survey_clear(&s);
}

static void show(struct setting *setting, struct view *view, const struct topic *t,
                 ProtobufCMessage *m, int64_t now_ns)
{
    const struct foxglove_message foxglove = {.topic = t,
                                              .node = "fuzz",
                                              .content = m,
                                              .capture_ns = now_ns,
                                              .publish_ns = now_ns};
    const struct view_message page = {.topic = t,
                                      .from = "fuzz",
                                      .content = m,
                                      .capture_ns = now_ns,
                                      .publish_ns = now_ns,
                                      .epoch_ns = 1};

    set_right(t, m);
    to_foxglove(setting, &foxglove);
    view_take(view, &page, now_ns);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct bytes input = {data, size}, payload;
    const struct topic *topic;
    struct setting setting = {.has_survey = false};
    struct view *view;
    int64_t now_ns = 1;

    FUZZ_REQUIRE(!view_create(&view, "fuzz", false));
    view_pages(view, 1);
    while (messages_next(&input, &topic, &payload)) {
        ProtobufCMessage *m = message_unpack(topic->schema, payload.size, payload.data);
        now_ns += VIEW_PERIOD_NS;
        if (m && !is_large(topic, m))
            show(&setting, view, topic, m, now_ns);
        if (m)
            protobuf_c_message_free_unpacked(m, NULL);
        view_tick(view, now_ns);
    }
    view_flush(view, now_ns);
    view_destroy(view);
    setting_clear(&setting);
    return 0;
}
