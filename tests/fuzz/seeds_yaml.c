/* SPDX-License-Identifier: MIT */
#include <glob.h>
#include <string.h>

#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/seeds.h"

static void copy_all(const struct seeds *s, const char *pattern)
{
    glob_t found;

    FUZZ_REQUIRE(!glob(pattern, 0, NULL, &found));
    for (size_t i = 0; i < found.gl_pathc; i++) {
        struct bytes_buffer b = seeds_read(found.gl_pathv[i]);
        seeds_put(s, "yaml", strrchr(found.gl_pathv[i], '/') + 1, bytes_in(&b));
        bytes_free(&b);
    }
    globfree(&found);
}

void seeds_yaml(const struct seeds *s)
{
    copy_all(s, SOURCE_DIR "/launch/*.yaml");
    copy_all(s, SOURCE_DIR "/launch/scenes/*.yaml");
    copy_all(s, SOURCE_DIR "/tests/fuzz/mini.yaml");
}
