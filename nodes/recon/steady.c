#include "nodes/recon/steady.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/recon/clutter_map.h"
#include "nodes/recon/first_return.h"
#include "nodes/recon/survey_plan.h"
#include "nodes/rt/processors.h"

#define AGE_LIMIT  2.0  /* times what the pings of an image take when none is missing */
#define NO_OVERLAP 0.99 /* of that time apart: no ping in common */

struct round { /* of the speakers: a frame */
    uint32_t number;
    size_t pings, expected;
    bool imaged;
};

struct steady {
    struct steady_config cfg;
    struct pool *pool;
    struct survey_plan plan;
    struct frames *frames; /* NULL: no survey yet */
    size_t n_pings;        /* in an image */
    float *intensity;      /* [nz][ny][nx] */
    float complex *traces; /* [n_microphones][n_samples], the newest, muted */
    bool *masked;          /* [n_microphones], of the newest traces */
    uint64_t *clipped;     /* [n_pings], ring */
    bool *subtracted;      /* [n_pings], ring: had a background */
    bool *blanked;         /* [n_pings], ring: a sound from outside drowned it */
    size_t newest;
    struct ego_path path;
    bool has_path;
    struct first_return first;
    struct clutter_map *clutter;
    struct frames_motion motion;
    struct frames_made made;
    struct round round;
    uint32_t scan;
    enum steady_motion state;
    struct steady_counts counts;
};

int steady_create(struct steady **out, const struct steady_config *cfg)
{
    size_t threads = cfg->threads ? cfg->threads : processors_usable();
    struct steady *s = calloc(1, sizeof *s);

    if (!s)
        return -ENOMEM;
    s->cfg = *cfg;
    int err = pool_create(&s->pool, threads);
    if (err) {
        free(s);
        return err;
    }
    *out = s;
    return 0;
}

static void clear(struct steady *s)
{
    frames_destroy(s->frames);
    free(s->intensity);
    free(s->traces);
    free(s->masked);
    free(s->clipped);
    free(s->subtracted);
    free(s->blanked);
    clutter_map_destroy(s->clutter);
    survey_plan_clear(&s->plan);
    s->frames = NULL;
    s->intensity = NULL;
    s->traces = NULL;
    s->masked = NULL;
    s->clipped = NULL;
    s->subtracted = NULL;
    s->blanked = NULL;
    s->clutter = NULL;
}

void steady_destroy(struct steady *s)
{
    if (!s)
        return;
    clear(s);
    pool_destroy(s->pool);
    free(s);
}

/* -- survey -----------------------------------------------------------------------------
 */

/* A survey may name a replica, of which it is not known when it sends what. */
static struct frames_config configure(const struct steady *s)
{
    const struct survey *survey = &s->plan.survey;
    const struct processing *p = &s->plan.processing;
    size_t together = survey->together > 1 ? survey->together : 1;
    double slot_s = (double)survey->slot_samples / survey->sample_rate_hz;
    double window_s = slot_s * ceil((double)s->n_pings / (double)together);
    struct frames_config cfg = {
        .geometry = &p->geometry,
        .format = s->plan.format,
        .band_hz = {p->band_hz[0], p->band_hz[1]},
        .gate_m = {p->gate_m[0], p->gate_m[1]},
        .grid = p->grid,
        .pool = s->pool,
        .latency_s = survey->latency_samples / survey->sample_rate_hz,
        .n_pings = s->n_pings,
        .max_age_ns = llrint(1e9 * AGE_LIMIT * window_s),
        .sum = s->cfg.sum,
    };

    if (survey->n_replica == 0)
        cfg.chirp = processing_chirp(survey);
    return cfg;
}

