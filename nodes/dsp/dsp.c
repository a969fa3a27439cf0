#include "nodes/dsp/dsp.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/background.h"
#include "dsp/drift_track.h"
#include "msgs/survey.h"
#include "msgs/tensor.h"
#include "nodes/rt/channel_check.h"

struct dsp {
    struct dsp_config cfg;
    struct survey survey;
    uint64_t survey_id;
    struct processing processing;
    struct compressor *compressor; /* NULL: no survey yet */
    struct background *background;
    struct trace_format format;
    struct drift *drift;
    struct drift_track track;
    struct air air;
    uint32_t scan;               /* that track and air belong to */
    float *padded;               /* [n_microphones][ping_samples] */
    float complex *traces;       /* [n_microphones][format.n_samples] */
    bool *background_masked;     /* [n_pings][n_microphones] */
    bool *unfit;                 /* [n_microphones], of the newest ping; scratch later */
    protobuf_c_boolean *masked;  /* [n_microphones], or its background was */
    struct channel_check *check; /* of one ping at a time */
    unsigned *noticed;           /* [n_microphones], faults said in the log already */
    struct tensor_view view;
};

int dsp_create(struct dsp **out, const struct dsp_config *cfg)
{
    struct dsp *d = calloc(1, sizeof *d);

    if (!d)
        return -ENOMEM;
    d->cfg = *cfg;
    *out = d;
    return 0;
}

static void clear(struct dsp *d)
{
    compressor_destroy(d->compressor);
    background_destroy(d->background);
    drift_destroy(d->drift);
    free(d->padded);
    free(d->traces);
    free(d->background_masked);
    free(d->unfit);
    free(d->masked);
    free(d->noticed);
    channel_check_destroy(d->check);
    survey_clear(&d->survey);
    *d = (struct dsp){.cfg = d->cfg};
}

static int allocate(struct dsp *d)
{
    size_t n_mics = d->survey.n_microphones;
    size_t n_pings = d->survey.n_positions * d->survey.n_speakers;

    d->padded = calloc(n_mics * d->processing.ping_samples, sizeof *d->padded);
    d->traces = calloc(n_mics * d->format.n_samples, sizeof *d->traces);
    d->background_masked = calloc(n_pings * n_mics, sizeof *d->background_masked);
    d->unfit = calloc(n_mics, sizeof *d->unfit);
    d->masked = calloc(n_mics, sizeof *d->masked);
    d->noticed = calloc(n_mics, sizeof *d->noticed);
    if (!d->padded || !d->traces || !d->background_masked || !d->unfit || !d->masked ||
        !d->noticed)
        return -ENOMEM;
    const struct drift_config cfg = {
        .format = d->format,
        .band_hz = {d->processing.band_hz[0], d->processing.band_hz[1]},
        .n_channels = n_mics,
    };
    int err = channel_check_create(&d->check, n_mics, 1);
    if (!err)
        err = drift_create(&d->drift, &cfg);
    if (err)
        return err;
    return background_create(&d->background, n_pings, n_mics, d->format.n_samples);
}

int dsp_survey(struct dsp *d, const Anlos__Survey *survey, struct complaint *why)
{
    if (d->compressor && d->survey_id == survey->id)
        return 0;
    clear(d);
    int err = survey_from_message(&d->survey, survey, why);
    if (!err)
        err = processing_plan(&d->processing, &d->survey, why);
    if (!err)
        err = compressor_create(&d->compressor, &d->processing, &d->survey,
                                d->cfg.compression, d->cfg.window, why);
    if (!err) {
        compressor_format(d->compressor, &d->format);
        err = allocate(d);
        if (err)
            complain(why, err, "background: %s", strerror(-err));
    }
    if (err)
        clear(d);
    else
        d->survey_id = survey->id;
    return err;
}

bool dsp_is_planned(const struct dsp *d)
{
    return d->compressor != NULL;
}

static void acknowledge(struct dsp_output *out, const Anlos__Ping *ping, Anlos__Pass pass,
                        bool usable)
{
    out->has_receipt = true;
    out->receipt.scan = ping->scan;
    out->receipt.pass = pass;
    out->receipt.position = ping->position;
    out->receipt.speaker = ping->speaker;
    out->receipt.usable = usable;
}

/* Samples [n_microphones][*n] of a ping that fits the survey, else NULL with a note. */
static const float *ping_samples(const struct dsp *d, const Anlos__Ping *ping, size_t *n,
                                 struct dsp_output *out)
{
    size_t extents[2];
    const float *x = ping->samples ? tensor_f32(ping->samples, 2, extents) : NULL;

    if (!d->compressor || ping->survey_id != d->survey_id) {
        snprintf(out->note, sizeof out->note, "a ping of another survey cannot be used");
        return NULL;
    }
    if (!x || extents[0] != d->survey.n_microphones || ping->n_clipped != extents[0] ||
        ping->n_not_finite != extents[0] || ping->position >= d->survey.n_positions ||
        ping->speaker >= d->survey.n_speakers) {
        snprintf(out->note, sizeof out->note, "a ping does not have the survey's shape");
        return NULL;
    }
    *n = extents[1];
    return x;
}

/* Each fault of each microphone is said once; for people they count from 1. */
static void notice(struct dsp *d, size_t mic, const struct channel_summary *summary,
                   struct dsp_output *out)
{
    const struct {
        bool is;
        const char *text;
    } faults[] = {{summary->silent, "is silent"},
                  {summary->damaged, "has samples that are not finite"},
                  {summary->clipped, "is clipped"}};

