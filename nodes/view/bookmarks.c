/* SPDX-License-Identifier: MIT */
#include "nodes/view/bookmarks.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "nodes/rt/export.h"
#include "nodes/rt/log.h"

#define ENDING      ".bookmarks"
#define LATEST_S    1e9
#define SAME_S      5e-4 /* times are written to a millisecond */
#define LINE_LENGTH 200

/* Nothing that would be a line's end, or that no page could show: it would be missing in
 * its list. */
static bool is_name(const char *text)
{
    char clean[BOOKMARK_NAME_SIZE];
    size_t n = strlen(text);

    if (!n || n >= sizeof clean || text[0] == ' ')
        return false;
    memcpy(clean, text, n + 1);
    log_text_clean(clean);
    return !strcmp(clean, text);
}

static bool is_time(double at_s)
{
    return at_s >= 0.0 && at_s <= LATEST_S; /* false for NaN */
}

/* Room for one more, at its place. */
static int insert(struct bookmarks *b, double at_s, const char *name)
{
    size_t i = b->n;

    if (list_grow(&b->list, b->n, &b->room, sizeof *b->list))
        return -ENOMEM;
    for (; i && b->list[i - 1].at_s > at_s; i--)
        b->list[i] = b->list[i - 1];
    b->list[i].at_s = at_s;
    snprintf(b->list[i].name, sizeof b->list[i].name, "%s", name);
    b->n++;
    return 0;
}

static void take_out(struct bookmarks *b, size_t i)
{
    b->n--;
    memmove(&b->list[i], &b->list[i + 1], (b->n - i) * sizeof *b->list);
}

static int take_line(struct bookmarks *b, char *line, unsigned number, struct error *why)
{
    char *end;

    line[strcspn(line, "\r\n")] = '\0';
    if (!line[strspn(line, " \t")])
        return 0;
    double at_s = strtod(line, &end);
    char *name = end + strspn(end, " \t");
    if (end == line || name == end || !is_time(at_s) || !is_name(name))
        return error_say(why, -EINVAL,
                         "%s:%u: expected seconds and a name of up to %d bytes of "
                         "UTF-8, like 12.34 cyclist",
                         b->path, number, BOOKMARK_NAME_SIZE - 1);
    if (b->n == BOOKMARKS_MOST)
        return error_say(why, -EINVAL, "%s:%u: more than %d bookmarks", b->path, number,
                         BOOKMARKS_MOST);
    return insert(b, at_s, name);
}

static int take_lines(struct bookmarks *b, FILE *f, struct error *why)
{
    char line[LINE_LENGTH];
    int err = 0;

    for (unsigned i = 1; !err && fgets(line, sizeof line, f); i++) {
        if (strlen(line) == sizeof line - 1 && line[sizeof line - 2] != '\n')
            return error_say(why, -EINVAL, "%s:%u: too long for a bookmark", b->path, i);
        err = take_line(b, line, i, why);
    }
    if (!err && ferror(f))
        err = error_say(why, -EIO, "%s: cannot be read", b->path);
    return err;
}

int bookmarks_read(struct bookmarks *b, const char *bag, struct error *why)
{
    bookmarks_clear(b);
    if (asprintf(&b->path, "%s" ENDING, bag) < 0) {
        b->path = NULL;
        return error_say(why, -ENOMEM, "out of memory");
    }
    FILE *f = fopen(b->path, "re");
    if (!f)
        return errno == ENOENT
                   ? 0
                   : error_say(why, -errno, "%s: %s", b->path, strerror(errno));
    int err = take_lines(b, f, why);
    if (err == -ENOMEM)
        error_say(why, err, "out of memory");
    if (err)
        b->n = 0;
    fclose(f);
    return err;
}

static int write_all(const struct bookmarks *b, struct error *why)
{
    const char *slash = strrchr(b->path, '/');
    char *folder = slash ? strndup(b->path, (size_t)(slash - b->path) + 1) : strdup(".");
    struct export_file e;

    if (!folder)
        return error_say(why, -ENOMEM, "out of memory");
    int err = export_file_open(&e, folder, slash ? slash + 1 : b->path, why);
    free(folder);
    if (err)
        return err;
    for (size_t i = 0; i < b->n; i++)
        fprintf(e.f, "%.3f %s\n", b->list[i].at_s, b->list[i].name);
    return export_file_commit(&e, why);
}

int bookmarks_add(struct bookmarks *b, double at_s, const char *name, struct error *why)
{
    if (!is_time(at_s) || !is_name(name))
        return error_say(why, -EINVAL,
                         "a bookmark needs a time and a name of up to %d "
                         "bytes",
                         BOOKMARK_NAME_SIZE - 1);
    if (b->n == BOOKMARKS_MOST)
        return error_say(why, -ENOSPC, "%s: there are %d bookmarks already", b->path,
                         BOOKMARKS_MOST);
    if (insert(b, at_s, name))
        return error_say(why, -ENOMEM, "out of memory");
    int err = write_all(b, why);
    for (size_t i = b->n; err && i-- > 0;)
        if (b->list[i].at_s <= at_s) { /* the newest of that time is the last */
            take_out(b, i);
            break;
        }
    return err;
}

int bookmarks_remove(struct bookmarks *b, double at_s, struct error *why)
{
    size_t i = 0;

    while (i < b->n && !(fabs(b->list[i].at_s - at_s) <= SAME_S))
        i++;
    if (i == b->n)
        return error_say(why, -ENOENT, "there is no bookmark at %.3f s", at_s);
    struct bookmark gone = b->list[i];
    take_out(b, i);
    int err = write_all(b, why);
    if (err)
        insert(b, gone.at_s, gone.name); /* of which there is room */
    return err;
}

void bookmarks_clear(struct bookmarks *b)
{
    free(b->path);
    free(b->list);
    *b = (struct bookmarks){.path = NULL};
}
