/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/host_peers.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "nodes/rt/stop.h"

#define FAR_APART_S 0.1 /* clocks; worth a warning */

void host_peers_init(struct host_peers *f, const struct hosts *h, int64_t epoch_ns,
                     uint64_t launch_file)
{
    *f = (struct host_peers){.epoch_ns = epoch_ns, .launch_file = launch_file};
    if (!h->n)
        return;
    memcpy(f->name, h->list[h->here].name, sizeof f->name);
    for (size_t i = 0; i < h->n; i++)
        if (i != h->here)
            memcpy(f->list[f->n++].name, h->list[i].name, sizeof f->name);
}

static struct host_peer *find(struct host_peers *f, const char *name)
{
    for (size_t i = 0; i < f->n; i++)
        if (!strcmp(f->list[i].name, name))
            return &f->list[i];
    return NULL;
}

/* Of stamps that came from elsewhere, and may be anything. */
static double seconds(int64_t from_ns, int64_t to_ns)
{
    int64_t ns;

    return __builtin_sub_overflow(to_ns, from_ns, &ns) ? 0.0 : 1e-9 * (double)ns;
}

/* How far the clocks are apart, and how long a message is on its way there and back, from
 * the four stamps of NTP (RFC 5905, section 8). */
static void measure(struct host_peer *o, const Anlos__HostSight *sight,
                    int64_t publish_ns, int64_t now_ns)
{
    double there_s = seconds(sight->sent_ns, sight->heard_ns);
    double back_s = seconds(publish_ns, now_ns);
    unsigned i = o->n_samples++ % HOST_PEERS_SAMPLES;

    o->ahead_s[i] = 0.5 * (there_s - back_s);
    o->round_trip_s[i] = there_s + back_s;
    o->clock_known |= o->n_samples == HOST_PEERS_SAMPLES;
}

/* The sample that was least delayed is the one least wrong. */
static bool best_sample(const struct host_peer *o, double *ahead_s, double *round_trip_s)
{
    unsigned n = o->n_samples < HOST_PEERS_SAMPLES ? o->n_samples : HOST_PEERS_SAMPLES;
    unsigned best = 0;

    for (unsigned i = 1; i < n; i++)
        if (o->round_trip_s[i] < o->round_trip_s[best])
            best = i;
    *ahead_s = n ? o->ahead_s[best] : 0.0;
    *round_trip_s = n ? o->round_trip_s[best] : 0.0;
    return n > 0;
}

static void begin_epoch(struct host_peer *o, int64_t epoch_ns)
{
    o->restarted = o->epoch_ns != 0;
    o->epoch_ns = epoch_ns;
    o->knows_ns = 0;
    o->n_samples = 0;
    o->ran = o->ended = false;
}

/* It was held up on its way.  A machine that was away may come back with a clock that is
 * behind: then its new start seems to be before the old one. */
static bool is_stale(const struct host_peer *o, int64_t epoch_ns, int64_t publish_ns,
                     int64_t now_ns)
{
    if (epoch_ns == o->epoch_ns)
        return publish_ns < o->sent_ns;
    return epoch_ns < o->epoch_ns && now_ns - o->heard_ns <= HOST_PEERS_SILENCE_NS;
}

void host_peers_hear(struct host_peers *f, const Anlos__HostStatus *m, int64_t epoch_ns,
                     int64_t publish_ns, int64_t now_ns)
{
    struct host_peer *o = find(f, m->host);

    if (!o || is_stale(o, epoch_ns, publish_ns, now_ns))
        return;
    if (epoch_ns != o->epoch_ns) {
        begin_epoch(o, epoch_ns);
        o->other_file = m->launch_file != f->launch_file;
    }
    if (o->silent) {
        o->silent = false;
        o->returned = true;
        o->silence_ns = now_ns - o->heard_ns;
    }
    o->sent_ns = publish_ns;
    o->heard_ns = now_ns;
    o->ended |= o->ran && m->state != ANLOS__HOST_STATUS__STATE__RUNNING &&
                o->state == ANLOS__HOST_STATUS__STATE__RUNNING;
    o->ran |= m->state == ANLOS__HOST_STATUS__STATE__RUNNING;
    o->state = m->state;
    snprintf(o->text, sizeof o->text, "%s", m->text);
    for (size_t i = 0; i < m->n_sights; i++) {
        const Anlos__HostSight *sight = m->sights[i];
        if (strcmp(sight->host, f->name) != 0 || sight->epoch_ns != f->epoch_ns ||
            sight->sent_ns <= o->knows_ns)
            continue;
        o->knows_ns = sight->sent_ns;
        measure(o, sight, publish_ns, now_ns);
    }
}

