/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/top/screen.h"

#include <ctype.h>
#include <curses.h>
#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "nodes/anlos/text.h"

/* -- columns ----------------------------------------------------------------------------
 */

#define CELL       TEXT_CELL_SIZE
#define REST_LEAST 10 /* a column of the rest that is narrower is left out */

enum cell {             /* what is behind a column's offset in its row */
            CELL_TEXT,  /* char [] */
            CELL_NAME,  /* const char * */
            CELL_TOPIC, /* const struct topic * */
            CELL_NODE_STATE,
            CELL_TOPIC_STATE,
            CELL_WAY,    /* bool: published */
            CELL_COUNT,  /* uint64_t */
            CELL_QUEUED, /* uint32_t */
            CELL_ID,     /* uint32_t */
            CELL_PID,    /* uint32_t */
            CELL_ALIVE,  /* unsigned [2]: alive, known */
            CELL_MEMORY, /* uint64_t */
            CELL_BYTES,  /* double, as all below */
            CELL_SHARE,
            CELL_SECONDS,
            CELL_RATE, /* [2]: is, expected */
            CELL_HZ,
            CELL_CENTI, /* two digits */
            CELL_DECI,
            CELL_PERCENT,
            CELL_LATENCY, /* struct table_latency */
            CELL_MEASUREMENT,
            CELL_SHAPE,
            CELL_FRAME, /* the whole object */
};

struct column {
    const char *title; /* NULL ends a list */
    int width;         /* 0: the rest of the line */
    bool left;
    int rank;     /* the highest goes first when there is no room */
    size_t field; /* its offset in the row */
    enum cell cell;
    enum look_sort sort; /* that goes by it, or by the sum of such */
};

struct link_row {     /* a topic at a node */
    const char *name; /* the topic's, or the node's */
    struct table_link link;
};

#define N(field) offsetof(struct table_node, field)
#define T(field) offsetof(struct table_topic, field)
#define L(field) offsetof(struct link_row, field)
#define O(field) offsetof(struct table_object, field)

static const struct column node_columns[] = {
    {"NODE", 8, true, 0, N(name), CELL_TEXT, 0},
    {"STATE", 8, true, 0, N(state), CELL_NODE_STATE, 0},
    {"CPU%", 5, false, 1, N(cpu), CELL_SHARE, LOOK_BY_LOAD},
    {"MEM", 5, false, 5, N(rss_bytes), CELL_MEMORY, 0},
    {"HZ/EXPECTED", 11, false, 3, N(rate_hz), CELL_RATE, LOOK_BY_RATE},
    {"LATENCY ms", 10, false, 4, N(latency), CELL_LATENCY, LOOK_BY_LATENCY},
    {"QUEUE", 5, false, 6, N(queued), CELL_COUNT, 0},
    {"DROPS", 5, false, 2, N(dropped), CELL_COUNT, LOOK_BY_LOSSES},
    {"GAPS", 5, false, 2, N(gaps), CELL_COUNT, LOOK_BY_LOSSES},
    {"REFUSED", 7, false, 7, N(refused), CELL_COUNT, LOOK_BY_LOSSES},
    {"UP", 6, false, 8, N(uptime_s), CELL_SECONDS, 0},
    {"PID", 7, false, 9, N(pid), CELL_PID, 0},
    {"IN Hz", 6, false, 10, N(in_hz), CELL_HZ, 0},
    {"OUT Hz", 6, false, 10, N(out_hz), CELL_HZ, 0},
    {"SAYS", 0, true, 8, N(text), CELL_TEXT, 0},
    {NULL, 0, false, 0, 0, 0, 0},
};

static const struct column topic_columns[] = {
    {"TOPIC", 13, true, 0, T(topic), CELL_TOPIC, 0},
    {"STATE", 6, true, 0, T(state), CELL_TOPIC_STATE, 0},
    {"HZ/EXPECTED", 11, false, 1, T(rate_hz), CELL_RATE, LOOK_BY_RATE},
    {"BYTES/s", 7, false, 3, T(bytes_s), CELL_BYTES, LOOK_BY_LOAD},
    {"SIZE", 5, false, 6, T(size_bytes), CELL_BYTES, 0},
    {"NODES", 5, false, 5, T(alive), CELL_ALIVE, 0},
    {"LOST", 5, false, 2, T(lost), CELL_COUNT, LOOK_BY_LOSSES},
    {"QUEUE", 5, false, 7, T(queued), CELL_COUNT, 0},
    {"LATENCY ms", 10, false, 4, T(latency), CELL_LATENCY, LOOK_BY_LATENCY},
    {"MESSAGES", 8, false, 8, T(messages), CELL_COUNT, 0},
    {NULL, 0, false, 0, 0, 0, 0},
};

static const struct column link_columns[] = {
    {"", 13, true, 0, L(name), CELL_NAME, 0},
    {"WAY", 6, true, 0, L(link.published), CELL_WAY, 0},
    {"HZ/EXPECTED", 11, false, 1, L(link.rate_hz), CELL_RATE, 0},
    {"BYTES/s", 7, false, 4, L(link.bytes_s), CELL_BYTES, 0},
    {"MSGS", 5, false, 5, L(link.messages), CELL_COUNT, 0},
    {"GAPS", 5, false, 2, L(link.gaps), CELL_COUNT, 0},
    {"DROPS", 5, false, 2, L(link.dropped), CELL_COUNT, 0},
    {"QUEUE", 5, false, 3, L(link.queued), CELL_QUEUED, 0},
    {"LATENCY ms", 10, false, 4, L(link.latency), CELL_LATENCY, 0},
    {NULL, 0, false, 0, 0, 0, 0},
};