static int allocate(struct steady *s, struct complaint *why)
{
    const struct frames_config cfg = configure(s);
    int err = frames_create(&s->frames, &cfg);

    if (err == -ENOTSUP)
        return complain(why, err,
                        "scan.mode fixed: expected an array that stands; this survey has "
                        "%zu positions",
                        s->plan.survey.n_positions);
    if (err)
        return complain(why, err, "images of %zu pings: %s; expected 1 to %d",
                        cfg.n_pings, strerror(-err), FRAMES_MAX_PINGS);
    s->intensity = calloc(grid_size(&cfg.grid), sizeof *s->intensity);
    s->traces =
        malloc(s->plan.survey.n_microphones * cfg.format.n_samples * sizeof *s->traces);
    s->masked = calloc(s->plan.survey.n_microphones, sizeof *s->masked);
    s->clipped = calloc(s->n_pings, sizeof *s->clipped);
    s->subtracted = calloc(s->n_pings, sizeof *s->subtracted);
    s->blanked = calloc(s->n_pings, sizeof *s->blanked);
    err = clutter_map_create(&s->clutter, &cfg.grid,
                             (int64_t)(NO_OVERLAP * (double)cfg.max_age_ns / AGE_LIMIT));
    return !err && s->intensity && s->traces && s->masked && s->clipped &&
                   s->subtracted && s->blanked
               ? 0
               : complain(why, -ENOMEM, "not enough memory for images of %zu voxels",
                          grid_size(&cfg.grid));
}

int steady_survey(struct steady *s, const Anlos__Survey *message, struct complaint *why)
{
    if (s->frames && s->plan.survey_id == message->id)
        return 0;
    clear(s);
    int err =
        survey_plan_create(&s->plan, message, s->cfg.compression, s->cfg.window, why);
    if (err)
        return err;
    const struct survey *survey = &s->plan.survey;
    s->round = (struct round){.expected = s->cfg.frame_pings ? s->cfg.frame_pings
                                                             : survey->n_speakers};
    s->n_pings = s->cfg.pings ? s->cfg.pings : s->round.expected;
    s->newest = 0;
    first_return_survey(&s->first, survey);
    mount_create(&s->motion.mount, survey->mount_origin_m, survey->mount_x_axis,
                 survey->mount_y_axis);
    err = allocate(s, why);
    if (err)
        clear(s);
    return err;
}

/* -- motion -----------------------------------------------------------------------------
 */

void steady_ego(struct steady *s, const Anlos__EgoMotion *ego, int64_t capture_ns)
{
    const struct ego_motion m = {ego->standstill ? 0.0 : ego->speed_m_s,
                                 ego->standstill ? 0.0 : ego->yaw_rate_rad_s};

    s->has_path = true;
    if (!ego->valid || !ego_path_add(&s->path, capture_ns, &m))
        return;
    /* A clock that was set back by much: what was heard before lies in the future. */
    if (capture_ns + EGO_MAX_AGE_NS < s->path.stamp_ns[s->path.newest]) {
        s->path.n = 0;
        ego_path_add(&s->path, capture_ns, &m);
    }
}

static enum steady_motion motion_of(const struct steady *s)
{
    struct ego_motion now;

    if (!s->has_path)
        return STEADY_STANDS;
    if (s->made.unknown || ego_path_at(&s->path, s->made.stamp_ns, &now))
        return STEADY_UNKNOWN;
    if (s->plan.survey.has_mount)
        return STEADY_MOVES;
    return now.speed_m_s == 0.0 && now.yaw_rate_rad_s == 0.0 ? STEADY_STANDS
                                                             : STEADY_NO_MOUNT;
}

int steady_walls(struct steady *s, const Anlos__WallList *walls, int64_t capture_ns,
                 struct complaint *why)
{
    return first_return_walls(&s->first, walls, capture_ns, why);
}

enum steady_motion steady_motion(const struct steady *s)
{
    return s->state;
}

/* -- pings ------------------------------------------------------------------------------
 */

static bool ends_frame(struct round *r, uint32_t frame)
{
    bool late = frame != r->number && r->pings > 0 && !r->imaged;

    if (frame != r->number)
        *r = (struct round){.number = frame, .expected = r->expected};
    r->pings++;
    r->imaged = r->imaged || r->pings >= r->expected;
    return late || r->pings == r->expected;
}

