/* SPDX-License-Identifier: MIT */
#include "nodes/view/view.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/view/plan.h"
#include "nodes/view/view_state.h"

#define NS_PER_MS     1000000
#define MEASURE_NS    50000000LL /* between two pings whose samples are looked at */
#define TRAIL_STEP_NS 100000000LL

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
    struct survey fresh;
    struct error why;

    if (v->survey_id == m->id || survey_from_message(&fresh, m, &why))
        return;
    survey_clear(&v->survey);
    v->survey = fresh;
    v->survey_id = m->id;
    v->has_walls = false; /* those were of another array */
    json_decref(v->kept[BOARD_WALLS]);
    v->kept[BOARD_WALLS] = NULL;
    v->changed[BOARD_WALLS] = true;
    walls_from_survey(&v->walls, &v->survey);
    keep(v, BOARD_SCENE, plan_scene_json(&v->survey));
}

static void take_walls(struct view *v, const Anlos__WallList *m)
{
    struct error why;

    if (!v->survey_id || walls_from_message(&v->walls, m, &why))
        return; /* those who work with them complain */
    v->has_walls = true;
    keep(v, BOARD_WALLS, plan_walls_json(&v->survey, m, &v->walls));
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
        view_take_volume(v, (const Anlos__Volume *)m->content, m->capture_ns,
                         m->publish_ns);
    } else if (m->topic == topic_detections()) {
        take_objects(v, m, now_ns);
    } else if (m->topic == topic_wall()) {
        take_walls(v, (const Anlos__WallList *)m->content);
    } else if (m->topic == topic_ego()) {
        trails_ego(&v->trails, (const Anlos__EgoMotion *)m->content, m->capture_ns);
    } else if (m->topic == topic_scan_status()) {
        keep(v, BOARD_SCAN, view_scan_json((const Anlos__ScanStatus *)m->content));
    } else if (m->topic == topic_stage_state()) {
        keep(v, BOARD_STAGE, view_stage_json((const Anlos__StageState *)m->content));
    } else if (m->topic == topic_clock()) {
        keep(v, BOARD_CLOCK, view_clock_json((const Anlos__Clock *)m->content));
    } else if (m->topic == topic_save_status() && !v->is_bag) {
        keep(
            v, BOARD_RECORD,
            view_record_json((const Anlos__SaveStatus *)m->content, v->may_save, now_ns));
    } else if (m->topic == topic_health()) {
        view_take_health(v, (const Anlos__Health *)m->content, m->epoch_ns,
                         v->is_bag ? m->publish_ns : now_ns);
        v->changed[BOARD_NODES] = true;
    } else if (m->topic == topic_log()) {
        view_take_line(v, (const Anlos__Log *)m->content);
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
        return view_nodes_json(v, now_ns);
    if (subject == BOARD_LOG)
        return view_log_json(v);
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
    survey_clear(&v->survey);
    v->survey_id = 0;
    v->has_walls = false;
    v->walls.n = 0;
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
