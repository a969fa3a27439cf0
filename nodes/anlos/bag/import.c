/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/bag/bag.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/recording/recording.h"
#include "hal/recording/replica_file.h"
#include "msgs/bag/topic_message.h"
#include "msgs/convert.h"
#include "msgs/tensor.h"
#include "nodes/anlos/bag/ego_table.h"
#include "nodes/anlos/confocal/scan.h"
#include "nodes/anlos/usage.h"
#include "nodes/array/acquisition.h"
#include "nodes/rt/stop.h"
#include "recon/tail.h"

#define SURVEY_PERIOD_NS 1000000000LL /* as the array node repeats it */

struct import_bag {
    struct verb_output output;
    struct bag_writer *writer;
    struct bag_topics *topics;
    uint8_t *survey; /* [survey_size] */
    size_t survey_size;
    uint64_t survey_id;
    uint64_t n_surveys, n_pings, n_egos;
    int64_t survey_due_ns;
    uint8_t *packed; /* [room], of a ping */
    size_t room;
};

static void destroy(struct import_bag *b)
{
    bag_topics_destroy(b->topics);
    free(b->survey);
    free(b->packed);
    free(b);
}

int import_bag_begin(struct import_bag **out, const char *path,
                     enum bag_compression compression, struct error *why)
{
    struct import_bag *b = calloc(1, sizeof *b);
    int err = b ? verb_output_begin(&b->output, path, why)
                : error_say(why, -ENOMEM, "out of memory");

    if (!err)
        err = verb_writer_create(&b->writer, &b->output, "anlos", compression, why);
    if (!err && bag_topics_create(&b->topics, b->writer)) {
        error_say(why, -ENOMEM, "out of memory");
        return import_bag_end(b, -ENOMEM, why);
    }
    if (err && b)
        destroy(b);
    else
        *out = b;
    return err;
}

static int put(struct import_bag *b, const char *node, const struct topic *t,
               uint64_t sequence, int64_t capture_ns, int64_t publish_ns,
               const uint8_t *payload, size_t size, struct error *why)
{
    struct envelope e = {.epoch_ns = IMPORT_START_NS,
                         .sequence = sequence,
                         .capture_ns = capture_ns,
                         .publish_ns = publish_ns,
                         .payload_size = (uint32_t)size};

    if (size > t->max_size)
        return error_say(why, -EMSGSIZE,
                         "a %s of %zu bytes; no more than %zu go over the "
                         "bus",
                         t->name, size, t->max_size);
    snprintf(e.node, sizeof e.node, "%s", node);
    snprintf(e.topic, sizeof e.topic, "%s", t->name);
    return bag_topics_put(b->topics, &e, payload, NULL, why);
}

/* What pings name; a text that is kept with them may be NULL.  To be said first.  0,
 * -EINVAL (does not pass survey_check), -ENOMEM, errors of writing. */
static int import_bag_survey(struct import_bag *b, const struct survey *s,
                             const char *yaml, size_t yaml_size, struct error *why)
{
    const struct bag_attachment a = {
        .log_time = IMPORT_START_NS,
        .create_time = IMPORT_START_NS,
        .name = bytes_of("survey.yaml"),
        .media_type = bytes_of("application/yaml"),
        .data = {(const uint8_t *)yaml, yaml_size},
    };
    int err = survey_check(s, why);

    if (!err && survey_pack(s, &b->survey, &b->survey_size))
        err = error_say(why, -ENOMEM, "out of memory");
    if (err)
        return err;
    b->survey_id = survey_id(s);
    b->survey_due_ns = IMPORT_START_NS;
    return yaml ? bag_writer_attachment(b->writer, &a, why) : 0;
}

static int pack(struct import_bag *b, const Anlos__Ping *p, size_t *size)
{
    *size = anlos__ping__get_packed_size(p);
    if (*size > b->room) {
        uint8_t *grown = realloc(b->packed, *size);
        if (!grown)
            return -ENOMEM;
        b->packed = grown;
        b->room = *size;
    }
    anlos__ping__pack(p, b->packed);
    return 0;
}

/* A ping that begins then and lasts slot_ns; the survey is repeated before it each
 * second. Its survey_id is filled in.  0, -EMSGSIZE, -ENOMEM, errors of writing. */
