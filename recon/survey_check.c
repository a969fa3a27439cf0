/* SPDX-License-Identifier: MIT */
/* What survey_check accepts.  Each rule says its field and its limits. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "recon/survey.h"

#define MAX_DISTANCE_M       100.0 /* a survey in millimetres does not pass */
#define MAX_SLOT_SAMPLES     ((size_t)1 << 22)
#define MAX_OVERLAP          16   /* slots that a chirp may take */
#define LEAST_TIME_BANDWIDTH 10.0 /* of a chirp: under that its spectrum is no band */
#define SLOT_CLEARANCE_M     0.1  /* before the next emission: its sidelobes */
#define STEP_OFF_M           1e-4 /* of a continuous scan, from even steps */
#define MAX_STAGE_M_S        0.5  /* of one: recon/geometry.h */

static int check_range(struct error *why, const char *field, double x, double min,
                       double max, const char *unit)
{
    if (x >= min && x <= max) /* false for NaN */
        return 0;
    return error_say(why, -EINVAL, "%s is %g %s, expected %g to %g %s", field, x, unit,
                     min, max, unit);
}

static int check_point(struct error *why, const char *field, size_t index,
                       const double p[3])
{
    for (int i = 0; i < 3; i++)
        if (!(fabs(p[i]) <= MAX_DISTANCE_M))
            return error_say(
                why, -EINVAL,
                "%s[%zu] is [%g, %g, %g], expected coordinates within +-%g m", field,
                index, p[0], p[1], p[2], MAX_DISTANCE_M);
    return 0;
}

static int check_unit(struct error *why, const char *field, const double v[3])
{
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if (fabs(length - 1) <= SURVEY_UNIT_TOLERANCE)
        return 0;
    return error_say(why, -EINVAL,
                     "%s [%g, %g, %g] has the length %g, expected a unit vector", field,
                     v[0], v[1], v[2], length);
}

static int check_count(struct error *why, const char *field, size_t n, int most,
                       const void *array)
{
    if (n >= 1 && n <= (size_t)most && array)
        return 0;
    return error_say(why, -EINVAL, "%s has %zu elements, expected 1 to %d", field, n,
                     most);
}

static int check_medium(const struct survey *s, struct error *why)
{
    if (s->source != SURVEY_LIVE && s->source != SURVEY_REPLAY &&
        s->source != SURVEY_SIMULATION)
        return error_say(why, -EINVAL,
                         "source is %d, expected live, replay or simulation",
                         (int)s->source);
    int err = check_range(why, "sound_speed_m_s", s->sound_speed_m_s, 300, 360, "m/s");
    if (!err && !isnan(s->temperature_c))
        err = check_range(why, "temperature_c", s->temperature_c, -60, 80, "C");
    return err;
}

static int check_chirp(const struct survey *s, struct error *why)
{
    int err = check_range(why, "sample_rate_hz", s->sample_rate_hz, 8e3, 400e3, "Hz");
    if (err)
        return err;
    double nyquist_hz = s->sample_rate_hz / 2;
    const double ends_hz[2] = {s->chirp_start_hz, s->chirp_stop_hz};
    for (int i = 0; i < 2; i++)
        if (!(ends_hz[i] > 0 && ends_hz[i] < nyquist_hz))
            return error_say(why, -EINVAL,
                             "chirp %s_hz is %g, expected over 0 and under half the "
                             "sample rate, %g",
                             i ? "stop" : "start", ends_hz[i], nyquist_hz);
    if (s->chirp_start_hz == s->chirp_stop_hz)
        return error_say(why, -EINVAL, "chirp start_hz and stop_hz are both %g",
                         s->chirp_start_hz);
    if (s->slot_samples < 1 || s->slot_samples > MAX_SLOT_SAMPLES)
        return error_say(why, -EINVAL, "slot_samples is %zu, expected 1 to %zu",
                         s->slot_samples, MAX_SLOT_SAMPLES);
    double slot_s = (double)s->slot_samples / s->sample_rate_hz;
    if (!(s->chirp_duration_s > 0 && s->chirp_duration_s <= MAX_OVERLAP * slot_s))
        return error_say(why, -EINVAL,
                         "chirp duration_s is %g, expected over 0 and up to %d slots of "
                         "%g",
                         s->chirp_duration_s, MAX_OVERLAP, slot_s);
    double least_s = LEAST_TIME_BANDWIDTH / fabs(s->chirp_stop_hz - s->chirp_start_hz);
    if (!s->n_replica && s->chirp_duration_s < least_s)
        return error_say(
            why, -EINVAL,
            "chirp duration_s is %g, too short to sweep %g to %g Hz; expected "
            "at least %g",
            s->chirp_duration_s, s->chirp_start_hz, s->chirp_stop_hz, least_s);
    if (survey_overlaps(s) && !s->has_gate)
        return error_say(
            why, -EINVAL,
            "chirp duration_s is %g, expected over 0 and up to the slot, %g; "
            "or gate_m, for slots that overlap to be told apart by it",
            s->chirp_duration_s, slot_s);
    if (!(s->latency_samples >= 0 && s->latency_samples < (double)s->slot_samples))
        return error_say(why, -EINVAL,
                         "latency_samples is %g, expected 0 to under slot_samples, %zu",
                         s->latency_samples, s->slot_samples);
    return 0;
}

