#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/recording/recording.h"
#include "recon/tail.h"
#include "msgs/tensor.h"
#include "nodes/anlos/bag/ego_table.h"
#include "nodes/anlos/bag/import.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/array/shooter.h"

#define MAX_YAML ((size_t)64 << 20)

struct recording_import {
    struct import_bag *bag;
    struct array *array;
    struct shooter *shooter;
    int64_t now_ns; /* the clock that the array sees */
    int64_t slot_ns;
    uint32_t n_fired;

    struct recording *passes[2]; /* scene, background or NULL */
    float *samples;              /* [n_microphones][n_ping] */
    uint32_t *counts;            /* [2][n_microphones] */
    size_t n_ping;
    int64_t shift_ns; /* from the times of the tables */
    struct ego_table ego;
    size_t n_ego; /* messages of it that are in the bag */
};

static int64_t now(void *state)
{
    return ((const struct recording_import *)state)->now_ns;
}

static int sleep_until(void *state, int64_t t_ns)
{
    ((struct recording_import *)state)->now_ns = t_ns;
    return 0;
}

struct paths {
    char scene[PATH_MAX], background[PATH_MAX], survey[PATH_MAX], ego[PATH_MAX];
};

static bool is_there(char *out, const char *folder, const char *name)
{
    return snprintf(out, PATH_MAX, "%s/%s", folder, name) < PATH_MAX &&
           !access(out, F_OK);
}

/* As `anlos sim` lays it out (scene, background and survey.yaml in a folder), or a folder
 * of WAV files with survey.yaml in it or beside it. */
static int find_paths(struct paths *p, const struct import_options *o,
                      struct complaint *why)
{
    if (access(o->from, R_OK))
        return complain(why, -errno, "%s: %s", o->from, strerror(errno));
    if (!is_there(p->scene, o->from, "scene"))
        snprintf(p->scene, PATH_MAX, "%s", o->from);
    if (!is_there(p->background, o->from, "background"))
        p->background[0] = '\0';
    if (o->background)
        snprintf(p->background, PATH_MAX, "%s", o->background);
    if (o->survey)
        snprintf(p->survey, PATH_MAX, "%s", o->survey);
    else if (!is_there(p->survey, o->from, "survey.yaml") &&
             !is_there(p->survey, o->from, "../survey.yaml"))
        return complain(why, -ENOENT,
                        "%s: no survey.yaml in it or beside it; name it with --survey",
                        o->from);
    if (o->ego)
        snprintf(p->ego, PATH_MAX, "%s", o->ego);
    else if (!is_there(p->ego, o->from, EGO_FILE) &&
             !is_there(p->ego, o->from, "../" EGO_FILE))
        p->ego[0] = '\0';
    const char *const all[] = {p->scene, p->background, p->survey};
    for (size_t i = 0; i < 3; i++)
        if (strpbrk(all[i], "?&"))
            return complain(why, -EINVAL, "%s: a name without ? and &, please", all[i]);
    return 0;
}

static int open_array(struct recording_import *r, const struct clock_source *clock,
                      const struct paths *p, struct complaint *why)
{
    char *uri;

    /* As it was recorded: what was calibrated elsewhere is not mixed in. */
    if (asprintf(&uri, "wav:%s?survey=%s&calibrated=%s%s", p->scene, p->survey,
                 p->background[0] ? "&background=" : "", p->background) < 0)
        return complain(why, -ENOMEM, "out of memory");
    int err = array_open(&r->array, uri, clock, why);
    free(uri);
    if (!err && shooter_create(&r->shooter, r->array))
        err = complain(why, -ENOMEM, "out of memory");
    return err;
}

static int read_text(const char *path, char **out, size_t *size, struct complaint *why)
{
    struct stat st;
    FILE *f = fopen(path, "re");

    if (!f || fstat(fileno(f), &st) || st.st_size < 0 || (size_t)st.st_size > MAX_YAML) {
        int err = complain(why, f ? -EFBIG : -errno, "%s: %s", path,
                           f ? "no survey of that size" : strerror(errno));
        if (f)
            fclose(f);
        return err;
    }
    *size = (size_t)st.st_size;
    *out = malloc(*size + 1);
    int err = 0;
    if (!*out)
        err = complain(why, -ENOMEM, "out of memory");
    else if (fread(*out, 1, *size, f) != *size)
        err = complain(why, -EIO, "%s cannot be read", path);
    fclose(f);
    return err;
}

static int put_survey(struct recording_import *r, const char *path, struct complaint *why)
{
    const struct survey *s = array_survey(r->array);
    char *yaml = NULL;
    size_t size = 0;
    int err = read_text(path, &yaml, &size, why);

    if (!err)
        err = import_bag_survey(r->bag, s, yaml, size, why);
    free(yaml);
    r->slot_ns = (int64_t)(1e9 * (double)s->slot_samples / s->sample_rate_hz + 0.5);
    return err;
}

