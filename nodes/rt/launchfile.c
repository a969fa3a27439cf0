/* SPDX-License-Identifier: MIT */
#include "nodes/rt/launchfile.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/nearest.h"
#include "hal/yaml_file.h"
#include "msgs/topics.h"
#include "nodes/rt/launchfile_hosts.h"
#include "nodes/rt/launchfile_sections.h"
#include "nodes/rt/launchfile_text.h"
#include "nodes/rt/uri.h"
#include "recon/imaging/imager.h"

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

bool launchfile_has_node(const struct launchfile *l, const char *name)
{
    for (unsigned i = 0; i < l->n_nodes; i++)
        if (!strcmp(l->nodes[i], name))
            return true;
    return false;
}

bool launchfile_moves_stage(const struct launchfile *l)
{
    return launchfile_has_node(l, "stage") && !uri_has_scheme(l->array.uri, "wav");
}

bool launchfile_keeps_pace(const struct launchfile *l)
{
    char *pace = uri_option(l->array.uri, "pace");
    bool fast = pace && !strcmp(pace, "fast");

    free(pace);
    return l->scan.fixed && !fast && !launchfile_has_node(l, "play");
}

char *launchfile_beside(const struct launchfile *l, const char *path)
{
    const char *slash = strrchr(l->path, '/');
    int folder = slash && path[0] != '/' ? (int)(slash - l->path) + 1 : 0;
    char *out = NULL;

    return asprintf(&out, "%.*s%s", folder, l->path, path) < 0 ? NULL : out;
}

static char *copy_text(const char *text, const char *otherwise)
{
    return strdup(text ? text : otherwise);
}

static unsigned unsigned_or(const unsigned *value, unsigned otherwise)
{
    return value ? *value : otherwise;
}

static double double_or(const double *value, double otherwise)
{
    return value ? *value : otherwise;
}

/* The brightest part of a person, by way of walls that mirror their own echo and his
 * alike (recon/detection/detection_range.h). */
#define PERSON_M 0.05

/* Everything but the list of nodes, with defaults, and paths as they are written. */
static int copy_parts(struct launchfile *l, const struct launch_text *t,
                      const struct launchfile_options *options)
{
    l->array.uri = copy_text(t->array.uri, "");
    l->array.person_m = double_or(t->array.person_m, PERSON_M);
    l->stage.uri = copy_text(t->stage.uri, "sim:");
    l->scan.window = unsigned_or(t->scan.window, 32);
    l->scan.retries = unsigned_or(t->scan.retries, 3);
    l->scan.timeout_s = double_or(t->scan.timeout_s, 5.0);
    l->recon.method = copy_text(t->recon.method, "fast");
    l->recon.threads = unsigned_or(t->recon.threads, 0);
    l->recon.preview = !t->recon.preview || *t->recon.preview;
    l->report.folder =
        copy_text(options && options->out ? options->out : t->report.folder, "out");
    return l->array.uri && l->stage.uri && l->recon.method && l->report.folder ? 0
                                                                               : -ENOMEM;
}

static int copy_dsp(struct launchfile *l, const struct launch_text *t, struct error *why)
{
    l->dsp.window = WINDOW_HANN;
    l->dsp.compression = COMPRESSION_MATCHED_FILTER;
    if (t->dsp.window && window_from_name(t->dsp.window, &l->dsp.window))
        return yaml_error_say(why, -EINVAL, l->path, "dsp.window",
                              "expected hann, hamming or rectangular, not %s",
                              t->dsp.window);
    if (t->dsp.compression &&
        compression_from_name(t->dsp.compression, &l->dsp.compression))
        return yaml_error_say(why, -EINVAL, l->path, "dsp.compression",
                              "expected matched_filter or deramp, not %s",
                              t->dsp.compression);
    return 0;
}

static int copy_processes(struct launchfile *l, const struct launch_text *t,
                          struct error *why)
{
    static const char *const names[] = {[REALTIME_AUTO] = "auto",
                                        [REALTIME_OFF] = "off",
                                        [REALTIME_REQUIRED] = "required"};
    const char *name = t->processes.realtime ? t->processes.realtime : "auto";
    double alive_s = double_or(t->processes.alive_s, 3.0);
    unsigned mode = 0;