static int check_sharing(const struct survey *s, struct error *why)
{
    if (s->chirp_alternates && (s->n_replica || s->pings_m))
        return error_say(why, -EINVAL, "chirp alternates, but a %s has no direction",
                         s->n_replica ? "replica" : "recording of pings");
    if (s->together > 2)
        return error_say(why, -EINVAL, "together is %zu, expected 1 or 2", s->together);
    if (s->together == 2 && !s->chirp_alternates)
        return error_say(why, -EINVAL,
                         "together is 2, and only the chirp's direction can tell two "
                         "speakers apart; expected chirp.alternates: true");
    return 0;
}

static int check_replica(const struct survey *s, struct error *why)
{
    if (s->n_replica < 2 || s->n_replica > s->slot_samples || !s->replica)
        return error_say(why, -EINVAL,
                         "replica has %zu samples, expected 2 to slot_samples, %zu",
                         s->n_replica, s->slot_samples);
    float largest = 0.0f;
    for (size_t i = 0; i < s->n_replica; i++) {
        if (!isfinite(s->replica[i]))
            return error_say(why, -EINVAL, "replica sample %zu is not finite", i);
        largest = fmaxf(largest, fabsf(s->replica[i]));
    }
    return largest > 0.0f ? 0 : error_say(why, -EINVAL, "replica is silent");
}

static int check_pings(const struct survey *s, struct error *why)
{
    if (s->n_speakers != 1 || s->n_microphones != 1)
        return error_say(why, -EINVAL,
                         "pings have places of their own: expected one speaker and one "
                         "microphone, not %zu and %zu",
                         s->n_speakers, s->n_microphones);
    for (size_t k = 0; k < s->n_positions; k++) {
        int err = check_point(why, "pings speaker", k, s->pings_m[k][0]);
        if (!err)
            err = check_point(why, "pings microphone", k, s->pings_m[k][1]);
        if (err)
            return err;
    }
    return 0;
}

static int check_array(const struct survey *s, struct error *why)
{
    int err =
        check_count(why, "speakers_m", s->n_speakers, SURVEY_MAX_ELEMENTS, s->speakers_m);
    for (size_t i = 0; !err && i < s->n_speakers; i++)
        err = check_point(why, "speakers_m", i, s->speakers_m[i]);
    if (!err)
        err = check_count(why, "microphones_m", s->n_microphones, SURVEY_MAX_ELEMENTS,
                          s->microphones_m);
    for (size_t i = 0; !err && i < s->n_microphones; i++)
        err = check_point(why, "microphones_m", i, s->microphones_m[i]);
    if (!err)
        err = check_unit(why, "stage axis", s->stage_axis);
    if (!err)
        err = check_count(why, s->pings_m ? "pings" : "stage positions_m", s->n_positions,
                          s->pings_m ? SURVEY_MAX_PINGS : SURVEY_MAX_ELEMENTS,
                          s->stage_positions_m);
    for (size_t i = 0; !err && i < s->n_positions; i++)
        if (!(fabs(s->stage_positions_m[i]) <= MAX_DISTANCE_M))
            err = error_say(why, -EINVAL,
                            "stage positions_m[%zu] is %g, expected within +-%g m", i,
                            s->stage_positions_m[i], MAX_DISTANCE_M);
    if (!err && s->n_speakers * s->n_microphones > SURVEY_MAX_PATHS / s->n_positions)
        err = error_say(why, -EINVAL,
                        "%zu speakers, %zu microphones and %zu positions; expected at "
                        "most %zu paths of them all",
                        s->n_speakers, s->n_microphones, s->n_positions,
                        SURVEY_MAX_PATHS);
    return err;
}

/* A stage that does not stop goes at one speed, and no speaker's turn comes again before
 * its chirp is over. */