static const struct column object_columns[] = {
    {"OBJECT", 6, true, 0, O(id), CELL_ID, 0},
    {"STATE", 9, true, 0, O(measurement), CELL_MEASUREMENT, 0},
    {"X m", 6, false, 1, O(at_m[0]), CELL_CENTI, 0},
    {"Y m", 6, false, 1, O(at_m[1]), CELL_CENTI, 0},
    {"VX m/s", 6, false, 2, O(velocity_m_s[0]), CELL_CENTI, 0},
    {"VY m/s", 6, false, 2, O(velocity_m_s[1]), CELL_CENTI, 0},
    {"EXISTS%", 7, false, 3, O(existence), CELL_PERCENT, 0},
    {"AGE s", 6, false, 4, O(age_s), CELL_DECI, 0},
    {"UNSEEN", 6, false, 6, O(unseen_s), CELL_DECI, 0},
    {"CLASS", 8, true, 5, O(shape), CELL_SHAPE, 0},
    {"Z m", 6, false, 7, O(at_m[2]), CELL_CENTI, 0},
    {"FRAME", 0, true, 8, 0, CELL_FRAME, 0},
    {NULL, 0, false, 0, 0, 0, 0},
};

/* A cell of two stands beside the other. */
#define IS_PAIR(type, first, second)                                                     \
    (offsetof(type, second) == offsetof(type, first) + sizeof((type *)0)->first)
_Static_assert(IS_PAIR(struct table_node, rate_hz, expected_hz), "CELL_RATE");
_Static_assert(IS_PAIR(struct table_topic, rate_hz, expected_hz), "CELL_RATE");
_Static_assert(IS_PAIR(struct table_link, rate_hz, expected_hz), "CELL_RATE");
_Static_assert(IS_PAIR(struct table_topic, alive, known), "CELL_ALIVE");
_Static_assert((int)TABLE_MAX_NODES <= (int)LOOK_MAX_ROWS, "look_rows");
_Static_assert((int)TABLE_MAX_TOPICS <= (int)LOOK_MAX_ROWS, "look_rows");
_Static_assert((int)TABLE_MAX_OBJECTS <= (int)LOOK_MAX_ROWS, "look_rows");

/* A word of a list, by its number. */
static const char *word(const char *const *words, unsigned n, unsigned i)
{
    return i < n ? words[i] : "?";
}

static void fixed(char out[CELL], int digits, double value)
{
    snprintf(out, CELL, isfinite(value) ? "%.*f" : "-", digits, value);
}

static void write_cell(const struct column *c, const void *row, char out[CELL])
{
    static const char *const measured[] = {"new", "measured", "predicted", "deleted"};
    static const char *const shapes[] = {"-", "point", "plate", "extended"};
    const void *at = (const char *)row + c->field;
    const struct table_object *o = row;
    const unsigned *u = at;
    const uint64_t *n = at;
    const double *d = at;

    switch (c->cell) {
    case CELL_TEXT:
        text_clean(out, CELL, at);
        break;
    case CELL_NAME:
        snprintf(out, CELL, "%s", *(const char *const *)at);
        break;
    case CELL_TOPIC:
        snprintf(out, CELL, "%s", (*(const struct topic *const *)at)->name);
        break;
    case CELL_NODE_STATE:
        snprintf(out, CELL, "%s", table_node_state_name(*u));
        break;
    case CELL_TOPIC_STATE:
        snprintf(out, CELL, "%s", table_topic_state_name(*u));
        break;
    case CELL_WAY:
        snprintf(out, CELL, "%s", *(const bool *)at ? "out" : "in");
        break;
    case CELL_COUNT:
        text_count(out, CELL, *n);
        break;
    case CELL_QUEUED:
        text_count(out, CELL, *u);
        break;
    case CELL_ID:
    case CELL_PID:
        snprintf(out, CELL, *u || c->cell == CELL_ID ? "%u" : "-", *u);
        break;
    case CELL_ALIVE:
        snprintf(out, CELL, "%u/%u", u[0], u[1]);
        break;
    case CELL_MEMORY:
        text_bytes(out, CELL, *n ? (double)*n : NAN);
        break;
    case CELL_BYTES:
        text_bytes(out, CELL, *d);
        break;
    case CELL_SHARE:
        text_percent(out, CELL, *d);
        break;
    case CELL_SECONDS:
        text_duration(out, CELL, *d);
        break;
    case CELL_RATE:
        text_rate(out, CELL, d[0], d[1]);
        break;
    case CELL_HZ:
        text_rate(out, CELL, *d, 0);
        out[strcspn(out, "/")] = '\0';
        break;
    case CELL_CENTI:
        fixed(out, 2, *d);
        break;
    case CELL_DECI:
        fixed(out, 1, *d);
        break;
    case CELL_PERCENT:
        fixed(out, 0, 100.0 * *d);
        break;
    case CELL_LATENCY:
        text_latency(out, CELL, at);
        break;
    case CELL_MEASUREMENT:
        snprintf(out, CELL, "%s", word(measured, 4, *u));
        break;
    case CELL_SHAPE:
        snprintf(out, CELL, "%s", word(shapes, 4, *u));
        break;
    case CELL_FRAME:
        snprintf(out, CELL, "%s%s", o->in_vehicle_frame ? "vehicle" : "array",
                 o->mirrored ? "" : ", as imaged");
    }
}