static int import_bag_ping(struct import_bag *b, Anlos__Ping *p, int64_t capture_ns,
                           int64_t length_ns, struct error *why)
{
    size_t size;
    int err = 0;

    p->survey_id = b->survey_id;
    if (capture_ns >= b->survey_due_ns) {
        err = put(b, "array", topic_survey(), b->n_surveys++, 0, capture_ns, b->survey,
                  b->survey_size, why);
        b->survey_due_ns = capture_ns + SURVEY_PERIOD_NS;
    }
    if (!err && pack(b, p, &size))
        err = error_say(why, -ENOMEM, "out of memory");
    return err ? err
               : put(b, "array", topic_ping(), b->n_pings++, capture_ns,
                     capture_ns + length_ns, b->packed, size, why);
}

/* How the vehicle moved; in the order of time with the pings, by when they end.  As
 * import_bag_ping. */
static int import_bag_ego(struct import_bag *b, const Anlos__EgoMotion *m,
                          int64_t capture_ns, struct error *why)
{
    uint8_t packed[128];
    size_t size = anlos__ego_motion__get_packed_size(m);

    if (size > sizeof packed)
        return error_say(why, -EMSGSIZE, "a message of ego motion of %zu bytes", size);
    anlos__ego_motion__pack(m, packed);
    return put(b, "can", topic_ego(), b->n_egos++, capture_ns, capture_ns, packed, size,
               why);
}

/* Text to text under a name. */
static int import_bag_metadata(struct import_bag *b, const char *name,
                               const char *const (*pairs)[2], size_t n, struct error *why)
{
    struct bytes_buffer map = {0};

    for (size_t i = 0; i < n; i++)
        bag_map_put(&map, bytes_of(pairs[i][0]), bytes_of(pairs[i][1]));
    const struct bag_metadata m = {bytes_of(name), bytes_in(&map)};
    int err = map.failed ? error_say(why, -ENOMEM, "out of memory")
                         : bag_writer_metadata(b->writer, &m, why);
    bytes_free(&map);
    return err;
}

int import_bag_end(struct import_bag *b, int err, struct error *why)
{
    int closed = bag_writer_close(b->writer, err ? NULL : why);

    err = verb_output_end(&b->output, err ? err : closed, why);
    if (!err)
        printf(b->n_egos ? "%s: %llu pings, %llu messages of ego motion\n"
                         : "%s: %llu pings\n",
               b->output.path, (unsigned long long)b->n_pings,
               (unsigned long long)b->n_egos);
    destroy(b);
    return err;
}

static int stopped(const struct import_bag *b, struct error *why)
{
    return error_say(why, -EINTR, "interrupted after %llu pings",
                     (unsigned long long)b->n_pings);
}

#define SOUND_M_S   343.0
#define MAX_RATE_HZ 380e3 /* below what survey_check takes */
#define MAX_BINS    512   /* as `anlos recon --confocal` has it */
#define TAPER       0.05  /* of a trace, at both ends */
#define DEPTH_STEPS 2.5   /* voxels in a pulse's width, c / 2 B */

struct mat_import {
    struct confocal_scan scan;
    struct survey survey;
    size_t first;     /* sample of a ping that bin 0 becomes */
    size_t n_samples; /* of a ping */
    float *samples;   /* [n_samples] */
    float *wave;      /* [scan.n], of a place */
    float scale;      /* what keeps every sample within 1 */
};

static int read_scan(struct mat_import *m, const char *path, struct error *why)
{
    struct confocal_file f;
    double gate_m[2];
    int err = confocal_file_load(&f, path, why);

    if (!err) {
        confocal_file_gate(&f, gate_m);
        err = confocal_scan_create(&m->scan, &f, gate_m, MAX_BINS,
                                   0.5 * SOUND_M_S / MAX_RATE_HZ, why);
    }
    confocal_file_clear(&f);
    return err;
}

/* The places of the scan, [ny][nx], each sends and hears. */
static int fill_places(struct survey *v, const struct confocal_scan *s)
{
    size_t n = s->nx * s->ny;

    if (survey_make_pings(v, n))
        return -ENOMEM;
    for (size_t q = 0; q < n; q++) {
        for (int end = 0; end < 2; end++) {
            v->pings_m[q][end][0] = ((double)(q % s->nx) - 0.5 * (double)(s->nx - 1)) *
                                    s->pitch_x_m;
            v->pings_m[q][end][1] = ((double)(q / s->nx) - 0.5 * (double)(s->ny - 1)) *
                                    s->pitch_y_m;
        }
    }
    return 0;
}

