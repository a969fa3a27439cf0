#include "nodes/launcher/devices.h"

#include "hal/array.h"
#include "hal/canbus.h"
#include "hal/stage.h"
#include "nodes/launcher/scenes.h"
#include "nodes/rt/launchfile_hosts.h"
#include "nodes/rt/round_check.h"

static int complain_of(const struct launchfile *l, const char *node,
                       const struct complaint *inner, int err, struct complaint *why)
{
    return complain(why, err, "%s: %s.uri: %.900s", l->path, node, inner->text);
}

static int check_array(const struct launchfile *l, struct complaint *why)
{
    struct complaint inner = {""};
    struct array *array = NULL;
    int err = array_open(&array, l->array.uri, clock_system(), &inner);

    if (err)
        return complain_of(l, "array", &inner, err, why);
    if (l->scan.fixed && launchfile_has_node(l, "scan"))
        err = round_check(array_survey(array), l->scan.speakers, l->scan.n_speakers,
                          &inner);
    array_close(array);
    return err ? complain(why, err, "%s: %.900s", l->path, inner.text) : 0;
}

static int check_stage(const struct launchfile *l, struct complaint *why)
{
    struct complaint inner = {""};
    struct stage *stage = NULL;
    int err = stage_open(&stage, l->stage.uri, clock_system(), &inner);

    stage_close(stage);
    return err ? complain_of(l, "stage", &inner, err, why) : 0;
}

static int check_can(const struct launchfile *l, struct complaint *why)
{
    struct complaint inner = {""};
    int err = canbus_check(l->can.uri, &inner);

    return err ? complain_of(l, "can", &inner, err, why) : 0;
}

int devices_check(const struct launchfile *l, struct complaint *why)
{
    const struct {
        const char *node;
        int (*check)(const struct launchfile *l, struct complaint *why);
    } devices[] = {{"array", check_array}, {"stage", check_stage}, {"can", check_can}};
    int err = 0;

    for (size_t i = 0; !err && i < sizeof devices / sizeof *devices; i++)
        if (launchfile_runs_here(l, devices[i].node))
            err = devices[i].check(l, why);
    return err ? err : scenes_check(l, why);
}
