/* SPDX-License-Identifier: MIT */
/* The section can of a launch file. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hal/yaml_file.h"
#include "msgs/can/layout.h"
#include "nodes/rt/launchfile_sections.h"
#include "nodes/rt/uri.h"

#define FIRST_BASE 0x100 /* msgs/can/e2e.h: bits 8 to 11 of a data ID are not 0 */
#define LAST_BASE  0x7f0 /* of identifiers of 11 bits */

static int check_can(const struct launchfile *l, struct error *why)
{
    const struct {
        const char *key;
        double value, min, max;
    } numbers[] = {
        {"can.sensor", l->can.sensor, 0,
         l->can.base_id < LAST_BASE ? (LAST_BASE - l->can.base_id) / CAN_SENSOR_STEP : 0},
        {"can.bitrate", l->can.bitrate, 10e3, 1e6},
        {"can.data_bitrate", l->can.data_bitrate, 10e3, 8e6},
        {"can.load", l->can.load, 0.01, 1},
    };

    if (l->can.base_id < FIRST_BASE || l->can.base_id > LAST_BASE)
        return yaml_error_say(
            why, -EINVAL, l->path, "can.base_id", "expected 0x%x to 0x%x, not 0x%x%s",
            FIRST_BASE, LAST_BASE, l->can.base_id,
            l->can.base_id < FIRST_BASE ? ": below, frames of 8 bytes cannot have their "
                                          "end-to-end protection"
                                        : "");
    int err = 0;
    for (size_t i = 0; !err && i < sizeof numbers / sizeof *numbers; i++)
        err = yaml_check_range(l->path, numbers[i].key, numbers[i].value, numbers[i].min,
                               numbers[i].max, why);
    return err;
}

#define LAST_ID 0x1fffffff

/* One by which a tester asks or is answered: of nobody else. */
static int check_diagnosis_id(const struct launchfile *l, const char *key, uint32_t id,
                              struct error *why)
{
    const unsigned first = l->can.base_id + CAN_SENSOR_STEP * l->can.sensor;
    const unsigned last = first + CAN_SENSOR_STEP - 1;

    if (id < 1 || id > LAST_ID)
        return yaml_error_say(why, -EINVAL, l->path, key,
                              "expected 0x1 to 0x%x, not 0x%x", LAST_ID, id);
    if (id >= first && id <= last)
        return yaml_error_say(why, -EINVAL, l->path, key,
                              "0x%x is one of the sensor's own frames, 0x%x to 0x%x", id,
                              first, last);
    return 0;
}

static int check_diagnosis(const struct launchfile *l, const struct launch_text *t,
                           struct error *why)
{
    const unsigned *functional = t->can.diagnosis.functional;
    const uint32_t request = l->can.diagnosis.request;
    const uint32_t response = l->can.diagnosis.response;
    int err = check_diagnosis_id(l, "can.diagnosis.request", request, why);

    if (!err)
        err = check_diagnosis_id(l, "can.diagnosis.response", response, why);
    if (!err && functional)
        err = check_diagnosis_id(l, "can.diagnosis.functional", *functional, why);
    if (err)
        return err;
    if (request == response || (functional && *functional == request) ||
        (functional && *functional == response))
        return yaml_error_say(why, -EINVAL, l->path, "can.diagnosis",
                              "expected a different identifier for each");
    if (!uri_has_scheme(l->can.uri, "socketcan"))
        return yaml_error_say(why, -EINVAL, l->path, "can.diagnosis",
                              "is of a CAN interface, socketcan:can0, say; %s carries no "
                              "ISO-TP",
                              l->can.uri);
    return 0;
}

static int copy_diagnosis(struct launchfile *l, const struct launch_text *t,
                          struct error *why)
{
    const struct launch_text_can_diagnosis *d = &t->can.diagnosis;

    if (!d->request && !d->response && !d->functional)
        return 0;
    if (!d->request || !d->response)
        return yaml_error_say(why, -EINVAL, l->path, "can.diagnosis",
                              "expected request and response, the identifiers by which a "
                              "tester asks and is answered");
    l->can.diagnosis.request = *d->request;
    l->can.diagnosis.response = *d->response;
    l->can.diagnosis.functional = d->functional ? *d->functional : 0;
    return check_diagnosis(l, t, why);
}

static unsigned unsigned_or(const unsigned *value, unsigned otherwise)
{
    return value ? *value : otherwise;
}

int launchfile_copy_can(struct launchfile *l, const struct launch_text *t,
                        struct error *why)
{
    l->can.base_id = unsigned_or(t->can.base_id, CAN_BASE_DEFAULT);
    l->can.sensor = unsigned_or(t->can.sensor, 0);
    l->can.fd = t->can.fd && *t->can.fd;
    l->can.motion = t->can.motion && *t->can.motion;
    l->can.field_of_view = t->can.field_of_view && *t->can.field_of_view;
    l->can.bitrate = unsigned_or(t->can.bitrate, 500000);
    l->can.data_bitrate = unsigned_or(t->can.data_bitrate, 2000000);
    l->can.load = t->can.load ? *t->can.load : 0.5;
    l->can.uri = strdup(t->can.uri ? t->can.uri : "log:can.candump");
    if (!l->can.uri)
        return -ENOMEM;
    int err = check_can(l, why);
    return err ? err : copy_diagnosis(l, t, why);
}

int launchfile_resolve_can(struct launchfile *l, const char *folder)
{
    if (uri_has_scheme(l->can.uri, "log"))
        return uri_replace(&l->can.uri, uri_in_folder(l->can.uri, l->report.folder));
    if (!uri_has_scheme(l->can.uri, "sim"))
        return 0;
    int err = uri_replace(&l->can.uri, uri_in_folder(l->can.uri, folder));
    return err ? err
               : uri_replace(&l->can.uri,
                             uri_option_in_folder(l->can.uri, l->report.folder, "log"));
}

void launchfile_free_can(struct launchfile *l)
{
    free(l->can.uri);
}
