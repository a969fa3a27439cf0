/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/doctor/doctor.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "msgs/convert.h"
#include "nodes/anlos/doctor/drive_pipe.h"
#include "nodes/anlos/stopwatch.h"
#include "nodes/rt/process.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/uri.h"

#define PROBE_S     2.0
#define MIN_IMAGES  3
#define UNDISTURBED 0.9 /* share of a processor of who need not wait for one */

void load_judge(const struct load *m, struct findings *f)
{
    double budget = LOAD_BUDGET * m->left;
    enum finding_level level = m->needed <= LOAD_NOTE * budget ? FINDING_OK
                               : m->needed <= budget           ? FINDING_NOTE
                                                               : FINDING_WRONG;

    finding_add(f, level, "load",
                "array, dsp, recon, wall and track need %.2f of a processor at the pace "
                "of the sound; %.2f are there for the nodes, of which these may take "
                "%.2f%s",
                m->needed, m->left, budget,
                level == FINDING_WRONG ? ": lists will be late" : "");
    if (level != FINDING_OK)
        finding_todo(f, "end other programs, or permit real-time priorities "
                        "(launch/hardware.md); else a coarser volume, fewer "
                        "recon.frames.pings, or recon.frames.every: frame");
}

double load_left(double share, double idle, size_t usable)
{
    double most = fmin((double)usable, LOAD_AT_ONCE);

    /* Who has to wait while others are idle may not use those: a limit of the group, or
     * processors of other programs. */
    return fmin(share < UNDISTURBED ? share : share + idle, most);
}

/* Of all processors since the machine started, idle or waiting for a disk. */
static double idle_s(void)
{
    unsigned long long idle = 0, waiting = 0;
    FILE *f = fopen("/proc/stat", "re");

    if (f && fscanf(f, "cpu %*u %*u %*u %llu %llu", &idle, &waiting) != 2)
        idle = waiting = 0;
    if (f)
        fclose(f);
    return (double)(idle + waiting) / (double)sysconf(_SC_CLK_TCK);
}

static int probe(struct drive_pipe *p, double probe_s, struct load *out,
                 struct error *why)
{
    struct stopwatch start = stopwatch_now(false), end = start;
    double idle = 0.0, first_s = 0.0, last_s = 0.0;

    for (size_t n = 0; end.wall_s - start.wall_s < probe_s || n < MIN_IMAGES; n++) {
        struct drive_image image;
        int err = drive_pipe_next(p, &image, why);
        if (err)
            return err;
        detections_free(image.tracks);
        detections_free(image.detections);
        last_s = image.t_s;
        if (!n) { /* what is made once does not count */
            first_s = image.t_s;
            idle = idle_s();
            start = stopwatch_now(false);
        }
        end = stopwatch_now(false);
    }
    double passed_s = end.wall_s - start.wall_s, own_s = end.cpu_s - start.cpu_s;
    out->needed = own_s / (last_s - first_s);
    out->left =
        load_left(own_s / passed_s, (idle_s() - idle) / passed_s, processors_usable());
    return 0;
}

int load_measure(const struct launchfile *l, double probe_s, struct load *out,
                 struct error *why)
{
    struct drive_pipe *p = calloc(1, sizeof *p);
    char *scene = uri_path(l->array.uri);
    int err = p && scene ? drive_pipe_create(p, l, scene, 0, 1, why)
                         : error_say(why, -ENOMEM, "out of memory");

    if (!err) { /* no node has that one */
        object_tracker_destroy(p->detector);
        p->detector = NULL;
        err = probe(p, probe_s, out, why);
    }
    if (p)
        drive_pipe_clear(p);
    free(p);
    free(scene);
    /* The nodes come before other programs where they may. */
    if (!err && priority_wanted(l) && !priority_permitted(&(struct error){""}))
        out->left = load_left(1.0, LOAD_AT_ONCE, processors_usable());
    return err;
}

static bool is_running(const struct doctor *d)
{
    char run_dir[RUNDIR_SIZE];
    struct presence_locks locks;

    if (rundir_name(run_dir, d->run_dir, NULL))
        return false;
    presence_read(&locks, NULL);
    return presence_of(&locks, run_dir, "array") == PRESENCE_ALIVE ||
           presence_of(&locks, run_dir, "recon") == PRESENCE_ALIVE;
}

static void measure(const struct launchfile *l, struct findings *f)
{
    struct error why = {""};
    struct load m;

    if (load_measure(l, PROBE_S, &m, &why))
        finding_add(f, FINDING_NOTE, "load", "is not measured: %s", why.text);
    else
        load_judge(&m, f);
}

void doctor_load_budget(const void *ctx, struct findings *f)
{
    const struct doctor *d = ctx;
    struct launchfile *l = doctor_load(d);

    if (!l || !launchfile_keeps_pace(l) || !launchfile_has_node(l, "array") ||
        !launchfile_has_node(l, "recon")) {
        launchfile_destroy(l);
        return;
    }
    if (is_running(d)) {
        finding_add(f, FINDING_OK, "load",
                    "is not measured while the system runs: 'anlos top' shows it");
    } else if (l->hosts.n) {
        finding_add(f, FINDING_NOTE, "load",
                    "is not measured of nodes on several machines");
    } else if (!uri_has_scheme(l->array.uri, "sim")) {
        finding_add(f, FINDING_NOTE, "load",
                    "is measured with a simulated array only, not with this one");
        finding_todo(f, "'anlos doctor --launch launch/drive.yaml', or 'anlos top' while "
                        "it runs");
    } else {
        measure(l, f);
    }
    launchfile_destroy(l);
}
