#include "nodes/view/request.h"

#include <errno.h>
#include <math.h>

#include <jansson.h>

#define MOST_SLICES 100000000

static int read(struct request *out, const json_t *o)
{
    const json_t *slice = json_object_get(o, "slice"), *seek = json_object_get(o, "seek");

    if (!json_is_object(o) || json_object_size(o) != 1)
        return -EINVAL;
    if (json_is_integer(slice)) {
        json_int_t k = json_integer_value(slice);
        *out = (struct request){.kind = REQUEST_SLICE, .slice = (size_t)k};
        return k >= 0 && k < MOST_SLICES ? 0 : -EINVAL;
    }
    *out = (struct request){.kind = REQUEST_SEEK, .seek_s = json_number_value(seek)};
    return json_is_number(seek) && isfinite(out->seek_s) ? 0 : -EINVAL;
}

int request_parse(struct request *out, const void *data, size_t size)
{
    if (size > REQUEST_MAX_SIZE)
        return -EMSGSIZE;
    json_t *o = json_loadb(data, size, JSON_REJECT_DUPLICATES, NULL);
    int err = o ? read(out, o) : -EINVAL;

    json_decref(o);
    return err;
}
