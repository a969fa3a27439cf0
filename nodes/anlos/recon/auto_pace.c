#include "nodes/anlos/recon/auto_pace.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "dsp/rank.h"
#include "nodes/anlos/recon/auto_look.h"

#define COLD   4  /* pings that find caches empty */
#define ENOUGH 16 /* pings to tell the pace from */

#define DEPTH_M 1.0 /* that things are expected to fill */

struct recon_auto_pace {
    const struct recon_auto *a;
    const struct recon_job *job;
    pthread_mutex_t lock;
    double *began_s; /* [n_positions]: of the ping at work; a thread's own */
    size_t n;        /* pings that were timed, with the cold ones */
    double took_s[ENOUGH];
    struct plan plan;
    atomic_size_t stride, sampled; /* 0: not chosen yet, every ping counts */
};

int recon_auto_pace_create(struct recon_auto_pace **out, const struct recon_auto *a,
                           const struct recon_job *job)
{
    struct recon_auto_pace *p = calloc(1, sizeof *p);
    if (!p)
        return -ENOMEM;
    pthread_mutex_init(&p->lock, NULL);
    p->a = a;
    p->job = job;
    p->began_s = calloc(a->set.geometry->n_positions, sizeof *p->began_s);
    atomic_init(&p->stride, job->options->budget_s > 0.0 ? 0 : 1);
    atomic_init(&p->sampled, 1);
    if (!p->began_s) {
        recon_auto_pace_destroy(p);
        return -ENOMEM;
    }
    *out = p;
    return 0;
}

/* To compress all speakers of the positions that tell how the elements stand, and to look
 * at them. */
static double samples_s(const struct recon_auto_pace *p, double compress_s,
                        double slowness)
{
    const struct geometry *g = p->a->set.geometry;
    size_t n = 0;
    for (size_t k = 0; k < g->n_positions; k++)
        n += coherence_samples(g, k);
    return compress_s * (double)n / (double)g->n_positions +
           slowness * planner_coherence_s(&p->a->set, 1, recon_auto_threads(p->job));
}

/* How many speakers, of which it is not known yet what they hear: a look comes first
 * where it is worth its time.  That is gone then, and depths that hold nothing need not
 * be imaged. */
static void decide(struct recon_auto_pace *p, struct planner_config planner)
{
    planner_decide(&p->plan, &planner);
    double stride = (double)p->plan.stride;
    double look_s = planner.slowness * planner_probe_s(planner.set, planner.grid,
                                                       p->plan.stride, planner.n_threads);
    if (look_s > RECON_AUTO_MOST_LOOK * (planner.budget_s - planner.compress_s / stride))
        return;
    struct probe seen = p->a->unknown;
    double middle_m = 0.5 * (seen.depth_m[0] + seen.depth_m[1]);
    seen.depth_m[0] = fmax(seen.depth_m[0], middle_m - 0.5 * DEPTH_M);
    seen.depth_m[1] = fmin(seen.depth_m[1], middle_m + 0.5 * DEPTH_M);
    planner.probe = &seen;
    planner.budget_s -= look_s;
    planner_decide(&p->plan, &planner);
}

/* Under the lock. */
static void choose(struct recon_auto_pace *p)
{
    const struct geometry *g = p->a->set.geometry;
    const struct recon_options *o = p->job->options;
    size_t n_pings = g->n_positions * g->n_speakers, threads = recon_auto_threads(p->job);
    double ping_s = rank_median(p->took_s + COLD, p->n - COLD);
    double compress_s = ping_s * (double)n_pings / (double)threads;
    double slowness = compress_s / planner_compress_s(n_pings, g->n_microphones, threads);
    double stand_s = samples_s(p, compress_s, slowness);
    bool sampled = stand_s <= RECON_AUTO_STAND * o->budget_s;
    const struct stopwatch *plan = &p->job->stages[RECON_PLAN];
    const struct planner_config planner = {
        .set = &p->a->set,
        .probe = &p->a->unknown,
        .grid = &p->a->whole,
        .n_threads = threads,
        .slowness = slowness,
        .compress_s = compress_s,
        .least_stride = 1,
        .budget_s = o->budget_s - fmin(plan->wall_s, plan->cpu_s) -
                    (sampled ? stand_s : 0.0),
        .error_m = o->error_m,
        .keep_grid = p->job->survey.has_volume,
    };
    decide(p, planner);
    if (!sampled)
        atomic_store(&p->sampled, p->plan.stride);
    atomic_store(&p->stride, p->plan.stride);
}

bool recon_auto_pace_wants(struct recon_auto_pace *p, size_t position, size_t speaker)
{
    size_t stride = atomic_load(&p->stride);
    if (stride && coherence_samples(p->a->set.geometry, position))
        stride = atomic_load(&p->sampled);
    if (stride)
        return speaker % stride == 0;
    p->began_s[position] = stopwatch_now(true).cpu_s;
    return true;
}

void recon_auto_pace_done(struct recon_auto_pace *p, size_t position)
{
    if (atomic_load(&p->stride) || p->began_s[position] == 0.0)
        return; /* traces of a file were never asked for */
    double took_s = stopwatch_now(true).cpu_s - p->began_s[position];
    pthread_mutex_lock(&p->lock);
    if (p->n < ENOUGH)
        p->took_s[p->n++] = took_s;
    if (p->n == ENOUGH && !atomic_load(&p->stride))
        choose(p);
    pthread_mutex_unlock(&p->lock);
}

size_t recon_auto_pace_stride(const struct recon_auto_pace *p)
{
    size_t stride = atomic_load(&p->stride);
    return stride ? stride : 1;
}

size_t recon_auto_pace_sampled(const struct recon_auto_pace *p)
{
    return atomic_load(&p->sampled);
}

void recon_auto_pace_follow(struct recon_auto_pace *p, size_t stride)
{
    atomic_store(&p->sampled, stride);
    atomic_store(&p->stride, stride);
}

void recon_auto_pace_destroy(struct recon_auto_pace *p)
{
    if (!p)
        return;
    pthread_mutex_destroy(&p->lock);
    free(p->began_s);
    free(p);
}
