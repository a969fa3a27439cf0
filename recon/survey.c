/* SPDX-License-Identifier: MIT */
#include "recon/survey.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/hash.h"
#include "recon/geometry.h"

#define PRESSURE_PA 101325.0

/* Mole fraction of water in air of a relative humidity, 0..1: Giacomo's equations
 * (Metrologia 18 (1982) 33) for the pressure of saturated vapour and its enhancement, as
 * Cramer's appendix has them. */
static double water_fraction(double temperature_c, double humidity)
{
    const double t = temperature_c, kelvin = t + 273.15;
    double saturated_pa = exp(1.2811805e-5 * kelvin * kelvin - 1.9509874e-2 * kelvin +
                              34.04926034 - 6.3536311e3 / kelvin);
    double enhancement = 1.00062 + 3.14e-8 * PRESSURE_PA + 5.6e-7 * t * t;
    return humidity * enhancement * saturated_pa / PRESSURE_PA;
}

/* Cramer, J. Acoust. Soc. Am. 93 (1993) 2510, equation 15, for 1013.25 hPa and 400 ppm of
 * carbon dioxide.  His fit is for 0..30 C and up to 6 % of water; dry it stays within
 * 0.1 % of the ideal gas over -20..50 C. */
double survey_humid_sound_speed_m_s(double temperature_c, double humidity)
{
    const double t = temperature_c, p = PRESSURE_PA, xc = 400e-6;
    double xw = water_fraction(temperature_c, humidity);
    return 331.5024 + 0.603055 * t - 0.000528 * t * t +
           (51.471935 + 0.1495874 * t - 0.000782 * t * t) * xw +
           (-1.82e-7 + 3.73e-8 * t - 2.93e-10 * t * t) * p +
           (-85.20931 - 0.228525 * t + 5.91e-5 * t * t) * xc - 2.835149 * xw * xw -
           2.15e-13 * p * p + 29.179762 * xc * xc + 0.000486 * xw * p * xc;
}

double survey_sound_speed_m_s(double temperature_c)
{
    return survey_humid_sound_speed_m_s(temperature_c, 0);
}

/* A millionth of a sample is not a chirp that is too long. */
static bool chirp_fits(const struct survey *s, size_t n_samples)
{
    return s->chirp_duration_s * s->sample_rate_hz <= (double)n_samples + 1e-6;
}

bool survey_overlaps(const struct survey *s)
{
    return !chirp_fits(s, s->slot_samples);
}

size_t survey_slot_of(const struct survey *s, size_t k)
{
    return s->together > 1 ? k / s->together : k;
}

size_t survey_slots(const struct survey *s, size_t n)
{
    return n ? survey_slot_of(s, n - 1) + 1 : 0;
}

bool survey_round_fits(const struct survey *s, size_t n)
{
    return chirp_fits(s, survey_slots(s, n) * s->slot_samples);
}

static double round_s(const struct survey *s)
{
    return (double)survey_slots(s, s->n_speakers) * (double)s->slot_samples /
           s->sample_rate_hz;
}

double survey_speed_m_s(const struct survey *s)
{
    size_t last = s->n_positions - 1;
    if (!s->continuous || !last)
        return 0.0;
    return (s->stage_positions_m[last] - s->stage_positions_m[0]) /
           ((double)last * round_s(s));
}

double survey_duration_s(const struct survey *s)
{
    return (double)s->n_positions * round_s(s);
}

bool survey_is_down(const struct survey *s, size_t k)
{
    return s->chirp_alternates && k % 2;
}

static void hash_bytes(uint64_t *h, const void *data, size_t size)
{
    *h = hash_add(*h, data, size);
}

static void hash_counts(uint64_t *h, uint64_t n)
{
    hash_bytes(h, &n, sizeof n);
}

static void hash_numbers(uint64_t *h, const double *x, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        double value = x[i] == 0 ? 0 : x[i]; /* -0 equals 0 */
        hash_bytes(h, &value, sizeof value);
    }
}

bool survey_walls_end(const struct survey *s)
{
    bool end = false;

    for (size_t i = 0; s->has_wall && i < (s->n_walls ? s->n_walls : 1); i++)
        end |= s->wall_ends_m[i][0] != 0.0 || s->wall_ends_m[i][1] != 0.0;
    return end;
}

