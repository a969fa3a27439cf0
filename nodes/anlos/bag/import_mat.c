#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/recording/replica_file.h"
#include "recon/tail.h"
#include "msgs/tensor.h"
#include "nodes/anlos/bag/import.h"
#include "nodes/anlos/confocal/traces.h"
#include "nodes/anlos/interrupt.h"

#define SOUND_M_S   343.0
#define MAX_RATE_HZ 380e3 /* below what survey_check takes */
#define MAX_BINS    512   /* as `anlos recon --confocal` has it */
#define TAPER       0.05  /* of a trace, at both ends */
#define DEPTH_STEPS 2.5   /* voxels in a pulse's width, c / 2 B */

struct mat_import {
    struct confocal_scan scan;
    struct survey survey;
    size_t first;     /* sample of a ping that bin 0 becomes */
    size_t n_samples; /* of a ping */
    float *samples;   /* [n_samples] */
    float *wave;      /* [scan.n], of a place */
    float scale;      /* what keeps every sample within 1 */
};

static int read_scan(struct mat_import *m, const char *path, struct complaint *why)
{
    struct confocal_file f;
    double gate_m[2];
    int err = confocal_file_load(&f, path, why);

    if (!err) {
        confocal_file_gate(&f, gate_m);
        err = confocal_scan_create(&m->scan, &f, gate_m, MAX_BINS,
                                   0.5 * SOUND_M_S / MAX_RATE_HZ, why);
    }
    confocal_file_clear(&f);
    return err;
}

/* The places of the scan, [ny][nx], each sends and hears. */
static int fill_places(struct survey *v, const struct confocal_scan *s)
{
    size_t n = s->nx * s->ny;

    if (survey_make_pings(v, n))
        return -ENOMEM;
    for (size_t q = 0; q < n; q++) {
        for (int end = 0; end < 2; end++) {
            v->pings_m[q][end][0] = ((double)(q % s->nx) - 0.5 * (double)(s->nx - 1)) *
                                    s->pitch_x_m;
            v->pings_m[q][end][1] = ((double)(q / s->nx) - 0.5 * (double)(s->ny - 1)) *
                                    s->pitch_y_m;
        }
    }
    return 0;
}

static void set_axis(double axis[3], double min, double max, double step)
{
    axis[0] = min;
    axis[1] = max;
    axis[2] = step;
}

static void fill_volume(struct survey *v, const struct confocal_scan *s)
{
    double x_m = 0.5 * (double)(s->nx - 1) * s->pitch_x_m;
    double y_m = 0.5 * (double)(s->ny - 1) * s->pitch_y_m;
    double far_m = s->range_m + (double)(s->n - 1) * s->range_step_m;
    double step_m = 0.5 * SOUND_M_S /
                    (DEPTH_STEPS * (v->chirp_stop_hz - v->chirp_start_hz));

    v->has_gate = v->has_volume = true;
    v->gate_m[0] = fmax(s->range_m - 0.5 * s->range_step_m, 0.0);
    v->gate_m[1] = far_m;
    set_axis(v->volume_m[0], -x_m, x_m, s->pitch_x_m);
    set_axis(v->volume_m[1], -y_m, y_m, s->pitch_y_m);
    set_axis(v->volume_m[2], fmax(s->range_m, 0.5 * step_m), far_m, step_m);
}

static double sinc(double x)
{
    return fabs(x) < 1e-9 ? 1.0 : sin(M_PI * x) / (M_PI * x);
}

/* What is sent: a pulse that fills the band in which the scan stands out of the noise,
 * and nothing else, with soft edges. */
static int fill_replica(struct survey *v, const double band_hz[2])
{
    size_t half = (size_t)ceil(v->sample_rate_hz / band_hz[0]), n = 2 * half + 1;

    v->replica = malloc(n * sizeof *v->replica);
    if (!v->replica)
        return -ENOMEM;
    v->n_replica = n;
    for (size_t i = 0; i < n; i++) {
        double t_s = ((double)i - (double)half) / v->sample_rate_hz;
        double window = 0.5 - 0.5 * cos(2.0 * M_PI * (double)(i + 1) / (double)(n + 1));
        double pass = band_hz[1] * sinc(2.0 * band_hz[1] * t_s) -
                      band_hz[0] * sinc(2.0 * band_hz[0] * t_s);
        v->replica[i] = (float)(2.0 * window * pass / v->sample_rate_hz);
    }
    v->chirp_duration_s = (double)n / v->sample_rate_hz;
    double found_hz[2]; /* as whoever reads the replica from a file will find it */
    int err = replica_band(v->replica, n, v->sample_rate_hz, found_hz);
    v->chirp_start_hz = found_hz[0];
    v->chirp_stop_hz = found_hz[1];
    return err;
}

/* A bin of range becomes a sample; the emission is late by a fraction of one, such that a
 * bin's middle is a sample's time. */
