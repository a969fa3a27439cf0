/* SPDX-License-Identifier: MIT */
#include "nodes/rt/launchfile.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cyaml/cyaml.h>

#include "hal/yaml_file.h"
#include "msgs/can/layout.h"
#include "msgs/topics.h"
#include "nodes/rt/uri.h"
#include "recon/imaging/imager.h"
#include "recon/tracking/object_tracker.h"
#include "recon/walls/wall_finder.h"

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

/* -- as it is written -------------------------------------------------------------------
 *
 * What is a pointer and NULL was left out, and names are not checked yet. */

#define OPTIONAL  CYAML_FLAG_OPTIONAL
#define NAME_SIZE 64
#define TEXT_SIZE 1024
#define MAX_NODES 16

/* Fields of a section's struct, under their names. */
#define STRING(of, name, flags, least, most)                                             \
    CYAML_FIELD_STRING_PTR(#name, CYAML_FLAG_POINTER | (flags), struct launch_text_##of, \
                           name, least, most)
#define NAME(of, name)          STRING(of, name, OPTIONAL, 1, NAME_SIZE)
#define NAME_NEEDED(of, name)   STRING(of, name, 0, 1, NAME_SIZE)
#define TEXT(of, name)          STRING(of, name, OPTIONAL, 1, TEXT_SIZE)
#define TEXT_NEEDED(of, name)   STRING(of, name, 0, 1, TEXT_SIZE)
#define TEXT_OR_EMPTY(of, name) STRING(of, name, OPTIONAL, 0, TEXT_SIZE)
#define REAL(of, name)                                                                   \
    CYAML_FIELD_FLOAT_PTR(#name, OPTIONAL, struct launch_text_##of, name)
#define WHOLE(of, name)                                                                  \
    CYAML_FIELD_UINT_PTR(#name, OPTIONAL, struct launch_text_##of, name)
#define FLAG(of, name)                                                                   \
    CYAML_FIELD_BOOL_PTR(#name, OPTIONAL, struct launch_text_##of, name)
#define PART(of, name, fields)                                                           \
    CYAML_FIELD_MAPPING(#name, OPTIONAL, struct launch_text_##of, name, fields)
#define SECTION(name)                                                                    \
    CYAML_FIELD_MAPPING(#name, OPTIONAL, struct launch_text, name, name##_fields)

static const cyaml_schema_value_t node_schema = {
    CYAML_VALUE_STRING(CYAML_FLAG_POINTER, char, 1, NAME_SIZE)};

struct launch_text_array {
    char *uri;
    double *person_m;
};

static const cyaml_schema_field_t array_fields[] = {
    TEXT_NEEDED(array, uri), REAL(array, person_m), CYAML_FIELD_END};

struct launch_text_stage {
    char *uri;
};

static const cyaml_schema_field_t stage_fields[] = {TEXT_NEEDED(stage, uri),
                                                    CYAML_FIELD_END};

struct launch_text_scan {
    char *mode;
    bool *background;
    unsigned *window, *retries, *background_frames;
    uint32_t *speakers; /* [speakers_count] */
    unsigned speakers_count;
    double *timeout_s;
};

static const cyaml_schema_value_t index_schema = {
    CYAML_VALUE_UINT(CYAML_FLAG_DEFAULT, uint32_t)};
static const cyaml_schema_field_t scan_fields[] = {
    NAME(scan, mode),
    FLAG(scan, background),
    CYAML_FIELD_SEQUENCE("speakers", CYAML_FLAG_POINTER | OPTIONAL,
                         struct launch_text_scan, speakers, &index_schema, 1, 4096),
    WHOLE(scan, background_frames),
    WHOLE(scan, window),
    WHOLE(scan, retries),
    REAL(scan, timeout_s),
    CYAML_FIELD_END};

struct launch_text_dsp {
    char *window, *compression, *background;
    double *background_s;
};

static const cyaml_schema_field_t dsp_fields[] = {
    NAME(dsp, window), NAME(dsp, compression), NAME(dsp, background),
    REAL(dsp, background_s), CYAML_FIELD_END};

struct launch_text_options { /* as written; by the names of recon/imaging/imager_options.h
                              */
    char *base, *iterations, *tolerance, *l1, *tv, *tv_isotropic, *rho, *snr_db, *sharpen;
    char *dmo, *lightcone, *coherence;
};

static const cyaml_schema_field_t option_fields[] = {
    NAME(options, base),      NAME(options, iterations), NAME(options, tolerance),
    NAME(options, l1),        NAME(options, tv),         NAME(options, tv_isotropic),
    NAME(options, rho),       NAME(options, snr_db),     NAME(options, dmo),
    NAME(options, lightcone), NAME(options, coherence),  NAME(options, sharpen),
    CYAML_FIELD_END};

struct launch_text_frames {
    unsigned *pings;
    char *sum, *every;
};

static const cyaml_schema_field_t frames_fields[] = {
    WHOLE(frames, pings), NAME(frames, sum), NAME(frames, every), CYAML_FIELD_END};

struct launch_text_recon {
    char *method;
    unsigned *threads;
    bool *preview;
    struct launch_text_frames frames;
    struct launch_text_options options;
};

static const cyaml_schema_field_t recon_fields[] = {NAME(recon, method),
                                                    WHOLE(recon, threads),
                                                    FLAG(recon, preview),
                                                    PART(recon, frames, frames_fields),
                                                    PART(recon, options, option_fields),
                                                    CYAML_FIELD_END};

struct launch_text_track {
    char *mode, *cfar;
    double *false_alarm_rate;
    double *threshold_db, *min_existence, *confirm_existence, *detection_probability;
    double *clutter, *sidelobe_db, *look_s, *acceleration_psd, *join_m, *coast_s;
    unsigned *confirm_hits, *confirm_of;
};

static const cyaml_schema_field_t track_fields[] = {NAME(track, mode),
                                                    NAME(track, cfar),
                                                    REAL(track, false_alarm_rate),
                                                    REAL(track, threshold_db),
                                                    REAL(track, min_existence),
                                                    REAL(track, confirm_existence),
                                                    REAL(track, detection_probability),
                                                    REAL(track, clutter),
                                                    REAL(track, sidelobe_db),
                                                    REAL(track, look_s),
                                                    REAL(track, acceleration_psd),
                                                    REAL(track, join_m),
                                                    REAL(track, coast_s),
                                                    WHOLE(track, confirm_hits),
                                                    WHOLE(track, confirm_of),
                                                    CYAML_FIELD_END};

struct launch_text_can_diagnosis {
    unsigned *request, *response, *functional;
};

static const cyaml_schema_field_t diagnosis_fields[] = {
    WHOLE(can_diagnosis, request), WHOLE(can_diagnosis, response),
    WHOLE(can_diagnosis, functional), CYAML_FIELD_END};

struct launch_text_can {
    char *uri;
    unsigned *base_id, *sensor, *bitrate, *data_bitrate;
    bool *fd, *motion, *field_of_view;
    double *load;
    struct launch_text_can_diagnosis diagnosis;
};

static const cyaml_schema_field_t can_fields[] = {
    TEXT(can, uri),      WHOLE(can, base_id),
    WHOLE(can, sensor),  FLAG(can, fd),
    FLAG(can, motion),   FLAG(can, field_of_view),
    WHOLE(can, bitrate), WHOLE(can, data_bitrate),
    REAL(can, load),     PART(can, diagnosis, diagnosis_fields),
    CYAML_FIELD_END};

struct launch_text_wall {
    char *from, *prior;
    double *vertical_deg, *reach_m, *every_s, *lost_s;
    double (*free_view_m)[2]; /* [free_view_m_count] */
    unsigned free_view_m_count;
};

static const cyaml_schema_value_t number_schema = {
    CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)};
static const cyaml_schema_value_t corner_schema = {
    CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number_schema, 2)};
static const cyaml_schema_field_t wall_fields[] = {
    NAME(wall, from),
    NAME(wall, prior),
    REAL(wall, vertical_deg),
    REAL(wall, reach_m),
    REAL(wall, every_s),
    REAL(wall, lost_s),
    CYAML_FIELD_SEQUENCE("free_view_m", CYAML_FLAG_POINTER | OPTIONAL,
                         struct launch_text_wall, free_view_m, &corner_schema, 0,
                         WALLS_MAX_CORNERS),
    CYAML_FIELD_END};

struct launch_text_report {
    char *folder;
};

static const cyaml_schema_field_t report_fields[] = {TEXT_NEEDED(report, folder),
                                                     CYAML_FIELD_END};

struct launch_text_host {
    char *name, *endpoint, *keys;
    char **nodes; /* [nodes_count] */
    unsigned nodes_count;
};

static const cyaml_schema_field_t host_fields[] = {
    NAME_NEEDED(host, name), TEXT_NEEDED(host, endpoint), TEXT(host, keys),
    CYAML_FIELD_SEQUENCE("nodes", CYAML_FLAG_POINTER, struct launch_text_host, nodes,
                         &node_schema, 1, MAX_NODES),
    CYAML_FIELD_END};
static const cyaml_schema_value_t host_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct launch_text_host, host_fields)};

struct launch_text_snapshot {
    char *folder;
    unsigned *before_s, *after_s, *max_mb;
    bool *faults;
};

static const cyaml_schema_field_t snapshot_fields[] = {
    TEXT(snapshot, folder),  WHOLE(snapshot, before_s), WHOLE(snapshot, after_s),
    WHOLE(snapshot, max_mb), FLAG(snapshot, faults),    CYAML_FIELD_END};

struct launch_text_record {
    char *path, *topics, *exclude, *compression;
    unsigned *split_mb, *split_s, *quota_mb, *flush_ms;
    bool *shuffle;
    struct launch_text_snapshot snapshot;
};

static const cyaml_schema_field_t record_fields[] = {
    TEXT_OR_EMPTY(record, path),
    TEXT_OR_EMPTY(record, topics),
    TEXT_OR_EMPTY(record, exclude),
    WHOLE(record, split_mb),
    WHOLE(record, split_s),
    WHOLE(record, quota_mb),
    WHOLE(record, flush_ms),
    TEXT_OR_EMPTY(record, compression),
    FLAG(record, shuffle),
    PART(record, snapshot, snapshot_fields),
    CYAML_FIELD_END};

struct launch_text_play {
    char *bag, *rate, *topics, *exclude, *remap;
    bool *loop;
    double *start_s, *end_s;
};

static const cyaml_schema_field_t play_fields[] = {
    TEXT(play, bag),     TEXT(play, rate),  FLAG(play, loop),
    REAL(play, start_s), REAL(play, end_s), TEXT(play, topics),
    TEXT(play, exclude), TEXT(play, remap), CYAML_FIELD_END};

struct launch_text_view {
    char *address, *bag;
    unsigned *port;
    bool *save;
};

static const cyaml_schema_field_t view_fields[] = {NAME(view, address), WHOLE(view, port),
                                                   FLAG(view, save), TEXT(view, bag),
                                                   CYAML_FIELD_END};

struct launch_text_processes {
    double *alive_s;
    char *realtime;
};

static const cyaml_schema_field_t processes_fields[] = {
    REAL(processes, alive_s), NAME(processes, realtime), CYAML_FIELD_END};

struct launch_text {
    char **nodes; /* [nodes_count] */
    unsigned nodes_count;
    struct launch_text_array array;
    struct launch_text_stage stage;
    struct launch_text_scan scan;
    struct launch_text_dsp dsp;
    struct launch_text_recon recon;
    struct launch_text_track track;
    struct launch_text_can can;
    struct launch_text_wall wall;
    struct launch_text_report report;
    struct launch_text_view view;
    struct launch_text_record record;
    struct launch_text_play play;
    struct launch_text_processes processes;
    struct launch_text_host *hosts; /* [hosts_count] */
    unsigned hosts_count;
};

static const cyaml_schema_field_t launch_fields[] = {
    CYAML_FIELD_SEQUENCE("nodes", CYAML_FLAG_POINTER, struct launch_text, nodes,
                         &node_schema, 1, MAX_NODES),
    SECTION(array),
    SECTION(stage),
    SECTION(scan),
    SECTION(dsp),
    SECTION(recon),
    SECTION(track),
    SECTION(can),
    SECTION(wall),
    SECTION(report),
    SECTION(view),
    SECTION(record),
    SECTION(play),
    SECTION(processes),
    CYAML_FIELD_SEQUENCE("hosts", CYAML_FLAG_POINTER | OPTIONAL, struct launch_text,
                         hosts, &host_schema, 1, CYAML_UNLIMITED),
    CYAML_FIELD_END};
static const struct cyaml_schema_value launch_text_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct launch_text, launch_fields)};

