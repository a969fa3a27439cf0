/* SPDX-License-Identifier: MIT */
#include "nodes/rt/presence.h"

#include <inttypes.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

/* "1: FLOCK  ADVISORY  WRITE 6533 fe:00:11993496 0 EOF"; one that waits has "->". */
void presence_read(struct presence_locks *out, const char *path)
{
    char line[256];
    FILE *f = fopen(path ? path : "/proc/locks", "re");

    out->n = 0;
    if (!f)
        return;
    while (out->n < PRESENCE_MAX_LOCKS && fgets(line, sizeof line, f)) {
        uint64_t inode;
        int pid;
        if (sscanf(line, "%*u: FLOCK %*s %*s %d %*x:%*x:%" SCNu64, &pid, &inode) != 2)
            continue;
        out->held[out->n].pid = pid;
        out->held[out->n++].inode = inode;
    }
    fclose(f);
}

static FILE *open_lock(const char *run_dir, const char *node)
{
    char path[PATH_MAX];
    int n = snprintf(path, sizeof path, "%s/%s.lock", run_dir, node);

    return n > 0 && (size_t)n < sizeof path ? fopen(path, "re") : NULL;
}

bool presence_replays(const char *run_dir, const char *node)
{
    char word[8] = "";
    FILE *f = open_lock(run_dir, node);

    if (!f)
        return false;
    bool replays = fscanf(f, "%*d %7s", word) == 1 && !strcmp(word, "replay");
    fclose(f);
    return replays;
}

enum presence presence_of(const struct presence_locks *locks, const char *run_dir,
                          const char *node)
{
    struct stat st;
    int pid = 0;
    FILE *f = open_lock(run_dir, node);

    if (!f)
        return PRESENCE_NEVER;
    bool known = !fstat(fileno(f), &st) && fscanf(f, "%d", &pid) == 1;
    fclose(f);
    for (size_t i = 0; known && i < locks->n; i++)
        if (locks->held[i].pid == pid && locks->held[i].inode == st.st_ino)
            return PRESENCE_ALIVE;
    return PRESENCE_GONE;
}