    while (mode <= REALTIME_REQUIRED && strcmp(names[mode], name))
        mode++;
    if (mode > REALTIME_REQUIRED)
        return yaml_error_say(why, -EINVAL, l->path, "processes.realtime",
                              "expected auto, off or required, not %s", name);
    if (alive_s != 0.0 && !(alive_s >= 2.0 && alive_s <= 3600.0))
        return yaml_error_say(
            why, -EINVAL, l->path, "processes.alive_s",
            "expected 0 (never) or 2 to 3600, not %g: health comes once "
            "a second",
            alive_s);
    l->processes.realtime = (enum realtime_mode)mode;
    l->processes.alive_s = alive_s;
    return 0;
}

/* Options of the method, which must use them. */
static int copy_options(struct launchfile *l, const struct launch_text *t,
                        struct error *why)
{
    struct imager_options *o = &l->recon.options;
    imager_options_default(o);
    for (const struct imager_option *i = imager_option_table; i->name; i++) {
        const char *value = launch_text_option(t, i->name);
        char text[128], key[64], reason[512];
        if (!value)
            continue;
        snprintf(text, sizeof text, "%s=%s", i->name, value);
        snprintf(key, sizeof key, "recon.options.%s", i->name);
        if (imager_option_set(o, text, reason, sizeof reason) ||
            imager_options_check(o, l->recon.method, reason, sizeof reason))
            return yaml_error_say(why, -EINVAL, l->path, key, "%s", reason);
    }
    return 0;
}

/* Whoever may publish is a node, but for the launcher, which reads this. */
static bool is_node(const char *name)
{
    for (const char *const *n = topics_nodes(); *n; n++)
        if (!strcmp(*n, name))
            return strcmp(name, "launcher") != 0;
    return false;
}

static int copy_nodes(struct launchfile *l, const struct launch_text *t,
                      struct error *why)
{
    l->nodes = calloc(t->nodes_count, sizeof *l->nodes);
    if (!l->nodes)
        return -ENOMEM;
    for (unsigned i = 0; i < t->nodes_count; i++) {
        char key[32];
        snprintf(key, sizeof key, "nodes[%u]", i);
        if (!is_node(t->nodes[i]))
            return yaml_error_say(
                why, -EINVAL, l->path, key,
                "%s is no node; expected stage, array, scan, dsp, recon, "
                "track, can, report, record, play, view or wall",
                t->nodes[i]);
        if (launchfile_has_node(l, t->nodes[i]))
            return yaml_error_say(why, -EINVAL, l->path, "nodes",
                                  "expected each node once, but %s is there twice",
                                  t->nodes[i]);
        l->nodes[i] = strdup(t->nodes[i]);
        if (!l->nodes[i])
            return -ENOMEM;
        l->n_nodes = i + 1;
    }
    return 0;
}

static int resolve_paths(struct launchfile *l, const struct launchfile_options *options)
{
    static const char *const options_with_paths[] = {"background", "survey", "calibrated",
                                                     "rig"};
    const char *slash = strrchr(l->path, '/');
    char *folder = slash
                       ? strndup(l->path, (size_t)(slash - l->path) + (slash == l->path))
                       : strdup(".");
    int err = folder ? 0 : -ENOMEM;

    if (!err &&
        (uri_has_scheme(l->array.uri, "sim") || uri_has_scheme(l->array.uri, "wav")))
        err = uri_replace(&l->array.uri, uri_in_folder(l->array.uri, folder));
    for (size_t i = 0; !err && i < COUNT(options_with_paths); i++)
        err = uri_replace(&l->array.uri, uri_option_in_folder(l->array.uri, folder,
                                                              options_with_paths[i]));
    if (!err)
        err = launchfile_resolve_can(l, folder);
    /* A recording says itself how it was made. */
    if (!err && l->scan.continuous && !uri_has_scheme(l->array.uri, "wav"))
        err =
            uri_replace(&l->array.uri, uri_set_option(l->array.uri, "continuous", "yes"));
    if (!err && options && options->realtime && uri_has_scheme(l->array.uri, "sim"))
        err = uri_replace(&l->array.uri, uri_set_option(l->array.uri, "pace", "real"));
    if (!err && options && options->realtime && uri_has_scheme(l->stage.uri, "sim"))
        err = uri_replace(&l->stage.uri, uri_set_option(l->stage.uri, "pace", "real"));
    free(folder);
    return err;
}

