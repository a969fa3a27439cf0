#include "nodes/anlos/calibrate/paths.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define OVER_FLOOR 8.0 /* times the median amplitude: no noise peaks so high */
#define UNDER_LOUDEST                                                                    \
    0.1 /* of the loudest: a reflector ahead may be louder than what                     \
           reaches the microphones beside the speakers */
#define LEAST_WINDOW_S 250e-6
#define PULSES         6.0

static double distance(const double a[3], const double b[3])
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

static struct path *paths_create(const struct survey *s)
{
    return calloc(s->n_speakers * s->n_microphones, sizeof(struct path));
}

struct path *paths_direct(const struct survey *s)
{
    struct path *out = paths_create(s);
    for (size_t p = 0; out && p < s->n_speakers * s->n_microphones; p++)
        out[p].distance_m = distance(s->speakers_m[p / s->n_microphones],
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
        out[p].distance_m = distance(image, s->microphones_m[p % s->n_microphones]);
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
                      struct time_zero *out, struct complaint *why)
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
        return complain(why, err,
                        "no microphone hears any speaker: nothing like the chirp in what "
                        "the array records within a ping; look at amplifiers, levels and "
                        "wiring, or the latency is longer than a slot");
    return err ? complain(why, err, "out of memory") : 0;
}