/* The ranks above it have no room. */
static int choose_rank(const struct column *columns, int width)
{
    for (int rank = 10;; rank--) {
        int sum = 0;
        for (const struct column *c = columns; c->title; c++)
            if (c->rank <= rank)
                sum += 1 + (c->width ? c->width : REST_LEAST);
        if (!rank || sum <= width)
            return rank;
    }
}

/* Blanks at the end. */
static void trim(char *text)
{
    for (size_t n = strlen(text); n && text[n - 1] == ' ';)
        text[--n] = '\0';
}

/* row NULL: the titles.  A line of at most width columns, without blanks at the end.  The
 * first two columns are always there. */
static void write_row(const struct column *columns, int width, const void *row,
                      char out[PAGE_LINE_SIZE])
{
    int rank = choose_rank(columns, width);
    size_t used = 0;

    for (const struct column *c = columns; c->title; c++) {
        char cell[CELL];
        if (c->rank > rank)
            continue;
        if (row)
            write_cell(c, row, cell);
        else
            snprintf(cell, sizeof cell, "%s", c->title);
        if (c->width)
            text_cut(cell, (size_t)c->width);
        int blanks = c->width - (int)text_columns(cell);
        int before = c->left || blanks < 0 ? 0 : blanks;
        int after = c->left && blanks > 0 ? blanks : 0;
        int n = snprintf(out + used, PAGE_LINE_SIZE - used, " %*s%s%*s", before, "", cell,
                         after, "");
        used += n > 0 && (size_t)n < PAGE_LINE_SIZE - used ? (size_t)n : 0;
    }
    if (width < INT_MAX)
        text_cut(out, (size_t)width);
    trim(out);
}

/* -- which rows, in which order ---------------------------------------------------------
 */

enum { MAX_STATES = 7 };

static const struct {
    const struct column *columns;
    size_t rows, size; /* of the table: where the first is, how large each is */
    size_t n;          /* where their number is */
    enum page_tone tones[MAX_STATES]; /* by the second column, the state */
} lists[LOOK_PANELS] = {
    [LOOK_NODES] = {node_columns,
                    offsetof(struct table, nodes),
                    sizeof(struct table_node),
                    offsetof(struct table, n_nodes),
                    {[TABLE_OFF] = PAGE_FAINT,
                     [TABLE_STARTING] = PAGE_NOTE,
                     [TABLE_READY] = PAGE_GOOD,
                     [TABLE_DEGRADED] = PAGE_NOTE,
                     [TABLE_FAULT] = PAGE_BAD,
                     [TABLE_SILENT] = PAGE_NOTE,
                     [TABLE_DEAD] = PAGE_BAD}},
    [LOOK_TOPICS] = {topic_columns,
                     offsetof(struct table, topics),
                     sizeof(struct table_topic),
                     offsetof(struct table, n_topics),
                     {[TABLE_ABSENT] = PAGE_FAINT,
                      [TABLE_IDLE] = PAGE_FAINT,
                      [TABLE_OK] = PAGE_GOOD,
                      [TABLE_LOW] = PAGE_NOTE,
                      [TABLE_LOSING] = PAGE_BAD,
                      [TABLE_CUT] = PAGE_BAD}},
    [LOOK_OBJECTS] = {object_columns,
                      offsetof(struct table, objects.list),
                      sizeof(struct table_object),
                      offsetof(struct table, objects.n),
                      {PAGE_GOOD, PAGE_GOOD, PAGE_NOTE, PAGE_GOOD}},
};

static size_t count_rows(const struct table *t, enum look_panel panel)
{
    return *(const size_t *)(const void *)((const char *)t + lists[panel].n);
}

static const void *row_at(const struct table *t, enum look_panel panel, size_t i)
{
    return (const char *)t + lists[panel].rows + i * lists[panel].size;
}

/* By its second column, the state, which may be that of a later version. */
static enum page_tone row_tone(const struct table *t, enum look_panel panel, size_t i)
{
    size_t at = lists[panel].columns[1].field;
    unsigned state =
        *(const unsigned *)(const void *)((const char *)row_at(t, panel, i) + at);

    return state < MAX_STATES ? lists[panel].tones[state] : PAGE_PLAIN;
}

static bool is_absent(const struct table *t, enum look_panel panel, size_t i)
{
    return panel == LOOK_TOPICS && t->topics[i].state == TABLE_ABSENT;
}

/* What is not known comes below what is known, and what is absent below that. */
static double row_key(const struct table *t, enum look_panel panel, size_t i,
                      enum look_sort sort)
{
    double key = 0.0;

    for (const struct column *c = lists[panel].columns; c->title; c++) {
        const void *at = (const char *)row_at(t, panel, i) + c->field;
        const struct table_latency *l = at;
        if (!sort || c->sort != sort)
            continue;
        double v = c->cell == CELL_COUNT     ? (double)*(const uint64_t *)at
                   : c->cell == CELL_LATENCY ? (l->n ? l->median_s : NAN)
                                             : *(const double *)at;
        key += isnan(v) ? -1.0 : v;
    }
    return is_absent(t, panel, i) ? -INFINITY : key;
}

struct order {
    const struct table *table;
    enum look_panel panel;
    enum look_sort sort;
};

