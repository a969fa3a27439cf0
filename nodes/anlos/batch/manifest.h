/* SPDX-License-Identifier: MIT */
/* nodes/anlos/batch/manifest.h -- which bags a batch works on, by a text of lines
 *
 *   PATH<tab>key=value<tab>...
 *
 * with truth, scene (who was there: a file of lines, a scene), tag (again for another
 * one), launch and bytes (its size, so that nobody has to ask the file system).  Paths
 * are seen from the manifest's folder; '#' begins a comment. */
#ifndef ANLOS_NODES_ANLOS_BATCH_MANIFEST_H
#define ANLOS_NODES_ANLOS_BATCH_MANIFEST_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"

struct manifest_bag {
    char *job;  /* path, and launch file where there is one, as written */
    char *name; /* the path as written */
    char *path; /* where it is */
    char *launch, *truth, *scene; /* where they are; NULL: none */
    char *tags;                   /* with commas between; "": none */
    uint64_t bytes;               /* its size, also of a file that is not there: 0 */
    size_t line;
};

struct manifest {
    struct manifest_bag *bags; /* [n] */
    size_t n;
};

/* 0; -EINVAL (what is wrong with a line, a bag that is there twice, no bag at all);
 * errors of text_file_open; -ENOMEM. */
int manifest_load(struct manifest *m, const char *path, struct error *why);

/* Leaves those of one shard, 1..n_shards, the largest first: each bag, from the largest
 * on, goes to the shard that has least so far (longest processing time first, Graham
 * 1969), so that all who know the sizes come to the same shards.  0, -ENOMEM. */
int manifest_shard(struct manifest *m, size_t shard, size_t n_shards);
void manifest_clear(struct manifest *m);

#endif
