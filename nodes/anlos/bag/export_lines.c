#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/bag/export.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/anlos/topic/message_line.h"

/* 0, -ENOMEM; what cannot be written shows in f. */
static int write_line(FILE *f, const struct stream_message *m, bool full)
{
    ProtobufCMessage *content = stream_unpack(m);
    const struct message_line l = {.topic = (const char *)m->channel->topic.data,
                                   .n_topic = m->channel->topic.size,
                                   .envelope = &m->envelope,
                                   .n_bytes = m->payload.size,
                                   .content = content,
                                   .why_not = m->topic
                                                  ? "not a message of the topic's schema"
                                                  : "not a topic of anlos"};
    int err = message_line_write(&l, full, f);

    if (content)
        protobuf_c_message_free_unpacked(content, NULL);
    return err;
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