static void set_axis(double axis[3], double min, double max, double step)
{
    axis[0] = min;
    axis[1] = max;
    axis[2] = step;
}

static void fill_volume(struct survey *v, const struct confocal_scan *s)
{
    double x_m = 0.5 * (double)(s->nx - 1) * s->pitch_x_m;
    double y_m = 0.5 * (double)(s->ny - 1) * s->pitch_y_m;
    double far_m = s->range_m + (double)(s->n - 1) * s->range_step_m;
    double step_m = 0.5 * SOUND_M_S /
                    (DEPTH_STEPS * (v->chirp_stop_hz - v->chirp_start_hz));

    v->has_gate = v->has_volume = true;
    v->gate_m[0] = fmax(s->range_m - 0.5 * s->range_step_m, 0.0);
    v->gate_m[1] = far_m;
    set_axis(v->volume_m[0], -x_m, x_m, s->pitch_x_m);
    set_axis(v->volume_m[1], -y_m, y_m, s->pitch_y_m);
    set_axis(v->volume_m[2], fmax(s->range_m, 0.5 * step_m), far_m, step_m);
}

static double sinc(double x)
{
    return fabs(x) < 1e-9 ? 1.0 : sin(M_PI * x) / (M_PI * x);
}

/* What is sent: a pulse that fills the band in which the scan stands out of the noise,
 * and nothing else, with soft edges. */
static int fill_replica(struct survey *v, const double band_hz[2])
{
    size_t half = (size_t)ceil(v->sample_rate_hz / band_hz[0]), n = 2 * half + 1;

    v->replica = malloc(n * sizeof *v->replica);
    if (!v->replica)
        return -ENOMEM;
    v->n_replica = n;
    for (size_t i = 0; i < n; i++) {
        double t_s = ((double)i - (double)half) / v->sample_rate_hz;
        double window = 0.5 - 0.5 * cos(2.0 * M_PI * (double)(i + 1) / (double)(n + 1));
        double pass = band_hz[1] * sinc(2.0 * band_hz[1] * t_s) -
                      band_hz[0] * sinc(2.0 * band_hz[0] * t_s);
        v->replica[i] = (float)(2.0 * window * pass / v->sample_rate_hz);
    }
    v->chirp_duration_s = (double)n / v->sample_rate_hz;
    double found_hz[2]; /* as whoever reads the replica from a file will find it */
    int err = replica_band(v->replica, n, v->sample_rate_hz, found_hz);
    v->chirp_start_hz = found_hz[0];
    v->chirp_stop_hz = found_hz[1];
    return err;
}

/* A bin of range becomes a sample; the emission is late by a fraction of one, such that a
 * bin's middle is a sample's time. */
static int fill_survey(struct mat_import *m, struct error *why)
{
    const struct confocal_scan *s = &m->scan;
    const double slower = SOUND_M_S / CONFOCAL_LIGHT_M_S;
    struct confocal_traces waves;
    struct survey *v = &m->survey;
    int err = confocal_traces_create(&waves, s, why);

    if (err)
        return err;
    const double band_hz[2] = {slower * waves.band_hz[0], slower * waves.band_hz[1]};
    confocal_traces_clear(&waves);
    v->source = SURVEY_REPLAY;
    v->sound_speed_m_s = SOUND_M_S;
    v->temperature_c = NAN;
    v->sample_rate_hz = 0.5 * SOUND_M_S / s->range_step_m;
    err = fill_replica(v, band_hz);
    if (!err)
        err = fill_places(v, s);
    if (err)
        return error_say(why, err, "%s", strerror(-err));
    m->first = (size_t)ceil(s->range_m / s->range_step_m);
    v->latency_samples = (double)m->first - s->range_m / s->range_step_m;
    v->slot_samples = m->first + s->n + v->n_replica;
    fill_volume(v, s);
    return 0;
}

static void find_scale(struct mat_import *m)
{
    const struct confocal_scan *s = &m->scan;
    double most = 0.0, gain = 0.0;

    for (size_t i = 0; i < s->nx * s->ny * s->n; i++)
        most = fmax(most, (double)s->counts[i]);
    for (size_t k = 0; k < m->survey.n_replica; k++)
        gain += fabs((double)m->survey.replica[k]);
    m->scale = most > 0.0 ? (float)(1.0 / (sqrt(most) * gain)) : 0.0f;
}

