/* SPDX-License-Identifier: MIT */
#include "hal/survey/rig_file.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "hal/survey/yaml.h"
#include "hal/yaml_file.h"

enum { DEFAULT_BUFFER_MS = 200, DEFAULT_LEVEL_DB = -6 };
#define PERIOD_S 0.01
#define GAIN_DB  40.0

struct numbers {
    double *list;
    unsigned n;
};
struct indices {
    uint32_t *list;
    unsigned n;
};

/* NULL: the key is not in the file. */
struct rig_device {
    int format; /* sample_format + 1, or 0 */
    int access; /* rig_access */
    uint32_t *period_frames;
    double *buffer_ms, *level_db;
    struct indices outputs, inputs, invert_outputs, invert_inputs;
    struct numbers output_gain_db, input_gain_db;
};

struct rig_root {
    struct survey_yaml survey;
    struct rig_device *device;
    char *calibrated;
};

static const cyaml_strval_t formats[] = {{"S16", SAMPLE_FORMAT_S16 + 1},
                                         {"S24_3", SAMPLE_FORMAT_S24_3 + 1},
                                         {"S24", SAMPLE_FORMAT_S24 + 1},
                                         {"S32", SAMPLE_FORMAT_S32 + 1},
                                         {"float", SAMPLE_FORMAT_FLOAT + 1}};
static const cyaml_strval_t accesses[] = {{"mmap", RIG_ACCESS_MMAP},
                                          {"rw", RIG_ACCESS_RW}};
static const struct cyaml_schema_value index_value = {
    CYAML_VALUE_UINT(CYAML_FLAG_DEFAULT, uint32_t)};

/* clang-format off */
#define LIST(key, value)                                                                 \
    CYAML_FIELD_SEQUENCE_COUNT(#key, CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL,           \
                               struct rig_device, key.list, key.n, &(value), 0, 4096)
/* clang-format on */

static const struct cyaml_schema_field device_fields[] = {
    CYAML_FIELD_ENUM("format", CYAML_FLAG_STRICT | CYAML_FLAG_OPTIONAL, struct rig_device,
                     format, formats, 5),
    CYAML_FIELD_ENUM("access", CYAML_FLAG_STRICT | CYAML_FLAG_OPTIONAL, struct rig_device,
                     access, accesses, 2),
    CYAML_FIELD_UINT_PTR("period_frames", CYAML_FLAG_OPTIONAL, struct rig_device,
                         period_frames),
    CYAML_FIELD_FLOAT_PTR("buffer_ms", CYAML_FLAG_OPTIONAL, struct rig_device, buffer_ms),
    CYAML_FIELD_FLOAT_PTR("level_db", CYAML_FLAG_OPTIONAL, struct rig_device, level_db),
    LIST(outputs, index_value),
    LIST(inputs, index_value),
    LIST(invert_outputs, index_value),
    LIST(invert_inputs, index_value),
    LIST(output_gain_db, survey_yaml_number),
    LIST(input_gain_db, survey_yaml_number),
    CYAML_FIELD_END};

static const struct cyaml_schema_field root_fields[] = {
    SURVEY_YAML_FIELDS(struct rig_root, CYAML_FLAG_DEFAULT),
    CYAML_FIELD_MAPPING_PTR("device", CYAML_FLAG_OPTIONAL, struct rig_root, device,
                            device_fields),
    CYAML_FIELD_STRING_PTR("calibrated", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL,
                           struct rig_root, calibrated, 1, 4096),
    CYAML_FIELD_END};
static const struct cyaml_schema_value root_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct rig_root, root_fields)};

/* A list of the file, and what of the array it is about. */
struct list {
    const char *path, *key, *of; /* "device.outputs", "speakers" */
    size_t n_elements;
};

static int check_count(const struct list *l, size_t n, struct error *why)
{
    if (n == l->n_elements)
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, l->key,
                          "expected one for each of %zu %s, found %zu", l->n_elements,
                          l->of, n);
}

static int refuse_entry(const struct list *l, size_t i, struct error *why,
                        const char *text, double value)
{
    char key[64];
    snprintf(key, sizeof key, "%s[%zu]", l->key, i);
    return yaml_error_say(why, -EINVAL, l->path, key, text, value);
}

