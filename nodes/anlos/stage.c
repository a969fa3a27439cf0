/* nodes/anlos/stage.c -- `anlos stage`: the stage by hand. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/stage/wish.h"
#include "nodes/anlos/usage.h"

enum { MAX_WISHES = 16 };

static const char help[] =
    "anlos stage -- look at the stage, home it, move it by hand\n"
    "\n"
    "usage: anlos stage COMMAND... [--run-dir DIR]    of a system that runs\n"
    "       anlos stage URI COMMAND...                when none does\n"
    "\n"
    "commands, one after the other\n"
    "  status          what it does, and where it is\n"
    "  home            lets it look for its place, which also ends a fault; a scan that\n"
    "                  had paused goes on\n"
    "  move M          moves it to M metres; a scan pauses until home or release\n"
    "  stop            brakes it; a scan pauses until home or release\n"
    "  release         lets a scan go on after move or stop\n"
    "\n"
    "  URI             the device, as stage.uri in a launch file: gpiod:CHIP?step=...,\n"
    "                  zaber:TTY?pitch_mm=..., sim:; for status, home and move\n"
    "  --run-dir DIR   where the system's sockets are, default $XDG_RUNTIME_DIR/anlos, "
    "else\n"
    "                  /tmp/anlos-UID\n"
    "  --help          this text\n"
    "\n"
    "Ctrl-C brakes what moves. Writes no files.\n"
    "\n"
    "examples\n"
    "  anlos stage status\n"
    "  anlos stage 'zaber:/dev/ttyUSB0?pitch_mm=25.4' home move 0.5\n"
    "\n"
    "exit codes: 0 done; 1 in fault, refused, or nothing is running; 2 bad arguments;\n"
    "130 stopped by Ctrl-C\n";

struct request {
    const char *uri, *run_dir;
    struct stage_wish wishes[MAX_WISHES];
    size_t n;
};

void stage_sight_print(const struct stage_sight *s)
{
    printf("%s at %.5f m%s%s%s\n", s->state, s->position_m,
           s->homed ? "" : ", place not known", s->text[0] ? ": " : "", s->text);
    fflush(stdout);
}

static int find_verb(const char *word)
{
    static const char *const verbs[] = {[VERB_STATUS] = "status",
                                        [VERB_HOME] = "home",
                                        [VERB_MOVE] = "move",
                                        [VERB_STOP] = "stop",
                                        [VERB_RELEASE] = "release"};

    for (int i = 0; i < 5; i++)
        if (!strcmp(word, verbs[i]))
            return i;
    return -1;
}

/* argv[*i] is a command; *i comes to stand at its last word.  0, or an exit code. */
static int take_wish(struct request *r, int argc, char **argv, int *i)
{
    struct stage_wish wish = {.verb = VERB_STATUS};
    const char *word = argv[*i];
    int verb = find_verb(word);

    if (verb < 0)
        return usage_error("stage", "%s: expected status, home, move M, stop or release",
                           word);
    if (r->n == MAX_WISHES)
        return usage_error("stage", "more than %d commands", MAX_WISHES);
    wish.verb = (enum stage_verb)verb;
    if (wish.verb == VERB_MOVE) {
        if (++*i >= argc)
            return usage_error("stage", "move: expected metres");
        if (usage_numbers(argv[*i], 1, &wish.target_m))
            return usage_error("stage", "move %s: expected metres", argv[*i]);
    }
    r->wishes[r->n++] = wish;
    return 0;
}

/* Not getopt's way: "move -0.1" has no option in it. */
static int read_arguments(struct request *r, int argc, char **argv)
{
    int code = 0;

    for (int i = 1; i < argc && !code; i++) {
        if (!strcmp(argv[i], "--run-dir")) {
            if (++i == argc)
                return usage_error("stage", "--run-dir: a folder is missing");
            r->run_dir = argv[i];
        } else if (argv[i][0] == '-') {
            return usage_error("stage", "%s: unknown option", argv[i]);
        } else if (!r->uri && !r->n && strchr(argv[i], ':')) {
            r->uri = argv[i];
        } else {
            code = take_wish(r, argc, argv, &i);
        }
    }
    return code;
}

static int check(const struct request *r)
{
    if (!r->n)
        return usage_error("stage", "a command is missing");
    if (r->uri && r->run_dir)
        return usage_error("stage", "expected a URI or --run-dir, not both");
    for (size_t i = 0; i < r->n && r->uri; i++)
        if (r->wishes[i].verb == VERB_STOP || r->wishes[i].verb == VERB_RELEASE)
            return usage_error("stage", "stop and release are for a system that runs");
    return 0;
}

int command_stage(int argc, char **argv)
{
    struct request r = {.n = 0};

    for (int i = 1; i < argc; i++)
        if (!strcmp(argv[i], "--help") || !strcmp(argv[i], "-h"))
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
    int code = read_arguments(&r, argc, argv);
    if (!code)
        code = check(&r);
    if (code)
        return code;
    return r.uri ? stage_wish_direct(r.uri, r.wishes, r.n)
                 : stage_wish_remote(r.run_dir, r.wishes, r.n);
}
