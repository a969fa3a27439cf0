#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/bag/export.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/anlos/topic/message_json.h"

static json_t *text_json(struct bytes text)
{
    json_t *j = json_stringn(text.size ? (const char *)text.data : "", text.size);

    return j ? j : json_null();
}

/* As `anlos topic echo` has it.  0, -ENOMEM; what cannot be written shows in f. */
static int write_line(FILE *f, const struct stream_message *m, bool full)
{
    ProtobufCMessage *content = stream_unpack(m);
    json_t *o =
        json_pack("{so, so, sI, sI, sI, sI, so}", "topic", text_json(m->channel->topic),
                  "from", text_json(bytes_of(m->envelope.node)), "sequence",
                  (json_int_t)m->envelope.sequence, "capture_ns",
                  (json_int_t)m->envelope.capture_ns, "publish_ns",
                  (json_int_t)m->envelope.publish_ns, "bytes",
                  (json_int_t)m->payload.size, "content",
                  content ? message_json(content, full)
                          : json_string(m->topic ? "not a message of the topic's schema"
                                                 : "not a topic of anlos"));
    if (content)
        protobuf_c_message_free_unpacked(content, NULL);
    int failed = !o ||
                 (json_dumpf(o, f, JSON_COMPACT | JSON_REAL_PRECISION(9)) && !ferror(f));
    fputc('\n', f);
    json_decref(o);
    return failed ? -ENOMEM : 0;
}

struct lines {
    struct stream *stream;
    const struct export_options *options;
    uint64_t n;
};

static int write_lines(FILE *f, void *context, struct complaint *why)
{
    struct lines *l = context;
    struct stream_message m;
    int err;

    while (!(err = stream_next(l->stream, &m, why)) && !ferror(f)) {
        if (write_line(f, &m, l->options->full))
            return complain(why, -ENOMEM, "out of memory");
        l->n++;
    }
    return err == -ENODATA ? 0 : err;
}

int export_lines(struct stream *s, const struct export_options *o, struct complaint *why)
{
    struct lines l = {s, o, 0};
    int err = verb_write_file(o->out, write_lines, &l, why);

    if (!err && strcmp(o->out, "-"))
        printf("%s: %" PRIu64 " messages\n", o->out, l.n);
    return err;
}
