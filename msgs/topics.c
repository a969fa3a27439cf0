/* SPDX-License-Identifier: MIT */
#include "msgs/topics.h"

#include <string.h>

#include "msgs/array.pb-c.h"
#include "msgs/clock.pb-c.h"
#include "msgs/detections.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/host.pb-c.h"
#include "msgs/log.pb-c.h"
#include "msgs/save.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/stage.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/traces.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "msgs/wall.pb-c.h"

#define KB ((size_t)1 << 10)
#define MB ((size_t)1 << 20)

static const char *const nodes[] = {"stage", "array", "scan",   "dsp",      "recon",
                                    "track", "can",   "report", "launcher", "record",
                                    "play",  "view",  "wall",   NULL};

enum {
    SURVEY,
    STAGE_COMMAND,
    STAGE_STATE,
    STAGE_MANUAL,
    FIRE,
    PING,
    TRACES,
    VOLUME,
    DETECTIONS,
    SCAN_STATUS,
    RECEIPT,
    HEALTH,
    LOG,
    CLOCK,
    HOST,
    WALL,
    WALL_GIVEN,
    ECHOES,
    EGO,
    AMBIENT,
    PLACES,
    PROGRESS,
    SAVE,
    SAVE_STATUS,
    N_TOPICS
};

/* Depths: a full queue of pings holds 4 s of a scan, one of traces a whole scan. */
static const struct topic topics[N_TOPICS + 1] = {
    /* clang-format off */
    [SURVEY]        = {"survey", &anlos__survey__descriptor,
                       1, TOPIC_LATEST, 1, 16 * MB, {"array"}},
    [STAGE_COMMAND] = {"stage/command", &anlos__stage_command__descriptor,
                       0, TOPIC_ALL, 16, 4 * KB, {"scan"}},
    [STAGE_STATE]   = {"stage/state", &anlos__stage_state__descriptor,
                       2, TOPIC_LATEST, 1, 4 * KB, {"stage"}},
    [STAGE_MANUAL]  = {"stage/manual", &anlos__stage_manual__descriptor,
                       0, TOPIC_ALL, 16, 4 * KB, {"hand"}},
    [FIRE]          = {"array/fire", &anlos__fire_command__descriptor,
                       0, TOPIC_ALL, 16, 64 * KB, {"scan"}},
    [PING]          = {"ping", &anlos__ping__descriptor,
                       16, TOPIC_ALL, 64, 8 * MB, {"array"}},
    [TRACES]        = {"traces", &anlos__traces__descriptor,
                       16, TOPIC_ALL, 512, 8 * MB, {"dsp"}},
    [VOLUME]        = {"volume", &anlos__volume__descriptor,
                       0, TOPIC_LATEST, 1, 256 * MB, {"recon"}},
    [DETECTIONS]    = {"detections", &anlos__detection_list__descriptor,
                       0, TOPIC_ALL, 64, 1 * MB, {"track"}},
    [SCAN_STATUS]   = {"scan/status", &anlos__scan_status__descriptor,
                       5, TOPIC_LATEST, 1, 4 * KB, {"scan"}},
    [RECEIPT]       = {"receipt", &anlos__receipt__descriptor,
                       16, TOPIC_ALL, 4096, 4 * KB, {"dsp", "recon"}},
    [HEALTH]        = {"health", &anlos__health__descriptor,
                       1, TOPIC_ALL, 256, 64 * KB, {"*"}},
    [LOG]           = {"log", &anlos__log__descriptor,
                       0, TOPIC_ALL, 512, 16 * KB, {"*"}},
    [CLOCK]         = {"clock", &anlos__clock__descriptor,
                       5, TOPIC_LATEST, 1, 8 * KB, {"play"}},
    [HOST]          = {"host", &anlos__host_status__descriptor,
                       2, TOPIC_ALL, 16, 4 * KB, {"launcher"}},
    [WALL]          = {"wall", &anlos__wall_list__descriptor,
                       10, TOPIC_LATEST, 1, 16 * KB, {"wall"}},
    [WALL_GIVEN]    = {"wall/given", &anlos__wall_list__descriptor,
                       10, TOPIC_LATEST, 1, 16 * KB, {"can", "vehicle"}},
    [ECHOES]        = {"echoes", &anlos__echoes__descriptor,
                       0, TOPIC_ALL, 256, 256 * KB, {"dsp"}},
    [EGO]           = {"ego", &anlos__ego_motion__descriptor,
                       50, TOPIC_ALL, 256, 4 * KB, {"can", "vehicle"}},
    [AMBIENT]       = {"ambient", &anlos__ambient__descriptor,
                       1, TOPIC_LATEST, 1, 4 * KB, {"can", "vehicle"}},
    [PLACES]        = {"array/places", &anlos__element_places__descriptor,
                       0, TOPIC_LATEST, 1, 16 * KB, {"dsp"}},
    [PROGRESS]      = {"progress", &anlos__progress__descriptor,
                       0, TOPIC_ALL, 256, 4 * KB,
                       {"play", "dsp", "recon", "wall", "track", "can", "report"}},
    [SAVE]          = {"record/save", &anlos__save_request__descriptor,
                       0, TOPIC_ALL, 16, 4 * KB, {"hand", "view", "page", "can"}},
    [SAVE_STATUS]   = {"record/status", &anlos__save_status__descriptor,
                       1, TOPIC_ALL, 64, 8 * KB, {"record", "recorder"}},
    /* clang-format on */
};