static void add(struct steady *s, const Anlos__Traces *t, const float complex *y,
                int64_t capture_ns)
{
    const struct trace_format *format = &s->plan.format;
    size_t n_mics = s->plan.survey.n_microphones;

    for (size_t m = 0; m < n_mics; m++)
        s->masked[m] = t->masked[m];
    memcpy(s->traces, y, n_mics * format->n_samples * sizeof *y);
    first_return_mute(&s->first, &s->plan.survey, s->has_path ? &s->path : NULL,
                      t->speaker, capture_ns, format, s->traces);
    const struct frames_ping ping = {.stamp_ns = capture_ns,
                                     .speaker = t->speaker,
                                     .down = t->down,
                                     .traces = s->traces,
                                     .masked = s->masked};
    if (t->scan != s->scan) {
        frames_reset(s->frames);
        clutter_map_reset(s->clutter);
    }
    s->scan = t->scan;
    /* The one before may hold the beginning of what drowned this one. */
    if (t->blanked && !s->blanked[s->newest]) {
        frames_spoil(s->frames);
        s->blanked[s->newest] = true;
    }
    s->counts.backwards += !frames_add(s->frames, &ping);
    if (t->blanked)
        frames_spoil(s->frames);
    s->newest = (s->newest + 1) % s->n_pings;
    s->blanked[s->newest] = t->blanked;
    s->clipped[s->newest] = t->clipped_samples;
    s->subtracted[s->newest] = t->background_subtracted;
}

bool steady_traces(struct steady *s, const Anlos__Traces *traces, int64_t capture_ns,
                   char *note, size_t size)
{
    note[0] = '\0';
    if (!s->frames)
        return false;
    const float complex *y = survey_plan_traces(&s->plan, traces);
    if (!y) {
        snprintf(note, size, "traces that do not fit the survey cannot be used");
        s->counts.unfit++;
        return false;
    }
    add(s, traces, y, capture_ns);
    /* Of two that sound together the second is the downward one, and of one instant there
     * is one image. */
    bool paired = s->plan.survey.together > 1 && !traces->down;
    return ends_frame(&s->round, traces->frame) || (s->cfg.every_ping && !paired);
}

/* -- image ------------------------------------------------------------------------------
 */

/* The part of an image's pings that has no background subtracted: what stands still is
 * left in them. */
static double standing_part(const struct steady *s)
{
    size_t subtracted = 0;

    for (size_t k = 0; k < s->n_pings; k++)
        subtracted += s->subtracted[k];
    return 1.0 - (double)subtracted / (double)s->n_pings;
}

void steady_image(struct steady *s, Anlos__Volume *out)
{
    bool follows = s->has_path && s->plan.survey.has_mount;

    s->motion.path = follows ? &s->path : NULL;
    frames_image(s->frames, &s->motion, s->intensity, &s->made);
    double part = s->cfg.moving_only ? standing_part(s) : 0.0;
    if (follows && part > 0.0)
        clutter_map_mute(s->clutter, &s->path, &s->motion.mount, s->made.stamp_ns, part,
                         s->intensity);
    s->state = motion_of(s);
    s->counts.images++;
    s->counts.unknown += s->state == STEADY_UNKNOWN;
    survey_plan_volume(&s->plan, s->intensity, out);
    out->scan = s->scan;
    out->frame = s->round.number;
    out->method = (char *)"frames";
    out->standing_left = part > 0.0;
    out->standing_taken = s->cfg.moving_only && !(part > 0.0);
    out->pings_used = (uint32_t)s->made.pings;
    out->pings_expected = (uint32_t)s->n_pings;
    out->microphones_masked = (uint32_t)s->made.microphones_masked;
    for (size_t k = 0; k < s->n_pings; k++)
        out->clipped_samples += s->clipped[k];
    for (size_t k = 0; k < s->n_pings; k++)
        out->pings_blanked += s->blanked[k];
}

int64_t steady_capture_ns(const struct steady *s)
{
    return s->made.stamp_ns;
}

const struct steady_counts *steady_counts(const struct steady *s)
{
    return &s->counts;
}
