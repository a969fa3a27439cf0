/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/topic/topic.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "dsp/error.h"
#include "hal/clock.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/feed.h"
#include "nodes/anlos/topic/message_json.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/stop.h"
#include "nodes/rt/terminal.h"

/* -- listening to a running system ------------------------------------------------------
 */

#define LOOK_UP_MS 100 /* between looks at Ctrl-C and the clock */
#define REDRAW_NS  1000000000LL
#define KEEP_BYTES ((size_t)256 << 20) /* that may wait to be looked at */

enum { MAX_TOPICS = 64 };

struct topic_watch {
    void (*table)(const struct tally *t, double elapsed_s, FILE *f);
    bool delays;    /* keep them for the table */
    bool survey;    /* the table asks what it says of pings */
    bool live;      /* stdout is a terminal: drawn anew every second */
    double seconds; /* 0: until Ctrl-C */
};

static int topic_watch_open(struct bus **out, const char *run_dir,
                            const struct topic *const *topics, size_t n,
                            struct error *why)
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
    if (fclose(f) || !text) {
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

static int topic_watch_tally(struct bus *bus, const struct topic *const *topics, size_t n,
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

/* -- the command line -------------------------------------------------------------------
 */

#define DEFAULT_SECONDS 5.0

static const char help[] =
    "anlos topic -- look at the messages of a running system, and add to them\n"
    "\n"
    "usage: anlos topic list [--json]\n"
    "       anlos topic echo TOPIC... [OPTION...]\n"
    "       anlos topic pub TOPIC [JSON|-] [OPTION...]\n"
    "       anlos topic hz|bw|delay [TOPIC...] [OPTION...]\n"
    "\n"
    "  list            every topic: schema, expected rate, queue policy, publishers\n"
    "  echo            prints messages as JSON, one a line; sound and images as type,\n"
    "                  shape, least and greatest value\n"
    "  pub             publishes the message JSON, or those that come on standard "
    "input,\n"
    "                  one a line: the fields of the schema, or a line of echo. What is\n"
    "                  left out has its default (0, false, empty)\n"
    "  hz              how often they come, against the expected rate (of pings that of\n"
    "                  the survey's slots); mean, least and\n"
    "                  greatest interval, its standard deviation; messages that got "
    "lost\n"
    "  bw              bytes a second; mean, least and greatest size of a message\n"
    "  delay           median and 99th percentile of the time from when a message's "
    "sound\n"
    "                  was taken to its arrival here, and from when it was sent; of the\n"
    "                  newest 4096 messages\n"
    "\n"
    "  hz, bw and delay have a row for each topic (all when none is named) and sender.\n"
    "  A replayed message has no delays: its times are not those of now.\n"
    "  On a terminal the table is drawn anew every second until Ctrl-C; in a pipe or "
    "file\n"
    "  it is printed once.\n"
    "\n"
    "  --json          list, echo: as JSON, which of echo is the default\n"
    "  --mcap          echo: as a bag (MCAP) for programs, with all bytes\n"
    "  --count N       echo, pub: stop after N messages, default: never\n"
    "  --timeout S     echo: give up when no message comes for S seconds\n"
    "  --field PATH    echo: only this field, as detections.0.position_m; without a\n"
    "                  number that of each\n"
    "  --full          echo: print every number of sound and images\n"
    "  --rate HZ       pub: JSON so often, until Ctrl-C; lines at most so fast\n"
    "  --once          pub: one message, as --count 1\n"
    "  --print         pub: print each message as echo does\n"
    "  --from NAME     pub: in whose name, of those that the topic has\n"
    "  --force         pub: although a process says it, or only one should\n"
    "  --seconds S     how long hz, bw and delay listen; default 5 in a pipe or file\n"
    "  --wait          go on when nothing is running yet\n"
    "  --run-dir DIR   where the system's sockets are, default $XDG_RUNTIME_DIR/anlos, "
    "else\n"
    "                  /tmp/anlos-UID\n"
    "  --help          this text\n"
    "\n"
    "From outside come ego, ambient and wall/given, in the name vehicle, while no "
    "process\n"
    "can runs, and stage/manual. What the processes themselves say takes --force, and\n"
    "that the process does not run. A message's stamps are of now.\n"
    "\n"
    "Writes no files.\n"
    "\n"
    "examples\n"
    "  anlos topic hz --seconds 10\n"
    "  anlos topic delay traces volume detections\n"
    "  anlos topic echo detections --count 1 | jq .content.detections\n"
    "  anlos topic echo log | jq -r '.content | .node + \": \" + .text'\n"
    "  anlos topic echo ego --field speed_m_s\n"
    "  anlos topic pub ambient '{\"temperature_c\": 21.5, \"humidity\": 0.4}'\n"
    "  my-odometry | anlos topic pub ego -\n"
    "\n"
    "exit codes: 0 done; 1 nothing is running, nothing came in time, or failed; 2 bad\n"
    "arguments or message, or not permitted; 130 stopped by Ctrl-C\n";

struct topic_options {
    const char *run_dir; /* NULL: the default */
    size_t count;
    double seconds; /* 0: not said */
    bool wait, json;
    struct echo_options echo;
    struct pub_options pub;
    char given[16]; /* the letters of the options that were, each once */
};

/* In ns, and added to the time of day, they have to be int64. */
#define SECONDS(field)                                                                   \
    USAGE_NUMBER(struct topic_options, field, USAGE_ABOVE_0, 1e9),                       \
        .expected = "a number above 0, up to 1e+09"
#define FLAG(field) USAGE_FLAG(struct topic_options, field)
#define TEXT(field) USAGE_TEXT(struct topic_options, field)

static const struct usage_option options[] = {
    {"json", FLAG(json), .code = 'j'},
    {"mcap", FLAG(echo.mcap), .code = 'm'},
    {"count", USAGE_COUNT(struct topic_options, count, 1, SIZE_MAX), .code = 'c',
     .expected = "a whole number above 0"},
    {"timeout", SECONDS(echo.timeout_s), .code = 't'},
    {"field", TEXT(echo.field), .code = 'p'},
    {"full", FLAG(echo.full), .code = 'f'},
    {"rate", USAGE_NUMBER(struct topic_options, pub.rate_hz, USAGE_ABOVE_0, 1e6),
     .code = 'a', .expected = "a number above 0, up to 1e+06"},
    {"once", USAGE_SWITCH('o')},
    {"print", FLAG(pub.print), .code = 'i'},
    {"from", TEXT(pub.from), .code = 'n'},
    {"force", FLAG(pub.force), .code = 'F'},
    {"seconds", SECONDS(seconds), .code = 's'},
    {"wait", FLAG(wait), .code = 'w'},
    {"run-dir", TEXT(run_dir), .code = 'r'},
    {.name = NULL},
};

static const struct watched {
    const char *verb;
    const char *takes;      /* letters of options */
    struct topic_watch how; /* without table: echo, pub */
} verbs[] = {
    {"echo", "jmctpfwr", {0}},
    {"pub", "caoinFwr", {0}},
    {"hz", "swr", {.table = topic_table_rates, .survey = true}},
    {"bw", "swr", {.table = topic_table_sizes}},
    {"delay", "swr", {.table = topic_table_delays, .delays = true}},
    {"list", "jr", {0}},
};

#define N_VERBS (sizeof verbs / sizeof *verbs)

/* Of a topic without an expected rate it is null. */
static json_t *topics_json(void)
{
    json_t *all = json_array();

    for (const struct topic *t = topics_all(); t->name; t++) {
        json_t *publishers = json_array();
        for (size_t i = 0; topic_publisher(t, i); i++)
            json_array_append_new(publishers, json_string(topic_publisher(t, i)));
        json_array_append_new(
            all, json_pack("{ss, ss, so, ss, sI, sI, so}", "topic", t->name, "schema",
                           t->schema->name, "rate_hz",
                           t->rate_hz > 0.0 ? json_real(t->rate_hz) : json_null(),
                           "policy", t->policy == TOPIC_ALL ? "all" : "latest", "depth",
                           (json_int_t)t->depth, "max_bytes", (json_int_t)t->max_size,
                           "publishers", publishers));
    }
    return all;
}

static int list_topics(bool json)
{
    if (json)
        return usage_json("topic", topics_json());
    topic_table_all(stdout);
    return usage_flush("topic");
}

/* Which options were given. */
static void note_option(struct topic_options *o, int code)
{
    size_t n = strlen(o->given);

    if (n + 1 < sizeof o->given && !strchr(o->given, code))
        o->given[n] = (char)code;
    o->count = code == 'o' ? 1 : o->count;
}

/* An option that would not be heeded.  Returns 0 or an exit code. */
static int check_options(const struct topic_options *o, const struct watched *v)
{
    for (const char *c = o->given; *c; c++) {
        const struct usage_option *odd = options;
        while (odd->code != *c)
            odd++;
        if (!strchr(v->takes, *c))
            return usage_error("topic", "--%s: %s has no such option", odd->name,
                               v->verb);
    }
    if (o->echo.mcap && (o->json || o->echo.full || o->echo.field))
        return usage_error("topic", "--mcap: not with --%s",
                           o->json        ? "json"
                           : o->echo.full ? "full"
                                          : "field");
    return 0;
}

static int refuse_topic(const char *name)
{
    struct nearest s = nearest_begin(name, strlen(name), 2);

    for (const struct topic *t = topics_all(); t->name; t++)
        nearest_try(&s, t->name);
    if (s.best)
        return usage_error("topic", "%s: no such topic; did you mean %s?", name, s.best);
    return usage_error("topic", "%s: no such topic; 'anlos topic list' has their names",
                       name);
}

/* The topics named, or all.  Returns 0 or an exit code. */
static int find_topics(char **names, size_t n_names, const struct topic ***out, size_t *n)
{
    *n = n_names ? n_names : TOPICS_COUNT;
    *out = calloc(*n, sizeof **out);
    if (!*out) {
        fprintf(stderr, "anlos topic: out of memory\n");
        return EXIT_FAILED;
    }
    for (size_t i = 0; i < *n; i++) {
        (*out)[i] = n_names ? topics_find(names[i]) : &topics_all()[i];
        if (!(*out)[i])
            return refuse_topic(names[i]);
    }
    return 0;
}

static int run_verb(struct bus *bus, const struct watched *v,
                    const struct topic *const *topics, size_t n,
                    const struct topic_options *o)
{
    struct topic_watch how = v->how;

    if (!how.table) {
        struct echo_options echo = o->echo;
        echo.count = o->count;
        return echo_run(bus, topics, n, &echo);
    }
    how.live = isatty(STDOUT_FILENO);
    how.seconds = o->seconds > 0.0 || how.live ? o->seconds : DEFAULT_SECONDS;
    return topic_watch_tally(bus, topics, n, &how);
}

/* The run folder of a system that runs, or will.  0, or an exit code. */
static int open_run_dir(char run_dir[RUNDIR_SIZE], const struct topic_options *o)
{
    struct error why = {0};

    if (rundir_name(run_dir, o->run_dir, &why) || rundir_check(run_dir, &why)) {
        fprintf(stderr, "anlos topic: %s\n", why.text);
        return EXIT_BAD_INPUT;
    }
    interrupt_catch();
    if (!feed_answers(run_dir)) {
        feed_say_nothing_runs("topic", run_dir, o->wait);
        if (!o->wait)
            return EXIT_FAILED;
    }
    if (rundir_open(run_dir, o->run_dir, &why)) {
        fprintf(stderr, "anlos topic: %s\n", why.text);
        return EXIT_BAD_INPUT;
    }
    return 0;
}

static int watch(const struct watched *v, const struct topic *const *topics, size_t n,
                 const struct topic_options *o)
{
    char run_dir[RUNDIR_SIZE];
    struct error why = {0};
    struct bus *bus;
    int code = open_run_dir(run_dir, o);

    if (code)
        return code;
    int err = topic_watch_open(&bus, run_dir, topics, n, &why);
    if (err) {
        fprintf(stderr, "anlos topic: %s\n", why.text);
        return EXIT_FAILED;
    }
    err = run_verb(bus, v, topics, n, o);
    bus_destroy(bus);
    if (!err)
        return EXIT_WORKED;
    if (err == -EINTR)
        return EXIT_INTERRUPTED;
    if (ferror(stdout))
        return usage_unwritten("topic", err);
    if (err == -ETIMEDOUT)
        fprintf(stderr, "anlos topic: no message for %g s\n", o->echo.timeout_s);
    else
        fprintf(stderr, "anlos topic: %s\n", strerror(-err));
    return EXIT_FAILED;
}

static int publish(const struct topic *t, const char *json, const struct topic_options *o)
{
    struct pub_options pub = o->pub;
    char run_dir[RUNDIR_SIZE];
    int code = open_run_dir(run_dir, o);

    pub.json = json;
    pub.count = o->count;
    return code ? code : pub_run(run_dir, t, &pub);
}

static int check_field(const char *path, const struct topic *const *topics, size_t n)
{
    struct error why = {0};

    for (size_t i = 0; i < n; i++)
        if (field_path_check(path, topics[i]->schema, &why))
            return usage_error("topic", "--field %s: %s", path, why.text);
    return 0;
}

/* words[n]: what follows the verb. */
static int run_words(const struct watched *v, char **words, size_t n,
                     const struct topic_options *o)
{
    const struct topic **topics = NULL;
    size_t n_topics = 0;
    bool pub = !strcmp(v->verb, "pub"), echo = !strcmp(v->verb, "echo");

    if (echo && !n)
        return usage_error("topic", "echo: expected a topic");
    if (pub && (n < 1 || n > 2))
        return usage_error("topic", "pub: expected one topic, and one message in quotes "
                                    "or -");
    int code = find_topics(words, pub ? 1 : n, &topics, &n_topics);
    if (!code && o->echo.field)
        code = check_field(o->echo.field, topics, n_topics);
    if (!code)
        code = pub ? publish(topics[0], n > 1 ? words[1] : NULL, o)
                   : watch(v, topics, n_topics, o);
    free(topics);
    return code;
}

int command_topic(int argc, char **argv)
{
    struct topic_options o = {0};
    struct usage usage = {
        .command = "topic", .help = help, .options = options, .into = &o};
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        note_option(&o, code);
    if (code)
        return ~code;
    const char *verb = optind < argc ? argv[optind] : "";
    size_t n = optind < argc ? (size_t)(argc - optind - 1) : 0;
    const struct watched *v = verbs;
    while (v < verbs + N_VERBS && strcmp(verb, v->verb))
        v++;
    if (v == verbs + N_VERBS)
        return usage_error("topic",
                           *verb
                               ? "%s: expected list, echo TOPIC..., pub TOPIC, or hz, bw "
                                 "or delay [TOPIC...]"
                               : "%slist, echo, pub, hz, bw or delay is missing",
                           verb);
    code = check_options(&o, v);
    if (code)
        return code;
    if (strcmp(verb, "list"))
        return run_words(v, argv + optind + 1, n, &o);
    return n ? usage_error("topic", "list: expected nothing after it")
             : list_topics(o.json);
}
