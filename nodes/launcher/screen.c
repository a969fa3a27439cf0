/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/screen.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include "nodes/rt/terminal.h"

void progress_init(struct progress *p, bool terminal)
{
    *p = (struct progress){
        .terminal = terminal, .step = -1, .state = ANLOS__SCAN_STATUS__STATE__WAITING};
}

static uint64_t messages_lost(const struct progress *p)
{
    uint64_t lost = 0;

    for (size_t i = 0; i < p->n_nodes; i++)
        lost += p->nodes[i].lost;
    return lost;
}

static void write_text(struct progress *p, const Anlos__ScanStatus *s)
{
    char left[32] = "";

    if (s->state == ANLOS__SCAN_STATUS__STATE__WAITING && !s->pings_done) {
        snprintf(p->text, sizeof p->text, "%s", s->text);
        return;
    }
    if (s->state == ANLOS__SCAN_STATUS__STATE__PAUSED) {
        snprintf(p->text, sizeof p->text, "paused at %u/%u pings; %s", s->pings_done,
                 s->pings_expected, s->text);
        return;
    }
    if (s->state == ANLOS__SCAN_STATUS__STATE__FAILED && !s->pings_done) {
        snprintf(p->text, sizeof p->text, "failed: %s", s->text);
        return;
    }
    if (!s->pings_expected) {
        snprintf(p->text, sizeof p->text, "%s: %s; %u pings, %u lost, %llu messages lost",
                 s->state == ANLOS__SCAN_STATUS__STATE__DONE     ? "done"
                 : s->state == ANLOS__SCAN_STATUS__STATE__FAILED ? "failed"
                 : s->pass == ANLOS__PASS__BACKGROUND            ? "background"
                                                                 : "runs",
                 s->text, s->pings_done, s->pings_lost,
                 (unsigned long long)messages_lost(p));
        return;
    }
    if (s->state == ANLOS__SCAN_STATUS__STATE__RUNNING && s->pings_done)
        snprintf(left, sizeof left, ", %.0f s left", s->time_left_s);
    snprintf(p->text, sizeof p->text,
             "%s %u/%u pings%s, %u retaken, %u given up, %llu messages lost%s%s",
             s->pass == ANLOS__PASS__BACKGROUND ? "background" : "scene", s->pings_done,
             s->pings_expected, left, s->pings_retaken, s->pings_lost,
             (unsigned long long)messages_lost(p), s->text[0] ? "; " : "", s->text);
}

/* What a reader of a pipe must not miss. */
static bool is_event(const struct progress *p, const Anlos__ScanStatus *s)
{
    if (p->endless && s->state == ANLOS__SCAN_STATUS__STATE__RUNNING)
        return !p->paced && s->pings_done;
    return s->state != p->state && (s->state == ANLOS__SCAN_STATUS__STATE__FAILED ||
                                    s->state == ANLOS__SCAN_STATUS__STATE__PAUSED ||
                                    p->state == ANLOS__SCAN_STATUS__STATE__PAUSED);
}

bool progress_status(struct progress *p, const Anlos__ScanStatus *s)
{
    p->endless = !s->pings_expected;
    bool event = is_event(p, s);
    int step = s->pings_expected ? (int)(10ull * s->pings_done / s->pings_expected) : -1;

    p->state = s->state;
    p->paced = s->state == ANLOS__SCAN_STATUS__STATE__RUNNING && s->pings_done;
    write_text(p, s);
    if (p->terminal)
        return true;
    if (step == p->step && !event)
        return false;
    p->step = step;
    return true;
}

bool progress_end(const struct progress *p)
{
    return !p->terminal && p->endless && p->paced;
}

void progress_health(struct progress *p, const Anlos__Health *health)
{
    size_t i = 0;

    while (i < p->n_nodes && strcmp(p->nodes[i].name, health->node))
        i++;
    if (i == PROGRESS_MAX_NODES)
        return;
    if (i == p->n_nodes)
        snprintf(p->nodes[p->n_nodes++].name, sizeof p->nodes[i].name, "%s",
                 health->node);
    p->nodes[i].lost = 0;
    for (size_t k = 0; k < health->n_topics; k++)
        p->nodes[i].lost += health->topics[k]->gaps + health->topics[k]->dropped;
}

#define CLEAR_LINE  "\r\033[K"
#define PLAIN       "\033[0m"
#define PATIENCE_MS 200 /* with a reader; none any more until it reads again */