void host_peers_say(struct host_peers *f, Anlos__HostStatus *out)
{
    anlos__host_status__init(out);
    out->host = f->name;
    out->state = f->state;
    out->text = f->text;
    out->launch_file = f->launch_file;
    out->sights = f->sight_list;
    for (size_t i = 0; i < f->n; i++) {
        struct host_peer *o = &f->list[i];
        if (!o->epoch_ns)
            continue;
        Anlos__HostSight *s = f->sight_list[out->n_sights] = &f->sights[out->n_sights];
        out->n_sights++;
        anlos__host_sight__init(s);
        s->host = o->name;
        s->epoch_ns = o->epoch_ns;
        s->sent_ns = o->sent_ns;
        s->heard_ns = o->heard_ns;
        s->silences = o->silences;
        best_sample(o, &s->clock_ahead_s, &s->round_trip_s);
    }
}

void host_peers_end(struct host_peers *f, Anlos__HostStatus__State state,
                    const char *text, int64_t now_ns)
{
    if (f->state != ANLOS__HOST_STATUS__STATE__RUNNING)
        return;
    f->state = state;
    f->state_ns = now_ns;
    snprintf(f->text, sizeof f->text, "%s", text);
}

static enum host_peers_verdict tell_end(const struct host_peer *o, char *text)
{
    switch (o->state) {
    case ANLOS__HOST_STATUS__STATE__DONE:
        snprintf(text, HOST_PEERS_TEXT_SIZE, "host %s: %.140s", o->name, o->text);
        return HOST_PEERS_DONE;
    case ANLOS__HOST_STATUS__STATE__FAILED:
        snprintf(text, HOST_PEERS_TEXT_SIZE, "host %s: %.140s", o->name, o->text);
        return HOST_PEERS_FAILED;
    default:
        snprintf(text, HOST_PEERS_TEXT_SIZE,
                 "host %s was stopped; this one waits %lld s for it to come back",
                 o->name, HOST_PEERS_PATIENCE_NS / 1000000000);
        return HOST_PEERS_WARNING;
    }
}

static enum host_peers_verdict tell_clock(const struct host_peer *o, char *text)
{
    double ahead_s, round_trip_s;

    best_sample(o, &ahead_s, &round_trip_s);
    snprintf(text, HOST_PEERS_TEXT_SIZE,
             "host %s: its clock is %.1f ms %s this one's, to within %.1f ms%s", o->name,
             1e3 * fabs(ahead_s), ahead_s < 0 ? "behind" : "ahead of",
             0.5e3 * round_trip_s,
             fabs(ahead_s) > FAR_APART_S
                 ? "; latencies between the two are wrong by that: set them by NTP or PTP"
                 : "");
    return fabs(ahead_s) > FAR_APART_S ? HOST_PEERS_WARNING : HOST_PEERS_NOTE;
}

/* true: what the flag stood for is to be told now, once. */
static bool take(bool *flag)
{
    bool was = *flag;

    *flag = false;
    return was;
}

static enum host_peers_verdict judge_one(struct host_peer *o, int64_t now_ns, char *text)
{
    int64_t quiet_ns = now_ns - o->heard_ns;

