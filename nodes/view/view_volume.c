/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/rt/export.h"
#include "nodes/view/plan.h"
#include "nodes/view/view_state.h"

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
        v->survey_id && v->survey_id == m->survey_id
            ? plan_footprint_json(&v->survey, v->walls.n ? &v->walls.list[0].plane : NULL,
                                  g)
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

void view_post_volume(struct view *v, const Anlos__Volume *volume, int64_t publish_ns)
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

void view_take_volume(struct view *v, const Anlos__Volume *volume, int64_t capture_ns,
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
    view_post_volume(v, volume, publish_ns);
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