/* What is written for an option; NULL: nothing. */
static const char *launch_text_option(const struct launch_text *t, const char *name)
{
    for (const cyaml_schema_field_t *f = option_fields; f->key; f++)
        if (!strcmp(f->key, name))
            return *(char *const *)((const char *)&t->recon.options + f->data_offset);
    return NULL;
}

/* -- from text to launch file -------------------------------------------------------- */

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

/* Which of the names is written, NULL after the last of them: *out, which stays what it
 * is where nothing is. */
static int take_name(const struct launchfile *l, const char *key, const char *name,
                     const char *const names[], size_t *out, struct error *why)
{
    char list[128] = "";
    size_t used = 0;

    for (size_t i = 0; name && names[i]; i++) {
        const char *between = !i ? "" : names[i + 1] ? ", " : " or ";
        if (!strcmp(names[i], name)) {
            *out = i;
            return 0;
        }
        used +=
            (size_t)snprintf(list + used, sizeof list - used, "%s%s", between, names[i]);
    }
    return name ? yaml_error_say(why, -EINVAL, l->path, key, "expected %s, not %s", list,
                                 name)
                : 0;
}

/* A number that has to be min..max.  What is written goes where it belongs; NULL: the
 * default stays there. */
struct number {
    const char *key;
    const double *real;
    const unsigned *whole;
    double *to_real;
    unsigned *to_whole;
    double min, max;
};

