#include "nodes/record/survey_cargo.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "msgs/convert.h"
#include "hal/survey/file.h"
#include "msgs/bag/manifest.h"

#define PLACE_SIZE 512

bool survey_cargo_is_news(const struct survey_cargo *s, const Anlos__Survey *m)
{
    return m->id != s->id;
}

static void put_geometry(struct pairs *p, uint64_t id, const struct survey *s)
{
    char text[128];

    snprintf(text, sizeof text, "%016" PRIx64, id);
    pairs_text(p, MANIFEST_SURVEY_ID, text);
    const ProtobufCEnumValue *source =
        protobuf_c_enum_descriptor_get_value(&anlos__source__descriptor, (int)s->source);
    pairs_text(p, MANIFEST_SOURCE, source ? source->name : "");
    pairs_number(p, MANIFEST_TEMPERATURE, s->temperature_c);
    pairs_number(p, MANIFEST_SOUND_SPEED, s->sound_speed_m_s);
    pairs_number(p, MANIFEST_RATE, s->sample_rate_hz);
    pairs_count(p, MANIFEST_SPEAKERS, s->n_speakers);
    pairs_count(p, MANIFEST_MICROPHONES, s->n_microphones);
    pairs_count(p, MANIFEST_POSITIONS, s->n_positions);
    snprintf(text, sizeof text, "%.9g, %.9g, %.9g", s->stage_axis[0], s->stage_axis[1],
             s->stage_axis[2]);
    pairs_text(p, MANIFEST_STAGE_AXIS, text);
    pairs_number(p, MANIFEST_STAGE_FIRST, s->stage_positions_m[0]);
    pairs_number(p, MANIFEST_STAGE_LAST, s->stage_positions_m[s->n_positions - 1]);
}

/* A folder of files and no more. */
static void remove_folder(const char *folder)
{
    char path[PATH_MAX];
    DIR *d = opendir(folder);

    for (const struct dirent *e; d && (e = readdir(d));) {
        snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        unlink(path); /* refuses "." and ".." */
    }
    if (d)
        closedir(d);
    rmdir(folder);
}

/* Files are what survey_save makes: it knows how a survey is written down. */
static int take_files(struct cargo *c, const struct survey *s, const char *folder,
                      struct complaint *why)
{
    char path[PLACE_SIZE + 32], curves[PLACE_SIZE + 32];

    snprintf(path, sizeof path, "%s/%s", folder, MANIFEST_SURVEY);
    snprintf(curves, sizeof curves, "%s/%s", folder, MANIFEST_CALIBRATION);
    int err = survey_save(s, path, MANIFEST_CALIBRATION, why);
    if (!err)
        err = cargo_add_folder(c, "", folder, why);
    if (!err && s->n_responses)
        err = cargo_add_folder(c, MANIFEST_CALIBRATION "/", curves, why);
    if (s->n_responses)
        remove_folder(curves);
    return err;
}

static int save(struct cargo *c, const struct survey *s, struct complaint *why)
{
    const char *place = getenv("TMPDIR");
    char folder[PLACE_SIZE];

    if (snprintf(folder, sizeof folder, "%s/anlos-survey-XXXXXX",
                 place && *place ? place : "/tmp") >= (int)sizeof folder)
        return complain(why, -ENAMETOOLONG, "$TMPDIR: path too long");
    if (!mkdtemp(folder))
        return complain(why, -errno, "%s: %s", folder, strerror(errno));
    int err = take_files(c, s, folder, why);
    remove_folder(folder);
    return err;
}

int survey_cargo_take(struct survey_cargo *out, const Anlos__Survey *m,
                      struct complaint *why)
{
    struct survey s;

    survey_cargo_clear(out);
    out->id = m->id; /* one that is wrong is complained about once */
    int err = survey_from_message(&s, m, why);
    if (err)
        return err;
    err = save(&out->files, &s, why);
    if (err)
        cargo_clear(&out->files);
    else
        put_geometry(&out->geometry, m->id, &s);
    survey_clear(&s);
    return err;
}

int survey_cargo_write(const struct survey_cargo *s, int64_t now_ns, struct bag_writer *w,
                       struct complaint *why)
{
    int err = cargo_write(&s->files, w, now_ns, why);

    return err || !s->geometry.map.size
               ? err
               : pairs_write(&s->geometry, MANIFEST_GEOMETRY, w, why);
}

void survey_cargo_clear(struct survey_cargo *s)
{
    cargo_clear(&s->files);
    pairs_clear(&s->geometry);
    *s = (struct survey_cargo){0};
}
