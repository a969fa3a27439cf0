#include "nodes/rt/launchfile.h"

#include <cyaml/cyaml.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hal/yaml_file.h"
#include "hal/yaml_place.h"
#include "nodes/rt/uri.h"
#include "recon/imager.h"

/* The file as it is written; what is a pointer and NULL was left out. */

struct array_part {
    char *uri;
};

struct stage_part {
    char *uri;
};

struct scan_part {
    bool *background;
    unsigned *window, *retries;
    double *timeout_s;
};

struct dsp_part {
    unsigned *window, *compression;
};

struct recon_part {
    char *method;
    unsigned *threads;
    bool *preview;
};

struct track_part {
    double *threshold_db, *min_existence;
};

struct can_part {
    char *uri;
    unsigned *base_id;
};

struct report_part {
    char *folder;
};

struct launch_text {
    unsigned *nodes;
    unsigned nodes_count;
    struct array_part array;
    struct stage_part stage;
    struct scan_part scan;
    struct dsp_part dsp;
    struct recon_part recon;
    struct track_part track;
    struct can_part can;
    struct report_part report;
};

static const char *const known_nodes[] = {"stage", "array", "scan",   "dsp", "recon",
                                          "track", "can",   "report", NULL};

static const cyaml_strval_t node_names[] = {
    {"stage", 0}, {"array", 1}, {"scan", 2}, {"dsp", 3},
    {"recon", 4}, {"track", 5}, {"can", 6},  {"report", 7},
};
static const cyaml_strval_t window_names[] = {
    {"rectangular", 0}, {"hann", 1}, {"hamming", 2}};
static const cyaml_strval_t compression_names[] = {{"matched_filter", 0}, {"deramp", 1}};

#define OPTIONAL  CYAML_FLAG_OPTIONAL
#define STRICT    (CYAML_FLAG_OPTIONAL | CYAML_FLAG_STRICT)
#define COUNT(a)  (sizeof(a) / sizeof((a)[0]))
#define TEXT_SIZE 1024

static const cyaml_schema_value_t node_schema = {
    CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, unsigned, node_names, COUNT(node_names))};
static const cyaml_schema_field_t array_fields[] = {
    CYAML_FIELD_STRING_PTR("uri", CYAML_FLAG_POINTER, struct array_part, uri, 1,
                           TEXT_SIZE),
    CYAML_FIELD_END};
static const cyaml_schema_field_t stage_fields[] = {
    CYAML_FIELD_STRING_PTR("uri", CYAML_FLAG_POINTER, struct stage_part, uri, 1,
                           TEXT_SIZE),
    CYAML_FIELD_END};
static const cyaml_schema_field_t scan_fields[] = {
    CYAML_FIELD_BOOL_PTR("background", OPTIONAL, struct scan_part, background),
    CYAML_FIELD_UINT_PTR("window", OPTIONAL, struct scan_part, window),
    CYAML_FIELD_UINT_PTR("retries", OPTIONAL, struct scan_part, retries),
    CYAML_FIELD_FLOAT_PTR("timeout_s", OPTIONAL, struct scan_part, timeout_s),
    CYAML_FIELD_END};
static const cyaml_schema_field_t dsp_fields[] = {
    CYAML_FIELD_ENUM_PTR("window", STRICT, struct dsp_part, window, window_names,
                         COUNT(window_names)),
    CYAML_FIELD_ENUM_PTR("compression", STRICT, struct dsp_part, compression,
                         compression_names, COUNT(compression_names)),
    CYAML_FIELD_END};
static const cyaml_schema_field_t recon_fields[] = {
    CYAML_FIELD_STRING_PTR("method", CYAML_FLAG_POINTER | OPTIONAL, struct recon_part,
                           method, 1, 64),
    CYAML_FIELD_UINT_PTR("threads", OPTIONAL, struct recon_part, threads),
    CYAML_FIELD_BOOL_PTR("preview", OPTIONAL, struct recon_part, preview),
    CYAML_FIELD_END};
static const cyaml_schema_field_t track_fields[] = {
    CYAML_FIELD_FLOAT_PTR("threshold_db", OPTIONAL, struct track_part, threshold_db),
    CYAML_FIELD_FLOAT_PTR("min_existence", OPTIONAL, struct track_part, min_existence),
    CYAML_FIELD_END};
