/* SPDX-License-Identifier: MIT */
/* tests/fuzz/fuzz.h -- what the fuzz targets share.  A target is one file, target_NAME.c,
 * with one function that takes any bytes: libFuzzer calls it with what it makes up
 * (tests/fuzz/run), and replay.c with the seeds and with what was found before (ctest).
 * Whatever the bytes are, it returns; what they must not do ends in abort(). */
#ifndef ANLOS_TESTS_FUZZ_FUZZ_H
#define ANLOS_TESTS_FUZZ_FUZZ_H

#include <stddef.h>
#include <stdint.h>

/* libFuzzer's name for the target.  0. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* libFuzzer's name for what comes before the first input: stdout, on which commands say
 * what they did, becomes silent.  0. */
int LLVMFuzzerInitialize(int *argc, char ***argv);

/* The path of a name in this process's own scratch folder (in $TMPDIR), which goes when
 * the process ends.  It lasts until the fourth call after it. */
const char *fuzz_path(const char *name);

/* The same, with the bytes in it. */
const char *fuzz_file(const char *name, const void *data, size_t size);

/* Takes away a file or folder of that name. */
void fuzz_remove(const char *name);

/* Something that must hold whatever the input is. */
#define FUZZ_REQUIRE(what)                                                               \
    do {                                                                                 \
        if (!(what))                                                                     \
            fuzz_fail(__FILE__, __LINE__, #what);                                        \
    } while (0)
_Noreturn void fuzz_fail(const char *file, int line, const char *what);

#endif
