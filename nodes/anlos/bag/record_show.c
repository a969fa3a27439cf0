#include "nodes/anlos/bag/record_show.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "nodes/anlos/live.h"

#define CLEAR_LINE "\r\033[K"
#define LIST_SIZE  200

/* "ping 3, traces 12" */
static void list_losses(const struct balance *t, char out[LIST_SIZE])
{
    size_t used = 0;

    out[0] = '\0';
    for (size_t i = 0; i < t->n && used < LIST_SIZE; i++)
        if (t->list[i].lost)
            used += (size_t)snprintf(out + used, LIST_SIZE - used, "%s%s %" PRIu64,
                                     used ? ", " : "", t->list[i].topic->name,
                                     t->list[i].lost);
}

static void clear_line(struct record_show *s)
{
    if (!s->line_shown)
        return;
    fputs(CLEAR_LINE, stdout);
    fflush(stdout);
    s->line_shown = false;
}

void record_show_progress(struct record_show *s, const struct recorder *r,
                          double elapsed_s, size_t queue_bytes)
{
    struct recorder_totals t;
    char losses[LIST_SIZE];

    recorder_sum(r, &t);
    list_losses(recorder_balance(r), losses);
    if (s->terminal) {
        char line[LIST_SIZE + 120];
        size_t rows, columns; /* a line that wraps would not be taken back */
        live_size(STDOUT_FILENO, &rows, &columns);
        snprintf(line, sizeof line,
                 "%.0f s  %" PRIu64 " messages  %.1f MB  waiting %.1f MB  lost %s",
                 elapsed_s, t.messages, 1e-6 * (double)t.file_bytes,
                 1e-6 * (double)queue_bytes, t.lost ? losses : "0");
        printf(CLEAR_LINE "%.*s", (int)columns - 1, line);
        fflush(stdout);
        s->line_shown = true;
    } else if (t.lost > s->lost) {
        fprintf(stderr, "anlos bag record: messages lost so far: %s\n", losses);
    }
    s->lost = t.lost;
}

void record_show_text(void *context, enum log_level level, const char *text)
{
    struct record_show *s = context;

    clear_line(s);
    fprintf(stderr, "anlos bag record: %s%s\n",
            level >= LOG_LEVEL_WARNING ? "warning: " : "", text);
}

bool record_show_end(struct record_show *s, const struct recorder *r, double elapsed_s)
{
    const struct balance *balance = recorder_balance(r);
    struct recorder_totals t;

    clear_line(s);
    recorder_sum(r, &t);
    printf("%-14s %10s %12s %10s\n", "topic", "messages", "MB", "lost");
    for (size_t i = 0; i < balance->n; i++)
        if (balance->list[i].messages || balance->list[i].lost)
            printf("%-14s %10" PRIu64 " %12.3f %10" PRIu64 "\n",
                   balance->list[i].topic->name, balance->list[i].messages,
                   1e-6 * (double)balance->list[i].bytes, balance->list[i].lost);
    if (t.unwritten)
        printf("of them %" PRIu64 ", the newest, could not be written\n", t.unwritten);
    printf("%s: %" PRIu64 " messages in %.1f s, %.3f MB", recorder_path(r),
           t.messages - t.unwritten, elapsed_s, 1e-6 * (double)t.file_bytes);
    if (t.n_files + t.n_removed > 1)
        printf(" in %u files", t.n_files);
    if (t.n_removed)
        printf(" (%u older ones are removed)", t.n_removed);
    printf(", %" PRIu64 " lost\n", t.lost);
    return !fflush(stdout);
}
