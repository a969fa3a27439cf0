#include "nodes/foxglove/server.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "nodes/foxglove/channels.h"
#include "nodes/foxglove/server_state.h"

#define PATH           "/"
#define TIME_PERIOD_MS 50
#define PARTING_MS     300
#define NS_PER_MS      1000000LL

const char *const foxglove_subprotocols[] = {"foxglove.sdk.v1", "foxglove.websocket.v1",
                                             NULL};

void foxglove_config_default(struct foxglove_config *cfg, int64_t now_ns)
{
    *cfg = (struct foxglove_config){.name = "anlos",
                                    .session_ns = now_ns,
                                    .max_clients = 8,
                                    .queue_bytes = (size_t)8 << 20,
                                    .total_bytes = (size_t)16 << 20,
                                    .queue_messages = 1024};
}

static size_t count_topics(void)
{
    size_t n = 0;

    while (topics_all()[n].name)
        n++;
    return n;
}

static void free_server(struct foxglove_server *s)
{
    inbox_clear(&s->inbox);
    for (size_t i = 0; s->newest && i < count_topics(); i++)
        blob_release(s->newest[i].payload);
    free(s->newest);
    setting_clear(&s->setting);
    free(s->offered);
    free(s->named);
    blob_release(s->info);
    pthread_cond_destroy(&s->work);
    pthread_cond_destroy(&s->parted);
    pthread_mutex_destroy(&s->lock);
    free(s);
}

/* Waits are by the machine's clock, whatever happens to the wall's. */
static void open_locks(struct foxglove_server *s)
{
    pthread_condattr_t attributes;

    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->work, NULL);
    pthread_cond_init(&s->parted, &attributes);
    pthread_condattr_destroy(&attributes);
}

int foxglove_server_create(struct foxglove_server **out, struct web *web,
                           const struct foxglove_config *cfg)
{
    struct foxglove_server *s = calloc(1, sizeof *s);
    const struct web_endpoint endpoint = {.path = PATH,
                                          .subprotocols = foxglove_subprotocols,
                                          .max_message = FOXGLOVE_REQUEST_MAX_SIZE,
                                          .ctx = s,
                                          .refuse = client_refuse,
                                          .open = client_open,
                                          .take = client_take,
                                          .next = client_next,
                                          .done = client_done,
                                          .close = client_close};

    if (!s)
        return -ENOMEM;
    open_locks(s);
    s->cfg = *cfg;
    s->web = web;
    s->n_channels = channels_count();
    s->info = reply_server_info(cfg->name, cfg->session_ns);
    s->offered = calloc(s->n_channels, sizeof *s->offered);
    s->named = calloc(s->n_channels, sizeof *s->named);
    s->newest = calloc(count_topics(), sizeof *s->newest);
    int err = !s->info || !s->offered || !s->named || !s->newest
                  ? -ENOMEM
                  : -pthread_create(&s->press, NULL, press_run, s);
    if (err) {
        free_server(s);
        return err;
    }
    s->presses = true;
    web_serve(web, &endpoint);
    *out = s;
    return 0;
}

static struct blob *payload_of(const struct foxglove_message *m)
{
    if (m->payload)
        return blob_copy(m->payload, m->payload_size);
    size_t size = protobuf_c_message_get_packed_size(m->content);
    uint8_t *data = malloc(size ? size : 1);
    if (data)
        protobuf_c_message_pack(m->content, data);
    return blob_create(data, size);
}

/* With the lock: does a client want anything that is made of it? */
static bool is_wanted(const struct foxglove_server *s, const struct topic *t)
{
    struct channel channel;

    for (size_t i = 0; i < s->n_channels; i++) {
        channel_get(i, &channel);
        if (!channel_is_from(&channel, t))
            continue;
        for (const struct client *c = s->clients; c; c = c->next)
            if (c->subscriptions[i].active)
                return true;
    }
    return false;
}

/* State, and the result of each scan: who subscribes late gets the newest. */
static bool is_kept(const struct topic *t)
{
    return t->policy == TOPIC_LATEST || t == topic_detections();
}

static bool is_setting(const struct topic *t)
{
    return t == topic_survey() || t == topic_stage_state() || t == topic_wall();
}

/* With the lock: names the channels that this topic's first message opens to everybody.
 */
