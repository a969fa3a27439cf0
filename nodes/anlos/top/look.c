#include "nodes/anlos/top/look.h"

#include <stdio.h>
#include <string.h>

#define PAGE_STEP 8

/* The steps that a key asks for among n rows. */
static size_t moved(size_t at, size_t n, int key)
{
    size_t last = n ? n - 1 : 0, step = 1;

    switch (key) {
    case LOOK_KEY_HOME:
        return 0;
    case LOOK_KEY_END:
        return last;
    case LOOK_KEY_PAGE_UP:
        step = PAGE_STEP;
        /* fall through */
    case LOOK_KEY_UP:
        return at > step ? at - step : 0;
    case LOOK_KEY_PAGE_DOWN:
        step = PAGE_STEP;
        /* fall through */
    default:
        return at + step < last ? at + step : last;
    }
}

static void move_node(struct look *v, const struct table *t, int key)
{
    size_t order[TABLE_MAX_NODES], n = look_nodes(v, t, order);
    size_t at = moved(look_selected_node(v, t, order, n), n, key);

    if (n)
        snprintf(v->node, sizeof v->node, "%s", t->nodes[order[at]].name);
}

static void move_topic(struct look *v, const struct table *t, int key)
{
    size_t order[TABLE_MAX_TOPICS], n = look_topics(v, t, order);
    size_t at = moved(look_selected_topic(v, t, order, n), n, key);

    if (n)
        v->topic = t->topics[order[at]].topic;
}

/* The log is read upwards from its newest line. */
static void move_log(struct look *v, const struct table *t, int key)
{
    static const int turned[] = {LOOK_KEY_DOWN,    LOOK_KEY_UP,  LOOK_KEY_PAGE_DOWN,
                                 LOOK_KEY_PAGE_UP, LOOK_KEY_END, LOOK_KEY_HOME};
    v->log_line = moved(v->log_line, t->n_logs, turned[key - LOOK_KEY_UP]);
}

static void move(struct look *v, const struct table *t, int key)
{
    switch (v->focus) {
    case LOOK_NODES:
        move_node(v, t, key);
        v->detail_line = 0;
        break;
    case LOOK_TOPICS:
        move_topic(v, t, key);
        v->detail_line = 0;
        break;
    case LOOK_DETAIL: /* at most a line for each link, of all nodes, and a few */
        v->detail_line = moved(v->detail_line, TABLE_MAX_LINKS * TABLE_MAX_NODES, key);
        break;
    case LOOK_OBJECTS:
        v->object_line = moved(v->object_line, t->objects.n, key);
        break;
    default:
        move_log(v, t, key);
    }
}

/* The objects have a panel when there is a list of them. */
static void focus(struct look *v, const struct table *t, int steps)
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

    if (key == LOOK_KEY_ESCAPE)
        v->filter[0] = '\0';
    if (key == LOOK_KEY_ESCAPE || key == '\n' || key == '\r')
        v->typing = false;
    else if (key == LOOK_KEY_BACKSPACE && n)
        v->filter[n - 1] = '\0';
    else if (key >= ' ' && key < 0x7f && n + 1 < sizeof v->filter)
        snprintf(v->filter + n, sizeof v->filter - n, "%c", key);
}

static void command(struct look *v, const struct table *t, int key)
{
    switch (key) {
    case '\t':
        focus(v, t, 1);
        break;
    case LOOK_KEY_BACK_TAB:
        focus(v, t, LOOK_PANELS - 1);
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
    case LOOK_KEY_ESCAPE:
        v->filter[0] = '\0';
        break;
    case 'k':
        move(v, t, LOOK_KEY_UP);
        break;
    case 'j':
        move(v, t, LOOK_KEY_DOWN);
        break;
    default:
        if (key >= LOOK_KEY_UP && key <= LOOK_KEY_END)
            move(v, t, key);
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
