#include "dsp/band_lanes.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/band_lanes_parts.h"

static float *floats_alloc(size_t n)
{
    size_t line = VECTOR_LANES * sizeof(float);

    return aligned_alloc(line, (n * sizeof(float) + line - 1) / line * line);
}

static int places_create(struct band_lanes *bl)
{
    const struct band_plan *p = bl->plan;
    size_t m = p->n_forward, n = p->layout.n_bins;

    bl->below = malloc(n * sizeof(*bl->below));
    bl->above = malloc(n * sizeof(*bl->above));
    if (!bl->below || !bl->above)
        return -ENOMEM;
    for (size_t place = 0; place < m; place++) {
        size_t k = bl->forward->number[place];

        if (k >= p->first && k - p->first < n)
            bl->below[k - p->first] = (uint32_t)place;
        k = m - 1 - k;
        if (k >= p->first && k - p->first < n)
            bl->above[k - p->first] = (uint32_t)place;
    }
    return 0;
}

int band_lanes_create(struct band_lanes **out, const struct band_plan *plan)
{
    struct band_lanes *bl = calloc(1, sizeof(*bl));
    size_t r = plan->layout.n_streams, n_samples = plan->layout.n_output + LANES;
    int err;

    if (!bl)
        return -ENOMEM;
    bl->plan = plan;
    bl->rows = floats_alloc(r * TILE * LANES);
    bl->spectrum = floats_alloc(r / 2 * plan->n_forward * POINT);
    bl->output = floats_alloc(r * band_lanes_output_stride(plan));
    bl->samples = floats_alloc(n_samples * POINT);
    err = bl->rows && bl->spectrum && bl->output && bl->samples ? 0 : -ENOMEM;
    if (!err)
        memset(bl->samples, 0, n_samples * POINT * sizeof(float));
    if (!err)
        err = lane_fft_create(&bl->forward, plan->n_forward);
    if (!err)
        err = lane_fft_create(&bl->inverse, plan->n_inverse);
    if (!err)
        err = places_create(bl);
    if (err)
        band_lanes_destroy(bl);
    else
        *out = bl;
    return err;
}

void band_lanes_destroy(struct band_lanes *bl)
{
    if (!bl)
        return;
    lane_fft_destroy(bl->forward);
    lane_fft_destroy(bl->inverse);
    free(bl->below);
    free(bl->above);
    free(bl->rows);
    free(bl->spectrum);
    free(bl->output);
    free(bl->samples);
    free(bl);
}

void band_lanes_filter(const struct band_plan *plan, float *filter, size_t lane,
                       const float complex *of_lane)
{
    size_t n = plan->layout.n_streams * plan->layout.n_bins;

    for (size_t i = 0; i < n; i++) {
        filter[i * POINT + lane] = crealf(of_lane[i]);
        filter[i * POINT + LANES + lane] = cimagf(of_lane[i]);
    }
}

void band_lanes_execute(struct band_lanes *bl, const float *x, size_t x_stride, size_t n,
                        const float *filter, bool shared, float complex *restrict y,
                        size_t n_channels)
{
    const struct band_lanes_input in = {x, x_stride, n, n_channels};

    band_lanes_mix(bl, &in);
    band_lanes_transform(bl, filter, shared);
    band_lanes_combine(bl);
    band_lanes_store(bl, y, n_channels);
}