static const char *row_name(const struct table *t, enum look_panel panel, size_t i,
                            char out[CELL])
{
    write_cell(lists[panel].columns, row_at(t, panel, i), out);
    return out;
}

static int compare(const void *a, const void *b, void *ctx)
{
    const struct order *o = ctx;
    size_t i = *(const size_t *)a, k = *(const size_t *)b;
    double x = row_key(o->table, o->panel, i, o->sort);
    double y = row_key(o->table, o->panel, k, o->sort);
    char one[CELL], other[CELL];

    if (x != y)
        return x < y ? 1 : -1;
    int way = o->sort == LOOK_BY_NAME ? strcmp(row_name(o->table, o->panel, i, one),
                                               row_name(o->table, o->panel, k, other))
                                      : 0;
    return way ? way : i < k ? -1 : i > k;
}

static bool is_selected(const struct look *v, const struct table *t,
                        enum look_panel panel, size_t i)
{
    return panel == LOOK_NODES    ? !strcmp(t->nodes[i].name, v->node)
           : panel == LOOK_TOPICS ? t->topics[i].topic == v->topic
                                  : false;
}

size_t look_rows(const struct look *v, const struct table *t, enum look_panel panel,
                 size_t order[LOOK_MAX_ROWS], size_t *at)
{
    struct order by = {t, panel, v->sort};
    char called[CELL];
    size_t n = 0;

    for (size_t i = 0; i < count_rows(t, panel); i++)
        if (panel == LOOK_OBJECTS || strstr(row_name(t, panel, i, called), v->filter))
            order[n++] = i;
    if (panel != LOOK_OBJECTS)
        qsort_r(order, n, sizeof *order, compare, &by);
    *at = 0;
    for (size_t i = 0; i < n; i++)
        if (is_selected(v, t, panel, order[i]))
            *at = i;
    return n;
}

static const char *const sort_names[] = {"order",   "load",   "rate",
                                         "latency", "losses", "name"};

/* -- keys -------------------------------------------------------------------------------
 */

enum { PAGE_STEP = 8, MOST_DETAIL = TABLE_MAX_LINKS * TABLE_MAX_NODES };

/* Where a key leads from one of n rows. */
static size_t moved(size_t at, size_t n, int key)
{
    size_t last = n ? n - 1 : 0;
    size_t step = key == KEY_PPAGE || key == KEY_NPAGE ? PAGE_STEP : 1;

    if (key == KEY_HOME)
        return 0;
    if (key == KEY_END)
        return last;
    if (key == KEY_UP || key == KEY_PPAGE)
        return at > step ? at - step : 0;
    return at + step < last ? at + step : last;
}

static void move_in_panel(struct look *v, const struct table *t, int key)
{
    size_t order[LOOK_MAX_ROWS], n, at, last = t->n_logs ? t->n_logs - 1 : 0;

    switch (v->focus) {
    case LOOK_DETAIL: /* at most a line for each link, of all nodes, and a few */
        v->detail_line = moved(v->detail_line, MOST_DETAIL, key);
        return;
    case LOOK_OBJECTS:
        v->object_line = moved(v->object_line, t->objects.n, key);
        return;
    case LOOK_LOG: /* told from its newest line */
        at = v->log_line < last ? last - v->log_line : 0;
        v->log_line = last - moved(at, t->n_logs, key);
        return;
    default:
        n = look_rows(v, t, v->focus, order, &at);
        at = moved(at, n, key);
        if (n && v->focus == LOOK_NODES)
            snprintf(v->node, sizeof v->node, "%s", t->nodes[order[at]].name);
        else if (n)
            v->topic = t->topics[order[at]].topic;
        v->detail_line = 0;
    }
}

/* The objects have a panel when there is a list of them. */
static void focus_next(struct look *v, const struct table *t, int steps)
{
    do
        v->focus = (enum look_panel)(((int)v->focus + steps) % LOOK_PANELS);
    while (v->focus == LOOK_OBJECTS && !t->objects.known);
    if (v->focus == LOOK_NODES || v->focus == LOOK_TOPICS) {
        v->detail_of_topic = v->focus == LOOK_TOPICS;
        v->detail_line = 0;
    }
}

/* Enter keeps the filter, escape takes it back. */
static void type(struct look *v, int key)
{
    size_t n = strlen(v->filter);

    if (key == '\033')
        v->filter[0] = '\0';
    if (key == '\033' || key == '\n' || key == '\r' || key == KEY_ENTER)
        v->typing = false;
    else if ((key == KEY_BACKSPACE || key == '\177' || key == '\b') && n)
        v->filter[n - 1] = '\0';
    else if (key >= ' ' && key < '\177' && n + 1 < sizeof v->filter)
        snprintf(v->filter + n, sizeof v->filter - n, "%c", key);
}

static void command(struct look *v, const struct table *t, int key)
{
    switch (key) {
    case '\t':
    case KEY_RIGHT:
        focus_next(v, t, 1);
        break;
    case KEY_BTAB:
    case KEY_LEFT:
        focus_next(v, t, LOOK_PANELS - 1);
        break;
    case 's':
        v->sort = (enum look_sort)((v->sort + 1) % LOOK_SORTS);
        break;
    case 'p':
    case ' ':
        v->paused = !v->paused;
        break;
    case 'h':
    case '?':
        v->help = true;
        break;
    case '/':
        v->typing = true;
        break;
    case '\033':
        v->filter[0] = '\0';
        break;
    case 'k':
    case 'j':
        move_in_panel(v, t, key == 'k' ? KEY_UP : KEY_DOWN);
        break;
    case KEY_UP:
    case KEY_DOWN:
    case KEY_PPAGE:
    case KEY_NPAGE:
    case KEY_HOME:
    case KEY_END:
        move_in_panel(v, t, key);
        break;
    default:
        break;
    }
}

