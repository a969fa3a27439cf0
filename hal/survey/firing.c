/* SPDX-License-Identifier: MIT */
#include "hal/survey/firing.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"

enum { STREAM_JITTER = 17, STREAM_STAGGER = 18 };

#define MOST_SAMPLES 1e6
#define MOST_S       1.0
#define MOST_M       100.0

static int whole_number(const struct device *d, const char *key, double max,
                        double *value, struct error *why)
{
    int err = device_number(d, key, 1, max, value, why);

    if (!err && *value != floor(*value))
        err = error_say(why, -EINVAL, "option %s=%s: expected a whole number", key,
                        device_option(d, key));
    return err;
}

int firing_from_device(struct firing *out, const struct device *d, struct error *why)
{
    static const char *const ways[] = {"no", "yes", NULL};

    *out = (struct firing){.chirps = FIRING_AS_THEY_ARE, .stage = FIRING_STAGE_AS_IT_IS};
    int err = whole_number(d, "slot_samples", MOST_SAMPLES, &out->slot_samples, why);
    if (!err)
        err = whole_number(d, "together", 2, &out->together, why);
    if (!err)
        err = whole_number(d, "positions", SURVEY_MAX_ELEMENTS, &out->positions, why);
    if (!err)
        err = device_number(d, "chirp_s", 1e-6, MOST_S, &out->chirp_s, why);
    if (!err)
        err = device_number(d, "far_m", 1e-3, MOST_M, &out->far_m, why);
    if (!err)
        err = whole_number(d, "jitter_samples", MOST_SAMPLES, &out->jitter_samples, why);
    int both = err ? err : device_choice(d, "alternates", ways, why);
    if (both >= 0 && device_option(d, "alternates"))
        out->chirps = both ? FIRING_BOTH_WAYS : FIRING_ONE_WAY;
    int on = both < 0 ? both : device_choice(d, "continuous", ways, why);
    if (on >= 0 && device_option(d, "continuous"))
        out->stage = on ? FIRING_STAGE_GOES_ON : FIRING_STAGE_STOPS;
    int staggers = on < 0 ? on : device_choice(d, "stagger", ways, why);
    if (staggers >= 0 && device_option(d, "stagger"))
        out->stagger = staggers ? FIRING_STAGGER_YES : FIRING_STAGGER_NO;
    if (out->stagger == FIRING_STAGGER_YES && out->jitter_samples > 0.0)
        return error_say(why, -EINVAL, "option stagger: not beside jitter_samples");
    return staggers < 0 ? staggers : 0;
}

int firing_refuse_uneven(const struct firing *f, const char *why_not, struct error *why)
{
    if (f->jitter_samples > 0.0)
        return error_say(why, -EINVAL, "option jitter_samples: %s", why_not);
    return f->stagger == FIRING_STAGGER_YES
               ? error_say(why, -EINVAL, "option stagger: %s", why_not)
               : 0;
}

int firing_from_uri(struct firing *out, const char *uri, struct error *why)
{
    const char *colon = strchr(uri, ':');
    struct device d;
    int err = device_parse(&d, colon ? colon + 1 : uri, NULL, why);

    if (err)
        return err;
    err = firing_from_device(out, &d, why);
    device_clear(&d);
    return err;
}

int firing_apply(struct survey *s, const struct firing *f, struct error *why)
{
    struct error inner = {""};

    if (f->far_m > 0.0 && !s->has_gate)
        return error_say(why, -EINVAL, "option far_m: there is no gate_m to end there");
    if (f->positions > 0.0 &&
        (f->positions < 2.0 || f->positions > (double)s->n_positions || s->pings_m))
        return error_say(why, -EINVAL,
                         "option positions=%.0f: expected 2 to the %zu that there are",
                         f->positions, s->pings_m ? 0 : s->n_positions);
    if (f->positions > 0.0)
        survey_spread_positions(s, (size_t)f->positions);
    if (f->slot_samples > 0.0)
        s->slot_samples = (size_t)f->slot_samples;
    if (f->together > 0.0)
        s->together = (size_t)f->together;
    if (f->chirp_s > 0.0)
        s->chirp_duration_s = f->chirp_s;
    if (f->far_m > 0.0)
        s->gate_m[1] = f->far_m;
    if (f->chirps != FIRING_AS_THEY_ARE)
        s->chirp_alternates = f->chirps == FIRING_BOTH_WAYS;
    if (f->stage != FIRING_STAGE_AS_IT_IS)
        s->continuous = f->stage == FIRING_STAGE_GOES_ON;
    int err = survey_check(s, &inner);
    return err ? error_say(why, err, "with the options of the array: %s", inner.text) : 0;
}

struct firing_slots firing_slots(const struct survey *s, const struct firing *f,
                                 bool staggers, uint64_t seed)
{
    struct firing_slots slots = {.slot_samples = s->slot_samples, .seed = seed};

    if (f->stagger != FIRING_STAGGER_AS_IT_IS)
        staggers = f->stagger == FIRING_STAGGER_YES;
    if (f->jitter_samples > 0.0)
        slots.jitter_samples = (size_t)f->jitter_samples;
    else if (staggers)
        slots.stagger_samples = s->slot_samples / FIRING_STAGGER_PART;
    return slots;
}

static uint64_t draw(const struct firing_slots *f, uint64_t stream, uint64_t which,
                     size_t n)
{
    struct random r;

    random_seed(&r, (uint64_t[]){f->seed, stream, which}, 3);
    return (uint64_t)(random_even(&r) * (double)n);
}

uint64_t firing_start(const struct firing_slots *f, uint64_t slot)
{
    uint64_t start = slot * (f->slot_samples + f->jitter_samples);

    if (f->jitter_samples)
        return start + draw(f, STREAM_JITTER, slot, f->jitter_samples + 1);
    if (!f->stagger_samples)
        return start;
    uint64_t block = slot / FIRING_STAGGER_SLOTS;
    uint64_t longer = draw(f, STREAM_STAGGER, block, FIRING_STAGGER_SLOTS - 1);
    return start + f->stagger_samples * (block + (slot % FIRING_STAGGER_SLOTS > longer));
}

uint64_t firing_slot_before(const struct firing_slots *f, double sample)
{
    double longer = (double)f->jitter_samples +
                    (double)f->stagger_samples / FIRING_STAGGER_SLOTS;
    double latest = (double)(f->jitter_samples + f->stagger_samples);
    double n = ceil((sample - latest) / ((double)f->slot_samples + longer));

    return n > 0.0 ? (uint64_t)n : 0;
}

float *firing_emission(const struct survey *s, bool down, size_t *n)
{
    double rate_hz = s->sample_rate_hz;
    double start_hz = down ? s->chirp_stop_hz : s->chirp_start_hz;
    double stop_hz = down ? s->chirp_start_hz : s->chirp_stop_hz;
    double slope = (stop_hz - start_hz) / s->chirp_duration_s;
    *n = (size_t)llround(s->chirp_duration_s * rate_hz);
    float *out = calloc(*n + 1, sizeof *out);
    for (size_t i = 0; out && i < *n; i++) {
        double t = (double)i / rate_hz;
        double turns = fmod((start_hz + 0.5 * slope * t) * t, 1);
        double phase = 2 * M_PI * turns;
        out[i] = (float)(s->chirp_sine ? sin(phase) : cos(phase));
    }
    return out;
}
