#include "nodes/dsp/dsp.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/blanker.h"
#include "msgs/convert/survey.h"
#include "recon/survey.h"
#include "msgs/tensor.h"
#include "nodes/dsp/mean_background.h"
#include "nodes/dsp/microphones.h"
#include "nodes/dsp/recorded_background.h"
#include "nodes/dsp/standing.h"

/* That a sound from outside is none of the place. */
#define LONGEST_NS INT64_C(500000000)

struct dsp {
    struct dsp_config cfg;
    struct survey survey;
    uint64_t survey_id;
    struct processing processing;
    struct compressor *compressor; /* NULL: no survey yet */
    struct recorded_background *recorded;
    struct mean_background *mean; /* of an array that stands */
    struct standing standing;
    struct blanker *blanker;
    bool *unfit;          /* [n_microphones], as masked */
    bool missing_noticed; /* a speaker's background */
    double ambient_c;     /* NaN: not known */
    int64_t capture_ns;   /* of the newest ping */
    struct trace_format format;
    float *padded;         /* [n_microphones][ping_samples] */
    float complex *traces; /* [n_microphones][format.n_samples] */
    struct microphones *microphones;
    protobuf_c_boolean *masked; /* [n_microphones]: unfit, or its background was */
    struct tensor_view view;
};

int dsp_create(struct dsp **out, const struct dsp_config *cfg)
{
    struct dsp *d = calloc(1, sizeof *d);

    if (!d)
        return -ENOMEM;
    d->cfg = *cfg;
    d->ambient_c = NAN;
    *out = d;
    return 0;
}

static void clear(struct dsp *d)
{
    compressor_destroy(d->compressor);
    recorded_background_destroy(d->recorded);
    mean_background_destroy(d->mean);
    free(d->padded);
    free(d->traces);
    free(d->masked);
    free(d->unfit);
    blanker_destroy(d->blanker);
    microphones_destroy(d->microphones);
    survey_clear(&d->survey);
    *d = (struct dsp){.cfg = d->cfg, .standing = d->standing, .ambient_c = d->ambient_c};
}

/* Judged by what lies in the gate. */
static int create_blanker(struct dsp *d)
{
    const struct trace_format *f = &d->format;
    double from = ceil((d->processing.gate_s[0] - f->t0_s) * f->rate_hz);
    struct blanker_config cfg = {.n_channels = d->survey.n_microphones,
                                 .n_samples = f->n_samples,
                                 .until = f->n_samples,
                                 .longest_ns = LONGEST_NS};

    cfg.from = (size_t)fmin(fmax(from, 0.0), (double)f->n_samples - 1.0);
    return blanker_create(&d->blanker, &cfg);
}

static int allocate(struct dsp *d)
{
    size_t n_mics = d->survey.n_microphones;

    d->padded = calloc(n_mics * d->processing.ping_samples, sizeof *d->padded);
    d->traces = calloc(n_mics * d->format.n_samples, sizeof *d->traces);
    d->masked = calloc(n_mics, sizeof *d->masked);
    d->unfit = calloc(n_mics, sizeof *d->unfit);
    if (!d->padded || !d->traces || !d->masked || !d->unfit)
        return -ENOMEM;
    int err = microphones_create(&d->microphones, n_mics);
    if (!err)
        err = create_blanker(d);
    if (!err)
        err = mean_background_create(&d->mean, d->survey.n_speakers, n_mics,
                                     d->format.n_samples, d->cfg.background_s);
    if (!err)
        err = recorded_background_create(&d->recorded, &d->survey, &d->processing,
                                         &d->format);
    return err;
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
    out->receipt.frame = ping->frame;
    out->receipt.usable = usable;
}

/* Samples [n_microphones][*n] of a ping that fits the survey, else NULL, with a note if
 * there is one. */
static const float *ping_samples(const struct dsp *d, const Anlos__Ping *ping, size_t *n,
                                 struct dsp_output *out)
{
    size_t extents[2];
    const float *x = ping->samples ? tensor_f32(ping->samples, 2, extents) : NULL;

    if (!d->compressor)
        return NULL;
    if (ping->survey_id != d->survey_id) {
        snprintf(out->note, sizeof out->note, "a ping of another survey cannot be used");
        return NULL;
    }
    if (!x || extents[0] != d->survey.n_microphones || ping->n_clipped != extents[0] ||
        ping->n_not_finite != extents[0] || ping->position >= d->survey.n_positions ||
        ping->speaker >= d->survey.n_speakers ||
        (ping->down && !d->survey.chirp_alternates)) {
        snprintf(out->note, sizeof out->note, "a ping does not have the survey's shape");
        return NULL;
    }
    *n = extents[1];
    return x;
}

/* A scan records what is missing, an array that stands does not. */
static void notice_missing(struct dsp *d, const Anlos__Ping *ping, struct dsp_output *out)
{
    if (!ping->frame || d->missing_noticed)
        return;
    d->missing_noticed = true;
    snprintf(out->note, sizeof out->note,
             "speaker %u has no background: its pings are not used", ping->speaker);
}

static void silence_masked(struct dsp *d)
{
    for (size_t m = 0; m < d->survey.n_microphones; m++)
        if (d->masked[m])
            memset(d->traces + m * d->format.n_samples, 0,
                   d->format.n_samples * sizeof *d->traces);
}