static int take_channels(size_t **out, const struct list *l, const struct indices *in,
                         struct error *why)
{
    int err = in->list ? check_count(l, in->n, why) : 0;
    if (err)
        return err;
    size_t *channels = *out = calloc(l->n_elements, sizeof *channels);
    if (!channels)
        return error_say(why, -ENOMEM, "%s: out of memory", l->path);
    for (size_t i = 0; i < l->n_elements; i++) {
        channels[i] = in->list ? in->list[i] : i;
        if (channels[i] >= RIG_MAX_CHANNELS)
            return refuse_entry(l, i, why, "channel %g is outside 0..255",
                                (double)channels[i]);
        for (size_t k = 0; k < i; k++)
            if (channels[k] == channels[i])
                return refuse_entry(l, i, why, "channel %g is there twice",
                                    (double)channels[i]);
    }
    return 0;
}

static int take_gains(float **out, const struct list *l, const struct numbers *in,
                      double base_db, struct error *why)
{
    int err = in->list ? check_count(l, in->n, why) : 0;
    if (err)
        return err;
    float *gains = *out = calloc(l->n_elements, sizeof *gains);
    if (!gains)
        return error_say(why, -ENOMEM, "%s: out of memory", l->path);
    for (size_t i = 0; i < l->n_elements; i++) {
        double db = in->list ? in->list[i] : 0;
        if (!(fabs(db) <= GAIN_DB))
            return refuse_entry(l, i, why, "%g dB is outside -40..40", db);
        gains[i] = (float)pow(10, (base_db + db) / 20);
    }
    return 0;
}

static int invert(float *gains, const struct list *l, const struct indices *in,
                  struct error *why)
{
    for (size_t i = 0; i < in->n; i++) {
        uint32_t k = in->list[i];
        if (k >= l->n_elements)
            return refuse_entry(l, i, why, "there is no %g; they count from 0", k);
        if (signbit(gains[k]))
            return refuse_entry(l, i, why, "%g is there twice", k);
        gains[k] = -gains[k];
    }
    return 0;
}

static int take_number(double *out, const double *in, const char *path, const char *key,
                       const double range[2], struct error *why)
{
    if (!in)
        return 0;
    if (!(*in >= range[0] && *in <= range[1]))
        return yaml_error_say(why, -EINVAL, path, key, "%g is outside %g..%g", *in,
                              range[0], range[1]);
    *out = *in;
    return 0;
}

static int take_buffers(struct rig *r, const struct rig_device *d, const char *path,
                        struct error *why)
{
    static const double ms_range[] = {10, 10000}, frames_range[] = {16, 65536};
    double rate_hz = r->survey.sample_rate_hz, buffer_ms = DEFAULT_BUFFER_MS;
    double period = round(PERIOD_S * rate_hz), given = 0;
    if (d->period_frames)
        given = *d->period_frames;
    int err =
        take_number(&buffer_ms, d->buffer_ms, path, "device.buffer_ms", ms_range, why);
    if (!err)
        err = take_number(&period, d->period_frames ? &given : NULL, path,
                          "device.period_frames", frames_range, why);
    if (err)
        return err;
    r->period_frames = (size_t)period;
    r->buffer_frames = (size_t)llround(buffer_ms * 1e-3 * rate_hz);
    if (r->buffer_frames < 2 * r->period_frames)
        return yaml_error_say(why, -EINVAL, path, "device.buffer_ms",
                              "%g ms are less than two periods of %zu frames", buffer_ms,
                              r->period_frames);
    return 0;
}

