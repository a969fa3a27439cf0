#include "nodes/foxglove/request.h"

#include <errno.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#define SHOWN 40 /* characters of a foreign word */

static const char *const unsupported[] = {
    "advertise",
    "unadvertise",
    "getParameters",
    "setParameters",
    "subscribeParameterUpdates",
    "unsubscribeParameterUpdates",
    "subscribeConnectionGraph",
    "unsubscribeConnectionGraph",
    "fetchAsset",
};

static const char *const binary_operations[] = {"", "a message of a client",
                                                "a service call"};

/* A foreign word, made fit to be shown. */
static void show(char out[SHOWN + 1], const char *word)
{
    size_t n = 0;

    for (; word[n] && n < SHOWN; n++)
        out[n] = word[n] >= ' ' && word[n] <= '~' ? word[n] : '?';
    out[n] = '\0';
}

static int take_id(const json_t *o, const char *operation, const char *key, uint32_t *out,
                   struct complaint *why)
{
    const json_t *id = key ? json_object_get(o, key) : o;

    if (!json_is_integer(id) || json_integer_value(id) < 0 ||
        json_integer_value(id) > (json_int_t)UINT32_MAX)
        return complain(why, -EINVAL, "%s: %s has to be a whole number, 0 to 4294967295",
                        operation, key ? key : "a subscription's id");
    *out = (uint32_t)json_integer_value(id);
    return 0;
}

static int take_wish(const json_t *item, struct foxglove_request *r,
                     struct complaint *why)
{
    struct foxglove_wish *w = &r->wishes[r->n];

    if (r->operation == FOXGLOVE_UNSUBSCRIBE)
        return take_id(item, "unsubscribe", NULL, &w->subscription, why);
    int err = take_id(item, "subscribe", "id", &w->subscription, why);
    return err ? err : take_id(item, "subscribe", "channelId", &w->channel, why);
}

static int take_wishes(const json_t *o, const char *key, struct foxglove_request *r,
                       struct complaint *why)
{
    const json_t *list = json_object_get(o, key);
    size_t n = json_array_size(list);

    if (!json_is_array(list))
        return complain(why, -EINVAL, "%s has to be an array", key);
    if (n > FOXGLOVE_REQUEST_MAX_WISHES)
        return complain(why, -EFBIG, "%s: %zu at once, and no more than %d are taken",
                        key, n, FOXGLOVE_REQUEST_MAX_WISHES);
    r->wishes = calloc(n ? n : 1, sizeof *r->wishes);
    if (!r->wishes)
        return complain(why, -ENOMEM, "out of memory");
    for (; r->n < n; r->n++) {
        int err = take_wish(json_array_get(list, r->n), r, why);
        if (err)
            return err;
    }
    return 0;
}

static int take_operation(const json_t *o, struct foxglove_request *r,
                          struct complaint *why)
{
    const char *op = json_string_value(json_object_get(o, "op"));
    char shown[SHOWN + 1];

    if (!op)
        return complain(why, -EINVAL, "a request has to be an object with a text \"op\"");
    if (!strcmp(op, "subscribe")) {
        r->operation = FOXGLOVE_SUBSCRIBE;
        return take_wishes(o, "subscriptions", r, why);
    }
    if (!strcmp(op, "unsubscribe")) {
        r->operation = FOXGLOVE_UNSUBSCRIBE;
        return take_wishes(o, "subscriptionIds", r, why);
    }
    show(shown, op);
    for (size_t i = 0; i < sizeof unsupported / sizeof *unsupported; i++)
        if (!strcmp(op, unsupported[i]))
            return complain(why, -ENOTSUP, "%s: this server has no such capability", op);
    return complain(why, -EINVAL, "%s: no such operation", shown);
}

static int parse_text(const char *data, size_t size, struct foxglove_request *out,
                      struct complaint *why)
{
    json_error_t error;
    json_t *o = json_loadb(data, size, JSON_REJECT_DUPLICATES, &error);

    if (!o)
        return complain(why, -EINVAL, "not JSON, from byte %d on", error.position);
    int err = take_operation(o, out, why);
    json_decref(o);
    if (err)
        foxglove_request_clear(out);
    return err;
}

static int parse_binary(const uint8_t *data, size_t size, struct complaint *why)
{
    if (size && data[0] > 0 && data[0] <= 2)
        return complain(why, -ENOTSUP, "%s: this server has no such capability",
                        binary_operations[data[0]]);
    return complain(why, -EINVAL, "a binary message that is %s",
                    size ? "no operation of the protocol" : "empty");
}

int foxglove_request_parse(const void *data, size_t size, bool binary,
                           struct foxglove_request *out, struct complaint *why)
{
    *out = (struct foxglove_request){.n = 0};
    if (size > FOXGLOVE_REQUEST_MAX_SIZE)
        return complain(why, -EFBIG, "a request of %zu bytes; no more than %zu are taken",
                        size, FOXGLOVE_REQUEST_MAX_SIZE);
    return binary ? parse_binary(data, size, why) : parse_text(data, size, out, why);
}

void foxglove_request_clear(struct foxglove_request *r)
{
    free(r->wishes);
    *r = (struct foxglove_request){.n = 0};
}
