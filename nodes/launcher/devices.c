#include "nodes/launcher/devices.h"

#include "hal/array.h"
#include "hal/canbus.h"
#include "hal/stage.h"
#include "nodes/rt/launchfile_hosts.h"
#include "nodes/rt/uri.h"

static int check_array(const char *uri, struct complaint *why)
{
    struct array *array = NULL;
    int err = array_open(&array, uri, clock_system(), why);

    array_close(array);
    return err;
}

static int check_stage(const char *uri, struct complaint *why)
{
    struct stage *stage = NULL;
    int err = stage_open(&stage, uri, clock_system(), why);

    stage_close(stage);
    return err;
}

/* A log, also that of a simulated vehicle, lies in a folder that is not there yet. */
static int check_can(const char *uri, struct complaint *why)
{
    struct canbus *bus = NULL;

    if (uri_has_scheme(uri, "log") || uri_has_scheme(uri, "sim"))
        return 0;
    int err = canbus_open(&bus, uri, why);
    canbus_close(bus);
    return err;
}

int devices_check(const struct launchfile *l, struct complaint *why)
{
    const struct {
        const char *node, *uri;
        int (*check)(const char *uri, struct complaint *why);
    } devices[] = {{"array", l->array.uri, check_array},
                   {"stage", l->stage.uri, check_stage},
                   {"can", l->can.uri, check_can}};

    for (size_t i = 0; i < sizeof devices / sizeof *devices; i++) {
        struct complaint inner = {""};
        if (!launchfile_runs_here(l, devices[i].node))
            continue;
        int err = devices[i].check(devices[i].uri, &inner);
        if (err)
            return complain(why, err, "%s: %s.uri: %.900s", l->path, devices[i].node,
                            inner.text);
    }
    return 0;
}