#define REAL_IN(section, name, least, most)                                              \
    {                                                                                    \
        .key = #section "." #name, .real = t->section.name, .to_real = &l->section.name, \
        .min = least, .max = most                                                        \
    }
#define WHOLE_IN(section, name, least, most)                                             \
    {                                                                                    \
        .key = #section "." #name, .whole = t->section.name,                             \
        .to_whole = &l->section.name, .min = least, .max = most                          \
    }

static int take_numbers(const struct launchfile *l, const struct number *numbers,
                        size_t n, struct error *why)
{
    int err = 0;

    for (const struct number *x = numbers; !err && x < numbers + n; x++) {
        if (x->real)
            *x->to_real = *x->real;
        if (x->whole)
            *x->to_whole = *x->whole;
        err = yaml_check_range(l->path, x->key, x->to_real ? *x->to_real : *x->to_whole,
                               x->min, x->max, why);
    }
    return err;
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

bool launchfile_keeps_pace(const struct launchfile *l)
{
    char *pace = uri_option(l->array.uri, "pace");
    bool fast = pace && !strcmp(pace, "fast");

    free(pace);
    return l->scan.fixed && !fast && !launchfile_has_node(l, "play");
}

/* -- nodes --------------------------------------------------------------------------- */

/* Whoever may publish is a node, but for the launcher, which reads this. */
static bool is_node(const char *name)
{
    return topics_have_node(name) && strcmp(name, "launcher") != 0;
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

/* -- hosts --------------------------------------------------------------------------- */

struct key {
    char text[40];
};

/* A key of the host that is being added. */
static struct key key_of(const struct launchfile *l, const struct host *h,
                         const char *name)
{
    struct key k;

    snprintf(k.text, sizeof k.text, "hosts[%td].%s", h - l->hosts.list, name);
    return k;
}

static int copy_host_name(const struct launchfile *l, struct host *h, const char *name,
                          struct error *why)
{
    size_t length = strlen(name);

    if (length >= sizeof h->name || strspn(name, HOSTS_NAME_CHARACTERS) != length ||
        !strcmp(name, "here"))
        return yaml_error_say(why, -EINVAL, l->path, key_of(l, h, "name").text,
                              "expected up to %zu letters, digits, '-', '_' and '.', and "
                              "not 'here', but found \"%s\"",
                              sizeof h->name - 1, name);
    if (hosts_find(&l->hosts, name) != HOSTS_MAX)
        return yaml_error_say(why, -EINVAL, l->path, key_of(l, h, "name").text,
                              "expected each host once, but %s is there twice", name);
    memcpy(h->name, name, length + 1);
    return 0;
}

/* Where the node has been put already; NULL: nowhere yet. */
static const struct host *find_node(const struct hosts *h, const char *node)
{
    for (size_t i = 0; i < h->n; i++)
        for (size_t k = 0; k < h->list[i].n_nodes; k++)
            if (!strcmp(h->list[i].nodes[k], node))
                return &h->list[i];
    return NULL;
}

/* The host is in the list already, so a node that is twice on it is found too. */
static int copy_host_nodes(struct launchfile *l, struct host *h,
                           const struct launch_text_host *t, struct error *why)
{
    for (unsigned i = 0; i < t->nodes_count; i++) {
        const struct host *other = find_node(&l->hosts, t->nodes[i]);
        if (!launchfile_has_node(l, t->nodes[i]))
            return yaml_error_say(why, -EINVAL, l->path, key_of(l, h, "nodes").text,
                                  "%s: %s is not one of the launch file's nodes", h->name,
                                  t->nodes[i]);
        if (other)
            return yaml_error_say(
                why, -EINVAL, l->path, key_of(l, h, "nodes").text,
                "expected each node on one host, but %s is on %s and %s", t->nodes[i],
                other->name, h->name);
        snprintf(h->nodes[h->n_nodes++], ENVELOPE_NODE_SIZE, "%s", t->nodes[i]);
    }
    return 0;
}

static int check_endpoint(const struct launchfile *l, const struct host *h,
                          struct error *why)
{
    const struct hosts *all = &l->hosts;

    for (const struct host *o = all->list; o < h; o++) {
        if (!o->address[0] != !h->address[0])
            return yaml_error_say(
                why, -EINVAL, l->path, key_of(l, h, "endpoint").text,
                "expected all by tcp:// or all by ipc://, but %s and %s "
                "differ",
                o->name, h->name);
        if (hosts_overlap(o, h))
            return yaml_error_say(
                why, -EINVAL, l->path, key_of(l, h, "endpoint").text,
                h->address[0] ? "%s and %s have the same address: expected ports at "
                                "least %u apart"
                              : "%s and %s have the same folder",
                o->name, h->name, hosts_n_ports());
    }
    return 0;
}

/* Whole, as other processes need it, who may stand elsewhere.  NULL: no memory, or there
 * is no current folder. */
static char *whole_path(const struct launchfile *l, const char *path)
{
    char *beside = yaml_sibling(l->path, path), *out = NULL;
    char *folder = beside && beside[0] != '/' ? realpath(".", NULL) : NULL;

    if (beside && beside[0] == '/')
        return beside;
    if (folder && asprintf(&out, "%s/%s", folder, beside) < 0)
        out = NULL;
    free(folder);
    free(beside);
    return out;
}

static int copy_host_keys(const struct launchfile *l, struct host *h, const char *path,
                          struct error *why)
{
    if (!path)
        return 0;
    if (!h->address[0])
        return yaml_error_say(
            why, -EINVAL, l->path, key_of(l, h, "keys").text,
            "%s: expected none with an endpoint ipc://: it never leaves "
            "this machine",
            h->name);
    char *whole = whole_path(l, path);
    bool fits = whole && strlen(whole) < sizeof h->keys && !strchr(whole, '\n');
    if (fits)
        strcpy(h->keys, whole);
    free(whole);
    if (!fits)
        return yaml_error_say(why, -EINVAL, l->path, key_of(l, h, "keys").text,
                              "%s: expected the path of a folder, of at most %zu "
                              "characters",
                              h->name, sizeof h->keys - 1);
    return 0;
}

static int add_host(struct launchfile *l, const struct launch_text_host *t,
                    struct error *why)
{
    struct hosts *all = &l->hosts;
    struct host *h = &all->list[all->n];
    struct error inner = {""};

    if (all->n == HOSTS_MAX)
        return yaml_error_say(why, -EINVAL, l->path, "hosts", "expected at most %d",
                              HOSTS_MAX);
    int err = copy_host_name(l, h, t->name, why);
    if (err)
        return err;
    if (host_set_endpoint(h, t->endpoint, &inner))
        return yaml_error_say(why, -EINVAL, l->path, key_of(l, h, "endpoint").text,
                              "%s: %.600s", h->name, inner.text);
    all->n++;
    err = check_endpoint(l, h, why);
    if (!err)
        err = copy_host_keys(l, h, t->keys, why);
    return err ? err : copy_host_nodes(l, h, t, why);
}

/* Fills in l->hosts, but for which of them is here; l->nodes are there already.  0,
 * -EINVAL: each node has to be on one host, names and ports on none of two. */
static int copy_hosts(struct launchfile *l, const struct launch_text *t,
                      struct error *why)
{
    int err = 0;

    for (unsigned i = 0; !err && i < t->hosts_count; i++)
        err = add_host(l, &t->hosts[i], why);
    for (unsigned i = 0; !err && l->hosts.n && i < l->n_nodes; i++)
        if (!find_node(&l->hosts, l->nodes[i]))
            err = yaml_error_say(why, -EINVAL, l->path, "hosts",
                                 "expected each node on one host, but %s is on none",
                                 l->nodes[i]);
    return err;
}

/* -- scan ---------------------------------------------------------------------------- */

enum { DEFAULT_FRAMES = 8, MOST_FRAMES = 1000 };
#define DEFAULT_BACKGROUND_S 10.0
#define MOST_BACKGROUND_S    3600.0

static int copy_scan_mode(struct launchfile *l, const struct launch_text *t,
                          struct error *why)
{
    static const char *const modes[] = {"stepped", "continuous", "fixed", NULL};
    size_t mode = 0;
    int err = take_name(l, "scan.mode", t->scan.mode, modes, &mode, why);

    l->scan.continuous = mode == 1;
    l->scan.fixed = mode == 2;
    return err;
}

static int refuse_of_stepped(const struct launchfile *l, const struct launch_text *t,
                             struct error *why)
{
    const char *key = t->scan.speakers_count      ? "scan.speakers"
                      : t->scan.background_frames ? "scan.background_frames"
                      : t->dsp.background_s       ? "dsp.background_s"
                      : t->dsp.background         ? "dsp.background"
                                                  : NULL;

    return key && !l->scan.fixed
               ? yaml_error_say(why, -EINVAL, l->path, key,
                                "is of an array that stands; expected it with scan.mode: "
                                "fixed")
               : 0;
}

static int copy_speakers(struct launchfile *l, const struct launch_text *t,
                         struct error *why)
{
    size_t n = t->scan.speakers_count;

    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < i; k++)
            if (t->scan.speakers[k] == t->scan.speakers[i])
                return yaml_error_say(why, -EINVAL, l->path, "scan.speakers",
                                      "expected each speaker once, but %u is there twice",
                                      t->scan.speakers[i]);
    if (!n)
        return 0;
    l->scan.speakers = malloc(n * sizeof *l->scan.speakers);
    if (!l->scan.speakers)
        return -ENOMEM;
    memcpy(l->scan.speakers, t->scan.speakers, n * sizeof *l->scan.speakers);
    l->scan.n_speakers = n;
    return 0;
}

static int copy_background_frames(struct launchfile *l, const struct launch_text *t,
                                  struct error *why)
{
    unsigned frames = t->scan.background_frames ? *t->scan.background_frames
                                                : DEFAULT_FRAMES;

    l->scan.background_frames = frames;
    if (frames >= 1 && frames <= MOST_FRAMES)
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, "scan.background_frames",
                          "expected 1 to %d, not %u", MOST_FRAMES, frames);
}

