#include "nodes/foxglove/reply.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/foxglove/channels.h"

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
    char *text = o ? json_dumps(o, JSON_COMPACT) : NULL;

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
