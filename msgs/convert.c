/* SPDX-License-Identifier: MIT */
#include "msgs/convert.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static Anlos__Vec3 vec3(const double v[3])
{
    Anlos__Vec3 out = ANLOS__VEC3__INIT;
    out.x = v[0];
    out.y = v[1];
    out.z = v[2];
    return out;
}

static Anlos__Vec3 *set_vec3(Anlos__Vec3 *out, const double v[3])
{
    *out = vec3(v);
    return out;
}

/* -- the survey ------------------------------------------------------------------------
 */

/* A list of vectors for a message: the pointers first, then what they point to. */
static Anlos__Vec3 **vec3_list(double (*const v)[3], size_t n)
{
    Anlos__Vec3 **list = malloc(n * (sizeof *list + sizeof **list));
    if (!list)
        return NULL;
    Anlos__Vec3 *storage = (Anlos__Vec3 *)(void *)(list + n);
    for (size_t i = 0; i < n; i++) {
        storage[i] = vec3(v[i]);
        list[i] = &storage[i];
    }
    return list;
}

static Anlos__MicrophoneResponse **response_list(const struct survey *s)
{
    size_t n = s->n_responses;
    Anlos__MicrophoneResponse **list = malloc((n + !n) * (sizeof *list + sizeof **list));
    if (!list)
        return NULL;
    Anlos__MicrophoneResponse *storage = (Anlos__MicrophoneResponse *)(void *)(list + n);
    for (size_t i = 0; i < n; i++) {
        anlos__microphone_response__init(&storage[i]);
        storage[i].serial = s->responses[i].serial;
        storage[i].n_frequency_hz = s->responses[i].n_points;
        storage[i].frequency_hz = s->responses[i].frequency_hz;
        storage[i].n_gain_db = s->responses[i].n_points;
        storage[i].gain_db = s->responses[i].gain_db;
        list[i] = &storage[i];
    }
    return list;
}

static void fill_numbers(Anlos__Survey *m, const struct survey *s)
{
    m->id = survey_id(s);
    m->source = (Anlos__Source)s->source;
    m->sound_speed_m_s = s->sound_speed_m_s;
    m->temperature_c = s->temperature_c;
    m->sample_rate_hz = s->sample_rate_hz;
    m->chirp_start_hz = s->chirp_start_hz;
    m->chirp_stop_hz = s->chirp_stop_hz;
    m->chirp_duration_s = s->chirp_duration_s;
    m->chirp_sine = s->chirp_sine;
    m->chirp_alternates = s->chirp_alternates;
    m->together = (uint32_t)s->together; /* bounded by survey_check, as the next one */
    m->continuous = s->continuous;
    m->slot_samples = (uint32_t)s->slot_samples;
    m->latency_samples = s->latency_samples;
    m->n_stage_positions_m = s->n_positions;
    m->stage_positions_m = s->stage_positions_m;
    m->gate_near_m = s->has_gate ? s->gate_m[0] : NAN;
    m->gate_far_m = s->has_gate ? s->gate_m[1] : NAN;
    m->n_volume = s->has_volume ? 9 : 0;
    m->volume = (double *)(uintptr_t)&s->volume_m[0][0]; /* packing only reads */
    m->has_wall = s->has_wall;
    m->wall_distance_m = s->wall_distance_m;
    m->has_mount = s->has_mount;
    m->n_walls = 6 * s->n_walls;
    m->walls = (double *)(uintptr_t)s->walls; /* packing only reads */
    m->n_wall_ends = survey_walls_end(s) ? 2 * (s->n_walls ? s->n_walls : 1) : 0;
    m->wall_ends = (double *)(uintptr_t)s->wall_ends_m;
    if (s->pings_m) {
        m->n_pings_m = 6 * s->n_positions;
        m->pings_m = s->pings_m[0][0];
    }
}

int survey_pack(const struct survey *s, uint8_t **out, size_t *size)
{
    int err = survey_check(s, NULL);
    if (err)
        return err;
    Anlos__Survey m = ANLOS__SURVEY__INIT;
    Anlos__Vec3 axis = vec3(s->stage_axis), normal = vec3(s->wall_normal);
    Anlos__Vec3 origin = vec3(s->mount_origin_m);
    Anlos__Vec3 x_axis = vec3(s->mount_x_axis), y_axis = vec3(s->mount_y_axis);
    struct tensor_view replica;
    fill_numbers(&m, s);
    if (s->n_replica)
        m.replica = tensor_borrow_f32(&replica, s->replica, 1, s->n_replica);
    m.stage_axis = &axis;
    m.wall_normal = s->has_wall ? &normal : NULL;
    m.mount_origin_m = s->has_mount ? &origin : NULL;
    m.mount_x_axis = s->has_mount ? &x_axis : NULL;
    m.mount_y_axis = s->has_mount ? &y_axis : NULL;
    m.n_speakers_m = s->n_speakers;
    m.speakers_m = vec3_list(s->speakers_m, s->n_speakers);
    m.n_microphones_m = s->n_microphones;
    m.microphones_m = vec3_list(s->microphones_m, s->n_microphones);
    m.n_responses = s->n_responses;
    m.responses = response_list(s);
    uint8_t *bytes = NULL;
    if (m.speakers_m && m.microphones_m && m.responses)
        bytes = malloc(anlos__survey__get_packed_size(&m));
    if (bytes) {
        *size = anlos__survey__pack(&m, bytes);
        *out = bytes;
    }
    free(m.speakers_m);
    free(m.microphones_m);
    free(m.responses);
    return bytes ? 0 : -ENOMEM;
}