/* The root of the counts of a place, without its mean, let down at both ends. */
static void fill_wave(struct mat_import *m, size_t q)
{
    const struct confocal_scan *s = &m->scan;
    const float *counts = s->counts + q * s->n;
    double mean = 0.0, width = TAPER * (double)s->n;

    for (size_t i = 0; i < s->n; i++) {
        m->wave[i] = counts[i] > 0.0f ? m->scale * sqrtf(counts[i]) : 0.0f;
        mean += (double)m->wave[i] / (double)s->n;
    }
    for (size_t i = 0; i < s->n; i++) {
        double edge = fmin((double)i + 0.5, (double)(s->n - i) - 0.5);
        double taper = 0.5 - 0.5 * cos(M_PI * fmin(edge / width, 1.0));
        m->wave[i] = (float)(taper * ((double)m->wave[i] - mean));
    }
}

/* What a place would have heard of what was sent. */
static void fill_samples(struct mat_import *m, size_t q)
{
    const struct survey *v = &m->survey;

    fill_wave(m, q);
    memset(m->samples, 0, m->n_samples * sizeof *m->samples);
    for (size_t i = 0; i < m->scan.n; i++) {
        float *to = m->samples + m->first + i, x = m->wave[i];
        for (size_t k = 0; k < v->n_replica; k++)
            to[k] += x * v->replica[k];
    }
}

static int put_pings(struct import_bag *bag, struct mat_import *m, struct error *why)
{
    double slot_ns = 1e9 * (double)m->survey.slot_samples / m->survey.sample_rate_hz;
    double length_ns = 1e9 * (double)m->n_samples / m->survey.sample_rate_hz;
    uint32_t none[1] = {0};
    int err = 0;

    for (size_t q = 0; !err && q < m->survey.n_positions; q++) {
        Anlos__Ping p = ANLOS__PING__INIT;
        struct tensor_view view;
        if (interrupt_requested())
            return stopped(bag, why);
        fill_samples(m, q);
        p.scan = 1;
        p.position = (uint32_t)q;
        p.samples = tensor_borrow_f32(&view, m->samples, 2, (size_t)1, m->n_samples);
        p.n_clipped = p.n_not_finite = 1;
        p.clipped = p.not_finite = none;
        p.valid = true;
        p.temperature_c = NAN;
        err = import_bag_ping(bag, &p, IMPORT_START_NS + llround((double)q * slot_ns),
                              llround(length_ns), why);
    }
    return err;
}

int import_mat(struct import_bag *bag, const struct import_options *o, struct error *why)
{
    static const char *const pairs[][2] = {
        {"imported_from", "optical confocal scan"},
        {"version", ANLOS_VERSION},
        {"light_m_s", "299792458"},
        {"sound_m_s", "343"},
        {"times", "those of sound over the ranges that light had"},
    };
    struct mat_import m = {.samples = NULL};
    int err = read_scan(&m, o->from, why);

    if (!err)
        err = fill_survey(&m, why);
    if (!err)
        err = import_bag_survey(bag, &m.survey, NULL, 0, why);
    if (!err)
        err = import_bag_metadata(bag, "anlos", pairs, sizeof pairs / sizeof *pairs, why);
    if (!err) {
        find_scale(&m);
        m.n_samples = m.survey.slot_samples + tail_samples(&m.survey);
        m.samples = malloc(m.n_samples * sizeof *m.samples);
        m.wave = malloc(m.scan.n * sizeof *m.wave);
        err = m.samples && m.wave ? put_pings(bag, &m, why)
                                  : error_say(why, -ENOMEM, "out of memory");
    }
    free(m.samples);
    free(m.wave);
    survey_clear(&m.survey);
    confocal_scan_clear(&m.scan);
    return err;
}

#define MAX_YAML ((size_t)64 << 20)

struct recording_import {
    struct import_bag *bag;
    struct array *array;
    struct acquisition *acquisition;
    int64_t now_ns; /* the clock that the array sees */
    int64_t slot_ns;
    uint32_t n_fired;

    struct recording *passes[2]; /* scene, background or NULL */
    float *samples;              /* [n_microphones][n_ping] */
    uint32_t *counts;            /* [2][n_microphones] */
    size_t n_ping;
    int64_t shift_ns; /* from the times of the tables */
    struct ego_table ego;
    size_t n_ego; /* messages of it that are in the bag */
};

