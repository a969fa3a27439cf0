/* SPDX-License-Identifier: MIT */
/* nodes/view/view.c -- what a view knows of the system, and how it says so: what each
 * message is to the page, what of it is kept, and what is posted when. */
#include "nodes/view/view.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/clock.pb-c.h"
#include "msgs/convert.h"
#include "msgs/envelope.h"
#include "msgs/save.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "nodes/rt/export.h"
#include "nodes/rt/names.h"
#include "nodes/rt/setting.h"
#include "nodes/rt/trails.h"
#include "nodes/view/history.h"
#include "nodes/view/meter.h"
#include "nodes/view/picture.h"
#include "nodes/view/plan.h"

#define NS_PER_MS     1000000
#define MEASURE_NS    50000000LL /* between two pings whose samples are looked at */
#define TRAIL_STEP_NS 100000000LL
#define MAX_NODES     64
#define MAX_LINES     100 /* of the log */

struct view_node {
    char name[ENVELOPE_NODE_SIZE];
    char text[256];
    Anlos__Health__State state;
    uint32_t pid;
    double uptime_s, cpu_s, cpu_share; /* of one core, since the message before */
    uint64_t rss_bytes, lost, refused; /* lost: gaps and dropped of what it receives */
    int64_t heard_ns, epoch_ns;
};

struct view_line {
    int64_t stamp_ns;
    const char *level;
    char node[ENVELOPE_NODE_SIZE];
    char text[512];
    uint64_t repeats, left_out;
};

struct view {
    struct board *board;
    char *origin;
    bool is_bag, may_save;
    atomic_int pages;

    bool changed[BOARD_SUBJECTS];
    int64_t
        posted_ns; /* 0: never, as the next two, which view_beat takes in any thread */
    _Atomic int64_t beat_ns, heard_ns;

    struct setting setting;
    struct trails trails;
    struct history history;
    bool has_history;
    json_t *kept[BOARD_SUBJECTS]; /* made of the newest message; NULL: none */
    struct meter meter;
    int64_t measured_ns;
    struct view_node nodes[MAX_NODES];
    size_t n_nodes;
    struct view_line lines[MAX_LINES]; /* a ring */
    uint64_t n_lines;                  /* ever */

    pthread_mutex_t picture_lock; /* slices are asked for by other threads */
    struct picture picture;
    uint32_t picture_id; /* counts the pictures; 0: none */
    struct view_image {  /* which image it is of */
        uint64_t survey_id;
        uint32_t scan, pings_used;
        bool preview;
        int64_t capture_ns;
    } image;
};

int view_create(struct view **out, const char *origin, bool is_bag)
{
    struct view *v = calloc(1, sizeof *v);
    int err = v && (v->origin = strdup(origin)) ? board_create(&v->board) : -ENOMEM;

    if (err) {
        if (v)
            free(v->origin);
        free(v);
        return err;
    }
    v->is_bag = is_bag;
    trails_init(&v->trails, VIEW_TRAIL_NS, TRAIL_STEP_NS);
    history_roll(&v->history, VIEW_STEP_NS);
    meter_init(&v->meter);
    pthread_mutex_init(&v->picture_lock, NULL);
    board_post(v->board, BOARD_HELLO,
               frame_of_text(json_pack("{ss ss ss ss}", "type", "hello", "version",
                                       ANLOS_VERSION, "mode", is_bag ? "bag" : "live",
                                       "origin", origin)));
    *out = v;
    return 0;
}

static json_t *scan_json(const Anlos__ScanStatus *s)
{
    return json_pack("{ss ss ss si si si si si si so ss}", "type", "scan", "state",
                     name_of_scan_state(s->state), "pass", name_of_pass(s->pass), "scan",
                     (int)s->scan, "position", (int)s->position, "done",
                     (int)s->pings_done, "expected", (int)s->pings_expected, "retaken",
                     (int)s->pings_retaken, "lost", (int)s->pings_lost, "left_s",
                     export_real(s->time_left_s), "text", s->text);
}