bool look_key(struct look *v, const struct table *t, int key)
{
    if (v->typing) {
        type(v, key);
        return false;
    }
    if (key == 'q' || key == 'Q')
        return true;
    if (v->help)
        v->help = false; /* any key */
    else
        command(v, t, key);
    return false;
}

/* -- single lines that the screen and the plain table share
 * ------------------------------
 */

#define BAR_COLUMNS 10

/* Who is alive and what was lost. */
static void write_summary(const struct table *t, char *out, size_t size)
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

/* How far the scan is: "[####      ]  45% ...". */
static void write_scan(const struct table_scan *s, char *out, size_t size)
{
    static const char *const words[] = {"waiting", "scene", "done", "failed", "paused"};
    bool runs = s->state == ANLOS__SCAN_STATUS__STATE__RUNNING;
    const char *last = s->over ? "last heard: " : "";
    const char *phase = runs && s->pass == ANLOS__PASS__BACKGROUND ? "background"
                        : (unsigned)s->state < 5                   ? words[s->state]
                                                                   : "?";
    char left[32], ending[48] = "", text[TABLE_TEXT_SIZE];

    text_clean(text, sizeof text, s->text);
    text_duration(left, sizeof left, s->left_s);
    if (runs && s->done)
        snprintf(ending, sizeof ending, ", %s left", left);
    double share = s->expected ? fmin((double)s->done / (double)s->expected, 1) : 0;
    if (!s->known)
        snprintf(out, size, "no scan yet");
    else if (!s->expected && runs)
        snprintf(out, size,
                 "%s%" PRIu32 " pings, %s, %" PRIu32 " lost, scan %" PRIu32 ": %s", last,
                 s->done, phase, s->given_up, s->scan, text);
    else
        snprintf(out, size,
                 "%s[%-*.*s] %3.0f%% %" PRIu32 "/%" PRIu32 " pings, position %" PRIu32
                 "%s, %s, %" PRIu32 " retaken, %" PRIu32 " given up, scan %" PRIu32
                 "%s%s",
                 last, BAR_COLUMNS, (int)(share * BAR_COLUMNS), "##########", 100 * share,
                 s->done, s->expected, s->position, ending, phase, s->retaken,
                 s->given_up, s->scan, *text ? ": " : "", text);
}

/* narrow: with a letter for the level, and nothing to fill columns. */
static void write_log(const struct table_log *l, bool narrow, char *out, size_t size)
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
    if (narrow)
        snprintf(out, size, "%s %c %s: %s%s%s", clock, toupper((unsigned char)*l->level),
                 node, text, times, left_out);
    else
        snprintf(out, size, "%s %-7s %-8s %s%s%s", clock, l->level, node, text, times,
                 left_out);
}

/* -- the screen -------------------------------------------------------------------------
 */

#define FRAME_LINES 3 /* two above the panels, the keys below */
#define FAIR_LOGS   5
#define NARROW      60 /* columns: then lines of the log are not cut but go on below */
#define INDENT      3

/* The keys first: a low terminal shows no more. */
static const char *const help_lines[] = {
    "",
    " q            quit                     tab          next panel, back with shift",
    " arrows       select a row, scroll     pages, home, end   further at once",
    " s            sort by the next thing   p, blank     hold what is shown",
    " /            only names with ...      escape       all names again",
    "",
    " state        ready: works; starting, degraded: says what is missing; fault;",
    "              silent: lives, but says nothing; dead: its process is gone;",
    "              off: ran here once.  Of topics: low: under a quarter of what is",
    "              expected; losing: messages got lost in the last 3 s; dead: all",
    "              who publish it are",
    " HZ/EXPECTED  messages a second; of a node, the pings that it is done with, or",
    "              its main output; -: none is expected, as of an array that stands",
    " LATENCY ms   age of the sound when the message went out (of a node without",
    "              output, came in): median/99th percentile of the last 5 s",
    " QUEUE        messages that wait now; of a topic, in the fullest queue",
    " DROPS, GAPS  pushed out of a full queue; never came.  LOST of a topic is both",
    " OBJECT       hidden ones, of the newest list; predicted: not seen just now; VX, VY",
    "              over ground, along the vehicle's axes",
    " REFUSED      messages that were not what they should be",
    " CPU%         100 is one core.  All rates are those of the last 3 s",
};

/* Adds a line, cut to the width.  NULL: there is no room. */
__attribute__((format(printf, 2, 3))) static struct page_line *
add(struct page *p, const char *format, ...)
{
    va_list args;

    if (p->n_lines == p->height)
        return NULL;
    struct page_line *line = &p->lines[p->n_lines++];
    va_start(args, format);
    vsnprintf(line->text, sizeof line->text, format, args);
    va_end(args);
    text_cut(line->text, (size_t)p->width);
    line->kind = PAGE_TEXT;
    line->selected = false;
    line->tone = PAGE_PLAIN;
    line->tone_at = line->tone_n = 0;
    return line;
}

static void add_title(struct page *p, const struct look *v, enum look_panel panel,
                      const char *text)
{
    struct page_line *line = add(p, "%s", text);

    if (line)
        line->kind = v->focus == panel ? PAGE_FOCUSED_TITLE : PAGE_TITLE;
}