static int put_position(struct recording_import *r, Anlos__Pass pass, uint32_t position,
                        uint32_t *speakers, struct complaint *why)
{
    const struct survey *s = array_survey(r->array);
    Anlos__FireCommand fire = ANLOS__FIRE_COMMAND__INIT;
    Anlos__Ping ping;
    int64_t t0_ns;

    fire.id = ++r->n_fired;
    fire.scan = 1;
    fire.pass = pass;
    fire.position = position;
    fire.stage_m = s->stage_positions_m[position];
    fire.n_speakers = s->n_speakers;
    fire.speakers = speakers;
    int err = shooter_fire(r->shooter, &fire, 0, why);
    while (!err && shooter_busy(r->shooter)) {
        err = interrupt_requested() ? complain(why, -EINTR, "interrupted")
                                    : shooter_next(r->shooter, &ping, &t0_ns, why);
        if (err)
            break;
        int64_t length_ns = r->slot_ns * (int64_t)ping.samples->shape[1] /
                            (int64_t)s->slot_samples;
        err = import_bag_ping(r->bag, &ping, t0_ns, length_ns, why);
        r->now_ns += r->slot_ns;
    }
    return err == -ENODATA ? 0 : err; /* the shot has ended */
}

/* The background comes first: what is imaged meanwhile is the scene without it. */
static int put_passes(struct recording_import *r, bool background, struct complaint *why)
{
    const struct survey *s = array_survey(r->array);
    uint32_t *speakers = malloc(s->n_speakers * sizeof *speakers);
    int err = speakers ? 0 : complain(why, -ENOMEM, "out of memory");

    for (size_t i = 0; !err && i < s->n_speakers; i++)
        speakers[i] = (uint32_t)i;
    for (size_t k = 0; !err && background && k < s->n_positions; k++)
        err = put_position(r, ANLOS__PASS__BACKGROUND, (uint32_t)k, speakers, why);
    for (size_t k = 0; !err && k < s->n_positions; k++)
        err = put_position(r, ANLOS__PASS__SCENE, (uint32_t)k, speakers, why);
    free(speakers);
    return err;
}

/* -- of an array that stands: all that sounded ------------------------------------------
 */

static int put_ego(struct recording_import *r, int64_t until_ns, struct complaint *why)
{
    int err = 0;

    for (; !err && r->n_ego < r->ego.n; r->n_ego++) {
        const struct ego_row *row = &r->ego.rows[r->n_ego];
        if (row->time_ns + r->shift_ns > until_ns)
            return 0;
        err = import_bag_ego(r->bag, &row->motion, row->time_ns + r->shift_ns, why);
    }
    return err;
}

static int put_emission(struct recording_import *r, Anlos__Pass pass, size_t i,
                        const struct emission *e, int64_t t0_ns, struct complaint *why)
{
    const struct survey *s = array_survey(r->array);
    uint32_t *clipped = r->counts, *not_finite = r->counts + s->n_microphones;
    int64_t length_ns = r->slot_ns * (int64_t)r->n_ping / (int64_t)s->slot_samples;
    struct tensor_view view;
    Anlos__Ping p = ANLOS__PING__INIT;
    int err = interrupt_requested()
                  ? complain(why, -EINTR, "interrupted")
                  : recording_read_emission(r->passes[pass == ANLOS__PASS__BACKGROUND], i,
                                            r->samples, clipped, not_finite, why);

    if (err)
        return err;
    p.scan = 1;
    p.pass = pass;
    p.stage_m = s->stage_positions_m[0];
    p.speaker = e->speaker;
    p.samples = tensor_borrow_f32(&view, r->samples, 2, s->n_microphones, r->n_ping);
    p.n_clipped = p.n_not_finite = s->n_microphones;
    p.clipped = clipped;
    p.not_finite = not_finite;
    p.valid = e->valid;
    p.temperature_c = e->temperature_c;
    p.down = e->down;
    p.frame = e->frame;
    if (pass == ANLOS__PASS__SCENE || e->has_time)
        err = put_ego(r, t0_ns + length_ns, why);
    return err ? err : import_bag_ping(r->bag, &p, t0_ns, length_ns, why);
}

/* Times of one clock overlap. */
static int check_ego(const struct recording_import *r, int64_t begin_ns, int64_t end_ns,
                     const char *ego, struct complaint *why)
{
    if (!r->ego.n)
        return 0;
    int64_t first_ns = r->ego.rows[0].time_ns + r->shift_ns;
    int64_t last_ns = r->ego.rows[r->ego.n - 1].time_ns + r->shift_ns;
    if (first_ns <= end_ns && last_ns >= begin_ns)
        return 0;
    return complain(why, -EINVAL,
                    "%s: is of %.3f to %.3f s, but the recording of %.3f to %.3f s: its "
                    "times count as those of " EMISSIONS_FILE
                    ", and where that has none, from the first sample on",
                    ego, 1e-9 * (double)(first_ns - r->shift_ns),
                    1e-9 * (double)(last_ns - r->shift_ns),
                    1e-9 * (double)(begin_ns - r->shift_ns),
                    1e-9 * (double)(end_ns - r->shift_ns));
}

