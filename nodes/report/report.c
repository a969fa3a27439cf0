/* SPDX-License-Identifier: MIT */
#include "nodes/report/report.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "msgs/convert.h"
#include "msgs/topics.h"
#include "msgs/unpack.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_plan.h"
#include "nodes/rt/export_projection.h"
#include "nodes/rt/names.h"
#include "recon/processing.h"

int report_hosts_take(struct report_hosts *h, const Anlos__HostStatus *status)
{
    Anlos__HostStatus *fresh = (Anlos__HostStatus *)message_copy(&status->base);
    size_t i = 0;

    if (!fresh)
        return -ENOMEM;
    while (i < h->n && strcmp(h->list[i]->host, fresh->host) != 0)
        i++;
    if (i == HOSTS_MAX) { /* a stranger */
        anlos__host_status__free_unpacked(fresh, NULL);
        return 0;
    }
    if (i == h->n)
        h->n++;
    else
        anlos__host_status__free_unpacked(h->list[i], NULL);
    h->list[i] = fresh;
    return 0;
}

/* What one host has measured of another; NULL: nothing. */
static const Anlos__HostSight *find(const struct report_hosts *h, const char *by,
                                    const char *of)
{
    for (size_t i = 0; i < h->n; i++)
        for (size_t k = 0; k < h->list[i]->n_sights; k++) {
            const Anlos__HostSight *s = h->list[i]->sights[k];
            if (!strcmp(h->list[i]->host, by) && !strcmp(s->host, of) &&
                s->round_trip_s != 0.0)
                return s;
        }
    return NULL;
}

/* Seconds by which the clock of one host is ahead of that of another; 0 when nobody has
 * measured it. */
static double report_hosts_ahead_s(const struct report_hosts *h, const char *of,
                                   const char *than)
{
    const Anlos__HostSight *one = find(h, than, of), *other = find(h, of, than);

    return one ? one->clock_ahead_s : other ? -other->clock_ahead_s : 0.0;
}

/* An array, an object for each pair that was measured. */
static json_t *report_hosts_json(const struct report_hosts *h)
{
    json_t *list = json_array();

    for (size_t i = 0; i < h->n; i++)
        for (size_t k = 0; k < h->list[i]->n_sights; k++) {
            const Anlos__HostSight *s = h->list[i]->sights[k];
            json_t *o = json_object();
            json_object_set_new(o, "host", json_string(s->host));
            json_object_set_new(o, "seen_by", json_string(h->list[i]->host));
            json_object_set_new(o, "clock_ahead_s", export_real(s->clock_ahead_s));
            json_object_set_new(o, "round_trip_s", export_real(s->round_trip_s));
            json_object_set_new(o, "silences", json_integer((json_int_t)s->silences));
            json_array_append_new(list, o);
        }
    return list;
}

static void report_hosts_clear(struct report_hosts *h)
{
    for (size_t i = 0; i < h->n; i++)
        anlos__host_status__free_unpacked(h->list[i], NULL);
    *h = (struct report_hosts){0};
}

/* At the end: what still ran then, an array that stands, was stopped. */
static const char *scan_state_name(Anlos__ScanStatus__State state)
{
    switch (state) {
    case ANLOS__SCAN_STATUS__STATE__WAITING:
        return "waiting";
    case ANLOS__SCAN_STATUS__STATE__RUNNING:
        return "stopped";
    case ANLOS__SCAN_STATUS__STATE__DONE:
        return "done";
    case ANLOS__SCAN_STATUS__STATE__PAUSED:
        return "paused";
    default:
        return "failed";
    }
}

static json_t *integer(uint64_t value)
{
    return json_integer((json_int_t)value);
}

/* Modulo 2^64 ns: a stamp is whatever its sender wrote. */
static double elapsed_s(int64_t from_ns, int64_t to_ns)
{
    return 1e-9 * (double)(int64_t)((uint64_t)to_ns - (uint64_t)from_ns);
}

/* Seconds between two stamps, null when one is missing. */
static json_t *report_json_seconds(int64_t from_ns, int64_t to_ns)
{
    return from_ns && to_ns ? export_real(elapsed_s(from_ns, to_ns)) : json_null();
}