static int copy_background(struct launchfile *l, const struct launch_text *t,
                           struct error *why)
{
    static const char *const names[] = {[BACKGROUND_NONE] = "none",
                                        [BACKGROUND_RECORDED] = "recorded",
                                        [BACKGROUND_ADAPTIVE] = "adaptive",
                                        NULL};
    double s = t->dsp.background_s ? *t->dsp.background_s : DEFAULT_BACKGROUND_S;
    size_t mode = l->scan.background ? BACKGROUND_RECORDED : BACKGROUND_NONE;
    int err = take_name(l, "dsp.background", t->dsp.background, names, &mode, why);

    if (err)
        return err;
    if ((mode == BACKGROUND_RECORDED) != l->scan.background)
        return yaml_error_say(why, -EINVAL, l->path, "dsp.background",
                              "%s does not go with scan.background: %s, which says "
                              "whether one is recorded",
                              names[mode], l->scan.background ? "true" : "false");
    if (!(s > 0 && s <= MOST_BACKGROUND_S))
        return yaml_error_say(why, -EINVAL, l->path, "dsp.background_s",
                              "expected over 0 and up to %g, not %g", MOST_BACKGROUND_S,
                              s);
    l->dsp.background = (enum background_mode)mode;
    l->dsp.background_s = s;
    return 0;
}

