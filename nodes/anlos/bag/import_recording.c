#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

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
    char scene[PATH_MAX], background[PATH_MAX], survey[PATH_MAX];
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
        err = put_passes(&r, p->background[0] != '\0', why);
    shooter_destroy(r.shooter);
    array_close(r.array);
    free(p);
    return err;
}
