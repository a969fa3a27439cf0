/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "recon/api/api.h"
#include "recon/processing.h"
#include "recon/tail.h"
#include "recon/walls/wall.h"

/* The paper's chirp; its slots follow each other without a pause. */
#define RATE_HZ    48000.0
#define START_HZ   2000.0
#define STOP_HZ    20000.0
#define DURATION_S 0.0625
#define SLOT       3000
#define AIR_C      20.0
#define FAR_M      100.0 /* of a wall that mirrors everything */

#define ROUNDING 4e-16 /* of a length that is 1; such a vector is kept as it is */

int anlos_survey_create_for(uint32_t version, struct anlos_survey **out,
                            struct anlos_error *why)
{
    int code = api_there(out, "out", why);

    if (code)
        return code;
    *out = NULL;
    if (version >> 24 != ANLOS_ABI || version > ANLOS_VERSION_NUMBER)
        return api_fail(why, ANLOS_VERSION_MISMATCH,
                        "compiled against anlos %u.%u.%u (interface %u), but the library "
                        "is %s (interface %d); compile anew, or install that libanlos",
                        version >> 16 & 0xff, version >> 8 & 0xff, version & 0xff,
                        version >> 24, ANLOS_VERSION, ANLOS_ABI);
    struct anlos_survey *s = calloc(1, sizeof *s);
    double *stands = calloc(1, sizeof *stands);
    if (!s || !stands) {
        free(s);
        free(stands);
        return api_fail(why, ANLOS_NO_MEMORY, "survey: out of memory");
    }
    s->inside = (struct survey){.source = SURVEY_LIVE,
                                .sound_speed_m_s = survey_sound_speed_m_s(AIR_C),
                                .temperature_c = AIR_C,
                                .sample_rate_hz = RATE_HZ,
                                .chirp_start_hz = START_HZ,
                                .chirp_stop_hz = STOP_HZ,
                                .chirp_duration_s = DURATION_S,
                                .slot_samples = SLOT,
                                .stage_axis = {1.0, 0.0, 0.0},
                                .n_positions = 1,
                                .stage_positions_m = stands};
    *out = s;
    return 0;
}

void anlos_survey_destroy(struct anlos_survey *s)
{
    if (!s)
        return;
    survey_clear(&s->inside);
    free(s);
}

/* -- elements ---------------------------------------------------------------------------
 */

/* A copy of x [n][width], all finite. */
static int copy(void *out, const double *x, size_t n, size_t width, size_t most,
                const char *name, struct anlos_error *why)
{
    int code = api_there(x, name, why);

    if (!code && (n < 1 || n > most))
        code = api_fail(why, ANLOS_INVALID, "%s: %zu of them, expected 1 to %zu", name, n,
                        most);
    if (!code)
        code = api_finite(x, n * width, name, why);
    if (code)
        return code;
    double *fresh = malloc(n * width * sizeof *fresh);
    if (!fresh)
        return api_fail(why, ANLOS_NO_MEMORY, "%s: out of memory", name);
    memcpy(fresh, x, n * width * sizeof *fresh);
    memcpy(out, &fresh, sizeof fresh);
    return 0;
}

/* No ping has a place of its own any more; n_positions is to be set. */
static void forget_pings(struct survey *s)
{
    free(s->pings_m);
    s->pings_m = NULL;
}

static void forget_responses(struct survey *s)
{
    for (size_t i = 0; i < s->n_responses; i++) {
        free(s->responses[i].frequency_hz);
        free(s->responses[i].gain_db);
    }
    free(s->responses);
    s->responses = NULL;
    s->n_responses = 0;
}

int anlos_survey_speakers(struct anlos_survey *s, const double *xyz_m, size_t n,
                          struct anlos_error *why)
{
    double(*fresh)[3] = NULL;
    int code = api_there(s, "survey", why);