static json_t *stage_json(const Anlos__StageState *s)
{
    return json_pack("{ss ss so so sb sb ss}", "type", "stage", "state",
                     name_of_stage_state(s->state), "position_m",
                     export_real(s->position_m), "target_m", export_real(s->target_m),
                     "homed", s->homed, "held", s->held, "text", s->text);
}

static json_t *record_json(const Anlos__SaveStatus *s, bool may_save, int64_t now_ns)
{
    static const char *const states[] = {"keeps", "saves", "nothing"};
    unsigned state = (unsigned)s->state;

    return json_pack("{ss ss sb sI ss ss so so sI}", "type", "record", "state",
                     states[state < 3 ? state : 2], "may_save", may_save, "at",
                     (json_int_t)(now_ns / NS_PER_MS), "path", s->path, "error", s->error,
                     "before_s", export_real(s->before_s), "kept_s",
                     export_real(s->kept_s), "saved", (json_int_t)s->saved);
}

static json_t *clock_json(const Anlos__Clock *c)
{
    return json_pack("{ss sf sf so sb sb ss}", "type", "clock", "at_s",
                     1e-9 * (double)(c->time_ns - c->start_ns), "span_s",
                     1e-9 * (double)(c->end_ns - c->start_ns), "rate",
                     export_real(c->rate), "paused", c->paused, "ended", c->ended, "bag",
                     c->bag);
}

/* Nodes in the order of the table of all nodes, that is, of the way the data goes. */
static size_t rank(const char *name)
{
    const char *const *names = topics_nodes();
    size_t i = 0;

    while (names[i] && strcmp(names[i], name))
        i++;
    return i;
}

static struct view_node *find_node(struct view *v, const char *name)
{
    for (size_t i = 0; i < v->n_nodes; i++)
        if (!strcmp(v->nodes[i].name, name))
            return &v->nodes[i];
    if (v->n_nodes == MAX_NODES)
        return NULL;
    size_t at = v->n_nodes++;
    while (at && rank(v->nodes[at - 1].name) > rank(name))
        at--;
    struct view_node *n = &v->nodes[at];
    memmove(n + 1, n, (v->n_nodes - 1 - at) * sizeof *n);
    memset(n, 0, sizeof *n);
    snprintf(n->name, sizeof n->name, "%s", name);
    return n;
}

static void take_health(struct view *v, const Anlos__Health *h, int64_t epoch_ns,
                        int64_t now_ns)
{
    struct view_node *n = find_node(v, h->node);

    if (!n || epoch_ns < n->epoch_ns) /* late, of the process before */
        return;
    double elapsed_s = h->uptime_s - n->uptime_s;
    n->cpu_share = epoch_ns != n->epoch_ns
                       ? (h->uptime_s > 0.0 ? h->cpu_s / h->uptime_s : 0.0)
                   : elapsed_s > 0.2 ? (h->cpu_s - n->cpu_s) / elapsed_s
                                     : n->cpu_share;
    if (epoch_ns != n->epoch_ns || elapsed_s > 0.2) {
        n->uptime_s = h->uptime_s;
        n->cpu_s = h->cpu_s;
    }
    n->epoch_ns = epoch_ns;
    n->heard_ns = now_ns;
    n->state = h->state;
    n->pid = h->pid;
    n->rss_bytes = h->rss_bytes;
    n->refused = h->refused;
    n->lost = 0;
    for (size_t i = 0; i < h->n_topics; i++)
        if (!h->topics[i]->published)
            n->lost += h->topics[i]->gaps + h->topics[i]->dropped;
    snprintf(n->text, sizeof n->text, "%s", h->text);
}

