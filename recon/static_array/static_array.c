/* SPDX-License-Identifier: MIT */
#include "recon/static_array/static_array.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/image_plan.h"
#include "recon/static_array/clutter_map.h"
#include "recon/static_array/first_return.h"
#include "recon/static_array/velocity_filter.h"

#define MOVERS_EVERY 2     /* images */
#define COURSES_S    0.048 /* after which they are looked for again, or after an image */
#define AGE_LIMIT    2.0  /* times what the pings of an image take when none is missing */
#define NO_OVERLAP   0.99 /* of that time apart: no ping in common */

struct round { /* of the speakers: a frame */
    uint32_t number;
    size_t pings, expected;
    bool imaged;
};

struct static_array {
    struct static_array_config cfg;
    struct pool *pool;
    struct image_plan plan;
    struct frames *frames;              /* NULL: no survey yet */
    size_t n_pings;                     /* in an image */
    float *intensity;                   /* [nz][ny][nx] */
    struct velocity_filter *velocities; /* NULL: phases add up, or no plan view */
    struct velocities found;
    float complex *traces; /* [n_microphones][n_samples], the newest, muted */
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
    enum static_array_motion state;
    struct static_array_counts counts;
};

int static_array_create(struct static_array **out, const struct static_array_config *cfg)
{
    struct static_array *s = calloc(1, sizeof *s);

    if (!s)
        return -ENOMEM;
    s->cfg = *cfg;
    int err = pool_create(&s->pool, cfg->threads);
    if (err) {
        free(s);
        return err;
    }
    *out = s;
    return 0;
}

void static_array_forget(struct static_array *s)
{
    frames_destroy(s->frames);
    free(s->intensity);
    velocity_filter_destroy(s->velocities);
    free(s->traces);
    free(s->clipped);
    free(s->subtracted);
    free(s->blanked);
    clutter_map_destroy(s->clutter);
    image_plan_clear(&s->plan);
    s->frames = NULL;
    s->intensity = NULL;
    s->velocities = NULL;
    s->traces = NULL;
    s->clipped = NULL;
    s->subtracted = NULL;
    s->blanked = NULL;
    s->clutter = NULL;
}

void static_array_destroy(struct static_array *s)
{
    if (!s)
        return;
    static_array_forget(s);
    pool_destroy(s->pool);
    free(s);
}

/* -- survey -----------------------------------------------------------------------------
 */

/* A survey may name a replica, of which it is not known when it sends what. */
static struct frames_config configure(const struct static_array *s)
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

static int create_velocities(struct static_array *s, const struct frames_config *cfg)
{
    const struct velocity_filter_config velocities = {
        .grid = cfg->grid,
        .n_pings = cfg->n_pings,
        .turns_per_m = cfg->format.carrier_hz / cfg->geometry->sound_speed_m_s,
        .sound_speed_m_s = cfg->geometry->sound_speed_m_s};

    if (!s->cfg.moving_only || cfg->sum != FRAMES_POWER || cfg->grid.n[1] != 1)
        return 0;
    return velocity_filter_create(&s->velocities, &velocities);
}

static int allocate(struct static_array *s, struct error *why)
{
    const struct frames_config cfg = configure(s);
    int err = frames_create(&s->frames, &cfg);

    if (err == -ENOTSUP)
        return error_say(
            why, err,
            "array: a static array stands, and this survey has %zu positions of a "
            "stage; expected one",
            s->plan.survey.n_positions);
    if (err)
        return error_say(why, err, "image_pings: %zu: %s; expected 1 to %d", cfg.n_pings,
                         strerror(-err), FRAMES_MAX_PINGS);
    s->intensity = calloc(grid_size(&cfg.grid), sizeof *s->intensity);
    s->traces =
        malloc(s->plan.survey.n_microphones * cfg.format.n_samples * sizeof *s->traces);
    s->clipped = calloc(s->n_pings, sizeof *s->clipped);
    s->subtracted = calloc(s->n_pings, sizeof *s->subtracted);
    s->blanked = calloc(s->n_pings, sizeof *s->blanked);
    err = create_velocities(s, &cfg);
    if (!err)
        err = clutter_map_create(
            &s->clutter, &cfg.grid,
            (int64_t)(NO_OVERLAP * (double)cfg.max_age_ns / AGE_LIMIT));
    return !err && s->intensity && s->traces && s->clipped && s->subtracted && s->blanked
               ? 0
               : error_say(why, -ENOMEM, "not enough memory for images of %zu voxels",
                           grid_size(&cfg.grid));
}

int static_array_survey(struct static_array *s, const struct survey *given,
                        struct error *why)
{
    static_array_forget(s);
    int err =
        image_plan_create(&s->plan, given, s->cfg.compression, s->cfg.moving_only, why);
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
        static_array_forget(s);
    return err;
}

/* -- motion -----------------------------------------------------------------------------
 */

uint64_t static_array_survey_id(const struct static_array *s)
{
    return s->plan.survey_id;
}

void static_array_ego(struct static_array *s, const struct ego_motion *motion,
                      int64_t capture_ns)
{
    s->has_path = true;
    if (!motion || !ego_path_add(&s->path, capture_ns, motion))
        return;
    /* A clock that was set back by much: what was heard before lies in the future. */
    if (capture_ns + EGO_MAX_AGE_NS < s->path.stamp_ns[s->path.newest]) {
        s->path.n = 0;
        ego_path_add(&s->path, capture_ns, motion);
    }
}

