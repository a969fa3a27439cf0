/* SPDX-License-Identifier: MIT */
/* Runs a target on files, and on all files of folders, without a fuzzer.  Every input has
 * bounded time, and without sanitizers (which need all addresses) bounded memory. */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/fuzz/fuzz.h"
#include "tests/msgs/memory_limit.h"

#define MAX_SECONDS 10 /* as tests/fuzz/run tells libFuzzer */
#define MAX_MEMORY  ((size_t)1 << 30)

/* What runs longer ends in SIGALRM, and is named before. */
static void replay(const char *path)
{
    struct stat st;
    FILE *f = fopen(path, "rb");
    FUZZ_REQUIRE(f && !fstat(fileno(f), &st));
    size_t size = (size_t)st.st_size;
    uint8_t *data = malloc(size ? size : 1); /* of its size: a read beyond it is found */
    FUZZ_REQUIRE(data && fread(data, 1, size, f) == size);
    fclose(f);
    fprintf(stderr, "%s\n", path);
    alarm(MAX_SECONDS);
    LLVMFuzzerTestOneInput(data, size);
    alarm(0);
    free(data);
}

static int is_visible(const struct dirent *e)
{
    return e->d_name[0] != '.';
}

/* Returns how many inputs there were; a folder that is not there holds none. */
static size_t replay_all(const char *path)
{
    struct dirent **entries;
    char entry[4096];
    int n = scandir(path, &entries, is_visible, alphasort);

    if (n < 0 && errno == ENOENT)
        return 0;
    if (n < 0) {
        replay(path);
        return 1;
    }
    for (int i = 0; i < n; i++) {
        snprintf(entry, sizeof entry, "%s/%s", path, entries[i]->d_name);
        replay(entry);
        free(entries[i]);
    }
    free(entries);
    return (size_t)n;
}

int main(int argc, char **argv)
{
    size_t n = 0;

    if (argc < 2 || argv[1][0] == '-') {
        fprintf(stderr, "usage: %s FILE_OR_FOLDER...\n", argv[0]);
        return 2;
    }
    FUZZ_REQUIRE(!memory_limit(MAX_MEMORY));
    FUZZ_REQUIRE(!LLVMFuzzerInitialize(&argc, &argv));
    for (int i = 1; i < argc; i++)
        n += replay_all(argv[i]);
    fprintf(stderr, "%zu inputs\n", n);
    return n ? 0 : 1;
}