static const cyaml_schema_field_t can_fields[] = {
    CYAML_FIELD_STRING_PTR("uri", CYAML_FLAG_POINTER | OPTIONAL, struct can_part, uri, 1,
                           TEXT_SIZE),
    CYAML_FIELD_UINT_PTR("base_id", OPTIONAL, struct can_part, base_id), CYAML_FIELD_END};
static const cyaml_schema_field_t report_fields[] = {
    CYAML_FIELD_STRING_PTR("folder", CYAML_FLAG_POINTER, struct report_part, folder, 1,
                           TEXT_SIZE),
    CYAML_FIELD_END};

static const cyaml_schema_field_t launch_fields[] = {
    CYAML_FIELD_SEQUENCE("nodes", CYAML_FLAG_POINTER, struct launch_text, nodes,
                         &node_schema, 1, COUNT(node_names)),
    CYAML_FIELD_MAPPING("array", OPTIONAL, struct launch_text, array, array_fields),
    CYAML_FIELD_MAPPING("stage", OPTIONAL, struct launch_text, stage, stage_fields),
    CYAML_FIELD_MAPPING("scan", OPTIONAL, struct launch_text, scan, scan_fields),
    CYAML_FIELD_MAPPING("dsp", OPTIONAL, struct launch_text, dsp, dsp_fields),
    CYAML_FIELD_MAPPING("recon", OPTIONAL, struct launch_text, recon, recon_fields),
    CYAML_FIELD_MAPPING("track", OPTIONAL, struct launch_text, track, track_fields),
    CYAML_FIELD_MAPPING("can", OPTIONAL, struct launch_text, can, can_fields),
    CYAML_FIELD_MAPPING("report", OPTIONAL, struct launch_text, report, report_fields),
    CYAML_FIELD_END};
static const cyaml_schema_value_t launch_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct launch_text, launch_fields)};

const char *const *launchfile_known_nodes(void)
{
    return known_nodes;
}

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

/* Everything but the list of nodes, with defaults, and paths as they are written. */
static int copy_parts(struct launchfile *l, const struct launch_text *t,
                      const struct launchfile_options *options)
{
    l->array.uri = copy_text(t->array.uri, "");
    l->stage.uri = copy_text(t->stage.uri, "sim:");
    l->scan.background = t->scan.background && *t->scan.background;
    l->scan.window = unsigned_or(t->scan.window, 32);
    l->scan.retries = unsigned_or(t->scan.retries, 3);
    l->scan.timeout_s = double_or(t->scan.timeout_s, 5.0);
    l->dsp.window = strdup(window_names[unsigned_or(t->dsp.window, 1)].str);
    l->dsp.compression =
        strdup(compression_names[unsigned_or(t->dsp.compression, 0)].str);
    l->recon.method = copy_text(t->recon.method, "fast");
    l->recon.threads = unsigned_or(t->recon.threads, 0);
    l->recon.preview = !t->recon.preview || *t->recon.preview;
    l->track.threshold_db = double_or(t->track.threshold_db, 12.0);
    l->track.min_existence = double_or(t->track.min_existence, 0.5);
    l->can.uri = copy_text(t->can.uri, "log:can.candump");
    l->can.base_id = unsigned_or(t->can.base_id, 0x400);
    l->report.folder =
        copy_text(options && options->out ? options->out : t->report.folder, "out");
    return l->array.uri && l->stage.uri && l->dsp.window && l->dsp.compression &&
                   l->recon.method && l->can.uri && l->report.folder
               ? 0
               : -ENOMEM;
}

static int copy_nodes(struct launchfile *l, const struct launch_text *t,
                      struct complaint *why)
{
    l->nodes = calloc(t->nodes_count, sizeof *l->nodes);
    if (!l->nodes)
        return -ENOMEM;
    for (unsigned i = 0; i < t->nodes_count; i++) {
        if (launchfile_has_node(l, known_nodes[t->nodes[i]]))
            return yaml_complain(why, -EINVAL, l->path, "nodes",
                                 "expected each node once, but %s is there twice",
                                 known_nodes[t->nodes[i]]);
        l->nodes[i] = strdup(known_nodes[t->nodes[i]]);
        if (!l->nodes[i])
            return -ENOMEM;
        l->n_nodes = i + 1;
    }
    return 0;
}

