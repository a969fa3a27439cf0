/* SPDX-License-Identifier: MIT */
/* tests/nodes/scene.h -- the small simulated scene point.yaml beside it as messages:
 * its survey, and any of its pings. */
#ifndef ANLOS_TESTS_NODES_SCENE_H
#define ANLOS_TESTS_NODES_SCENE_H

#include <stdlib.h>
#include <string.h>

#include "hal/room/room.h"
#include "msgs/array.pb-c.h"
#include "msgs/convert.h"
#include "msgs/tensor.h"
#include "recon/survey.h"

#define SCENE_MAX_MICROPHONES 16

struct scene {
    struct room *room;
    Anlos__Survey *survey;
    size_t n_samples; /* of a ping */
    float *samples;   /* [n_microphones][n_samples], of the newest */
    uint32_t clipped[SCENE_MAX_MICROPHONES], not_finite[SCENE_MAX_MICROPHONES];
    struct tensor_view view;
};

/* A survey as its message; NULL: it does not pack. */
static inline Anlos__Survey *scene_message(const struct survey *survey)
{
    uint8_t *bytes = NULL;
    size_t size;

    if (survey_pack(survey, &bytes, &size))
        return NULL;
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    return m;
}

static inline int scene_open(struct scene *s, const char *path)
{
    memset(s, 0, sizeof *s);
    if (room_load(&s->room, path, NULL))
        return -1;
    s->survey = scene_message(room_survey(s->room));
    if (!s->survey)
        return -1;
    s->n_samples = room_frames(s->room, 1);
    s->samples = calloc(s->survey->n_microphones_m * s->n_samples, sizeof *s->samples);
    return s->samples ? 0 : -1;
}

static inline void scene_ping(struct scene *s, Anlos__Pass pass, uint32_t position,
                              uint32_t speaker, Anlos__Ping *out)
{
    memset(s->clipped, 0, sizeof s->clipped);
    memset(s->not_finite, 0, sizeof s->not_finite);
    room_record(s->room, (enum pass)pass, position, &speaker, 1, 0, s->samples);
    anlos__ping__init(out);
    out->survey_id = s->survey->id;
    out->scan = 1;
    out->pass = pass;
    out->position = position;
    out->stage_m = s->survey->stage_positions_m[position];
    out->speaker = speaker;
    out->samples = tensor_borrow_f32(&s->view, s->samples, 2, s->survey->n_microphones_m,
                                     s->n_samples);
    out->n_clipped = out->n_not_finite = s->survey->n_microphones_m;
    out->clipped = s->clipped;
    out->not_finite = s->not_finite;
    out->valid = true;
}

static inline void scene_close(struct scene *s)
{
    room_destroy(s->room);
    anlos__survey__free_unpacked(s->survey, NULL);
    free(s->samples);
}

#endif
