/* SPDX-License-Identifier: MIT */
/* nodes/anlos/batch/batch.h -- what `anlos batch` works on, what comes of it, and how
 * results are put beside each other. */
#ifndef ANLOS_NODES_ANLOS_BATCH_BATCH_H
#define ANLOS_NODES_ANLOS_BATCH_BATCH_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/resource.h>
#include <time.h>

#include "dsp/error.h"

/* Which bags a batch works on, by a text of lines
 *
 *   PATH<tab>key=value<tab>...
 *
 * with truth, scene (who was there: a file of lines, a scene), tag (again for another
 * one), launch and bytes (its size, so that nobody has to ask the file system).  Paths
 * are seen from the manifest's folder; '#' begins a comment. */

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

/* What came of a bag: one line of JSON in a file of its
 * own, there whole or not at all.  All but its last member, "run" (who did it when, and
 * what it took), depends on the bag, its settings and the program alone. */

#define RESULT_FORMAT    1
#define RESULT_NAME_SIZE 160

struct result_place {
    const char *folder; /* of the results */
    const char *launch; /* for bags whose line names none; NULL: the bag's own */
    uint64_t program;   /* result_program */
};

/* A hash of this program's file: what another one makes is another version, whatever it
 * says of itself.  0, negative errno. */
int result_program(uint64_t *out, struct error *why);

/* BAG-HASH of bag, settings and program; a file of this name with ".json" is its result.
 */
void result_name(const struct result_place *p, const struct manifest_bag *bag,
                 char out[RESULT_NAME_SIZE]);

/* Of the bag's size and date, and of what is in the files that go with it. */
uint64_t result_inputs(const struct result_place *p, const struct manifest_bag *bag);

/* The line of a result that is there, was made of these inputs, and is no failure; NULL:
 * it has to be made. */
json_t *result_load(const struct result_place *p, const char *name, uint64_t inputs);

/* The tags of the manifest in the place of those it has.  true: they are others. */
bool result_retag(json_t *line, const struct manifest_bag *bag);

struct result_run {   /* what the child took */
    int status;       /* of wait */
    const char *said; /* the last sentence on its stderr */
    const char *shard;
    struct timespec started;
    double wall_s;
    size_t timeout_s; /* it was ended because it took longer; 0: it was not */
    struct rusage used;
};

/* The line, of what the child left in a folder.  NULL: no memory. */
json_t *result_make(const struct result_place *p, const struct manifest_bag *bag,
                    uint64_t inputs, const char *folder, const struct result_run *run);
/* A member of it that is a text; "" where there is none. */
const char *result_text(const json_t *line, const char *key);
bool result_is_failure(const json_t *line);

/* By way of a temporary file in a folder of the same file system, on the disk before it
 * gets its name.  0, negative errno. */
int result_write(const struct result_place *p, const char *name, const json_t *line,
                 const char *temporary, struct error *why);

/* `anlos batch merge`: the results of folders as one table, versions beside each other.
 * argv[0] is "merge"; help is that of `anlos batch`.  Returns the exit code. */
int batch_merge(int argc, char **argv, const char *help);

#endif