static int check_continuous(const struct survey *s, struct error *why)
{
    if (s->pings_m || s->n_positions < 2)
        return error_say(why, -EINVAL,
                         "stage continuous, but there is %s; expected positions_m of two "
                         "or more",
                         s->pings_m ? "a recording of pings" : "one position");
    double speed_m_s = survey_speed_m_s(s), last = (double)(s->n_positions - 1);
    double first_m = s->stage_positions_m[0];
    double step_m = (s->stage_positions_m[s->n_positions - 1] - first_m) / last;
    for (size_t k = 1; k < s->n_positions; k++)
        if (!(fabs(s->stage_positions_m[k] - first_m - (double)k * step_m) <= STEP_OFF_M))
            return error_say(why, -EINVAL,
                             "stage positions_m[%zu] is %g, but a continuous stage goes "
                             "at one speed; expected %g, for even steps",
                             k, s->stage_positions_m[k], first_m + (double)k * step_m);
    if (!(fabs(speed_m_s) > 0 && fabs(speed_m_s) <= MAX_STAGE_M_S))
        return error_say(
            why, -EINVAL,
            "stage positions_m are %g m apart, which in a round of %zu slots "
            "of %zu samples takes %g m/s; expected over 0 and up to %g",
            fabs(step_m), survey_slots(s, s->n_speakers), s->slot_samples,
            fabs(speed_m_s), MAX_STAGE_M_S);
    if (!survey_round_fits(s, s->n_speakers))
        return error_say(why, -EINVAL,
                         "chirp duration_s is %g, but a round of %zu slots is over "
                         "before; expected a longer slot_samples or a shorter chirp",
                         s->chirp_duration_s, survey_slots(s, s->n_speakers));
    return 0;
}

double survey_gate_limit_m(const struct survey *s)
{
    double slot_s = (double)s->slot_samples / s->sample_rate_hz;
    double limit_m = slot_s * s->sound_speed_m_s / 2;

    return survey_overlaps(s) ? limit_m - SLOT_CLEARANCE_M : limit_m;
}

static int check_gate(const struct survey *s, struct error *why)
{
    double far_m = s->gate_m[1], slot_s = (double)s->slot_samples / s->sample_rate_hz;
    double limit_m = survey_gate_limit_m(s);
    if (survey_overlaps(s) && far_m > limit_m)
        return error_say(
            why, -EINVAL,
            "gate_m: far is %g m, and %g m before the next speaker is heard, "
            "a slot of %g s later, end at %g m",
            far_m, SLOT_CLEARANCE_M, slot_s, limit_m);
    if (far_m > limit_m)
        return error_say(why, -EINVAL,
                         "gate_m: gate beyond the slot: far is %g m, and the echoes of a "
                         "slot of %g s end at %g m",
                         far_m, slot_s, limit_m);
    return 0;
}

static int check_volume(const struct survey *s, struct error *why)
{
    for (int i = 0; i < 3; i++) {
        const double *v = s->volume_m[i];
        if (!(fabs(v[0]) <= MAX_DISTANCE_M && fabs(v[1]) <= MAX_DISTANCE_M &&
              v[0] <= v[1] && v[2] > 0 && isfinite(v[2])))
            return error_say(
                why, -EINVAL,
                "volume %c_m is [%g, %g, %g], expected [min, max, step] with "
                "min <= max within +-%g m and step > 0",
                "xyz"[i], v[0], v[1], v[2], MAX_DISTANCE_M);
        if ((v[1] - v[0]) / v[2] > SURVEY_MAX_ELEMENTS)
            return error_say(why, -EINVAL,
                             "volume %c_m has %.0f steps, expected up to %d", "xyz"[i],
                             (v[1] - v[0]) / v[2], SURVEY_MAX_ELEMENTS);
    }
    return 0;
}

static int check_mount(const struct survey *s, struct error *why)
{
    int err = check_point(why, "mount origin_m", 0, s->mount_origin_m);
    if (!err)
        err = check_unit(why, "mount x_axis", s->mount_x_axis);
    if (!err)
        err = check_unit(why, "mount y_axis", s->mount_y_axis);
    if (err)
        return err;
    const double *x = s->mount_x_axis, *y = s->mount_y_axis;
    double dot = x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
    if (fabs(dot) > SURVEY_UNIT_TOLERANCE)
        return error_say(why, -EINVAL,
                         "mount x_axis and y_axis are not at right angles (dot product "
                         "%g)",
                         dot);
    return 0;
}

static int check_response(const struct survey_response *r, size_t index,
                          struct error *why)
{
    if (!memchr(r->serial, 0, sizeof r->serial))
        return error_say(why, -EINVAL, "calibration %zu: the serial does not end", index);
    if (r->n_points < 2 || r->n_points > SURVEY_MAX_ELEMENTS || !r->frequency_hz ||
        !r->gain_db)
        return error_say(why, -EINVAL, "calibration %s has %zu points, expected 2 to %d",
                         r->serial, r->n_points, SURVEY_MAX_ELEMENTS);
    for (size_t i = 0; i < r->n_points; i++) {
        double before_hz = i ? r->frequency_hz[i - 1] : 0;
        if (!(r->frequency_hz[i] > before_hz && isfinite(r->frequency_hz[i])))
            return error_say(why, -EINVAL,
                             "calibration %s: frequency %zu is %g Hz, expected rising "
                             "from 0",
                             r->serial, i, r->frequency_hz[i]);
        if (!(fabs(r->gain_db[i]) <= 200))
            return error_say(why, -EINVAL,
                             "calibration %s: gain %zu is %g dB, expected within +-200",
                             r->serial, i, r->gain_db[i]);
    }
    return 0;
}

