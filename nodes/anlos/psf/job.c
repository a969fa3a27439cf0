#include "nodes/anlos/psf/job.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/file.h"
#include "nodes/anlos/recon/job.h"

#define HALF_WIDTHS  2.0 /* of a point's image, on each side of it in fine steps */
#define FINE_STEPS   8.0 /* in a width */
#define OTHER_DB     6.0 /* below the brightest: another object, not a sidelobe */
#define MAX_DETAIL_M 0.5 /* wider is no point whatever the method */

/* A whole reconstruction. */
static int image(struct recon_job *job, const struct recon_options *o,
                 struct complaint *why)
{
    int err = recon_job_open(job, o, why);
    if (!err)
        err = recon_job_plan(job, why);
    return err ? err : recon_job_run(job, why);
}

static size_t brightest(const struct grid *g, const float *v)
{
    size_t best = 0;
    for (size_t i = 0; i < grid_size(g); i++)
        if (v[i] > v[best])
            best = i;
    return best;
}

static void place(const struct grid *g, size_t voxel, size_t at[3], double at_m[3])
{
    at[0] = voxel % g->n[0];
    at[1] = voxel / g->n[0] % g->n[1];
    at[2] = voxel / (g->n[0] * g->n[1]);
    for (int a = 0; a < 3; a++)
        at_m[a] = g->origin_m[a] + g->step_m[a] * (double)at[a];
}

static size_t count_others(const Anlos__DetectionList *list)
{
    size_t others = 0;
    for (size_t i = 1; i < list->n_detections; i++)
        others += list->detections[i]->level_db >
                  list->detections[0]->level_db - OTHER_DB;
    return others;
}

/* Voxels above half the amplitude along an axis, in m: coarse, but never wild. */
static double seen_width(const struct grid *g, const float *v, const size_t at[3], int a)
{
    size_t stride = a == 0 ? 1 : a == 1 ? g->n[0] : g->n[0] * g->n[1];
    const float *peak = v + at[0] + g->n[0] * (at[1] + g->n[1] * at[2]);
    size_t up = 0, down = 0;
    while (at[a] + up + 1 < g->n[a] && peak[(up + 1) * stride] > 0.25f * *peak)
        up++;
    while (at[a] > down && *(peak - (down + 1) * stride) > 0.25f * *peak)
        down++;
    return (double)(up + down) * g->step_m[a];
}

/* How wide the point's image is there, more or less: as the geometry has it, or as the
 * image has when that is wider (powers, a wrong speed of sound). */
static void guess_widths(const struct recon_job *found, const size_t at[3],
                         const double at_m[3], double width_m[3])
{
    geometry_resolution_at(&found->processing.geometry, found->processing.band_hz, at_m,
                           width_m);
    for (int a = 0; a < 3; a++) {
        double seen_m = seen_width(&found->processing.grid, found->intensity, at, a);
        width_m[a] =
            fmax(isfinite(width_m[a]) ? width_m[a] : 0.0, fmin(seen_m, MAX_DETAIL_M));
    }
}

/* Where the point is, and fine steps around it as the volume of *fine. */
static int find_point(struct psf_job *job, const struct recon_job *found,
                      struct recon_options *fine, struct complaint *why)
{
    const struct grid *g = &found->processing.grid;
    size_t voxel = brightest(g, found->intensity), at[3];
    double at_m[3], width_m[3];
    place(g, voxel, at, at_m);
    if (!(found->intensity[voxel] > 0.0f))
        return complain(why, -EINVAL, "the image is empty");
    for (int a = 0; a < 3; a++)
        if (g->n[a] > 1 && (at[a] == 0 || at[a] + 1 == g->n[a]))
            return complain(why, -EINVAL,
                            "the brightest place, %.3f, %.3f, %.3f m, lies on the rim of "
                            "the volume; expected a corner reflector inside",
                            at_m[0], at_m[1], at_m[2]);
    guess_widths(found, at, at_m, width_m);
    for (int a = 0; a < 3; a++) {
        bool extends = g->n[a] > 1 && width_m[a] > 0.0;
        double half_m = extends ? HALF_WIDTHS * width_m[a] : 0.0;
        fine->volume_m[a][0] = at_m[a] - half_m;
        fine->volume_m[a][1] = at_m[a] + half_m;
        fine->volume_m[a][2] = extends ? width_m[a] / FINE_STEPS : g->step_m[a];
    }
    fine->has_volume = true;
    job->n_others = count_others(found->detections);
    return 0;
}

