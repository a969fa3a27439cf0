/* SPDX-License-Identifier: MIT */
#include "hal/survey/calibration.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/yaml.h"
#include "hal/text_file.h"
#include "hal/yaml_file.h"

#define OPTIONAL CYAML_FLAG_OPTIONAL

/* The id of a survey that has nothing but the places of its elements. */
static void name_geometry(const struct survey *s, char *out, size_t size)
{
    struct survey bare = {.n_speakers = s->n_speakers,
                          .speakers_m = s->speakers_m,
                          .n_microphones = s->n_microphones,
                          .microphones_m = s->microphones_m};
    snprintf(out, size, "%016" PRIx64, survey_id(&bare));
}

/* As a recording of a calibrated array has it. */
static bool has_its_places(const struct calibration *c, const struct survey *s)
{
    return c->places_m &&
           !memcmp(s->speakers_m, c->places_m, c->n_speakers * sizeof *c->places_m) &&
           !memcmp(s->microphones_m, c->places_m + c->n_speakers,
                   c->n_microphones * sizeof *c->places_m);
}

int calibration_create(struct calibration **out, size_t n_speakers, size_t n_microphones)
{
    struct calibration *c = calloc(1, sizeof *c);
    *out = NULL;
    if (!c)
        return -ENOMEM;
    c->sample_rate_hz = c->latency_samples = c->temperature_c = NAN;
    c->humidity_percent = c->sound_speed_m_s = c->places_sigma_m = NAN;
    c->n_speakers = n_speakers;
    c->n_microphones = n_microphones;
    c->speakers = calloc(n_speakers, sizeof *c->speakers);
    c->microphones = calloc(n_microphones, sizeof *c->microphones);
    if (!c->speakers || !c->microphones) {
        calibration_destroy(c);
        return -ENOMEM;
    }
    *out = c;
    return 0;
}

void calibration_name(struct calibration *c, const struct survey *s, const char *array)
{
    snprintf(c->array, sizeof c->array, "%s", array);
    name_geometry(s, c->geometry, sizeof c->geometry);
    c->sample_rate_hz = s->sample_rate_hz;
}

int calibration_fits(const struct calibration *c, const struct survey *s,
                     const char *path, struct error *why)
{
    char geometry[sizeof c->geometry];
    if (c->n_speakers != s->n_speakers || c->n_microphones != s->n_microphones)
        return error_say(why, -EINVAL,
                         "%s: made for %zu speakers and %zu microphones, and the array "
                         "has %zu and %zu; calibrate anew",
                         path, c->n_speakers, c->n_microphones, s->n_speakers,
                         s->n_microphones);
    if (c->sample_rate_hz != s->sample_rate_hz)
        return error_say(why, -EINVAL,
                         "%s: made at %g Hz, and the array runs at %g Hz; calibrate anew",
                         path, c->sample_rate_hz, s->sample_rate_hz);
    name_geometry(s, geometry, sizeof geometry);
    if (strcmp(geometry, c->geometry) != 0 && !has_its_places(c, s))
        return error_say(why, -EINVAL,
                         "%s: made with speakers and microphones at other places "
                         "(geometry %s) than this array's (%s); calibrate anew",
                         path, c->geometry, geometry);
    return 0;
}

static int check_moves(const struct calibration *c, const struct survey *s,
                       const char *path, struct error *why)
{
    for (size_t e = 0; c->places_m && e < c->n_speakers + c->n_microphones; e++) {
        bool speaker = e < c->n_speakers;
        size_t i = speaker ? e : e - c->n_speakers;
        const double *at = speaker ? s->speakers_m[i] : s->microphones_m[i];
        double moved = hypot(hypot(c->places_m[e][0] - at[0], c->places_m[e][1] - at[1]),
                             c->places_m[e][2] - at[2]);
        if (!(moved <= CALIBRATION_MAX_MOVE_M))
            return error_say(why, -EINVAL,
                             "%s: places: %s %zu is %.3g m from where the survey has it, "
                             "and at most %g is plausible; measure the survey anew",
                             path, speaker ? "speaker" : "microphone", i, moved,
                             CALIBRATION_MAX_MOVE_M);
    }
    return 0;
}