static int64_t now(void *state)
{
    return ((const struct recording_import *)state)->now_ns;
}

static int sleep_until(void *state, int64_t t_ns)
{
    ((struct recording_import *)state)->now_ns = t_ns;
    return 0;
}

struct paths {
    char scene[PATH_MAX], background[PATH_MAX], survey[PATH_MAX], ego[PATH_MAX];
};

static bool is_there(char *out, const char *folder, const char *name)
{
    return snprintf(out, PATH_MAX, "%s/%s", folder, name) < PATH_MAX &&
           !access(out, F_OK);
}

/* As `anlos sim` lays it out (scene, background and survey.yaml in a folder), or a folder
 * of WAV files with survey.yaml in it or beside it. */
static int find_paths(struct paths *p, const struct import_options *o, struct error *why)
{
    if (access(o->from, R_OK))
        return error_say(why, -errno, "%s: %s", o->from, strerror(errno));
    if (!is_there(p->scene, o->from, "scene"))
        snprintf(p->scene, PATH_MAX, "%s", o->from);
    if (!is_there(p->background, o->from, "background"))
        p->background[0] = '\0';
    if (o->background)
        snprintf(p->background, PATH_MAX, "%s", o->background);
    if (o->survey)
        snprintf(p->survey, PATH_MAX, "%s", o->survey);
    else if (!is_there(p->survey, o->from, "survey.yaml") &&
             !is_there(p->survey, o->from, "../survey.yaml"))
        return error_say(why, -ENOENT,
                         "%s: no survey.yaml in it or beside it; name it with --survey",
                         o->from);
    if (o->ego)
        snprintf(p->ego, PATH_MAX, "%s", o->ego);
    else if (!is_there(p->ego, o->from, EGO_FILE) &&
             !is_there(p->ego, o->from, "../" EGO_FILE))
        p->ego[0] = '\0';
    const char *const all[] = {p->scene, p->background, p->survey};
    for (size_t i = 0; i < 3; i++)
        if (strpbrk(all[i], "?&"))
            return error_say(why, -EINVAL, "%s: a name without ? and &, please", all[i]);
    return 0;
}

static int open_array(struct recording_import *r, const struct clock_source *clock,
                      const struct paths *p, struct error *why)
{
    char *uri;

    /* As it was recorded: what was calibrated elsewhere is not mixed in. */
    if (asprintf(&uri, "wav:%s?survey=%s&calibrated=%s%s", p->scene, p->survey,
                 p->background[0] ? "&background=" : "", p->background) < 0)
        return error_say(why, -ENOMEM, "out of memory");
    int err = array_open(&r->array, uri, clock, why);
    free(uri);
    if (!err && acquisition_create(&r->acquisition, NULL, r->array))
        err = error_say(why, -ENOMEM, "out of memory");
    return err;
}

static int read_text(const char *path, char **out, size_t *size, struct error *why)
{
    struct stat st;
    FILE *f = fopen(path, "re");

    if (!f || fstat(fileno(f), &st) || st.st_size < 0 || (size_t)st.st_size > MAX_YAML) {
        int err = error_say(why, f ? -EFBIG : -errno, "%s: %s", path,
                            f ? "no survey of that size" : strerror(errno));
        if (f)
            fclose(f);
        return err;
    }
    *size = (size_t)st.st_size;
    *out = malloc(*size + 1);
    int err = 0;
    if (!*out)
        err = error_say(why, -ENOMEM, "out of memory");
    else if (fread(*out, 1, *size, f) != *size)
        err = error_say(why, -EIO, "%s cannot be read", path);
    fclose(f);
    return err;
}

static int put_survey(struct recording_import *r, const char *path, struct error *why)
{
    const struct survey *s = array_survey(r->array);
    char *yaml = NULL;
    size_t size = 0;
    int err = read_text(path, &yaml, &size, why);

    if (!err)
        err = import_bag_survey(r->bag, s, yaml, size, why);
    free(yaml);
    r->slot_ns = (int64_t)(1e9 * (double)s->slot_samples / s->sample_rate_hz + 0.5);
    return err;
}