static void hash_placement(uint64_t *h, const struct survey *s)
{
    hash_counts(h, s->has_gate);
    if (s->has_gate)
        hash_numbers(h, s->gate_m, 2);
    hash_counts(h, s->has_volume);
    if (s->has_volume)
        hash_numbers(h, &s->volume_m[0][0], 9);
    hash_counts(h, s->has_wall);
    if (s->has_wall) {
        hash_numbers(h, s->wall_normal, 3);
        hash_numbers(h, &s->wall_distance_m, 1);
    }
    for (size_t i = 0; i < s->n_walls; i++) {
        hash_numbers(h, s->walls[i].normal, 3);
        hash_numbers(h, &s->walls[i].distance_m, 1);
        hash_numbers(h, s->walls[i].gate_m, 2);
    }
    if (survey_walls_end(s)) { /* walls without ends keep their ids */
        hash_bytes(h, "ends", 4);
        hash_numbers(h, s->wall_ends_m[0], 2 * (s->n_walls ? s->n_walls : 1));
    }
    hash_counts(h, s->has_mount);
    if (s->has_mount) {
        hash_numbers(h, s->mount_origin_m, 3);
        hash_numbers(h, s->mount_x_axis, 3);
        hash_numbers(h, s->mount_y_axis, 3);
    }
}

/* Nothing for surveys of stage and chirp: they keep their ids. */
static void hash_source(uint64_t *h, const struct survey *s)
{
    if (s->chirp_alternates)
        hash_bytes(h, "alternates", 10);
    if (s->together > 1) {
        hash_bytes(h, "together", 8);
        hash_counts(h, s->together);
    }
    if (s->continuous)
        hash_bytes(h, "continuous", 10);
    if (s->pings_m)
        hash_numbers(h, s->pings_m[0][0], 6 * s->n_positions);
    if (!s->n_replica)
        return;
    hash_counts(h, s->n_replica);
    for (size_t i = 0; i < s->n_replica; i++) {
        double value = (double)s->replica[i];
        hash_numbers(h, &value, 1);
    }
}

uint64_t survey_id(const struct survey *s)
{
    uint64_t h = HASH_BEGIN;
    const double numbers[] = {
        s->sound_speed_m_s,  s->sample_rate_hz,  s->chirp_start_hz,    s->chirp_stop_hz,
        s->chirp_duration_s, s->latency_samples, s->chirp_sine ? 1 : 0};
    hash_numbers(&h, numbers, sizeof numbers / sizeof *numbers);
    hash_counts(&h, s->slot_samples);
    hash_counts(&h, s->n_speakers);
    hash_numbers(&h, s->n_speakers ? s->speakers_m[0] : NULL, 3 * s->n_speakers);
    hash_counts(&h, s->n_microphones);
    hash_numbers(&h, s->n_microphones ? s->microphones_m[0] : NULL, 3 * s->n_microphones);
    hash_numbers(&h, s->stage_axis, 3);
    hash_counts(&h, s->n_positions);
    hash_numbers(&h, s->stage_positions_m, s->n_positions);
    hash_source(&h, s);
    hash_placement(&h, s);
    hash_counts(&h, s->n_responses);
    for (size_t i = 0; i < s->n_responses; i++) {
        const struct survey_response *r = &s->responses[i];
        hash_bytes(&h, r->serial, strnlen(r->serial, sizeof r->serial));
        hash_counts(&h, r->n_points);
        hash_numbers(&h, r->frequency_hz, r->n_points);
        hash_numbers(&h, r->gain_db, r->n_points);
    }
    return h ? h : 1;
}

static bool are_near(size_t n, const double (*a_m)[3], const double (*b_m)[3])
{
    for (size_t i = 0; i < n; i++)
        if (!(geometry_distance(a_m[i], b_m[i]) <= SURVEY_SAME_M))
            return false;
    return true;
}

bool survey_is_same_array(const struct survey *a, const struct survey *b)
{
    struct survey like = *b;

    if (a->n_speakers != b->n_speakers || a->n_microphones != b->n_microphones ||
        !are_near(a->n_speakers, (const double(*)[3])a->speakers_m,
                  (const double(*)[3])b->speakers_m) ||
        !are_near(a->n_microphones, (const double(*)[3])a->microphones_m,
                  (const double(*)[3])b->microphones_m))
        return false;
    like.speakers_m = a->speakers_m;
    like.microphones_m = a->microphones_m;
    like.sound_speed_m_s = a->sound_speed_m_s;
    memcpy(like.gate_m, a->gate_m, sizeof like.gate_m);
    return survey_id(&like) == survey_id(a);
}

