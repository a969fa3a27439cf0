/* The thread that converts: each message once for all who want it. */
#include <errno.h>

#include "msgs/unpack.h"
#include "nodes/foxglove/channels.h"
#include "nodes/foxglove/server_state.h"

static size_t topic_index(const struct topic *t)
{
    return (size_t)(t - topics_all());
}

static void push_newest(struct foxglove_server *s, const struct topic *t, uint64_t client,
                        size_t channel)
{
    struct arrival late = s->newest[topic_index(t)];

    if (!late.payload)
        return;
    late.client = client;
    late.channel = channel;
    blob_hold(late.payload);
    s->counts.skipped += inbox_push(&s->inbox, &late) < 0;
    pthread_cond_signal(&s->work);
}

void press_late(struct foxglove_server *s, const struct client *c, size_t channel)
{
    struct channel ch;

    channel_get(channel, &ch);
    for (size_t i = 0; i < CHANNEL_MAX_SOURCES && ch.sources[i]; i++)
        push_newest(s, ch.sources[i], c->serial, channel);
}

static bool wants(const struct client *c, const struct arrival *a, size_t channel)
{
    return c->subscriptions[channel].active &&
           (!a->client || (a->client == c->serial && a->channel == channel));
}

static bool is_wanted(struct foxglove_server *s, const struct arrival *a, size_t channel)
{
    bool wanted = false;

    pthread_mutex_lock(&s->lock);
    for (const struct client *c = s->clients; c && !wanted; c = c->next)
        wanted = wants(c, a, channel);
    pthread_mutex_unlock(&s->lock);
    return wanted;
}

static void give(struct foxglove_server *s, const struct arrival *a, size_t channel,
                 struct blob *b)
{
    pthread_mutex_lock(&s->lock);
    for (struct client *c = s->clients; c; c = c->next) {
        if (!wants(c, a, channel))
            continue;
        const struct outgoing o = {OUTGOING_MESSAGE, blob_hold(b), channel,
                                   c->subscriptions[channel].id, a->publish_ns};
        client_push(c, &o);
    }
    pthread_mutex_unlock(&s->lock);
}

static void count_failure(struct foxglove_server *s)
{
    pthread_mutex_lock(&s->lock);
    s->counts.failed++;
    pthread_mutex_unlock(&s->lock);
}

/* NULL: there is none, or not yet. */
static struct blob *convert(struct foxglove_server *s, const struct channel *c,
                            const struct foxglove_message *m, struct blob *payload)
{
    uint8_t *data = NULL;
    size_t size;

    if (!c->convert)
        return blob_hold(payload);
    int err = channel_pack(c, &s->setting, m, &data, &size);
    struct blob *b = err ? NULL : blob_create(data, size);
    if (!b && err != -EAGAIN)
        count_failure(s);
    return b;
}

static void work_off(struct foxglove_server *s, const struct arrival *a)
{
    struct foxglove_message m = {.topic = a->topic,
                                 .node = a->node,
                                 .capture_ns = a->capture_ns,
                                 .publish_ns = a->publish_ns};
    ProtobufCMessage *content =
        message_unpack(a->topic->schema, a->payload->size, a->payload->data);
    struct channel c;

    m.content = content;
    if (!content) {
        count_failure(s);
        return;
    }
    if (setting_take(&s->setting, &m)) { /* an image may have come before its survey */
        pthread_mutex_lock(&s->lock);
        push_newest(s, topic_volume(), 0, 0);
        pthread_mutex_unlock(&s->lock);
    }
    for (size_t i = 0; i < s->n_channels; i++) {
        channel_get(i, &c);
        if (!channel_is_from(&c, a->topic) || !is_wanted(s, a, i))
            continue;
        struct blob *b = convert(s, &c, &m, a->payload);
        if (b)
            give(s, a, i, b);
        blob_release(b);
    }
    protobuf_c_message_free_unpacked(content, NULL);
}

void *press_run(void *data)
{
    struct foxglove_server *s = data;
    struct arrival a;

    pthread_mutex_lock(&s->lock);
    for (;;) {
        while (!s->stopping && !s->inbox.first)
            pthread_cond_wait(&s->work, &s->lock);
        if (s->stopping)
            break;
        inbox_pop(&s->inbox, &a);
        pthread_mutex_unlock(&s->lock);
        work_off(s, &a);
        blob_release(a.payload);
        pthread_mutex_lock(&s->lock);
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}