static int put_position(struct recording_import *r, Anlos__Pass pass, uint32_t position,
                        uint32_t *speakers, struct error *why)
{
    const struct survey *s = array_survey(r->array);
    Anlos__FireCommand fire = ANLOS__FIRE_COMMAND__INIT;
    Anlos__Ping ping;
    int64_t t0_ns;

    fire.id = ++r->n_fired;
    fire.scan = 1;
    fire.pass = pass;
    fire.position = position;
    fire.stage_m = s->stage_positions_m[position];
    fire.n_speakers = s->n_speakers;
    fire.speakers = speakers;
    int err = acquisition_fire(r->acquisition, &fire, 0, why);
    while (!err && acquisition_busy(r->acquisition)) {
        err = interrupt_requested()
                  ? stopped(r->bag, why)
                  : acquisition_next(r->acquisition, &ping, &t0_ns, why);
        if (err)
            break;
        int64_t length_ns = r->slot_ns * (int64_t)ping.samples->shape[1] /
                            (int64_t)s->slot_samples;
        err = import_bag_ping(r->bag, &ping, t0_ns, length_ns, why);
        r->now_ns += r->slot_ns;
    }
    return err == -ENODATA ? 0 : err; /* the shot has ended */
}

/* The background comes first: what is imaged meanwhile is the scene without it. */
static int put_passes(struct recording_import *r, bool background, struct error *why)
{
    const struct survey *s = array_survey(r->array);
    uint32_t *speakers = malloc(s->n_speakers * sizeof *speakers);
    int err = speakers ? 0 : error_say(why, -ENOMEM, "out of memory");

    for (size_t i = 0; !err && i < s->n_speakers; i++)
        speakers[i] = (uint32_t)i;
    for (size_t k = 0; !err && background && k < s->n_positions; k++)
        err = put_position(r, ANLOS__PASS__BACKGROUND, (uint32_t)k, speakers, why);
    for (size_t k = 0; !err && k < s->n_positions; k++)
        err = put_position(r, ANLOS__PASS__SCENE, (uint32_t)k, speakers, why);
    free(speakers);
    return err;
}

/* -- of an array that stands: all that sounded ------------------------------------------
 */
static int put_ego(struct recording_import *r, int64_t until_ns, struct error *why)
{
    int err = 0;

    for (; !err && r->n_ego < r->ego.n; r->n_ego++) {
        const struct ego_row *row = &r->ego.rows[r->n_ego];
        if (row->time_ns + r->shift_ns > until_ns)
            return 0;
        err = import_bag_ego(r->bag, &row->motion, row->time_ns + r->shift_ns, why);
    }
    return err;
}

static int put_emission(struct recording_import *r, Anlos__Pass pass, size_t i,
                        const struct emission *e, int64_t t0_ns, struct error *why)
{
    const struct survey *s = array_survey(r->array);
    uint32_t *clipped = r->counts, *not_finite = r->counts + s->n_microphones;
    int64_t length_ns = r->slot_ns * (int64_t)r->n_ping / (int64_t)s->slot_samples;
    struct tensor_view view;
    Anlos__Ping p = ANLOS__PING__INIT;
    int err = interrupt_requested()
                  ? stopped(r->bag, why)
                  : recording_read_emission(r->passes[pass == ANLOS__PASS__BACKGROUND], i,
                                            r->samples, clipped, not_finite, why);

    if (err)
        return err;
    p.scan = 1;
    p.pass = pass;
    p.stage_m = s->stage_positions_m[0];
    p.speaker = e->speaker;
    p.samples = tensor_borrow_f32(&view, r->samples, 2, s->n_microphones, r->n_ping);
    p.n_clipped = p.n_not_finite = s->n_microphones;
    p.clipped = clipped;
    p.not_finite = not_finite;
    p.valid = e->valid;
    p.temperature_c = e->temperature_c;
    p.down = e->down;
    p.frame = e->frame;
    if (pass == ANLOS__PASS__SCENE || e->has_time)
        err = put_ego(r, t0_ns + length_ns, why);
    return err ? err : import_bag_ping(r->bag, &p, t0_ns, length_ns, why);
}

