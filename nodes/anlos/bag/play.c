#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/play_keys.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/launchfile_play.h"

static const char help[] =
    "anlos bag play -- play a recording onto the bus, in the place of who was recorded\n"
    "\n"
    "usage: anlos bag play FILE [options]\n"
    "\n"
    "  FILE            a bag\n"
    "  --rate R        of its pace: 1 (default), 10, 0.5; max: as fast as it is used\n"
    "  --loop          begins again at its end\n"
    "  --start S       from S seconds after the first message on\n"
    "  --end S         up to S seconds after the first message\n"
    "  --topics T      only these: names or patterns with commas between, survey,scan/*\n"
    "  --exclude T     all but these\n"
    "  --remap A:=B    what the bag calls A is of topic B; several with commas between\n"
    "  --paused        waits for the space bar before the first message\n"
    "  --run-dir DIR   where the system's sockets are, default $XDG_RUNTIME_DIR/anlos,\n"
    "                  else /tmp/anlos-UID\n"
    "  --help          this text\n"
    "\n"
    "A folder where a live system runs is refused.  It plays to view, record, top, and "
    "to\n"
    "nodes that were started with --replay; what those say themselves is not played.  "
    "Play\n"
    "waits until they are ready and, at any pace, until pings are used, so that none is\n"
    "lost.  Sources say replay, and topic clock says where it is.  A whole replay with "
    "results is\n"
    "'anlos launch launch/play.yaml --bag FILE'.\n"
    "\n"
    "keys: space pauses, . plays one message, left and right seek 10 s, home seeks the\n"
    "start, + and - change the pace, q ends\n"
    "\n"
    "examples\n"
    "  anlos bag play scan.mcap --rate 10\n"
    "  anlos bag play scan.mcap --topics 'volume,detections' --loop\n"
    "\n"
    "exit codes: 0 done; 1 failed, or pings got lost; 2 bad arguments or files; 130 "
    "stopped\n"
    "by Ctrl-C\n";

static const struct option options[] = {
    {"rate", required_argument, NULL, 'a'},
    {"loop", no_argument, NULL, 'l'},
    {"start", required_argument, NULL, 's'},
    {"end", required_argument, NULL, 'e'},
    {"topics", required_argument, NULL, 't'},
    {"exclude", required_argument, NULL, 'x'},
    {"remap", required_argument, NULL, 'm'},
    {"paused", no_argument, NULL, 'p'},
    {"run-dir", required_argument, NULL, 'r'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

struct request {
    struct playback_config play;
    struct arguments arguments;
    char topics_room[VERB_PATTERNS], exclude_room[VERB_PATTERNS];
    char remap_room[VERB_PATTERNS];
};

static int take_seconds(const char *name, double *out)
{
    if (!usage_numbers(optarg, 1, out) && *out >= 0.0)
        return 0;
    return usage_error("bag play", "--%s %s: expected seconds, 0 or more", name, optarg);
}

static int take_option(struct request *r, int code, char **argv)
{
    switch (code) {
    case 'a':
        if (!launchfile_play_rate(optarg, &r->play.rate))
            return 0;
        return usage_error("bag play", "--rate %s: expected max, or 0.001 to 1000000",
                           optarg);
    case 'l':
        r->play.loop = true;
        return 0;
    case 's':
        return take_seconds("start", &r->play.bag_iterator.start_s);
    case 'e':
        return take_seconds("end", &r->play.bag_iterator.end_s);
    case 't':
        return verb_add_patterns("bag play", optarg, r->topics_room, &r->play.topics);
    case 'x':
        return verb_add_patterns("bag play", optarg, r->exclude_room, &r->play.exclude);
    case 'm':
        return verb_add_patterns("bag play", optarg, r->remap_room,
                                 &r->play.bag_iterator.remap);
    case 'p':
        r->play.paused = true;
        return 0;
    case 'r':
        r->arguments.run_dir = optarg;
        return 0;
    default:
        return usage_option_error("bag play", code, argv, options);
    }
}

static int play(struct request *r, struct node *node, struct playback_status *status,
                struct error *why)
{
    struct playback *p = NULL;
    struct play_control control;
    struct play_keys keys;

    r->play.run_dir = node_run_dir(node);
    int err = playback_create(&p, &r->play, node_epoch_ns(node), why);
    if (err)
        return err;
    play_keys_open(&keys, &control);
    err = play_run(node, p, &control, false);
    play_keys_close(&keys);
    playback_status(p, status);
    playback_destroy(p);
    return err == -ECANCELED ? 0 : err;
}

static int run(struct request *r)
{
    struct error why = {""};
    struct playback_status status = {.messages = 0};
    struct node *node = NULL;
    char text[200];

    int err = node_start(&node, "play", &r->arguments, &why);
    if (!err)
        err = play(r, node, &status, &why);
    if (node)
        node_finish(node, 0);
    if (err && why.text[0]) {
        err = err == -EADDRINUSE ? -EEXIST : err == -ENODATA ? -EBADMSG : err;
        return verb_end("play", err, &why);
    }
    if (status.messages) {
        play_summary(&status, text, sizeof text);
        printf("%s\n", text);
    }
    if (err == -ESHUTDOWN)
        return EXIT_INTERRUPTED;
    return err || status.pings.missing || status.pings.unused || status.lost ||
                   fflush(stdout)
               ? EXIT_FAILED
               : EXIT_WORKED;
}

int bag_play(int argc, char **argv)
{
    struct request r = {.play = {.bag_iterator = {.end_s = INFINITY},
                                 .rate = 1.0,
                                 .alone = true,
                                 .window = 32,
                                 .timeout_s = 5.0},
                        .arguments = {.replay = true, .log_level = LOG_LEVEL_WARNING}};
    int code;

    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
        if (code == 'h')
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
        code = take_option(&r, code, argv);
        if (code)
            return code;
    }
    code = verb_one_operand("bag play", "FILE", argc, argv);
    if (code)
        return code;
    if (r.play.bag_iterator.end_s < r.play.bag_iterator.start_s)
        return usage_error("bag play", "--end %g comes before --start %g",
                           r.play.bag_iterator.end_s, r.play.bag_iterator.start_s);
    r.play.bag_iterator.bag = argv[optind];
    return run(&r);
}