static json_t *nodes_json(const struct view *v, int64_t now_ns)
{
    json_t *list = json_array();

    for (size_t i = 0; i < v->n_nodes; i++) {
        const struct view_node *n = &v->nodes[i];
        int64_t age_ns = now_ns - n->heard_ns;
        bool silent = age_ns > VIEW_SILENT_NS;
        json_array_append_new(
            list,
            json_pack("{ss ss ss si so so sI sI sI sI}", "node", n->name, "state",
                      silent ? "silent" : name_of_health_state(n->state), "text", n->text,
                      "pid", (int)n->pid, "cpu", export_real(n->cpu_share), "up_s",
                      export_real(n->uptime_s), "rss_bytes", (json_int_t)n->rss_bytes,
                      "lost", (json_int_t)n->lost, "refused", (json_int_t)n->refused,
                      "age_ms", (json_int_t)(age_ns / NS_PER_MS)));
    }
    return json_pack("{ss so}", "type", "nodes", "nodes", list);
}

/* A line may come over the bus and stand in the file for late comers. */
static bool is_known(const struct view *v, const Anlos__Log *l)
{
    uint64_t first = v->n_lines > MAX_LINES ? v->n_lines - MAX_LINES : 0;

    for (uint64_t i = first; i < v->n_lines; i++) {
        const struct view_line *line = &v->lines[i % MAX_LINES];
        if (line->stamp_ns == l->stamp_ns && !strcmp(line->node, l->node) &&
            !strncmp(line->text, l->text, sizeof line->text - 1))
            return true;
    }
    return false;
}

static void take_line(struct view *v, const Anlos__Log *l)
{
    if (is_known(v, l))
        return;
    struct view_line *line = &v->lines[v->n_lines++ % MAX_LINES];

    line->stamp_ns = l->stamp_ns;
    line->level = name_of_log_level(l->level);
    line->repeats = l->repeats;
    line->left_out = l->left_out;
    snprintf(line->node, sizeof line->node, "%s", l->node);
    snprintf(line->text, sizeof line->text, "%s", l->text);
}

static json_t *log_json(const struct view *v)
{
    json_t *list = json_array();
    uint64_t first = v->n_lines > MAX_LINES ? v->n_lines - MAX_LINES : 0;

    for (uint64_t i = first; i < v->n_lines; i++) {
        const struct view_line *l = &v->lines[i % MAX_LINES];
        json_array_append_new(
            list, json_pack("{sI sI ss ss ss sI sI}", "id", (json_int_t)i, "ms",
                            (json_int_t)(l->stamp_ns / NS_PER_MS), "level", l->level,
                            "node", l->node, "text", l->text, "repeats",
                            (json_int_t)l->repeats, "left_out", (json_int_t)l->left_out));
    }
    return json_pack("{ss so}", "type", "log", "lines", list);
}

/* Below full scale; null where there is none. */
static json_t *decibels(const struct picture *p, double intensity)
{
    double db = intensity > 0.0 && p->peak > 0.0 ? 10.0 * log10(intensity / p->peak)
                                                 : NAN;

    return export_real(round(10.0 * db) / 10.0);
}

static json_t *describe(struct view *v, const Anlos__Volume *m, int64_t publish_ns)
{
    const struct grid *g = &v->picture.grid;
    json_t *footprint =
        v->setting.has_survey && v->setting.survey_id == m->survey_id
            ? plan_footprint_json(&v->setting.survey, setting_wall(&v->setting), g)
            : json_null();

    return json_pack(
        "{ss si si sb ss s[iii] so so si si so ss sI si sf so so so sI}", "type",
        "volume", "id", (int)v->picture_id, "scan", (int)m->scan, "preview", m->preview,
        "method", m->method, "n", (int)g->n[0], (int)g->n[1], (int)g->n[2], "origin_m",
        export_reals(g->origin_m, 3), "step_m", export_reals(g->step_m, 3), "pings_used",
        (int)m->pings_used, "pings_expected", (int)m->pings_expected, "imaging_s",
        export_real(m->imaging_s), "source", name_of_source(m->source), "clipped",
        (json_int_t)m->clipped_samples, "masked", (int)m->microphones_masked, "step_db",
        PICTURE_STEP_DB, "brightest_db", decibels(&v->picture, v->picture.brightest),
        "noise_db", decibels(&v->picture, v->picture.noise), "footprint", footprint, "ms",
        (json_int_t)(publish_ns / 1000000));
}