/* Times of one clock overlap. */
static int check_ego(const struct recording_import *r, int64_t begin_ns, int64_t end_ns,
                     const char *ego, struct error *why)
{
    if (!r->ego.n)
        return 0;
    int64_t first_ns = r->ego.rows[0].time_ns + r->shift_ns;
    int64_t last_ns = r->ego.rows[r->ego.n - 1].time_ns + r->shift_ns;
    if (first_ns <= end_ns && last_ns >= begin_ns)
        return 0;
    return error_say(why, -EINVAL,
                     "%s: is of %.3f to %.3f s, but the recording of %.3f to %.3f s: its "
                     "times count as those of " EMISSIONS_FILE
                     ", and where that has none, from the first sample on",
                     ego, 1e-9 * (double)(first_ns - r->shift_ns),
                     1e-9 * (double)(last_ns - r->shift_ns),
                     1e-9 * (double)(begin_ns - r->shift_ns),
                     1e-9 * (double)(end_ns - r->shift_ns));
}

static int64_t time_of(const struct recording_import *r, const struct emission *e,
                       int64_t begin_ns)
{
    double rate_hz = array_survey(r->array)->sample_rate_hz;

    return e->has_time ? e->time_ns + r->shift_ns
                       : begin_ns + llround(1e9 * (double)e->sample / rate_hz);
}

/* Without times in its table a pass begins when the one before has ended. */
static int put_pass(struct recording_import *r, Anlos__Pass pass, const struct paths *p,
                    struct error *why)
{
    const struct recording *from = r->passes[pass == ANLOS__PASS__BACKGROUND];
    const struct survey *s = array_survey(r->array);
    int64_t begin_ns = r->now_ns;
    size_t n;
    int err = 0;

    if (!from)
        return 0;
    const struct emission *list = recording_emissions(from, &n);
    if (!list[0].has_time && pass == ANLOS__PASS__SCENE)
        r->shift_ns = begin_ns;
    if (pass == ANLOS__PASS__SCENE)
        err = check_ego(r, time_of(r, &list[0], begin_ns),
                        time_of(r, &list[n - 1], begin_ns) + 2 * r->slot_ns, p->ego, why);
    for (size_t i = 0; !err && i < n; i++)
        err = put_emission(r, pass, i, &list[i], time_of(r, &list[i], begin_ns), why);
    r->now_ns += llround(1e9 * (double)recording_samples(from) / s->sample_rate_hz);
    return err;
}

/* Times that count from the beginning of something count from that of the bag. */
static void find_shift(struct recording_import *r)
{
    int64_t first_ns = r->ego.n ? r->ego.rows[0].time_ns : INT64_MAX;

    for (int i = 0; i < 2; i++) {
        size_t n = 0;
        const struct emission *list = r->passes[i] ? recording_emissions(r->passes[i], &n)
                                                   : NULL;
        if (n && list[0].has_time && list[0].time_ns < first_ns)
            first_ns = list[0].time_ns;
    }
    r->shift_ns = first_ns < IMPORT_START_NS ? IMPORT_START_NS : 0;
}

static int put_endless(struct recording_import *r, const struct paths *p,
                       struct error *why)
{
    const struct survey *s = array_survey(r->array);

    r->n_ping = s->slot_samples + tail_samples(s);
    r->samples = calloc(s->n_microphones * r->n_ping, sizeof *r->samples);
    r->counts = calloc(2 * s->n_microphones, sizeof *r->counts);
    if (!r->samples || !r->counts)
        return error_say(why, -ENOMEM, "out of memory");
    int err = p->ego[0] ? ego_table_load(&r->ego, p->ego, why) : 0;
    if (err)
        return err;
    find_shift(r);
    err = put_pass(r, ANLOS__PASS__BACKGROUND, p, why);
    if (!err)
        err = put_pass(r, ANLOS__PASS__SCENE, p, why);
    return err ? err : put_ego(r, INT64_MAX, why);
}

static int open_passes(struct recording_import *r, const struct paths *p,
                       struct error *why)
{
    const struct survey *s = array_survey(r->array);
    int err = recording_open(&r->passes[0], p->scene, s, why);

    return err || !p->background[0]
               ? err
               : recording_open(&r->passes[1], p->background, s, why);
}

static int put_all(struct recording_import *r, const struct paths *p, struct error *why)
{
    int err = open_passes(r, p, why);

    if (err)
        return err;
    if (recording_goes_on(r->passes[0]))
        return put_endless(r, p, why);
    if (p->ego[0])
        return error_say(why, -EINVAL,
                         "%s: a scan is taken by a vehicle that stands; remove it",
                         p->ego);
    return put_passes(r, p->background[0] != '\0', why);
}

