/* SPDX-License-Identifier: MIT */
/* The paper's chain from samples to image, after its own compression. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <unistd.h>

#include <cmocka.h>

#include "recon/detection/peak.h"
#include "tests/nodes/near.h"
#include "tests/nodes/simulated.h"

/* Midpoints 0.4 x 0.4 m around the point, on lines of 2.5 cm, which resolve 6 cm there.
 */
#define SCENE                                                                            \
    SIMULATED_BASE SIMULATED_POINT                                                       \
        "slot_samples: 1500\n"                                                           \
        "speakers_m: [\n"                                                                \
        "  [0, -0.1, 0], [0, -0.05, 0], [0, 0.0, 0], [0, 0.05, 0],\n"                    \
        "  [0, 0.1, 0], [0, 0.15, 0], [0, 0.2, 0], [0, 0.25, 0],\n"                      \
        "  [0, 0.3, 0]]\n"                                                               \
        "microphones_m: [\n"                                                             \
        "  [0.03, -0.1, 0], [0.03, -0.05, 0], [0.03, 0.0, 0],\n"                         \
        "  [0.03, 0.05, 0], [0.03, 0.1, 0], [0.03, 0.15, 0],\n"                          \
        "  [0.03, 0.2, 0], [0.03, 0.25, 0], [0.03, 0.3, 0]]\n"                           \
        "stage: {axis: [1, 0, 0], positions_m: [\n"                                      \
        "  -0.1, -0.075, -0.05, -0.025, 0.0, 0.025, 0.05, 0.075, 0.1,\n"                 \
        "  0.125, 0.15, 0.175, 0.2, 0.225, 0.25, 0.275, 0.3]}\n"                         \
        "volume: {x_m: [-0.04, 0.3, 0.01], y_m: [-0.06, 0.28, 0.01], "                   \
        "z_m: [1, 1.4, 0.005]}\n"

static const double at_m[3] = {0.13, 0.11, 1.2};

static int set_up(void **state)
{
    int err = simulated_create(state);
    if (!err)
        simulated_record(*state, "point", SCENE);
    return err;
}

static void image(struct simulated *s, struct recon_job *job,
                  enum compression compression)
{
    static struct recon_options o; /* borrowed by the job */
    o = simulated_options(s, "paper");
    o.compression = compression;
    simulated_image(job, &o);
}

static void a_point_is_where_it_is_after_deramp(void **state)
{
    struct recon_job job;
    struct peak_fit fit;
    size_t best = 0;
    image(*state, &job, COMPRESSION_DERAMP);
    for (size_t v = 1; v < grid_size(&job.processing.grid); v++)
        best = job.intensity[v] > job.intensity[best] ? v : best;
    peak_fit(&job.processing.grid, job.intensity, best, 100.0, PEAK_ZERO_EMPTY, NULL,
             &fit);
    assert_true(hypot(fit.position_m[0] - at_m[0], fit.position_m[1] - at_m[1]) < 3e-3);
    assert_near(fit.position_m[2], at_m[2], 3e-3);
    recon_job_clear(&job);
}

/* Both take the whole chirp under the same window of the band, so nothing is left between
 * them but what the matched filter's whitening spares (1e-3). */
static void it_is_the_same_image_after_the_matched_filter(void **state)
{
    struct recon_job deramp, matched;
    double difference = 0.0, sum = 0.0;
    image(*state, &deramp, COMPRESSION_DERAMP);
    image(*state, &matched, COMPRESSION_MATCHED_FILTER);
    for (size_t v = 0; v < grid_size(&deramp.processing.grid); v++) {
        double d = (double)deramp.intensity[v] - (double)matched.intensity[v];
        difference += d * d;
        sum += (double)matched.intensity[v] * (double)matched.intensity[v];
    }
    assert_true(sqrt(difference / sum) < 0.01);
    recon_job_clear(&deramp);
    recon_job_clear(&matched);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_is_where_it_is_after_deramp),
        cmocka_unit_test(it_is_the_same_image_after_the_matched_filter),
    };
    return cmocka_run_group_tests(tests, set_up, simulated_destroy);
}
