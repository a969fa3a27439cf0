/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/calibrate/paths.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/chirp.h"
#include "nodes/rt/stop.h"
#include "recon/geometry.h"
#include "recon/processing.h"

#define RETRIES       5    /* of one ping that comes invalid */
#define OVERSAMPLING  8.0  /* dsp/arrival.h */
#define OVERTONE      3    /* the first that symmetric clipping makes */
#define OVERTONE_BAND 0.45 /* of the rate: below the converters' filters */

struct sounding {
    const struct survey *survey;
    size_t n_samples; /* of a ping */
    size_t takes, retaken;
    float *mean;                 /* [n_speakers][n_microphones][n_samples] */
    float *before;               /* [n_microphones][n_samples]: the take before */
    struct sounding_pair *pairs; /* [n_speakers][n_microphones] */
    struct pulse_compress *compress, *overtone; /* overtone may be NULL */
    float complex *traces; /* [n_microphones][samples of the longer format] */
};

static struct sounding_pair *pair_at(const struct sounding *s, size_t speaker,
                                     size_t microphone)
{
    return &s->pairs[speaker * s->survey->n_microphones + microphone];
}

/* -- recording --------------------------------------------------------------------------
 */
static int allocate(struct sounding *s, size_t n_samples)
{
    size_t n_mics = s->survey->n_microphones, n_speakers = s->survey->n_speakers;
    s->n_samples = n_samples;
    s->mean = calloc(n_speakers * n_mics, n_samples * sizeof *s->mean);
    s->before = malloc(n_mics * n_samples * sizeof *s->before);
    s->pairs = calloc(n_speakers * n_mics, sizeof *s->pairs);
    return s->mean && s->before && s->pairs ? 0 : -ENOMEM;
}

/* Takes differ by noise alone, so half the mean square of the difference is its power. */
static void add_take(struct sounding *s, size_t speaker, size_t take,
                     const struct array_ping *ping)
{
    size_t n = s->n_samples;
    for (size_t m = 0; m < s->survey->n_microphones; m++) {
        struct sounding_pair *p = pair_at(s, speaker, m);
        float *mean = s->mean + (speaker * s->survey->n_microphones + m) * n;
        float *before = s->before + m * n;
        const float *x = ping->samples + m * n;
        double differences = 0.0;
        for (size_t i = 0; i < n; i++) {
            double d = take ? (double)x[i] - (double)before[i] : 0.0;
            differences += d * d;
            before[i] = x[i];
            mean[i] += x[i] / (float)s->takes;
        }
        p->clipped += ping->clipped[m];
        p->not_finite += ping->not_finite[m];
        p->noise_rms += differences / (2.0 * (double)n * (double)(s->takes - 1));
    }
}

static int fire(struct sounding *s, struct array *array, size_t position,
                uint32_t speaker, struct array_ping *ping, struct error *why)
{
    const struct survey *survey = s->survey;
    const struct array_shot shot = {.pass = PASS_SCENE,
                                    .position = position,
                                    .stage_m = survey->stage_positions_m[position],
                                    .speakers = &speaker,
                                    .n_speakers = 1};
    for (size_t tries = 0; tries <= RETRIES; tries++) {
        int err = array_fire(array, &shot);
        if (err)
            return error_say(why, err, "speaker %u cannot be fired: %s", speaker,
                             strerror(-err));
        do {
            err = interrupt_requested() ? -EINTR : array_next(array, ping, why);
        } while (err == -EINTR && !interrupt_requested());
        if (err)
            return err == -EINTR ? error_say(why, err, "interrupted") : err;
        if (ping->valid)
            return 0;
        s->retaken++;
    }
    return error_say(why, -EIO, "speaker %u: %d pings were lost one after the other",
                     speaker, RETRIES + 1);
}

static int record(struct sounding *s, struct array *array, size_t position,
                  uint32_t speaker, struct error *why)
{
    struct array_ping ping;
    for (size_t take = 0; take < s->takes; take++) {
        int err = fire(s, array, position, speaker, &ping, why);
        if (!err && !s->mean && allocate(s, ping.n_samples) < 0)
            err = error_say(why, -ENOMEM, "out of memory");
        if (err)
            return err;
        add_take(s, speaker, take, &ping);
    }
    return 0;
}

/* Root of the powers; is there any sound at all? */
static int finish(struct sounding *s, struct error *why)
{
    size_t n = s->survey->n_speakers * s->survey->n_microphones;
    double all = 0.0;
    for (size_t p = 0; p < n; p++) {
        const float *x = s->mean + p * s->n_samples;
        double sum = 0.0;
        for (size_t i = 0; i < s->n_samples; i++)
            sum += (double)x[i] * (double)x[i];
        s->pairs[p].rms = sqrt(sum / (double)s->n_samples);
        s->pairs[p].noise_rms = s->takes > 1 ? sqrt(s->pairs[p].noise_rms) : 0.0;
        all += sum;
    }
    return all > 0.0 ? 0
                     : error_say(why, -ENODATA,
                                 "the array records nothing: every sample is 0; look at "
                                 "its input, and that it is not muted");
}