    if (!code)
        code = copy(&fresh, xyz_m, n, 3, SURVEY_MAX_ELEMENTS, "speakers", why);
    if (code)
        return code;
    free(s->inside.speakers_m);
    s->inside.speakers_m = fresh;
    s->inside.n_speakers = n;
    return 0;
}

int anlos_survey_microphones(struct anlos_survey *s, const double *xyz_m, size_t n,
                             struct anlos_error *why)
{
    double(*fresh)[3] = NULL;
    int code = api_there(s, "survey", why);

    if (!code)
        code = copy(&fresh, xyz_m, n, 3, SURVEY_MAX_ELEMENTS, "microphones", why);
    if (code)
        return code;
    forget_responses(&s->inside);
    free(s->inside.microphones_m);
    s->inside.microphones_m = fresh;
    s->inside.n_microphones = n;
    return 0;
}

/* To the length 1, which it has but for the digits that somebody wrote. */
static int unit(double out[3], const double v[3], const char *name,
                struct anlos_error *why)
{
    int code = api_there(v, name, why);

    if (!code)
        code = api_finite(v, 3, name, why);
    if (code)
        return code;
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if (!(fabs(length - 1.0) <= SURVEY_UNIT_TOLERANCE))
        return api_fail(why, ANLOS_INVALID,
                        "%s [%g, %g, %g] has the length %g, expected 1", name, v[0], v[1],
                        v[2], length);
    for (int i = 0; i < 3; i++)
        out[i] = fabs(length - 1.0) < ROUNDING ? v[i] : v[i] / length;
    return 0;
}

int anlos_survey_stage(struct anlos_survey *s, const double axis[3],
                       const double *positions_m, size_t n, struct anlos_error *why)
{
    double direction[3], *fresh = NULL;
    int code = api_there(s, "survey", why);

    if (!code)
        code = unit(direction, axis, "stage axis", why);
    if (!code)
        code =
            copy(&fresh, positions_m, n, 1, SURVEY_MAX_ELEMENTS, "stage positions", why);
    if (code)
        return code;
    forget_pings(&s->inside);
    memcpy(s->inside.stage_axis, direction, sizeof direction);
    free(s->inside.stage_positions_m);
    s->inside.stage_positions_m = fresh;
    s->inside.n_positions = n;
    return 0;
}

int anlos_survey_pings(struct anlos_survey *s, const double *xyz_m, size_t n,
                       struct anlos_error *why)
{
    struct survey fresh = {.n_speakers = 0};
    double(*places)[2][3] = NULL;
    int code = api_there(s, "survey", why);

    if (!code)
        code = copy(&places, xyz_m, n, 6, SURVEY_MAX_PINGS, "pings", why);
    if (code)
        return code;
    if (survey_make_pings(&fresh, n)) {
        survey_clear(&fresh);
        free(places);
        return api_fail(why, ANLOS_NO_MEMORY, "pings: out of memory");
    }
    struct survey *to = &s->inside;
    forget_responses(to);
    free(to->speakers_m);
    free(to->microphones_m);
    free(to->stage_positions_m);
    free(to->pings_m);
    free(fresh.pings_m);
    to->n_speakers = to->n_microphones = 1;
    to->n_positions = n;
    to->speakers_m = fresh.speakers_m;
    to->microphones_m = fresh.microphones_m;
    to->stage_positions_m = fresh.stage_positions_m;
    memcpy(to->stage_axis, fresh.stage_axis, sizeof to->stage_axis);
    to->pings_m = places;
    return 0;
}

/* Of each microphone, without points; its number for a name. */
static int make_responses(struct survey *s, struct anlos_error *why)
{
    if (s->n_responses)
        return 0;
    s->responses = calloc(s->n_microphones, sizeof *s->responses);
    if (!s->responses)
        return api_fail(why, ANLOS_NO_MEMORY, "responses: out of memory");
    s->n_responses = s->n_microphones;
    for (size_t i = 0; i < s->n_responses; i++)
        snprintf(s->responses[i].serial, sizeof s->responses[i].serial, "microphone %zu",
                 i);
    return 0;
}