static void post_volume(struct view *v, const Anlos__Volume *volume, int64_t publish_ns)
{
    const struct picture *p = &v->picture;
    size_t sizes[PICTURE_SIDES], all = 0, n[2];
    uint8_t *image;

    for (int i = 0; i < PICTURE_SIDES; i++)
        all += sizes[i] = picture_side_size(p, (enum picture_side)i, n);
    struct frame *f = frame_of_images(describe(v, volume, publish_ns), all, &image);
    for (int i = 0; f && i < PICTURE_SIDES; i++) {
        memcpy(image, p->projection[i], sizes[i]);
        image += sizes[i];
    }
    board_post(v->board, BOARD_VOLUME, f);
}

static bool is_same(const struct view_image *a, const struct view_image *b)
{
    return a->survey_id == b->survey_id && a->scan == b->scan &&
           a->pings_used == b->pings_used && a->preview == b->preview &&
           a->capture_ns == b->capture_ns;
}

/* Makes the picture of a volume and posts it, unless it is the one that is shown. */
static void take_volume(struct view *v, const Anlos__Volume *volume, int64_t capture_ns,
                        int64_t publish_ns)
{
    const struct view_image image = {volume->survey_id, volume->scan, volume->pings_used,
                                     volume->preview, capture_ns};
    struct picture fresh, before;
    struct grid grid;
    const float *intensity = volume_grid(volume, &grid);
    bool shown = v->kept[BOARD_VOLUME] != NULL;

    if (!intensity)
        return;
    if (!v->picture_id || !is_same(&image, &v->image)) {
        if (picture_create(&fresh, &grid, intensity))
            return;
        pthread_mutex_lock(&v->picture_lock);
        before = v->picture;
        v->picture = fresh;
        v->picture_id++;
        pthread_mutex_unlock(&v->picture_lock);
        picture_clear(&before);
        v->image = image;
    } else if (shown) {
        return; /* repeated for those who missed it */
    }
    if (!shown)
        v->kept[BOARD_VOLUME] = json_null();
    post_volume(v, volume, publish_ns);
}

const struct topic *view_topic(size_t i)
{
    const struct topic *const all[] = {
        topic_survey(),      topic_ping(),        topic_volume(), topic_detections(),
        topic_scan_status(), topic_stage_state(), topic_clock(),  topic_health(),
        topic_log(),         topic_wall(),        topic_ego()};

    return i < sizeof all / sizeof *all ? all[i] : NULL;
}

void view_may_save(struct view *v, bool may)
{
    v->may_save = may;
}

static void keep(struct view *v, enum board_subject subject, json_t *json)
{
    if (!json)
        return;
    json_decref(v->kept[subject]);
    v->kept[subject] = json;
    v->changed[subject] = true;
}

static void take_survey(struct view *v, const Anlos__Survey *m)
{
    if (!setting_survey(&v->setting, m))
        return;
    json_decref(v->kept[BOARD_WALLS]);
    v->kept[BOARD_WALLS] = NULL;
    v->changed[BOARD_WALLS] = true;
    keep(v, BOARD_SCENE, plan_scene_json(&v->setting.survey));
}

static void take_walls(struct view *v, const Anlos__WallList *m)
{
    if (v->setting.has_survey && setting_walls(&v->setting, m))
        keep(v, BOARD_WALLS, plan_walls_json(&v->setting.survey, m, &v->setting.walls));
}

static void take_objects(struct view *v, const struct view_message *in, int64_t now_ns)
{
    const Anlos__DetectionList *m = (const Anlos__DetectionList *)in->content;

    trails_take(&v->trails, m, in->capture_ns);
    keep(v, BOARD_OBJECTS, plan_objects_json(m, &v->trails));
    if (v->is_bag)
        return;
    history_take(&v->history, m, in->capture_ns, in->publish_ns, now_ns);
    v->has_history = true;
}

/* What is wrong with a ping is counted always; its level is measured now and then, and
 * for each speaker at least once. */
