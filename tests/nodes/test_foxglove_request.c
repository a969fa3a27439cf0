/* SPDX-License-Identifier: MIT */
/* What a client may ask for, and which page may connect. */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/foxglove/request.h"

static struct foxglove_request request;
static struct error why;

static int parse(const char *text)
{
    why.text[0] = '\0';
    return foxglove_request_parse(text, strlen(text), false, &request, &why);
}

static void assert_fit_to_show(void)
{
    assert_true(why.text[0]);
    for (const char *c = why.text; *c; c++)
        assert_in_range(*c, ' ', '~');
}

static void subscriptions_are_taken_in_their_order(void **state)
{
    (void)state;
    assert_int_equal(parse("{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":0,"
                           "\"channelId\":3},{\"channelId\":5,\"id\":4294967295}]}"),
                     0);
    assert_int_equal(request.operation, FOXGLOVE_SUBSCRIBE);
    assert_int_equal(request.n, 2);
    assert_int_equal(request.wishes[0].subscription, 0);
    assert_int_equal(request.wishes[0].channel, 3);
    assert_int_equal(request.wishes[1].subscription, 4294967295);
    assert_int_equal(request.wishes[1].channel, 5);
    foxglove_request_clear(&request);
    assert_int_equal(parse("{\"op\":\"unsubscribe\",\"subscriptionIds\":[7]}"), 0);
    assert_int_equal(request.operation, FOXGLOVE_UNSUBSCRIBE);
    assert_int_equal(request.n, 1);
    assert_int_equal(request.wishes[0].subscription, 7);
    foxglove_request_clear(&request);
}

static void nothing_at_all_may_be_subscribed_to(void **state)
{
    (void)state;
    assert_int_equal(parse("{\"op\":\"subscribe\",\"subscriptions\":[]}"), 0);
    assert_int_equal(request.n, 0);
    foxglove_request_clear(&request);
}

static void what_is_no_request_is_refused_with_a_reason(void **state)
{
    static const char *const texts[] = {
        "",
        "{",
        "[]",
        "3",
        "{}",
        "null",
        "\"subscribe\"",
        "{\"op\":3}",
        "{\"op\":\"\"}",
        "{\"op\":\"dance\\u0007\\u00e4\"}",
        "{\"op\":\"subscribe\"}",
        "{\"op\":\"subscribe\",\"op\":\"subscribe\",\"subscriptions\":[]}",
        "{\"op\":\"subscribe\",\"subscriptions\":{}}",
        "{\"op\":\"subscribe\",\"subscriptions\":[3]}",
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1}]}",
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":-1,\"channelId\":1}]}",
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1.5,\"channelId\":1}]}",
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1,\"channelId\":4294967296}]}",
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1,\"channelId\":1e300}]}",
        "{\"op\":\"unsubscribe\",\"subscriptionIds\":[9223372036854775808]}",
        "{\"op\":\"unsubscribe\",\"subscriptionIds\":[\"1\"]}",
        "{\"op\":\"unsubscribe\",\"subscriptionIds\":[[1]]}",
        "{\"op\":\"subscribe\",\"subscriptions\":[]} x",
        "\xff\xfe",
    };

    (void)state;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        assert_int_equal(parse(texts[i]), -EINVAL);
        assert_fit_to_show();
        assert_null(request.wishes);
    }
}

static void what_the_server_does_not_offer_is_named(void **state)
{
    static const char *const operations[] = {"advertise", "getParameters", "fetchAsset",
                                             "subscribeConnectionGraph"};
    char text[64];

    (void)state;
    for (size_t i = 0; i < 4; i++) {
        snprintf(text, sizeof text, "{\"op\":\"%s\"}", operations[i]);
        assert_int_equal(parse(text), -ENOTSUP);
        assert_non_null(strstr(why.text, operations[i]));
    }
    assert_int_equal(foxglove_request_parse("\1abcd", 5, true, &request, &why), -ENOTSUP);
    assert_int_equal(foxglove_request_parse("\2", 1, true, &request, &why), -ENOTSUP);
    assert_int_equal(foxglove_request_parse("\3", 1, true, &request, &why), -EINVAL);
    assert_int_equal(foxglove_request_parse("\0", 1, true, &request, &why), -EINVAL);
    assert_int_equal(foxglove_request_parse("", 0, true, &request, &why), -EINVAL);
}