/* An array that stands may be stopped before its scan says anything. */
static const Anlos__ScanStatus *status_of(const struct report *r)
{
    static const Anlos__ScanStatus none = ANLOS__SCAN_STATUS__INIT;

    return r->status ? r->status : &none;
}

static json_t *pings(const struct report *r)
{
    const Anlos__ScanStatus *s = status_of(r);
    json_t *o = json_object();

    json_object_set_new(o, "expected", /* 0: there was no end */
                        s->pings_expected ? integer(s->pings_expected) : json_null());
    json_object_set_new(o, "done", integer(s->pings_done));
    json_object_set_new(o, "retaken", integer(s->pings_retaken));
    json_object_set_new(o, "lost", integer(s->pings_lost));
    if (r->volume) {
        json_object_set_new(o, "imaged", integer(r->volume->pings_used));
        json_object_set_new(o, "imaged_of", integer(r->volume->pings_expected));
    }
    return o;
}

/* The host that runs a node. */
static const char *host_of(const struct hosts *map, const char *node)
{
    for (size_t i = 0; i < map->n; i++)
        if (hosts_may_run(map, i, node))
            return map->list[i].name;
    return "";
}

/* How far the clock that stamps volumes is ahead of the one that stamps sound. */
static double clock_ahead_s(const struct report *r)
{
    return r->map ? report_hosts_ahead_s(&r->hosts, host_of(r->map, "recon"),
                                         host_of(r->map, "array"))
                  : 0.0;
}

/* The capture stamp is that of a ping's first sample: it has been heard ping_s later. */
static json_t *times(const struct report *r)
{
    json_t *o = json_object();

    json_object_set_new(o, "scan_s", report_json_seconds(r->running_ns, r->ended_ns));
    if (r->volume) {
        double after = elapsed_s(r->volume_capture_ns, r->volume_publish_ns) -
                       clock_ahead_s(r);
        json_object_set_new(o, "imaging_s", export_real(r->volume->imaging_s));
        /* A simulation that runs fast stamps sound that was never waited for. */
        json_object_set_new(o, "last_ping_to_volume_s",
                            export_real(fmax(after - r->ping_s, r->volume->imaging_s)));
    }
    return o;
}

static json_t *topic_count(const Anlos__TopicCount *c)
{
    json_t *o = json_object();

    json_object_set_new(o, "topic", json_string(c->topic));
    json_object_set_new(o, "direction", json_string(c->published ? "out" : "in"));
    json_object_set_new(o, "messages", integer(c->messages));
    json_object_set_new(o, "bytes", integer(c->bytes));
    json_object_set_new(o, "gaps", integer(c->gaps));
    json_object_set_new(o, "dropped", integer(c->dropped));
    return o;
}

static json_t *node(const struct report_node *n)
{
    const Anlos__Health *h = n->health;
    json_t *o = json_object(), *topics = json_array(), *device = json_object();

    json_object_set_new(o, "node", json_string(h->node));
    json_object_set_new(o, "state", json_string(name_of_health_state(h->state)));
    json_object_set_new(o, "text", json_string(h->text));
    json_object_set_new(o, "priority", json_string(h->priority));
    json_object_set_new(o, "restarts", integer(n->restarts));
    json_object_set_new(o, "uptime_s", export_real(h->uptime_s));
    json_object_set_new(o, "cpu_s", export_real(h->cpu_s));
    json_object_set_new(o, "rss_bytes", integer(h->rss_bytes));
    json_object_set_new(o, "refused", integer(h->refused));
    json_object_set_new(o, "refused_connections", integer(h->refused_connections));
    for (size_t i = 0; i < h->n_topics; i++)
        json_array_append_new(topics, topic_count(h->topics[i]));
    json_object_set_new(o, "topics", topics);
    for (size_t i = 0; i < h->n_device; i++)
        json_object_set_new(device, h->device[i]->name, integer(h->device[i]->value));
    json_object_set_new(o, "device", device);
    return o;
}

