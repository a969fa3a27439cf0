/* SPDX-License-Identifier: MIT */
#include "nodes/record/parts.h"

#include <errno.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "dsp/list.h"

#define MAX_RECORDINGS 10000 /* of one name, FILE-2.mcap and so on */

/* Where the ending starts: "a.b/c" has none. */
static size_t stem_length(const char *path)
{
    const char *slash = strrchr(path, '/');
    const char *dot = strrchr(slash ? slash : path, '.');

    return dot && dot != path && dot[-1] != '/' ? (size_t)(dot - path) : strlen(path);
}

static void name_part(const struct parts *p, unsigned number, char path[PATH_MAX])
{
    if (p->split)
        snprintf(path, PATH_MAX, "%s_%04u%s", p->stem, number, p->ending);
    else
        snprintf(path, PATH_MAX, "%s%s", p->stem, p->ending);
}

/* Is a file of an earlier recording of that name there?  path: the first, if so. */
static bool is_taken(const struct parts *p, char path[PATH_MAX])
{
    glob_t found = {0};
    char pattern[2 * PATH_MAX];
    size_t n = 0;

    name_part(p, 1, path);
    if (!p->split)
        return !access(path, F_OK);
    for (const char *c = p->stem; *c; c++) { /* characters that glob(3) minds */
        if (strchr("*?[]\\", *c))
            pattern[n++] = '\\';
        pattern[n++] = *c;
    }
    snprintf(pattern + n, sizeof pattern - n, "_[0-9][0-9][0-9][0-9]%s", p->ending);
    bool taken = !glob(pattern, 0, NULL, &found) && found.gl_pathc;
    if (taken)
        snprintf(path, PATH_MAX, "%s", found.gl_pathv[0]);
    globfree(&found);
    return taken;
}

static int take_name(struct parts *p, const char *path, unsigned number, bool split,
                     struct error *why)
{
    size_t n = stem_length(path);
    char suffix[16] = "";

    *p = (struct parts){.split = split};
    if (number > 1)
        snprintf(suffix, sizeof suffix, "-%u", number);
    if (n + 32 >= sizeof p->stem || strlen(path + n) >= sizeof p->ending)
        return error_say(why, -ENAMETOOLONG, "%.500s: name too long", path);
    snprintf(p->stem, sizeof p->stem, "%.*s%s", (int)n, path, suffix);
    snprintf(p->ending, sizeof p->ending, "%s", path + n);
    return 0;
}

int parts_init(struct parts *p, const char *path, bool split, struct error *why)
{
    char taken[PATH_MAX];
    int err = take_name(p, path, 1, split, why);

    if (!err && is_taken(p, taken))
        err = error_say(why, -EEXIST,
                        "%.900s exists already; remove it or name another file", taken);
    return err;
}

int parts_init_free(struct parts *p, const char *path, bool split, struct error *why)
{
    char taken[PATH_MAX];

    for (unsigned i = 1; i <= MAX_RECORDINGS; i++) {
        int err = take_name(p, path, i, split, why);
        if (err || !is_taken(p, taken))
            return err;
    }
    return error_say(why, -EEXIST, "%.900s exists already; remove some recordings",
                     taken);
}

const char *parts_begin(struct parts *p, char path[PATH_MAX])
{
    name_part(p, ++p->n, path);
    return path;
}

int parts_end(struct parts *p, uint64_t bytes)
{
    if (list_grow(&p->closed, p->n_closed, &p->room, sizeof *p->closed))
        return -ENOMEM;
    p->closed[p->n_closed++] = (struct part){p->n, bytes};
    return 0;
}

uint64_t parts_bytes(const struct parts *p)
{
    uint64_t sum = 0;

    for (unsigned i = 0; i < p->n_closed; i++)
        sum += p->closed[i].bytes;
    return sum;
}

int parts_keep_quota(struct parts *p, uint64_t quota_bytes, uint64_t open_bytes,
                     struct error *why)
{
    char path[PATH_MAX];

    while (p->n_closed && parts_bytes(p) + open_bytes > quota_bytes) {
        name_part(p, p->closed[0].number, path);
        if (unlink(path) && errno != ENOENT)
            return error_say(why, -errno,
                             "%.900s cannot be removed to keep the quota: %s", path,
                             strerror(errno));
        p->n_removed++;
        p->removed_bytes += p->closed[0].bytes;
        memmove(p->closed, p->closed + 1, --p->n_closed * sizeof *p->closed);
    }
    return 0;
}

void parts_clear(struct parts *p)
{
    free(p->closed);
    *p = (struct parts){.n = 0};
}
