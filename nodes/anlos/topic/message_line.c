#include "nodes/anlos/topic/message_line.h"

#include <errno.h>
#include <jansson.h>
#include <string.h>

#include "nodes/anlos/topic/message_json.h"

/* Null: not UTF-8. */
static json_t *text_json(const char *text, size_t n)
{
    json_t *j = json_stringn(n ? text : "", n);

    return j ? j : json_null();
}

int message_line_write(const struct message_line *l, bool full, FILE *f)
{
    const struct envelope *e = l->envelope;
    json_t *o = json_pack(
        "{so, so, sI, sI, sI, sI}", "topic", text_json(l->topic, l->n_topic), "from",
        text_json(e->node, strlen(e->node)), "sequence", (json_int_t)e->sequence,
        "capture_ns", (json_int_t)e->capture_ns, "publish_ns", (json_int_t)e->publish_ns,
        "bytes", (json_int_t)l->n_bytes);

    if (e->replayed)
        json_object_set_new(o, "replayed", json_true());
    json_object_set_new(o, "content",
                        l->content ? message_json(l->content, full)
                                   : json_string(l->why_not));
    int failed = !o || json_dumpf(o, f, JSON_COMPACT | JSON_REAL_PRECISION(9));
    json_decref(o);
    putc('\n', f);
    return failed && !ferror(f) ? -ENOMEM : 0;
}