static int64_t time_of(const struct recording_import *r, const struct emission *e,
                       int64_t begin_ns)
{
    double rate_hz = array_survey(r->array)->sample_rate_hz;

    return e->has_time ? e->time_ns + r->shift_ns
                       : begin_ns + llround(1e9 * (double)e->sample / rate_hz);
}

/* Without times in its table a pass begins when the one before has ended. */
static int put_pass(struct recording_import *r, Anlos__Pass pass, const struct paths *p,
                    struct complaint *why)
{
    const struct recording *from = r->passes[pass == ANLOS__PASS__BACKGROUND];
    const struct survey *s = array_survey(r->array);
    int64_t begin_ns = r->now_ns;
    size_t n;
    int err = 0;

    if (!from)
        return 0;
    const struct emission *list = recording_emissions(from, &n);
    if (!list[0].has_time && pass == ANLOS__PASS__SCENE)
        r->shift_ns = begin_ns;
    if (pass == ANLOS__PASS__SCENE)
        err = check_ego(r, time_of(r, &list[0], begin_ns),
                        time_of(r, &list[n - 1], begin_ns) + 2 * r->slot_ns, p->ego, why);
    for (size_t i = 0; !err && i < n; i++)
        err = put_emission(r, pass, i, &list[i], time_of(r, &list[i], begin_ns), why);
    r->now_ns += llround(1e9 * (double)recording_samples(from) / s->sample_rate_hz);
    return err;
}

/* Times that count from the beginning of something count from that of the bag. */
static void find_shift(struct recording_import *r)
{
    int64_t first_ns = r->ego.n ? r->ego.rows[0].time_ns : INT64_MAX;

    for (int i = 0; i < 2; i++) {
        size_t n = 0;
        const struct emission *list = r->passes[i] ? recording_emissions(r->passes[i], &n)
                                                   : NULL;
        if (n && list[0].has_time && list[0].time_ns < first_ns)
            first_ns = list[0].time_ns;
    }
    r->shift_ns = first_ns < IMPORT_START_NS ? IMPORT_START_NS : 0;
}

static int put_endless(struct recording_import *r, const struct paths *p,
                       struct complaint *why)
{
    const struct survey *s = array_survey(r->array);

    r->n_ping = s->slot_samples + tail_samples(s);
    r->samples = calloc(s->n_microphones * r->n_ping, sizeof *r->samples);
    r->counts = calloc(2 * s->n_microphones, sizeof *r->counts);
    if (!r->samples || !r->counts)
        return complain(why, -ENOMEM, "out of memory");
    int err = p->ego[0] ? ego_table_load(&r->ego, p->ego, why) : 0;
    if (err)
        return err;
    find_shift(r);
    err = put_pass(r, ANLOS__PASS__BACKGROUND, p, why);
    if (!err)
        err = put_pass(r, ANLOS__PASS__SCENE, p, why);
    return err ? err : put_ego(r, INT64_MAX, why);
}

static int open_passes(struct recording_import *r, const struct paths *p,
                       struct complaint *why)
{
    const struct survey *s = array_survey(r->array);
    int err = recording_open(&r->passes[0], p->scene, s, why);

    return err || !p->background[0]
               ? err
               : recording_open(&r->passes[1], p->background, s, why);
}

static int put_all(struct recording_import *r, const struct paths *p,
                   struct complaint *why)
{
    int err = open_passes(r, p, why);

    if (err)
        return err;
    if (recording_goes_on(r->passes[0]))
        return put_endless(r, p, why);
    if (p->ego[0])
        return complain(why, -EINVAL,
                        "%s: a scan is taken by a vehicle that stands; remove it",
                        p->ego);
    return put_passes(r, p->background[0] != '\0', why);
}

int import_recording(struct import_bag *bag, const struct import_options *o,
                     struct complaint *why)
{
    static const char *const pairs[][2] = {{"imported_from", "recording"},
                                           {"version", ANLOS_VERSION}};
    struct recording_import r = {.bag = bag, .now_ns = IMPORT_START_NS};
    const struct clock_source clock = {now, sleep_until, &r};
    struct paths *p = malloc(sizeof *p);
    int err = p ? find_paths(p, o, why) : complain(why, -ENOMEM, "out of memory");

    if (!err)
        err = open_array(&r, &clock, p, why);
    if (!err)
        err = put_survey(&r, p->survey, why);
    if (!err)
        err = import_bag_metadata(bag, "anlos", pairs, 2, why);
    if (!err)
        err = put_all(&r, p, why);
    ego_table_clear(&r.ego);
    for (int i = 0; i < 2; i++)
        recording_close(r.passes[i]);
    free(r.samples);
    free(r.counts);
    shooter_destroy(r.shooter);
    array_close(r.array);
    free(p);
    return err;
}
