/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/api/api.h"
#include "recon/tail.h"

#define FULL_SCALE  0.9999f
#define CLIPPED_RUN 3 /* one sample or two at full scale may be a loud sound */

void api_pings_forget(struct api_pings *p)
{
    survey_clear(&p->survey);
    free(p->clean);
    free(p->clipped);
    free(p->not_finite);
    free(p->heard);
    *p = (struct api_pings){.clipped_samples = p->clipped_samples,
                            .not_finite_samples = p->not_finite_samples};
}

int api_pings_survey(struct api_pings *p, const struct survey *survey,
                     struct anlos_error *why)
{
    api_pings_forget(p);
    p->clipped = calloc(survey->n_microphones, sizeof *p->clipped);
    p->not_finite = calloc(survey->n_microphones, sizeof *p->not_finite);
    p->heard = calloc(survey->n_speakers, sizeof *p->heard);
    if (!p->clipped || !p->not_finite || !p->heard || survey_copy(&p->survey, survey)) {
        api_pings_forget(p);
        return api_fail(why, ANLOS_NO_MEMORY, "survey: out of memory");
    }
    p->survey_id = survey_id(survey);
    return 0;
}

static int check_ping(const struct api_pings *p, const struct api_config *cfg,
                      const struct anlos_ping *ping, struct anlos_error *why)
{
    const struct survey *s = &p->survey;

    if (!p->survey_id)
        return api_fail(why, ANLOS_NOT_READY,
                        "a ping before there is a survey; call anlos_pipeline_survey");
    if (ping->survey && ping->survey != p->survey_id)
        return api_fail(why, ANLOS_INVALID,
                        "a ping of the survey %016llx, but planned is for %016llx; give "
                        "that survey first",
                        (unsigned long long)ping->survey,
                        (unsigned long long)p->survey_id);
    if (ping->n_microphones != s->n_microphones)
        return api_fail(why, ANLOS_INVALID,
                        "a ping of %zu microphones, but the survey has %zu",
                        ping->n_microphones, s->n_microphones);
    if (ping->speaker >= s->n_speakers || ping->position >= s->n_positions)
        return api_fail(why, ANLOS_INVALID,
                        "a ping of speaker %u at position %u, but the survey has %zu and "
                        "%zu, counted from 0",
                        ping->speaker, ping->position, s->n_speakers, s->n_positions);
    if (ping->n_samples < s->slot_samples)
        return api_fail(why, ANLOS_INVALID,
                        "a ping of %zu samples, expected a slot at least, %zu; best are "
                        "%zu",
                        ping->n_samples, s->slot_samples,
                        s->slot_samples + tail_samples(s));
    if (ping->n_samples > SIZE_MAX / sizeof(float) / s->n_microphones)
        return api_fail(why, ANLOS_INVALID, "a ping of %zu samples", ping->n_samples);
    if (ping->down && !s->chirp_alternates)
        return api_fail(why, ANLOS_INVALID,
                        "a ping whose chirp ran down, but the survey's does not "
                        "alternate");
    if (ping->has_temperature &&
        !(ping->temperature_c >= -60.0 && ping->temperature_c <= 80.0))
        return api_fail(why, ANLOS_INVALID, "a ping in air of %g C, expected -60 to 80",
                        ping->temperature_c);
    if (ping->background && cfg->inside.frontend.background == BACKGROUND_NONE)
        return api_fail(why, ANLOS_INVALID,
                        "a ping of the background, but the configuration says none; "
                        "expected ANLOS_BACKGROUND_RECORDED");
    int code = api_there(ping->samples, "samples of a ping", why);
    if (!code)
        code = api_stamp(ping->capture_ns, "capture_ns of a ping", why);
    return code ? code : api_stamp(ping->received_ns, "received_ns of a ping", why);
}

/* Counts what is not finite, and what is at full scale where nobody has. */
static bool look(struct api_pings *p, const struct anlos_ping *ping)
{
    bool clean = true;

    for (size_t m = 0; m < ping->n_microphones; m++) {
        const float *x = ping->samples + m * ping->n_samples;
        uint32_t broken = 0, clipped = 0, run = 0;
        for (size_t i = 0; i < ping->n_samples; i++) {
            broken += !isfinite(x[i]);
            run = fabsf(x[i]) >= FULL_SCALE ? run + 1 : 0;
            clipped += run == CLIPPED_RUN ? CLIPPED_RUN : run > CLIPPED_RUN;
        }
        p->not_finite[m] = broken;
        p->clipped[m] = ping->clipped ? ping->clipped[m] : clipped;
        p->not_finite_samples += broken;
        p->clipped_samples += p->clipped[m];
        clean = clean && !broken;
    }
    return clean;
}

/* A copy with zeros in place of what is not finite. */
static const float *scrub(struct api_pings *p, const struct anlos_ping *ping,
                          struct anlos_error *why)
{
    size_t n = ping->n_microphones * ping->n_samples;

    if (p->clean_samples < ping->n_samples) {
        float *fresh = calloc(n, sizeof *fresh);
        if (!fresh) {
            api_fail(why, ANLOS_NO_MEMORY, "a ping of %zu samples: out of memory", n);
            return NULL;
        }
        free(p->clean);
        p->clean = fresh;
        p->clean_samples = ping->n_samples;
    }
    for (size_t i = 0; i < n; i++)
        p->clean[i] = isfinite(ping->samples[i]) ? ping->samples[i] : 0.0f;
    return p->clean;
}

/* A speaker that is heard again begins another round. */
static uint32_t frame_of(struct api_pings *p, const struct api_config *cfg,
                         const struct anlos_ping *ping)
{
    if (!cfg->inside.is_static)
        return 0;
    if (ping->frame)
        return ping->frame;
    if (!p->frame || p->heard[ping->speaker]) {
        memset(p->heard, 0, p->survey.n_speakers * sizeof *p->heard);
        p->frame++;
    }
    p->heard[ping->speaker] = true;
    return p->frame;
}

int api_pings_take(struct api_pings *p, const struct api_config *cfg,
                   const struct anlos_ping *given, struct ping *out, int64_t *now_ns,
                   struct anlos_error *why)
{
    struct anlos_ping own;
    int code = API_TAKE(&own, given, "struct anlos_ping", why);

    if (!code)
        code = check_ping(p, cfg, &own, why);
    if (code)
        return code;
    const float *samples = look(p, &own) ? own.samples : scrub(p, &own, why);
    if (!samples)
        return ANLOS_NO_MEMORY;
    double ping_s = (double)own.n_samples / p->survey.sample_rate_hz;
    *now_ns = own.received_ns ? own.received_ns : own.capture_ns + llrint(1e9 * ping_s);
    *out = (struct ping){.survey_id = p->survey_id,
                         .capture_ns = own.capture_ns,
                         .scan = own.scan,
                         .frame = frame_of(p, cfg, &own),
                         .pass = own.background ? PASS_BACKGROUND : PASS_SCENE,
                         .position = own.position,
                         .speaker = own.speaker,
                         .stage_m = p->survey.stage_positions_m[own.position],
                         .temperature_c = own.has_temperature ? own.temperature_c : NAN,
                         .down = own.down,
                         .valid = true,
                         .n_microphones = own.n_microphones,
                         .n_samples = own.n_samples,
                         .samples = samples,
                         .clipped = p->clipped,
                         .not_finite = p->not_finite};
    return 0;
}
