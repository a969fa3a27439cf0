/* SPDX-License-Identifier: MIT */
#include "tests/recon/bumper.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/detection/peak.h"
#include "tests/recon/dice.h"
#include "tests/recon/near.h"

#define EPOCH_NS 1000000000LL /* of time 0 */

void bumper_elements(struct bumper *b, size_t n_speakers, size_t n_microphones)
{
    b->geometry.n_speakers = n_speakers;
    b->geometry.n_microphones = n_microphones;
    for (size_t j = 0; j < n_speakers; j++)
        b->speakers_m[j][0] = n_speakers > 1 ? (double)j / (double)(n_speakers - 1) - 0.5
                                             : 0.0;
    for (size_t i = 0; i < n_microphones; i++) {
        b->microphones_m[i][0] = (double)i / (double)(n_microphones - 1) - 0.5;
        b->microphones_m[i][1] = 0.05;
    }
    b->cfg.n_pings = n_speakers;
}

void bumper_default(struct bumper *b)
{
    *b = (struct bumper){
        .world = {.sound_speed_m_s = 343.0,
                  .sample_rate_hz = 48000.0,
                  .chirp_hz = {2000.0, 20000.0},
                  .chirp_s = 5e-3,
                  .mount_m = {3.5, 0.0, 0.5},
                  .at_m = {5.1, 0.4, 0.55}},
        .slot_s = 24e-3,
        .together = 1,
        .reach_m = 2.4,
    };
    bumper_elements(b, 8, 8);
    b->cfg.max_age_ns = 2000000000LL;
    const double left[3] = {0.0, 1.0, 0.0}, up[3] = {0.0, 0.0, 1.0};
    mount_create(&b->motion.mount, b->world.mount_m, left, up);
    double at[3];
    moving_to_array(&b->world, 0.0, b->world.at_m, at);
    bumper_look_at(b, at, 41, 0.01);
}

void bumper_look_at(struct bumper *b, const double at_m[3], size_t n, double step_m)
{
    double half_m = 0.5 * step_m * (double)(n - 1);
    b->cfg.grid = (struct grid){.origin_m = {at_m[0] - half_m, at_m[1], at_m[2] - half_m},
                                .step_m = {step_m, step_m, step_m},
                                .n = {n, 1, n}};
}

static struct pulse_compress *compressor(const struct bumper *b, bool down)
{
    const struct moving *w = &b->world;
    struct pulse_compress *pc = NULL;
    const struct pulse_compress_config cfg = {
        .sample_rate_hz = w->sample_rate_hz,
        .n_samples = b->n_rx,
        .chirp = {w->chirp_hz[down], w->chirp_hz[!down], w->chirp_s, false},
        .band_hz = {w->chirp_hz[0], w->chirp_hz[1]},
        .window = WINDOW_HANN,
        .gate_s = {0.6 / w->sound_speed_m_s, 2.0 * b->reach_m / w->sound_speed_m_s},
        .oversampling = 2.0,
        .n_channels = b->geometry.n_microphones};
    return pulse_compress_create(&pc, &cfg) ? NULL : pc;
}

void bumper_start(struct bumper *b)
{
    const struct moving *w = &b->world;
    b->geometry.sound_speed_m_s = w->sound_speed_m_s;
    b->geometry.n_positions = 1;
    b->geometry.speakers_m = (const double(*)[3])b->speakers_m;
    b->geometry.microphones_m = (const double(*)[3])b->microphones_m;
    b->geometry.stage_positions_m = &b->position_m;
    b->geometry.stage_axis[0] = 1.0;
    double echo_s = 2.0 * b->reach_m / w->sound_speed_m_s + 2e-3;
    b->n_rx = (size_t)((w->chirp_s + echo_s) * w->sample_rate_hz);
    b->compress[0] = compressor(b, false);
    b->compress[1] = compressor(b, true);
    pulse_compress_format(b->compress[0], &b->cfg.format);
    size_t n_mic = b->geometry.n_microphones;
    b->rx = malloc(n_mic * b->n_rx * sizeof *b->rx);
    b->traces = malloc(n_mic * b->cfg.format.n_samples * sizeof *b->traces);
    if (!b->rx || !b->traces || pool_create(&b->pool, 2))
        abort();
    b->cfg.geometry = &b->geometry;
    b->cfg.pool = b->pool;
    memcpy(b->cfg.band_hz, w->chirp_hz, sizeof b->cfg.band_hz);
    b->cfg.gate_m[0] = 0.3;
    b->cfg.gate_m[1] = b->reach_m;
    b->cfg.chirp = (struct chirp){w->chirp_hz[0], w->chirp_hz[1], w->chirp_s, false};
}