int anlos_survey_response(struct anlos_survey *s, size_t microphone,
                          const double *frequency_hz, const double *gain_db, size_t n,
                          struct anlos_error *why)
{
    double *frequencies = NULL, *gains = NULL;
    int code = api_there(s, "survey", why);

    if (!code && microphone >= s->inside.n_microphones)
        code = api_fail(why, ANLOS_INVALID,
                        "response of microphone %zu of %zu; say the microphones first",
                        microphone, s->inside.n_microphones);
    if (!code)
        code = copy(&frequencies, frequency_hz, n, 1, SURVEY_MAX_ELEMENTS,
                    "response frequencies", why);
    if (!code)
        code = copy(&gains, gain_db, n, 1, SURVEY_MAX_ELEMENTS, "response gains", why);
    if (!code)
        code = make_responses(&s->inside, why);
    if (code) {
        free(frequencies);
        free(gains);
        return code;
    }
    struct survey_response *r = &s->inside.responses[microphone];
    free(r->frequency_hz);
    free(r->gain_db);
    r->n_points = n;
    r->frequency_hz = frequencies;
    r->gain_db = gains;
    return 0;
}

/* -- sound ------------------------------------------------------------------------------
 */

static int set_band(struct survey *s, double start_hz, double stop_hz, double duration_s,
                    struct anlos_error *why)
{
    const double numbers[] = {start_hz, stop_hz, duration_s};
    int code = api_finite(numbers, 3, "chirp (start, stop, duration)", why);

    if (code)
        return code;
    s->chirp_start_hz = start_hz;
    s->chirp_stop_hz = stop_hz;
    s->chirp_duration_s = duration_s;
    return 0;
}

int anlos_survey_chirp(struct anlos_survey *s, double start_hz, double stop_hz,
                       double duration_s, bool sine, struct anlos_error *why)
{
    int code = api_there(s, "survey", why);

    if (!code)
        code = set_band(&s->inside, start_hz, stop_hz, duration_s, why);
    if (code)
        return code;
    s->inside.chirp_sine = sine;
    free(s->inside.replica);
    s->inside.replica = NULL;
    s->inside.n_replica = 0;
    return 0;
}

int anlos_survey_replica(struct anlos_survey *s, const float *samples, size_t n,
                         double start_hz, double stop_hz, struct anlos_error *why)
{
    int code = api_there(s, "survey", why);

    if (!code)
        code = api_there(samples, "replica", why);
    if (!code && (n < 2 || n > s->inside.slot_samples))
        code = api_fail(why, ANLOS_INVALID,
                        "replica has %zu samples, expected 2 to slot_samples, %zu", n,
                        s->inside.slot_samples);
    float *fresh = code ? NULL : malloc(n * sizeof *fresh);
    if (!code && !fresh)
        code = api_fail(why, ANLOS_NO_MEMORY, "replica: out of memory");
    if (!code)
        code = set_band(&s->inside, start_hz, stop_hz,
                        (double)n / s->inside.sample_rate_hz, why);
    if (code) {
        free(fresh);
        return code;
    }
    memcpy(fresh, samples, n * sizeof *fresh);
    free(s->inside.replica);
    s->inside.replica = fresh;
    s->inside.n_replica = n;
    return 0;
}

int anlos_survey_sampling(struct anlos_survey *s, double sample_rate_hz,
                          size_t slot_samples, double latency_samples,
                          struct anlos_error *why)
{
    const double numbers[] = {sample_rate_hz, latency_samples};
    int code = api_there(s, "survey", why);

    if (!code)
        code = api_finite(numbers, 2, "sampling (rate, latency)", why);
    if (code)
        return code;
    s->inside.sample_rate_hz = sample_rate_hz;
    s->inside.slot_samples = slot_samples;
    s->inside.latency_samples = latency_samples;
    if (s->inside.n_replica)
        s->inside.chirp_duration_s = (double)s->inside.n_replica / sample_rate_hz;
    return 0;
}