static void offer(struct foxglove_server *s, const struct topic *t)
{
    struct channel channel;

    for (size_t i = 0; i < s->n_channels; i++) {
        channel_get(i, &channel);
        s->named[i] = !s->offered[i] && channel_is_from(&channel, t);
        s->offered[i] = s->offered[i] || s->named[i];
    }
    struct blob *b = s->clients ? reply_advertise(s->named) : NULL;
    for (struct client *c = s->clients; b && c; c = c->next) {
        const struct outgoing o = {.kind = OUTGOING_TEXT, .blob = blob_hold(b)};
        client_push(c, &o);
    }
    blob_release(b);
}

void foxglove_server_message(struct foxglove_server *s, const struct foxglove_message *m)
{
    struct arrival a = {
        .topic = m->topic, .capture_ns = m->capture_ns, .publish_ns = m->publish_ns};
    struct arrival *newest = &s->newest[m->topic - topics_all()];

    pthread_mutex_lock(&s->lock);
    if (!s->offered[m->topic - topics_all()]) /* which is the channel of the topic */
        offer(s, m->topic);
    bool wanted = is_wanted(s, m->topic) || is_setting(m->topic);
    pthread_mutex_unlock(&s->lock);
    if (!wanted && !is_kept(m->topic))
        return;
    snprintf(a.node, sizeof a.node, "%s", m->node);
    a.payload = payload_of(m);
    pthread_mutex_lock(&s->lock);
    if (a.payload && is_kept(m->topic)) {
        blob_release(newest->payload);
        *newest = a;
        blob_hold(a.payload);
    }
    int skipped = !a.payload ? -ENOMEM : wanted ? inbox_push(&s->inbox, &a) : 0;
    if (!wanted)
        blob_release(a.payload);
    s->counts.skipped += skipped < 0 ? 1 : (uint64_t)skipped;
    pthread_cond_signal(&s->work);
    pthread_mutex_unlock(&s->lock);
}

static struct timespec after_ms(int64_t ms)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    int64_t ns = t.tv_nsec + ms * NS_PER_MS;
    t.tv_sec += ns / (1000 * NS_PER_MS);
    t.tv_nsec = ns % (1000 * NS_PER_MS);
    return t;
}

void foxglove_server_time(struct foxglove_server *s, int64_t now_ns)
{
    struct timespec t = after_ms(0);
    int64_t ms = t.tv_sec * 1000 + t.tv_nsec / NS_PER_MS;

    pthread_mutex_lock(&s->lock);
    if (now_ns != s->time_ns && ms - s->time_sent_ms >= TIME_PERIOD_MS) {
        s->time_ns = now_ns;
        s->time_sent_ms = ms;
        for (struct client *c = s->clients; c; c = c->next) {
            c->time_waits = true;
            web_wake(s->web);
        }
    }
    pthread_mutex_unlock(&s->lock);
}

void foxglove_server_counts(struct foxglove_server *s, struct foxglove_counts *out)
{
    pthread_mutex_lock(&s->lock);
    *out = s->counts;
    for (const struct client *c = s->clients; c; c = c->next)
        out->waiting += c->queue.bytes;
    pthread_mutex_unlock(&s->lock);
}

/* It wakes the web server, which may be gone after foxglove_server_stop. */
static void end_press(struct foxglove_server *s)
{
    pthread_mutex_lock(&s->lock);
    s->stopping = true;
    pthread_cond_signal(&s->work);
    pthread_mutex_unlock(&s->lock);
    if (s->presses)
        pthread_join(s->press, NULL);
    s->presses = false;
}

void foxglove_server_stop(struct foxglove_server *s)
{
    const struct timespec end = after_ms(PARTING_MS);
    int err = 0;

    end_press(s);
    pthread_mutex_lock(&s->lock);
    for (struct client *c = s->clients; c; c = c->next) {
        c->goodbye = true;
        web_wake(s->web);
    }
    while (s->counts.clients && !err)
        err = pthread_cond_timedwait(&s->parted, &s->lock, &end);
    pthread_mutex_unlock(&s->lock);
}

void foxglove_server_destroy(struct foxglove_server *s)
{
    if (!s)
        return;
    end_press(s);
    free_server(s);
}
