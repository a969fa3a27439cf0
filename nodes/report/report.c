#include "nodes/report/report.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "msgs/convert.h"
#include "recon/survey.h"
#include "nodes/report/report_json.h"
#include "nodes/rt/export.h"
#include "recon/processing.h"
#include "nodes/rt/volume_grid.h"

#define FAILED_WAIT_NS 5000000000LL

void report_init(struct report *r)
{
    memset(r, 0, sizeof *r);
    r->ping_s = NAN;
    logbook_init(&r->logbook);
}

/* A deep copy, by way of its bytes.  NULL: no memory. */
static void *copy(const ProtobufCMessage *m)
{
    size_t size = protobuf_c_message_get_packed_size(m);
    uint8_t *bytes = malloc(size ? size : 1);

    if (!bytes)
        return NULL;
    protobuf_c_message_pack(m, bytes);
    void *out = protobuf_c_message_unpack(m->descriptor, NULL, size, bytes);
    free(bytes);
    return out;
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
    Anlos__Volume *fresh = copy(&volume->base);
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
    Anlos__DetectionList *fresh = copy(&list->base);
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
    Anlos__ScanStatus *fresh = copy(&status->base);
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
    Anlos__Health *fresh = copy(&health->base);
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

static int write_report(const struct report *r, const char *folder, struct complaint *why)
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
                      struct complaint *why)
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
    size_t used = 0;
    int first = 0;

    for (int i = 0; i < N_FILES; i++) {
        int err = write_file(r, i, folder, NULL);
        if (!err)
            continue;
        used += (size_t)snprintf(failed + used, size - used, "%s%s", first ? ", " : "",
                                 file_names[i]);
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

int report_write(const struct report *r, const char *folder, struct complaint *why)
{
    struct export_stage stage;
    char failed[160];
    int err = export_stage_begin(&stage, folder, why);

    if (err)
        return err;
    err = write_report(r, stage.path, why);
    if (err) {
        export_stage_abandon(&stage);
        return err;
    }
    int missing = write_files(r, stage.path, failed, sizeof failed);
    remove_older(folder, stage.path);
    err = export_stage_commit(&stage, why);
    if (err) {
        export_stage_abandon(&stage);
        return err;
    }
    return missing ? complain(why, missing, "%s: cannot be written: %s: %s", folder,
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
