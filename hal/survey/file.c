#include "hal/survey/file.h"

#include <errno.h>
#include <stdbool.h>
#include <string.h>

#include "hal/survey/yaml.h"
#include "hal/yaml/file.h"
#include "hal/survey/place.h"

struct survey_root {
    struct survey_yaml survey;
};

static const struct cyaml_schema_field root_fields[] = {
    SURVEY_YAML_FIELDS(struct survey_root, CYAML_FLAG_OPTIONAL),
    CYAML_FIELD_STRING_PTR("pings", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL,
                           struct survey_root, survey.pings, 1, 4096),
    CYAML_FIELD_STRING_PTR("replica", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL,
                           struct survey_root, survey.replica, 1, 4096),
    CYAML_FIELD_END};
static const struct cyaml_schema_value root_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct survey_root, root_fields)};

/* Each part once: as the array and the chirp, or as the files in place of them. */
static int check_keys(const struct survey_yaml *y, const char *path,
                      struct complaint *why)
{
    const struct {
        const char *key, *instead;
        bool there, replaced, optional;
    } keys[] = {
        {"sample_rate_hz", NULL, y->sample_rate_hz, false, false},
        {"chirp", "replica", y->chirp, y->replica, false},
        {"slot_samples", NULL, y->slot_samples, false, false},
        {"speakers_m", "pings", y->speakers_m, y->pings, false},
        {"microphones_m", "pings", y->microphones_m, y->pings, false},
        {"stage", "pings", y->stage, y->pings, true},
    };
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        if (keys[i].there && keys[i].replaced)
            return yaml_complain(why, -EINVAL, path, keys[i].key,
                                 "the key \"%s\" says this already; expected one",
                                 keys[i].instead);
        if (!keys[i].there && !keys[i].replaced && !keys[i].optional)
            return complain(why, -EINVAL, "%s:1: the key \"%s\" is missing%s%s%s", path,
                            keys[i].key, keys[i].instead ? ", or \"" : "",
                            keys[i].instead ? keys[i].instead : "",
                            keys[i].instead ? "\"" : "");
    }
    return 0;
}

int survey_load(struct survey *out, const char *path, struct complaint *why)
{
    void *root;
    memset(out, 0, sizeof *out);
    int err = yaml_load(path, &root_schema, &root, why);
    if (err)
        return err;
    const struct survey_yaml *y = &((const struct survey_root *)root)->survey;
    err = check_keys(y, path, why);
    if (!err)
        err = survey_from_yaml(out, y, path, why);
    yaml_unload(&root_schema, root);
    return err;
}

int survey_load_place(struct survey *out, const char *path, struct complaint *why)
{
    void *root;
    memset(out, 0, sizeof *out);
    int err = yaml_load(path, &root_schema, &root, why);
    if (err)
        return err;
    err = survey_yaml_place(out, &((const struct survey_root *)root)->survey, path, why);
    if (!err) {
        err = survey_check_place(out, why);
        if (err)
            yaml_place_complaint(why, path);
    }
    yaml_unload(&root_schema, root);
    return err;
}
