#include "nodes/anlos/recon/report.h"

#include <math.h>
#include <stdio.h>

#include "nodes/anlos/recon/auto.h"
#include "recon/objects.h"

/* Of the worst axis that is told. */
static double sigma_m(const Anlos__DetectionList *list, const Anlos__Detection *d)
{
    static const int diagonal[3] = {0, 3, 5};
    int height = list->in_vehicle_frame ? 2 : 1;
    double worst = NAN;

    for (int a = 0; d->n_covariance_m2 == 6 && a < 3; a++) {
        double sigma = sqrt(d->covariance_m2[diagonal[a]]);
        if (sigma < OBJECTS_KNOWN_M && !(d->height_assumed && a == height))
            worst = fmax(worst, sigma);
    }
    return worst;
}

static void print_multipath(const Anlos__Detection *d)
{
    static const char *const names[] = {[ANLOS__MULTIPATH__OF_A_PAIR] = "by bounces of",
                                        [ANLOS__MULTIPATH__BY_A_FACE] = "mirror image of",
                                        [ANLOS__MULTIPATH__IN_A_SHADOW] = "echo behind"};

    if (d->multipath <= 0 || d->multipath > ANLOS__MULTIPATH__IN_A_SHADOW)
        return;
    printf("   multipath: %s", names[d->multipath]);
    for (size_t i = 0; i < d->n_multipath_of; i++)
        printf("%s %u", i ? " and" : "", d->multipath_of[i]);
}

static void print_object(const Anlos__DetectionList *list, const Anlos__Detection *d)
{
    static const char *const borders[6] = {"x-", "x+", "y-", "y+", "z-", "z+"};
    double sigma_cm = 100.0 * sigma_m(list, d);

    if (d->position_m)
        printf("%4u %9.3f %8.3f %8.3f ", d->id, d->position_m->x, d->position_m->y,
               d->position_m->z);
    else
        printf("%4u %9s %8s %8s ", d->id, "unknown", "", "");
    if (isnan(sigma_cm))
        printf("%9s", "unknown");
    else
        printf("%9.1f", sigma_cm);
    printf(" %8.1f %9.0f %%", d->level_db, 100.0 * d->existence);
    if (d->extent_m && fmax(fmax(d->extent_m->x, d->extent_m->y), d->extent_m->z) > 0.0)
        printf("   %.2f x %.2f x %.2f", d->extent_m->x, d->extent_m->y, d->extent_m->z);
    if (d->at_border)
        printf("   where the image ends:");
    for (int i = 0; i < 6; i++)
        if (d->at_border >> i & 1u)
            printf(" %s", borders[i]);
    print_multipath(d);
    printf("\n");
}

/* In whose terms the places are. */
static const char *frame_text(const Anlos__DetectionList *list, bool own_places,
                              bool traces)
{
    if (list->mirrored)
        return list->in_vehicle_frame ? "positions in the vehicle frame"
                                      : "positions in the array frame";
    if (own_places) /* may stand around the objects */
        return list->in_vehicle_frame ? "positions in the vehicle frame, as imaged"
               : traces               ? "positions as tx_m and rx_m have them"
                                      : "positions in the frame of the pings";
    return list->in_vehicle_frame
               ? "positions in the vehicle frame, as mirrored by the wall (the survey "
                 "names no wall)"
               : "positions in the array frame, as mirrored by the wall (the survey "
                 "names no wall)";
}

void recon_report_print_objects(const Anlos__DetectionList *list, bool own_places,
                                bool traces)
{
    printf("%zu %s%s, %s\n", list->n_detections, own_places ? "object" : "hidden object",
           list->n_detections == 1 ? "" : "s", frame_text(list, own_places, traces));
    if (list->n_detections)
        printf("   # %9s %8s %8s %9s %8s %11s   %s\n", "x m", "y m", "z m", "sigma cm",
               "SNR dB", "existence", "extent m");
    for (size_t i = 0; i < list->n_detections; i++)
        print_object(list, list->detections[i]);
    for (size_t i = 0; i < list->n_detections; i++) {
        if (!list->detections[i]->height_assumed)
            continue;
        printf("(the array hears no heights: they are assumed, to half a metre)\n");
        break;
    }
}

void recon_report_print_stages(const struct stopwatch stages[RECON_STAGES])
{
    for (int i = 0; i < RECON_STAGES; i++)
        printf("%s%s %.2f", i ? ", " : " (", recon_stage_name(i), stages[i].wall_s);
    printf(")\n");
}

static void print_air(const struct recon_job *job)
{
    char text[128];
    air_text(&job->air, text, sizeof text);
    if (text[0])
        printf("%s: corrected\n", text);
}

/* What the method was left to decide, and how it ended. */
static void print_outcome(const struct recon_job *job)
{
    const struct imager_outcome *o = &job->outcome;
    if (o->choice)
        printf("%s %s%s", o->choice, o->chosen ? "always" : "never",
               o->iterates ? "; " : "\n");
    if (o->iterates)
        printf("%zu iterations, residual %.2g%s\n", o->iterations, o->residual,
               o->converged ? "" : ": not converged");
}

void recon_report_print(const struct recon_job *job)
{
    size_t expected = job->survey.n_positions * job->survey.n_speakers;

    recon_report_print_objects(job->detections, job->processing.geometry.pings_m != NULL,
                               job->options->traces != NULL);
    print_air(job);
    print_outcome(job);
    if (job->automatic)
        recon_auto_print(job->automatic, job);
    printf("%zu of %zu pings, method %s%s%s%s, %zu thread%s: %.2f s", job->n_pings,
           expected, job->method, job->method_because ? " (" : "",
           job->method_because ? job->method_because : "", job->method_because ? ")" : "",
           job->options->threads, job->options->threads == 1 ? "" : "s",
           job->total.wall_s);
    recon_report_print_stages(job->stages);
    printf("%s: volume.nrrd, projection_{xy,xz,yz}.png, detections.json, report.json\n",
           job->options->out);
}
