/* SPDX-License-Identifier: MIT */
#include "nodes/rt/terminal.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

bool colour_wanted(int fd)
{
    const char *no = getenv("NO_COLOR"), *kind = getenv("TERM");

    return isatty(fd) && !(no && *no) && kind && *kind && strcmp(kind, "dumb") != 0;
}

static size_t count_lines(const char *text)
{
    size_t n = 0;

    for (const char *p = text; *p; p++)
        n += *p == '\n';
    return n;
}

int live_draw(struct live *l, const char *text, size_t high, size_t wide)
{
    size_t n = count_lines(text), room = high > 2 ? high - 1 : 1, shown = n;

    if (n > room)
        shown = room - 1;
    if (l->n_lines)
        fprintf(l->f, "\033[%zuA", l->n_lines);
    for (size_t i = 0; i < shown; i++) {
        size_t length = strcspn(text, "\n");
        size_t width = length < wide ? length : wide - 1;
        fprintf(l->f, "\r\033[K%.*s\n", (int)width, text);
        text += length + 1;
    }
    l->n_lines = shown;
    if (shown < n) {
        char more[64];
        snprintf(more, sizeof more, "... and %zu lines more", n - shown);
        fprintf(l->f, "\r\033[K%.*s\n", (int)wide - 1, more);
        l->n_lines++;
    }
    fprintf(l->f, "\033[J"); /* what is left of a longer one */
    return fflush(l->f) ? -errno : 0;
}

void live_size(int fd, size_t *high, size_t *wide)
{
    struct winsize size;
    int err = ioctl(fd, TIOCGWINSZ, &size);

    *high = err || !size.ws_row ? 24 : size.ws_row;
    *wide = err || !size.ws_col ? 80 : size.ws_col;
}
