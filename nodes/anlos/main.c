/* SPDX-License-Identifier: MIT */
/* nodes/anlos/main.c -- `anlos COMMAND`: each command is a file of its own beside this.
 */
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/stop.h"

struct command {
    const char *name;
    const char *what;
    int (*run)(int argc, char **argv);
};

static const struct command commands[] = {
    {"launch", "run a whole system from a launch file", command_launch},
    {"calibrate", "measure an array: timing, channels, gains, air", command_calibrate},
    {"plan", "tell what a scan of so many seconds will resolve", command_plan},
    {"recon", "image a recording, in one process without the bus", command_recon},
    {"batch", "process many recordings, one result each", command_batch},
    {"psf", "measure or compute the image of a point", command_psf},
    {"resolution", "tell how close things may be and still be told apart",
     command_resolution},
    {"falloff", "fit how echoes fade with distance", command_falloff},
    {"speed-error", "measure what error costs in time", command_speed_error},
    {"score", "tell how far recorded tracks are from who was there", command_score},
    {"bench", "run a benchmark of those who work on anlos", command_bench},
    {"sim", "record a simulated scene as WAV files", command_sim},
    {"array", "look at the sound cards of this machine", command_array},
    {"stage", "look at the stage, home it, move it by hand", command_stage},
    {"bag", "record, play, check, cut and convert recordings", command_bag},
    {"can", "read the frames on the vehicle's bus", command_can},
    {"top", "watch the nodes and topics of a running system", command_top},
    {"topic", "look at the messages of a running system, add to them", command_topic},
    {"view", "show a running system or a bag on a web page", command_view},
    {"node", "look at the processes of a running system", command_node},
    {"keys", "make and show the keys with which hosts know each other", command_keys},
    {"doctor", "find what is wrong with this machine or system", command_doctor},
};

#define N_COMMANDS (sizeof commands / sizeof commands[0])

static void print_help(FILE *to)
{
    fprintf(
        to,
        "usage: anlos COMMAND [arguments]\n\n"
        "Hears around corners: speakers send chirps, a wall mirrors them to what is\n"
        "hidden and back, and from the echoes come an image and a list of objects.\n\n"
        "commands\n");
    for (size_t i = 0; i < N_COMMANDS; i++)
        fprintf(to, "  %-12s %s\n", commands[i].name, commands[i].what);
    fprintf(to,
            "\n`anlos COMMAND --help` explains a command, as `anlos help COMMAND` does;\n"
            "`anlos --version` says which this is.  A first look:\n\n"
            "  anlos launch launch/demo.yaml        everything, simulated\n"
            "  anlos topic list                     in another terminal meanwhile\n\n"
            "or step by step:\n\n"
            "  anlos sim launch/scenes/corner.yaml --out recording\n"
            "  anlos recon --help\n");
}

/* NULL: there is none, and that has been said. */
static const struct command *find(const char *name)
{
    const char *names[N_COMMANDS + 1] = {NULL};

    for (size_t i = 0; i < N_COMMANDS; i++) {
        if (!strcmp(name, commands[i].name))
            return &commands[i];
        names[i] = commands[i].name;
    }
    const char *near = usage_nearest(name, names);
    fprintf(stderr, "anlos: %s: no such %s%s%s%s; see anlos --help\n", name,
            name[0] == '-' ? "option" : "command", near ? "; did you mean " : "",
            near ? near : "", near ? "?" : "");
    return NULL;
}

/* A command whose output got lost has not done what it was asked for, though it does not
 * look itself. */
static int run(int argc, char **argv)
{
    const struct command *c = find(argv[0]);

    if (!c)
        return EXIT_BAD_INPUT;
    int code = c->run(argc, argv);
    return code ? code : usage_flush(c->name);
}

/* "help bag info" as "bag info --help". */
static int explain(int argc, char **argv)
{
    static char option[] = "--help";

    for (int i = 0; i + 1 < argc; i++)
        argv[i] = argv[i + 1];
    argv[argc - 1] = option;
    return run(argc, argv);
}

int main(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "--help";
    bool helps = !strcmp(name, "help");

    if (usage_hold_streams())
        return EXIT_FAILED;
    if (helps && argc > 2)
        return explain(argc - 1, argv + 1);
    if (helps || !strcmp(name, "--help") || !strcmp(name, "-h")) {
        print_help(argc > 1 ? stdout : stderr);
        return argc > 1 ? usage_flush("--help") : EXIT_BAD_INPUT;
    }
    if (!strcmp(name, "--version") || !strcmp(name, "version")) {
        printf("anlos %s\n", ANLOS_VERSION);
        return usage_flush("--version");
    }
    return run(argc - 1, argv + 1);
}
