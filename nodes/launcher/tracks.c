#include "nodes/launcher/tracks.h"

#include <errno.h>

#include "nodes/launcher/results_file.h"

static double number(const json_t *track, const char *name)
{
    return json_number_value(json_object_get(track, name));
}

static double place(const json_t *track, const char *name, size_t axis)
{
    return json_number_value(json_array_get(json_object_get(track, name), axis));
}

static void print_track(const json_t *x, FILE *to)
{
    const char *class = json_string_value(json_object_get(x, "class"));

    fprintf(to, "%5.0f %7.1f to %6.1f %8.2f %6.2f %8.2f %6.2f %6.1f  %-8.8s %6.0f %%\n",
            number(x, "id"), number(x, "first_s"), number(x, "last_s"),
            place(x, "from_m", 0), place(x, "from_m", 1), place(x, "to_m", 0),
            place(x, "to_m", 1), number(x, "mean_speed_m_s"), class ? class : "",
            100.0 * number(x, "greatest_existence"));
}

static void print_table(const json_t *drive, const json_t *tracks, FILE *to)
{
    const char *frame = json_string_value(json_object_get(drive, "frame"));
    size_t n = json_array_size(tracks), first = n > TRACKS_SHOWN ? n - TRACKS_SHOWN : 0;

    fprintf(to, "\nhidden objects tracked in %.0f s: %zu\n", number(drive, "seconds"), n);
    if (n)
        fprintf(to, "%5s %17s %15s %15s %6s  %-8s %8s\n", "track", "tracked (s)",
                "from x, y (m)", "to x, y (m)", "m/s", "class", "certain");
    if (first)
        fprintf(to, "  ... %zu before these are in report.json\n", first);
    for (size_t i = first; i < n; i++)
        print_track(json_array_get(tracks, i), to);
    fprintf(to,
            "positions in the %s frame of that moment; plan.png shows the newest from "
            "above\n",
            frame ? frame : "array");
}

int tracks_print(const char *folder, FILE *to, struct complaint *why)
{
    char path[4096];
    json_t *root;
    int err = results_file_load(&root, folder, "report.json", path, sizeof path, why);

    if (err)
        return err;
    const json_t *drive = json_object_get(root, "drive");
    const json_t *tracks = json_object_get(drive, "tracks");
    if (!json_is_array(tracks))
        err = complain(why, -ENODATA, "%s: nothing of tracks is in it", path);
    else
        print_table(drive, tracks, to);
    json_decref(root);
    return err;
}