int calibration_apply(const struct calibration *c, struct survey *s, const char *path,
                      struct error *why)
{
    struct error inner = {.text = ""};
    struct survey set = *s;
    int err = calibration_fits(c, s, path, why);
    if (!err)
        err = check_moves(c, s, path, why);
    if (err)
        return err;
    if (c->places_m) {
        set.speakers_m = c->places_m;
        set.microphones_m = c->places_m + c->n_speakers;
    }
    if (!isnan(c->latency_samples))
        set.latency_samples = c->latency_samples;
    if (!isnan(c->temperature_c))
        set.temperature_c = c->temperature_c;
    if (!isnan(c->sound_speed_m_s))
        set.sound_speed_m_s = c->sound_speed_m_s;
    err = survey_check(&set, &inner);
    if (err)
        return error_say(why, err, "%s: with it the survey is wrong: %.700s", path,
                         inner.text);
    if (c->places_m) {
        memcpy(s->speakers_m, set.speakers_m, s->n_speakers * sizeof *s->speakers_m);
        memcpy(s->microphones_m, set.microphones_m,
               s->n_microphones * sizeof *s->microphones_m);
        set.speakers_m = s->speakers_m;
        set.microphones_m = s->microphones_m;
    }
    *s = set;
    return 0;
}

/* What a channel's samples are to be multiplied by: its gain and polarity undone; 0 for a
 * dead or noisy one, which recon/frontend/channel_check then leaves out. */
static float calibration_factor(const struct calibration_channel *channel)
{
    double factor = pow(10.0, -channel->gain_db / 20.0);
    if (channel->faults & (CALIBRATION_DEAD | CALIBRATION_NOISY))
        return 0.0f;
    return (float)(channel->faults & CALIBRATION_INVERTED ? -factor : factor);
}

void calibration_correct(const struct calibration *c, size_t speaker, size_t n_samples,
                         float *samples)
{
    if (!c)
        return;
    float sent = calibration_factor(&c->speakers[speaker]);
    for (size_t m = 0; m < c->n_microphones; m++) {
        float factor = sent * calibration_factor(&c->microphones[m]);
        for (size_t i = 0; factor != 1.0f && i < n_samples; i++)
            samples[m * n_samples + i] *= factor;
    }
}

void calibration_destroy(struct calibration *c)
{
    if (!c)
        return;
    free(c->speakers);
    free(c->microphones);
    free(c->places_m);
    free(c->background);
    free(c);
}

/* -- the file as libcyaml reads it ------------------------------------------------------
 */
enum { N_FAULTS = 4, SPEAKERS = 0, MICROPHONES = 1 };

struct numbers {
    uint32_t *at;
    unsigned n;
};

struct gains {
    double *speakers_db, *microphones_db;
    unsigned n_speakers, n_microphones;
};

struct channels {
    struct numbers with[2][N_FAULTS]; /* speakers, microphones by fault */
};

struct places {
    double (*speakers_m)[3], (*microphones_m)[3];
    unsigned n_speakers, n_microphones;
    double sigma_m;
};

struct root {
    char *array, *made, *geometry, *background;
    double sample_rate_hz;
    uint32_t speakers, microphones;
    double *latency_samples, *temperature_c, *humidity_percent, *sound_speed_m_s;
    struct channels *channels;
    struct gains *gains;
    struct places *places;
};

static const struct cyaml_schema_value channel_number = {
    CYAML_VALUE_UINT(CYAML_FLAG_DEFAULT, uint32_t)};

/* clang-format off */
#define NUMBERS(key, kind, fault)                                                        \
    CYAML_FIELD_SEQUENCE_COUNT(key, CYAML_FLAG_POINTER | OPTIONAL, struct channels,      \
                               with[kind][fault].at, with[kind][fault].n,                \
                               &channel_number, 0, SURVEY_MAX_ELEMENTS)
