/* SPDX-License-Identifier: MIT */
#include "nodes/record/attachments.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const char *media_type(const char *name)
{
    static const char *const types[][2] = {{".yaml", "application/yaml"},
                                           {".yml", "application/yaml"},
                                           {".csv", "text/csv"},
                                           {".txt", "text/plain"},
                                           {".wav", "audio/wav"}};
    const char *dot = strrchr(name, '.');

    for (size_t i = 0; dot && i < sizeof types / sizeof *types; i++)
        if (!strcmp(dot, types[i][0]))
            return types[i][1];
    return "application/octet-stream";
}

/* Takes data over in any case. */
static int add(struct attachments *c, const char *name, uint8_t *data, size_t size)
{
    struct attachments_item *grown = realloc(c->items, (c->n + 1) * sizeof *grown);
    char *copy = strdup(name);

    if (grown)
        c->items = grown;
    if (!grown || !copy) {
        free(copy);
        free(data);
        return -ENOMEM;
    }
    c->items[c->n++] = (struct attachments_item){copy, data, size};
    return 0;
}

static int read_all(FILE *f, const char *path, uint8_t **out, size_t *size,
                    struct error *why)
{
    struct stat st;

    if (fstat(fileno(f), &st))
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    if (!S_ISREG(st.st_mode))
        return error_say(why, S_ISDIR(st.st_mode) ? -EISDIR : -EINVAL, "%s: no file",
                         path);
    if ((uint64_t)st.st_size > ATTACHMENTS_MAX_FILE)
        return error_say(why, -EFBIG, "%s: over %zu MB", path,
                         ATTACHMENTS_MAX_FILE >> 20);
    *size = (size_t)st.st_size;
    *out = malloc(*size + 1);
    if (!*out)
        return error_say(why, -ENOMEM, "out of memory");
    if (fread(*out, 1, *size, f) == *size)
        return 0;
    free(*out);
    return error_say(why, -EIO, "%s cannot be read", path);
}

int attachments_add_file(struct attachments *c, const char *name, const char *path,
                         struct error *why)
{
    uint8_t *data = NULL;
    size_t size = 0;
    FILE *f = fopen(path, "re");

    if (!f)
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    int err = read_all(f, path, &data, &size, why);
    fclose(f);
    if (!err && add(c, name, data, size))
        err = error_say(why, -ENOMEM, "out of memory");
    return err;
}

static int add_entry(struct attachments *c, const char *prefix, const char *folder,
                     const char *entry, struct error *why)
{
    char path[PATH_MAX], name[PATH_MAX];
    struct stat st;

    if (snprintf(path, sizeof path, "%s/%s", folder, entry) >= (int)sizeof path ||
        snprintf(name, sizeof name, "%s%s", prefix, entry) >= (int)sizeof name)
        return error_say(why, -ENAMETOOLONG, "%.500s/%s: path too long", folder, entry);
    if (stat(path, &st) || !S_ISREG(st.st_mode))
        return 0;
    return attachments_add_file(c, name, path, why);
}

int attachments_add_folder(struct attachments *c, const char *prefix, const char *folder,
                           struct error *why)
{
    struct dirent **names = NULL;
    int n = scandir(folder, &names, NULL, alphasort);
    int err = n < 0 ? error_say(why, -errno, "%s: %s", folder, strerror(errno)) : 0;

    for (int i = 0; i < n; i++) {
        if (!err && names[i]->d_name[0] != '.')
            err = add_entry(c, prefix, folder, names[i]->d_name, why);
        free(names[i]);
    }
    free(names);
    return err;
}

int attachments_write(const struct attachments *c, struct bag_writer *w, int64_t now_ns,
                      struct error *why)
{
    int err = 0;

    for (size_t i = 0; !err && i < c->n; i++) {
        const struct attachments_item *item = &c->items[i];
        const struct bag_attachment a = {.log_time = (uint64_t)now_ns,
                                         .create_time = (uint64_t)now_ns,
                                         .name = bytes_of(item->name),
                                         .media_type = bytes_of(media_type(item->name)),
                                         .data = {item->data, item->size}};
        err = bag_writer_attachment(w, &a, why);
    }
    return err;
}

void attachments_clear(struct attachments *c)
{
    for (size_t i = 0; i < c->n; i++) {
        free(c->items[i].name);
        free(c->items[i].data);
    }
    free(c->items);
    *c = (struct attachments){0};
}