int import_recording(struct import_bag *bag, const struct import_options *o,
                     struct error *why)
{
    static const char *const pairs[][2] = {{"imported_from", "recording"},
                                           {"version", ANLOS_VERSION}};
    struct recording_import r = {.bag = bag, .now_ns = IMPORT_START_NS};
    const struct clock_source clock = {now, sleep_until, &r};
    struct paths *p = malloc(sizeof *p);
    int err = p ? find_paths(p, o, why) : error_say(why, -ENOMEM, "out of memory");

    if (!err)
        err = open_array(&r, &clock, p, why);
    if (!err)
        err = put_survey(&r, p->survey, why);
    if (!err)
        err = import_bag_metadata(bag, "anlos", pairs, 2, why);
    if (!err)
        err = put_all(&r, p, why);
    ego_table_clear(&r.ego);
    for (int i = 0; i < 2; i++)
        recording_close(r.passes[i]);
    free(r.samples);
    free(r.counts);
    acquisition_destroy(r.acquisition);
    array_close(r.array);
    free(p);
    return err;
}

static const char help[] =
    "anlos bag import -- make a bag of a recording\n"
    "\n"
    "usage: anlos bag import FOLDER -o OUT [--survey FILE] [--background FOLDER]\n"
    "                        [--ego FILE] [--compression C]\n"
    "       anlos bag import FILE.mat -o OUT [--compression C]\n"
    "\n"
    "FOLDER is what 'anlos sim' writes, or any folder of WAV files with a survey.yaml in "
    "it\n"
    "or beside it.  The bag has what the array would have sent: surveys and pings, the\n"
    "background first.  Of an array that stands, one file may go on without end: round\n"
    "after round of its speakers, or as an emissions.csv beside it says; "
    "launch/drive.md\n"
    "tells how to bring a drive of your own.  FILE.mat is an optical confocal scan "
    "(rect_data, width): each "
    "place\n"
    "becomes a ping, the ranges stay, and light becomes sound of 343 m/s.\n"
    "\n"
    "  -o, --out OUT         the bag; must not be there\n"
    "  --survey FILE         the survey of FOLDER\n"
    "  --background FOLDER   the recording without the hidden objects\n"
    "  --ego FILE            how the vehicle moved: time_s,speed_m_s,yaw_rate_rad_s; by\n"
    "                        default ego.csv in FOLDER or beside it, if there is one\n"
    "  --compression C       zstd (default), lz4 or none\n"
    "  --help                this text\n"
    "\n"
    "Times begin at 1970-01-01 00:00:01, unless emissions.csv says when it was: equal\n"
    "recordings become equal bags.\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or files; 130 stopped by Ctrl-C (no "
    "OUT\n"
    "then)\n";

static const struct usage_option options[] = {
    {"out", USAGE_TEXT(struct import_options, out), .letter = 'o'},
    {"survey", USAGE_TEXT(struct import_options, survey)},
    {"background", USAGE_TEXT(struct import_options, background)},
    {"ego", USAGE_TEXT(struct import_options, ego)},
    {"compression", USAGE_NAME('c', verb_compression_name)},
    {.name = NULL},
};

static bool is_mat(const char *path)
{
    size_t n = strlen(path);

    return n > 4 && !strcmp(path + n - 4, ".mat");
}

static int run(const struct import_options *o)
{
    struct import_bag *bag;
    struct error why = {""};

    interrupt_catch();
    int err = import_bag_begin(&bag, o->out, o->compression, &why);
    if (err)
        return verb_end("import", err, &why);
    err = is_mat(o->from) ? import_mat(bag, o, &why) : import_recording(bag, o, &why);
    err = import_bag_end(bag, err, &why);
    if (err)
        return verb_end("import", err, &why);
    return usage_flush("bag import");
}

int bag_import(int argc, char **argv)
{
    struct import_options o = {.compression = BAG_ZSTD};
    struct usage usage = {
        .command = "bag import", .help = help, .options = options, .into = &o};
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        o.compression = verb_compression(optarg);
    if (code)
        return ~code;
    code = verb_one_operand("bag import", "FOLDER or FILE.mat", argc, argv);
    if (code)
        return code;
    if (!o.out)
        return usage_error("bag import", "-o OUT is missing");
    o.from = argv[optind];
    if (is_mat(o.from) && (o.survey || o.background || o.ego))
        return usage_error("bag import",
                           "%s: a .mat has no survey, no background and no motion",
                           o.from);
    return run(&o);
}