static void compress(struct dsp *d, bool down, const float *x, size_t n)
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
    compressor_execute_either(d->compressor, down, x, n, d->traces);
    silence_masked(d);
}

/* Of an array that stands it is the mean so far. */
static void keep_background(struct dsp *d, const Anlos__Ping *ping)
{
    const float complex *traces = d->traces;

    if (ping->frame)
        traces = mean_background_record(d->mean, ping, d->traces);
    recorded_background_keep(d->recorded, ping, d->masked, traces);
}

/* true: a background was subtracted. */
static bool subtract_adaptive(struct dsp *d, size_t speaker, bool stands)
{
    if (stands)
        return mean_background_subtract(d->mean, speaker, d->capture_ns, d->masked,
                                        d->traces);
    mean_background_reset(d->mean);
    return false;
}

static bool stands_still(const struct dsp *d)
{
    double ping_s = (double)d->processing.ping_samples / d->survey.sample_rate_hz;

    return standing_between(&d->standing, d->capture_ns,
                            d->capture_ns + llrint(1e9 * ping_s));
}

/* Of an array that stands, whose pings nobody takes again: a ping that a sound from
 * outside drowned is of no use. */
static bool is_drowned(struct dsp *d, const float complex *background)
{
    for (size_t m = 0; m < d->survey.n_microphones; m++)
        d->unfit[m] = d->masked[m];
    return blanker_execute(d->blanker, d->traces, background, d->unfit, d->capture_ns);
}

static void blank(struct dsp *d)
{
    for (size_t m = 0; m < d->survey.n_microphones; m++)
        d->masked[m] = true;
    silence_masked(d);
    mean_background_drop(d->mean);
}

/* true: a background was subtracted, or would have been. */
static bool subtract_background(struct dsp *d, const Anlos__Ping *ping, bool *blanked)
{
    bool adaptive = d->cfg.background == BACKGROUND_ADAPTIVE;
    bool stands = adaptive && stands_still(d);
    const float complex *background = stands ? mean_background_of(d->mean, ping->speaker)
                                             : NULL;

    *blanked = ping->frame && is_drowned(d, background);
    if (*blanked) {
        blank(d);
        return background ||
               (!adaptive && recorded_background_is_kept(d->recorded, ping));
    }
    return adaptive
               ? subtract_adaptive(d, ping->speaker, stands)
               : recorded_background_subtract(d->recorded, ping, d->masked, d->traces);
}

static void write_traces(struct dsp *d, const Anlos__Ping *ping, uint64_t clipped,
                         bool subtracted, bool blanked, Anlos__Traces *out)
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
    out->blanked = blanked;
    out->clipped_samples = clipped;
    out->temperature_c = isnan(ping->temperature_c) ? d->ambient_c : ping->temperature_c;
    out->frame = ping->frame;
    out->down = ping->down;
}

void dsp_ego(struct dsp *d, const Anlos__EgoMotion *ego, int64_t capture_ns)
{
    standing_hear(&d->standing, ego, capture_ns);
}

void dsp_ambient(struct dsp *d, const Anlos__Ambient *ambient)
{
    d->ambient_c = ambient->temperature_c;
}

void dsp_stamp(struct dsp *d, int64_t capture_ns)
{
    d->capture_ns = capture_ns;
}

/* A scan takes again what was of no use; an array that stands goes on. */
static void refuse(struct dsp_output *out, const Anlos__Ping *ping, Anlos__Pass pass)
{
    if (!ping->frame)
        acknowledge(out, ping, pass, false);
}

void dsp_ping(struct dsp *d, const Anlos__Ping *ping, struct dsp_output *out)
{
    size_t n = 0;
    bool blanked;

    *out = (struct dsp_output){0};
    anlos__traces__init(&out->traces);
    anlos__receipt__init(&out->receipt);
    const float *x = ping_samples(d, ping, &n, out);
    if (!x || !ping->valid) {
        refuse(out, ping, ping->pass);
        return;
    }
    if (ping->pass == ANLOS__PASS__SCENE && d->cfg.background == BACKGROUND_RECORDED &&
        !recorded_background_is_kept(d->recorded, ping)) {
        refuse(out, ping, ANLOS__PASS__BACKGROUND);
        notice_missing(d, ping, out);
        return;
    }
    uint64_t clipped = microphones_judge(d->microphones, ping, x, n, d->masked,
                                         &out->channels, out->note, sizeof out->note);
    compress(d, ping->down, x, n);
    if (ping->pass == ANLOS__PASS__BACKGROUND) {
        keep_background(d, ping);
        if (!ping->frame)
            acknowledge(out, ping, ANLOS__PASS__BACKGROUND, true);
        return;
    }
    bool subtracted = subtract_background(d, ping, &blanked);
    out->has_traces = true;
    write_traces(d, ping, clipped, subtracted, blanked, &out->traces);
}

const struct air *dsp_air(const struct dsp *d)
{
    static const struct air nothing = {.pings = 0};

    return d->recorded ? recorded_background_air(d->recorded) : &nothing;
}

void dsp_destroy(struct dsp *d)
{
    if (!d)
        return;
    clear(d);
    free(d);
}
