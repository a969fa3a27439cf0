/* SPDX-License-Identifier: MIT */
#include "nodes/rt/names.h"

#include <stddef.h>

#define NAME(names, value)                                                               \
    name((names), sizeof(names) / sizeof *(names), (unsigned)(value))

static const char *name(const char *const *names, size_t n, unsigned value)
{
    return value < n ? names[value] : "unknown";
}

const char *name_of_source(Anlos__Source source)
{
    static const char *const names[] = {"live", "replay", "simulation"};
    return NAME(names, source);
}

const char *name_of_pass(Anlos__Pass pass)
{
    static const char *const names[] = {"scene", "background"};
    return NAME(names, pass);
}

const char *name_of_scan_state(Anlos__ScanStatus__State state)
{
    static const char *const names[] = {"waiting", "running", "done", "failed", "paused"};
    return NAME(names, state);
}

const char *name_of_stage_state(Anlos__StageState__State state)
{
    static const char *const names[] = {"at rest", "moving", "settling", "fault",
                                        "refused"};
    return NAME(names, state);
}

const char *name_of_health_state(Anlos__Health__State state)
{
    static const char *const names[] = {"starting", "ready", "degraded", "fault"};
    return NAME(names, state);
}

const char *name_of_log_level(Anlos__Log__Level level)
{
    static const char *const names[] = {"debug", "info", "warning", "error"};
    return NAME(names, level);
}

const char *name_of_measurement(Anlos__Measurement measurement)
{
    static const char *const names[] = {"new", "measured", "predicted", "deleted"};
    return NAME(names, measurement);
}

const char *name_of_shape(Anlos__Shape shape)
{
    static const char *const names[] = {"", "point", "plate", "extended"};
    return (unsigned)shape < sizeof names / sizeof *names ? names[shape] : "";
}

const char *name_of_wall_origin(Anlos__Wall__Origin origin)
{
    static const char *const names[] = {"configured", "given", "estimated"};
    return NAME(names, origin);
}
