#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/topic/watch.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/rundir.h"

static const char help[] =
    "anlos topic -- look at the messages of a running system\n"
    "\n"
    "usage: anlos topic list\n"
    "       anlos topic echo TOPIC [--count N] [--full] [--wait] [--run-dir DIR]\n"
    "       anlos topic hz [TOPIC...] [--seconds S] [--wait] [--run-dir DIR]\n"
    "\n"
    "  list            every topic: schema, expected rate, queue policy, publishers\n"
    "  echo            prints messages as JSON, one a line; sound and images as type,\n"
    "                  shape, least and greatest value\n"
    "  hz              listens for some seconds: rate against the expected one, "
    "bandwidth,\n"
    "                  messages that got lost; all topics when none is named\n"
    "\n"
    "  --count N       stop after N messages, default: never\n"
    "  --full          print every number of sound and images\n"
    "  --seconds S     how long hz listens, default 5\n"
    "  --wait          go on when nothing is running yet\n"
    "  --run-dir DIR   where the system's sockets are, default $XDG_RUNTIME_DIR/anlos, "
    "else\n"
    "                  /tmp/anlos-UID\n"
    "  --help          this text\n"
    "\n"
    "Writes no files.\n"
    "\n"
    "examples\n"
    "  anlos topic hz --seconds 10\n"
    "  anlos topic echo detections --count 1 | jq .content.detections\n"
    "\n"
    "exit codes: 0 done; 1 nothing is running, or failed; 2 bad arguments;\n"
    "130 stopped by Ctrl-C\n";

static const struct option options[] = {
    {"count", required_argument, NULL, 'c'},
    {"full", no_argument, NULL, 'f'},
    {"seconds", required_argument, NULL, 's'},
    {"wait", no_argument, NULL, 'w'},
    {"run-dir", required_argument, NULL, 'r'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

struct topic_options {
    const char *run_dir; /* NULL: the default */
    size_t count;
    double seconds;
    bool full, wait;
};

static int list_topics(void)
{
    printf("%-14s %-20s %8s  %-7s %6s %9s  %s\n", "topic", "schema", "rate", "policy",
           "depth", "max size", "published by");
    for (const struct topic *t = topics_all(); t->name; t++) {
        char rate[16] = "-";
        if (t->rate_hz > 0.0)
            snprintf(rate, sizeof rate, "%g Hz", t->rate_hz);
        printf("%-14s %-20s %8s  %-7s %6zu %6zu kB ", t->name, t->schema->name, rate,
               t->policy == TOPIC_ALL ? "all" : "latest", t->depth, t->max_size / 1024);
        for (size_t i = 0; i < 8 && t->publishers[i]; i++)
            printf(" %s",
                   strcmp(t->publishers[i], "*") ? t->publishers[i] : "every node");
        printf("\n");
    }
    return fflush(stdout) ? EXIT_FAILED : EXIT_WORKED;
}

static int take_option(struct topic_options *o, int code, char **argv)
{
    switch (code) {
    case 'c':
        if (!usage_count(optarg, 1, SIZE_MAX, &o->count))
            return 0;
        return usage_error("topic", "--count %s: expected a whole number above 0",
                           optarg);
    case 's':
        if (!usage_positive(optarg, &o->seconds))
            return 0;
        return usage_error("topic", "--seconds %s: expected a number above 0", optarg);
    case 'f':
        o->full = true;
        return 0;
    case 'w':
        o->wait = true;
        return 0;
    case 'r':
        o->run_dir = optarg;
        return 0;
    default:
        return usage_option_error("topic", code, argv, options);
    }
}

/* The topics named, or all.  Returns 0 or an exit code. */
static int find_topics(char **names, size_t n_names, const struct topic ***out, size_t *n)
{
    size_t all = 0;
    while (topics_all()[all].name)
        all++;
    *n = n_names ? n_names : all;
    *out = calloc(*n, sizeof **out);
    if (!*out) {
        fprintf(stderr, "anlos topic: out of memory\n");
        return EXIT_FAILED;
    }
    for (size_t i = 0; i < *n; i++) {
        (*out)[i] = n_names ? topics_find(names[i]) : &topics_all()[i];
        if (!(*out)[i])
            return usage_error("topic",
                               "%s: no such topic; 'anlos topic list' has their names",
                               names[i]);
    }
    return 0;
}

static int watch(bool echo, const struct topic *const *topics, size_t n,
                 const struct topic_options *o)
{
    char run_dir[RUNDIR_SIZE];
    struct complaint why = {0};
    struct bus *bus;

    if (rundir_open(run_dir, o->run_dir, &why)) {
        fprintf(stderr, "anlos topic: %s\n", why.text);
        return EXIT_BAD_INPUT;
    }
    if (!topic_watch_alive(run_dir)) {
        fprintf(stderr, "anlos topic: nothing is running in %s%s\n", run_dir,
                o->wait ? " yet; waiting"
                        : "; start it with 'anlos launch FILE', or name "
                          "its folder with --run-dir");
        if (!o->wait)
            return EXIT_FAILED;
    }
    interrupt_catch();
    int err = topic_watch_open(&bus, run_dir, topics, n, &why);
    if (err) {
        fprintf(stderr, "anlos topic: %s\n", why.text);
        return EXIT_FAILED;
    }
    err = echo ? topic_watch_echo(bus, o->count, o->full)
               : topic_watch_rates(bus, topics, n, o->seconds);
    bus_destroy(bus);
    if (!err)
        return EXIT_WORKED;
    if (err == -EINTR)
        return EXIT_INTERRUPTED;
    fprintf(stderr, "anlos topic: %s\n", strerror(-err));
    return EXIT_FAILED;
}

int command_topic(int argc, char **argv)
{
    struct topic_options o = {.seconds = 5.0};
    const struct topic **topics = NULL;
    size_t n = 0;
    int code;

    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
        if (code == 'h')
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
        code = take_option(&o, code, argv);
        if (code)
            return code;
    }
    const char *verb = optind < argc ? argv[optind] : "";
    char **names = argv + optind + 1;
    int n_names = argc - optind - 1;
    bool echo = !strcmp(verb, "echo");
    if (!strcmp(verb, "list") && n_names <= 0)
        return list_topics();
    if (!echo && strcmp(verb, "hz"))
        return usage_error("topic",
                           *verb ? "%s: expected list, echo TOPIC or hz [TOPIC...]"
                                 : "%slist, echo TOPIC or hz is missing",
                           verb);
    if (echo && n_names != 1)
        return usage_error("topic", "echo: expected one topic");
    code = find_topics(names, (size_t)n_names, &topics, &n);
    if (!code)
        code = watch(echo, topics, n, &o);
    free(topics);
    return code;
}