static int check_responses(const struct survey *s, struct error *why)
{
    if (!s->n_responses)
        return 0;
    if (s->n_responses != s->n_microphones || !s->responses)
        return error_say(
            why, -EINVAL,
            "calibration of %zu microphones, expected one for each of the %zu",
            s->n_responses, s->n_microphones);
    int err = 0;
    for (size_t i = 0; !err && i < s->n_responses; i++)
        err = check_response(&s->responses[i], i, why);
    return err;
}

static int check_wall_ends(const struct survey *s, struct error *why)
{
    for (size_t i = 0; i < SURVEY_MAX_WALLS && i < (s->n_walls ? s->n_walls : 1); i++) {
        double from_m = s->wall_ends_m[i][0], to_m = s->wall_ends_m[i][1];
        if (s->has_wall && (from_m != 0.0 || to_m != 0.0) &&
            !(from_m < to_m && from_m >= -MAX_DISTANCE_M && to_m <= MAX_DISTANCE_M))
            return error_say(why, -EINVAL,
                             "wall %zu ends at %g and %g m along it, expected from < to "
                             "within %g m",
                             i + 1, from_m, to_m, MAX_DISTANCE_M);
    }
    return 0;
}

static int check_walls(const struct survey *s, struct error *why)
{
    int err = 0;
    if (s->n_walls > SURVEY_MAX_WALLS ||
        (s->n_walls &&
         (!s->has_wall || s->walls[0].distance_m != s->wall_distance_m ||
          memcmp(s->walls[0].normal, s->wall_normal, sizeof s->wall_normal) != 0)))
        return error_say(why, -EINVAL,
                         "walls has %zu elements, expected up to %d, the first of them "
                         "the wall",
                         s->n_walls, SURVEY_MAX_WALLS);
    for (size_t i = 0; !err && i < s->n_walls; i++) {
        const struct survey_wall *w = &s->walls[i];
        err = check_unit(why, "walls normal", w->normal);
        if (!err)
            err = check_range(why, "walls distance_m", w->distance_m, -MAX_DISTANCE_M,
                              MAX_DISTANCE_M, "m");
        if (!err && !(w->gate_m[0] >= 0 && w->gate_m[0] < w->gate_m[1] &&
                      w->gate_m[1] <= MAX_DISTANCE_M))
            err = error_say(why, -EINVAL,
                            "walls gate_m is [%g, %g], expected 0 <= near < far <= %g m",
                            w->gate_m[0], w->gate_m[1], MAX_DISTANCE_M);
    }
    return err;
}

static int check_ends(const struct survey *s, struct error *why)
{
    double near_m = s->gate_m[0], far_m = s->gate_m[1];
    if (near_m >= 0 && near_m < far_m && isfinite(far_m))
        return 0;
    return error_say(why, -EINVAL, "gate_m is [%g, %g], expected 0 <= near < far", near_m,
                     far_m);
}

int survey_check_place(const struct survey *s, struct error *why)
{
    int err = s->has_gate ? check_ends(s, why) : 0;
    if (!err && s->has_volume)
        err = check_volume(s, why);
    if (!err && s->has_wall)
        err = check_unit(why, "wall normal", s->wall_normal);
    if (!err && s->has_wall)
        err = check_range(why, "wall distance_m", s->wall_distance_m, -MAX_DISTANCE_M,
                          MAX_DISTANCE_M, "m");
    if (!err)
        err = check_walls(s, why);
    if (!err)
        err = check_wall_ends(s, why);
    if (!err && s->has_mount)
        err = check_mount(s, why);
    return err;
}

int survey_check(const struct survey *s, struct error *why)
{
    int err = check_medium(s, why);
    if (!err)
        err = check_chirp(s, why);
    if (!err)
        err = check_sharing(s, why);
    if (!err)
        err = check_array(s, why);
    if (!err && s->pings_m)
        err = check_pings(s, why);
    if (!err && s->continuous)
        err = check_continuous(s, why);
    if (!err && s->n_replica)
        err = check_replica(s, why);
    if (!err && s->has_gate)
        err = check_gate(s, why);
    if (!err)
        err = survey_check_place(s, why);
    if (!err)
        err = check_responses(s, why);
    return err;
}
