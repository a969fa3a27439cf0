/* SPDX-License-Identifier: MIT */
#include "hal/room/pose.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "hal/random.h"
#include "hal/room/vector.h"

enum { STREAM_SPEAKERS = 5, STREAM_MICROPHONES = 6, STREAM_STAGE = 7 };

/* nominal NULL: 0. */
static void draw(double (*out)[3], const double (*nominal)[3], size_t n, double rms,
                 uint32_t seed, uint64_t stream)
{
    struct random r;
    random_seed(&r, (uint64_t[]){seed, stream}, 2);
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 3; a++)
            out[i][a] = (nominal ? nominal[i][a] : 0.0) + rms * random_normal(&r);
}

int pose_create(struct pose *out, const struct survey *s, double element_m,
                double stage_m, uint32_t seed)
{
    struct pose p = {.survey = s};
    size_t size = sizeof *p.speakers_m;
    p.speakers_at_m = calloc(s->n_speakers, size);
    p.microphones_at_m = calloc(s->n_microphones, size);
    p.stage_errors_m = calloc(s->n_positions, size);
    p.speakers_m = calloc(s->n_speakers, size);
    p.microphones_m = calloc(s->n_microphones, size);
    p.speaker_images_m = calloc(s->n_speakers, size);
    p.microphone_images_m = calloc(s->n_microphones, size);
    *out = p;
    if (!p.speakers_at_m || !p.microphones_at_m || !p.stage_errors_m || !p.speakers_m ||
        !p.microphones_m || !p.speaker_images_m || !p.microphone_images_m) {
        pose_clear(out);
        return -ENOMEM;
    }
    draw(p.speakers_at_m, (const double(*)[3])s->speakers_m, s->n_speakers, element_m,
         seed, STREAM_SPEAKERS);
    draw(p.microphones_at_m, (const double(*)[3])s->microphones_m, s->n_microphones,
         element_m, seed, STREAM_MICROPHONES);
    draw(p.stage_errors_m, NULL, s->n_positions, stage_m, seed, STREAM_STAGE);
    return 0;
}

static void place(const struct survey *s, const double stage[3], size_t n,
                  const double (*at)[3], double (*out)[3], double (*images)[3])
{
    for (size_t i = 0; i < n; i++) {
        vector_add(at[i], 1, stage, out[i]);
        vector_mirror(s->wall_normal, s->wall_distance_m, out[i], images[i]);
    }
}

static void carry(struct pose *p, const double stage[3])
{
    const struct survey *s = p->survey;
    place(s, stage, s->n_speakers, (const double(*)[3])p->speakers_at_m, p->speakers_m,
          p->speaker_images_m);
    place(s, stage, s->n_microphones, (const double(*)[3])p->microphones_at_m,
          p->microphones_m, p->microphone_images_m);
}

void pose_move(struct pose *p, size_t position)
{
    const struct survey *s = p->survey;
    double stage[3];
    vector_add(p->stage_errors_m[position], s->stage_positions_m[position], s->stage_axis,
               stage);
    carry(p, stage);
}

void pose_go(struct pose *p, double stage_m)
{
    const struct survey *s = p->survey;
    const double *at_m = s->stage_positions_m;
    size_t last = s->n_positions - 1, k = 0;
    double stage[3], part = 0;
    if (last) { /* even steps, up or down */
        double along = (stage_m - at_m[0]) / (at_m[last] - at_m[0]) * (double)last;
        along = fmin(fmax(along, 0), (double)last);
        k = (size_t)fmin(floor(along), (double)(last - 1));
        part = along - (double)k;
    }
    for (int a = 0; a < 3; a++) {
        double before = p->stage_errors_m[k][a],
               behind = p->stage_errors_m[k + (last > 0)][a];
        stage[a] = stage_m * s->stage_axis[a] + before + part * (behind - before);
    }
    carry(p, stage);
}

void pose_clear(struct pose *p)
{
    free(p->speakers_at_m);
    free(p->microphones_at_m);
    free(p->stage_errors_m);
    free(p->speakers_m);
    free(p->microphones_m);
    free(p->speaker_images_m);
    free(p->microphone_images_m);
    *p = (struct pose){.survey = NULL};
}
