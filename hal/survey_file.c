#include "hal/survey_file.h"

#include <errno.h>
#include <string.h>

#include "hal/survey_yaml.h"
#include "hal/yaml_file.h"

struct survey_root {
    struct survey_yaml survey;
};

static const struct cyaml_schema_field root_fields[] = {
    SURVEY_YAML_FIELDS(struct survey_root, CYAML_FLAG_DEFAULT), CYAML_FIELD_END};
static const struct cyaml_schema_value root_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct survey_root, root_fields)};

int survey_load(struct survey *out, const char *path, struct complaint *why)
{
    void *root;
    memset(out, 0, sizeof *out);
    int err = yaml_load(path, &root_schema, &root, why);
    if (err)
        return err;
    err = survey_from_yaml(out, &((const struct survey_root *)root)->survey, path, why);
    yaml_unload(&root_schema, root);
    return err;
}
