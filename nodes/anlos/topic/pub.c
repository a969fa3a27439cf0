/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/topic/topic.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "hal/clock.h"
#include "msgs/hosts.h"
#include "nodes/anlos/topic/message_json.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/stop.h"

#define JOIN_NS    1000000000LL /* for subscribers to find a publisher that is new */
#define REJOIN_NS  300000000LL  /* and for the others, once one has: its tries' period */
#define STALE_NS   1000000000LL /* a stamp that is farther from now is a recording's */
#define LOOK_UP_NS 50000000LL

static int64_t now_ns(void)
{
    return clock_now_ns(clock_system());
}

/* -- in whose name ----------------------------------------------------------------------
 */

/* The name under which others than nodes say it; NULL: nobody else does. */
static const char *outside_name(const struct topic *t)
{
    const char *name;

    for (size_t i = 0; (name = topic_publisher(t, i)); i++)
        if (!topics_have_node(name))
            return name;
    return NULL;
}

struct system {
    const char *run_dir;
    struct presence_locks locks;
    struct hosts hosts;
};

static bool runs(const struct system *s, const char *node)
{
    if (presence_of(&s->locks, s->run_dir, node) == PRESENCE_ALIVE)
        return true;
    for (size_t i = 0; i < s->hosts.n; i++)
        for (size_t k = 0; i != s->hosts.here && k < s->hosts.list[i].n_nodes; k++)
            if (!strcmp(s->hosts.list[i].nodes[k], node))
                return true;
    return false;
}

/* A node that says the same already; NULL: none.  What is asked for now and then is asked
 * by several. */
static const char *other_speaker(const struct system *s, const struct topic *t,
                                 const char *from)
{
    const char *name;

    for (size_t i = 0; t->rate_hz > 0.0 && (name = topic_publisher(t, i)); i++)
        if (topics_have_node(name) && strcmp(name, from) && runs(s, name))
            return name;
    return NULL;
}

static bool is_replay(const struct system *s)
{
    for (const char *const *n = topics_nodes(); *n; n++)
        if (presence_of(&s->locks, s->run_dir, *n) == PRESENCE_ALIVE &&
            presence_replays(s->run_dir, *n))
            return true;
    return false;
}

static int refuse(const struct system *s, const struct topic *t, const char *from,
                  bool force)
{
    if (is_replay(s))
        return usage_error("topic",
                           "the system in %s replays a bag: its processes refuse what is "
                           "said now",
                           s->run_dir);
    if (runs(s, from))
        return usage_error("topic", "pub %s: %s itself runs, and says it", t->name, from);
    if (force)
        return 0;
    if (topics_have_node(from))
        return usage_error("topic",
                           "pub %s: only the process %s says that, and what the sensor "
                           "states comes of it; --force says it in its place",
                           t->name, from);
    const char *other = other_speaker(s, t, from);
    return other ? usage_error("topic",
                               "pub %s: %s runs and says it already; --force says it "
                               "beside that",
                               t->name, other)
                 : 0;
}

/* 0, or an exit code. */
static int choose_name(const char *run_dir, const struct topic *t,
                       const struct pub_options *o, const char **from)
{
    const char *outside = outside_name(t);
    struct error why = {0};
    int code = EXIT_FAILED;

    *from = o->from ? o->from : outside ? outside : topic_publisher(t, 0);
    if (!topic_is_published_by(t, *from))
        return usage_error("topic", "--from %s: nobody of that name says %s", *from,
                           t->name);
    struct system *s = calloc(1, sizeof *s);
    if (!s)
        return usage_outcome("topic", -ENOMEM, &why);
    s->run_dir = run_dir;
    presence_read(&s->locks, NULL);
    if (hosts_read(&s->hosts, run_dir, &why))
        fprintf(stderr, "anlos topic: %s\n", why.text);
    else
        code = refuse(s, t, *from, o->force);
    free(s);
    return code;
}

/* -- publishing -------------------------------------------------------------------------
 */

struct pub {
    const struct topic *topic;
    const struct pub_options *o;
    const char *from;
    struct bus *bus;
    int64_t epoch_ns;
    uint64_t n; /* published */
    size_t line;
    int64_t due_ns;
};

static int pause_until(int64_t end_ns)
{
    for (int64_t left; !interrupt_requested() && (left = end_ns - now_ns()) > 0;) {
        const struct timespec t = {.tv_nsec = left < LOOK_UP_NS ? left : LOOK_UP_NS};
        nanosleep(&t, NULL);
    }
    return interrupt_requested() ? -EINTR : 0;
}

