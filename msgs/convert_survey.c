/* SPDX-License-Identifier: MIT */
#include "msgs/convert.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/tensor.h"

static Anlos__Vec3 vec3(const double v[3])
{
    Anlos__Vec3 out = ANLOS__VEC3__INIT;
    out.x = v[0];
    out.y = v[1];
    out.z = v[2];
    return out;
}

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
