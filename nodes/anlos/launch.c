/* nodes/anlos/launch.c -- `anlos launch`: a whole system from one file. */
#include <errno.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "nodes/anlos/commands.h"
#include "nodes/launcher/devices.h"
#include "nodes/launcher/launcher.h"
#include "nodes/launcher/truth.h"
#include "nodes/rt/arguments.h"
#include "nodes/rt/export.h"
#include "nodes/rt/launchfile.h"
#include "nodes/rt/node.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/uri.h"

static void print_help(void)
{
    printf(
        "usage: anlos launch FILE [options]\n\n"
        "Starts every node that the launch file names, each a process of its own, shows\n"
        "their logs and the progress of the scan, starts a node again that crashed, and\n"
        "ends when the results are written.  Ctrl-C stops all of them.\n\n"
        "  FILE               a launch file (YAML), e.g. launch/demo.yaml\n"
        "%s\n"
        "Results, in report.folder of the launch file: volume.nrrd, projection_*.png,\n"
        "detections.json, report.json, and can.candump with the frames for the vehicle.\n"
        "Look at a running system with `anlos topic list`.\n\n"
        "Exit codes: 0 done, 1 a node or the scan failed, 2 bad configuration,\n"
        "130 Ctrl-C.\n\n"
        "  anlos launch launch/demo.yaml --out /tmp/demo\n"
        "  anlos launch launch/demo.yaml --realtime\n",
        arguments_help());
}

/* The folder of this program, where the nodes are too. */
static int find_programs(char *out, size_t size)
{
    const char *given = getenv("ANLOS_BIN_DIR");
    char path[4096];

    if (given)
        return snprintf(out, size, "%s", given) < (int)size ? 0 : -ENAMETOOLONG;
    ssize_t n = readlink("/proc/self/exe", path, sizeof path - 1);
    if (n < 0)
        return -errno;
    path[n] = '\0';
    return snprintf(out, size, "%s", dirname(path)) < (int)size ? 0 : -ENAMETOOLONG;
}

static int prepare(struct launchfile **launch, const struct arguments *a,
                   char run_dir[RUNDIR_SIZE], struct complaint *why)
{
    const struct launchfile_options options = {.out = a->out, .realtime = a->realtime};
    int err = launchfile_load(launch, a->launch, &options, why);

    if (!err)
        err = devices_check(*launch, why);
    if (!err)
        err = rundir_open(run_dir, a->run_dir, why);
    if (!err && launchfile_has_node(*launch, "report"))
        err = export_folder((*launch)->report.folder, why);
    return err;
}

static void print_results(const struct launchfile *l)
{
    struct truth *t = calloc(1, sizeof *t);
    struct complaint why = {""};
    int err = t ? truth_read_detections(t, l->report.folder, &why)
                : complain(&why, -ENOMEM, "not enough memory for the table");

    if (!err && uri_has_scheme(l->array.uri, "sim")) {
        char *scene = uri_path(l->array.uri);
        err = scene ? truth_read_scene(t, scene, &why)
                    : complain(&why, -ENOMEM, "not enough memory for the scene");
        free(scene);
    }
    if (err && err != -ENOENT) {
        fprintf(stderr, "anlos launch: %s\n", why.text);
    } else {
        printf("\n");
        if (err) {
            printf("the scan ended before there was an image; report.json says more\n");
        } else {
            truth_match(t);
            truth_print(t, stdout);
        }
        printf("results are in %s\n", l->report.folder);
    }
    free(t);
}

int command_launch(int argc, char **argv)
{
    struct arguments args;
    struct complaint why = {""};
    struct launchfile *launch = NULL;
    char run_dir[RUNDIR_SIZE], bin_dir[4096];
    int code = EXIT_BAD_INPUT;
    bool reported = false;
    int err = arguments_parse(&args, argc, argv, &why);

    if (!err && args.help) {
        print_help();
        return EXIT_WORKED;
    }
    if (!err)
        err = prepare(&launch, &args, run_dir, &why);
    if (!err && (err = find_programs(bin_dir, sizeof bin_dir)))
        complain(&why, err, "the folder of this program: %s", strerror(-err));
    if (err) {
        fprintf(stderr, "anlos launch: %s\n", why.text);
    } else {
        const struct launcher_config cfg = {
            .launch = launch, .arguments = &args, .run_dir = run_dir, .bin_dir = bin_dir};
        code = launcher_run(&cfg, &reported);
        if (reported)
            print_results(launch);
    }
    launchfile_destroy(launch);
    return code;
}