/* Whether the array is carried or static, with which speakers, and what is subtracted:
 *
 *   scan: {mode: fixed, speakers: [0, 5, 10, 15], background: true, background_frames: 8}
 *   dsp: {background: adaptive, background_s: 5}
 *
 * Fills in l->scan but its numbers of a stepped scan, and l->dsp's background.  0,
 * -EINVAL, -ENOMEM. */
static int copy_scan(struct launchfile *l, const struct launch_text *t, struct error *why)
{
    l->scan.background = t->scan.background && *t->scan.background;
    int err = copy_scan_mode(l, t, why);
    if (!err)
        err = refuse_of_stepped(l, t, why);
    if (!err)
        err = copy_speakers(l, t, why);
    if (!err)
        err = copy_background_frames(l, t, why);
    if (!err)
        err = copy_background(l, t, why);
    return err;
}

/* -- dsp ----------------------------------------------------------------------------- */

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

/* -- recon: images of a static array ------------------------------------------------- */

static int refuse_frames_of_stepped(const struct launchfile *l,
                                    const struct launch_text *t, struct error *why)
{
    const struct launch_text_frames *f = &t->recon.frames;

    if (l->scan.fixed || !(f->pings || f->sum || f->every))
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, "recon.frames",
                          "is of an array that stands; expected it with scan.mode: "
                          "fixed");
}

static int refuse_of_fixed(const struct launchfile *l, const struct launch_text *t,
                           struct error *why)
{
    bool has_option = false;

    if (!l->scan.fixed)
        return 0;
    for (const struct imager_option *i = imager_option_table; i->name; i++)
        has_option = has_option || launch_text_option(t, i->name);
    const char *key = t->recon.method    ? "recon.method"
                      : has_option       ? "recon.options"
                      : t->recon.preview ? "recon.preview"
                                         : NULL;
    if (!key)
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, key,
                          "is for scans: with scan.mode: fixed expected recon.frames");
}

static int take_frames(struct launchfile *l, const struct launch_text *t,
                       struct error *why)
{
    static const char *const sums[] = {
        [FRAMES_COHERENT] = "coherent", [FRAMES_POWER] = "power", NULL};
    static const char *const every[] = {"ping", "frame", NULL};
    const struct launch_text_frames *f = &t->recon.frames;
    size_t sum = FRAMES_POWER, when = 1;

    l->recon.frames.pings = f->pings ? *f->pings : 0;
    if (l->recon.frames.pings > FRAMES_MAX_PINGS)
        return yaml_error_say(why, -EINVAL, l->path, "recon.frames.pings",
                              "expected 0 to %d, not %u", FRAMES_MAX_PINGS,
                              l->recon.frames.pings);
    int err = take_name(l, "recon.frames.sum", f->sum, sums, &sum, why);
    if (!err)
        err = take_name(l, "recon.frames.every", f->every, every, &when, why);
    l->recon.frames.sum = (enum frames_sum)sum;
    l->recon.frames.every_ping = when == 0;
    return err;
}

/* The images of a static array:
 *
 *   recon: {frames: {pings: 16, sum: power, every: frame}}
 *
 * They are made by back-projection (recon/static_array/frames.h); methods, their options
 * and previews are for scans.  Fills in l->recon.frames; l->scan is there.  0, -EINVAL.
 */
static int copy_frames(struct launchfile *l, const struct launch_text *t,
                       struct error *why)
{
    int err = refuse_frames_of_stepped(l, t, why);

    if (!err)
        err = refuse_of_fixed(l, t, why);
    return err ? err : take_frames(l, t, why);
}

/* -- recon: options of a method ------------------------------------------------------ */

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

/* -- track --------------------------------------------------------------------------- */

/* As the stage has it where nothing is said. */
static void track_default(struct launch_track *out, bool fixed)
{
    struct object_tracker_config d;

    object_tracker_config_default(&d, fixed);
    *out = (struct launch_track){.threshold_db = d.detector.threshold_db,
                                 .min_existence = d.detector.min_existence,
                                 .cfar = d.detector.cfar,
                                 .false_alarm_rate = d.detector.false_alarm_rate,
                                 .mode = d.mode,
                                 .confirm_hits = d.track.life.confirm_hits,
                                 .confirm_of = d.track.life.confirm_of,
                                 .confirm_existence = d.track.life.confirm_existence,
                                 .detection_probability = d.track.detection_probability,
                                 .clutter = d.clutter,
                                 .sidelobe_db = d.sidelobe_db,
                                 .look_s = d.look_s,
                                 .acceleration_psd = d.track.acceleration_psd_m2_s3,
                                 .join_m = d.track.join_m,
                                 .coast_s = d.track.coast_s};
}

static int copy_track_names(struct launchfile *l, const struct launch_text_track *t,
                            struct error *why)
{
    static const char *const kinds[] = {[CFAR_OFF] = "off",
                                        [CFAR_AVERAGING] = "averaging",
                                        [CFAR_ORDERED] = "ordered",
                                        NULL};
    static const char *const modes[] = {[OBJECT_TRACKER_AUTO] = "auto",
                                        [OBJECT_TRACKER_LISTS] = "lists",
                                        [OBJECT_TRACKER_TRACKS] = "tracks",
                                        NULL};
    size_t kind = l->track.cfar, mode = l->track.mode;
    int err = take_name(l, "track.cfar", t->cfar, kinds, &kind, why);

    if (!err)
        err = take_name(l, "track.mode", t->mode, modes, &mode, why);
    l->track.cfar = (enum cfar_kind)kind;
    l->track.mode = (enum object_tracker_mode)mode;
    return err;
}

