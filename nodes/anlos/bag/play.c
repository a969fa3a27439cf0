/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/bag/bag.h"
#include "nodes/play/run.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "hal/clock.h"
#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/launchfile.h"
#include "nodes/rt/rundir.h"

/* -- a person at a terminal who pauses, steps, seeks and changes the pace ---------------
 */

#define SEEK_NS        10000000000LL
#define SHOW_PERIOD_NS 100000000LL
#define CLEAR_LINE     "\r\033[K"

enum { SLOWEST_DIVISOR = 64, FASTEST = 64 };

struct play_keys {
    bool terminal, shown;
    struct termios before;
    struct playback_status status; /* as shown last */
    int64_t show_due_ns;
};

static void change_rate(struct playback *p, double rate, bool faster, int64_t now_ns)
{
    double wanted = faster ? 2.0 * rate : 0.5 * rate;

    if (rate <= 0.0) /* max */
        wanted = faster ? 0.0 : FASTEST;
    else if (wanted > FASTEST)
        wanted = 0.0;
    else if (wanted < 1.0 / SLOWEST_DIVISOR)
        wanted = 1.0 / SLOWEST_DIVISOR;
    playback_rate(p, wanted, now_ns);
}

static int take_key(struct playback *p, char key, int64_t now_ns)
{
    struct playback_status s;

    playback_status(p, &s);
    switch (key) {
    case ' ':
        playback_pause(p, s.phase != PLAYBACK_PAUSES, now_ns);
        return 0;
    case '.':
        if (s.phase != PLAYBACK_PAUSES)
            playback_pause(p, true, now_ns);
        playback_one(p);
        return 0;
    case '+':
    case '=':
    case '-':
        change_rate(p, s.rate, key != '-', now_ns);
        return 0;
    case 'q':
        return -ECANCELED;
    default:
        return 0;
    }
}

static void take_arrow(struct playback *p, char key)
{
    struct playback_status s;

    playback_status(p, &s);
    if (key == 'C') /* right */
        playback_seek(p, s.at_ns < s.end_ns - SEEK_NS ? s.at_ns + SEEK_NS : s.end_ns);
    else if (key == 'D') /* left */
        playback_seek(p, s.at_ns - SEEK_NS);
    else if (key == 'H') /* home */
        playback_seek(p, s.start_ns);
}

/* What n bytes from the keyboard ask for.  -ECANCELED: to end. */
static int play_keys_take(struct play_keys *k, struct playback *p, const char *bytes,
                          size_t n, int64_t now_ns)
{
    int err = 0;

    k->show_due_ns = 0;
    for (size_t i = 0; i < n && !err; i++) {
        if (bytes[i] != '\033')
            err = take_key(p, bytes[i], now_ns);
        else if (n - i >= 3 && (bytes[i + 1] == '[' || bytes[i + 1] == 'O'))
            take_arrow(p, bytes[i += 2]);
    }
    return err;
}

static int read_keys(void *ctx, struct playback *p, int64_t now_ns)
{
    char bytes[64];
    ssize_t n = read(STDIN_FILENO, bytes, sizeof bytes);

    if (n < 0)
        return errno == EINTR || errno == EAGAIN ? 0 : -errno;
    return n ? play_keys_take(ctx, p, bytes, (size_t)n, now_ns) : -ECANCELED;
}

void play_keys_line(const struct playback_status *s, char *text, size_t size)
{
    static const char *const phases[] = {[PLAYBACK_WAITS] = "waits",
                                         [PLAYBACK_PLAYS] = "plays",
                                         [PLAYBACK_PAUSES] = "pauses",
                                         [PLAYBACK_ENDED] = "has ended"};
    char rate[32] = "max", pings[96] = "";

    if (s->rate > 0.0)
        snprintf(rate, sizeof rate, "%gx", s->rate);
    if (s->pings.played)
        snprintf(pings, sizeof pings,
                 "  %" PRIu64 " pings, %" PRIu64 " used, %" PRIu64 " lost",
                 s->pings.played, s->pings.used, s->pings.unused + s->pings.missing);
    snprintf(text, size, "%7.1f of %.1f s  %s at %s%s  %s",
             1e-9 * (double)(s->at_ns - s->start_ns),
             1e-9 * (double)(s->end_ns - s->start_ns), phases[s->phase], rate, pings,
             s->text);
}

static void show(void *ctx, const struct playback_status *s)
{
    struct play_keys *k = ctx;
    int64_t now_ns = clock_now_ns(clock_system());
    char text[80]; /* a line of any terminal, so that it stays one */

    if (!k->terminal || (now_ns < k->show_due_ns && s->phase == k->status.phase))
        return;
    k->show_due_ns = now_ns + SHOW_PERIOD_NS;
    k->status = *s;
    play_keys_line(s, text, sizeof text);
    printf(CLEAR_LINE "%s", text);
    fflush(stdout);
    k->shown = true;
}

