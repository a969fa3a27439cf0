/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/topic/field_path.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/nearest.h"
#include "msgs/tensor.pb-c.h"

enum { NAME_SIZE = 64 };

/* The next name or index of the path; *path comes to stand behind its dot, or is NULL at
 * the end.  false: empty or too long. */
static bool next_part(const char **path, char out[NAME_SIZE])
{
    size_t n = strcspn(*path, ".");

    if (!n || n >= NAME_SIZE)
        return false;
    memcpy(out, *path, n);
    out[n] = '\0';
    *path = (*path)[n] ? *path + n + 1 : NULL;
    return true;
}

static bool is_index(const char *part)
{
    return part[strspn(part, "0123456789")] == '\0';
}

static int no_field(const char *part, const ProtobufCMessageDescriptor *d,
                    struct error *why)
{
    struct nearest s = nearest_begin(part, strlen(part), 3);

    for (unsigned i = 0; i < d->n_fields; i++)
        nearest_try(&s, d->fields[i].name);
    return error_say(why, -EINVAL, "%s: %s has no such field%s%s%s", part, d->name,
                     s.best ? "; did you mean " : "", s.best ? s.best : "",
                     s.best ? "?" : "");
}

int field_path_check(const char *path, const ProtobufCMessageDescriptor *schema,
                     struct error *why)
{
    const ProtobufCMessageDescriptor *d = schema;
    bool list = false;
    char part[NAME_SIZE];

    while (path) {
        if (!next_part(&path, part))
            return error_say(why, -EINVAL, "expected names of fields with dots between");
        if (list && is_index(part)) {
            list = false;
            continue;
        }
        if (!d)
            return error_say(why, -EINVAL, "%s: there are no fields in what is before it",
                             part);
        const ProtobufCFieldDescriptor *f =
            protobuf_c_message_descriptor_get_field_by_name(d, part);
        if (!f && d == &anlos__tensor__descriptor && !path &&
            (!strcmp(part, "min") || !strcmp(part, "max"))) /* message_json's own */
            return 0;
        if (!f)
            return no_field(part, d, why);
        list = f->label == PROTOBUF_C_LABEL_REPEATED;
        d = f->type == PROTOBUF_C_TYPE_MESSAGE ? f->descriptor : NULL;
    }
    return 0;
}

json_t *field_path_pick(const char *path, json_t *content)
{
    const char *rest = path;
    char part[NAME_SIZE];

    if (!path)
        return json_incref(content);
    if (!json_is_array(content)) {
        json_t *v = next_part(&rest, part) ? json_object_get(content, part) : NULL;
        return v ? field_path_pick(rest, v) : json_null();
    }
    if (next_part(&rest, part) && is_index(part)) {
        json_t *v = json_array_get(content, strtoul(part, NULL, 10));
        return v ? field_path_pick(rest, v) : json_null();
    }
    json_t *each = json_array();
    for (size_t i = 0; each && i < json_array_size(content); i++)
        json_array_append_new(each, field_path_pick(path, json_array_get(content, i)));
    return each;
}