void screen_init(struct screen *s, enum log_format format)
{
    *s = (struct screen){.format = format,
                         .out_terminal = isatty(STDOUT_FILENO),
                         .err_terminal = isatty(STDERR_FILENO),
                         .coloured = colour_wanted(STDERR_FILENO)};
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

/* A pipe that says so has room for 4096 bytes, more than nearly any line. */
static bool has_room(struct screen *s, int fd)
{
    bool *stuck = &s->stuck[fd == STDERR_FILENO];
    struct pollfd p = {.fd = fd, .events = POLLOUT};

    *stuck = poll(&p, 1, *stuck ? 0 : PATIENCE_MS) == 0;
    return !*stuck;
}

static void draw_progress(struct screen *s)
{
    if (!has_room(s, STDOUT_FILENO))
        return;
    printf(CLEAR_LINE "%.*s", columns(), s->progress);
    fflush(stdout);
}

static void clear_progress(struct screen *s)
{
    if (!s->progress_shown || !has_room(s, STDOUT_FILENO))
        return;
    printf(CLEAR_LINE);
    fflush(stdout);
}

static void write_for_terminal(const struct log_line *l, bool coloured)
{
    char text[LOG_TEXT_SIZE + 96], time_of_day[16] = "";
    time_t seconds = (time_t)(l->stamp_ns / 1000000000);
    struct tm t;

    if (localtime_r(&seconds, &t))
        strftime(time_of_day, sizeof time_of_day, "%H:%M:%S", &t);
    log_line_text(l, text, sizeof text);
    fprintf(stderr, "%s%s.%03d%s %s%-7s%s %s%-7s %s%s\n", coloured ? "\033[2m" : "",
            time_of_day, (int)(l->stamp_ns / 1000000 % 1000), coloured ? PLAIN : "",
            coloured ? "\033[1m" : "", l->node, coloured ? PLAIN : "",
            coloured ? colour(l->level) : "", log_level_name(l->level), text,
            coloured ? PLAIN : "");
}

static void write_line(const struct screen *s, const struct log_line *line)
{
    char text[LOG_LINE_SIZE];

    if (s->err_terminal && s->format == LOG_FORMAT_TEXT)
        write_for_terminal(line, s->coloured);
    else
        fwrite(text, 1, log_line_write(line, s->format, text), stderr);
}

static void tell_left_out(struct screen *s, int64_t now_ns)
{
    struct log_line note = {
        .stamp_ns = now_ns, .level = LOG_LEVEL_WARNING, .node = "launcher"};

    if (!s->left_out)
        return;
    snprintf(note.text, sizeof note.text,
             "%u lines before this were left out: nobody took them", s->left_out);
    write_line(s, &note);
    s->left_out = 0;
}

/* Makes way for a line of now_ns.  false: it is to be left out. */
static bool begin_line(struct screen *s, int64_t now_ns)
{
    if (!has_room(s, STDERR_FILENO)) {
        s->left_out++;
        return false;
    }
    clear_progress(s);
    tell_left_out(s, now_ns);
    return true;
}

void screen_log(struct screen *s, const struct log_line *line)
{
    if (!begin_line(s, line->stamp_ns))
        return;
    write_line(s, line);
    if (s->progress_shown)
        draw_progress(s);
}

void screen_output(struct screen *s, const char *node, const char *text, int64_t now_ns)
{
    struct log_line line;

    if (s->format == LOG_FORMAT_JSON && text[0] == '{') {
        if (!begin_line(s, now_ns))
            return;
        fprintf(stderr, "%s\n", text);
        if (s->progress_shown)
            draw_progress(s);
        return;
    }
    if (!log_line_read(&line, text)) {
        screen_log(s, &line);
        return;
    }
    line = (struct log_line){.stamp_ns = now_ns, .level = read_level(&text)};
    snprintf(line.node, sizeof line.node, "%s", node);
    do { /* what is too long for one line goes into more */
        size_t n = (size_t)snprintf(line.text, sizeof line.text, "%s", text);
        text += n < sizeof line.text ? n : sizeof line.text - 1;
        log_text_clean(line.text);
        screen_log(s, &line);
    } while (*text);
}

void screen_progress(struct screen *s, const char *text)
{
    snprintf(s->progress, sizeof s->progress, "%s", text);
    if (s->out_terminal) {
        s->progress_shown = true;
        draw_progress(s);
    } else if (has_room(s, STDOUT_FILENO)) {
        printf("%s\n", text);
        fflush(stdout);
    }
}

void screen_end_progress(struct screen *s)
{
    if (s->progress_shown && has_room(s, STDOUT_FILENO)) /* whole, now that it stays */
        printf(CLEAR_LINE "%s\n", s->progress);
    fflush(stdout);
    s->progress_shown = false;
}

void screen_close(struct screen *s, int64_t now_ns)
{
    screen_end_progress(s);
    s->stuck[1] = false; /* a last chance */
    if (s->left_out && has_room(s, STDERR_FILENO))
        tell_left_out(s, now_ns);
}