/* Fills in l->track.  0, -EINVAL. */
static int copy_track(struct launchfile *l, const struct launch_text *t,
                      struct error *why)
{
    track_default(&l->track, l->scan.fixed);
    l->track.confirm_of = unsigned_or(t->track.confirm_of, l->track.confirm_of);
    const struct number numbers[] = {
        REAL_IN(track, threshold_db, 0, 120),
        REAL_IN(track, min_existence, 0, 1),
        REAL_IN(track, false_alarm_rate, 1e-12, 0.5),
        WHOLE_IN(track, confirm_of, 1, TRACK_LOOKS_MAX),
        WHOLE_IN(track, confirm_hits, 1, l->track.confirm_of),
        REAL_IN(track, confirm_existence, 0, 0.998),
        REAL_IN(track, detection_probability, 0.01, 0.99),
        REAL_IN(track, clutter, 1e-6, 1000),
        REAL_IN(track, look_s, 0, 10),
        REAL_IN(track, sidelobe_db, 0.1, 200),
        REAL_IN(track, acceleration_psd, 1e-6, 1000),
        REAL_IN(track, join_m, 0, 10),
        REAL_IN(track, coast_s, 0.01, 60),
    };
    int err = copy_track_names(l, &t->track, why);
    return err ? err : take_numbers(l, numbers, COUNT(numbers), why);
}

/* -- wall ---------------------------------------------------------------------------- */

static int copy_wall_names(struct launchfile *l, const struct launch_text_wall *t,
                           struct error *why)
{
    static const char *const from[] = {[WALL_FROM_SURVEY] = "survey",
                                       [WALL_FROM_TOPIC] = "topic",
                                       [WALL_FROM_ECHOES] = "echoes",
                                       NULL};
    static const char *const priors[] = {"vertical", "none", NULL};
    size_t k = WALL_FROM_SURVEY, prior = 0;
    int err = take_name(l, "wall.from", t->from, from, &k, why);

    if (!err)
        err = take_name(l, "wall.prior", t->prior, priors, &prior, why);
    l->wall.from = (enum wall_from)k;
    l->wall.vertical = prior == 0;
    return err;
}

static int copy_wall_numbers(struct launchfile *l, const struct launch_text *t,
                             struct error *why)
{
    const struct number numbers[] = {
        REAL_IN(wall, vertical_deg, 0.1, 20.0),
        REAL_IN(wall, reach_m, 0.3, 20.0),
        REAL_IN(wall, every_s, 0.05, 60.0),
        REAL_IN(wall, lost_s, 0.1, 600.0),
    };
    struct wall_finder_config d;

    wall_finder_config_default(&d);
    l->wall.vertical_deg = d.map.vertical_rad * 180.0 / M_PI;
    l->wall.reach_m = d.listener.reach_m;
    l->wall.every_s = d.listener.every_s;
    l->wall.lost_s = d.map.lost_s;
    return take_numbers(l, numbers, COUNT(numbers), why);
}

static int copy_free_view(struct launchfile *l, const struct launch_text_wall *t,
                          struct error *why)
{
    if (t->free_view_m_count == 1 || t->free_view_m_count == 2)
        return yaml_error_say(why, -EINVAL, l->path, "wall.free_view_m",
                              "expected at least 3 corners, each [x, z]");
    for (unsigned i = 0; i < t->free_view_m_count; i++)
        for (int a = 0; a < 2; a++) {
            char key[48];
            double x = t->free_view_m[i][a];
            snprintf(key, sizeof key, "wall.free_view_m[%u]", i);
            if (!(fabs(x) <= 1000.0))
                return yaml_error_say(why, -EINVAL, l->path, key,
                                      "expected [x, z] within 1000 m, not %g", x);
            l->wall.free_view_m[i][a] = x;
        }
    l->wall.n_corners = t->free_view_m_count;
    return 0;
}

/* Fills in l->wall.  0, -EINVAL. */
static int copy_wall(struct launchfile *l, const struct launch_text *t, struct error *why)
{
    int err = copy_wall_names(l, &t->wall, why);

    if (!err)
        err = copy_wall_numbers(l, t, why);
    return err ? err : copy_free_view(l, &t->wall, why);
}

/* -- can ----------------------------------------------------------------------------- */

#define FIRST_BASE 0x100 /* msgs/can/e2e.h: bits 8 to 11 of a data ID are not 0 */
#define LAST_BASE  0x7f0 /* of identifiers of 11 bits */

static int copy_can_numbers(struct launchfile *l, const struct launch_text *t,
                            struct error *why)
{
    l->can.base_id = unsigned_or(t->can.base_id, CAN_BASE_DEFAULT);
    l->can.bitrate = 500000;
    l->can.data_bitrate = 2000000;
    l->can.load = 0.5;
    const struct number numbers[] = {
        WHOLE_IN(can, sensor, 0,
                 l->can.base_id < LAST_BASE
                     ? (LAST_BASE - l->can.base_id) / CAN_SENSOR_STEP
                     : 0),
        WHOLE_IN(can, bitrate, 10e3, 1e6),
        WHOLE_IN(can, data_bitrate, 10e3, 8e6),
        REAL_IN(can, load, 0.01, 1),
    };