int anlos_survey_firing(struct anlos_survey *s, bool alternates, unsigned together,
                        struct anlos_error *why)
{
    int code = api_there(s, "survey", why);

    if (!code && (together < 1 || together > 2))
        code = api_fail(why, ANLOS_INVALID, "together is %u, expected 1 or 2", together);
    if (code)
        return code;
    s->inside.chirp_alternates = alternates;
    s->inside.together = together;
    return 0;
}

int anlos_survey_sound_speed(struct anlos_survey *s, double m_s, struct anlos_error *why)
{
    int code = api_there(s, "survey", why);

    if (!code)
        code = api_finite(&m_s, 1, "sound speed", why);
    if (code)
        return code;
    s->inside.sound_speed_m_s = m_s;
    s->inside.temperature_c = NAN;
    return 0;
}

int anlos_survey_air(struct anlos_survey *s, double temperature_c, double humidity,
                     struct anlos_error *why)
{
    int code = api_there(s, "survey", why);

    if (code)
        return code;
    if (!(temperature_c >= -20.0 && temperature_c <= 50.0 && humidity >= 0.0 &&
          humidity <= 1.0))
        return api_fail(why, ANLOS_INVALID,
                        "air of %g C and a humidity of %g, expected -20 to 50 and 0 to 1",
                        temperature_c, humidity);
    s->inside.temperature_c = temperature_c;
    s->inside.sound_speed_m_s = survey_humid_sound_speed_m_s(temperature_c, humidity);
    return 0;
}

/* -- scene ------------------------------------------------------------------------------
 */

int anlos_survey_gate(struct anlos_survey *s, double near_m, double far_m,
                      struct anlos_error *why)
{
    const double gate[] = {near_m, far_m};
    int code = api_there(s, "survey", why);

    if (!code)
        code = api_finite(gate, 2, "gate", why);
    if (code)
        return code;
    s->inside.has_gate = true;
    memcpy(s->inside.gate_m, gate, sizeof gate);
    return 0;
}

int anlos_survey_volume(struct anlos_survey *s, const double x_m[3], const double y_m[3],
                        const double z_m[3], struct anlos_error *why)
{
    static const char *const names[] = {"volume x", "volume y", "volume z"};
    const double *const axes[] = {x_m, y_m, z_m};
    int code = api_there(s, "survey", why);

    for (int i = 0; !code && i < 3; i++) {
        code = api_there(axes[i], names[i], why);
        if (!code)
            code = api_finite(axes[i], 3, names[i], why);
    }
    if (code)
        return code;
    s->inside.has_volume = true;
    for (int i = 0; i < 3; i++)
        memcpy(s->inside.volume_m[i], axes[i], sizeof s->inside.volume_m[i]);
    return 0;
}

/* One wall that mirrors everything is a survey's `wall`; it is the first of `walls`. */
int anlos_survey_add_wall(struct anlos_survey *s, const double normal[3],
                          double distance_m, double near_m, double far_m,
                          struct anlos_error *why)
{
    const double numbers[] = {distance_m, near_m, far_m};
    bool gated = near_m != 0.0 || far_m != 0.0;
    double n[3];
    int code = api_there(s, "survey", why);

    if (!code)
        code = unit(n, normal, "wall normal", why);
    if (!code)
        code = api_finite(numbers, 3, "wall (distance, near, far)", why);
    struct survey *to = code ? NULL : &s->inside;
    if (to && to->n_walls == SURVEY_MAX_WALLS)
        code = api_fail(why, ANLOS_INVALID, "one wall more than %d", SURVEY_MAX_WALLS);
    if (code)
        return code;
    const struct survey_wall fresh = {
        {n[0], n[1], n[2]}, distance_m, {near_m, gated ? far_m : FAR_M}};
    if (!to->has_wall) {
        to->has_wall = true;
        memcpy(to->wall_normal, n, sizeof n);
        to->wall_distance_m = distance_m;
        to->walls[0] = fresh;
        to->n_walls = gated ? 1 : 0;
        return 0;
    }
    to->n_walls += to->n_walls ? 0 : 1;
    to->walls[to->n_walls++] = fresh;
    return 0;
}