static int fill_survey(struct mat_import *m, struct complaint *why)
{
    const struct confocal_scan *s = &m->scan;
    const double slower = SOUND_M_S / CONFOCAL_LIGHT_M_S;
    struct confocal_traces waves;
    struct survey *v = &m->survey;
    int err = confocal_traces_create(&waves, s, why);

    if (err)
        return err;
    const double band_hz[2] = {slower * waves.band_hz[0], slower * waves.band_hz[1]};
    confocal_traces_clear(&waves);
    v->source = SURVEY_REPLAY;
    v->sound_speed_m_s = SOUND_M_S;
    v->temperature_c = NAN;
    v->sample_rate_hz = 0.5 * SOUND_M_S / s->range_step_m;
    err = fill_replica(v, band_hz);
    if (!err)
        err = fill_places(v, s);
    if (err)
        return complain(why, err, "%s", strerror(-err));
    m->first = (size_t)ceil(s->range_m / s->range_step_m);
    v->latency_samples = (double)m->first - s->range_m / s->range_step_m;
    v->slot_samples = m->first + s->n + v->n_replica;
    fill_volume(v, s);
    return 0;
}

static void find_scale(struct mat_import *m)
{
    const struct confocal_scan *s = &m->scan;
    double most = 0.0, gain = 0.0;

    for (size_t i = 0; i < s->nx * s->ny * s->n; i++)
        most = fmax(most, (double)s->counts[i]);
    for (size_t k = 0; k < m->survey.n_replica; k++)
        gain += fabs((double)m->survey.replica[k]);
    m->scale = most > 0.0 ? (float)(1.0 / (sqrt(most) * gain)) : 0.0f;
}

/* The root of the counts of a place, without its mean, let down at both ends. */
static void fill_wave(struct mat_import *m, size_t q)
{
    const struct confocal_scan *s = &m->scan;
    const float *counts = s->counts + q * s->n;
    double mean = 0.0, width = TAPER * (double)s->n;

    for (size_t i = 0; i < s->n; i++) {
        m->wave[i] = counts[i] > 0.0f ? m->scale * sqrtf(counts[i]) : 0.0f;
        mean += (double)m->wave[i] / (double)s->n;
    }
    for (size_t i = 0; i < s->n; i++) {
        double edge = fmin((double)i + 0.5, (double)(s->n - i) - 0.5);
        double taper = 0.5 - 0.5 * cos(M_PI * fmin(edge / width, 1.0));
        m->wave[i] = (float)(taper * ((double)m->wave[i] - mean));
    }
}

/* What a place would have heard of what was sent. */
static void fill_samples(struct mat_import *m, size_t q)
{
    const struct survey *v = &m->survey;

    fill_wave(m, q);
    memset(m->samples, 0, m->n_samples * sizeof *m->samples);
    for (size_t i = 0; i < m->scan.n; i++) {
        float *to = m->samples + m->first + i, x = m->wave[i];
        for (size_t k = 0; k < v->n_replica; k++)
            to[k] += x * v->replica[k];
    }
}

static int put_pings(struct import_bag *bag, struct mat_import *m, struct complaint *why)
{
    double slot_ns = 1e9 * (double)m->survey.slot_samples / m->survey.sample_rate_hz;
    double length_ns = 1e9 * (double)m->n_samples / m->survey.sample_rate_hz;
    uint32_t none[1] = {0};
    int err = 0;

    for (size_t q = 0; !err && q < m->survey.n_positions; q++) {
        Anlos__Ping p = ANLOS__PING__INIT;
        struct tensor_view view;
        if (interrupt_requested())
            return complain(why, -EINTR, "interrupted");
        fill_samples(m, q);
        p.scan = 1;
        p.position = (uint32_t)q;
        p.samples = tensor_borrow_f32(&view, m->samples, 2, (size_t)1, m->n_samples);
        p.n_clipped = p.n_not_finite = 1;
        p.clipped = p.not_finite = none;
        p.valid = true;
        p.temperature_c = NAN;
        err = import_bag_ping(bag, &p, IMPORT_START_NS + llround((double)q * slot_ns),
                              llround(length_ns), why);
    }
    return err;
}

int import_mat(struct import_bag *bag, const struct import_options *o,
               struct complaint *why)
{
    static const char *const pairs[][2] = {
        {"imported_from", "optical confocal scan"},
        {"version", ANLOS_VERSION},
        {"light_m_s", "299792458"},
        {"sound_m_s", "343"},
        {"times", "those of sound over the ranges that light had"},
    };
    struct mat_import m = {.samples = NULL};
    int err = read_scan(&m, o->from, why);

    if (!err)
        err = fill_survey(&m, why);
    if (!err)
        err = import_bag_survey(bag, &m.survey, NULL, 0, why);
    if (!err)
        err = import_bag_metadata(bag, "anlos", pairs, sizeof pairs / sizeof *pairs, why);
    if (!err) {
        find_scale(&m);
        m.n_samples = m.survey.slot_samples + tail_samples(&m.survey);
        m.samples = malloc(m.n_samples * sizeof *m.samples);
        m.wave = malloc(m.scan.n * sizeof *m.wave);
        err = m.samples && m.wave ? put_pings(bag, &m, why)
                                  : complain(why, -ENOMEM, "out of memory");
    }
    free(m.samples);
    free(m.wave);
    survey_clear(&m.survey);
    confocal_scan_clear(&m.scan);
    return err;
}