/* *uri becomes text, which may be NULL for want of memory. */
static int replace(char **uri, char *text)
{
    if (!text)
        return -ENOMEM;
    free(*uri);
    *uri = text;
    return 0;
}

static int resolve_paths(struct launchfile *l, const struct launchfile_options *options)
{
    static const char *const options_with_paths[] = {"background", "survey"};
    const char *slash = strrchr(l->path, '/');
    char *folder = slash
                       ? strndup(l->path, (size_t)(slash - l->path) + (slash == l->path))
                       : strdup(".");
    int err = folder ? 0 : -ENOMEM;

    if (!err &&
        (uri_has_scheme(l->array.uri, "sim") || uri_has_scheme(l->array.uri, "wav")))
        err = replace(&l->array.uri, uri_in_folder(l->array.uri, folder));
    for (size_t i = 0; !err && i < COUNT(options_with_paths); i++)
        err = replace(&l->array.uri,
                      uri_option_in_folder(l->array.uri, folder, options_with_paths[i]));
    if (!err && uri_has_scheme(l->can.uri, "log"))
        err = replace(&l->can.uri, uri_in_folder(l->can.uri, l->report.folder));
    if (!err && options && options->realtime && uri_has_scheme(l->array.uri, "sim"))
        err = replace(&l->array.uri, uri_set_option(l->array.uri, "pace", "real"));
    if (!err && options && options->realtime && uri_has_scheme(l->stage.uri, "sim"))
        err = replace(&l->stage.uri, uri_set_option(l->stage.uri, "pace", "real"));
    free(folder);
    return err;
}

static bool method_is_known(const char *method)
{
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
        if (!strcmp(m, method))
            return true;
    return false;
}

static int check_numbers(const struct launchfile *l, struct complaint *why)
{
    const struct {
        const char *key;
        double value, min, max;
    } numbers[] = {
        {"scan.window", l->scan.window, 1, 4096},
        {"scan.retries", l->scan.retries, 0, 100},
        {"scan.timeout_s", l->scan.timeout_s, 0.1, 600},
        {"recon.threads", l->recon.threads, 0, 256},
        {"track.threshold_db", l->track.threshold_db, 0, 120},
        {"track.min_existence", l->track.min_existence, 0, 1},
        {"can.base_id", l->can.base_id, 0, 0x7f0},
    };

    for (size_t i = 0; i < COUNT(numbers); i++)
        if (!(numbers[i].value >= numbers[i].min && numbers[i].value <= numbers[i].max))
            return yaml_complain(why, -EINVAL, l->path, numbers[i].key,
                                 "expected %g to %g, not %g", numbers[i].min,
                                 numbers[i].max, numbers[i].value);
    return 0;
}

static int check(const struct launchfile *l, struct complaint *why)
{
    if (!l->array.uri[0] && launchfile_has_node(l, "array"))
        return yaml_complain(why, -EINVAL, l->path, "array.uri",
                             "expected a device, e.g. \"sim:SCENE.yaml\"");
    if (!method_is_known(l->recon.method))
        return yaml_complain(why, -EINVAL, l->path, "recon.method",
                             "%s is not one of the methods, e.g. fast or backprojection",
                             l->recon.method);
    return check_numbers(l, why);
}

int launchfile_load(struct launchfile **out, const char *path,
                    const struct launchfile_options *options, struct complaint *why)
{
    void *text = NULL;
    struct launchfile *l = calloc(1, sizeof *l);
    int err;

    if (!l || !(l->path = strdup(path))) {
        free(l);
        return complain(why, -ENOMEM, "%s: not enough memory", path);
    }
    err = yaml_load(path, &launch_schema, &text, why);
    if (err)
        goto fail;
    err = copy_nodes(l, text, why);
    if (!err)
        err = copy_parts(l, text, options);
    if (!err)
        err = check(l, why);
    if (!err)
        err = resolve_paths(l, options);
    if (err == -ENOMEM)
        complain(why, err, "%s: not enough memory", path);
    yaml_unload(&launch_schema, text);
    if (err)
        goto fail;
    *out = l;
    return 0;
fail:
    launchfile_destroy(l);
    return err;
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
    free(l->dsp.window);
    free(l->dsp.compression);
    free(l->recon.method);
    free(l->can.uri);
    free(l->report.folder);
    free(l->path);
    free(l);
}