static int check_numbers(const struct launchfile *l, struct error *why)
{
    const struct {
        const char *key;
        double value, min, max;
    } numbers[] = {
        {"scan.window", l->scan.window, 1, 4096},
        {"scan.retries", l->scan.retries, 0, 100},
        {"scan.timeout_s", l->scan.timeout_s, 0.1, 600},
        {"recon.threads", l->recon.threads, 0, 256},
    };
    int err = 0;

    if (!(l->array.person_m >= 1e-3 && l->array.person_m <= 10.0))
        err = yaml_error_say(why, -EINVAL, l->path, "array.person_m",
                             "%g is outside 0.001..10", l->array.person_m);
    for (size_t i = 0; !err && i < COUNT(numbers); i++)
        err = yaml_check_range(l->path, numbers[i].key, numbers[i].value, numbers[i].min,
                               numbers[i].max, why);
    return err;
}

static int check(const struct launchfile *l, struct error *why)
{
    if (!l->array.uri[0] && launchfile_has_node(l, "array"))
        return yaml_error_say(why, -EINVAL, l->path, "array.uri",
                              "expected a device, e.g. \"sim:SCENE.yaml\"");
    if (!imager_has_method(l->recon.method)) {
        char hint[NEAREST_HINT_SIZE];
        return yaml_error_say(
            why, -EINVAL, l->path, "recon.method",
            "%s is not one of the methods, e.g. fast or backprojection%s",
            l->recon.method, nearest_hint(hint, l->recon.method, imager_methods()));
    }
    return check_numbers(l, why);
}

static int fill(struct launchfile *l, const struct launch_text *text,
                const struct launchfile_options *options, struct error *why)
{
    int err = copy_nodes(l, text, why);

    if (!err)
        err = launchfile_copy_hosts(l, text, why);
    if (!err)
        err = launchfile_copy_view(l, text, why);
    if (!err)
        err = launchfile_copy_record(l, text, options, why);
    if (!err)
        err = launchfile_copy_play(l, text, options, why);
    if (!err)
        err = launchfile_copy_can(l, text, why);
    if (!err)
        err = launchfile_copy_wall(l, text, why);
    if (!err)
        err = launchfile_copy_scan(l, text, why);
    if (!err)
        err = launchfile_copy_track(l, text, why);
    if (!err)
        err = copy_dsp(l, text, why);
    if (!err)
        err = copy_processes(l, text, why);
    if (!err)
        err = copy_parts(l, text, options);
    if (!err)
        err = check(l, why);
    if (!err)
        err = launchfile_copy_frames(l, text, why);
    if (!err)
        err = copy_options(l, text, why);
    if (!err)
        err = resolve_paths(l, options);
    return err == -ENOMEM ? error_say(why, err, "%s: not enough memory", l->path) : err;
}

/* Takes over text. */
static int create(struct launchfile **out, const char *path, void *text,
                  const struct launchfile_options *options, struct error *why)
{
    struct launchfile *l = calloc(1, sizeof *l);
    int err;

    if (l && (l->path = strdup(path)))
        err = fill(l, text, options, why);
    else
        err = error_say(why, -ENOMEM, "%s: not enough memory", path);
    yaml_unload(&launch_text_schema, text);
    if (err)
        launchfile_destroy(l);
    else
        *out = l;
    return err;
}

int launchfile_load(struct launchfile **out, const char *path,
                    const struct launchfile_options *options, struct error *why)
{
    void *text;
    int err = yaml_load(path, &launch_text_schema, &text, why);

    return err ? err : create(out, path, text, options, why);
}

int launchfile_parse(struct launchfile **out, const char *path, const void *data,
                     size_t size, struct error *why)
{
    void *text;
    int err = yaml_parse(path, data, size, &launch_text_schema, &text, why);

    return err ? err : create(out, path, text, NULL, why);
}

void launchfile_destroy(struct launchfile *l)
{
    if (!l)
        return;
    for (unsigned i = 0; i < l->n_nodes; i++)
        free(l->nodes[i]);
    free(l->nodes);
    free(l->array.uri);
    free(l->stage.uri);
    free(l->recon.method);
    launchfile_free_can(l);
    free(l->report.folder);
    launchfile_free_scan(l);
    launchfile_free_record(l);
    launchfile_free_play(l);
    launchfile_free_view(l);
    free(l->path);
    free(l);
}
