#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/sim/job.h"
#include "nodes/anlos/usage.h"

#define MAX_THREADS 64

static const char help[] =
    "anlos sim -- make a recording of a simulated scene\n"
    "\n"
    "usage: anlos sim SCENE.yaml --out DIR [--threads N]\n"
    "\n"
    "Renders what every microphone hears at every stage position: direct path, wall and\n"
    "room clutter, and the hidden objects by way of the wall; once with the objects and\n"
    "once without.  launch/scenes/ has examples that explain the file's keys.\n"
    "\n"
    "  --out DIR       where the recording goes; made when missing.  A recording that "
    "is\n"
    "                  there already is not overwritten.\n"
    "  --threads N     1..64, default: one for each processor\n"
    "  --help          this text\n"
    "\n"
    "files written, all or none\n"
    "  scene/posNN.wav        a file for each stage position: float32, a channel for "
    "each\n"
    "                         microphone, a slot for each speaker\n"
    "  background/posNN.wav   the same room without the hidden objects\n"
    "  survey.yaml            geometry and timing, for `anlos recon`\n"
    "  calibration/           the microphones' curves, when the scene has any\n"
    "  truth.json             the objects: where they are, and where the wall mirrors "
    "them\n"
    "\n"
    "example\n"
    "  anlos sim launch/scenes/corner.yaml --out /tmp/corner\n"
    "\n"
    "exit codes: 0 done; 1 failed (no memory, full disk); 2 bad arguments or scene;\n"
    "130 stopped by Ctrl-C, nothing written\n";

static const struct option options[] = {
    {"out", required_argument, NULL, 'o'},
    {"threads", required_argument, NULL, 't'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

/* As a word of a shell's command line. */
static void print_quoted(const char *word)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                "0123456789_-./+:,@%=";
    if (*word && !word[strspn(word, plain)]) {
        fputs(word, stdout);
        return;
    }
    putchar('\'');
    for (; *word; word++) {
        if (*word == '\'')
            fputs("'\\''", stdout);
        else
            putchar(*word);
    }
    putchar('\'');
}

static void print_next_command(const char *out)
{
    static const char *const parts[4][2] = {{"--survey", "survey.yaml"},
                                            {"--wav", "scene"},
                                            {"--background", "background"},
                                            {"--out", "image"}};
    printf("%s: scene, background, survey.yaml, truth.json\nnext:\n  anlos recon", out);
    for (size_t i = 0; i < 4; i++) {
        char word[PATH_MAX + 16];
        snprintf(word, sizeof word, "%s/%s", out, parts[i][1]);
        printf(" %s ", parts[i][0]);
        print_quoted(word);
    }
    printf(" --method fast\n");
}

int command_sim(int argc, char **argv)
{
    struct sim_options o = {.threads = usage_default_threads(),
                            .progress = isatty(STDERR_FILENO)};
    struct usage usage = {.command = "sim", .help = help, .options = options};
    struct complaint why = {0};
    bool bad_input = false;
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0) {
        if (code == 'o')
            o.out = optarg;
        else if (usage_count(optarg, 1, MAX_THREADS, &o.threads))
            return usage_error("sim", "--threads %s: expected a number from 1 to %d",
                               optarg, MAX_THREADS);
    }
    if (code)
        return ~code;
    if (optind == argc)
        return usage_error("sim", "SCENE.yaml is missing");
    if (optind + 1 < argc)
        return usage_error("sim", "%s: unexpected argument", argv[optind + 1]);
    if (!o.out || !o.out[0])
        return usage_error("sim", "--out DIR is missing");
    o.scene = argv[optind];

    interrupt_catch();
    int err = sim_job_run(&o, &bad_input, &why);
    if (!err) {
        print_next_command(o.out);
        return EXIT_WORKED;
    }
    fprintf(stderr, "anlos sim: %s\n", why.text);
    return err == -EINTR ? EXIT_INTERRUPTED : bad_input ? EXIT_BAD_INPUT : EXIT_FAILED;
}
