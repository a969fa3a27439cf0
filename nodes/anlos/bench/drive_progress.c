#include "nodes/anlos/bench/drive_progress.h"

#include <stdio.h>
#include <unistd.h>

#include "nodes/anlos/stopwatch.h"

#define EVERY_S 60.0 /* where it is not a terminal */

static double now_s(void)
{
    return stopwatch_now(false).wall_s;
}

void drive_progress_begin(struct drive_progress *p, size_t n)
{
    double s = now_s();

    *p = (struct drive_progress){
        .n = n, .began_s = s, .told_s = s, .terminal = isatty(STDERR_FILENO)};
}

void drive_progress_add(struct drive_progress *p, double seconds, size_t n_false_tracks)
{
    double s = now_s();

    p->done++;
    p->seconds += seconds;
    p->n_false_tracks += n_false_tracks;
    if (p->done == p->n || (!p->terminal && s - p->told_s < EVERY_S))
        return;
    p->told_s = s;
    double left_s = (s - p->began_s) / (double)p->done * (double)(p->n - p->done);
    fprintf(stderr, "%s%zu of %zu drives, %.2f h, %zu false tracks; %.0f s left%s",
            p->terminal ? "\r\033[K" : "", p->done, p->n, p->seconds / 3600.0,
            p->n_false_tracks, left_s, p->terminal ? "" : "\n");
}

void drive_progress_clear(const struct drive_progress *p)
{
    if (p->terminal)
        fputs("\r\033[K", stderr);
}