static enum static_array_motion motion_of(const struct static_array *s)
{
    struct ego_motion now;

    if (!s->has_path)
        return STATIC_ARRAY_STANDS;
    if (s->made.unknown || ego_path_at(&s->path, s->made.stamp_ns, &now))
        return STATIC_ARRAY_UNKNOWN;
    if (s->plan.survey.has_mount)
        return STATIC_ARRAY_MOVES;
    return now.speed_m_s == 0.0 && now.yaw_rate_rad_s == 0.0 ? STATIC_ARRAY_STANDS
                                                             : STATIC_ARRAY_NO_MOUNT;
}

void static_array_walls(struct static_array *s, const struct walls *walls,
                        int64_t capture_ns)
{
    first_return_walls(&s->first, walls, capture_ns);
}

enum static_array_motion static_array_motion(const struct static_array *s)
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

static void add(struct static_array *s, const struct traces *t)
{
    const struct trace_format *format = &s->plan.format;
    size_t n_mics = s->plan.survey.n_microphones, n = t->format.n_samples;

    for (size_t m = 0; m < n_mics; m++) {
        float complex *x = s->traces + m * format->n_samples;
        memcpy(x, t->samples + m * n, n * sizeof *x);
        memset(x + n, 0, (format->n_samples - n) * sizeof *x);
    }
    first_return_mute(&s->first, &s->plan.survey, s->has_path ? &s->path : NULL,
                      t->speaker, t->capture_ns, format, s->traces);
    const struct frames_ping ping = {.stamp_ns = t->capture_ns,
                                     .speaker = t->speaker,
                                     .down = t->down,
                                     .traces = s->traces,
                                     .masked = t->masked};
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

bool static_array_traces(struct static_array *s, const struct traces *traces, char *note,
                         size_t size)
{
    note[0] = '\0';
    if (!s->frames)
        return false;
    if (!image_plan_fits(&s->plan, traces)) {
        snprintf(note, size, "traces that do not fit the survey cannot be used");
        s->counts.unfit++;
        return false;
    }
    add(s, traces);
    /* Of two that sound together the second is the downward one, and of one instant there
     * is one image. */
    bool paired = s->plan.survey.together > 1 && !traces->down;
    return ends_frame(&s->round, traces->frame) || (s->cfg.every_ping && !paired);
}

/* -- image ------------------------------------------------------------------------------
 */

/* The part of an image's pings that has no background subtracted: what stands still is
 * left in them. */
static double standing_part(const struct static_array *s)
{
    size_t subtracted = 0;

    for (size_t k = 0; k < s->n_pings; k++)
        subtracted += s->subtracted[k];
    return 1.0 - (double)subtracted / (double)s->n_pings;
}

/* Where what stands is in the image, which a background would tell from it: what moves
 * by itself.  Else how what stands out goes. */
static void find_movers(struct static_array *s, double standing)
{
    s->found.n_movers = s->found.n_ambiguous = s->found.n_courses = 0;
    bool taken = !(standing > 0.0);
    double slot_s = s->plan.survey.slot_samples / s->plan.survey.sample_rate_hz;
    size_t every = taken ? (size_t)fmax(COURSES_S / slot_s, 1.0) : MOVERS_EVERY;

    if (s->velocities && s->counts.images % every == 0)
        velocity_filter_find(s->velocities, s->frames, s->intensity, taken, &s->found);
}

void static_array_image(struct static_array *s, struct volume *out)
{
    bool follows = s->has_path && s->plan.survey.has_mount;

    s->motion.path = follows ? &s->path : NULL;
    frames_image(s->frames, &s->motion, s->intensity, &s->made);
    double part = s->cfg.moving_only ? standing_part(s) : 0.0;
    find_movers(s, part);
    if (follows && part > 0.0)
        clutter_map_mute(s->clutter, &s->path, &s->motion.mount, s->made.stamp_ns, part,
                         s->intensity);
    s->state = motion_of(s);
    s->counts.images++;
    s->counts.unknown += s->state == STATIC_ARRAY_UNKNOWN;
    image_plan_volume(&s->plan, s->intensity, out);
    out->capture_ns = s->made.stamp_ns;
    out->scan = s->scan;
    out->frame = s->round.number;
    out->method = "frames";
    out->standing_left = part > 0.0;
    out->movers = s->found.movers;
    out->n_movers = s->found.n_movers;
    out->ambiguous = s->found.ambiguous;
    out->n_ambiguous = s->found.n_ambiguous;
    out->courses = s->found.courses;
    out->n_courses = s->found.n_courses;
    out->standing_taken = s->cfg.moving_only && !(part > 0.0);
    if (!out->standing_left)
        out->newest = frames_newest(s->frames, &out->blocks);
    out->pings_used = s->made.pings;
    out->age_s = s->made.age_s;
    out->pings_expected = s->n_pings;
    out->microphones_masked = s->made.microphones_masked;
    for (size_t k = 0; k < s->n_pings; k++)
        out->clipped_samples += s->clipped[k];
    for (size_t k = 0; k < s->n_pings; k++)
        out->pings_blanked += s->blanked[k];
}

const struct static_array_counts *static_array_counts(const struct static_array *s)
{
    return &s->counts;
}
