#include "nodes/anlos/bag/import_bag.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "msgs/bag/topic_message.h"

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
                     enum bag_compression compression, struct complaint *why)
{
    struct import_bag *b = calloc(1, sizeof *b);
    int err = b ? verb_output_begin(&b->output, path, why)
                : complain(why, -ENOMEM, "out of memory");

    if (!err)
        err = verb_writer_create(&b->writer, &b->output, "anlos", compression, why);
    if (!err && bag_topics_create(&b->topics, b->writer)) {
        complain(why, -ENOMEM, "out of memory");
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
               const uint8_t *payload, size_t size, struct complaint *why)
{
    struct envelope e = {.epoch_ns = IMPORT_START_NS,
                         .sequence = sequence,
                         .capture_ns = capture_ns,
                         .publish_ns = publish_ns,
                         .payload_size = (uint32_t)size};

    if (size > t->max_size)
        return complain(why, -EMSGSIZE,
                        "a %s of %zu bytes; no more than %zu go over the "
                        "bus",
                        t->name, size, t->max_size);
    snprintf(e.node, sizeof e.node, "%s", node);
    snprintf(e.topic, sizeof e.topic, "%s", t->name);
    return bag_topics_put(b->topics, &e, payload, NULL, why);
}

int import_bag_survey(struct import_bag *b, const struct survey *s, const char *yaml,
                      size_t yaml_size, struct complaint *why)
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
        err = complain(why, -ENOMEM, "out of memory");
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

int import_bag_ping(struct import_bag *b, Anlos__Ping *p, int64_t capture_ns,
                    int64_t length_ns, struct complaint *why)
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
        err = complain(why, -ENOMEM, "out of memory");
    return err ? err
               : put(b, "array", topic_ping(), b->n_pings++, capture_ns,
                     capture_ns + length_ns, b->packed, size, why);
}

int import_bag_ego(struct import_bag *b, const Anlos__EgoMotion *m, int64_t capture_ns,
                   struct complaint *why)
{
    uint8_t packed[128];
    size_t size = anlos__ego_motion__get_packed_size(m);

    if (size > sizeof packed)
        return complain(why, -EMSGSIZE, "a message of ego motion of %zu bytes", size);
    anlos__ego_motion__pack(m, packed);
    return put(b, "can", topic_ego(), b->n_egos++, capture_ns, capture_ns, packed, size,
               why);
}

int import_bag_metadata(struct import_bag *b, const char *name,
                        const char *const (*pairs)[2], size_t n, struct complaint *why)
{
    struct bytes_buffer map = {0};

    for (size_t i = 0; i < n; i++)
        bag_map_put(&map, bytes_of(pairs[i][0]), bytes_of(pairs[i][1]));
    const struct bag_metadata m = {bytes_of(name), bytes_in(&map)};
    int err = map.failed ? complain(why, -ENOMEM, "out of memory")
                         : bag_writer_metadata(b->writer, &m, why);
    bytes_free(&map);
    return err;
}

int import_bag_end(struct import_bag *b, int err, struct complaint *why)
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
