#include "nodes/launcher/scenes.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hal/room/scene.h"
#include "nodes/rt/launchfile_hosts.h"
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
                      struct complaint *why)
{
    if (!array || !can || is_same_file(array, can))
        return 0;
    return complain(why, -EINVAL,
                    "%s: can.uri: the vehicle drives in %s, but its array hears %s "
                    "(array.uri); name the same scene in both",
                    l->path, can, array);
}

static int check_pace(const struct launchfile *l, const char *array,
                      struct complaint *why)
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
        err =
            complain(why, -EINVAL,
                     "%s: scan.mode: %s is a drive, in which things move on while a scan "
                     "takes its steps; expected fixed",
                     l->path, array);
    scene_free(scene);
    survey_clear(&survey);
    return err;
}

int scenes_check(const struct launchfile *l, struct complaint *why)
{
    char *array = NULL, *can = NULL;
    int err = scene_of(l, "array", l->array.uri, &array);

    if (!err)
        err = scene_of(l, "can", l->can.uri, &can);
    if (err)
        complain(why, err, "%s: not enough memory", l->path);
    else
        err = check_pair(l, array, can, why);
    if (!err)
        err = check_pace(l, array, why);
    free(array);
    free(can);
    return err;
}