static json_t *messages(const struct report *r)
{
    uint64_t gaps = 0, dropped = 0, refused = 0, connections = 0;
    json_t *o = json_object();

    for (size_t i = 0; i < r->n_nodes; i++) {
        const Anlos__Health *h = r->nodes[i].health;
        refused += h->refused;
        connections += h->refused_connections;
        for (size_t k = 0; k < h->n_topics; k++) {
            gaps += h->topics[k]->gaps;
            dropped += h->topics[k]->dropped;
        }
    }
    json_object_set_new(o, "gaps", integer(gaps));
    json_object_set_new(o, "dropped", integer(dropped));
    json_object_set_new(o, "refused", integer(refused));
    json_object_set_new(o, "refused_connections", integer(connections));
    return o;
}

json_t *report_json(const struct report *r)
{
    json_t *o = json_object(), *nodes = json_array();

    json_object_set_new(o, "state", json_string(scan_state_name(status_of(r)->state)));
    json_object_set_new(o, "text", json_string(status_of(r)->text));
    if (r->volume) {
        json_object_set_new(o, "method", json_string(r->volume->method));
        json_object_set_new(o, "clipped_samples", integer(r->volume->clipped_samples));
        json_object_set_new(o, "microphones_masked",
                            integer(r->volume->microphones_masked));
    }
    json_object_set_new(o, "pings", pings(r));
    json_object_set_new(o, "times", times(r));
    json_object_set_new(o, "messages_lost", messages(r));
    json_t *drive = logbook_json(&r->logbook);
    if (drive)
        json_object_set_new(o, "drive", drive);
    if (r->map)
        json_object_set_new(o, "hosts", report_hosts_json(&r->hosts));
    for (size_t i = 0; i < r->n_nodes; i++)
        json_array_append_new(nodes, node(&r->nodes[i]));
    json_object_set_new(o, "nodes", nodes);
    return o;
}

#define FAILED_WAIT_NS 5000000000LL
#define WRITE_S        300.0       /* at most, on a slow disk */
#define LOOK_NS        500000000LL /* whether all is there that will come */

void report_init(struct report *r)
{
    memset(r, 0, sizeof *r);
    r->ping_s = NAN;
    logbook_init(&r->logbook);
}

int report_survey(struct report *r, const Anlos__Survey *survey)
{
    struct processing p;
    struct survey s;

    if (survey_from_message(&s, survey, NULL))
        return 0; /* dsp complains about it */
    if (!processing_plan(&p, &s, NULL))
        r->ping_s = (double)p.ping_samples / s.sample_rate_hz;
    survey_clear(&s);
    logbook_survey(&r->logbook, survey);
    return 0;
}

int report_volume(struct report *r, const Anlos__Volume *volume, int64_t capture_ns,
                  int64_t publish_ns)
{
    if (volume->preview)
        return 0;
    /* recon repeats its last volume: the first one tells how long it took. */
    if (r->volume && r->volume->pings_used == volume->pings_used &&
        r->volume_capture_ns == capture_ns)
        return 0;
    Anlos__Volume *fresh = (Anlos__Volume *)message_copy(&volume->base);
    if (!fresh)
        return -ENOMEM;
    anlos__volume__free_unpacked(r->volume, NULL);
    r->volume = fresh;
    r->volume_capture_ns = capture_ns;
    r->volume_publish_ns = publish_ns;
    return 0;
}

int report_detections(struct report *r, const Anlos__DetectionList *list,
                      int64_t capture_ns)
{
    if (list->preview)
        return 0;
    int err = logbook_list(&r->logbook, list, capture_ns);
    if (err)
        return err;
    Anlos__DetectionList *fresh = (Anlos__DetectionList *)message_copy(&list->base);
    if (!fresh)
        return -ENOMEM;
    anlos__detection_list__free_unpacked(r->detections, NULL);
    r->detections = fresh;
    return 0;
}

static bool has_ended(const Anlos__ScanStatus *s)
{
    return s && (s->state == ANLOS__SCAN_STATUS__STATE__DONE ||
                 s->state == ANLOS__SCAN_STATUS__STATE__FAILED);
}

