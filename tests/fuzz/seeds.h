/* SPDX-License-Identifier: MIT */
/* tests/fuzz/seeds.h -- the small files from which a fuzzer starts: FOLDER/TARGET/NAME.
 * They are made by the code that writes such files, so they follow it. */
#ifndef ANLOS_TESTS_FUZZ_SEEDS_H
#define ANLOS_TESTS_FUZZ_SEEDS_H

#include "msgs/bag/bytes.h"

struct seeds {
    const char *folder; /* where they go */
};

/* The path of a seed, in a folder that is there.  It lasts until the next call. */
const char *seeds_path(const struct seeds *s, const char *target, const char *name);

/* Writes one. */
void seeds_put(const struct seeds *s, const char *target, const char *name,
               struct bytes content);

/* All of a file; free its data. */
struct bytes_buffer seeds_read(const char *path);

/* The messages of a scan of mini.yaml beside this, as tests/fuzz/messages.h has them. */
void seeds_messages(const struct seeds *s);

/* Bags of all forms, whole and damaged. */
void seeds_bags(const struct seeds *s);

/* The launch files, rigs and scenes of this project. */
void seeds_yaml(const struct seeds *s);

/* WAV and MATLAB files. */
void seeds_recordings(const struct seeds *s);

#endif
