#include "nodes/rt/launchfile_record.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/place.h"

#define MAX_MB 100000000 /* 100 TB */
#define MAX_S  31536000  /* a year */

static int add_node(struct launchfile *l)
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

static int take_numbers(struct launchfile *l, const struct launch_text_record *t,
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
    };

    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
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

static char *copy_text(const char *text, const char *otherwise)
{
    return strdup(text ? text : otherwise);
}

int launchfile_copy_record(struct launchfile *l, const struct launch_text *t,
                           const struct launchfile_options *options, struct error *why)
{
    const struct launch_text_record *r = &t->record;
    const char *path = options && options->record ? options->record : r->path;
    const char *compression = r->compression ? r->compression : "none";
    bool added = options && options->record && !launchfile_has_node(l, "record");

    if (added && add_node(l))
        return -ENOMEM;
    if (launchfile_has_node(l, "record") && !path)
        return yaml_error_say(why, -EINVAL, l->path, "record.path",
                              "expected the name of a bag, e.g. out/demo.mcap");
    if (bag_compression_find(&l->record.compression,
                             bytes_of(strcmp(compression, "none") ? compression : "")))
        return yaml_error_say(why, -EINVAL, l->path, "record.compression",
                              "expected none, lz4 or zstd, not %s", compression);
    l->record.path = copy_text(path, "");
    l->record.topics = copy_text(r->topics, "*");
    l->record.exclude = copy_text(r->exclude, "");
    if (!l->record.path || !l->record.topics || !l->record.exclude)
        return -ENOMEM;
    return take_numbers(l, r, why);
}

void launchfile_free_record(struct launchfile *l)
{
    free(l->record.path);
    free(l->record.topics);
    free(l->record.exclude);
}