const struct topic *topics_all(void)
{
    return topics;
}

const struct topic *topics_find(const char *name)
{
    for (const struct topic *t = topics; t->name; t++)
        if (strcmp(t->name, name) == 0)
            return t;
    return NULL;
}

const char *const *topics_nodes(void)
{
    return nodes;
}

bool topics_have_node(const char *name)
{
    const char *const *n = topics_nodes();

    while (*n && strcmp(*n, name))
        n++;
    return *n;
}

const char *topic_publisher(const struct topic *t, size_t i)
{
    const char *const *list = t->publishers;
    if (list[0] && strcmp(list[0], "*") == 0)
        list = nodes;
    for (size_t k = 0; k < i; k++)
        if (!list[k])
            return NULL;
    return list[i];
}

bool topic_is_published_by(const struct topic *t, const char *node)
{
    const char *name;
    for (size_t i = 0; (name = topic_publisher(t, i)); i++)
        if (strcmp(name, node) == 0)
            return true;
    return false;
}

const struct topic *topic_survey(void)
{
    return &topics[SURVEY];
}

const struct topic *topic_stage_command(void)
{
    return &topics[STAGE_COMMAND];
}

const struct topic *topic_stage_state(void)
{
    return &topics[STAGE_STATE];
}

const struct topic *topic_stage_manual(void)
{
    return &topics[STAGE_MANUAL];
}

const struct topic *topic_fire(void)
{
    return &topics[FIRE];
}

const struct topic *topic_ping(void)
{
    return &topics[PING];
}

const struct topic *topic_traces(void)
{
    return &topics[TRACES];
}

const struct topic *topic_volume(void)
{
    return &topics[VOLUME];
}

const struct topic *topic_detections(void)
{
    return &topics[DETECTIONS];
}

const struct topic *topic_scan_status(void)
{
    return &topics[SCAN_STATUS];
}

const struct topic *topic_receipt(void)
{
    return &topics[RECEIPT];
}

const struct topic *topic_health(void)
{
    return &topics[HEALTH];
}

const struct topic *topic_log(void)
{
    return &topics[LOG];
}

const struct topic *topic_clock(void)
{
    return &topics[CLOCK];
}

const struct topic *topic_host(void)
{
    return &topics[HOST];
}

const struct topic *topic_wall(void)
{
    return &topics[WALL];
}

const struct topic *topic_wall_given(void)
{
    return &topics[WALL_GIVEN];
}

const struct topic *topic_echoes(void)
{
    return &topics[ECHOES];
}

const struct topic *topic_ego(void)
{
    return &topics[EGO];
}

const struct topic *topic_ambient(void)
{
    return &topics[AMBIENT];
}

const struct topic *topic_places(void)
{
    return &topics[PLACES];
}

const struct topic *topic_progress(void)
{
    return &topics[PROGRESS];
}

const struct topic *topic_save(void)
{
    return &topics[SAVE];
}

const struct topic *topic_save_status(void)
{
    return &topics[SAVE_STATUS];
}
