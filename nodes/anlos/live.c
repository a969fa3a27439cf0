/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/live.h"

#include <errno.h>
#include <string.h>
#include <sys/ioctl.h>

static size_t count_lines(const char *text)
{
    size_t n = 0;

    for (const char *p = text; *p; p++)
        n += *p == '\n';
    return n;
}

int live_draw(struct live *l, const char *text, size_t rows, size_t columns)
{
    size_t n = count_lines(text), room = rows > 2 ? rows - 1 : 1, shown = n;

    if (n > room)
        shown = room - 1;
    if (l->n_lines)
        fprintf(l->f, "\033[%zuA", l->n_lines);
    for (size_t i = 0; i < shown; i++) {
        size_t length = strcspn(text, "\n");
        size_t width = length < columns ? length : columns - 1;
        fprintf(l->f, "\r\033[K%.*s\n", (int)width, text);
        text += length + 1;
    }
    l->n_lines = shown;
    if (shown < n) {
        char more[64];
        snprintf(more, sizeof more, "... and %zu lines more", n - shown);
        fprintf(l->f, "\r\033[K%.*s\n", (int)columns - 1, more);
        l->n_lines++;
    }
    fprintf(l->f, "\033[J"); /* what is left of a longer one */
    return fflush(l->f) ? -errno : 0;
}

void live_size(int fd, size_t *rows, size_t *columns)
{
    struct winsize size;
    int err = ioctl(fd, TIOCGWINSZ, &size);

    *rows = err || !size.ws_row ? 24 : size.ws_row;
    *columns = err || !size.ws_col ? 80 : size.ws_col;
}
