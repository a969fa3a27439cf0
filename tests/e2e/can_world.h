/* SPDX-License-Identifier: MIT */
/* tests/e2e/can_world.h -- the node can by itself: the test is the rest of the sensor,
 * and holds its clock and its bus.  All that it depends on comes at its pace until it is
 * stopped. */
#ifndef ANLOS_TESTS_E2E_CAN_WORLD_H
#define ANLOS_TESTS_E2E_CAN_WORLD_H

#include "tests/e2e/can_log.h"
#include "tests/e2e/held.h"
#include "tests/nodes/alone.h"

#include <math.h>

#include "msgs/detections.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/topics.h"
#include "msgs/wall.pb-c.h"

#define MS    INT64_C(1000000)
#define SCENE SOURCE_DIR "/launch/scenes/drive-person.yaml"

enum input { SURVEY, SCAN, HEALTH, DSP_HEALTH, WALLS, LISTS, INPUTS };

struct source { /* of one kind of messages */
    int64_t period_ns;
    bool stopped;
    int64_t sent_ns; /* before the newest went out */
};

struct world {
    char path[128]; /* of the log */
    struct held *held;
    struct alone can;
    struct can_log log;
    struct bus *array, *scan, *dsp, *wall, *track;
    struct source sources[INPUTS];
    struct survey survey;
    const char *faults[3]; /* that the array tells of a microphone or itself */
    uint32_t counter;      /* of lists */
    bool stuck;            /* it does not go on */
};

static inline void publish(struct bus *b, const struct topic *t, int64_t capture_ns,
                           const ProtobufCMessage *m)
{
    assert_int_equal(bus_publish_message(b, t, capture_ns, alone_now_ns(), m), 0);
}

static inline void tell_scan(struct world *w)
{
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    s.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    publish(w->scan, topic_scan_status(), 0, &s.base);
}

static inline void tell_health(struct bus *b, const char *node, const char *const *faults,
                               size_t n)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__Fault list[3], *pointers[3];

    h.node = (char *)node;
    h.state = ANLOS__HEALTH__STATE__READY;
    h.faults = pointers;
    for (size_t i = 0; i < n && faults[i]; i++) {
        anlos__fault__init(&list[i]);
        list[i].name = (char *)faults[i];
        list[i].count = 1;
        list[i].of = 16;
        pointers[h.n_faults++] = &list[i];
    }
    publish(b, topic_health(), 0, &h.base);
}

static inline void tell_walls(struct world *w)
{
    Anlos__WallList list = ANLOS__WALL_LIST__INIT;
    Anlos__Wall wall = ANLOS__WALL__INIT, *walls[] = {&wall};

    wall.existence = 0.9;
    list.walls = walls;
    list.n_walls = 1;
    publish(w->wall, topic_wall(), 0, &list.base);
}

static inline void tell_list(struct world *w)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection object = ANLOS__DETECTION__INIT, *objects[] = {&object};
    Anlos__Vec3 position = ANLOS__VEC3__INIT;

    position.x = 3.0;
    object.id = 1;
    object.existence = 0.9;
    object.position_m = &position;
    w->counter += !w->stuck;
    list.counter = w->counter;
    list.detections = objects;
    list.n_detections = 1;
    list.mirrored = list.in_vehicle_frame = list.tracked = true;
    publish(w->track, topic_detections(), alone_now_ns() - 50 * MS, &list.base);
}

static inline void tell(struct world *w, enum input i)
{
    switch (i) {
    case SURVEY:
        alone_tell_survey(w->array, &w->survey);
        break;
    case SCAN:
        tell_scan(w);
        break;
    case HEALTH:
        tell_health(w->array, "array", w->faults, 3);
        break;
    case DSP_HEALTH:
        tell_health(w->dsp, "dsp", NULL, 0);
        break;
    case WALLS:
        tell_walls(w);
        break;
    default:
        tell_list(w);
    }
}

/* All inputs go on but those that have stopped; what the node sends is read. */
static inline void go_on(struct world *w)
{
    struct bus_message m;

    for (int i = 0; i < INPUTS; i++) {
        struct source *s = &w->sources[i];
        int64_t now_ns = alone_now_ns();
        if (s->stopped || now_ns < s->sent_ns + s->period_ns)
            continue;
        s->sent_ns = now_ns;
        tell(w, (enum input)i);
    }
    assert_false(alone_hear(&w->can, &m)); /* only health comes */
    can_log_read(&w->log, w->path);
}

/* At once, not with the next of its period. */
static inline void tell_now(struct world *w, enum input i)
{
    w->sources[i].sent_ns = 0;
}

static inline int64_t stop(struct world *w, enum input i)
{
    w->sources[i].stopped = true;
    return w->sources[i].sent_ns;
}

static inline void open_world(struct world *w, struct scratch *s)
{
    char launch[1024];

    *w = (struct world){
        .sources = {[SURVEY] = {.period_ns = 250 * MS},
                    [SCAN] = {.period_ns = 250 * MS},
                    [HEALTH] = {.period_ns = 250 * MS},
                    [DSP_HEALTH] = {.period_ns = 250 * MS},
                    [WALLS] = {.period_ns = 100 * MS},
                    [LISTS] = {.period_ns = 100 * MS}},
        .survey = alone_survey(),
        .log = {.tally = {.checks = {.base = CAN_BASE_DEFAULT}}},
    };
    w->survey.temperature_c = NAN; /* the vehicle's is the only one */
    w->held = held_open(scratch_path(s, "held"));
    setenv(HELD_FILE, s->path, 1);
    snprintf(w->path, sizeof w->path, "%s/out/can.candump", s->folder);
    w->array = alone_bus(s->folder, "array");
    w->scan = alone_bus(s->folder, "scan");
    w->dsp = alone_bus(s->folder, "dsp");
    w->wall = alone_bus(s->folder, "wall");
    w->track = alone_bus(s->folder, "track");
    snprintf(launch, sizeof launch,
             "nodes: [array, scan, dsp, recon, wall, track, can, report]\n"
             "array: {uri: 'sim:%s'}\n"
             "scan: {mode: fixed}\n"
             "can: {uri: 'sim:%s?log=can.candump&wall=on'}\n"
             "report: {folder: '%s/out'}\n",
             SCENE, SCENE, s->folder);
    alone_start_program(&w->can, BINARY_DIR "/tests/held_can", s->folder, "can", launch);
}

static inline void close_world(struct world *w, int exit_code)
{
    alone_end(&w->can, exit_code);
    can_log_read(&w->log, w->path);
    fclose(w->log.file);
    bus_destroy(w->array);
    bus_destroy(w->scan);
    bus_destroy(w->dsp);
    bus_destroy(w->wall);
    bus_destroy(w->track);
    munmap(w->held, sizeof *w->held);
}

#endif