int anlos_survey_end_wall(struct anlos_survey *s, const double from_m[3],
                          const double to_m[3], struct anlos_error *why)
{
    int code = api_there(s, "survey", why);

    if (!code)
        code = api_there(from_m, "from_m", why);
    if (!code)
        code = api_there(to_m, "to_m", why);
    if (!code && !s->inside.has_wall)
        code = api_fail(why, ANLOS_INVALID, "no wall was added that may end");
    if (!code)
        code = api_finite(from_m, 3, "where the wall begins", why);
    if (!code)
        code = api_finite(to_m, 3, "where the wall ends", why);
    if (code)
        return code;
    struct survey *to = &s->inside;
    size_t last = to->n_walls ? to->n_walls - 1 : 0;
    const double *normal = to->n_walls ? to->walls[last].normal : to->wall_normal;
    struct wall w = {.normal = {normal[0], normal[1], normal[2]}};
    if (!wall_end_at(&w, from_m, to_m))
        return api_fail(why, ANLOS_INVALID,
                        "the wall begins and ends at one place of it, expected two");
    memcpy(to->wall_ends_m[last], w.ends_m, sizeof w.ends_m);
    return 0;
}

int anlos_survey_mount(struct anlos_survey *s, const double origin_m[3],
                       const double x_axis[3], const double y_axis[3],
                       struct anlos_error *why)
{
    double x[3], y[3];
    int code = api_there(s, "survey", why);

    if (!code)
        code = api_there(origin_m, "mount origin", why);
    if (!code)
        code = api_finite(origin_m, 3, "mount origin", why);
    if (!code)
        code = unit(x, x_axis, "mount x axis", why);
    if (!code)
        code = unit(y, y_axis, "mount y axis", why);
    if (code)
        return code;
    s->inside.has_mount = true;
    memcpy(s->inside.mount_origin_m, origin_m, sizeof s->inside.mount_origin_m);
    memcpy(s->inside.mount_x_axis, x, sizeof x);
    memcpy(s->inside.mount_y_axis, y, sizeof y);
    return 0;
}

/* -- all of it --------------------------------------------------------------------------
 */

int api_survey(const struct anlos_survey *s, struct anlos_error *why)
{
    struct error inside = {""};
    int code = api_there(s, "survey", why);

    if (code)
        return code;
    int err = survey_check(&s->inside, &inside);
    return err ? api_fail(why, ANLOS_INVALID, "survey: %s", inside.text) : 0;
}

int anlos_survey_check(const struct anlos_survey *s, struct anlos_error *why)
{
    return api_survey(s, why);
}

uint64_t anlos_survey_id(const struct anlos_survey *s)
{
    return s ? survey_id(&s->inside) : 0;
}

size_t anlos_survey_ping_samples(const struct anlos_survey *s)
{
    return api_survey(s, NULL) ? 0 : s->inside.slot_samples + tail_samples(&s->inside);
}

size_t anlos_survey_emission(const struct anlos_survey *s, bool down, float *out,
                             size_t n)
{
    if (api_survey(s, NULL))
        return 0;
    const struct survey *from = &s->inside;
    struct chirp chirp = processing_chirp(from);
    size_t samples = from->n_replica ? from->n_replica
                                     : chirp_length(&chirp, from->sample_rate_hz);
    if (!out || n < samples)
        return samples;
    if (from->n_replica) {
        memcpy(out, from->replica, samples * sizeof *out);
        return samples;
    }
    if (down && from->chirp_alternates) {
        double start_hz = chirp.start_hz;
        chirp.start_hz = chirp.stop_hz;
        chirp.stop_hz = start_hz;
    }
    chirp_generate(&chirp, from->sample_rate_hz, out);
    return samples;
}
