#include "nodes/anlos/falloff/job.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hal/recording/recording.h"
#include "hal/survey/file.h"
#include "recon/compressor.h"
#include "recon/falloff.h"

struct measurement {
    struct survey survey;
    struct recording *scene, *background; /* background may be NULL */
    struct processing processing;
    struct compressor *compressor;
    struct trace_format format;
    size_t speaker, microphone; /* the closest pair */
    size_t frames;
    float *samples, *subtrahend; /* [n_microphones][frames] */
    float *ping;                 /* [n_microphones][ping_samples] */
    float complex *traces;       /* [n_microphones][format.n_samples] */
    uint32_t *counts;            /* [2][n_microphones] */
};

static int open_recordings(struct measurement *m, const char *folder,
                           struct complaint *why)
{
    char path[PATH_MAX];
    int err;
    snprintf(path, sizeof path, "%s/survey.yaml", folder);
    err = survey_load(&m->survey, path, why);
    if (!err)
        err = processing_plan(&m->processing, &m->survey, why);
    if (err)
        return err;
    snprintf(path, sizeof path, "%s/scene", folder);
    err = recording_open(&m->scene, path, &m->survey, why);
    snprintf(path, sizeof path, "%s/background", folder);
    if (!err && !access(path, F_OK))
        err = recording_open(&m->background, path, &m->survey, why);
    return err;
}

/* Elements keep their distances while a stage carries them. */
static void find_closest_pair(struct measurement *m)
{
    const struct geometry *g = &m->processing.geometry;
    double closest = INFINITY;
    for (size_t j = 0; j < g->n_speakers; j++)
        for (size_t i = 0; i < g->n_microphones; i++) {
            double s[3], r[3];
            geometry_speaker(g, 0, j, s);
            geometry_microphone(g, 0, i, r);
            double d = hypot(hypot(s[0] - r[0], s[1] - r[1]), s[2] - r[2]);
            if (d >= closest)
                continue;
            closest = d;
            m->speaker = j;
            m->microphone = i;
        }
}

static int measurement_open(struct measurement *m, const char *folder,
                            struct complaint *why)
{
    memset(m, 0, sizeof *m);
    int err = open_recordings(m, folder, why);
    if (!err)
        err = compressor_create(&m->compressor, &m->processing, &m->survey,
                                COMPRESSION_MATCHED_FILTER, WINDOW_HANN, why);
    if (err)
        return err;
    size_t n = m->survey.n_microphones;
    compressor_format(m->compressor, &m->format);
    find_closest_pair(m);
    m->frames = recording_frames(m->scene);
    m->samples = malloc(n * m->frames * sizeof *m->samples);
    m->subtrahend = malloc(n * m->frames * sizeof *m->subtrahend);
    m->ping = malloc(n * m->processing.ping_samples * sizeof *m->ping);
    m->traces = malloc(n * m->format.n_samples * sizeof *m->traces);
    m->counts = malloc(2 * n * sizeof *m->counts);
    if (m->samples && m->subtrahend && m->ping && m->traces && m->counts)
        return 0;
    return complain(why, -ENOMEM, "out of memory");
}

static void measurement_close(struct measurement *m)
{
    compressor_destroy(m->compressor);
    recording_close(m->scene);
    recording_close(m->background);
    survey_clear(&m->survey);
    free(m->samples);
    free(m->subtrahend);
    free(m->ping);
    free(m->traces);
    free(m->counts);
}

/* The slot of the pair's speaker at one position, compressed. */
static int compress_position(struct measurement *m, size_t position,
                             struct complaint *why)
{
    size_t n = m->survey.n_microphones, length = m->processing.ping_samples;
    size_t start = survey_slot_of(&m->survey, m->speaker) * m->survey.slot_samples;
    int err =
        recording_read(m->scene, position, m->samples, m->counts, m->counts + n, why);
    if (!err && m->background)
        err = recording_read(m->background, position, m->subtrahend, m->counts,
                             m->counts + n, why);
    if (err)
        return err;
    for (size_t i = 0; i < n; i++)
        for (size_t q = 0; q < length; q++) {
            size_t at = i * m->frames + start + q;
            bool there = start + q < m->frames;
            m->ping[i * length + q] =
                there ? m->samples[at] - (m->background ? m->subtrahend[at] : 0.0f)
                      : 0.0f;
        }
    compressor_execute_either(m->compressor, survey_is_down(&m->survey, m->speaker),
                              m->ping, length, m->traces);
    return 0;
}

static int append(struct falloff_points *p, double distance_m, double power)
{
    if (p->n == p->room) {
        size_t room = p->room ? 2 * p->room : 64;
        double *d = realloc(p->distance_m, room * sizeof *d);
        if (d)
            p->distance_m = d;
        double *w = realloc(p->power, room * sizeof *w);
        if (w)
            p->power = w;
        if (!d || !w)
            return -ENOMEM;
        p->room = room;
    }
    p->distance_m[p->n] = distance_m;
    p->power[p->n++] = power;
    return 0;
}

static int measure_positions(struct falloff_points *p, struct measurement *m,
                             const char *folder, struct complaint *why)
{
    size_t before = p->n;
    for (size_t k = 0; k < m->survey.n_positions; k++) {
        double delay_s, power;
        int err = compress_position(m, k, why);
        if (err)
            return err;
        if (falloff_peak(&m->format, m->traces + m->microphone * m->format.n_samples,
                         &delay_s, &power))
            continue;
        if (append(p, 0.5 * m->survey.sound_speed_m_s * delay_s, power))
            return complain(why, -ENOMEM, "out of memory");
    }
    return p->n > before ? 0
                         : complain(why, -ENODATA, "%s: no position has an echo", folder);
}

int falloff_measure(struct falloff_points *p, const char *folder, struct complaint *why)
{
    struct measurement m;
    int err = measurement_open(&m, folder, why);
    if (!err)
        err = measure_positions(p, &m, folder, why);
    measurement_close(&m);
    return err;
}

void falloff_points_clear(struct falloff_points *p)
{
    free(p->distance_m);
    free(p->power);
    memset(p, 0, sizeof *p);
}