static int take_vec3(double out[3], const Anlos__Vec3 *v, const char *field,
                     struct error *why)
{
    if (!v)
        return error_say(why, -EINVAL, "survey message: %s is missing", field);
    out[0] = v->x;
    out[1] = v->y;
    out[2] = v->z;
    return 0;
}

static int take_vec3_list(double (**out)[3], size_t *n_out, Anlos__Vec3 *const *list,
                          size_t n, const char *field, struct error *why)
{
    if (n < 1 || n > SURVEY_MAX_ELEMENTS)
        return error_say(why, -EINVAL,
                         "survey message: %s has %zu elements, expected 1 to %d", field,
                         n, SURVEY_MAX_ELEMENTS);
    *out = malloc(n * sizeof **out);
    if (!*out)
        return error_say(why, -ENOMEM, "survey message: out of memory");
    *n_out = n;
    int err = 0;
    for (size_t i = 0; !err && i < n; i++)
        err = take_vec3((*out)[i], list[i], field, why);
    return err;
}

static int take_numbers(double **out, const double *from, size_t n, int most,
                        const char *field, struct error *why)
{
    if (n < 1 || n > (size_t)most)
        return error_say(why, -EINVAL,
                         "survey message: %s has %zu elements, expected 1 to %d", field,
                         n, most);
    *out = malloc(n * sizeof **out);
    if (!*out)
        return error_say(why, -ENOMEM, "survey message: out of memory");
    memcpy(*out, from, n * sizeof **out);
    return 0;
}

static int take_response(struct survey_response *r, const Anlos__MicrophoneResponse *m,
                         struct error *why)
{
    size_t length = strlen(m->serial);
    if (length >= sizeof r->serial || m->n_frequency_hz != m->n_gain_db)
        return error_say(why, -EINVAL,
                         "survey message: calibration \"%.40s\" has %zu frequencies and "
                         "%zu gains, expected as many, and a serial under %zu characters",
                         m->serial, m->n_frequency_hz, m->n_gain_db, sizeof r->serial);
    memcpy(r->serial, m->serial, length + 1);
    int err = take_numbers(&r->frequency_hz, m->frequency_hz, m->n_frequency_hz,
                           SURVEY_MAX_ELEMENTS, "calibration", why);
    if (!err)
        err = take_numbers(&r->gain_db, m->gain_db, m->n_gain_db, SURVEY_MAX_ELEMENTS,
                           "calibration", why);
    r->n_points = m->n_frequency_hz;
    return err;
}

static int take_responses(struct survey *s, const Anlos__Survey *m, struct error *why)
{
    if (!m->n_responses)
        return 0;
    if (m->n_responses > SURVEY_MAX_ELEMENTS)
        return error_say(
            why, -EINVAL,
            "survey message: calibration of %zu microphones, expected up to %d",
            m->n_responses, SURVEY_MAX_ELEMENTS);
    s->responses = calloc(m->n_responses, sizeof *s->responses);
    if (!s->responses)
        return error_say(why, -ENOMEM, "survey message: out of memory");
    s->n_responses = m->n_responses;
    int err = 0;
    for (size_t i = 0; !err && i < m->n_responses; i++)
        err = take_response(&s->responses[i], m->responses[i], why);
    return err;
}

/* NaN stands for a gate that is not given; half a gate is an error, which survey_check
 * finds. */
static void take_scalars(struct survey *s, const Anlos__Survey *m)
{
    s->source = (enum survey_source)m->source;
    s->sound_speed_m_s = m->sound_speed_m_s;
    s->temperature_c = m->temperature_c;
    s->sample_rate_hz = m->sample_rate_hz;
    s->chirp_start_hz = m->chirp_start_hz;
    s->chirp_stop_hz = m->chirp_stop_hz;
    s->chirp_duration_s = m->chirp_duration_s;
    s->chirp_sine = m->chirp_sine;
    s->chirp_alternates = m->chirp_alternates;
    s->together = m->together;
    s->continuous = m->continuous;
    s->slot_samples = m->slot_samples;
    s->latency_samples = m->latency_samples;
    s->has_gate = !isnan(m->gate_near_m) || !isnan(m->gate_far_m);
    s->gate_m[0] = s->has_gate ? m->gate_near_m : 0;
    s->gate_m[1] = s->has_gate ? m->gate_far_m : 0;
    s->has_wall = m->has_wall;
    s->wall_distance_m = m->has_wall ? m->wall_distance_m : 0;
    s->has_mount = m->has_mount;
}