#define GAINS(key)                                                                       \
    CYAML_FIELD_SEQUENCE_COUNT(#key "_db", CYAML_FLAG_POINTER, struct gains, key##_db,   \
                               n_##key, &survey_yaml_number, 1, SURVEY_MAX_ELEMENTS)
#define PLACES(key)                                                                      \
    CYAML_FIELD_SEQUENCE_COUNT(#key "_m", CYAML_FLAG_POINTER, struct places, key##_m,    \
                               n_##key, &survey_yaml_point, 1, SURVEY_MAX_ELEMENTS)
#define TEXT(key, flags, size)                                                           \
    CYAML_FIELD_STRING_PTR(#key, CYAML_FLAG_POINTER | (flags), struct root, key, 1, size)
#define NUMBER(key) CYAML_FIELD_FLOAT_PTR(#key, OPTIONAL, struct root, key)

/* clang-format on */
static const struct cyaml_schema_field channel_fields[] = {
    NUMBERS("inverted_speakers", SPEAKERS, 0),
    NUMBERS("dead_speakers", SPEAKERS, 1),
    NUMBERS("clipped_speakers", SPEAKERS, 2),
    NUMBERS("noisy_speakers", SPEAKERS, 3),
    NUMBERS("inverted_microphones", MICROPHONES, 0),
    NUMBERS("dead_microphones", MICROPHONES, 1),
    NUMBERS("clipped_microphones", MICROPHONES, 2),
    NUMBERS("noisy_microphones", MICROPHONES, 3),
    CYAML_FIELD_END};
static const char *const fault_names[N_FAULTS] = {"inverted", "dead", "clipped", "noisy"};
static const char *const kind_names[2] = {"speakers", "microphones"};

static const struct cyaml_schema_field gain_fields[] = {
    GAINS(speakers), GAINS(microphones), CYAML_FIELD_END};

static const struct cyaml_schema_field place_fields[] = {
    PLACES(speakers), PLACES(microphones),
    CYAML_FIELD_FLOAT("sigma_m", CYAML_FLAG_DEFAULT, struct places, sigma_m),
    CYAML_FIELD_END};

static const struct cyaml_schema_field root_fields[] = {
    TEXT(array, CYAML_FLAG_DEFAULT, sizeof((struct calibration *)0)->array - 1),
    TEXT(made, CYAML_FLAG_DEFAULT, sizeof((struct calibration *)0)->made - 1),
    TEXT(geometry, CYAML_FLAG_DEFAULT, sizeof((struct calibration *)0)->geometry - 1),
    CYAML_FIELD_FLOAT("sample_rate_hz", CYAML_FLAG_DEFAULT, struct root, sample_rate_hz),
    CYAML_FIELD_UINT("speakers", CYAML_FLAG_DEFAULT, struct root, speakers),
    CYAML_FIELD_UINT("microphones", CYAML_FLAG_DEFAULT, struct root, microphones),
    NUMBER(latency_samples),
    NUMBER(temperature_c),
    NUMBER(humidity_percent),
    NUMBER(sound_speed_m_s),
    CYAML_FIELD_MAPPING_PTR("channels", OPTIONAL, struct root, channels, channel_fields),
    CYAML_FIELD_MAPPING_PTR("gains", OPTIONAL, struct root, gains, gain_fields),
    CYAML_FIELD_MAPPING_PTR("places", OPTIONAL, struct root, places, place_fields),
    TEXT(background, OPTIONAL, 4096),
    CYAML_FIELD_END};
static const struct cyaml_schema_value root_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct root, root_fields)};

/* -- reading ----------------------------------------------------------------------------
 */
static int check_numbers(const struct root *r, const char *path, struct error *why)
{
    const struct {
        const char *key;
        double value, min, max;
        const char *unit;
    } rules[] = {
        {"sample_rate_hz", r->sample_rate_hz, 8e3, 400e3, "Hz"},
        {"speakers", r->speakers, 1, SURVEY_MAX_ELEMENTS, "channels"},
        {"microphones", r->microphones, 1, SURVEY_MAX_ELEMENTS, "channels"},
        {"latency_samples", r->latency_samples ? *r->latency_samples : 0, 0,
         r->sample_rate_hz, "samples, a second"},
        {"temperature_c", r->temperature_c ? *r->temperature_c : 0, -40, 60, "C"},
        {"humidity_percent", r->humidity_percent ? *r->humidity_percent : 0, 0, 100, "%"},
        {"sound_speed_m_s", r->sound_speed_m_s ? *r->sound_speed_m_s : 340, 300, 360,
         "m/s"},
    };
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++)
        if (!(rules[i].value >= rules[i].min && rules[i].value <= rules[i].max))
            return yaml_error_say(why, -EINVAL, path, rules[i].key,
                                  "%g is implausible; expected %g to %g %s",
                                  rules[i].value, rules[i].min, rules[i].max,
                                  rules[i].unit);
    return 0;
}

static int take_gains(struct calibration_channel *out, size_t n, const double *gains_db,
                      size_t n_gains, const char *kind, const char *path,
                      struct error *why)
{
    char key[48];
    snprintf(key, sizeof key, "gains.%s_db", kind);
    if (n_gains != n)
        return yaml_error_say(why, -EINVAL, path, key,
                              "expected %zu gains, one for each, found %zu", n, n_gains);
    for (size_t i = 0; i < n; i++) {
        if (!(fabs(gains_db[i]) <= CALIBRATION_MAX_GAIN_DB)) {
            snprintf(key, sizeof key, "gains.%s_db[%zu]", kind, i);
            return yaml_error_say(why, -EINVAL, path, key,
                                  "%g is implausible; expected %g to %g dB", gains_db[i],
                                  -CALIBRATION_MAX_GAIN_DB, CALIBRATION_MAX_GAIN_DB);
        }
        out[i].gain_db = gains_db[i];
    }
    return 0;
}