/* Takes the first line that is seen of n back to where the last line is the last. */
static size_t scrolled(size_t *line, size_t n, size_t room)
{
    size_t last = n > room ? n - room : 0;

    return *line = *line < last ? *line : last;
}

/* Nodes, topics or objects: the one selected is always seen. */
static void draw_rows(struct page *p, const struct table *t, struct look *v,
                      enum look_panel panel, size_t room)
{
    const struct column *c = lists[panel].columns;
    size_t order[LOOK_MAX_ROWS], at, n = look_rows(v, t, panel, order, &at);
    bool objects = panel == LOOK_OBJECTS;
    bool marks = !objects && v->detail_of_topic == (panel == LOOK_TOPICS);
    char text[PAGE_LINE_SIZE];

    if (!room--)
        return;
    write_row(c, p->width, NULL, text);
    add_title(p, v, panel,
              objects && t->objects.over
                  ? " OBJECTS (those of the last list; nobody tracks now)"
              : objects && !n ? " OBJECTS (none now)"
                              : text);
    size_t first = objects              ? scrolled(&v->object_line, n, room)
                   : room && at >= room ? at - room + 1
                                        : 0;
    for (size_t i = first; i < n && i - first < room; i++) {
        bool selected = marks && i == at;
        write_row(c, p->width, row_at(t, panel, order[i]), text);
        if (selected)
            text[0] = '>';
        struct page_line *line = add(p, "%s", text);
        if (!line)
            return;
        line->selected = selected;
        line->tone = row_tone(t, panel, order[i]);
        line->tone_at = 1 + c[0].width + 1; /* the second column */
        line->tone_n = c[1].width;
    }
}

static void add_link(struct page *d, const char *called, const struct table_link *link)
{
    const struct link_row row = {.name = called,
                                 .link = link ? *link : (struct table_link){0}};
    char text[PAGE_LINE_SIZE];

    write_row(link_columns, d->width, link ? &row : NULL, text);
    add(d, "%s", text);
}

/* What a node's device counts, in as many lines as the width asks for. */
static void add_device(struct page *d, const struct table_node *node)
{
    char line[PAGE_LINE_SIZE] = "", called[sizeof node->device[0].name], item[96];

    for (size_t i = 0; i < node->n_device; i++) {
        text_clean(called, sizeof called, node->device[i].name);
        snprintf(item, sizeof item, " %s%s %" PRIu64, i ? "" : "device: ", called,
                 node->device[i].value);
        if (*line && text_columns(line) + text_columns(item) + 1 > (size_t)d->width) {
            add(d, "%s", line);
            *line = '\0';
        }
        size_t used = strlen(line);
        snprintf(line + used, sizeof line - used, "%s%s", used ? "," : "", item);
    }
    if (*line)
        add(d, "%s", line);
}

/* What it says, its device's counts, and each of its topics. */
static void detail_node(struct page *d, const struct table_node *node)
{
    char up[32], silent[32], text[TABLE_TEXT_SIZE];

    text_duration(up, sizeof up, node->uptime_s);
    text_duration(silent, sizeof silent, node->silent_s);
    text_clean(text, sizeof text, node->text);
    if (node->state == TABLE_SILENT && !node->pid)
        add(d, " its process lives, but its health does not come");
    else if (node->state == TABLE_SILENT || node->state == TABLE_DEAD)
        add(d, " last heard %s ago: %s", silent, *text ? text : "-");
    else if (node->state == TABLE_OFF)
        add(d, " it ran here once, and does not run now");
    else
        add(d, " %s", *text ? text : "-");
    add_device(d, node);
    if (!node->pid)
        return;
    add(d, " process %u, up %s, started again %u times%s", (unsigned)node->pid, up,
        node->restarts, node->twin ? "; another process of this name speaks too" : "");
    add_link(d, NULL, NULL);
    for (size_t i = 0; i < node->n_links; i++)
        add_link(d, node->links[i].topic->name, &node->links[i]);
}

/* How it is kept, and each node that publishes or receives it. */
static void detail_topic(struct page *d, const struct table *t, const struct topic *topic)
{
    char most[32];

    text_bytes(most, sizeof most, (double)topic->max_size);
    add(d, " %s; a queue keeps %s %zu; at most %s bytes each", topic->schema->name,
        topic->policy == TOPIC_ALL ? "all up to" : "the latest", topic->depth, most);
    add_link(d, NULL, NULL);
    for (int published = 1; published >= 0; published--)
        for (size_t i = 0; i < t->n_nodes; i++)
            for (size_t k = 0; k < t->nodes[i].n_links; k++) {
                const struct table_link *link = &t->nodes[i].links[k];
                if (link->topic == topic && link->published == (bool)published)
                    add_link(d, t->nodes[i].name, link);
            }
}

/* All that is known of the node or topic selected.  Returns its name. */
static const char *make_detail(struct page *d, const struct table *t,
                               const struct look *v, int width)
{
    enum look_panel panel = v->detail_of_topic ? LOOK_TOPICS : LOOK_NODES;
    size_t order[LOOK_MAX_ROWS], at, n = look_rows(v, t, panel, order, &at);

    d->width = width;
    d->height = PAGE_MAX_LINES;
    d->n_lines = 0;
    if (!n)
        return "nothing selected";
    if (v->detail_of_topic) {
        detail_topic(d, t, t->topics[order[at]].topic);
        return t->topics[order[at]].topic->name;
    }
    detail_node(d, &t->nodes[order[at]]);
    return t->nodes[order[at]].name;
}

