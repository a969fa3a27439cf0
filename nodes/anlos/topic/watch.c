#include "nodes/anlos/topic/watch.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hal/clock.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/live.h"
#include "nodes/anlos/topic/message_json.h"

#define LOOK_UP_MS 100 /* between looks at Ctrl-C and the clock */
#define REDRAW_NS  1000000000LL
#define KEEP_BYTES ((size_t)256 << 20) /* that may wait to be looked at */

enum { MAX_TOPICS = 64 };

int topic_watch_open(struct bus **out, const char *run_dir,
                     const struct topic *const *topics, size_t n, struct error *why)
{
    struct bus_config cfg = {.run_dir = run_dir, .listen_only = true};
    int err = bus_create(out, &cfg, why);
    if (!err) /* INT64_MAX: no publisher counts as one that starts later */
        bus_keep_all(*out, KEEP_BYTES, INT64_MAX);
    for (size_t i = 0; !err && i < n; i++) {
        err = bus_subscribe(*out, topics[i]);
        if (err) {
            error_say(why, err, "topic %s: %s", topics[i]->name, strerror(-err));
            bus_destroy(*out);
        }
    }
    return err;
}

static int echo_message(const struct bus_message *m, bool full)
{
    ProtobufCMessage *content = bus_message_unpack(m);
    const struct message_line l = {.topic = m->topic->name,
                                   .n_topic = strlen(m->topic->name),
                                   .envelope = &m->envelope,
                                   .n_bytes = m->envelope.payload_size,
                                   .content = content,
                                   .why_not = "not a message of the topic's schema"};
    errno = 0;
    int err = message_line_write(&l, full, stdout);
    if (!err && fflush(stdout))
        err = errno ? -errno : -EIO;
    if (content)
        protobuf_c_message_free_unpacked(content, NULL);
    return err;
}

int topic_watch_echo(struct bus *bus, size_t count, bool full)
{
    for (size_t seen = 0; !count || seen < count;) {
        struct bus_message m;
        int err = bus_receive(bus, &m, LOOK_UP_MS);
        if (interrupt_requested()) {
            if (!err)
                bus_message_free(&m);
            return -EINTR;
        }
        if (err == -ETIMEDOUT)
            continue;
        if (err)
            return err;
        err = echo_message(&m, full);
        bus_message_free(&m);
        if (err)
            return err == -EPIPE ? 0 : err; /* `| head` has seen enough */
        seen++;
    }
    return 0;
}

/* Adds a message if its topic was asked for, and not only heard for what it says. */
static int take(struct tally *t, const struct topic_watch *w, bool listed,
                const struct bus_message *m)
{
    ProtobufCMessage *content = NULL;

    if (w->survey && m->topic == topic_survey())
        content = bus_message_unpack(m);
    if (content) {
        tally_survey(t, (const Anlos__Survey *)content);
        protobuf_c_message_free_unpacked(content, NULL);
    }
    return m->topic == topic_survey() && !listed
               ? 0
               : tally_add(t, m, clock_now_ns(clock_system()));
}

/* Listens until end_ns, taking every message as soon as it comes.  0, -EINTR, -ENOMEM. */
static int listen_until(struct bus *bus, struct tally *t, const struct topic_watch *w,
                        bool survey_listed, int64_t end_ns)
{
    for (;;) {
        struct bus_message m;
        int64_t now_ns = clock_now_ns(clock_system());
        if (interrupt_requested())
            return -EINTR;
        if (now_ns >= end_ns)
            return 0;
        int64_t left_ms = (end_ns - now_ns) / 1000000 + 1;
        int err = bus_receive(bus, &m, left_ms < LOOK_UP_MS ? (int)left_ms : LOOK_UP_MS);
        if (err == -ETIMEDOUT)
            continue;
        if (!err) {
            err = take(t, w, survey_listed, &m);
            bus_message_free(&m);
        }
        if (err)
            return err;
    }
}

/* What came to grief here and shows in no row. */
static void print_rest(struct bus *bus, FILE *f)
{
    uint64_t dropped = 0, refused = bus_refused(bus);
    struct bus_count counts[MAX_TOPICS];
    size_t n = bus_counts(bus, counts, MAX_TOPICS);

    for (size_t i = 0; i < n && i < MAX_TOPICS; i++)
        dropped += counts[i].dropped;
    if (refused)
        fprintf(f, "%" PRIu64 " messages were refused (wrong magic, version or length)\n",
                refused);
    if (dropped)
        fprintf(f,
                "%" PRIu64 " messages came faster than they were looked at: they count "
                "as gaps here, not in the system\n",
                dropped);
}

static int show(struct bus *bus, const struct tally *t, const struct topic_watch *w,
                struct live *live, double elapsed_s)
{
    char *text = NULL;
    size_t size, rows, columns;
    FILE *f = open_memstream(&text, &size);
    int err = 0;

    if (!f)
        return -ENOMEM;
    w->table(t, elapsed_s, f);
    print_rest(bus, f);
    if (fclose(f)) {
        err = -ENOMEM;
    } else if (w->live) {
        live_size(STDOUT_FILENO, &rows, &columns);
        err = live_draw(live, text, rows, columns);
    } else if (fputs(text, stdout) == EOF || fflush(stdout)) {
        err = -errno;
    }
    free(text);
    return err;
}

static bool is_listed(const struct topic *const *topics, size_t n,
                      const struct topic *topic)
{
    size_t i = 0;

    while (i < n && topics[i] != topic)
        i++;
    return i < n;
}

int topic_watch_tally(struct bus *bus, const struct topic *const *topics, size_t n,
                      const struct topic_watch *w)
{
    struct live live = {.f = stdout};
    struct tally t;
    int64_t began_ns = clock_now_ns(clock_system()), now_ns = began_ns;
    int64_t end_ns = w->seconds > 0.0 ? began_ns + (int64_t)(1e9 * w->seconds)
                                      : INT64_MAX;
    bool survey_listed = is_listed(topics, n, topic_survey());
    int err = tally_open(&t, topics, n, w->delays);

    if (!err && w->survey && !survey_listed)
        err = bus_subscribe(bus, topic_survey());

    while (!err && now_ns < end_ns) {
        int64_t next_ns = now_ns + REDRAW_NS;
        err = listen_until(bus, &t, w, survey_listed,
                           w->live && next_ns < end_ns ? next_ns : end_ns);
        now_ns = clock_now_ns(clock_system());
        if (!err || err == -EINTR) {
            int shown = show(bus, &t, w, &live, 1e-9 * (double)(now_ns - began_ns));
            err = err ? err : shown;
        }
    }
    tally_clear(&t);
    return err;
}