static void take_ping(struct view *v, const Anlos__Ping *m, int64_t now_ns)
{
    bool due = now_ns - v->measured_ns >= MEASURE_NS || now_ns < v->measured_ns ||
               m->speaker >= v->meter.n_speakers ||
               v->meter.speakers[m->speaker].state == METER_UNHEARD;

    if (meter_ping(&v->meter, m, due))
        return;
    if (due)
        v->measured_ns = now_ns;
    v->changed[BOARD_LEVELS] = true;
}

void view_take(struct view *v, const struct view_message *m, int64_t now_ns)
{
    if (strcmp(m->from, "view")) /* this process is no sign of the system's life */
        v->heard_ns = now_ns;
    if (m->topic == topic_survey()) {
        take_survey(v, (const Anlos__Survey *)m->content);
    } else if (m->topic == topic_ping()) {
        take_ping(v, (const Anlos__Ping *)m->content, now_ns);
    } else if (m->topic == topic_volume()) {
        take_volume(v, (const Anlos__Volume *)m->content, m->capture_ns, m->publish_ns);
    } else if (m->topic == topic_detections()) {
        take_objects(v, m, now_ns);
    } else if (m->topic == topic_wall()) {
        take_walls(v, (const Anlos__WallList *)m->content);
    } else if (m->topic == topic_ego()) {
        trails_ego(&v->trails, (const Anlos__EgoMotion *)m->content, m->capture_ns);
    } else if (m->topic == topic_scan_status()) {
        keep(v, BOARD_SCAN, scan_json((const Anlos__ScanStatus *)m->content));
    } else if (m->topic == topic_stage_state()) {
        keep(v, BOARD_STAGE, stage_json((const Anlos__StageState *)m->content));
    } else if (m->topic == topic_clock()) {
        keep(v, BOARD_CLOCK, clock_json((const Anlos__Clock *)m->content));
    } else if (m->topic == topic_save_status() && !v->is_bag) {
        keep(v, BOARD_RECORD,
             record_json((const Anlos__SaveStatus *)m->content, v->may_save, now_ns));
    } else if (m->topic == topic_health()) {
        take_health(v, (const Anlos__Health *)m->content, m->epoch_ns,
                    v->is_bag ? m->publish_ns : now_ns);
        v->changed[BOARD_NODES] = true;
    } else if (m->topic == topic_log()) {
        take_line(v, (const Anlos__Log *)m->content);
        v->changed[BOARD_LOG] = true;
    }
}

static const char *const types[BOARD_SUBJECTS] = {
    [BOARD_HELLO] = "hello",     [BOARD_TIMELINE] = "timeline",
    [BOARD_SCENE] = "scene",     [BOARD_SCAN] = "scan",
    [BOARD_STAGE] = "stage",     [BOARD_CLOCK] = "clock",
    [BOARD_NODES] = "nodes",     [BOARD_WALLS] = "walls",
    [BOARD_OBJECTS] = "objects", [BOARD_HISTORY] = "history",
    [BOARD_RECORD] = "record",   [BOARD_LEVELS] = "levels",
    [BOARD_LOG] = "log",         [BOARD_VOLUME] = "volume",
    [BOARD_TIME] = "time"};

/* A new reference; of what is not known, that it is not. */
static json_t *say(const struct view *v, enum board_subject subject, int64_t now_ns)
{
    if (subject == BOARD_LEVELS && v->meter.pings)
        return meter_json(&v->meter);
    if (subject == BOARD_NODES && v->n_nodes)
        return nodes_json(v, now_ns);
    if (subject == BOARD_LOG)
        return log_json(v);
    json_t *history = subject == BOARD_HISTORY ? history_json(&v->history, now_ns) : NULL;
    if (history)
        return history;
    if (v->kept[subject])
        return json_incref(v->kept[subject]);
    return json_pack("{ss sb}", "type", types[subject], "none", 1);
}

static void post_changes(struct view *v, int64_t now_ns)
{
    for (int i = BOARD_SCENE; i <= BOARD_LOG; i++) {
        enum board_subject subject = (enum board_subject)i;
        if (v->changed[i])
            board_post(v->board, subject, frame_of_text(say(v, subject, now_ns)));
        v->changed[i] = false;
    }
    v->posted_ns = now_ns;
}

