/* SPDX-License-Identifier: MIT */
#include "nodes/rt/log_history.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define FILE_NAME    "log.recent"
#define PERIOD_NS    200000000LL /* at most five times a second */
#define LINE_LARGEST 16384

void log_history_open(struct log_history *h, const char *run_dir)
{
    *h = (struct log_history){.n = 0};
    snprintf(h->path, sizeof h->path, "%s/" FILE_NAME, run_dir);
    unlink(h->path);
}

static void make_room(struct log_history *h)
{
    size_t i = 0;

    if (h->n < LOG_HISTORY_LINES)
        return;
    while (i < h->n && !h->lines[i].informs)
        i++;
    i = i < h->n ? i : 0;
    free(h->lines[i].data);
    h->n--;
    memmove(&h->lines[i], &h->lines[i + 1], (h->n - i) * sizeof h->lines[0]);
}

void log_history_add(struct log_history *h, const Anlos__Log *line)
{
    size_t size = anlos__log__get_packed_size(line);
    uint8_t *data = h->path[0] && size <= LINE_LARGEST ? malloc(size + 1) : NULL;

    if (!data)
        return;
    make_room(h);
    h->lines[h->n].data = data;
    h->lines[h->n].size = (uint32_t)anlos__log__pack(line, data);
    h->lines[h->n].informs = line->level <= ANLOS__LOG__LEVEL__INFO;
    h->n++;
    h->fresh = true;
}

static bool write_all(const struct log_history *h, FILE *f)
{
    bool well = true;

    for (size_t i = 0; i < h->n && well; i++)
        well = fwrite(&h->lines[i].size, sizeof h->lines[i].size, 1, f) == 1 &&
               fwrite(h->lines[i].data, 1, h->lines[i].size, f) == h->lines[i].size;
    return well;
}

/* A full disk costs late comers the newest lines, and nobody else anything. */
static void write_file(const struct log_history *h)
{
    char name[sizeof h->path + 8];

    snprintf(name, sizeof name, "%s.new", h->path);
    int fd = open(name, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0600);
    FILE *f = fd < 0 ? NULL : fdopen(fd, "w");
    if (!f) {
        if (fd >= 0)
            close(fd);
        return;
    }
    bool well = write_all(h, f);
    if (fclose(f) || !well || rename(name, h->path))
        unlink(name);
}

int64_t log_history_tick(struct log_history *h, int64_t now_ns)
{
    if (!h->fresh)
        return INT64_MAX;
    if (now_ns < h->due_ns)
        return h->due_ns;
    write_file(h);
    h->fresh = false;
    h->due_ns = now_ns + PERIOD_NS;
    return INT64_MAX;
}

void log_history_close(struct log_history *h)
{
    for (size_t i = 0; i < h->n; i++)
        free(h->lines[i].data);
    if (h->path[0])
        unlink(h->path);
    *h = (struct log_history){.n = 0};
}

void log_history_read(const char *run_dir,
                      void (*call)(void *ctx, const Anlos__Log *line), void *ctx)
{
    char path[sizeof((struct log_history *)0)->path];
    static uint8_t data[LINE_LARGEST];
    uint32_t size;

    snprintf(path, sizeof path, "%s/" FILE_NAME, run_dir);
    FILE *f = fopen(path, "re");
    if (!f)
        return;
    for (size_t i = 0; i < LOG_HISTORY_LINES; i++) {
        if (fread(&size, sizeof size, 1, f) != 1 || size > sizeof data ||
            fread(data, 1, size, f) != size)
            break;
        Anlos__Log *line = anlos__log__unpack(NULL, size, data);
        if (line)
            call(ctx, line);
        if (line)
            anlos__log__free_unpacked(line, NULL);
    }
    fclose(f);
}