int report_status(struct report *r, const Anlos__ScanStatus *status, int64_t now_ns)
{
    if (status->state == ANLOS__SCAN_STATUS__STATE__RUNNING && !r->running_ns)
        r->running_ns = now_ns;
    if (!has_ended(status))
        r->ended_ns = 0;
    else if (!r->ended_ns)
        r->ended_ns = now_ns;
    Anlos__ScanStatus *fresh = (Anlos__ScanStatus *)message_copy(&status->base);
    if (!fresh)
        return -ENOMEM;
    anlos__scan_status__free_unpacked(r->status, NULL);
    r->status = fresh;
    return 0;
}

int report_health(struct report *r, const Anlos__Health *health, int64_t epoch_ns)
{
    size_t i = 0;

    while (i < r->n_nodes && strcmp(r->nodes[i].health->node, health->node))
        i++;
    if (i == REPORT_MAX_NODES)
        return 0;
    struct report_node *n = &r->nodes[i];
    if (i < r->n_nodes && epoch_ns < n->epoch_ns)
        return 0;
    Anlos__Health *fresh = (Anlos__Health *)message_copy(&health->base);
    if (!fresh)
        return -ENOMEM;
    anlos__health__free_unpacked(n->health, NULL);
    n->health = fresh;
    if (i == r->n_nodes)
        r->n_nodes++;
    else if (epoch_ns != n->epoch_ns)
        n->restarts++;
    n->epoch_ns = epoch_ns;
    return 0;
}

bool report_is_complete(const struct report *r, int64_t now_ns)
{
    if (!has_ended(r->status))
        return false;
    if (r->volume && r->detections && r->volume->scan == r->status->scan &&
        r->detections->scan == r->status->scan)
        return true;
    return r->status->state == ANLOS__SCAN_STATUS__STATE__FAILED &&
           now_ns - r->ended_ns > FAILED_WAIT_NS;
}

static int write_report(const struct report *r, const char *folder, struct error *why)
{
    json_t *json = report_json(r);
    int err = export_json(folder, "report.json", json, why);

    json_decref(json);
    return err;
}

/* Besides report.json, the small ones first. */
enum {
    DETECTIONS,
    PLAN,
    PROJECTIONS,
    VOLUME = PROJECTIONS + EXPORT_PROJECTIONS,
    N_FILES
};

static const char *const file_names[N_FILES] = {"detections.json",   "plan.png",
                                                "projection_xy.png", "projection_xz.png",
                                                "projection_yz.png", "volume.nrrd"};

static int write_file(const struct report *r, int which, const char *folder,
                      struct error *why)
{
    struct grid grid;
    const float *intensity = r->volume ? volume_grid(r->volume, &grid) : NULL;

    switch (which) {
    case DETECTIONS:
        return r->detections ? export_detections(folder, r->detections, why) : 0;
    case PLAN:
        return logbook_picture(&r->logbook, folder, intensity ? &grid : NULL, why);
    case VOLUME:
        return intensity ? export_nrrd(folder, file_names[which], &grid, intensity, why)
                         : 0;
    default:
        return intensity ? export_projection(folder, (size_t)(which - PROJECTIONS), &grid,
                                             intensity, r->detections, why)
                         : 0;
    }
}

/* Goes on after one that cannot be written.  The first error; failed: their names. */
static int write_files(const struct report *r, const char *folder, char *failed,
                       size_t size)
{
    int first = 0;

    for (int i = 0; i < N_FILES; i++) {
        int err = write_file(r, i, folder, NULL);
        if (!err)
            continue;
        text_add(failed, size, ", ", "%s", file_names[i]);
        first = first ? first : err;
    }
    return first;
}

/* Those of an earlier scan beside the report of this one would be taken for its own. */
static void remove_older(const char *folder, const char *fresh)
{
    char path[4096];

    for (size_t i = 0; i < N_FILES; i++)
        if (snprintf(path, sizeof path, "%s/%s", fresh, file_names[i]) <
                (int)sizeof path &&
            access(path, F_OK) &&
            snprintf(path, sizeof path, "%s/%s", folder, file_names[i]) <
                (int)sizeof path)
            unlink(path);
}

