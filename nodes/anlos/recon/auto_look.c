#include "nodes/anlos/recon/auto_look.h"

#include <errno.h>
#include <math.h>

#include "nodes/anlos/recon/auto_pace.h"

/* -- how the elements stand -------------------------------------------------------------
 */

bool recon_auto_is_lost(const struct recon_auto *a)
{
    return a->probe.coherence.element_m > PLANNER_INCOHERENT_M;
}

int recon_auto_look_at_elements(struct recon_auto *a, struct recon_job *job)
{
    size_t sampled = recon_auto_pace_sampled(a->pace);
    double budget_s = job->options->budget_s;
    double stand_s = a->slowness *
                     planner_coherence_s(&a->set, sampled, recon_auto_threads(job));
    int err = 0;
    a->stands = sampled == 1;
    a->probe.coherence.element_m = NAN;
    if (!(budget_s > 0.0) || stand_s <= RECON_AUTO_STAND * budget_s)
        err = coherence_measure(&a->probe.coherence, &a->set, job->pool);
    return err == -ENOTSUP ? 0 : err;
}

/* -- a look at the scene ----------------------------------------------------------------
 */

/* Without one all of it is imaged, as if nothing were known but how the elements stand
 * and, where that was asked for, whether things mirror. */
static void know_nothing(struct recon_auto *a)
{
    struct probe known = a->probe;
    a->probe = a->unknown;
    a->probe.coherence = known.coherence;
    a->probe.scattering = known.scattering;
    a->probe.specular = known.specular;
}

/* What an image of power takes. */
static double power_s(const struct recon_auto *a, const struct recon_job *job)
{
    size_t threads = recon_auto_threads(job);
    return a->slowness * (a->probe.specular
                              ? planner_mirror_s(&a->set, threads)
                              : planner_image_s(&a->set, &job->processing.grid,
                                                "incoherent", false, 1, threads));
}

/* Is a look at the scene worth its time?  Power takes so long that it always is. */
static bool look_pays(const struct recon_auto *a, const struct recon_job *job,
                      double look_s, double left_s)
{
    if (recon_auto_is_lost(a))
        left_s = fmax(left_s, power_s(a, job));
    return look_s <= RECON_AUTO_MOST_LOOK * left_s;
}

int recon_auto_look(struct recon_auto *a, struct recon_job *job)
{
    const struct grid *grid = &job->processing.grid;
    double look_s = a->slowness * planner_probe_s(&a->set, grid,
                                                  recon_auto_pace_stride(a->pace),
                                                  recon_auto_threads(job));
    int err =
        recon_auto_is_lost(a) ? probe_scattering(&a->probe, &a->set, grid, job->pool) : 0;
    a->looked = !err && look_pays(a, job, look_s, recon_auto_left_s(job));
    if (a->looked)
        err = probe_run(&a->probe, &a->set, grid,
                        isnan(a->probe.coherence.element_m) ? NULL : &a->probe.coherence,
                        job->pool);
    else
        know_nothing(a);
    return err;
}