    if (l->can.base_id < FIRST_BASE || l->can.base_id > LAST_BASE)
        return yaml_error_say(
            why, -EINVAL, l->path, "can.base_id", "expected 0x%x to 0x%x, not 0x%x%s",
            FIRST_BASE, LAST_BASE, l->can.base_id,
            l->can.base_id < FIRST_BASE ? ": below, frames of 8 bytes cannot have their "
                                          "end-to-end protection"
                                        : "");
    return take_numbers(l, numbers, COUNT(numbers), why);
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

/* Fills in l->can; paths are as they are written.  0, -EINVAL, -ENOMEM. */
static int copy_can(struct launchfile *l, const struct launch_text *t, struct error *why)
{
    l->can.fd = t->can.fd && *t->can.fd;
    l->can.motion = t->can.motion && *t->can.motion;
    l->can.field_of_view = t->can.field_of_view && *t->can.field_of_view;
    l->can.uri = strdup(t->can.uri ? t->can.uri : "log:can.candump");
    if (!l->can.uri)
        return -ENOMEM;
    int err = copy_can_numbers(l, t, why);
    return err ? err : copy_diagnosis(l, t, why);
}

/* A log into the report's folder; a scene is relative to the launch file's, folder.  0,
 * -ENOMEM. */
static int resolve_can(struct launchfile *l, const char *folder)
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

/* -- view ---------------------------------------------------------------------------- */

/* Fills in l->view; a bag's path is relative to the launch file's folder.  0, -EINVAL,
 * -ENOMEM. */
static int copy_view(struct launchfile *l, const struct launch_text *t, struct error *why)
{
    unsigned port = t->view.port ? *t->view.port : 8765;

    if (port > 65535)
        return yaml_error_say(why, -EINVAL, l->path, "view.port",
                              "expected 0 (any) to 65535, not %u", port);
    l->view.port = port;
    l->view.save = t->view.save && *t->view.save;
    l->view.address = strdup(t->view.address ? t->view.address : "127.0.0.1");
    l->view.bag = t->view.bag ? yaml_sibling(l->path, t->view.bag) : NULL;
    return l->view.address && (l->view.bag || !t->view.bag) ? 0 : -ENOMEM;
}

/* -- record -------------------------------------------------------------------------- */

#define MAX_MB 100000000 /* 100 TB */
#define MAX_S  31536000  /* a year */

static int add_record_node(struct launchfile *l)
{
    char **grown = realloc(l->nodes, (l->n_nodes + 1) * sizeof *grown);
    char *name = strdup("record");

    if (grown)
        l->nodes = grown;
    if (!grown || !name) {
        free(name);
        return -ENOMEM;
    }
    memmove(grown + 1, grown, l->n_nodes++ * sizeof *grown);
    grown[0] = name;
    return 0;
}

static int copy_record_numbers(struct launchfile *l, const struct launch_text_record *t,
                               struct error *why)
{
    const struct {
        const char *key;
        const unsigned *text;
        unsigned *value, otherwise, min, max;
    } numbers[] = {
        {"record.split_mb", t->split_mb, &l->record.split_mb, 0, 0, MAX_MB},
        {"record.split_s", t->split_s, &l->record.split_s, 0, 0, MAX_S},
        {"record.quota_mb", t->quota_mb, &l->record.quota_mb, 0, 0, MAX_MB},
        {"record.flush_ms", t->flush_ms, &l->record.flush_ms, 1000, 1, 3600000},
        {"record.snapshot.before_s", t->snapshot.before_s, &l->record.snapshot.before_s,
         SNAPSHOT_BEFORE_S, 1, SNAPSHOT_MOST_S},
        {"record.snapshot.after_s", t->snapshot.after_s, &l->record.snapshot.after_s,
         SNAPSHOT_AFTER_S, 0, SNAPSHOT_MOST_S},
        {"record.snapshot.max_mb", t->snapshot.max_mb, &l->record.snapshot.max_mb,
         SNAPSHOT_MAX_MB, SNAPSHOT_LEAST_MB, SNAPSHOT_MOST_MB},
    };

    for (size_t i = 0; i < COUNT(numbers); i++) {
        unsigned value = numbers[i].text ? *numbers[i].text : numbers[i].otherwise;
        if (value < numbers[i].min || value > numbers[i].max)
            return yaml_error_say(why, -EINVAL, l->path, numbers[i].key,
                                  "expected %u to %u, not %u", numbers[i].min,
                                  numbers[i].max, value);
        *numbers[i].value = value;
    }
    if (l->record.quota_mb && l->record.split_mb > l->record.quota_mb / 2)
        return yaml_error_say(why, -EINVAL, l->path, "record.split_mb",
                              "expected no more than half of quota_mb");
    return 0;
}

static int copy_snapshot(struct launchfile *l, const struct launch_text_snapshot *s,
                         const char *asked, struct error *why)
{
    const char *folder = asked ? asked : s->folder;
    bool other = s->before_s || s->after_s || s->max_mb || s->faults;

    if (!folder && other)
        return yaml_error_say(why, -EINVAL, l->path, "record.snapshot.folder",
                              "expected where bags of the last seconds go, e.g. "
                              "out/snapshots");
    l->record.snapshot.faults = s->faults ? *s->faults : true;
    l->record.snapshot.folder = folder ? strdup(folder) : NULL;
    return folder && !l->record.snapshot.folder ? -ENOMEM : 0;
}

/* Fills in l->record; a path or folder in the options adds the node, before all others.
 * 0, -EINVAL, -ENOMEM. */
static int copy_record(struct launchfile *l, const struct launch_text *t,
                       const struct launchfile_options *options, struct error *why)
{
    const struct launch_text_record *r = &t->record;
    const char *path = options && options->record ? options->record : r->path;
    const char *compression = r->compression ? r->compression : "none";
    bool asked = options && (options->record || options->snapshot);

    if (asked && !launchfile_has_node(l, "record") && add_record_node(l))
        return -ENOMEM;
    int err = copy_snapshot(l, &r->snapshot, options ? options->snapshot : NULL, why);
    if (err)
        return err;
    if (launchfile_has_node(l, "record") && !path && !l->record.snapshot.folder)
        return yaml_error_say(why, -EINVAL, l->path, "record.path",
                              "expected the name of a bag, e.g. out/demo.mcap, or a "
                              "snapshot's folder");
    if (bag_compression_find(&l->record.compression,
                             bytes_of(strcmp(compression, "none") ? compression : "")))
        return yaml_error_say(why, -EINVAL, l->path, "record.compression",
                              "expected none, lz4 or zstd, not %s", compression);
    l->record.shuffle = r->shuffle && *r->shuffle;
    if (l->record.shuffle && l->record.compression == BAG_NONE)
        return yaml_error_say(why, -EINVAL, l->path, "record.shuffle",
                              "shuffled sound is for a compression: set "
                              "record.compression to zstd or lz4");
    l->record.path = copy_text(path, "");
    l->record.topics = copy_text(r->topics, "*");
    l->record.exclude = copy_text(r->exclude, "");
    if (!l->record.path || !l->record.topics || !l->record.exclude)
        return -ENOMEM;
    return copy_record_numbers(l, r, why);
}

/* -- play ---------------------------------------------------------------------------- */

int launchfile_play_rate(const char *text, double *out)
{
    char *end;

    *out = 0.0;
    if (!strcmp(text, "max"))
        return 0;
    *out = strtod(text, &end);
    return end == text || *end || !(*out >= 1e-3 && *out <= 1e6) ? -EINVAL : 0;
}

/* A path of the file is relative to its folder, one of the command line to ours. */
static char *play_bag(const struct launchfile *l, const char *in_file,
                      const struct launchfile_options *options)
{
    if (options && options->bag)
        return strdup(options->bag);
    return in_file ? yaml_sibling(l->path, in_file) : strdup("");
}

static int copy_play_texts(struct launchfile *l, const struct launch_text_play *t,
                           const struct launchfile_options *options)
{
    const struct {
        char **to;
        const char *from;
    } texts[] = {{&l->play.topics, t->topics},
                 {&l->play.exclude, t->exclude},
                 {&l->play.remap, t->remap}};

    l->play.bag = play_bag(l, t->bag, options);
    if (!l->play.bag)
        return -ENOMEM;
    for (size_t i = 0; i < COUNT(texts); i++)
        if (texts[i].from && !(*texts[i].to = strdup(texts[i].from)))
            return -ENOMEM;
    return 0;
}

static int copy_play_rate(struct launchfile *l, const char *asked, const char *in_file,
                          struct error *why)
{
    const char *rate = asked ? asked : in_file ? in_file : "1";