static int take_speakers(struct rig *r, const struct rig_device *d, const char *path,
                         struct error *why)
{
    static const double range[] = {-120, 0};
    struct list l = {path, "device.level_db", "speakers", r->survey.n_speakers};
    double level_db = DEFAULT_LEVEL_DB;
    int err = take_number(&level_db, d->level_db, path, l.key, range, why);
    l.key = "device.outputs";
    if (!err)
        err = take_channels(&r->outputs, &l, &d->outputs, why);
    l.key = "device.output_gain_db";
    if (!err)
        err = take_gains(&r->output_gain, &l, &d->output_gain_db, level_db, why);
    for (size_t i = 0; !err && i < l.n_elements; i++)
        if (r->output_gain[i] > 1)
            err = refuse_entry(&l, i, why,
                               "with level_db the chirp is %g dB above full scale",
                               20 * log10(r->output_gain[i]));
    l.key = "device.invert_outputs";
    return err ? err : invert(r->output_gain, &l, &d->invert_outputs, why);
}

static int take_microphones(struct rig *r, const struct rig_device *d, const char *path,
                            struct error *why)
{
    struct list l = {path, "device.inputs", "microphones", r->survey.n_microphones};
    int err = take_channels(&r->inputs, &l, &d->inputs, why);
    l.key = "device.input_gain_db";
    if (!err)
        err = take_gains(&r->input_gain, &l, &d->input_gain_db, 0, why);
    l.key = "device.invert_inputs";
    return err ? err : invert(r->input_gain, &l, &d->invert_inputs, why);
}

static int take_device(struct rig *r, const struct rig_device *d, const char *path,
                       struct error *why)
{
    static const struct rig_device nothing = {.format = 0};
    if (!d)
        d = &nothing;
    r->has_format = d->format != 0;
    if (r->has_format)
        r->format = (enum sample_format)(d->format - 1);
    r->access = (enum rig_access)d->access;
    int err = take_buffers(r, d, path, why);
    if (!err)
        err = take_speakers(r, d, path, why);
    return err ? err : take_microphones(r, d, path, why);
}

/* With the background that it names. */
static int take_calibration(struct rig *r, const char *file, struct error *why)
{
    int err = calibration_take(&r->calibration, file, &r->survey, why);
    if (err || !r->calibration || !r->calibration->background)
        return err;
    r->background = yaml_sibling(file, r->calibration->background);
    return r->background ? 0 : error_say(why, -ENOMEM, "%s: out of memory", file);
}

/* What the rig names is relative to it, and what is wrong there has its line. */
static int take_named_calibration(struct rig *r, const char *name, const char *path,
                                  struct error *why)
{
    struct error inner = {.text = ""};
    char *file = yaml_sibling(path, name);
    if (!file)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    int err = take_calibration(r, file, &inner);
    free(file);
    return err ? yaml_error_say(why, err, path, "calibrated", "%.700s", inner.text) : 0;
}

int rig_load_calibrated(struct rig *out, const char *path, const char *calibrated,
                        struct error *why)
{
    void *data;
    *out = (struct rig){.access = RIG_ACCESS_ANY};
    int err = yaml_load(path, &root_schema, &data, why);
    if (err)
        return err;
    const struct rig_root *root = data;
    err = survey_from_yaml(&out->survey, &root->survey, path, why);
    out->survey.source = SURVEY_LIVE;
    if (!err)
        err = take_device(out, root->device, path, why);
    if (!err && calibrated)
        err = take_calibration(out, calibrated, why);
    else if (!err && root->calibrated)
        err = take_named_calibration(out, root->calibrated, path, why);
    yaml_unload(&root_schema, data);
    if (err)
        rig_clear(out);
    return err;
}

int rig_load(struct rig *out, const char *path, struct error *why)
{
    return rig_load_calibrated(out, path, NULL, why);
}

static size_t channels_for(const size_t *channels, size_t n)
{
    size_t most = 0;
    for (size_t i = 0; i < n; i++)
        most = channels[i] >= most ? channels[i] + 1 : most;
    return most;
}

size_t rig_output_channels(const struct rig *r)
{
    return channels_for(r->outputs, r->survey.n_speakers);
}

size_t rig_input_channels(const struct rig *r)
{
    return channels_for(r->inputs, r->survey.n_microphones);
}

void rig_clear(struct rig *r)
{
    survey_clear(&r->survey);
    calibration_destroy(r->calibration);
    free(r->background);
    free(r->outputs);
    free(r->inputs);
    free(r->output_gain);
    free(r->input_gain);
    *r = (struct rig){.access = RIG_ACCESS_ANY};
}
