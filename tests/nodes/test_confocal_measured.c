/* SPDX-License-Identifier: MIT */
/* Optical scans that were measured, of ../shared. */
#include "tests/optional.h"

#include <math.h>
#include <stdlib.h>

#include "nodes/anlos/confocal/confocal.h"

#define MEASURED SOURCE_DIR "/../shared/data/optical-confocal/data_"

static void run(struct confocal_job *job, const struct recon_options *o)
{
    struct error why = {""};

    optional_needs(o->confocal);
    if (confocal_job_run(job, o, &why))
        fail_msg("%s", why.text);
}

/* Mean of the maxima over depth in a rectangle. */
static double brightness(const struct confocal_job *job, double x0, double x1, double y0,
                         double y1)
{
    const struct grid *g = &job->grid;
    double sum = 0.0;
    int n = 0;
    for (size_t q = 0; q < g->n[0] * g->n[1]; q++) {
        double x = g->origin_m[0] + (double)(q % g->n[0]) * g->step_m[0];
        double y = g->origin_m[1] + (double)(q / g->n[0]) * g->step_m[1];
        float largest = 0.0f;
        if (x < x0 || x > x1 || y < y0 || y > y1)
            continue;
        for (size_t z = 0; z < g->n[2]; z++)
            largest = fmaxf(largest, job->intensity[z * g->n[0] * g->n[1] + q]);
        sum += largest;
        n++;
    }
    return sum / n;
}

/* Against the board below. */
static double darkness(const struct confocal_job *job, double x0, double x1, double y0,
                       double y1)
{
    return brightness(job, x0, x1, y0, y1) / brightness(job, x0, x1, -0.21, -0.17);
}

/* White board, dark arrow to the right below dark letters. */
static void the_arrow_of_the_exit_sign_points_to_the_right(void **state)
{
    static const char *const methods[2] = {"lct", "fk"};
    (void)state;
    for (int m = 0; m < 2; m++) {
        struct recon_options o = {
            .confocal = MEASURED "exit_sign.mat", .method = methods[m], .threads = 2};
        struct confocal_job job;
        run(&job, &o);
        double board = brightness(&job, -0.15, 0.15, -0.21, -0.17);
        double beside = brightness(&job, -0.39, -0.3, -0.2, 0.2);
        assert_true(darkness(&job, -0.15, 0.05, -0.115, -0.09) < 0.75); /* shaft */
        assert_true(darkness(&job, 0.11, 0.15, -0.15, -0.13) + 0.1 <    /* head */
                    darkness(&job, -0.15, -0.11, -0.15, -0.13));
        assert_true(beside < 0.4 * board);
        confocal_job_clear(&job);
    }
}

static void the_nine_dots_are_found_ten_centimetres_apart(void **state)
{
    (void)state;
    struct recon_options o = {
        .confocal = MEASURED "dot_chart_40cm.mat", .method = "fk", .threads = 2};
    struct confocal_job job;
    run(&job, &o);
    for (int dot = 0; dot < 9; dot++) {
        double x = 0.005 + 0.1 * (dot % 3 - 1), y = 0.1 * (dot / 3 - 1);
        bool found = false;
        for (size_t i = 0; i < job.detections->n_detections; i++) {
            const Anlos__Vec3 *p = job.detections->detections[i]->position_m;
            found = found ||
                    (hypot(p->x - x, p->y - y) < 0.012 && fabs(p->z - 0.4) < 0.02);
        }
        assert_true(found);
    }
    confocal_job_clear(&job);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_arrow_of_the_exit_sign_points_to_the_right),
        cmocka_unit_test(the_nine_dots_are_found_ten_centimetres_apart),
    };
    setenv("XDG_CACHE_HOME", "/dev/null", 1); /* no folder: nothing is kept */
    return optional_code(cmocka_run_group_tests(tests, NULL, NULL));
}
