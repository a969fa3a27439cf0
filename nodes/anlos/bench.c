/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bench.c -- `anlos bench NAME`: runs a benchmark of tests/bench, which is
 * built beside this program.  What left it for a command of its own is called by its old
 * name for one version. */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/launcher/program.h"

static const char help[] =
    "anlos bench -- run a benchmark of those who work on anlos\n"
    "\n"
    "usage: anlos bench drive [arguments]\n"
    "       anlos bench detection [arguments]\n"
    "\n"
    "  drive        how exact the tracks of simulated drives are\n"
    "  detection    how often one point is found in how much noise\n"
    "\n"
    "They are programs of tests/bench, in the folder bench beside that of this program.\n"
    "Each explains itself with --help.\n"
    "\n"
    "`anlos bench speed-error` is `anlos speed-error` now, and `anlos bench drive "
    "--bag`\n"
    "is `anlos score`; the old names are taken for one version.\n"
    "\n"
    "exit codes: of the program; 1 it is not there; 2 bad arguments\n";

/* The place of the first argument that is none of an option; 0: there is none. */
static int find_name(int argc, char **argv)
{
    for (int i = 1; i < argc; i++) {
        if (argv[i][0] != '-')
            return i;
        i += !strchr(argv[i], '=') && strcmp(argv[i], "--quick") &&
             strcmp(argv[i], "--help") && strcmp(argv[i], "-h");
    }
    return 0;
}

static bool has_option(int argc, char **argv, const char *name)
{
    size_t n = strlen(name);

    for (int i = 1; i < argc; i++)
        if (!strncmp(argv[i], name, n) && (!argv[i][n] || argv[i][n] == '='))
            return true;
    return false;
}

static int run_program(const char *name, char **argv)
{
    char folder[PATH_MAX / 2], path[PATH_MAX];
    int err = program_own_folder(folder, sizeof folder);

    if (!err) {
        snprintf(path, sizeof path, "%s/../bench/bench_%s", folder, name);
        execv(path, argv);
        err = -errno;
    }
    if (err != -ENOENT) {
        fprintf(stderr, "anlos bench: bench_%s: %s\n", name, strerror(-err));
        return EXIT_FAILED;
    }
    fprintf(stderr,
            "anlos bench: %s is not there; 'cmake --build FOLDER' makes it beside "
            "FOLDER/bin\n",
            path);
    return EXIT_FAILED;
}

/* The arguments without the benchmark's name, which stands at `name`. */
static int run_command(int (*command)(int, char **), const char *called, int argc,
                       char **argv, int name)
{
    char **own = calloc((size_t)argc + 3, sizeof *own), first[] = "", option[] = "--out",
         out[] = "out/bench"; /* as ever; a later one counts */
    int n = 0;

    if (!own) {
        fprintf(stderr, "anlos bench: out of memory\n");
        return EXIT_FAILED;
    }
    own[n++] = first;
    own[n++] = option;
    own[n++] = out;
    for (int i = 1; i < argc; i++)
        if (i != name)
            own[n++] = argv[i];
    fprintf(stderr,
            "anlos bench: this is `anlos %s` now; the next version has it under "
            "that name alone\n",
            called);
    int code = command(n, own);
    free(own);
    return code;
}

int command_bench(int argc, char **argv)
{
    int at = find_name(argc, argv);
    const char *name = argv[at];

    if (!at && (has_option(argc, argv, "--help") || has_option(argc, argv, "-h")))
        return fputs(help, stdout) < 0 ? EXIT_FAILED : usage_flush("bench");
    if (!at)
        return usage_error("bench", "expected drive or detection");
    if (!strcmp(name, "speed-error"))
        return run_command(command_speed_error, name, argc, argv, at);
    if (!strcmp(name, "drive") && has_option(argc, argv, "--bag"))
        return run_command(command_score, "score", argc, argv, at);
    if (strcmp(name, "drive") && strcmp(name, "detection"))
        return usage_error("bench", "%s: expected drive or detection", name);
    memmove(argv + at, argv + at + 1, (size_t)(argc - at) * sizeof *argv);
    return run_program(name, argv);
}
