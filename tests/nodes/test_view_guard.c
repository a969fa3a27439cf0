/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include <errno.h>
#include <string.h>

#include "nodes/view/server.h"

static void addresses_are_hosts_and_names_are_not(void **state)
{
    static const char *const good[] = {"127.0.0.1",     "127.0.0.1:8765", "localhost",
                                       "LOCALHOST:1",   "[::1]",          "[::1]:8765",
                                       "192.168.1.7:80"};
    static const char *const bad[] = {"",
                                      ":8765",
                                      "evil.example",
                                      "127.0.0.1.evil.example",
                                      "::1",
                                      "[::1",
                                      "[::1]x",
                                      "127.0.0.1:80:80",
                                      "127.0.0.1:x",
                                      "localhost.evil",
                                      "[127.0.0.1]:1",
                                      "127.0.0.1:8765@evil.example"};
    char longest[400];

    (void)state;
    for (size_t i = 0; i < sizeof good / sizeof *good; i++)
        assert_true(guard_host(good[i], "127.0.0.1"));
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_false(guard_host(bad[i], "127.0.0.1"));
    memset(longest, '1', sizeof longest);
    longest[sizeof longest - 1] = '\0';
    assert_false(guard_host(longest, "127.0.0.1"));
    assert_false(guard_host(NULL, "127.0.0.1"));
}

static void an_origin_has_to_be_the_page_s_own(void **state)
{
    (void)state;
    assert_true(guard_origin(NULL, "127.0.0.1:8765"));
    assert_true(guard_origin("http://127.0.0.1:8765", "127.0.0.1:8765"));
    assert_true(guard_origin("HTTP://LocalHost", "localhost"));
    assert_false(guard_origin("http://127.0.0.1:8766", "127.0.0.1:8765"));
    assert_false(guard_origin("http://127.0.0.1", "127.0.0.1:8765"));
    assert_false(guard_origin("https://127.0.0.1:8765", "127.0.0.1:8765"));
    assert_false(guard_origin("http://localhost:8765", "127.0.0.1:8765"));
    assert_false(guard_origin("null", "127.0.0.1:8765"));
    assert_false(guard_origin("", "127.0.0.1:8765"));
    assert_false(guard_origin("http://127.0.0.1:8765", NULL));
}

static int parse(struct request *r, const char *text)
{
    return request_parse(r, text, strlen(text));
}

static void a_request_asks_for_one_thing(void **state)
{
    static const char *const bad[] = {"",
                                      "null",
                                      "[]",
                                      "{}",
                                      "3",
                                      "{\"slice\": 1.5}",
                                      "{\"slice\": -1}",
                                      "{\"slice\": null}",
                                      "{\"seek\": \"1\"}",
                                      "{\"seek\": 1, \"slice\": 2}",
                                      "{\"slice\": 1, \"slice\": 2}",
                                      "{\"slice\": 1}x",
                                      "{\"save\": false}",
                                      "{\"save\": 1}",
                                      "{\"save\": true, \"seek\": 1}",
                                      "{\"slice\": 100000000}",
                                      "{\"mark\": 1, \"name\": \"\"}",
                                      "{\"mark\": 1, \"name\": 2}",
                                      "{\"mark\": 1, \"name\": \"a\\u0000b\"}",
                                      "{\"mark\": 1, \"nome\": \"a\"}",
                                      "{\"mark\": 1, \"name\": \"a\", \"seek\": 1}",
                                      "{\"mark\": \"a\"}",
                                      "{\"mark\": 1e999}",
                                      "{\"seek\": 1e999}"};
    struct request r;
    char large[REQUEST_MAX_SIZE + 1];

    (void)state;
    assert_int_equal(parse(&r, "{\"slice\": 17}"), 0);
    assert_int_equal(r.kind, REQUEST_SLICE);
    assert_int_equal(r.slice, 17);
    assert_int_equal(parse(&r, "{\"seek\":2.5}"), 0);
    assert_int_equal(r.kind, REQUEST_SEEK);
    assert_true(r.seek_s == 2.5);
    assert_int_equal(parse(&r, "{\"seek\":-3}"), 0); /* the start */
    assert_int_equal(parse(&r, "{\"save\": true}"), 0);
    assert_int_equal(r.kind, REQUEST_SAVE);
    assert_int_equal(parse(&r, "{\"mark\": 12.5, \"name\": \"B\\u00e4r\"}"), 0);
    assert_int_equal(r.kind, REQUEST_MARK);
    assert_true(r.mark_s == 12.5);
    assert_string_equal(r.name, "B\xc3\xa4r");
    assert_int_equal(parse(&r, "{\"mark\": 3}"), 0);
    assert_string_equal(r.name, "");
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_int_equal(parse(&r, bad[i]), -EINVAL);
    memset(large, ' ', sizeof large);
    memcpy(large, "{\"slice\": 1}", 12);
    assert_int_equal(request_parse(&r, large, REQUEST_MAX_SIZE), 0);
    assert_int_equal(request_parse(&r, large, REQUEST_MAX_SIZE + 1), -EMSGSIZE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(addresses_are_hosts_and_names_are_not),
        cmocka_unit_test(an_origin_has_to_be_the_page_s_own),
        cmocka_unit_test(a_request_asks_for_one_thing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