void view_beat(struct view *v, int64_t now_ns)
{
    int64_t heard_ns = v->heard_ns;
    json_t *heard = heard_ns ? json_integer(heard_ns / NS_PER_MS) : json_null();

    board_post(v->board, BOARD_TIME,
               frame_of_text(json_pack("{ss sI so si sI}", "type", "time", "now",
                                       (json_int_t)(now_ns / NS_PER_MS), "heard", heard,
                                       "pages", atomic_load(&v->pages), "skipped",
                                       (json_int_t)board_skipped(v->board))));
    v->beat_ns = now_ns;
}

int view_tick(struct view *v, int64_t now_ns)
{
    bool changed = false;

    if (now_ns - v->beat_ns >= VIEW_BEAT_NS || now_ns < v->beat_ns) {
        v->changed[BOARD_NODES] |= v->n_nodes > 0;   /* some may have fallen silent */
        v->changed[BOARD_HISTORY] |= v->has_history; /* it rolls on */
        view_beat(v, now_ns);
    }
    if (now_ns - v->posted_ns >= VIEW_PERIOD_NS || now_ns < v->posted_ns)
        post_changes(v, now_ns);
    for (int i = 0; i < BOARD_SUBJECTS; i++)
        changed |= v->changed[i];
    int64_t due = v->beat_ns + VIEW_BEAT_NS;
    if (changed && v->posted_ns + VIEW_PERIOD_NS < due)
        due = v->posted_ns + VIEW_PERIOD_NS;
    return (int)((due - now_ns) / NS_PER_MS + 1);
}

void view_reset(struct view *v)
{
    for (int i = 0; i < BOARD_SUBJECTS; i++) {
        json_decref(v->kept[i]);
        v->kept[i] = NULL;
    }
    setting_clear(&v->setting);
    trails_init(&v->trails, VIEW_TRAIL_NS, TRAIL_STEP_NS);
    meter_clear(&v->meter);
    v->measured_ns = 0;
    v->n_nodes = 0;
    v->n_lines = 0;
    v->heard_ns = 0;
}

void view_flush(struct view *v, int64_t now_ns)
{
    for (int i = BOARD_SCENE; i <= BOARD_LOG; i++)
        v->changed[i] = true;
    post_changes(v, now_ns);
    if (!v->kept[BOARD_VOLUME])
        board_post(v->board, BOARD_VOLUME, frame_of_text(say(v, BOARD_VOLUME, now_ns)));
    view_beat(v, now_ns);
}

void view_history_span(struct view *v, int64_t start_ns, int64_t end_ns)
{
    history_span(&v->history, start_ns, end_ns);
}

void view_history_take(struct view *v, const struct view_message *m)
{
    history_take(&v->history, (const Anlos__DetectionList *)m->content, m->capture_ns,
                 m->publish_ns, m->publish_ns);
}

void view_history_post(struct view *v)
{
    board_post(v->board, BOARD_HISTORY, frame_of_text(say(v, BOARD_HISTORY, 0)));
}

struct frame *view_slice(struct view *v, size_t k)
{
    struct frame *f = NULL;
    uint8_t *image;

    pthread_mutex_lock(&v->picture_lock);
    const size_t *n = v->picture.grid.n;
    if (v->picture_id && k < n[2]) {
        f = frame_of_images(json_pack("{ss si sI}", "type", "slice", "id",
                                      (int)v->picture_id, "index", (json_int_t)k),
                            n[0] * n[1], &image);
        if (f)
            memcpy(image, picture_slice(&v->picture, k), n[0] * n[1]);
    }
    pthread_mutex_unlock(&v->picture_lock);
    return f;
}

struct board *view_board(struct view *v)
{
    return v->board;
}

void view_pages(struct view *v, int change)
{
    atomic_fetch_add(&v->pages, change);
}

void view_destroy(struct view *v)
{
    if (!v)
        return;
    view_reset(v);
    picture_clear(&v->picture);
    board_destroy(v->board);
    pthread_mutex_destroy(&v->picture_lock);
    free(v->origin);
    free(v);
}
