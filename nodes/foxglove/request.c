/* SPDX-License-Identifier: MIT */
#include "nodes/foxglove/request.h"

#include <arpa/inet.h>
#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "nodes/foxglove/channels.h"
#include "nodes/rt/json_whole.h"

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
                   struct error *why)
{
    const json_t *id = key ? json_object_get(o, key) : o;

    if (!json_is_integer(id) || json_integer_value(id) < 0 ||
        json_integer_value(id) > (json_int_t)UINT32_MAX)
        return error_say(why, -EINVAL, "%s: %s has to be a whole number, 0 to 4294967295",
                         operation, key ? key : "a subscription's id");
    *out = (uint32_t)json_integer_value(id);
    return 0;
}

static int take_wish(const json_t *item, struct foxglove_request *r, struct error *why)
{
    struct foxglove_wish *w = &r->wishes[r->n];

    if (r->operation == FOXGLOVE_UNSUBSCRIBE)
        return take_id(item, "unsubscribe", NULL, &w->subscription, why);
    int err = take_id(item, "subscribe", "id", &w->subscription, why);
    return err ? err : take_id(item, "subscribe", "channelId", &w->channel, why);
}

static int take_wishes(const json_t *o, const char *key, struct foxglove_request *r,
                       struct error *why)
{
    const json_t *list = json_object_get(o, key);
    size_t n = json_array_size(list);

    if (!json_is_array(list))
        return error_say(why, -EINVAL, "%s has to be an array", key);
    if (n > FOXGLOVE_REQUEST_MAX_WISHES)
        return error_say(why, -EFBIG, "%s: %zu at once, and no more than %d are taken",
                         key, n, FOXGLOVE_REQUEST_MAX_WISHES);
    r->wishes = calloc(n ? n : 1, sizeof *r->wishes);
    if (!r->wishes)
        return error_say(why, -ENOMEM, "out of memory");
    for (; r->n < n; r->n++) {
        int err = take_wish(json_array_get(list, r->n), r, why);
        if (err)
            return err;
    }
    return 0;
}

static int take_operation(const json_t *o, struct foxglove_request *r, struct error *why)
{
    const char *op = json_string_value(json_object_get(o, "op"));
    char shown[SHOWN + 1];

    if (!op)
        return error_say(why, -EINVAL,
                         "a request has to be an object with a text \"op\"");
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
            return error_say(why, -ENOTSUP, "%s: this server has no such capability", op);
    return error_say(why, -EINVAL, "%s: no such operation", shown);
}

static int parse_text(const char *data, size_t size, struct foxglove_request *out,
                      struct error *why)
{
    json_error_t error;
    json_t *o = json_loadb(data, size, JSON_REJECT_DUPLICATES, &error);

    if (!o)
        return error_say(why, -EINVAL, "not JSON, from byte %d on", error.position);
    int err = take_operation(o, out, why);
    json_decref(o);
    if (err)
        foxglove_request_clear(out);
    return err;
}

static int parse_binary(const uint8_t *data, size_t size, struct error *why)
{
    if (size && data[0] > 0 && data[0] <= 2)
        return error_say(why, -ENOTSUP, "%s: this server has no such capability",
                         binary_operations[data[0]]);
    return error_say(why, -EINVAL, "a binary message that is %s",
                     size ? "no operation of the protocol" : "empty");
}

int foxglove_request_parse(const void *data, size_t size, bool binary,
                           struct foxglove_request *out, struct error *why)
{
    *out = (struct foxglove_request){.n = 0};
    if (size > FOXGLOVE_REQUEST_MAX_SIZE)
        return error_say(why, -EFBIG,
                         "a request of %zu bytes; no more than %zu are taken", size,
                         FOXGLOVE_REQUEST_MAX_SIZE);
    return binary ? parse_binary(data, size, why) : parse_text(data, size, out, why);
}

void foxglove_request_clear(struct foxglove_request *r)
{
    free(r->wishes);
    *r = (struct foxglove_request){.n = 0};
}

