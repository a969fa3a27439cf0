/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/devices.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/error.h"
#include "hal/array.h"
#include "hal/canbus.h"
#include "hal/room/scene.h"
#include "hal/stage.h"
#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_hosts.h"
#include "nodes/rt/round_check.h"
#include "nodes/rt/uri.h"

/* The scene of a node that there is; NULL: it is not simulated. */
static int scene_of(const struct launchfile *l, const char *node, const char *uri,
                    char **out)
{
    *out = NULL;
    if (!launchfile_has_node(l, node) || !uri_has_scheme(uri, "sim"))
        return 0;
    *out = uri_path(uri);
    return *out ? 0 : -ENOMEM;
}

/* Files that are not here, but on another host, by their names. */
static bool is_same_file(const char *a, const char *b)
{
    char *real_a = realpath(a, NULL), *real_b = realpath(b, NULL);
    bool same = !strcmp(real_a ? real_a : a, real_b ? real_b : b);

    free(real_a);
    free(real_b);
    return same;
}

static int check_pair(const struct launchfile *l, const char *array, const char *can,
                      struct error *why)
{
    if (!array || !can || is_same_file(array, can))
        return 0;
    return error_say(why, -EINVAL,
                     "%s: can.uri: the vehicle drives in %s, but its array hears %s "
                     "(array.uri); name the same scene in both",
                     l->path, can, array);
}

static int check_pace(const struct launchfile *l, const char *array, struct error *why)
{
    struct survey survey;
    struct scene *scene = NULL;

    if (!array || l->scan.fixed || !launchfile_has_node(l, "scan") ||
        !launchfile_runs_here(l, "array"))
        return 0;
    int err = scene_load(&scene, &survey, array, why);
    if (err)
        return err;
    if (scene->drive)
        err = error_say(
            why, -EINVAL,
            "%s: scan.mode: %s is a drive, in which things move on while a scan "
            "takes its steps; expected fixed",
            l->path, array);
    scene_free(scene);
    survey_clear(&survey);
    return err;
}

/* A pass without the objects is played from a recording of its own. */
static int check_background(const struct launchfile *l, struct error *why)
{
    if (!l->scan.background || !uri_has_scheme(l->array.uri, "wav") ||
        !launchfile_has_node(l, "scan"))
        return 0;
    char *background = uri_option(l->array.uri, "background");
    int err = 0;

    if (!background)
        err = error_say(why, -ENOMEM, "%s: not enough memory", l->path);
    else if (!*background)
        err = error_say(why, -EINVAL,
                        "%s: scan.background: %s names no recording of it; name one with "
                        "background=FOLDER in array.uri, or scan without",
                        l->path, l->array.uri);
    free(background);
    return err;
}

int devices_fit(const struct launchfile *l, struct error *why)
{
    char *array = NULL, *can = NULL;
    int err = scene_of(l, "array", l->array.uri, &array);

    if (!err)
        err = scene_of(l, "can", l->can.uri, &can);
    if (err)
        error_say(why, err, "%s: not enough memory", l->path);
    else
        err = check_background(l, why);
    if (!err)
        err = check_pair(l, array, can, why);
    if (!err)
        err = check_pace(l, array, why);
    free(array);
    free(can);
    return err;
}

static int error_say_of(const struct launchfile *l, const char *node,
                        const struct error *inner, int err, struct error *why)
{
    return error_say(why, err, "%s: %s.uri: %.900s", l->path, node, inner->text);
}

static int check_array(const struct launchfile *l, struct error *why)
{
    struct error inner = {""};
    struct array *array = NULL;
    int err = array_open(&array, l->array.uri, clock_system(), &inner);

    if (err)
        return error_say_of(l, "array", &inner, err, why);
    if (l->scan.fixed && launchfile_has_node(l, "scan"))
        err = round_check(array_survey(array), l->scan.speakers, l->scan.n_speakers,
                          &inner);
    array_close(array);
    return err ? error_say(why, err, "%s: %.900s", l->path, inner.text) : 0;
}

static int check_stage(const struct launchfile *l, struct error *why)
{
    struct error inner = {""};
    struct stage *stage = NULL;
    int err = stage_open(&stage, l->stage.uri, clock_system(), &inner);

    stage_close(stage);
    return err ? error_say_of(l, "stage", &inner, err, why) : 0;
}

static int check_can(const struct launchfile *l, struct error *why)
{
    struct error inner = {""};
    int err = canbus_check(l->can.uri, &inner);

    return err ? error_say_of(l, "can", &inner, err, why) : 0;
}

int devices_check(const struct launchfile *l, struct error *why)
{
    const struct {
        const char *node;
        int (*check)(const struct launchfile *l, struct error *why);
    } devices[] = {{"array", check_array}, {"stage", check_stage}, {"can", check_can}};
    int err = 0;

    for (size_t i = 0; !err && i < sizeof devices / sizeof *devices; i++)
        if (launchfile_runs_here(l, devices[i].node))
            err = devices[i].check(l, why);
    return err ? err : devices_fit(l, why);
}