void bumper_stop(struct bumper *b)
{
    pulse_compress_destroy(b->compress[0]);
    pulse_compress_destroy(b->compress[1]);
    free(b->rx);
    free(b->traces);
    pool_destroy(b->pool);
}

struct frames *bumper_frames(struct bumper *b)
{
    struct frames *f;
    if (frames_create(&f, &b->cfg))
        abort();
    return f;
}

double bumper_time_s(const struct bumper *b, size_t k)
{
    return (double)(k / b->together) * b->slot_s;
}

static bool is_down(const struct bumper *b, size_t k)
{
    return b->alternates && k % 2;
}

/* What a ping hears of ping j's chirp. */
static void hear(struct bumper *b, size_t k, size_t j)
{
    for (size_t w = 0; w <= b->n_others; w++)
        for (size_t i = 0; i < b->geometry.n_microphones; i++)
            moving_record(w ? &b->others[w - 1] : &b->world, bumper_time_s(b, k),
                          bumper_time_s(b, j), is_down(b, j),
                          b->speakers_m[j % b->geometry.n_speakers], b->microphones_m[i],
                          b->n_rx, b->rx + i * b->n_rx);
}

struct moving *bumper_also(struct bumper *b)
{
    if (b->n_others == BUMPER_OTHERS)
        abort();
    b->others[b->n_others] = b->world;
    return &b->others[b->n_others++];
}

void bumper_ping(struct bumper *b, size_t k, struct frames_ping *out)
{
    double length_s = (double)b->n_rx / b->world.sample_rate_hz;
    memset(b->rx, 0, b->geometry.n_microphones * b->n_rx * sizeof *b->rx);
    size_t around = b->crosstalk ? b->together * (size_t)ceil(length_s / b->slot_s) : 0;
    for (size_t j = k > around ? k - around : 0; j <= k + around; j++)
        hear(b, k, j);
    for (size_t q = 0; b->noise > 0.0 && q < b->geometry.n_microphones * b->n_rx; q++)
        b->rx[q] += (float)(b->noise * dice_normal(&b->seed));
    pulse_compress_execute(b->compress[is_down(b, k)], b->rx, b->n_rx, b->traces);
    *out = (struct frames_ping){.stamp_ns = EPOCH_NS + llrint(1e9 * bumper_time_s(b, k)),
                                .speaker = k % b->geometry.n_speakers,
                                .down = is_down(b, k),
                                .traces = b->traces};
}

void bumper_add(struct bumper *b, struct frames *f, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        struct frames_ping ping;
        bumper_ping(b, k, &ping);
        frames_add(f, &ping);
    }
}

void bumper_point(const struct bumper *b, size_t k, double out[3])
{
    double t = bumper_time_s(b, k), p[3];
    for (int a = 0; a < 3; a++)
        p[a] = b->world.at_m[a] + t * b->world.velocity_m_s[a];
    moving_to_array(&b->world, t, p, out);
}

void bumper_drive(struct bumper *b)
{
    const struct ego_motion m = {b->world.speed_m_s, b->world.yaw_rate_rad_s};
    for (int k = -5; k < 100; k++)
        ego_path_add(&b->path, EPOCH_NS + k * 20000000LL, &m);
    b->motion.path = &b->path;
}

float bumper_peak(const struct bumper *b, const float *image, double at_m[3])
{
    size_t best = 0;
    for (size_t v = 0; v < grid_size(&b->cfg.grid); v++) {
        assert_true(isfinite(image[v]));
        best = image[v] > image[best] ? v : best;
    }
    struct peak_fit fit;
    peak_fit(&b->cfg.grid, image, best, 1e3, PEAK_ZERO_EMPTY, NULL, &fit);
    memcpy(at_m, fit.position_m, sizeof fit.position_m);
    return image[best];
}
