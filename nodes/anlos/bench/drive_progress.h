/* nodes/anlos/bench/drive_progress.h -- how far many drives are, on stderr: on a terminal
 * one line that changes, elsewhere a line now and then. */
#ifndef ANLOS_NODES_ANLOS_BENCH_DRIVE_PROGRESS_H
#define ANLOS_NODES_ANLOS_BENCH_DRIVE_PROGRESS_H

#include <stdbool.h>
#include <stddef.h>

struct drive_progress {
    size_t n, done, n_false_tracks;
    double seconds; /* simulated so far */
    double began_s, told_s;
    bool terminal;
};

void drive_progress_begin(struct drive_progress *p, size_t n);

/* One more drive, of seconds, is done. */
void drive_progress_add(struct drive_progress *p, double seconds, size_t n_false_tracks);

/* Takes the line away, where something else is to be printed. */
void drive_progress_clear(const struct drive_progress *p);

#endif