static int take_faults(struct calibration_channel *out, size_t n,
                       const struct numbers with[N_FAULTS], const char *kind,
                       const char *path, struct error *why)
{
    for (unsigned f = 0; f < N_FAULTS; f++)
        for (unsigned i = 0; i < with[f].n; i++) {
            if (with[f].at[i] < n) {
                out[with[f].at[i]].faults |= 1u << f;
                continue;
            }
            char key[64];
            snprintf(key, sizeof key, "channels.%s_%s[%u]", fault_names[f], kind, i);
            return yaml_error_say(why, -EINVAL, path, key,
                                  "there is no %u; expected 0 to %zu", with[f].at[i],
                                  n - 1);
        }
    return 0;
}

static int take_channels(struct calibration *c, const struct root *r, const char *path,
                         struct error *why)
{
    struct calibration_channel *channels[2] = {c->speakers, c->microphones};
    const size_t n[2] = {c->n_speakers, c->n_microphones};
    int err = 0;
    c->has_gains = r->gains != NULL;
    c->has_channels = r->channels != NULL;
    for (int k = 0; k < 2; k++) {
        if (r->gains && !err)
            err = take_gains(channels[k], n[k],
                             k ? r->gains->microphones_db : r->gains->speakers_db,
                             k ? r->gains->n_microphones : r->gains->n_speakers,
                             kind_names[k], path, why);
        if (r->channels && !err)
            err = take_faults(channels[k], n[k], r->channels->with[k], kind_names[k],
                              path, why);
    }
    return err;
}

static int check_places(const struct calibration *c, const struct places *p,
                        const char *path, struct error *why)
{
    const struct {
        const char *key;
        size_t is, expected;
    } counts[] = {{"places.speakers_m", p->n_speakers, c->n_speakers},
                  {"places.microphones_m", p->n_microphones, c->n_microphones}};
    for (size_t i = 0; i < 2; i++)
        if (counts[i].is != counts[i].expected)
            return yaml_error_say(why, -EINVAL, path, counts[i].key,
                                  "expected %zu places, one for each, found %zu",
                                  counts[i].expected, counts[i].is);
    if (!(p->sigma_m > 0.0 && p->sigma_m <= CALIBRATION_MAX_MOVE_M))
        return yaml_error_say(why, -EINVAL, path, "places.sigma_m",
                              "%g is implausible; expected more than 0, up to %g m",
                              p->sigma_m, CALIBRATION_MAX_MOVE_M);
    return 0;
}

static int take_places(struct calibration *c, const struct places *p, const char *path,
                       struct error *why)
{
    if (!p)
        return 0;
    int err = check_places(c, p, path, why);
    if (err)
        return err;
    c->places_m = malloc((c->n_speakers + c->n_microphones) * sizeof *c->places_m);
    if (!c->places_m)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    memcpy(c->places_m, p->speakers_m, c->n_speakers * sizeof *c->places_m);
    memcpy(c->places_m + c->n_speakers, p->microphones_m,
           c->n_microphones * sizeof *c->places_m);
    c->places_sigma_m = p->sigma_m;
    return 0;
}

static double known(const double *x)
{
    return x ? *x : NAN;
}

static int from_root(struct calibration **out, const struct root *r, const char *path,
                     struct error *why)
{
    struct calibration *c;
    int err = check_numbers(r, path, why);
    if (err)
        return err;
    if (calibration_create(&c, r->speakers, r->microphones) < 0)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    c->sample_rate_hz = r->sample_rate_hz;
    strcpy(c->array, r->array);
    strcpy(c->made, r->made);
    strcpy(c->geometry, r->geometry);
    c->latency_samples = known(r->latency_samples);
    c->temperature_c = known(r->temperature_c);
    c->humidity_percent = known(r->humidity_percent);
    c->sound_speed_m_s = known(r->sound_speed_m_s);
    err = take_channels(c, r, path, why);
    if (!err)
        err = take_places(c, r->places, path, why);
    if (!err && r->background && !(c->background = strdup(r->background)))
        err = error_say(why, -ENOMEM, "%s: out of memory", path);
    if (err)
        calibration_destroy(c);
    else
        *out = c;
    return err;
}

int calibration_load(struct calibration **out, const char *path, struct error *why)
{
    void *root;
    *out = NULL;
    int err = yaml_load(path, &root_schema, &root, why);
    if (err)
        return err;
    err = from_root(out, root, path, why);
    yaml_unload(&root_schema, root);
    return err;
}

