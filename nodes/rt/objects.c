#include "nodes/rt/objects.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/rt/processing.h"
#include "recon/wall.h"

#define CLUSTER_WIDTHS 3.0 /* of a point, that pings around objects keep apart */

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

/* The columns of r: the array frame's axes as the vehicle sees them, taken from where
 * survey_to_vehicle puts them. */
static void axes_in_vehicle(const struct survey *s, double r[3][3])
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    double origin[3];

    survey_to_vehicle(s, zero, origin);
    for (int a = 0; a < 3; a++) {
        double unit[3] = {a == 0, a == 1, a == 2}, moved[3];
        survey_to_vehicle(s, unit, moved);
        for (int b = 0; b < 3; b++)
            r[b][a] = moved[b] - origin[b];
    }
}

/* out = r c r^T */
static void turn_covariance(const double r[3][3], const double c[6], double out[6])
{
    static const int at[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

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

/* The box around an imaged object becomes the box, along the axes of its position's
 * frame, around that box mirrored and turned. */
static void turn_extent(const struct survey *s, const double r[3][3],
                        const double extent[3], double out[3])
{
    for (int b = 0; b < 3; b++) {
        out[b] = 0.0;
        for (int a = 0; a < 3; a++) {
            double side = r[b][a]; /* of r (1 - 2 n n^T) */
            for (int i = 0; s->has_wall && i < 3; i++)
                side -= 2.0 * r[b][i] * s->wall_normal[i] * s->wall_normal[a];
            out[b] += fabs(side) * extent[a];
        }
    }
}

static int fill_detection(Anlos__Detection *m, const struct survey *s,
                          const struct detection *d)
{
    double position[3], covariance[6], rotated[6], extent[3], r[3][3];
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
    axes_in_vehicle(s, r);
    turn_covariance((const double(*)[3])r, covariance, rotated);
    turn_extent(s, (const double(*)[3])r, d->extent_m, extent);

    m->position_m = vec3_create(there);
    m->virtual_m = vec3_create(d->position_m);
    m->extent_m = vec3_create(extent);
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

static size_t drop_unlikely(struct detection *found, size_t n, double min_existence)
{
    size_t kept = 0;

    for (size_t i = 0; i < n; i++)
        if (found[i].existence >= min_existence)
            found[kept++] = found[i];
    return kept;
}

int objects_find(Anlos__DetectionList **out, const struct survey *s,
                 const struct detect_config *cfg, double min_existence,
                 const struct grid *grid, const float *intensity)
{
    struct detection found[OBJECTS_MAX];
    struct detect_config resolved = *cfg;
    struct geometry geometry;
    size_t n = 0;
    double band_hz[2] = {fmin(s->chirp_start_hz, s->chirp_stop_hz),
                         fmax(s->chirp_start_hz, s->chirp_stop_hz)};
    double middle[3];
    for (int a = 0; a < 3; a++)
        middle[a] = grid->origin_m[a] + 0.5 * (double)grid->n[a] * grid->step_m[a];

    processing_geometry(&geometry, s);
    if (geometry.pings_m) { /* a turntable sees details of one cluster's size */
        double *r = resolved.resolution_m;
        geometry_resolution_at(&geometry, band_hz, middle, r);
        resolved.cluster_m =
            fmin(resolved.cluster_m, CLUSTER_WIDTHS * cbrt(r[0] * r[1] * r[2]));
    } else {
        geometry_resolution(&geometry, band_hz, middle[2], resolved.resolution_m);
    }
    int err = detect_objects(&resolved, grid, intensity, found, OBJECTS_MAX, &n);
    if (err)
        return err;
    return objects_list(out, s, found, drop_unlikely(found, n, min_existence));
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
