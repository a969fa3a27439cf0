/* SPDX-License-Identifier: MIT */
/* tests/hal/scratch.h -- a folder for a test's files, gone when the test ends, and a
 * clock that the test sets. */
#ifndef ANLOS_TESTS_HAL_SCRATCH_H
#define ANLOS_TESTS_HAL_SCRATCH_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "hal/clock.h"
#include "tests/hal/folder.h"

struct scratch {
    char folder[64];
    char path[512]; /* of the file last named */
};

static const char *scratch_place = "/tmp";

/* For a test that makes thousands of files: in memory, where that can be done. */
static inline int scratch_in_memory(void **state)
{
    (void)state;
    if (!access("/dev/shm", W_OK | X_OK))
        scratch_place = "/dev/shm";
    return setenv("TMPDIR", scratch_place, 1);
}

static inline int scratch_open(void **state)
{
    struct scratch *s = calloc(1, sizeof *s);
    if (!s)
        return -1;
    snprintf(s->folder, sizeof s->folder, "%.40s/anlos-test-XXXXXX", scratch_place);
    if (!mkdtemp(s->folder)) {
        free(s);
        return -1;
    }
    *state = s;
    return 0;
}

static inline int scratch_close(void **state)
{
    struct scratch *s = *state;
    int err = folder_remove(s->folder);
    free(s);
    return err;
}

static inline const char *scratch_path(struct scratch *s, const char *name)
{
    snprintf(s->path, sizeof s->path, "%s/%s", s->folder, name);
    return s->path;
}

static inline const char *scratch_write(struct scratch *s, const char *name,
                                        const char *text)
{
    FILE *f = fopen(scratch_path(s, name), "w");
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
    return s->path;
}

static inline void scratch_folder(struct scratch *s, const char *name)
{
    assert_int_equal(mkdir(scratch_path(s, name), 0777), 0);
}

/* "PATH" and then exactly the rest. */
static inline void assert_error(const char *text, const char *path, const char *rest)
{
    char expected[1600];
    snprintf(expected, sizeof expected, "%s%s", path, rest);
    assert_string_equal(text, expected);
}

static inline void assert_contains(const char *text, const char *part)
{
    if (!strstr(text, part))
        fail_msg("\"%s\" does not contain \"%s\"", text, part);
}

struct fake_clock {
    struct clock_source source;
    int64_t now_ns;
    int interrupted; /* the next sleep is broken off */
};

static inline int64_t fake_now(void *state)
{
    return ((const struct fake_clock *)state)->now_ns;
}

static inline int fake_sleep(void *state, int64_t t_ns)
{
    struct fake_clock *c = state;
    if (c->interrupted) {
        c->interrupted = 0;
        return -4; /* EINTR */
    }
    if (t_ns > c->now_ns)
        c->now_ns = t_ns;
    return 0;
}

static inline void fake_clock_set(struct fake_clock *c, int64_t now_ns)
{
    *c = (struct fake_clock){.source = {fake_now, fake_sleep, c}, .now_ns = now_ns};
}

#endif
