/* SPDX-License-Identifier: MIT */
/* nodes/anlos/launch.c -- `anlos launch`: a whole system from one file. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/launcher/devices.h"
#include "nodes/launcher/launcher.h"
#include "nodes/launcher/program.h"
#include "nodes/launcher/site.h"
#include "nodes/launcher/truth.h"
#include "nodes/record/parts.h"
#include "nodes/rt/arguments.h"
#include "nodes/rt/export.h"
#include "nodes/rt/launchfile_hosts.h"
#include "nodes/rt/node.h"
#include "nodes/rt/process.h"
#include "nodes/rt/uri.h"

static void print_help(void)
{
    printf(
        "usage: anlos launch FILE [options]\n\n"
        "Starts every node that the launch file names, each a process of its own, shows\n"
        "their logs and the progress of the scan, starts a node again that crashed or\n"
        "hangs, and ends when the results are written.  Ctrl-C stops all of them.  Of a\n"
        "launch file with hosts, start it on each of them: it runs what is to run "
        "there,\n"
        "and ends when the host with the report is done, when another one failed, or "
        "when\n"
        "one has not been heard for a minute.\n\n"
        "  FILE               a launch file (YAML), e.g. launch/demo.yaml\n"
        "%s\n"
        "Results, in report.folder of the launch file: volume.nrrd, projection_*.png,\n"
        "detections.json, report.json, of tracks plan.png, and can.candump with the\n"
        "frames for the vehicle.\n"
        "Look at a running system with `anlos topic list`.\n\n"
        "Exit codes: 0 done, 1 a node or the scan failed, the CAN log is not whole, or\n"
        "after Ctrl-C the report or the recording, 2 bad configuration, 130 Ctrl-C.\n\n"
        "  anlos launch launch/demo.yaml --out /tmp/demo\n"
        "  anlos launch launch/demo.yaml --realtime\n"
        "  anlos launch launch/play.yaml --bag scan.mcap --rate max\n"
        "  anlos launch launch/two-hosts.yaml --host vehicle\n",
        arguments_help());
}

/* A name on the command line is meant: what stands there is not to be ignored. */
static int check_recording(const struct launchfile *l, const struct arguments *a,
                           struct error *why)
{
    struct parts parts;
    bool split = l->record.split_mb || l->record.split_s || l->record.quota_mb;

    return a->record ? parts_init(&parts, l->record.path, split, why) : 0;
}

/* What is needed of the machine, once the runtime directory is ours.  *results: the lock
 * of the folder of results, -1: there is none. */
static int prepare_host(const struct launchfile *l, int *results, struct error *why)
{
    int err = 0;

    *results = -1;
    if (priority_wanted(l) && l->processes.realtime == REALTIME_REQUIRED)
        err = priority_permitted(why);
    if (!err && launchfile_runs_here(l, "report")) {
        err = export_folder(l->report.folder, why);
        if (!err)
            err = site_lock_results(results, l->report.folder, why);
    }
    return err;
}

/* After 0: site_unlock_results, site_close, launchfile_destroy; else the latter alone. */
static int prepare(struct launchfile **launch, const struct arguments *a,
                   char run_dir[RUNDIR_SIZE], int *results, struct error *why)
{
    const struct launchfile_options options = {.out = a->out,
                                               .bag = a->bag,
                                               .rate = a->rate,
                                               .record = a->record,
                                               .snapshot = a->snapshot,
                                               .realtime = a->realtime};
    int err = launchfile_load(launch, a->launch, &options, why);

    if (!err)
        err = launchfile_choose_host(*launch, a->host, why);
    if (!err)
        err = devices_check(*launch, why);
    if (!err)
        err = check_recording(*launch, a, why);
    if (!err)
        err = site_open(*launch, a, run_dir, why);
    if (err)
        return err;
    err = prepare_host(*launch, results, why);
    if (err)
        site_close(*launch, run_dir);
    return err;
}

/* It may lie only on the host that has the array. */
static int read_scene(struct truth *t, const struct launchfile *l, struct error *why)
{
    char *scene = uri_path(l->array.uri);
    int err = 0;

    if (!scene)
        err = error_say(why, -ENOMEM, "not enough memory for the scene");
    else if (launchfile_runs_here(l, "array") || !access(scene, R_OK))
        err = truth_read_scene(t, scene, why);
    free(scene);
    return err;
}

/* Of the newest image: what is hidden, and in a simulation where it really is. */
static void print_objects(const struct launchfile *l)
{
    struct truth *t = calloc(1, sizeof *t);
    struct error why = {""};
    int err = t ? truth_read_detections(t, l->report.folder, &why)
                : error_say(&why, -ENOMEM, "not enough memory for the table");

    if (!err && uri_has_scheme(l->array.uri, "sim"))
        err = read_scene(t, l, &why);
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
    }
    free(t);
}

static void print_results(const struct launchfile *l)
{
    struct error why = {""};

    if (l->scan.fixed && !tracks_print(l->report.folder, stdout, &why)) {
        if (uri_has_scheme(l->array.uri, "sim"))
            printf("`anlos bench drive` says how exact such tracks are\n");
    } else {
        print_objects(l);
    }
    printf("results are in %s\n", l->report.folder);
}

int command_launch(int argc, char **argv)
{
    struct arguments args;
    struct error why = {""};
    struct launchfile *launch = NULL;
    char run_dir[RUNDIR_SIZE], bin_dir[4096];
    int code = EXIT_BAD_INPUT, results;
    bool reported = false;
    int err = arguments_parse(&args, argc, argv, &why);

    if (!err && args.version) {
        printf("anlos %s\n", ANLOS_VERSION);
        return usage_flush("launch");
    }
    if (!err && args.help) {
        if (args.values)
            choice_print(args.values, stdout);
        else
            print_help();
        return usage_flush("launch");
    }
    if (!err && (err = program_folder(bin_dir, sizeof bin_dir)))
        error_say(&why, err, "the folder of this program: %s", strerror(-err));
    if (!err)
        err = prepare(&launch, &args, run_dir, &results, &why);
    if (err) {
        fprintf(stderr, "anlos launch: %s\n", why.text);
    } else {
        const struct launcher_config cfg = {.launch = launch,
                                            .arguments = &args,
                                            .run_dir = run_dir,
                                            .bin_dir = bin_dir,
                                            .launch_file = site_launch_file(launch)};
        heap_share();
        code = launcher_run(&cfg, &reported);
        site_unlock_results(results, launch->report.folder);
        site_close(launch, run_dir);
        if (reported)
            print_results(launch);
        int unwritten = usage_flush("launch");
        code = code ? code : unwritten;
    }
    launchfile_destroy(launch);
    return code;
}