/* struct survey_wall is the six numbers of the message, in their order. */
static int take_walls(struct survey *s, const Anlos__Survey *m, struct error *why)
{
    _Static_assert(sizeof s->walls[0] == 6 * sizeof(double), "numbers and no gaps");
    if (m->n_walls % 6 || m->n_walls / 6 > SURVEY_MAX_WALLS)
        return error_say(why, -EINVAL,
                         "survey message: walls has %zu numbers, expected 6 for each of "
                         "up to %d",
                         m->n_walls, SURVEY_MAX_WALLS);
    s->n_walls = m->n_walls / 6;
    for (size_t i = 0; i < s->n_walls; i++)
        memcpy(&s->walls[i], &m->walls[6 * i], sizeof s->walls[i]);
    size_t n_ends = 2 * (s->n_walls ? s->n_walls : 1);
    if (m->n_wall_ends && m->n_wall_ends != n_ends)
        return error_say(
            why, -EINVAL,
            "survey message: wall_ends has %zu numbers, expected %zu or none",
            m->n_wall_ends, n_ends);
    for (size_t i = 0; i < m->n_wall_ends; i++)
        s->wall_ends_m[i / 2][i % 2] = m->wall_ends[i];
    return 0;
}

static int take_placement(struct survey *s, const Anlos__Survey *m, struct error *why)
{
    if (m->n_volume != 0 && m->n_volume != 9)
        return error_say(why, -EINVAL,
                         "survey message: volume has %zu numbers, expected 9",
                         m->n_volume);
    s->has_volume = m->n_volume == 9;
    if (s->has_volume)
        memcpy(s->volume_m, m->volume, sizeof s->volume_m);
    int err = take_vec3(s->stage_axis, m->stage_axis, "stage_axis", why);
    if (!err && m->has_wall)
        err = take_vec3(s->wall_normal, m->wall_normal, "wall_normal", why);
    if (!err)
        err = take_walls(s, m, why);
    if (!err && m->has_mount)
        err = take_vec3(s->mount_origin_m, m->mount_origin_m, "mount_origin_m", why);
    if (!err && m->has_mount)
        err = take_vec3(s->mount_x_axis, m->mount_x_axis, "mount_x_axis", why);
    if (!err && m->has_mount)
        err = take_vec3(s->mount_y_axis, m->mount_y_axis, "mount_y_axis", why);
    return err;
}

static int take_pings(struct survey *s, const Anlos__Survey *m, struct error *why)
{
    double *all = NULL;
    if (m->n_pings_m != 6 * s->n_positions)
        return error_say(
            why, -EINVAL,
            "survey message: pings_m has %zu numbers, expected 6 for each of "
            "%zu positions",
            m->n_pings_m, s->n_positions);
    int err = take_numbers(&all, m->pings_m, m->n_pings_m, 6 * SURVEY_MAX_PINGS,
                           "pings_m", why);
    s->pings_m = (double(*)[2][3])all;
    return err;
}

static int take_replica(struct survey *s, const Anlos__Tensor *t, struct error *why)
{
    size_t n;
    const float *x = tensor_f32(t, 1, &n);
    if (!x)
        return error_say(why, -EINVAL, "survey message: replica is no f32 of one axis");
    s->replica = malloc(n * sizeof *s->replica);
    if (!s->replica)
        return error_say(why, -ENOMEM, "survey message: out of memory");
    memcpy(s->replica, x, n * sizeof *x);
    s->n_replica = n;
    return 0;
}

static int take_message(struct survey *s, const Anlos__Survey *m, struct error *why)
{
    memset(s, 0, sizeof *s);
    take_scalars(s, m);
    int err = take_placement(s, m, why);
    if (!err)
        err = take_vec3_list(&s->speakers_m, &s->n_speakers, m->speakers_m,
                             m->n_speakers_m, "speakers_m", why);
    if (!err)
        err = take_vec3_list(&s->microphones_m, &s->n_microphones, m->microphones_m,
                             m->n_microphones_m, "microphones_m", why);
    if (!err)
        err = take_numbers(&s->stage_positions_m, m->stage_positions_m,
                           m->n_stage_positions_m,
                           m->n_pings_m ? SURVEY_MAX_PINGS : SURVEY_MAX_ELEMENTS,
                           "stage_positions_m", why);
    if (!err)
        s->n_positions = m->n_stage_positions_m;
    if (!err && m->n_pings_m)
        err = take_pings(s, m, why);
    if (!err && m->replica)
        err = take_replica(s, m->replica, why);
    if (!err)
        err = take_responses(s, m, why);
    if (!err)
        err = survey_check(s, why);
    if (err)
        survey_clear(s);
    return err;
}

int survey_from_message(struct survey *s, const Anlos__Survey *m, struct error *why)
{
    int err = take_message(s, m, why);

    if (err || m->id == survey_id(s))
        return err;
    error_say(why, -EINVAL,
              "survey message: id %016llx is not that of its content, %016llx",
              (unsigned long long)m->id, (unsigned long long)survey_id(s));
    survey_clear(s);
    return -EINVAL;
}

void survey_complete_id(Anlos__Survey *m)
{
    struct survey s;

    if (m->id || take_message(&s, m, NULL))
        return;
    m->id = survey_id(&s);
    survey_clear(&s);
}

/* -- a ping, and what becomes of it ----------------------------------------------------
 */

