#include <errno.h>
#include <inttypes.h>
#include <string.h>

#include "foxglove/log.pb-c.h"
#include "msgs/log.pb-c.h"
#include "nodes/foxglove/convert.h"
#include "nodes/foxglove/parts.h"

static Foxglove__Log__Level level_of(Anlos__Log__Level level)
{
    switch (level) {
    case ANLOS__LOG__LEVEL__DEBUG:
        return FOXGLOVE__LOG__LEVEL__DEBUG;
    case ANLOS__LOG__LEVEL__INFO:
        return FOXGLOVE__LOG__LEVEL__INFO;
    case ANLOS__LOG__LEVEL__WARNING:
        return FOXGLOVE__LOG__LEVEL__WARNING;
    case ANLOS__LOG__LEVEL__ERROR:
        return FOXGLOVE__LOG__LEVEL__ERROR;
    default:
        return FOXGLOVE__LOG__LEVEL__UNKNOWN;
    }
}

/* The text, and what the sender says of lines that it did not send. */
static char *text_of(struct arena *a, const Anlos__Log *l)
{
    const char *ago = l->repeats_ago_s >= 1.0
                          ? arena_print(a, ", last %.0f s ago", l->repeats_ago_s)
                          : "";
    const char *repeats = l->repeats
                              ? arena_print(a, " (%" PRIu64 " times more in %.0f s%s)",
                                            l->repeats, l->repeats_s, ago)
                              : "";
    const char *left_out =
        l->left_out
            ? arena_print(a, " (%" PRIu64 " lines before it are left out)", l->left_out)
            : "";
    size_t size = strlen(l->text) + strlen(repeats) + strlen(left_out) + 1;
    char *text = arena_array(a, size, 1);

    if (text)
        strcat(strcat(strcpy(text, l->text), repeats), left_out);
    return text;
}

int convert_log(struct arena *a, const struct setting *s,
                const struct foxglove_message *m, ProtobufCMessage **out)
{
    const Anlos__Log *l = (const Anlos__Log *)m->content;
    Foxglove__Log *log = arena_one(a, sizeof *log);

    (void)s;
    foxglove__log__init(log);
    log->timestamp = part_time(a, l->stamp_ns ? l->stamp_ns : m->publish_ns);
    log->level = level_of(l->level);
    log->message = text_of(a, l);
    log->name = l->node;
    *out = &log->base;
    return a->failed ? -ENOMEM : 0;
}