/* RFC 4648. */
static char *base64(struct bytes from)
{
    static const char digits[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    char *out = malloc((from.size + 2) / 3 * 4 + 1), *at = out;

    for (size_t i = 0; out && i < from.size; i += 3) {
        size_t n = from.size - i < 3 ? from.size - i : 3;
        uint32_t group = (uint32_t)from.data[i] << 16;
        group |= n > 1 ? (uint32_t)from.data[i + 1] << 8 : 0;
        group |= n > 2 ? from.data[i + 2] : 0;
        *at++ = digits[group >> 18];
        *at++ = digits[group >> 12 & 63];
        *at++ = n > 1 ? digits[group >> 6 & 63] : '=';
        *at++ = n > 2 ? digits[group & 63] : '=';
    }
    if (out)
        *at = '\0';
    return out;
}

static struct blob *print(json_t *o)
{
    char *text = json_whole(o) ? json_dumps(o, JSON_COMPACT) : NULL;

    json_decref(o);
    return blob_create((uint8_t *)text, text ? strlen(text) : 0);
}

struct blob *reply_server_info(const char *name, int64_t session_ns)
{
    char session[24];

    snprintf(session, sizeof session, "%" PRId64, session_ns);
    return print(json_pack("{ss, ss, s[s], s[s], s{ss}, ss}", "op", "serverInfo", "name",
                           name, "capabilities", "time", "supportedEncodings", "protobuf",
                           "metadata", "version", ANLOS_VERSION, "sessionId", session));
}

static json_t *channel_json(size_t index)
{
    struct channel c;

    channel_get(index, &c);
    char *schema = base64(c.schema.data);
    json_t *o = !schema ? NULL
                        : json_pack("{sI, ss, ss, ss%, ss, ss}", "id", (json_int_t)index,
                                    "topic", c.name, "encoding", "protobuf", "schemaName",
                                    c.schema.name.data, c.schema.name.size, "schema",
                                    schema, "schemaEncoding", "protobuf");
    free(schema);
    return o;
}

struct blob *reply_advertise(const bool *named)
{
    json_t *list = json_array();

    for (size_t i = 0; list && i < channels_count(); i++) {
        if (named[i] && json_array_append_new(list, channel_json(i))) {
            json_decref(list);
            list = NULL;
        }
    }
    return print(list ? json_pack("{ss, so}", "op", "advertise", "channels", list)
                      : NULL);
}

struct blob *reply_status(enum reply_level level, const char *text)
{
    return print(
        json_pack("{ss, si, ss}", "op", "status", "level", (int)level, "message", text));
}

static void put(uint8_t *out, uint64_t value, size_t n_bytes)
{
    for (size_t i = 0; i < n_bytes; i++)
        out[i] = (uint8_t)(value >> 8 * i);
}

void reply_message_head(uint8_t out[REPLY_MESSAGE_HEAD], uint32_t subscription,
                        int64_t t_ns)
{
    out[0] = 1;
    put(out + 1, subscription, 4);
    put(out + 5, (uint64_t)t_ns, 8);
}

void reply_time(uint8_t out[REPLY_TIME_SIZE], int64_t t_ns)
{
    out[0] = 2;
    put(out + 1, (uint64_t)t_ns, 8);
}

#define HOST_SIZE 256

/* The host of "host:port", without the port and an address's brackets.  false: it is
 * none. */
static bool take_host(const char *from, char out[HOST_SIZE])
{
    bool bracket = *from == '[';
    size_t n = strcspn(from + bracket, bracket ? "]" : ":/");

    if (!n || n >= HOST_SIZE)
        return false;
    memcpy(out, from + bracket, n);
    out[n] = '\0';
    return true;
}

static bool is_address(const char *host)
{
    unsigned char address[sizeof(struct in6_addr)];

    return inet_pton(AF_INET, host, address) == 1 ||
           inet_pton(AF_INET6, host, address) == 1;
}

static bool is_here(const char *host)
{
    struct in_addr address;

    if (!strcasecmp(host, "localhost") || !strcmp(host, "::1"))
        return true;
    return inet_pton(AF_INET, host, &address) == 1 && ntohl(address.s_addr) >> 24 == 127;
}

static bool is_foxglove(const char *host)
{
    static const char domain[] = ".foxglove.dev";
    size_t n = strlen(host), m = sizeof domain - 1;

    return n > m && !strcasecmp(host + n - m, domain);
}

bool origin_is_allowed(const char *origin, const char *host)
{
    char page[HOST_SIZE], asked[HOST_SIZE];

    if (!origin || !strcmp(origin, "file://"))
        return true;
    const char *rest = strstr(origin, "://");
    if (!rest || !take_host(rest + 3, page))
        return false;
    if (is_here(page))
        return true;
    if (is_foxglove(page))
        return !strncasecmp(origin, "https://", 8);
    return host && take_host(host, asked) && is_address(page) && !strcmp(page, asked);
}