static void draw_detail(struct page *p, const struct page *d, const char *called,
                        struct look *v, size_t room)
{
    char text[64];

    if (!room--)
        return;
    snprintf(text, sizeof text, " %s", called);
    add_title(p, v, LOOK_DETAIL, text);
    size_t first = scrolled(&v->detail_line, (size_t)d->n_lines, room);
    for (size_t i = first; i < (size_t)d->n_lines && i - first < room; i++)
        add(p, "%s", d->lines[i].text);
}

/* A line of the log, in as many lines as it takes, of which no more than `most` are
 * drawn.  How many it takes. */
static size_t fold_log(struct page *p, const struct table_log *l, size_t most)
{
    static const struct {
        const char *level;
        enum page_tone tone;
    } tones[] = {{"error", PAGE_BAD}, {"warning", PAGE_NOTE}, {"debug", PAGE_FAINT}};
    bool narrow = p->width < NARROW;
    char text[PAGE_LINE_SIZE];
    size_t n = 0, at = 0;

    write_log(l, narrow, text, sizeof text);
    do {
        int indent = n ? INDENT : 1;
        bool folds = narrow && p->width > 2 * INDENT;
        size_t length = folds ? text_line(text + at, (size_t)(p->width - indent))
                              : strlen(text);
        struct page_line *line =
            n < most ? add(p, "%*s%.*s", indent, "", (int)length, text + at) : NULL;
        if (line)
            trim(line->text);
        for (size_t k = 0; line && k < sizeof tones / sizeof *tones; k++)
            if (!strcmp(l->level, tones[k].level))
                line->tone = tones[k].tone;
        if (line)
            line->tone_n = p->width;
        at += length;
        n++;
    } while (text[at]);
    return n;
}

/* How many of the n, from the first or the last on, there is whole room for. */
static size_t fit_logs(struct page *p, const struct table *t, size_t n, bool from_last,
                       size_t room)
{
    size_t fit = 0, used = 0;

    while (fit < n) {
        size_t i = from_last ? n - 1 - fit : fit;
        used += fold_log(p, &t->logs[i], 0);
        if (used > room)
            break;
        fit++;
    }
    return fit;
}

static void draw_log(struct page *p, const struct table *t, struct look *v, size_t room)
{
    if (!room--)
        return;
    add_title(p, v, LOOK_LOG, t->n_logs ? " LOG" : " LOG (nothing was said yet)");
    if (!room || !t->n_logs)
        return;
    size_t first = fit_logs(p, t, t->n_logs, false, room);
    size_t end = t->n_logs - scrolled(&v->log_line, t->n_logs, first ? first : 1);
    size_t n = fit_logs(p, t, end, true, room);
    for (size_t i = end - (n ? n : 1); i < end && room; i++) {
        size_t lines = fold_log(p, &t->logs[i], room);
        room -= lines < room ? lines : room;
    }
}

struct share { /* of the height, a panel's lines with its title */
    size_t least, fair, most;
    size_t got;
};

/* Of a panel with so many rows, some of which are fair.  None of it: {0}. */
static struct share share_want(size_t least_rows, size_t fair_rows, size_t rows)
{
    return (struct share){.least = 1 + (rows < least_rows ? rows : least_rows),
                          .fair = 1 + fair_rows,
                          .most = 1 + rows};
}

/* One that is not there stays away. */
static void grow(struct share *s, size_t to, size_t *left)
{
    size_t more = s->got && to > s->got ? to - s->got : 0;

    if (more > *left)
        more = *left;
    s->got += more;
    *left -= more;
}

/* Sets what each got of `left` lines, 1 or more.  The one in focus is always there, the
 * others as long as there is room for their least; then it gets all it can use, and the
 * others first what is fair. */
static void share_height(struct share s[LOOK_PANELS], enum look_panel focus, size_t left)
{
    /* The panels that stay when there is little room, the last to go first. */
    static const enum look_panel by_weight[LOOK_PANELS] = {
        LOOK_NODES, LOOK_OBJECTS, LOOK_TOPICS, LOOK_DETAIL, LOOK_LOG};

    s[focus].got = 1;
    left--;
    grow(&s[focus], s[focus].least, &left);
    for (size_t i = 0; i < LOOK_PANELS; i++) {
        struct share *other = &s[by_weight[i]];
        if (other->got || !other->least || other->least > left)
            continue;
        other->got = other->least;
        left -= other->least;
    }
    grow(&s[focus], s[focus].most, &left);
    for (size_t i = 0; i < LOOK_PANELS; i++)
        grow(&s[by_weight[i]], s[by_weight[i]].fair, &left);
    for (size_t i = 0; i < LOOK_PANELS; i++)
        grow(&s[by_weight[i]], s[by_weight[i]].most, &left);
}

