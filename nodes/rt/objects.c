#include "nodes/rt/objects.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/rt/processing.h"
#include "recon/wall.h"

static Anlos__Vec3 *vec3_create(const double v[3])
{
    Anlos__Vec3 *m = malloc(sizeof *m);
    if (!m)
        return NULL;
    anlos__vec3__init(m);
    m->x = v[0];
    m->y = v[1];
    m->z = v[2];
    return m;
}

/* out = R c R^T with the columns of R = the frame's axes as the vehicle sees them, taken
 * from where survey_to_vehicle puts them. */
static void covariance_to_vehicle(const struct survey *s, const double c[6],
                                  double out[6])
{
    static const int at[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    static const double zero[3] = {0.0, 0.0, 0.0};
    double origin[3], r[3][3];

    survey_to_vehicle(s, zero, origin);
    for (int a = 0; a < 3; a++) {
        double unit[3] = {a == 0, a == 1, a == 2}, moved[3];
        survey_to_vehicle(s, unit, moved);
        for (int b = 0; b < 3; b++)
            r[b][a] = moved[b] - origin[b];
    }
    for (int a = 0; a < 3; a++) {
        for (int b = a; b < 3; b++) {
            double sum = 0.0;
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    sum += r[a][i] * c[at[i][j]] * r[b][j];
            out[at[a][b]] = sum;
        }
    }
}

static int fill_detection(Anlos__Detection *m, const struct survey *s,
                          const struct detection *d)
{
    double position[3], covariance[6], rotated[6];
    memcpy(position, d->position_m, sizeof position);
    memcpy(covariance, d->covariance_m2, sizeof covariance);
    if (s->has_wall) {
        struct wall wall = {.distance_m = s->wall_distance_m};
        memcpy(wall.normal, s->wall_normal, sizeof wall.normal);
        wall_mirror(&wall, d->position_m, position);
        wall_mirror_covariance(&wall, d->covariance_m2, covariance);
    }
    double there[3];
    survey_to_vehicle(s, position, there);
    covariance_to_vehicle(s, covariance, rotated);

    m->position_m = vec3_create(there);
    m->virtual_m = vec3_create(d->position_m);
    m->extent_m = vec3_create(d->extent_m);
    m->covariance_m2 = malloc(sizeof rotated);
    if (!m->position_m || !m->virtual_m || !m->extent_m || !m->covariance_m2)
        return -ENOMEM;
    memcpy(m->covariance_m2, rotated, sizeof rotated);
    m->n_covariance_m2 = 6;
    m->existence = d->existence;
    m->level_db = d->level_db;
    return 0;
}

int objects_list(Anlos__DetectionList **out, const struct survey *s,
                 const struct detection *objects, size_t n)
{
    Anlos__DetectionList *list = malloc(sizeof *list);
    if (!list)
        return -ENOMEM;
    anlos__detection_list__init(list);
    list->mirrored = s->has_wall;
    list->in_vehicle_frame = s->has_mount;
    list->source = s->source;
    list->temperature_c = s->temperature_c;
    list->sound_speed_m_s = s->sound_speed_m_s;
    list->detections = calloc(n ? n : 1, sizeof(Anlos__Detection *));
    if (!list->detections)
        goto fail;
    for (size_t i = 0; i < n; i++) {
        Anlos__Detection *m = malloc(sizeof *m);
        if (!m)
            goto fail;
        anlos__detection__init(m);
        m->id = (uint32_t)i + 1;
        list->detections[list->n_detections++] = m;
        if (fill_detection(m, s, &objects[i]))
            goto fail;
    }
    *out = list;
    return 0;
fail:
    objects_free(list);
    return -ENOMEM;
}

int objects_find(Anlos__DetectionList **out, const struct survey *s,
                 const struct detect_config *cfg, const struct grid *grid,
                 const float *intensity)
{
    struct detection found[OBJECTS_MAX];
    struct detect_config resolved = *cfg;
    struct geometry geometry;
    size_t n = 0;
    double band_hz[2] = {fmin(s->chirp_start_hz, s->chirp_stop_hz),
                         fmax(s->chirp_start_hz, s->chirp_stop_hz)};
    double middle_m = grid->origin_m[2] + 0.5 * (double)grid->n[2] * grid->step_m[2];

    processing_geometry(&geometry, s);
    geometry_resolution(&geometry, band_hz, middle_m, resolved.resolution_m);
    int err = detect_objects(&resolved, grid, intensity, found, OBJECTS_MAX, &n);
    return err ? err : objects_list(out, s, found, n);
}

void objects_free(Anlos__DetectionList *list)
{
    if (!list)
        return;
    for (size_t i = 0; i < list->n_detections; i++) {
        Anlos__Detection *m = list->detections[i];
        free(m->position_m);
        free(m->virtual_m);
        free(m->extent_m);
        free(m->covariance_m2);
        free(m);
    }
    free(list->detections);
    free(list);
}