void ping_from_message(struct ping *p, const Anlos__Ping *m, int64_t capture_ns)
{
    size_t extents[2] = {0};
    const float *samples = m->samples ? tensor_f32(m->samples, 2, extents) : NULL;

    *p = (struct ping){.survey_id = m->survey_id,
                       .capture_ns = capture_ns,
                       .scan = m->scan,
                       .frame = m->frame,
                       .pass = (enum pass)m->pass,
                       .position = m->position,
                       .speaker = m->speaker,
                       .stage_m = m->stage_m,
                       .temperature_c = m->temperature_c,
                       .down = m->down,
                       .valid = m->valid};
    if (!samples || m->n_clipped != extents[0] || m->n_not_finite != extents[0])
        return;
    p->n_microphones = extents[0];
    p->n_samples = extents[1];
    p->samples = samples;
    p->clipped = m->clipped;
    p->not_finite = m->not_finite;
}

void traces_to_message(const struct traces *t, protobuf_c_boolean *masked,
                       struct tensor_view *view, Anlos__Traces *m)
{
    anlos__traces__init(m);
    m->survey_id = t->survey_id;
    m->scan = t->scan;
    m->frame = t->frame;
    m->position = t->position;
    m->stage_m = t->stage_m;
    m->speaker = t->speaker;
    m->samples =
        tensor_borrow_c64(view, t->samples, 2, t->n_microphones, t->format.n_samples);
    m->t0_s = t->format.t0_s;
    m->rate_hz = t->format.rate_hz;
    m->carrier_hz = t->format.carrier_hz;
    for (size_t i = 0; i < t->n_microphones; i++)
        masked[i] = t->masked[i];
    m->n_masked = t->n_microphones;
    m->masked = masked;
    m->background_subtracted = t->background_subtracted;
    m->blanked = t->blanked;
    m->clipped_samples = t->clipped_samples;
    m->temperature_c = t->temperature_c;
    m->down = t->down;
}

void traces_from_message(struct traces *t, struct traces_room *room,
                         const Anlos__Traces *m, int64_t capture_ns)
{
    size_t extents[2] = {0};
    const float complex *samples = m->samples ? tensor_c64(m->samples, 2, extents) : NULL;

    *t = (struct traces){.survey_id = m->survey_id,
                         .capture_ns = capture_ns,
                         .scan = m->scan,
                         .frame = m->frame,
                         .position = m->position,
                         .speaker = m->speaker,
                         .stage_m = m->stage_m,
                         .temperature_c = m->temperature_c,
                         .down = m->down,
                         .background_subtracted = m->background_subtracted,
                         .blanked = m->blanked,
                         .clipped_samples = m->clipped_samples,
                         .format = {.n_samples = extents[1],
                                    .t0_s = m->t0_s,
                                    .rate_hz = m->rate_hz,
                                    .carrier_hz = m->carrier_hz}};
    if (!samples || m->n_masked != extents[0] || extents[0] > SURVEY_MAX_ELEMENTS)
        return;
    for (size_t i = 0; i < extents[0]; i++)
        room->masked[i] = m->masked[i];
    t->n_microphones = extents[0];
    t->samples = samples;
    t->masked = room->masked;
}

/* -- an image --------------------------------------------------------------------------
 */

/* Beyond these it is no image of sound, and what draws axes would never come to an end.
 */
#define FARTHEST_M 1e4
#define FINEST_M   1e-6

static Anlos__Tensor *set_movers(struct tensor_view *view,
                                 const struct volume_mover *movers, size_t n)
{
    return tensor_borrow_f32(view, movers->at_m, 2, n, sizeof *movers / sizeof(float));
}

void volume_to_message(const struct volume *v, struct volume_view *view, Anlos__Volume *m)
{
    const struct grid *g = &v->grid;

    anlos__volume__init(m);
    m->survey_id = v->survey_id;
    m->scan = v->scan;
    m->frame = v->frame;
    m->preview = v->preview;
    m->intensity =
        tensor_borrow_f32(&view->intensity, v->intensity, 3, g->n[2], g->n[1], g->n[0]);
    m->origin_m = set_vec3(&view->origin, g->origin_m);
    m->step_m = set_vec3(&view->step, g->step_m);
    m->method = (char *)(uintptr_t)v->method; /* packing only reads */
    m->pings_used = (uint32_t)v->pings_used;
    m->age_s = v->age_s;
    m->pings_expected = (uint32_t)v->pings_expected;
    m->pings_blanked = (uint32_t)v->pings_blanked;
    m->microphones_masked = (uint32_t)v->microphones_masked;
    m->clipped_samples = v->clipped_samples;
    m->source = (Anlos__Source)v->source;
    m->sound_speed_m_s = v->sound_speed_m_s;
    m->standing_left = v->standing_left;
    m->standing_taken = v->standing_taken;
    if (v->newest) {
        const struct grid *b = &v->blocks;
        m->newest =
            tensor_borrow_f32(&view->newest, v->newest, 3, b->n[2], b->n[1], b->n[0]);
        m->newest_origin_m = set_vec3(&view->newest_origin, b->origin_m);
        m->newest_step_m = set_vec3(&view->newest_step, b->step_m);
    }
    if (v->n_movers)
        m->movers = set_movers(&view->movers, v->movers, v->n_movers);
    if (v->n_ambiguous)
        m->ambiguous = set_movers(&view->ambiguous, v->ambiguous, v->n_ambiguous);
    if (v->n_courses)
        m->courses = tensor_borrow_f32(&view->courses, v->courses->mover.at_m, 2,
                                       v->n_courses, sizeof *v->courses / sizeof(float));
    if (v->around.intensity) {
        const struct surroundings_view *a = &v->around;
        const struct grid *c = &a->grid;
        m->coarse =
            tensor_borrow_f32(&view->coarse, a->intensity, 3, c->n[2], c->n[1], c->n[0]);
        m->coarse_origin_m = set_vec3(&view->coarse_origin, c->origin_m);
        m->coarse_step_m = set_vec3(&view->coarse_step, c->step_m);
        if (a->n_spots)
            m->beyond =
                tensor_borrow_f32(&view->beyond, a->spots[0], 2, a->n_spots, (size_t)4);
    }
}

