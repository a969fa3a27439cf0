/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/truth.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "hal/room/room.h"
#include "recon/geometry.h"

/* FOLDER/NAME; release *out with json_decref.  path[size] gets its name, for errors.
 * 0, -ENOENT (there is none), -EINVAL (no JSON, too long a name). */
static int results_file_load(json_t **out, const char *folder, const char *name,
                             char *path, size_t size, struct error *why)
{
    json_error_t error;

    if (snprintf(path, size, "%s/%s", folder, name) >= (int)size)
        return error_say(why, -EINVAL, "%s: the name is too long", folder);
    *out = json_load_file(path, 0, &error);
    if (*out)
        return 0;
    int err = json_error_code(&error) == json_error_cannot_open_file ? -ENOENT : -EINVAL;
    return error_say(why, err, "%s: %s", path, error.text);
}

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

int tracks_print(const char *folder, FILE *to, struct error *why)
{
    char path[4096];
    json_t *root;
    int err = results_file_load(&root, folder, "report.json", path, sizeof path, why);

    if (err)
        return err;
    const json_t *drive = json_object_get(root, "drive");
    const json_t *tracks = json_object_get(drive, "tracks");
    if (!json_is_array(tracks))
        err = error_say(why, -ENODATA, "%s: nothing of tracks is in it", path);
    else
        print_table(drive, tracks, to);
    json_decref(root);
    return err;
}

static int read_position(const json_t *list, double out[3])
{
    if (!json_is_array(list) || json_array_size(list) != 3)
        return -EINVAL;
    for (size_t i = 0; i < 3; i++) {
        const json_t *x = json_array_get(list, i);
        if (!json_is_number(x))
            return -EINVAL;
        out[i] = json_number_value(x);
    }
    return 0;
}

static int read_list(struct truth *t, const json_t *root)
{
    const json_t *list = json_object_get(root, "detections");
    const char *frame = json_string_value(json_object_get(root, "frame"));

    if (!json_is_array(list) || !frame)
        return -EINVAL;
    snprintf(t->frame, sizeof t->frame, "%s", frame);
    t->mirrored = json_is_true(json_object_get(root, "mirrored_at_wall"));
    for (size_t i = 0; i < json_array_size(list) && i < TRUTH_MAX; i++) {
        const json_t *x = json_array_get(list, i);
        struct truth_detection *d = &t->detections[t->n_detections];
        if (json_is_null(json_object_get(x, "position_m")))
            continue;
        if (read_position(json_object_get(x, "position_m"), d->position_m))
            return -EINVAL;
        d->existence = json_number_value(json_object_get(x, "existence"));
        d->object = -1;
        t->n_detections++;
    }
    return 0;
}

int truth_read_detections(struct truth *t, const char *folder, struct error *why)
{
    char path[4096];
    json_t *root;

    t->n_detections = 0;
    int err = results_file_load(&root, folder, "detections.json", path, sizeof path, why);
    if (err)
        return err;
    err = read_list(t, root);
    json_decref(root);
    if (err)
        return error_say(why, err, "%s: is not a list of detections", path);
    return 0;
}

int truth_read_scene(struct truth *t, const char *scene, struct error *why)
{
    const struct room_object *objects;
    struct room *room = NULL;
    int err = room_load(&room, scene, why);

    if (err)
        return err;
    t->moving = room_is_drive(room);
    size_t n = t->moving ? 0 : room_objects(room, &objects);
    t->n_objects = n < TRUTH_MAX ? n : TRUTH_MAX;
    for (size_t i = 0; i < t->n_objects; i++) {
        struct truth_object *o = &t->objects[i];
        const double *p = t->mirrored ? objects[i].position_m : objects[i].virtual_m;
        if (objects[i].name[0])
            snprintf(o->name, sizeof o->name, "%s (%s)", objects[i].name,
                     objects[i].kind);
        else
            snprintf(o->name, sizeof o->name, "%s", objects[i].kind);
        memcpy(o->position_m, p, sizeof o->position_m);
        if (!strcmp(t->frame, "vehicle"))
            survey_to_vehicle(room_survey(room), p, o->position_m);
        o->found = -1;
    }
    room_destroy(room);
    return 0;
}

/* Matches the nearest pair that is left; false: there is none within reach. */
static bool match_nearest(struct truth *t)
{
    double best_m = TRUTH_MATCH_M;
    int object = -1, detection = -1;

    for (size_t i = 0; i < t->n_objects; i++) {
        for (size_t k = 0; k < t->n_detections; k++) {
            if (t->objects[i].found >= 0 || t->detections[k].object >= 0)
                continue;
            double d =
                geometry_distance(t->objects[i].position_m, t->detections[k].position_m);
            if (d > best_m)
                continue;
            best_m = d;
            object = (int)i;
            detection = (int)k;
        }
    }
    if (object < 0)
        return false;
    t->objects[object].found = detection;
    t->detections[detection].object = object;
    return true;
}

void truth_match(struct truth *t)
{
    while (match_nearest(t))
        ;
}

static void print_position(const double p[3], FILE *to)
{
    fprintf(to, "  %6.3f %6.3f %6.3f", p[0], p[1], p[2]);
}

static void print_object(const struct truth *t, const struct truth_object *o, FILE *to)
{
    fprintf(to, "%-18.18s", o->name);
    print_position(o->position_m, to);
    if (o->found < 0) {
        fprintf(to, "  %-20s\n", "not found");
        return;
    }
    const struct truth_detection *d = &t->detections[o->found];
    print_position(d->position_m, to);
    fprintf(to, " %4.1f cm%8.0f %%\n",
            100.0 * geometry_distance(o->position_m, d->position_m),
            100.0 * d->existence);
}

/* Of a real room or a recording nobody knows the truth. */
static void print_detections(const struct truth *t, FILE *to)
{
    fprintf(to, "%-13s  %-20s %9s\n", "hidden object", "reported at (m)", "existence");
    for (size_t k = 0; k < t->n_detections; k++) {
        const struct truth_detection *d = &t->detections[k];
        fprintf(to, "%13zu", k + 1);
        print_position(d->position_m, to);
        fprintf(to, "%8.0f %%\n", 100.0 * d->existence);
    }
    if (!t->n_detections)
        fprintf(to, "none\n");
}

static void print_comparison(const struct truth *t, FILE *to)
{
    fprintf(to, "%-18s  %-20s  %-20s %7s %9s\n", "hidden object",
            t->mirrored ? "really at (m)" : "mirrored at (m)", "reported at (m)", "error",
            "existence");
    for (size_t i = 0; i < t->n_objects; i++)
        print_object(t, &t->objects[i], to);
    for (size_t k = 0; k < t->n_detections; k++) {
        const struct truth_detection *d = &t->detections[k];
        if (d->object >= 0)
            continue;
        fprintf(to, "%-18s  %-20s", "nothing there", "");
        print_position(d->position_m, to);
        fprintf(to, " %7s%8.0f %%\n", "", 100.0 * d->existence);
    }
}

void truth_print(const struct truth *t, FILE *to)
{
    if (t->n_objects)
        print_comparison(t, to);
    else
        print_detections(t, to);
    if (t->moving)
        fprintf(to, "of the last image alone: what is hidden moves\n");
    fprintf(to, "positions in the %s frame%s\n", t->frame,
            t->mirrored ? "" : "; no wall is known, so they are those of mirror images");
}