static size_t subscribers(struct pub *p)
{
    struct bus_count counts[32];
    size_t n = bus_counts(p->bus, counts, 32);

    for (size_t i = 0; i < n && i < 32; i++)
        if (counts[i].published && counts[i].topic == p->topic)
            return counts[i].peers;
    return 0;
}

/* What is sent before they have found this publisher they never hear. */
static int await_subscribers(struct pub *p)
{
    int64_t end_ns = now_ns() + JOIN_NS;
    int err = 0;

    while (!err && !subscribers(p) && now_ns() < end_ns)
        err = pause_until(now_ns() + LOOK_UP_NS / 5);
    if (!err && !subscribers(p))
        fprintf(stderr, "anlos topic: nobody listens to %s so far\n", p->topic->name);
    else if (!err)
        err = pause_until(now_ns() + REJOIN_NS);
    return err;
}

static int print(const struct pub *p, const ProtobufCMessage *m, int64_t capture_ns,
                 int64_t publish_ns)
{
    struct envelope e = {.sequence = p->n,
                         .epoch_ns = p->epoch_ns,
                         .capture_ns = capture_ns,
                         .publish_ns = publish_ns};
    const struct message_line l = {.topic = p->topic->name,
                                   .n_topic = strlen(p->topic->name),
                                   .envelope = &e,
                                   .n_bytes = protobuf_c_message_get_packed_size(m),
                                   .content = m};

    snprintf(e.node, sizeof e.node, "%s", p->from);
    errno = 0;
    int err = message_line_write(&l, false, stdout);
    return !err && fflush(stdout) ? (errno ? -errno : -EIO) : err;
}

static int publish(struct pub *p, const ProtobufCMessage *m, int64_t capture_ns,
                   struct error *why)
{
    int64_t now = now_ns();

    capture_ns = capture_ns ? capture_ns : now;
    int err = bus_publish_message(p->bus, p->topic, capture_ns, now, m);
    if (err == -EMSGSIZE)
        return error_say(why, err, "larger than a message of %s may be, %zu bytes",
                         p->topic->name, p->topic->max_size);
    if (err)
        return error_say(why, err, "%s", strerror(-err));
    err = p->o->print ? print(p, m, capture_ns, now) : 0;
    p->n += !err;
    return err;
}

/* -- a line of JSON ---------------------------------------------------------------------
 */

static int check_stamp(const struct pub *p, int64_t capture_ns, struct error *why)
{
    double off_s = 1e-9 * (double)(capture_ns - now_ns());

    if (p->o->force || !capture_ns || fabs(off_s) < 1e-9 * (double)STALE_NS)
        return 0;
    return error_say(why, -EINVAL,
                     "capture_ns is %.1f s %s now: a recording is for 'anlos bag play', "
                     "and --force says it as if it were now",
                     fabs(off_s), off_s < 0.0 ? "before" : "after");
}

/* Of a line as echo prints it: its content. */
static int open_line(const struct pub *p, const json_t **j, int64_t *capture_ns,
                     struct error *why)
{
    const json_t *content = json_object_get(*j, "content");
    const json_t *stamp = json_object_get(*j, "capture_ns");
    const char *topic = json_string_value(json_object_get(*j, "topic"));

    if (!content)
        return 0;
    if (topic && strcmp(topic, p->topic->name))
        return error_say(why, -EINVAL, "a message of %s, not of %s", topic,
                         p->topic->name);
    if (json_is_true(json_object_get(*j, "replayed")) && !p->o->force)
        return error_say(why, -EINVAL,
                         "it was replayed: --force says it as if it were now");
    if (stamp && !json_is_integer(stamp))
        return error_say(why, -EINVAL, "capture_ns: expected a whole number");
    *j = content;
    *capture_ns = json_integer_value(stamp);
    if (*capture_ns < 0 || *capture_ns > ENVELOPE_MAX_STAMP)
        return error_say(why, -EINVAL, "capture_ns: out of range");
    return check_stamp(p, *capture_ns, why);
}

