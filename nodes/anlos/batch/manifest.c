/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/batch/batch.h"

#include <ctype.h>
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "dsp/list.h"
#include "hal/text_file.h"

struct reading {
    const char *path;
    int folder; /* length of its folder's part, with the slash */
    struct manifest *m;
    size_t room, line;
    struct error *why;
};

static int out_of_memory(struct reading *r)
{
    return error_say(r->why, -ENOMEM, "%s: out of memory", r->path);
}

static void clear_bag(struct manifest_bag *b)
{
    free(b->job);
    free(b->name);
    free(b->path);
    free(b->launch);
    free(b->truth);
    free(b->scene);
    free(b->tags);
}

void manifest_clear(struct manifest *m)
{
    for (size_t i = 0; i < m->n; i++)
        clear_bag(&m->bags[i]);
    free(m->bags);
    *m = (struct manifest){.bags = NULL};
}

/* As seen from the manifest's folder.  NULL: no memory. */
static char *place(const struct reading *r, const char *path)
{
    char *out = NULL;

    if (path[0] == '/')
        return strdup(path);
    return asprintf(&out, "%.*s%s", r->folder, r->path, path) < 0 ? NULL : out;
}

static int take_file(struct reading *r, char **into, const char *key, const char *value)
{
    if (*into)
        return error_say(r->why, -EINVAL, "%s:%zu: %s= is there twice", r->path, r->line,
                         key);
    *into = place(r, value);
    return *into ? 0 : out_of_memory(r);
}

static int take_tag(struct reading *r, struct manifest_bag *b, const char *value)
{
    char *tags = NULL;

    if (asprintf(&tags, "%s%s%s", b->tags, b->tags[0] ? "," : "", value) < 0)
        return out_of_memory(r);
    free(b->tags);
    b->tags = tags;
    return 0;
}

static int take_bytes(struct reading *r, struct manifest_bag *b, const char *value)
{
    char *end;

    errno = 0;
    b->bytes = strtoull(value, &end, 10);
    if (!isdigit((unsigned char)value[0]) || *end || errno)
        return error_say(r->why, -EINVAL, "%s:%zu: bytes=%s: expected a number of bytes",
                         r->path, r->line, value);
    return 0;
}

static int take_field(struct reading *r, struct manifest_bag *b, char *field, bool *sized)
{
    char *value = field;
    const char *key = strsep(&value, "=");

    if (!value || !*value)
        return error_say(r->why, -EINVAL,
                         "%s:%zu: \"%s\": expected key=value after the path, with tabs "
                         "between",
                         r->path, r->line, field);
    if (!strcmp(key, "tag"))
        return take_tag(r, b, value);
    if (!strcmp(key, "truth"))
        return take_file(r, &b->truth, key, value);
    if (!strcmp(key, "scene"))
        return take_file(r, &b->scene, key, value);
    if (!strcmp(key, "launch"))
        return take_file(r, &b->launch, key, value);
    if (strcmp(key, "bytes"))
        return error_say(r->why, -EINVAL,
                         "%s:%zu: %s: no such key; expected truth, scene, tag, launch or "
                         "bytes",
                         r->path, r->line, key);
    *sized = true;
    return take_bytes(r, b, value);
}

static int name_job(struct reading *r, struct manifest_bag *b)
{
    const char *launch = b->launch;

    if (launch && !strncmp(launch, r->path, (size_t)r->folder))
        launch += r->folder;
    if (asprintf(&b->job, "%s%s%s", b->name, launch ? " with " : "",
                 launch ? launch : "") >= 0)
        return 0;
    b->job = NULL;
    return out_of_memory(r);
}