static int read_vec3(const Anlos__Vec3 *v, double out[3])
{
    if (!v || !isfinite(v->x) || !isfinite(v->y) || !isfinite(v->z))
        return -1;
    out[0] = v->x;
    out[1] = v->y;
    out[2] = v->z;
    return 0;
}

static const float *image_grid(const Anlos__Tensor *image, const Anlos__Vec3 *origin_m,
                               const Anlos__Vec3 *step_m, struct grid *out)
{
    size_t extents[3];
    const float *x = image ? tensor_f32(image, 3, extents) : NULL;

    if (!x || read_vec3(origin_m, out->origin_m) || read_vec3(step_m, out->step_m))
        return NULL;
    for (int i = 0; i < 3; i++) {
        out->n[i] = extents[2 - i];
        if (!(fabs(out->origin_m[i]) <= FARTHEST_M && out->step_m[i] >= FINEST_M &&
              (double)out->n[i] * out->step_m[i] <= FARTHEST_M))
            return NULL;
    }
    return x;
}

const float *volume_grid(const Anlos__Volume *v, struct grid *out)
{
    return image_grid(v->intensity, v->origin_m, v->step_m, out);
}

static void around_from_message(struct surroundings_view *a, const Anlos__Volume *m)
{
    size_t extents[2] = {0, 4};
    const float *spots = m->beyond ? tensor_f32(m->beyond, 2, extents) : NULL;

    if ((m->beyond && !spots) || extents[1] != 4 || extents[0] > SURROUNDINGS_SPOTS)
        return;
    for (size_t i = 0; i < 4 * extents[0]; i++)
        if (!(fabsf(spots[i]) <= (i % 4 < 3 ? FARTHEST_M : FLT_MAX)) ||
            (i % 4 == 3 && spots[i] < 0.0f))
            return;
    a->intensity = image_grid(m->coarse, m->coarse_origin_m, m->coarse_step_m, &a->grid);
    a->n_spots = extents[0];
    a->spots = (const float(*)[4])spots;
}

/* Of so many numbers each; *n of them, 0 where they are none. */
static const void *rows_from_message(const Anlos__Tensor *m, size_t size, size_t *n)
{
    size_t extents[2];
    const float *rows = m ? tensor_f32(m, 2, extents) : NULL;
    bool sound = rows && extents[0] <= VOLUME_MOVERS &&
                 extents[1] == size / sizeof(float);

    *n = sound ? extents[0] : 0;
    return rows;
}

static size_t movers_from_message(const Anlos__Tensor *m,
                                  const struct volume_mover **movers)
{
    size_t n;

    *movers = rows_from_message(m, sizeof **movers, &n);
    for (size_t i = 0; i < n; i++)
        if (!volume_mover_is_sound(*movers + i))
            return 0;
    return n;
}

static size_t courses_from_message(const Anlos__Tensor *m,
                                   const struct volume_course **courses)
{
    size_t n;

    *courses = rows_from_message(m, sizeof **courses, &n);
    for (size_t i = 0; i < n; i++)
        if (!volume_course_is_sound(*courses + i))
            return 0;
    return n;
}

void volume_from_message(struct volume *v, const Anlos__Volume *m, int64_t capture_ns)
{
    *v = (struct volume){.survey_id = m->survey_id,
                         .capture_ns = capture_ns,
                         .scan = m->scan,
                         .frame = m->frame,
                         .method = m->method,
                         .source = (enum survey_source)m->source,
                         .sound_speed_m_s = m->sound_speed_m_s,
                         .preview = m->preview,
                         .pings_used = m->pings_used,
                         .age_s = m->age_s,
                         .pings_expected = m->pings_expected,
                         .pings_blanked = m->pings_blanked,
                         .microphones_masked = m->microphones_masked,
                         .clipped_samples = m->clipped_samples,
                         .standing_left = m->standing_left,
                         .standing_taken = m->standing_taken};
    v->intensity = volume_grid(m, &v->grid);
    v->newest = image_grid(m->newest, m->newest_origin_m, m->newest_step_m, &v->blocks);
    if (v->newest && v->intensity && grid_size(&v->blocks) > grid_size(&v->grid))
        v->newest = NULL;
    if (m->coarse)
        around_from_message(&v->around, m);
    v->n_movers = movers_from_message(m->movers, &v->movers);
    v->n_ambiguous = movers_from_message(m->ambiguous, &v->ambiguous);
    v->n_courses = courses_from_message(m->courses, &v->courses);
}

