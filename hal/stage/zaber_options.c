#include "hal/stage/zaber_options.h"

#include <errno.h>
#include <math.h>

const char *const stage_zaber_option_keys[] = {
    "pitch_mm", "steps",  "resolution", "device", "axis",   "baud", "timeout",
    "checksum", "settle", "min",        "max",    "homing", NULL};

static int read_numbers(struct stage_zaber_options *o, const struct device *d,
                        struct complaint *why)
{
    double device = 1, axis = 1, baud = 115200;
    struct {
        const char *key;
        double min, max, *value;
    } numbers[] = {
        {"pitch_mm", 1e-3, 1000, &o->pitch_mm},
        {"steps", 1, 10000, &o->steps},
        {"resolution", 1, 1024, &o->resolution},
        {"settle", 0, 60, &o->settle_s},
        {"min", -100, 100, &o->min_m},
        {"max", -100, 100, &o->max_m},
        {"timeout", 0.01, 10, &o->port.timeout_s},
        {"device", 1, 99, &device},
        {"axis", 1, 9, &axis},
        {"baud", 9600, 115200, &baud},
    };

    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        int err = device_number(d, numbers[i].key, numbers[i].min, numbers[i].max,
                                numbers[i].value, why);
        if (err)
            return err;
    }
    o->port.device = (unsigned)device;
    o->port.axis = (unsigned)axis;
    o->port.baud = (unsigned)baud;
    return 0;
}

int stage_zaber_options_read(struct stage_zaber_options *o, const struct device *d,
                             struct complaint *why)
{
    static const char *const checksums[] = {"auto", "on", "off", NULL};
    static const char *const homings[] = {"first-move", "manual", NULL};

    *o = (struct stage_zaber_options){.port = {.path = d->path, .timeout_s = 0.3},
                                      .steps = 200,
                                      .settle_s = 0.15,
                                      .min_m = -INFINITY,
                                      .max_m = INFINITY};
    if (!*d->path)
        return complain(why, -EINVAL,
                        "no serial port is named; expected "
                        "zaber:/dev/ttyUSB0?pitch_mm=...");
    if (!device_option(d, "pitch_mm"))
        return complain(why, -EINVAL,
                        "option pitch_mm is missing: the travel of a turn of the motor "
                        "in mm, from the stage's data sheet");
    int err = read_numbers(o, d, why);
    int checksum = err ? err : device_choice(d, "checksum", checksums, why);
    int homing = checksum < 0 ? checksum : device_choice(d, "homing", homings, why);
    if (homing < 0)
        return homing;
    o->port.checksum = (enum zaber_checksum)checksum;
    o->home_first = homing == 0;
    if (o->min_m >= o->max_m)
        return complain(why, -EINVAL, "option min=%g is not under max=%g", o->min_m,
                        o->max_m);
    return 0;
}