/* -- compressing ------------------------------------------------------------------------
 */
static int create_compressors(struct sounding *s, struct error *why)
{
    const struct survey *survey = s->survey;
    struct microphone *curves = calloc(survey->n_microphones, sizeof *curves);
    const struct microphone **each = calloc(survey->n_microphones, sizeof *each);
    struct pulse_compress_config cfg = {
        .sample_rate_hz = survey->sample_rate_hz,
        .n_samples = s->n_samples,
        .chirp = processing_chirp(survey),
        .window = WINDOW_HANN,
        .gate_s = {0.0, (double)s->n_samples / survey->sample_rate_hz},
        .oversampling = OVERSAMPLING,
        .n_channels = survey->n_microphones,
        .microphones = survey->n_responses ? each : NULL,
        .n_replica = survey->n_replica,
        .replica = survey->replica};
    struct trace_format f, overtone = {.n_samples = 0};
    int err = curves && each ? 0 : -ENOMEM;
    for (size_t m = 0; !err && m < survey->n_responses; m++) {
        const struct survey_response *r = &survey->responses[m];
        curves[m] = (struct microphone){r->n_points, r->frequency_hz, r->gain_db};
        each[m] = &curves[m];
    }
    if (!err)
        err = pulse_compress_create(&s->compress, &cfg);
    if (!err && !survey->n_replica &&
        !harmonic_chirp(&cfg.chirp, OVERTONE, OVERTONE_BAND * survey->sample_rate_hz,
                        survey->sample_rate_hz, &cfg.chirp))
        err = pulse_compress_create(&s->overtone, &cfg);
    if (!err) {
        pulse_compress_format(s->compress, &f);
        if (s->overtone)
            pulse_compress_format(s->overtone, &overtone);
        size_t longest = f.n_samples > overtone.n_samples ? f.n_samples
                                                          : overtone.n_samples;
        s->traces = malloc(survey->n_microphones * longest * sizeof *s->traces);
        err = s->traces ? 0 : -ENOMEM;
    }
    free(each);
    free(curves);
    return err ? error_say(why, err, "pulse compression: %s", strerror(-err)) : 0;
}

int sounding_take(struct sounding **out, struct array *array, size_t position,
                  size_t only, size_t takes, struct error *why)
{
    struct sounding *s = calloc(1, sizeof *s);
    int err = 0;
    *out = NULL;
    if (!s)
        return error_say(why, -ENOMEM, "out of memory");
    s->survey = array_survey(array);
    s->takes = takes;
    for (size_t j = 0; j < s->survey->n_speakers && !err; j++)
        if (only == SIZE_MAX || only == j)
            err = record(s, array, position, (uint32_t)j, why);
    if (!err)
        err = finish(s, why);
    if (!err)
        err = create_compressors(s, why);
    if (err)
        sounding_destroy(s);
    else
        *out = s;
    return err;
}

const struct survey *sounding_survey(const struct sounding *s)
{
    return s->survey;
}

size_t sounding_retaken(const struct sounding *s)
{
    return s->retaken;
}

const struct sounding_pair *sounding_pair(const struct sounding *s, size_t speaker,
                                          size_t microphone)
{
    return pair_at(s, speaker, microphone);
}

void sounding_format(const struct sounding *s, struct trace_format *out)
{
    pulse_compress_format(s->compress, out);
}

static const float complex *compress(struct sounding *s, struct pulse_compress *pc,
                                     size_t speaker)
{
    const float *x = s->mean + speaker * s->survey->n_microphones * s->n_samples;
    pulse_compress_execute(pc, x, s->n_samples, s->traces);
    return s->traces;
}

const float complex *sounding_traces(struct sounding *s, size_t speaker)
{
    return compress(s, s->compress, speaker);
}

const float complex *sounding_overtones(struct sounding *s, size_t speaker,
                                        struct trace_format *format)
{
    if (!s->overtone)
        return NULL;
    pulse_compress_format(s->overtone, format);
    return compress(s, s->overtone, speaker);
}

void sounding_destroy(struct sounding *s)
{
    if (!s)
        return;
    pulse_compress_destroy(s->compress);
    pulse_compress_destroy(s->overtone);
    free(s->traces);
    free(s->mean);
    free(s->before);
    free(s->pairs);
    free(s);
}

#define OVER_FLOOR 8.0 /* times the median amplitude: no noise peaks so high */
#define UNDER_LOUDEST                                                                    \
    0.1 /* of the loudest: a reflector ahead may be louder than what                     \
           reaches the microphones beside the speakers */
#define LEAST_WINDOW_S 250e-6
#define PULSES         6.0

static struct path *paths_create(const struct survey *s)
{
    return calloc(s->n_speakers * s->n_microphones, sizeof(struct path));
}

