/* SPDX-License-Identifier: MIT */
/* Who comes to the web server, and who has to go. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "nodes/web/web.h"

#define PAGE_SIZE ((size_t)64 << 20) /* no socket takes that at once */
#define MORE      (3 * WEB_MAX_CLIENTS)

struct rig {
    struct web *web;
    uint8_t *page;
    char log[8192]; /* to be read after web_destroy */
};

static void give_page(void *ctx, const struct web_request *r, struct web_reply *out)
{
    struct rig *rig = ctx;

    (void)r;
    *out = (struct web_reply){.status = "200 OK",
                              .type = "application/octet-stream",
                              .data = rig->page,
                              .size = PAGE_SIZE};
}

static void take_log(void *ctx, const char *text)
{
    struct rig *rig = ctx;
    size_t n = strlen(rig->log);

    snprintf(rig->log + n, sizeof rig->log - n, "%s\n", text);
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    const struct web_config cfg = {.address = "127.0.0.1",
                                   .write_ms = 120000,
                                   .silence_s = 60,
                                   .page = give_page,
                                   .page_ctx = r,
                                   .log = take_log,
                                   .log_ctx = r};

    *state = r;
    return !r || !(r->page = calloc(1, PAGE_SIZE)) || web_create(&r->web, &cfg, NULL) ||
                   web_start(r->web, NULL)
               ? -1
               : 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    web_destroy(r->web);
    free(r->page);
    free(r);
    return 0;
}

static int open_connection(const struct rig *r)
{
    const struct timeval patience = {.tv_sec = 60};
    struct sockaddr_in at = {.sin_family = AF_INET};
    int fd = socket(AF_INET, SOCK_STREAM, 0);

    at.sin_port = htons((uint16_t)web_port(r->web));
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_true(fd >= 0);
    assert_int_equal(setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience),
                     0);
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof at), 0);
    return fd;
}

static int ask_for_page(const struct rig *r)
{
    static const char request[] = "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n";
    int fd = open_connection(r);

    assert_int_equal(send(fd, request, sizeof request - 1, MSG_NOSIGNAL),
                     sizeof request - 1);
    return fd;
}

static size_t read_all(int fd)
{
    static uint8_t data[65536];
    size_t all = 0;
    ssize_t n;

    while ((n = recv(fd, data, sizeof data, 0)) > 0)
        all += (size_t)n;
    assert_int_equal(n, 0); /* neither a reset nor a silence */
    return all;
}

/* More come than there are places, and say nothing: each takes that of one before, and
 * not that of who is being sent a page, though nobody has been there longer. */
static void who_is_sent_a_page_keeps_his_place(void **state)
{
    struct rig *r = *state;
    int fds[MORE], reader = ask_for_page(r);
    uint8_t first;

    assert_int_equal(recv(reader, &first, 1, 0), 1);
    for (int i = 0; i < MORE; i++)
        fds[i] = open_connection(r);
    /* The first of them has gone, so all that is to be decided has been. */
    assert_int_equal(recv(fds[0], &first, 1, 0), 0);
    assert_true(read_all(reader) > PAGE_SIZE);
    close(reader);
    for (int i = 0; i < MORE; i++)
        close(fds[i]);
    web_destroy(r->web);
    r->web = NULL;
    if (!strstr(r->log, "ended after") || !strstr(r->log, "others wanted its place"))
        fail_msg("it is logged: %s", r->log);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(who_is_sent_a_page_keeps_his_place, setup,
                                        teardown),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