static void a_request_is_bounded_in_size_number_and_depth(void **state)
{
    size_t size = FOXGLOVE_REQUEST_MAX_SIZE + 1;
    char *text = malloc(size + 1);

    (void)state;
    assert_non_null(text);
    memset(text, ' ', size);
    assert_int_equal(foxglove_request_parse(text, size, false, &request, &why), -EFBIG);
    memset(text, '[', size - 1);
    assert_int_equal(foxglove_request_parse(text, size - 1, false, &request, &why),
                     -EINVAL);
    int n = snprintf(text, size, "{\"op\":\"unsubscribe\",\"subscriptionIds\":[0");
    for (int i = 0; i < FOXGLOVE_REQUEST_MAX_WISHES; i++)
        n += snprintf(text + n, size - (size_t)n, ",1");
    snprintf(text + n, size - (size_t)n, "]}");
    assert_int_equal(parse(text), -EFBIG);
    assert_fit_to_show();
    free(text);
}

/* Of a request that is sound: cut anywhere, it is none; changed anywhere, it may be. */
static void no_damage_does_harm(void **state)
{
    static const char sound[] =
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1,\"channelId\":2}]}";
    char text[sizeof sound];

    (void)state;
    for (size_t n = 0; n < sizeof sound - 1; n++)
        assert_int_equal(foxglove_request_parse(sound, n, false, &request, &why),
                         -EINVAL);
    for (size_t i = 0; i < sizeof sound - 1; i++) {
        for (int c = 0; c < 256; c++) {
            memcpy(text, sound, sizeof sound);
            text[i] = (char)c;
            if (!foxglove_request_parse(text, sizeof sound - 1, false, &request, &why))
                foxglove_request_clear(&request);
            assert_null(request.wishes);
        }
    }
}

static void only_known_pages_may_connect(void **state)
{
    static const struct {
        const char *origin, *host;
        bool allowed;
    } cases[] = {
        {NULL, "127.0.0.1:8765", true},
        {"http://localhost:8080", "localhost:8765", true},
        {"http://127.0.0.1:8765", "127.0.0.1:8765", true},
        {"http://[::1]:8765", "[::1]:8765", true},
        {"http://127.3.2.1", NULL, true},
        {"https://app.foxglove.dev", "localhost:8765", true},
        {"https://app.foxglove.dev", "192.168.0.7:8765", true},
        {"file://", "localhost:8765", true},
        {"http://192.168.0.7:8765", "192.168.0.7:8765", true},
        {"http://[fe80::7]:8765", "[fe80::7]:8765", true},
        {"http://192.168.0.8:8765", "192.168.0.7:8765", false},
        {"http://app.foxglove.dev", "localhost:8765", false},
        {"https://foxglove.dev.evil.com", "localhost:8765", false},
        {"https://evilfoxglove.dev", "localhost:8765", false},
        {"https://localhost.evil.com", "localhost:8765", false},
        {"http://127.0.0.1.evil.com", "127.0.0.1.evil.com", false},
        {"http://evil.com:8765", "evil.com:8765", false}, /* a name made to point here */
        {"null", "localhost:8765", false},
        {"", "localhost:8765", false},
        {"http://", "localhost:8765", false},
        {"http://[", "[", false},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_int_equal(origin_is_allowed(cases[i].origin, cases[i].host),
                         cases[i].allowed);
}

static void replies_are_laid_out_as_the_protocol_says(void **state)
{
    static const uint8_t message[] = {1, 0xd4, 0xc3, 0xb2, 0xa1, 8, 7, 6, 5, 4, 3, 2, 1},
                         time[] = {2, 8, 7, 6, 5, 4, 3, 2, 1};
    uint8_t out[REPLY_MESSAGE_HEAD];
    struct blob *status = reply_status(REPLY_WARNING, "a \"word\"");

    (void)state;
    reply_message_head(out, 0xa1b2c3d4, 0x0102030405060708);
    assert_memory_equal(out, message, sizeof message);
    reply_time(out, 0x0102030405060708);
    assert_memory_equal(out, time, sizeof time);
    assert_non_null(status);
    static const char text[] =
        "{\"op\":\"status\",\"level\":1,\"message\":\"a \\\"word\\\"\"}";
    assert_int_equal(status->size, sizeof text - 1);
    assert_memory_equal(status->data, text, sizeof text - 1);
    blob_release(status);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(subscriptions_are_taken_in_their_order),
        cmocka_unit_test(nothing_at_all_may_be_subscribed_to),
        cmocka_unit_test(what_is_no_request_is_refused_with_a_reason),
        cmocka_unit_test(what_the_server_does_not_offer_is_named),
        cmocka_unit_test(a_request_is_bounded_in_size_number_and_depth),
        cmocka_unit_test(no_damage_does_harm),
        cmocka_unit_test(only_known_pages_may_connect),
        cmocka_unit_test(replies_are_laid_out_as_the_protocol_says),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