    if (!launchfile_play_rate(rate, &l->play.rate))
        return 0;
    if (asked)
        return error_say(why, -EINVAL, "--rate %s: expected max, or 0.001 to 1000000",
                         rate);
    return yaml_error_say(why, -EINVAL, l->path, "play.rate",
                          "expected max, or 0.001 to 1000000, not %s", rate);
}

/* Fills in l->play; what the options say wins.  0, -EINVAL, -ENOMEM. */
static int copy_play(struct launchfile *l, const struct launch_text *t,
                     const struct launchfile_options *options, struct error *why)
{
    bool plays = launchfile_has_node(l, "play");
    int err = copy_play_texts(l, &t->play, options);

    if (!err)
        err = copy_play_rate(l, options ? options->rate : NULL, t->play.rate, why);
    if (err)
        return err;
    if (options && (options->bag || options->rate) && !plays)
        return error_say(why, -EINVAL,
                         "%s: --bag and --rate are for launch files with the node play, "
                         "as launch/play.yaml",
                         l->path);
    if (plays && !l->play.bag[0])
        return yaml_error_say(why, -EINVAL, l->path, "play.bag",
                              "expected the name of a bag; or say --bag FILE");
    l->play.loop = t->play.loop && *t->play.loop;
    l->play.start_s = t->play.start_s ? *t->play.start_s : 0.0;
    l->play.end_s = t->play.end_s ? *t->play.end_s : INFINITY;
    if (!(l->play.start_s >= 0.0 && l->play.start_s <= l->play.end_s))
        return yaml_error_say(why, -EINVAL, l->path, "play.start_s",
                              "expected 0 or more, and no more than end_s");
    return 0;
}

/* -- processes ----------------------------------------------------------------------- */

static int copy_processes(struct launchfile *l, const struct launch_text *t,
                          struct error *why)
{
    static const char *const names[] = {[REALTIME_AUTO] = "auto",
                                        [REALTIME_OFF] = "off",
                                        [REALTIME_REQUIRED] = "required",
                                        NULL};
    double alive_s = double_or(t->processes.alive_s, 3.0);
    size_t mode = REALTIME_AUTO;
    int err =
        take_name(l, "processes.realtime", t->processes.realtime, names, &mode, why);

    if (err)
        return err;
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

/* -- the rest, and all --------------------------------------------------------------- */

/* The brightest part of a person, by way of walls that mirror their own echo and his
 * alike (recon/detection/detection_range.h). */
#define PERSON_M 0.05

/* What is of no section above, with defaults, and paths as they are written. */
static int copy_parts(struct launchfile *l, const struct launch_text *t,
                      const struct launchfile_options *options)
{
    l->array.uri = copy_text(t->array.uri, "");
    l->stage.uri = copy_text(t->stage.uri, "sim:");
    l->recon.method = copy_text(t->recon.method, "fast");
    l->recon.preview = !t->recon.preview || *t->recon.preview;
    l->report.folder =
        copy_text(options && options->out ? options->out : t->report.folder, "out");
    return l->array.uri && l->stage.uri && l->recon.method && l->report.folder ? 0
                                                                               : -ENOMEM;
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
        err = resolve_can(l, folder);
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

/* Those of the array, the scan and the images. */
static int copy_numbers(struct launchfile *l, const struct launch_text *t,
                        struct error *why)
{
    const struct number numbers[] = {
        WHOLE_IN(scan, window, 1, 4096),
        WHOLE_IN(scan, retries, 0, 100),
        REAL_IN(scan, timeout_s, 0.1, 600),
        WHOLE_IN(recon, threads, 0, 256),
    };

    l->array.person_m = double_or(t->array.person_m, PERSON_M);
    l->scan.window = 32;
    l->scan.retries = 3;
    l->scan.timeout_s = 5.0;
    if (!(l->array.person_m >= 1e-3 && l->array.person_m <= 10.0))
        return yaml_error_say(why, -EINVAL, l->path, "array.person_m",
                              "%g is outside 0.001..10", l->array.person_m);
    return take_numbers(l, numbers, COUNT(numbers), why);
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
    return 0;
}

static int fill(struct launchfile *l, const struct launch_text *text,
                const struct launchfile_options *options, struct error *why)
{
    int err = copy_nodes(l, text, why);

    if (!err)
        err = copy_hosts(l, text, why);
    if (!err)
        err = copy_view(l, text, why);
    if (!err)
        err = copy_record(l, text, options, why);
    if (!err)
        err = copy_play(l, text, options, why);
    if (!err)
        err = copy_can(l, text, why);
    if (!err)
        err = copy_wall(l, text, why);
    if (!err)
        err = copy_scan(l, text, why);
    if (!err)
        err = copy_track(l, text, why);
    if (!err)
        err = copy_dsp(l, text, why);
    if (!err)
        err = copy_processes(l, text, why);
    if (!err)
        err = copy_parts(l, text, options);
    if (!err)
        err = check(l, why);
    if (!err)
        err = copy_numbers(l, text, why);
    if (!err)
        err = copy_frames(l, text, why);
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
    free(l->can.uri);
    free(l->report.folder);
    free(l->scan.speakers);
    free(l->record.path);
    free(l->record.snapshot.folder);
    free(l->record.topics);
    free(l->record.exclude);
    free(l->play.bag);
    free(l->play.topics);
    free(l->play.exclude);
    free(l->play.remap);
    free(l->view.address);
    free(l->view.bag);
    free(l->path);
    free(l);
}