static int fit(struct psf_job *job, struct recon_job *fine, struct complaint *why)
{
    struct psf_file *f = &job->file;
    job->grid = fine->processing.grid;
    int err = psf_fit(&f->psf, &job->grid, fine->intensity,
                      brightest(&job->grid, fine->intensity));
    if (err)
        return complain(why, err,
                        err == -ENOMEM ? "out of memory"
                                       : "the brightest place is no point: no "
                                         "Gaussian fits it");
    geometry_resolution_at(&fine->processing.geometry, fine->processing.band_hz,
                           f->psf.centre_m, job->expected_m);
    f->measured = true;
    snprintf(f->method, sizeof f->method, "%s", fine->method);
    memcpy(f->band_hz, fine->processing.band_hz, sizeof f->band_hz);
    job->pings = imager_pings(fine->imager);
    job->pings_expected = fine->survey.n_positions * fine->survey.n_speakers;
    job->intensity = fine->intensity;
    fine->intensity = NULL;
    return 0;
}

int psf_job_measure(struct psf_job *job, const struct recon_options *options,
                    struct complaint *why)
{
    struct recon_job found, near;
    struct recon_options fine = *options;
    memset(job, 0, sizeof *job);
    int err = image(&found, options, why);
    if (!err)
        err = find_point(job, &found, &fine, why);
    recon_job_clear(&found);
    if (err)
        return err;
    err = image(&near, &fine, why);
    if (!err)
        err = fit(job, &near, why);
    recon_job_clear(&near);
    return err;
}

static int check_before(const struct geometry *g, const double at_m[3],
                        struct complaint *why)
{
    double least_m[3], most_m[3];
    geometry_aperture(g, least_m, most_m);
    return at_m[2] > most_m[2]
               ? 0
               : complain(why, -EINVAL,
                          "--at %g,%g,%g: not before the array; expected z above %g m",
                          at_m[0], at_m[1], at_m[2], most_m[2]);
}

int psf_job_compute(struct psf_job *job, const char *survey_path, const double at_m[3],
                    struct complaint *why)
{
    struct survey survey;
    struct geometry geometry;
    memset(job, 0, sizeof *job);
    int err = survey_load(&survey, survey_path, why);
    if (err)
        return err;
    processing_geometry(&geometry, &survey);
    if (!geometry.pings_m) /* those have no front */
        err = check_before(&geometry, at_m, why);
    if (err) {
        survey_clear(&survey);
        return err;
    }
    struct psf_config cfg = {
        .geometry = &geometry,
        .band_hz = {fmin(survey.chirp_start_hz, survey.chirp_stop_hz),
                    fmax(survey.chirp_start_hz, survey.chirp_stop_hz)},
        .at_m = {at_m[0], at_m[1], at_m[2]},
    };
    err = psf_compute(&job->file.psf, &cfg, &job->grid, &job->intensity);
    if (err == -ERANGE)
        complain(why, err,
                 "%s: its aperture resolves fewer than two axes at %g, %g, %g m",
                 survey_path, at_m[0], at_m[1], at_m[2]);
    else if (err)
        complain(why, err, "%s", strerror(-err));
    memcpy(job->file.band_hz, cfg.band_hz, sizeof cfg.band_hz);
    strcpy(job->file.method, "geometry");
    survey_clear(&survey);
    return err;
}

void psf_job_clear(struct psf_job *job)
{
    free(job->intensity);
    memset(job, 0, sizeof *job);
}
