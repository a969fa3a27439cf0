/* SPDX-License-Identifier: MIT */
#include "nodes/can/vehicle_bus.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sys/stat.h>

#include "nodes/rt/export.h"
#include "nodes/rt/uri.h"

/* A file that was written since the launcher began. */
static bool is_of_this_run(const char *path)
{
    const char *start = getenv("ANLOS_LAUNCH_NS");
    struct stat st;

    return start && *path && !stat(path, &st) &&
           st.st_mtim.tv_sec * 1000000000LL + st.st_mtim.tv_nsec >= atoll(start);
}

/* The URI of a log that goes on if it has begun. */
static char *logging_uri(const char *uri)
{
    char *path = uri_has_scheme(uri, "log") ? uri_path(uri) : uri_option(uri, "log");
    char *out = NULL;

    if (path)
        out = uri_set_option(uri, "append", is_of_this_run(path) ? "yes" : "no");
    free(path);
    return out;
}

int vehicle_bus_open(struct canbus **out, const struct launchfile *l, struct error *why)
{
    *out = NULL;
    if (uri_has_scheme(l->can.uri, "socketcan"))
        return canbus_open(out, l->can.uri, why);
    int err = export_folder(l->report.folder, why);
    if (err)
        return err;
    char *uri = logging_uri(l->can.uri);
    if (!uri)
        return error_say(why, -ENOMEM, "out of memory");
    err = canbus_open(out, uri, why);
    free(uri);
    return err;
}

const struct clock_source *vehicle_bus_clock(const struct launchfile *l,
                                             const struct clock_source *replayed)
{
    return uri_has_scheme(l->can.uri, "log") ? replayed : clock_system();
}