/* Keys come one by one from now on, when both ends are a terminal; else nothing is read
 * or shown. */
static void play_keys_open(struct play_keys *k, struct play_control *out)
{
    *k = (struct play_keys){.terminal = isatty(STDIN_FILENO) && isatty(STDOUT_FILENO) &&
                                        !tcgetattr(STDIN_FILENO, &k->before)};
    *out = (struct play_control){.fd = -1, .read = read_keys, .show = show, .ctx = k};
    if (!k->terminal || tcgetattr(STDIN_FILENO, &k->before))
        return;
    struct termios raw = k->before;
    raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO); /* Ctrl-C still is one */
    raw.c_cc[VMIN] = 0;
    raw.c_cc[VTIME] = 0;
    if (!tcsetattr(STDIN_FILENO, TCSANOW, &raw))
        out->fd = STDIN_FILENO;
}

static void play_keys_close(struct play_keys *k)
{
    if (k->shown)
        printf("\n");
    if (k->terminal)
        tcsetattr(STDIN_FILENO, TCSANOW, &k->before);
}

/* -- the verb ---------------------------------------------------------------------------
 */

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
    "  --topics T,...  only these: names or patterns with commas between, survey,scan/*\n"
    "  --exclude T,... all but these\n"
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
    "exit codes: 0 done, also when nobody heard it, which it says; 1 failed, or pings "
    "got\n"
    "lost; 2 bad arguments or files; 130 stopped by Ctrl-C\n";

struct request {
    struct playback_config play;
    struct arguments arguments;
    char run_dir[RUNDIR_SIZE];
    char topics_room[VERB_PATTERNS], exclude_room[VERB_PATTERNS];
    char remap_room[VERB_PATTERNS];
};

#define SECONDS(field)                                                                   \
    USAGE_NUMBER(struct request, play.bag_iterator.field, 0, USAGE_ANY),                 \
        .expected = "seconds, 0 or more"

static const struct usage_option options[] = {
    {"rate", USAGE_VALUE('a')},
    {"loop", USAGE_FLAG(struct request, play.loop)},
    {"start", SECONDS(start_s)},
    {"end", SECONDS(end_s)},
    {"topics", USAGE_VALUE('t')},
    {"exclude", USAGE_VALUE('x')},
    {"remap", USAGE_VALUE('m')},
    {"paused", USAGE_FLAG(struct request, play.paused)},
    {"run-dir", USAGE_TEXT(struct request, arguments.run_dir)},
    {.name = NULL},
};

static int take_option(struct request *r, int code)
{
    switch (code) {
    case 'a':
        if (!launchfile_play_rate(optarg, &r->play.rate))
            return 0;
        return usage_error("bag play", "--rate %s: expected max, or 0.001 to 1000000",
                           optarg);
    case 't':
        return verb_add_patterns("bag play", optarg, r->topics_room, &r->play.topics);
    case 'x':
        return verb_add_patterns("bag play", optarg, r->exclude_room, &r->play.exclude);
    default:
        return verb_add_patterns("bag play", optarg, r->remap_room,
                                 &r->play.bag_iterator.remap);
    }
}

static int play(struct request *r, struct node *node, struct playback_status *status,
                struct error *why)
{
    struct playback *p = NULL;
    struct play_control control;
    struct play_keys keys;

    snprintf(r->run_dir, sizeof r->run_dir, "%s", node_run_dir(node));
    r->play.run_dir = r->run_dir;
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
    if (status.messages && !status.heard)
        fprintf(stderr,
                "anlos bag play: nobody in %s heard it: those who are to hear it start "
                "with --replay, or with the node play in their launch file\n",
                r->run_dir);
    if (err == -ESHUTDOWN)
        return EXIT_INTERRUPTED;
    bool whole = !err && !status.pings.missing && !status.pings.unused && !status.lost;
    int code = usage_flush("bag play");
    return code ? code : whole ? EXIT_WORKED : EXIT_FAILED;
}

int bag_play(int argc, char **argv)
{
    struct request r = {.play = {.bag_iterator = {.end_s = INFINITY},
                                 .rate = 1.0,
                                 .alone = true,
                                 .window = 32,
                                 .timeout_s = 5.0},
                        .arguments = {.replay = true, .log_level = LOG_LEVEL_WARNING}};
    struct usage usage = {
        .command = "bag play", .help = help, .options = options, .into = &r};
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        if ((code = take_option(&r, code)) != 0)
            return code;
    if (code)
        return ~code;
    code = verb_one_operand("bag play", "FILE", argc, argv);
    if (code)
        return code;
    if (r.play.bag_iterator.end_s < r.play.bag_iterator.start_s)
        return usage_error("bag play", "--end %g comes before --start %g",
                           r.play.bag_iterator.end_s, r.play.bag_iterator.start_s);
    r.play.bag_iterator.bag = argv[optind];
    return run(&r);
}
