/* Single lines that the screen and the plain table share. */
#include <inttypes.h>
#include <stdio.h>
#include <time.h>

#include "nodes/anlos/top/screen.h"
#include "nodes/anlos/text.h"

#define BAR_COLUMNS 10

void layout_summary(const struct table *t, char *out, size_t size)
{
    size_t alive = 0, off = 0;
    char refused[64] = "";

    for (size_t i = 0; i < t->n_nodes; i++) {
        alive += table_node_is_alive(&t->nodes[i]);
        off += t->nodes[i].state == TABLE_OFF;
    }
    if (t->own_refused)
        snprintf(refused, sizeof refused, ", %" PRIu64 " could not be read here",
                 t->own_refused);
    if (!alive && off == t->n_nodes)
        snprintf(out, size, "%s: nothing is running%s", t->run_dir, refused);
    else
        snprintf(out, size, "%s: %zu of %zu nodes alive, %" PRIu64 " messages lost%s",
                 t->run_dir, alive, t->n_nodes - off, t->lost, refused);
}

/* What it is at: a state, or the pass of one that runs. */
static const char *phase_word(const struct table_scan *s)
{
    static const char *const words[] = {"waiting", "scene", "done", "failed", "paused"};
    unsigned state = (unsigned)s->state;

    if (s->state == ANLOS__SCAN_STATUS__STATE__RUNNING &&
        s->pass == ANLOS__PASS__BACKGROUND)
        return "background";
    return state < 5 ? words[state] : "?";
}

/* "[####      ]  45%" */
static void write_bar(const struct table_scan *s, char out[32])
{
    char marks[BAR_COLUMNS + 1];
    double share = s->expected ? (double)s->done / (double)s->expected : 0;
    int full = share >= 1 ? BAR_COLUMNS : (int)(share * BAR_COLUMNS);

    for (int i = 0; i < BAR_COLUMNS; i++)
        marks[i] = i < full ? '#' : ' ';
    marks[BAR_COLUMNS] = '\0';
    snprintf(out, 32, "[%s] %3.0f%%", marks, 100 * (share < 1 ? share : 1));
}

void layout_scan(const struct table_scan *s, char *out, size_t size)
{
    char bar[32], left[32], ending[48] = "", text[TABLE_TEXT_SIZE];

    if (!s->known) {
        snprintf(out, size, "no scan yet");
        return;
    }
    text_clean(text, sizeof text, s->text);
    if (!s->expected && s->state == ANLOS__SCAN_STATUS__STATE__RUNNING) {
        snprintf(out, size,
                 "%s%" PRIu32 " pings, %s, %" PRIu32 " lost, scan %" PRIu32 ": %s",
                 s->over ? "last heard: " : "", s->done, phase_word(s), s->given_up,
                 s->scan, text);
        return;
    }
    write_bar(s, bar);
    text_duration(left, sizeof left, s->left_s);
    if (s->state == ANLOS__SCAN_STATUS__STATE__RUNNING && s->done)
        snprintf(ending, sizeof ending, ", %s left", left);
    snprintf(out, size,
             "%s%s %" PRIu32 "/%" PRIu32 " pings, position %" PRIu32 "%s, %s, %" PRIu32
             " retaken, %" PRIu32 " given up, scan %" PRIu32 "%s%s",
             s->over ? "last heard: " : "", bar, s->done, s->expected, s->position,
             ending, phase_word(s), s->retaken, s->given_up, s->scan, *text ? ": " : "",
             text);
}

void layout_log(const struct table_log *l, char *out, size_t size)
{
    time_t seconds = (time_t)(l->stamp_ns / 1000000000);
    char clock[16] = "--:--:--", times[40] = "", left_out[64] = "";
    char text[TABLE_TEXT_SIZE], node[ENVELOPE_NODE_SIZE];
    struct tm tm;

    if (localtime_r(&seconds, &tm))
        strftime(clock, sizeof clock, "%H:%M:%S", &tm);
    text_clean(text, sizeof text, l->text);
    text_clean(node, sizeof node, l->node);
    if (l->repeats)
        snprintf(times, sizeof times, " (%" PRIu64 " times more)", l->repeats);
    if (l->left_out)
        snprintf(left_out, sizeof left_out, " (%" PRIu64 " lines before it left out)",
                 l->left_out);
    snprintf(out, size, "%s %-7s %-8s %s%s%s", clock, l->level, node, text, times,
             left_out);
}