int report_write(const struct report *r, const char *folder, struct error *why)
{
    struct export_stage stage;
    char failed[160] = "";
    int err = export_stage_begin(&stage, folder, why);

    if (err)
        return err;
    err = write_report(r, stage.path, why);
    if (err)
        return export_stage_end(&stage, err, why);
    int missing = write_files(r, stage.path, failed, sizeof failed);
    remove_older(folder, stage.path);
    err = export_stage_end(&stage, 0, why);
    if (err)
        return err;
    return missing ? error_say(why, missing, "%s: cannot be written: %s: %s", folder,
                               failed, strerror(-missing))
                   : 0;
}

void report_clear(struct report *r)
{
    anlos__volume__free_unpacked(r->volume, NULL);
    anlos__detection_list__free_unpacked(r->detections, NULL);
    anlos__scan_status__free_unpacked(r->status, NULL);
    for (size_t i = 0; i < r->n_nodes; i++)
        anlos__health__free_unpacked(r->nodes[i].health, NULL);
    report_hosts_clear(&r->hosts);
    logbook_clear(&r->logbook);
    report_init(r);
}

static int take_survey(void *self, const struct node_message *in)
{
    return report_survey(self, (const Anlos__Survey *)in->content);
}

static int take_volume(void *self, const struct node_message *in)
{
    return report_volume(self, (const Anlos__Volume *)in->content, in->capture_ns,
                         in->publish_ns);
}

static int take_detections(void *self, const struct node_message *in)
{
    return report_detections(self, (const Anlos__DetectionList *)in->content,
                             in->capture_ns);
}

static int take_status(void *self, const struct node_message *in)
{
    return report_status(self, (const Anlos__ScanStatus *)in->content,
                         node_machine_ns(((struct report *)self)->node));
}

static int take_health(void *self, const struct node_message *in)
{
    return report_health(self, (const Anlos__Health *)in->content, in->epoch_ns);
}

static int take_walls(void *self, const struct node_message *in)
{
    return logbook_walls(&((struct report *)self)->logbook,
                         (const Anlos__WallList *)in->content);
}

static int take_hosts(void *self, const struct node_message *in)
{
    return report_hosts_take(&((struct report *)self)->hosts,
                             (const Anlos__HostStatus *)in->content);
}

static int take_ego(void *self, const struct node_message *in)
{
    logbook_ego(&((struct report *)self)->logbook, (const Anlos__EgoMotion *)in->content,
                in->capture_ns);
    return 0;
}

static bool has_hosts(const void *self)
{
    return ((const struct report *)self)->map;
}

static const struct loop_input inputs[] = {
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_volume, .take = take_volume},
    {.topic = topic_detections, .take = take_detections},
    {.topic = topic_scan_status, .take = take_status},
    {.topic = topic_health, .take = take_health},
    {.topic = topic_wall, .take = take_walls},
    {.topic = topic_ego, .take = take_ego},
    {.topic = topic_host, .take = take_hosts, .wanted = has_hosts},
    {.topic = NULL},
};

static int64_t look_due_ns(const void *self)
{
    return ((const struct report *)self)->look_due_ns;
}

static int look(void *self)
{
    struct report *r = self;
    int64_t now = node_machine_ns(r->node);

    r->look_due_ns = now + LOOK_NS;
    return report_is_complete(r, now) ? LOOP_DONE : 0;
}

static const struct loop_timer timers[] = {
    {.due_ns = look_due_ns, .run = look, .when = LOOP_EACH},
    {.run = NULL},
};

static void start(void *self)
{
    node_state(((struct report *)self)->node, ANLOS__HEALTH__STATE__READY, "ready");
}

/* A system without end is over when it is stopped. */
static int end(void *self, int err)
{
    const struct report *r = self;
    const struct launchfile *l = node_launch(r->node);
    struct error why = {""};

    if (err && !(err == -ESHUTDOWN && l->scan.fixed))
        return err;
    node_busy(r->node, WRITE_S);
    err = report_write(r, l->report.folder, &why);
    if (!err)
        node_log(r->node, LOG_LEVEL_DEBUG, "%s is written", l->report.folder);
    else if (why.text[0])
        node_log(r->node, LOG_LEVEL_ERROR, "%s", why.text);
    return err;
}

static void clear(void *self)
{
    report_clear(self);
}

const struct loop report_loop = {
    .inputs = inputs, .timers = timers, .start = start, .end = end, .close = clear};