    for (unsigned i = 0; i < sizeof faults / sizeof *faults; i++) {
        size_t used = strlen(out->note);
        if (!faults[i].is || d->noticed[mic] & 1u << i)
            continue;
        d->noticed[mic] |= 1u << i;
        snprintf(out->note + used, sizeof out->note - used, "%smicrophone %zu %s",
                 used ? "; " : "", mic + 1, faults[i].text);
    }
}

/* Masks what is not fit; returns the clipped samples of all channels. */
static uint64_t judge(struct dsp *d, const Anlos__Ping *ping, const float *x, size_t n,
                      struct dsp_output *out)
{
    struct channel_summary summary;
    uint64_t clipped = 0;

    for (size_t m = 0; m < d->survey.n_microphones; m++)
        d->unfit[m] = false;
    channel_check_position(d->check, 0, n, x, ping->clipped, ping->not_finite, d->unfit);
    for (size_t m = 0; m < d->survey.n_microphones; m++) {
        channel_check_summary(d->check, m, &summary);
        notice(d, m, &summary, out);
        clipped += ping->clipped[m];
        d->masked[m] = d->unfit[m];
    }
    return clipped;
}

static void compress(struct dsp *d, const float *x, size_t n)
{
    size_t need = d->processing.ping_samples;

    if (n < need) {
        for (size_t m = 0; m < d->survey.n_microphones; m++) {
            memcpy(d->padded + m * need, x + m * n, n * sizeof *x);
            memset(d->padded + m * need + n, 0, (need - n) * sizeof *x);
        }
        x = d->padded;
        n = need;
    }
    compressor_execute(d->compressor, x, n, d->traces);
    for (size_t m = 0; m < d->survey.n_microphones; m++)
        if (d->masked[m])
            memset(d->traces + m * d->format.n_samples, 0,
                   d->format.n_samples * sizeof *d->traces);
}

/* Each scan begins anew: the air of the last one may be long gone. */
static void follow_scan(struct dsp *d, const Anlos__Ping *ping)
{
    if (d->air.sound_speed_m_s > 0.0 && ping->scan == d->scan)
        return;
    d->scan = ping->scan;
    drift_track_start(&d->track);
    air_start(&d->air, d->survey.sound_speed_m_s,
              d->survey.n_positions * d->survey.n_speakers);
}

/* Of what is not masked.  Subtracts the background as it sounds in the air of now. */
static void subtract(struct dsp *d, const float complex *background)
{
    struct drift_measurement now;

    for (size_t m = 0; m < d->survey.n_microphones; m++)
        d->unfit[m] = d->masked[m];
    drift_measure(d->drift, background, d->traces, d->unfit, &now);
    double stretch = drift_track_update(&d->track, &now);
    air_add(&d->air, stretch, drift_subtract(d->drift, stretch, background, d->traces));
}

static void write_traces(struct dsp *d, const Anlos__Ping *ping, uint64_t clipped,
                         bool subtracted, Anlos__Traces *out)
{
    out->survey_id = d->survey_id;
    out->scan = ping->scan;
    out->position = ping->position;
    out->stage_m = ping->stage_m;
    out->speaker = ping->speaker;
    out->samples = tensor_borrow_c64(&d->view, d->traces, 2, d->survey.n_microphones,
                                     d->format.n_samples);
    out->t0_s = d->format.t0_s;
    out->rate_hz = d->format.rate_hz;
    out->carrier_hz = d->format.carrier_hz;
    out->n_masked = d->survey.n_microphones;
    out->masked = d->masked;
    out->background_subtracted = subtracted;
    out->clipped_samples = clipped;
    out->temperature_c = ping->temperature_c;
}

void dsp_ping(struct dsp *d, const Anlos__Ping *ping, struct dsp_output *out)
{
    size_t n = 0;

    *out = (struct dsp_output){0};
    anlos__traces__init(&out->traces);
    anlos__receipt__init(&out->receipt);
    const float *x = ping_samples(d, ping, &n, out);
    if (!x || !ping->valid) {
        acknowledge(out, ping, ping->pass, false);
        return;
    }
    size_t n_mics = d->survey.n_microphones;
    size_t index = ping->position * d->survey.n_speakers + ping->speaker;
    bool *background_masked = d->background_masked + index * n_mics;
    const float complex *background = background_traces(d->background, index);
    if (ping->pass == ANLOS__PASS__SCENE && d->cfg.background && !background) {
        acknowledge(out, ping, ANLOS__PASS__BACKGROUND, false);
        return;
    }
    uint64_t clipped = judge(d, ping, x, n, out);
    compress(d, x, n);
    if (ping->pass == ANLOS__PASS__BACKGROUND) {
        for (size_t m = 0; m < n_mics; m++)
            background_masked[m] = d->masked[m];
        background_store(d->background, index, d->traces);
        acknowledge(out, ping, ANLOS__PASS__BACKGROUND, true);
        return;
    }
    follow_scan(d, ping);
    for (size_t m = 0; background && m < n_mics; m++)
        d->masked[m] = d->masked[m] || background_masked[m];
    if (background)
        subtract(d, background);
    out->has_traces = true;
    write_traces(d, ping, clipped, background != NULL, &out->traces);
}

const struct air *dsp_air(const struct dsp *d)
{
    return &d->air;
}

void dsp_destroy(struct dsp *d)
{
    if (!d)
        return;
    clear(d);
    free(d);
}