static int copy_array(void *out, const void *from, size_t n, size_t element_size)
{
    void *copy = NULL;
    if (n) {
        copy = malloc(n * element_size); /* n came from an array of that size */
        if (!copy)
            return -ENOMEM;
        memcpy(copy, from, n * element_size);
    }
    memcpy(out, &copy, sizeof copy);
    return 0;
}

int survey_make_pings(struct survey *s, size_t n)
{
    s->n_speakers = s->n_microphones = 1;
    s->n_positions = n;
    s->stage_axis[0] = 1.0;
    s->speakers_m = calloc(1, sizeof *s->speakers_m);
    s->microphones_m = calloc(1, sizeof *s->microphones_m);
    s->stage_positions_m = calloc(n, sizeof *s->stage_positions_m);
    s->pings_m = calloc(n, sizeof *s->pings_m);
    return s->speakers_m && s->microphones_m && s->stage_positions_m && s->pings_m
               ? 0
               : -ENOMEM;
}

int survey_copy(struct survey *out, const struct survey *s)
{
    *out = *s;
    out->speakers_m = out->microphones_m = NULL;
    out->stage_positions_m = NULL;
    out->pings_m = NULL;
    out->replica = NULL;
    out->responses = NULL;
    out->n_responses = 0;
    if (copy_array(&out->speakers_m, s->speakers_m, s->n_speakers, sizeof(double[3])) ||
        copy_array(&out->microphones_m, s->microphones_m, s->n_microphones,
                   sizeof(double[3])) ||
        copy_array(&out->stage_positions_m, s->stage_positions_m, s->n_positions,
                   sizeof(double)) ||
        copy_array(&out->pings_m, s->pings_m, s->pings_m ? s->n_positions : 0,
                   sizeof *s->pings_m) ||
        copy_array(&out->replica, s->replica, s->n_replica, sizeof *s->replica))
        goto no_memory;
    out->responses = calloc(s->n_responses ? s->n_responses : 1, sizeof *out->responses);
    if (!out->responses)
        goto no_memory;
    for (size_t i = 0; i < s->n_responses; i++) {
        const struct survey_response *from = &s->responses[i];
        struct survey_response *to = &out->responses[i];
        out->n_responses = i + 1;
        memcpy(to->serial, from->serial, sizeof to->serial);
        to->n_points = from->n_points;
        if (copy_array(&to->frequency_hz, from->frequency_hz, from->n_points,
                       sizeof(double)) ||
            copy_array(&to->gain_db, from->gain_db, from->n_points, sizeof(double)))
            goto no_memory;
    }
    return 0;
no_memory:
    survey_clear(out);
    return -ENOMEM;
}

void survey_spread_positions(struct survey *s, size_t n)
{
    n = n < 2 ? 2 : n;
    if (n >= s->n_positions)
        return;
    double first_m = s->stage_positions_m[0];
    double way_m = s->stage_positions_m[s->n_positions - 1] - first_m;
    for (size_t k = 0; k < n; k++)
        s->stage_positions_m[k] = first_m + way_m * (double)k / (double)(n - 1);
    s->n_positions = n;
}

void survey_to_vehicle(const struct survey *s, const double p[3], double out[3])
{
    const double q[3] = {p[0], p[1], p[2]}; /* out may be p */
    if (!s->has_mount) {
        memcpy(out, q, sizeof q);
        return;
    }
    const double *x = s->mount_x_axis, *y = s->mount_y_axis;
    const double z[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2],
                         x[0] * y[1] - x[1] * y[0]};
    for (int i = 0; i < 3; i++)
        out[i] = s->mount_origin_m[i] + q[0] * x[i] + q[1] * y[i] + q[2] * z[i];
}

void survey_clear(struct survey *s)
{
    free(s->speakers_m);
    free(s->microphones_m);
    free(s->stage_positions_m);
    free(s->pings_m);
    free(s->replica);
    for (size_t i = 0; i < s->n_responses; i++) {
        free(s->responses[i].frequency_hz);
        free(s->responses[i].gain_db);
    }
    free(s->responses);
    memset(s, 0, sizeof *s);
}