static int take_bag(struct reading *r, struct manifest_bag *b, char *line)
{
    char *field;
    bool sized = false;
    struct stat st;
    int err = 0;

    char *name = strsep(&line, "\t");
    while (!strncmp(name, "./", 2)) /* the same bag by another name */
        name += 2;
    if (!*name)
        return error_say(r->why, -EINVAL, "%s:%zu: expected a path before the first tab",
                         r->path, r->line);
    b->line = r->line;
    b->name = strdup(name);
    b->path = b->name ? place(r, b->name) : NULL;
    b->tags = strdup("");
    if (!b->path || !b->tags)
        return out_of_memory(r);
    while (!err && (field = strsep(&line, "\t")))
        if (*field)
            err = take_field(r, b, field, &sized);
    if (!err && b->truth && b->scene)
        err = error_say(r->why, -EINVAL,
                        "%s:%zu: expected one of truth= and scene=", r->path, r->line);
    if (!err && !sized && !stat(b->path, &st) && st.st_size > 0)
        b->bytes = (uint64_t)st.st_size;
    return err ? err : name_job(r, b);
}

static int take_line(void *ctx, char *line, size_t number)
{
    struct reading *r = ctx;
    struct manifest *m = r->m;

    r->line = number;
    line[strcspn(line, "\r\n")] = '\0';
    if (!line[strspn(line, " \t")] || line[0] == '#')
        return 0;
    if (list_grow(&m->bags, m->n, &r->room, sizeof *m->bags))
        return out_of_memory(r);
    struct manifest_bag *b = &m->bags[m->n++];
    *b = (struct manifest_bag){.job = NULL};
    return take_bag(r, b, line);
}

static int by_job(const void *a, const void *b)
{
    const struct manifest_bag *x = a, *y = b;
    int order = strcmp(x->job, y->job);

    return order ? order : (x->line > y->line) - (x->line < y->line);
}

static int by_line(const void *a, const void *b)
{
    const struct manifest_bag *x = a, *y = b;

    return (x->line > y->line) - (x->line < y->line);
}

static int by_bytes(const void *a, const void *b)
{
    const struct manifest_bag *x = a, *y = b;

    return x->bytes != y->bytes ? (x->bytes < y->bytes) - (x->bytes > y->bytes)
                                : by_line(a, b);
}

static void sort(struct manifest *m, int (*order)(const void *, const void *))
{
    qsort(m->bags, m->n, sizeof *m->bags, order);
}

static int check(const struct reading *r)
{
    struct manifest *m = r->m;
    int err = 0;

    if (!m->n)
        return error_say(r->why, -EINVAL,
                         "%s: no bag is in it; expected the path of one on each line",
                         r->path);
    sort(m, by_job);
    for (size_t i = 1; i < m->n && !err; i++)
        if (!strcmp(m->bags[i - 1].job, m->bags[i].job))
            err = error_say(r->why, -EINVAL, "%s:%zu: %s is in line %zu already", r->path,
                            m->bags[i].line, m->bags[i].job, m->bags[i - 1].line);
    sort(m, by_line);
    return err;
}

int manifest_load(struct manifest *m, const char *path, struct error *why)
{
    const char *slash = strrchr(path, '/');
    struct reading r = {
        .path = path, .folder = slash ? (int)(slash - path) + 1 : 0, .m = m, .why = why};

    *m = (struct manifest){.bags = NULL};
    int err = text_file_lines(path, take_line, &r, why);
    if (!err)
        err = check(&r);
    if (err)
        manifest_clear(m);
    return err;
}

static size_t least(const uint64_t *load, size_t n)
{
    size_t best = 0;

    for (size_t i = 1; i < n; i++)
        if (load[i] < load[best])
            best = i;
    return best;
}

int manifest_shard(struct manifest *m, size_t shard, size_t n_shards)
{
    uint64_t *load = calloc(n_shards, sizeof *load);
    size_t kept = 0;

    if (!load)
        return -ENOMEM;
    sort(m, by_bytes);
    for (size_t i = 0; i < m->n; i++) {
        size_t to = least(load, n_shards);
        load[to] += m->bags[i].bytes + 1; /* those without a size are spread too */
        if (to + 1 == shard)
            m->bags[kept++] = m->bags[i];
        else
            clear_bag(&m->bags[i]);
    }
    m->n = kept;
    free(load);
    return 0;
}
