#include "nodes/launcher/screen.h"

#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "nodes/rt/log.h"

#define CLEAR_LINE "\r\033[K"

void screen_init(struct screen *s)
{
    *s = (struct screen){.out_terminal = isatty(STDOUT_FILENO),
                         .err_terminal = isatty(STDERR_FILENO)};
}

/* The level at the start of a line, and where its text begins. */
static enum log_level read_level(const char **line)
{
    for (int l = LOG_LEVEL_DEBUG; l <= LOG_LEVEL_ERROR; l++) {
        const char *name = log_level_name((enum log_level)l);
        size_t n = strlen(name);
        if (!strncmp(*line, name, n) && (*line)[n] == ' ') {
            *line += n + 1;
            return (enum log_level)l;
        }
    }
    return LOG_LEVEL_INFO;
}

static const char *colour(enum log_level level)
{
    switch (level) {
    case LOG_LEVEL_ERROR:
        return "\033[31m";
    case LOG_LEVEL_WARNING:
        return "\033[33m";
    case LOG_LEVEL_DEBUG:
        return "\033[2m";
    default:
        return "";
    }
}

/* One column less than there are: a line that wraps could not be rewritten. */
static int columns(void)
{
    struct winsize size;

    return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) || size.ws_col < 2 ? 79
                                                                      : size.ws_col - 1;
}

static void draw_progress(struct screen *s)
{
    printf(CLEAR_LINE "%.*s", columns(), s->progress);
    fflush(stdout);
}

void screen_log(struct screen *s, const char *node, const char *line)
{
    enum log_level level = read_level(&line);

    if (s->progress_shown) {
        printf(CLEAR_LINE);
        fflush(stdout);
    }
    if (s->err_terminal)
        fprintf(stderr, "\033[1m%-7s\033[0m %s%-7s %s\033[0m\n", node, colour(level),
                log_level_name(level), line);
    else
        fprintf(stderr, "%-7s %-7s %s\n", node, log_level_name(level), line);
    if (s->progress_shown)
        draw_progress(s);
}

void screen_progress(struct screen *s, const char *text)
{
    snprintf(s->progress, sizeof s->progress, "%s", text);
    if (s->out_terminal) {
        s->progress_shown = true;
        draw_progress(s);
    } else {
        printf("%s\n", text);
        fflush(stdout);
    }
}

void screen_end_progress(struct screen *s)
{
    if (s->progress_shown) /* whole, now that it stays */
        printf(CLEAR_LINE "%s\n", s->progress);
    fflush(stdout);
    s->progress_shown = false;
}
