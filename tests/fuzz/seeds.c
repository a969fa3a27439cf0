/* SPDX-License-Identifier: MIT */
#include "tests/fuzz/seeds.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#include "tests/fuzz/fuzz.h"

const char *seeds_path(const struct seeds *s, const char *target, const char *name)
{
    static char path[PATH_MAX];

    mkdir(s->folder, 0777);
    snprintf(path, sizeof path, "%s/%s", s->folder, target);
    mkdir(path, 0777);
    snprintf(path, sizeof path, "%s/%s/%s", s->folder, target, name);
    return path;
}

void seeds_put(const struct seeds *s, const char *target, const char *name,
               struct bytes content)
{
    FILE *f = fopen(seeds_path(s, target, name), "wb");

    FUZZ_REQUIRE(f && fwrite(content.data, 1, content.size, f) == content.size);
    FUZZ_REQUIRE(!fclose(f));
}

struct bytes_buffer seeds_read(const char *path)
{
    struct bytes_buffer out = {0};
    uint8_t block[4096];
    FILE *f = fopen(path, "rb");

    FUZZ_REQUIRE(f);
    for (size_t n; (n = fread(block, 1, sizeof block, f)) > 0;)
        bytes_put(&out, (struct bytes){block, n});
    fclose(f);
    FUZZ_REQUIRE(!out.failed);
    return out;
}

int main(int argc, char **argv)
{
    const struct seeds s = {.folder = argv[1]};

    if (argc != 2 || argv[1][0] == '-') {
        fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
        return 2;
    }
    seeds_messages(&s);
    seeds_bags(&s);
    seeds_yaml(&s);
    seeds_recordings(&s);
    return 0;
}