/* *capture_ns 0: now. */
static int read_line(const struct pub *p, const char *text, size_t n,
                     ProtobufCMessage **out, int64_t *capture_ns, struct error *why)
{
    json_error_t wrong;
    json_t *all = json_loadb(text, n, JSON_REJECT_DUPLICATES | JSON_ALLOW_NUL, &wrong);
    const json_t *j = all;

    *capture_ns = 0;
    if (!all)
        return error_say(why, -EINVAL, "no JSON: %s, at character %d", wrong.text,
                         wrong.position);
    int err = open_line(p, &j, capture_ns, why);
    if (!err)
        err = json_message(out, j, p->topic->schema, why);
    json_decref(all);
    return err;
}

static bool is_blank(const char *text, size_t n)
{
    return strspn(text, " \t\r\n") >= n;
}

/* Paced, and no more than were asked for: -ENODATA then. */
static int await_turn(struct pub *p)
{
    if (p->o->count && p->n >= p->o->count)
        return -ENODATA;
    if (p->o->rate_hz <= 0.0)
        return interrupt_requested() ? -EINTR : 0;
    int err = pause_until(p->due_ns);
    int64_t now = now_ns(), step_ns = (int64_t)(1e9 / p->o->rate_hz);
    p->due_ns = p->due_ns && p->due_ns + step_ns > now ? p->due_ns + step_ns
                                                       : now + step_ns;
    return err;
}

static int publish_argument(struct pub *p, struct error *why)
{
    ProtobufCMessage *m;
    int64_t capture_ns;
    size_t most = p->o->count ? p->o->count : p->o->rate_hz > 0.0 ? SIZE_MAX : 1;
    int err = read_line(p, p->o->json, strlen(p->o->json), &m, &capture_ns, why);

    if (err)
        return err;
    err = await_subscribers(p);
    while (!err && p->n < most) {
        err = await_turn(p);
        if (!err)
            err = publish(p, m, capture_ns, why);
    }
    protobuf_c_message_free_unpacked(m, NULL);
    return err;
}

static int publish_line(struct pub *p, const char *text, size_t n, struct error *why)
{
    ProtobufCMessage *m;
    int64_t capture_ns;
    int err = read_line(p, text, n, &m, &capture_ns, why);

    if (err)
        return err;
    err = await_turn(p);
    if (!err)
        err = publish(p, m, capture_ns, why);
    protobuf_c_message_free_unpacked(m, NULL);
    return err;
}

static int publish_lines(struct pub *p, struct error *why)
{
    char *text = NULL;
    size_t room = 0;
    ssize_t n;
    int err = await_subscribers(p);

    while (!err && (!p->o->count || p->n < p->o->count) &&
           (n = getline(&text, &room, stdin)) >= 0) {
        p->line++;
        if (!is_blank(text, (size_t)n))
            err = publish_line(p, text, (size_t)n, why);
    }
    free(text);
    if (!err && interrupt_requested())
        return -EINTR;
    if (!err && ferror(stdin))
        return error_say(why, -EIO, "standard input: cannot be read");
    return err;
}

static int say(const struct pub *p, int err, const struct error *why)
{
    if (!err || err == -ENODATA)
        return EXIT_WORKED;
    if (err == -EINTR)
        return EXIT_INTERRUPTED;
    if (ferror(stdout))
        return usage_unwritten("topic", err);
    if (p->line)
        fprintf(stderr, "anlos topic: line %zu: ", p->line);
    else
        fprintf(stderr, "anlos topic: pub %s: ", p->topic->name);
    fprintf(stderr, "%s\n", why->text[0] ? why->text : strerror(-err));
    return err == -EINVAL || err == -EMSGSIZE ? EXIT_BAD_INPUT : EXIT_FAILED;
}

int pub_run(const char *run_dir, const struct topic *t, const struct pub_options *o)
{
    struct pub p = {.topic = t, .o = o, .epoch_ns = now_ns()};
    struct error why = {0};
    bool lines = !o->json || !strcmp(o->json, "-");
    int code = choose_name(run_dir, t, o, &p.from);

    if (code)
        return code;
    const struct bus_config cfg = {
        .node = p.from, .run_dir = run_dir, .epoch_ns = p.epoch_ns, .world = BUS_LIVE};
    int err = bus_create(&p.bus, &cfg, &why);
    if (err)
        return usage_outcome("topic", err, &why);
    err = lines ? publish_lines(&p, &why) : publish_argument(&p, &why);
    if (p.n && (!err || err == -ENODATA)) /* what is on its way is not cut off */
        pause_until(now_ns() + LOOK_UP_NS);
    bus_destroy(p.bus);
    return say(&p, err, &why);
}