struct path *paths_direct(const struct survey *s)
{
    struct path *out = paths_create(s);
    for (size_t p = 0; out && p < s->n_speakers * s->n_microphones; p++)
        out[p].distance_m = geometry_distance(s->speakers_m[p / s->n_microphones],
                                              s->microphones_m[p % s->n_microphones]);
    return out;
}

struct path *paths_reflected(const struct survey *s, size_t position,
                             const double normal[3], double distance_m)
{
    struct path *out = paths_create(s);
    double along = 0.0; /* how far the stage carries the array toward the plane */
    for (int a = 0; a < 3; a++)
        along += normal[a] * s->stage_axis[a] * s->stage_positions_m[position];
    for (size_t p = 0; out && p < s->n_speakers * s->n_microphones; p++) {
        const double *speaker = s->speakers_m[p / s->n_microphones];
        double before = distance_m - along, image[3];
        for (int a = 0; a < 3; a++)
            before -= normal[a] * speaker[a];
        for (int a = 0; a < 3; a++)
            image[a] = speaker[a] + 2.0 * before * normal[a];
        out[p].distance_m =
            geometry_distance(image, s->microphones_m[p % s->n_microphones]);
    }
    return out;
}

/* A look at each pair's trace; latency_s NaN: the first arrival anywhere. */
struct look {
    double latency_s, speed_m_s, window_s;
};

static bool hear(const struct look *look, const struct trace_format *f,
                 const float complex *y, double floor, struct path *p)
{
    struct arrival loudest;
    double last_s = f->t0_s + (double)f->n_samples / f->rate_hz;
    double least = OVER_FLOOR * floor;
    if (!isnan(look->latency_s)) {
        double at_s = look->latency_s + p->distance_m / look->speed_m_s;
        return arrival_strongest(f, y, at_s - look->window_s, at_s + look->window_s,
                                 &p->arrival) &&
               cabs(p->arrival.peak) >= least;
    }
    if (!arrival_strongest(f, y, 0.0, last_s, &loudest) || cabs(loudest.peak) < least)
        return false;
    least = fmax(least, UNDER_LOUDEST * cabs(loudest.peak));
    return arrival_first(f, y, 0.0, last_s, least, &p->arrival);
}

static int look_at_all(const struct look *look, struct path *paths, struct sounding *s)
{
    const struct survey *survey = sounding_survey(s);
    struct trace_format f;
    sounding_format(s, &f);
    float *scratch = malloc(f.n_samples * sizeof *scratch);
    if (!scratch)
        return -ENOMEM;
    for (size_t j = 0; j < survey->n_speakers; j++) {
        const float complex *y = sounding_traces(s, j);
        for (size_t m = 0; m < survey->n_microphones; m++, y += f.n_samples) {
            struct path *p = &paths[j * survey->n_microphones + m];
            p->heard = !p->ignored && hear(look, &f, y, arrival_floor(&f, y, scratch), p);
        }
    }
    free(scratch);
    return 0;
}

int paths_hear_first(struct path *paths, struct sounding *s)
{
    const struct look look = {.latency_s = NAN};
    return look_at_all(&look, paths, s);
}

int paths_hear_near(struct path *paths, struct sounding *s, double latency_s,
                    double speed_m_s, double window_s)
{
    const struct look look = {latency_s, speed_m_s, window_s};
    return look_at_all(&look, paths, s);
}

double paths_window_s(const struct survey *s)
{
    double band_hz = fabs(s->chirp_stop_hz - s->chirp_start_hz);
    return fmax(LEAST_WINDOW_S, PULSES / band_hz);
}

void paths_pairs(const struct path *paths, size_t n, struct time_zero_pair *out)
{
    for (size_t p = 0; p < n; p++) {
        out[p].distance_m = paths[p].distance_m;
        out[p].arrival_s = paths[p].heard ? paths[p].arrival.time_s : NAN;
    }
}

int paths_fit_latency(struct path *direct, struct sounding *s, double speed_m_s,
                      struct time_zero *out, struct error *why)
{
    const struct survey *survey = sounding_survey(s);
    size_t n = survey->n_speakers * survey->n_microphones;
    struct time_zero_pair *pairs = malloc(n * sizeof *pairs);
    int err = pairs ? paths_hear_first(direct, s) : -ENOMEM;
    for (int pass = 0; pass < 2 && !err; pass++) {
        paths_pairs(direct, n, pairs);
        err = time_zero_fit(out, pairs, n, speed_m_s);
        if (!err && pass == 0)
            err = paths_hear_near(direct, s, out->latency_s, speed_m_s,
                                  paths_window_s(survey));
    }
    free(pairs);
    if (err == -ENODATA)
        return error_say(
            why, err,
            "no microphone hears any speaker: nothing like the chirp in what "
            "the array records within a ping; look at amplifiers, levels and "
            "wiring, or the latency is longer than a slot");
    return err ? error_say(why, err, "out of memory") : 0;
}