/* -- objects ---------------------------------------------------------------------------
 */

_Static_assert(SHAPE_POINT == (int)ANLOS__SHAPE__POINT &&
                   SHAPE_PLATE == (int)ANLOS__SHAPE__PLATE &&
                   SHAPE_EXTENDED == (int)ANLOS__SHAPE__EXTENDED &&
                   MULTIPATH_NONE == (int)ANLOS__MULTIPATH__NO_MULTIPATH &&
                   MULTIPATH_PAIR == (int)ANLOS__MULTIPATH__OF_A_PAIR &&
                   MULTIPATH_FACE == (int)ANLOS__MULTIPATH__BY_A_FACE &&
                   MULTIPATH_SHADOW == (int)ANLOS__MULTIPATH__IN_A_SHADOW &&
                   TRACK_NEW == (int)ANLOS__MEASUREMENT__NEW &&
                   TRACK_MEASURED == (int)ANLOS__MEASUREMENT__MEASURED &&
                   TRACK_PREDICTED == (int)ANLOS__MEASUREMENT__PREDICTED &&
                   TRACK_DELETED == (int)ANLOS__MEASUREMENT__DELETED &&
                   TRACK_MOTION_UNKNOWN == (int)ANLOS__MOTION__MOTION_UNKNOWN &&
                   TRACK_STANDING == (int)ANLOS__MOTION__STANDING &&
                   TRACK_MOVING == (int)ANLOS__MOTION__MOVING,
               "");

static Anlos__Vec3 *new_vec3(const double v[3])
{
    Anlos__Vec3 *m = malloc(sizeof *m);

    return m ? set_vec3(m, v) : NULL;
}

static double *copy_numbers(const double *values, size_t n)
{
    double *copy = malloc(n * sizeof *copy);

    return copy ? memcpy(copy, values, n * sizeof *copy) : NULL;
}

static int fill_place(Anlos__Detection *m, const struct object *o)
{
    m->position_m = new_vec3(o->place.position_m);
    m->extent_m = new_vec3(o->place.extent_m);
    m->covariance_m2 = copy_numbers(o->place.covariance_m2, 6);
    if (!m->position_m || !m->extent_m || !m->covariance_m2)
        return -ENOMEM;
    m->n_covariance_m2 = 6;
    if (!o->tracked)
        return 0;
    m->velocity_m_s = copy_numbers(o->velocity_m_s, 2);
    m->velocity_covariance_m2_s2 = copy_numbers(o->velocity_m2_s2, 3);
    if (!m->velocity_m_s || !m->velocity_covariance_m2_s2)
        return -ENOMEM;
    m->n_velocity_m_s = 2;
    m->n_velocity_covariance_m2_s2 = 3;
    return 0;
}

static int fill_multipath(Anlos__Detection *m, const struct object *o)
{
    m->multipath = (Anlos__Multipath)o->multipath;
    m->multipath_of = malloc(sizeof o->of);
    if (!m->multipath_of)
        return -ENOMEM;
    memcpy(m->multipath_of, o->of, sizeof o->of);
    m->n_multipath_of = o->of[1] == o->of[0] ? 1 : 2;
    return 0;
}

static int fill(Anlos__Detection *m, const struct object *o)
{
    m->id = o->id;
    m->existence = o->existence;
    m->level_db = o->level_db;
    m->shape = (Anlos__Shape)o->shape.shape;
    m->shape_probability = o->shape.probability;
    m->wall = o->place.wall;
    m->behind_no_wall = o->place.behind_no_wall;
    m->in_free_view = o->place.in_free_view;
    m->height_assumed = o->place.height_assumed;
    m->at_border = o->at_border;
    m->measurement = (Anlos__Measurement)o->state;
    m->motion = (Anlos__Motion)o->motion;
    m->age_s = o->age_s;
    m->unseen_s = o->unseen_s;
    m->virtual_m = new_vec3(o->virtual_m);
    int err = m->virtual_m ? 0 : -ENOMEM;
    if (!err && o->placed)
        err = fill_place(m, o);
    return err || !o->multipath ? err : fill_multipath(m, o);
}

static int fill_views(Anlos__DetectionList *m, const struct field_of_view *view)
{
    m->views = calloc(view->n ? view->n : 1, sizeof *m->views);
    if (!m->views)
        return -ENOMEM;
    for (size_t i = 0; i < view->n; i++) {
        const struct view_area *from = &view->areas[i];
        Anlos__ViewArea *a = malloc(sizeof *a);
        if (!a)
            return -ENOMEM;
        anlos__view_area__init(a);
        m->views[m->n_views++] = a;
        a->wall = from->wall;
        a->corners_m = malloc(2 * from->n * sizeof *a->corners_m);
        if (!a->corners_m)
            return -ENOMEM;
        a->n_corners_m = 2 * from->n;
        memcpy(a->corners_m, from->corners_m, 2 * from->n * sizeof *a->corners_m);
    }
    return 0;
}