int calibration_take(struct calibration **out, const char *path, struct survey *s,
                     struct error *why)
{
    *out = NULL;
    if (!path || !*path)
        return 0;
    int err = calibration_load(out, path, why);
    if (!err)
        err = calibration_apply(*out, s, path, why);
    if (err) {
        calibration_destroy(*out);
        *out = NULL;
    }
    return err;
}

/* In double quotes, as YAML and JSON have them. */
static void print_text(FILE *f, const char *key, const char *text)
{
    fprintf(f, "%s: \"", key);
    for (; *text; text++) {
        unsigned char c = (unsigned char)*text;
        if (c == '"' || c == '\\')
            fputc('\\', f);
        if (c < ' ')
            fprintf(f, "\\x%02x", c);
        else
            fputc(c, f);
    }
    fputs("\"\n", f);
}

static void print_number(FILE *f, const char *key, double x)
{
    char text[DECIMAL_SIZE];
    if (!isnan(x))
        fprintf(f, "%s: %s\n", key, decimal_print(x, text));
}

static void print_faults(FILE *f, const char *kind,
                         const struct calibration_channel *channels, size_t n)
{
    static const char *const names[] = {"inverted", "dead", "clipped", "noisy"};
    for (unsigned k = 0; k < 4; k++) {
        const char *joint = "";
        fprintf(f, "  %s_%s: [", names[k], kind);
        for (size_t i = 0; i < n; i++) {
            if (!(channels[i].faults & 1u << k))
                continue;
            fprintf(f, "%s%zu", joint, i);
            joint = ", ";
        }
        fputs("]\n", f);
    }
}

static void print_gains(FILE *f, const char *kind,
                        const struct calibration_channel *channels, size_t n)
{
    char text[DECIMAL_SIZE];
    fprintf(f, "  %s_db: [", kind);
    for (size_t i = 0; i < n; i++)
        fprintf(f, "%s%s", i ? ", " : "", decimal_print(channels[i].gain_db, text));
    fputs("]\n", f);
}

static void print_places(FILE *f, const char *kind, const double (*at_m)[3], size_t n)
{
    char text[3][DECIMAL_SIZE];
    fprintf(f, "  %s_m:\n", kind);
    for (size_t i = 0; i < n; i++)
        fprintf(f, "    - [%s, %s, %s]\n", decimal_print(at_m[i][0], text[0]),
                decimal_print(at_m[i][1], text[1]), decimal_print(at_m[i][2], text[2]));
}

static void print_calibration(FILE *f, const void *what)
{
    const struct calibration *c = what;
    fputs("# What anlos calibrate has measured; each of its commands renews a part.\n"
          "# Channels are counted from 0, gains are relative to their mean.\n",
          f);
    print_text(f, "array", c->array);
    print_text(f, "made", c->made);
    print_text(f, "geometry", c->geometry);
    print_number(f, "sample_rate_hz", c->sample_rate_hz);
    fprintf(f, "speakers: %zu\nmicrophones: %zu\n", c->n_speakers, c->n_microphones);
    print_number(f, "latency_samples", c->latency_samples);
    print_number(f, "temperature_c", c->temperature_c);
    print_number(f, "humidity_percent", c->humidity_percent);
    print_number(f, "sound_speed_m_s", c->sound_speed_m_s);
    if (c->has_channels) {
        fputs("channels:\n", f);
        print_faults(f, "speakers", c->speakers, c->n_speakers);
        print_faults(f, "microphones", c->microphones, c->n_microphones);
    }
    if (c->has_gains) {
        fputs("gains:\n", f);
        print_gains(f, "speakers", c->speakers, c->n_speakers);
        print_gains(f, "microphones", c->microphones, c->n_microphones);
    }
    if (c->places_m) {
        char sigma[DECIMAL_SIZE];
        fputs("places: # in place of the survey's\n", f);
        print_places(f, "speakers", (const double(*)[3])c->places_m, c->n_speakers);
        print_places(f, "microphones", (const double(*)[3])c->places_m + c->n_speakers,
                     c->n_microphones);
        fprintf(f, "  sigma_m: %s\n", decimal_print(c->places_sigma_m, sigma));
    }
    if (c->background)
        print_text(f, "background", c->background);
}

int calibration_save(const struct calibration *c, const char *path, struct error *why)
{
    int err = text_file_write(path, true, print_calibration, c);
    if (err)
        error_say(why, err, "%s cannot be written: %s", path, strerror(-err));
    return err;
}
