/* SPDX-License-Identifier: MIT */
/* tests/nodes/foxglove_socket.h -- a WebSocket client that does what it is told, also
 * what no library would.  Include after cmocka.h. */
#ifndef ANLOS_TESTS_NODES_FOXGLOVE_SOCKET_H
#define ANLOS_TESTS_NODES_FOXGLOVE_SOCKET_H

#include <arpa/inet.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define SOCKET_DEADLINE_S 60
#define SOCKET_MAX_FRAME  ((size_t)1 << 22)

enum { OP_CONTINUATION, OP_TEXT, OP_BINARY, OP_CLOSE = 8, OP_PING, OP_PONG };

struct socket_frame {
    int op;
    size_t size;
    uint8_t *data; /* [size] and a zero, of the caller's */
};

static inline int socket_open(int port)
{
    const struct sockaddr_in to = {.sin_family = AF_INET,
                                   .sin_port = htons((uint16_t)port),
                                   .sin_addr = {htonl(INADDR_LOOPBACK)}};
    const struct timeval deadline = {.tv_sec = SOCKET_DEADLINE_S};
    int fd = socket(AF_INET, SOCK_STREAM, 0);

    assert_true(fd >= 0);
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &deadline, sizeof deadline);
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &deadline, sizeof deadline);
    assert_int_equal(connect(fd, (const struct sockaddr *)&to, sizeof to), 0);
    return fd;
}

static inline void socket_write(int fd, const void *data, size_t size)
{
    const uint8_t *at = data;

    while (size) {
        ssize_t n = send(fd, at, size, MSG_NOSIGNAL);
        assert_true(n > 0);
        at += n;
        size -= (size_t)n;
    }
}

/* false: the other side has hung up. */
static inline bool socket_read(int fd, void *data, size_t size)
{
    uint8_t *at = data;

    while (size) {
        ssize_t n = recv(fd, at, size, 0);
        if (n == 0)
            return false;
        assert_true(n > 0); /* else the deadline has passed */
        at += n;
        size -= (size_t)n;
    }
    return true;
}

/* The HTTP status of a handshake with these lines more. */
static inline int socket_shake(int fd, const char *lines)
{
    char text[1024], c = 0;
    size_t n = 0;
    int status = 0;

    snprintf(text, sizeof text,
             "GET / HTTP/1.1\r\nHost: 127.0.0.1:8765\r\nUpgrade: websocket\r\n"
             "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
             "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n%s\r\n",
             lines);
    socket_write(fd, text, strlen(text));
    memset(text, 0, sizeof text);
    while (n < sizeof text - 1 && !strstr(text, "\r\n\r\n") && socket_read(fd, &c, 1))
        text[n++] = c;
    assert_int_equal(sscanf(text, "HTTP/1.1 %d", &status), 1);
    return status;
}

/* A masked frame, as clients have to send them. */
static inline void socket_frame(int fd, int op, bool last, const void *data, size_t size)
{
    static const uint8_t mask[4] = {0x12, 0x34, 0x56, 0x78};
    uint8_t head[14] = {(uint8_t)((last ? 0x80 : 0) | op)}, *masked = malloc(size + 1);
    size_t n = 2;

    assert_non_null(masked);
    head[1] = 0x80 | (uint8_t)(size < 126 ? size : size < 65536 ? 126 : 127);
    if (size >= 126)
        for (int i = size < 65536 ? 1 : 7; i >= 0; i--)
            head[n++] = (uint8_t)((uint64_t)size >> 8 * i);
    memcpy(head + n, mask, 4);
    for (size_t i = 0; i < size; i++)
        masked[i] = ((const uint8_t *)data)[i] ^ mask[i % 4];
    socket_write(fd, head, n + 4);
    socket_write(fd, masked, size);
    free(masked);
}

static inline void socket_say(int fd, const char *text)
{
    socket_frame(fd, OP_TEXT, true, text, strlen(text));
}

/* Of the next frame, the head; its size.  false: the other side has hung up. */
static inline bool socket_head(int fd, int *op, bool *last, size_t *size)
{
    uint8_t head[8];
    uint64_t n;

    if (!socket_read(fd, head, 2))
        return false;
    *op = head[0] & 15;
    *last = head[0] & 0x80;
    n = head[1] & 127;
    int more = n == 126 ? 2 : n == 127 ? 8 : 0;
    if (more) {
        assert_true(socket_read(fd, head, (size_t)more));
        n = 0;
        for (int i = 0; i < more; i++)
            n = n << 8 | head[i];
    }
    assert_true(n <= SOCKET_MAX_FRAME);
    *size = (size_t)n;
    return true;
}

/* The next message, of however many frames; free its data.  A close ends one that is on
 * its way; other control frames within one are ignored.  false: the other side has
 * hung up. */
static inline bool socket_next(int fd, struct socket_frame *f)
{
    bool last = false, open = true;
    size_t more;
    int op;

    *f = (struct socket_frame){.op = -1};
    while (!last && (open = socket_head(fd, &op, &last, &more))) {
        bool control = op & 8, within = f->op >= 0;
        if (control && (op == OP_CLOSE || !within)) {
            f->op = op;
            f->size = 0;
        } else if (!control) {
            assert_int_equal(op == OP_CONTINUATION, within);
            f->op = within ? f->op : op;
        }
        f->data = realloc(f->data, f->size + more + 1);
        assert_non_null(f->data);
        if (!(open = socket_read(fd, f->data + f->size, more)))
            break;
        if (control && f->op != op)
            last = false;
        else
            f->size += more;
        f->data[f->size] = 0;
    }
    if (!open) {
        free(f->data);
        f->data = NULL;
    }
    return open;
}

#endif