int detections_from_objects(Anlos__DetectionList **out, const struct object_list *list)
{
    Anlos__DetectionList *m = malloc(sizeof *m);

    if (!m)
        return -ENOMEM;
    anlos__detection_list__init(m);
    m->scan = list->scan;
    m->frame = list->frame;
    m->counter = list->counter;
    m->preview = list->preview;
    m->mirrored = list->mirrored;
    m->in_vehicle_frame = list->in_vehicle_frame;
    m->tracked = list->tracked;
    m->ego_unknown = list->ego_unknown;
    m->source = (Anlos__Source)list->source;
    m->temperature_c = list->temperature_c;
    m->sound_speed_m_s = list->sound_speed_m_s;
    m->detections = calloc(list->n ? list->n : 1, sizeof(Anlos__Detection *));
    if (!m->detections)
        goto fail;
    for (size_t i = 0; i < list->n; i++) {
        Anlos__Detection *d = malloc(sizeof *d);
        if (!d)
            goto fail;
        anlos__detection__init(d);
        m->detections[m->n_detections++] = d;
        if (fill(d, &list->objects[i]))
            goto fail;
    }
    if (fill_views(m, &list->view))
        goto fail;
    *out = m;
    return 0;
fail:
    detections_free(m);
    return -ENOMEM;
}

void detections_free(Anlos__DetectionList *list)
{
    if (!list)
        return;
    for (size_t i = 0; i < list->n_detections; i++) {
        Anlos__Detection *m = list->detections[i];
        free(m->position_m);
        free(m->virtual_m);
        free(m->extent_m);
        free(m->covariance_m2);
        free(m->velocity_m_s);
        free(m->velocity_covariance_m2_s2);
        free(m->multipath_of);
        free(m);
    }
    for (size_t i = 0; i < list->n_views; i++) {
        free(list->views[i]->corners_m);
        free(list->views[i]);
    }
    free(list->views);
    free(list->detections);
    free(list);
}

/* -- walls, and what arrived of a ping -------------------------------------------------
 */

static int take_wall(struct wall_gate *out, const Anlos__Wall *m, struct error *why)
{
    if (!m->normal)
        return error_say(why, -EINVAL, "a wall without id, normal or distance");
    if (m->n_covariance != 0 && m->n_covariance != 6)
        return error_say(why, -EINVAL, "wall %u has a covariance that is none", m->id);
    if (m->n_ends_m != 0 && m->n_ends_m != 2)
        return error_say(why, -EINVAL, "wall %u has %zu ends, expected 2 or none", m->id,
                         m->n_ends_m);
    *out =
        (struct wall_gate){.id = m->id,
                           .plane = {.normal = {m->normal->x, m->normal->y, m->normal->z},
                                     .distance_m = m->distance_m},
                           .gate_m = {m->gate_near_m, m->gate_far_m}};
    if (m->n_covariance)
        memcpy(out->plane.covariance, m->covariance, sizeof out->plane.covariance);
    if (m->n_ends_m)
        memcpy(out->plane.ends_m, m->ends_m, sizeof out->plane.ends_m);
    return 0;
}

static int take_corners(struct walls *out, const Anlos__WallList *m, struct error *why)
{
    if (m->n_free_view_m % 2 || m->n_free_view_m > 2 * WALLS_MAX_CORNERS)
        return error_say(why, -EINVAL,
                         "free view has %zu numbers, expected x and z of up "
                         "to %d corners",
                         m->n_free_view_m, WALLS_MAX_CORNERS);
    out->n_corners = m->n_free_view_m / 2;
    for (size_t i = 0; i < m->n_free_view_m; i++)
        out->free_view_m[i / 2][i % 2] = m->free_view_m[i];
    return 0;
}

int walls_from_message(struct walls *out, const Anlos__WallList *m, struct error *why)
{
    struct walls w = {.n = m->n_walls};
    if (m->n_walls > WALLS_MAX)
        return error_say(why, -EINVAL, "%zu walls, expected at most %d", m->n_walls,
                         WALLS_MAX);
    int err = take_corners(&w, m, why);
    for (size_t i = 0; !err && i < m->n_walls; i++) {
        double said = m->walls[i]->existence; /* 0: it is not */
        err = take_wall(&w.list[i], m->walls[i], why);
        w.existence[i] = said > 0.0 ? fmin(said, 1.0) : 1.0;
        w.unseen_s[i] = m->walls[i]->unseen_s;
        w.origin[i] = (enum wall_origin)m->walls[i]->origin;
    }
    if (!err)
        err = walls_check(&w, why);
    if (err)
        return err;
    walls_normalise(&w);
    *out = w;
    return 0;
}

static Anlos__Wall *set_wall(const struct walls *w, size_t i, struct walls_view *view)
{
    const struct wall_gate *from = &w->list[i];
    Anlos__Wall *m = &view->walls[i];

    anlos__wall__init(m);
    m->id = from->id;
    m->origin = (Anlos__Wall__Origin)w->origin[i];
    m->normal = set_vec3(&view->normals[i], from->plane.normal);
    m->distance_m = from->plane.distance_m;
    m->gate_near_m = from->gate_m[0];
    m->gate_far_m = from->gate_m[1];
    m->existence = w->existence[i];
    m->unseen_s = w->unseen_s[i];
    if (w->origin[i] != WALL_CONFIGURED) {
        m->n_covariance = 6;
        m->covariance =
            (double *)(uintptr_t)from->plane.covariance; /* packing only reads */
    }
    if (wall_ends(&from->plane)) {
        m->n_ends_m = 2;
        m->ends_m = (double *)(uintptr_t)from->plane.ends_m;
    }
    return m;
}