    if (take(&o->restarted)) {
        snprintf(text, HOST_PEERS_TEXT_SIZE, "host %s was started again", o->name);
        return HOST_PEERS_NOTE;
    }
    if (take(&o->other_file)) {
        snprintf(text, HOST_PEERS_TEXT_SIZE, "host %s runs from another launch file",
                 o->name);
        return HOST_PEERS_WARNING;
    }
    if (take(&o->returned)) {
        snprintf(text, HOST_PEERS_TEXT_SIZE, "host %s is heard again, after %.1f s",
                 o->name, 1e-9 * (double)o->silence_ns);
        return HOST_PEERS_WARNING;
    }
    if (take(&o->ended))
        return tell_end(o, text);
    if (take(&o->clock_known))
        return tell_clock(o, text);
    if (!o->ran || quiet_ns <= HOST_PEERS_SILENCE_NS)
        return HOST_PEERS_GO_ON;
    if (quiet_ns > HOST_PEERS_PATIENCE_NS) {
        snprintf(text, HOST_PEERS_TEXT_SIZE, "host %s has not been heard for %lld s",
                 o->name, HOST_PEERS_PATIENCE_NS / 1000000000);
        return HOST_PEERS_FAILED;
    }
    if (o->silent || o->state != ANLOS__HOST_STATUS__STATE__RUNNING)
        return HOST_PEERS_GO_ON;
    o->silent = true;
    o->silences++;
    snprintf(text, HOST_PEERS_TEXT_SIZE, "host %s is not heard any more", o->name);
    return HOST_PEERS_WARNING;
}

enum host_peers_verdict host_peers_judge(struct host_peers *f, int64_t now_ns,
                                         char text[HOST_PEERS_TEXT_SIZE])
{
    enum host_peers_verdict verdict = HOST_PEERS_GO_ON;

    for (size_t i = 0; i < f->n && verdict == HOST_PEERS_GO_ON; i++)
        verdict = judge_one(&f->list[i], now_ns, text);
    return verdict;
}

/* One that has ended too needs no word of us; one that was never heard gets none. */
static bool is_told(const struct host_peers *f, const struct host_peer *o, int64_t now_ns)
{
    return !o->epoch_ns || o->knows_ns >= f->state_ns ||
           o->state != ANLOS__HOST_STATUS__STATE__RUNNING ||
           now_ns - o->heard_ns > HOST_PEERS_FAREWELL_NS ||
           now_ns - f->state_ns > HOST_PEERS_FAREWELL_NS;
}

bool host_peers_may_leave(const struct host_peers *f, int64_t now_ns)
{
    for (size_t i = 0; i < f->n; i++)
        if (!is_told(f, &f->list[i], now_ns))
            return false;
    return true;
}

#define TELL_NS 500000000LL

int host_peering_open(struct host_peering *f, struct bus *bus, const struct hosts *hosts,
                      int64_t epoch_ns, uint64_t launch_file)
{
    *f = (struct host_peering){.bus = bus};
    host_peers_init(&f->host_peers, hosts, epoch_ns, launch_file);
    return f->host_peers.n ? bus_subscribe(bus, topic_host()) : 0;
}

void host_peering_hear(struct host_peering *f, const ProtobufCMessage *m,
                       const struct envelope *e, int64_t now_ns)
{
    host_peers_hear(&f->host_peers, (const Anlos__HostStatus *)m, e->epoch_ns,
                    e->publish_ns, now_ns);
}

int64_t host_peering_tell(struct host_peering *f, int64_t now_ns)
{
    Anlos__HostStatus status;

    if (!f->host_peers.n)
        return INT64_MAX;
    if (now_ns >= f->tell_ns) {
        host_peers_say(&f->host_peers, &status);
        bus_publish_message(f->bus, topic_host(), 0, now_ns, &status.base);
        f->tell_ns = now_ns + TELL_NS;
    }
    return f->tell_ns;
}

void host_peering_end(struct host_peering *f, int exit_code, const char *results,
                      int64_t now_ns)
{
    char text[HOST_PEERS_TEXT_SIZE] = "stopped";
    Anlos__HostStatus__State state = ANLOS__HOST_STATUS__STATE__LEFT;

    if (exit_code == EXIT_WORKED) {
        state = ANLOS__HOST_STATUS__STATE__DONE;
        snprintf(text, sizeof text, results ? "done, results are in %.150s" : "done",
                 results);
    } else if (exit_code <= 128) { /* else a signal */
        state = ANLOS__HOST_STATUS__STATE__FAILED;
        snprintf(text, sizeof text, "ended with exit code %d", exit_code);
    }
    host_peers_end(&f->host_peers, state, text, now_ns);
    f->tell_ns = now_ns;
}

bool host_peering_may_leave(const struct host_peering *f, int64_t now_ns)
{
    return host_peers_may_leave(&f->host_peers, now_ns);
}