static void draw_panels(struct page *p, const struct table *t, struct look *v)
{
    size_t order[LOOK_MAX_ROWS], at, n_present = 0;
    size_t n_nodes = look_rows(v, t, LOOK_NODES, order, &at);
    size_t n_topics = look_rows(v, t, LOOK_TOPICS, order, &at);
    struct page detail;
    const char *called = make_detail(&detail, t, v, p->width);

    for (size_t i = 0; i < n_topics; i++) /* the absent ones come behind them */
        n_present += !is_absent(t, LOOK_TOPICS, order[i]);
    size_t n_detail = (size_t)detail.n_lines, n_objects = t->objects.n;
    struct share s[LOOK_PANELS] = {[LOOK_NODES] = share_want(3, n_nodes, n_nodes),
                                   [LOOK_TOPICS] = share_want(3, n_present, n_topics),
                                   [LOOK_DETAIL] = share_want(2, n_detail, n_detail),
                                   [LOOK_LOG] = share_want(2, FAIR_LOGS, TABLE_MAX_LOGS)};
    if (t->objects.known)
        s[LOOK_OBJECTS] = share_want(3, n_objects, n_objects);
    share_height(s, v->focus, (size_t)(p->height - FRAME_LINES));
    draw_rows(p, t, v, LOOK_NODES, s[LOOK_NODES].got);
    draw_rows(p, t, v, LOOK_TOPICS, s[LOOK_TOPICS].got);
    draw_rows(p, t, v, LOOK_OBJECTS, s[LOOK_OBJECTS].got);
    draw_detail(p, &detail, called, v, s[LOOK_DETAIL].got);
    draw_log(p, t, v, s[LOOK_LOG].got);
}

static void draw_head(struct page *p, const struct table *t, const struct look *v)
{
    char text[PAGE_LINE_SIZE], cpu[16];

    write_summary(t, text, sizeof text);
    text_percent(cpu, sizeof cpu, t->own_cpu);
    struct page_line *line =
        add(p, "%s%s%s%s%s%s  (top itself: %s%% CPU)", v->paused ? "PAUSED  " : "", text,
            v->sort ? "  sorted by " : "", v->sort ? sort_names[v->sort] : "",
            *v->filter ? "  names with " : "", v->filter, cpu);
    if (line && v->paused) {
        line->tone = PAGE_NOTE;
        line->tone_n = 6;
    }
    write_scan(&t->scan, text, sizeof text);
    add(p, "%s", text);
}

static void draw_keys(struct page *p, const struct look *v)
{
    while (p->n_lines < p->height - 1)
        add(p, "%s", "");
    struct page_line *line =
        v->typing
            ? add(p, "/%s_   part of a name; enter keeps it, escape clears it", v->filter)
            : add(p, "q quit  tab panel  arrows select  s sort  p pause  / filter  "
                     "h help");
    if (line)
        line->kind = PAGE_TITLE;
}

void screen_draw(struct page *p, int width, int height, const struct table *t,
                 struct look *v)
{
    p->width = width < 1 ? 1 : width > PAGE_MAX_COLUMNS ? PAGE_MAX_COLUMNS : width;
    p->height = height < 1 ? 1 : height > PAGE_MAX_LINES ? PAGE_MAX_LINES : height;
    p->n_lines = 0;
    draw_head(p, t, v);
    for (size_t i = 0; v->help && i < sizeof help_lines / sizeof *help_lines; i++)
        if (p->n_lines < p->height - 1)
            add(p, "%s", help_lines[i]);
    if (!v->help && p->height > FRAME_LINES)
        draw_panels(p, t, v);
    draw_keys(p, v);
}

/* -- the plain table --------------------------------------------------------------------
 */

/* Without the blank in front, which is the screen's room for a mark. */
static void print_row(FILE *to, const struct column *columns, const void *row)
{
    char text[PAGE_LINE_SIZE];

    write_row(columns, INT_MAX, row, text);
    fprintf(to, "%s\n", text + 1);
}

static void print_rows(FILE *to, const struct table *t, enum look_panel panel)
{
    print_row(to, lists[panel].columns, NULL);
    for (size_t i = 0; i < count_rows(t, panel); i++)
        if (!is_absent(t, panel, i))
            print_row(to, lists[panel].columns, row_at(t, panel, i));
    fprintf(to, "\n");
}

static void print_devices(FILE *to, const struct table *t)
{
    char called[sizeof t->nodes[0].device[0].name];

    for (size_t i = 0; i < t->n_nodes; i++) {
        const struct table_node *n = &t->nodes[i];
        if (!n->n_device)
            continue;
        fprintf(to, "%s device:", n->name);
        for (size_t k = 0; k < n->n_device; k++) {
            text_clean(called, sizeof called, n->device[k].name);
            fprintf(to, "%s %s %" PRIu64, k ? "," : "", called, n->device[k].value);
        }
        fprintf(to, "\n");
    }
}

int screen_print(FILE *to, const struct table *t)
{
    char text[PAGE_LINE_SIZE];

    write_summary(t, text, sizeof text);
    fprintf(to, "%s\n", text);
    write_scan(&t->scan, text, sizeof text);
    fprintf(to, "%s\n\n", text);
    print_rows(to, t, LOOK_NODES);
    print_rows(to, t, LOOK_TOPICS);
    if (t->objects.n)
        print_rows(to, t, LOOK_OBJECTS);
    else if (t->objects.known)
        fprintf(to, "no hidden objects now\n\n");
    if (t->objects.n && t->objects.over)
        fprintf(to, "(of the last list; nobody tracks now)\n\n");
    print_devices(to, t);
    for (size_t i = 0; i < t->n_logs; i++) {
        write_log(&t->logs[i], false, text, sizeof text);
        fprintf(to, "%s\n", text);
    }
    errno = 0;
    return fflush(to) || ferror(to) ? (errno ? -errno : -EIO) : 0;
}