void walls_to_message(const struct walls *w, const char *text, struct walls_view *view,
                      Anlos__WallList *m)
{
    anlos__wall_list__init(m);
    for (size_t i = 0; i < w->n; i++)
        view->each[i] = set_wall(w, i, view);
    m->n_walls = w->n;
    m->walls = view->each;
    m->text = (char *)(uintptr_t)text; /* packing only reads */
    m->n_free_view_m = 2 * w->n_corners;
    m->free_view_m = (double *)(uintptr_t)w->free_view_m;
}

void returns_room_clear(struct returns_room *room)
{
    free(room->at);
    free(room->heard);
    free(room->arrivals);
    free(room->path_m);
    free(room->amplitude);
    *room = (struct returns_room){.n = 0};
}

static int make_room(struct returns_room *room, size_t n)
{
    if (room->n >= n)
        return 0;
    returns_room_clear(room);
    room->at = calloc(n, sizeof *room->at);
    room->heard = calloc(n, sizeof *room->heard);
    room->arrivals = calloc(n, sizeof *room->arrivals);
    room->path_m = calloc(n, WALL_PEAKS * sizeof *room->path_m);
    room->amplitude = calloc(n, WALL_PEAKS * sizeof *room->amplitude);
    if (!room->at || !room->heard || !room->arrivals || !room->path_m ||
        !room->amplitude) {
        returns_room_clear(room);
        return -ENOMEM;
    }
    room->n = n;
    return 0;
}

int returns_to_message(const struct wall_returns *r, struct returns_room *room,
                       Anlos__Echoes *m)
{
    size_t n = r->usable ? r->n_microphones : 0, total = 0;
    int err = make_room(room, n);

    if (err)
        return err;
    for (size_t i = 0; i < n; i++) {
        room->heard[i] = r->at[i].heard;
        room->arrivals[i] = r->at[i].n;
        for (size_t k = 0; k < r->at[i].n; k++, total++) {
            room->path_m[total] = r->at[i].peaks[k].path_m;
            room->amplitude[total] = r->at[i].peaks[k].amplitude;
        }
    }
    anlos__echoes__init(m);
    m->survey_id = r->ping.survey_id;
    m->scan = r->ping.scan;
    m->pass = r->ping.pass == PASS_BACKGROUND ? ANLOS__PASS__BACKGROUND
                                              : ANLOS__PASS__SCENE;
    m->position = r->ping.position;
    m->speaker = r->ping.speaker;
    m->down = r->ping.down;
    m->frame = r->ping.frame;
    m->usable = r->usable;
    m->n_heard = m->n_arrivals = n;
    m->heard = room->heard;
    m->arrivals = room->arrivals;
    m->n_path_m = m->n_amplitude = total;
    m->path_m = room->path_m;
    m->amplitude = room->amplitude;
    return 0;
}

static bool holds(const Anlos__Echoes *m)
{
    size_t total = 0;

    for (size_t i = 0; i < m->n_arrivals; i++) {
        if (m->arrivals[i] > WALL_PEAKS)
            return false;
        total += m->arrivals[i];
    }
    for (size_t k = 0; k < m->n_path_m && k < m->n_amplitude; k++)
        if (!isfinite(m->path_m[k]) || !(m->amplitude[k] > 0.0) ||
            !isfinite(m->amplitude[k]))
            return false;
    return m->n_heard == m->n_arrivals && m->n_path_m == total && m->n_amplitude == total;
}

int returns_from_message(struct wall_returns *r, struct returns_room *room,
                         const Anlos__Echoes *m, int64_t capture_ns)
{
    size_t n = m->n_heard, next = 0;
    int err = holds(m) ? make_room(room, n) : -EINVAL;

    if (err)
        return err;
    for (size_t i = 0; i < n; i++) {
        struct wall_arrivals *a = &room->at[i];
        *a = (struct wall_arrivals){.heard = m->heard[i], .n = m->arrivals[i]};
        for (size_t k = 0; k < a->n; k++, next++)
            a->peaks[k] = (struct wall_echo_peak){m->path_m[next], m->amplitude[next]};
    }
    *r = (struct wall_returns){.ping = {.survey_id = m->survey_id,
                                        .capture_ns = capture_ns,
                                        .scan = m->scan,
                                        .frame = m->frame,
                                        .pass = m->pass == ANLOS__PASS__BACKGROUND
                                                    ? PASS_BACKGROUND
                                                    : PASS_SCENE,
                                        .position = m->position,
                                        .speaker = m->speaker,
                                        .down = m->down,
                                        .valid = m->usable},
                               .usable = m->usable,
                               .n_microphones = n,
                               .at = room->at};
    return 0;
}

/* -- the vehicle -----------------------------------------------------------------------
 */

const struct ego_motion *ego_from_message(struct ego_motion *out,
                                          const Anlos__EgoMotion *m)
{
    *out = (struct ego_motion){m->standstill ? 0.0 : m->speed_m_s,
                               m->standstill ? 0.0 : m->yaw_rate_rad_s};
    return m->valid ? out : NULL;
}
