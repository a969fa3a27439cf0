#include "nodes/anlos/can/line.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define SECOND_NS INT64_C(1000000000)

static void skip_blanks(const char **p)
{
    while (**p == ' ' || **p == '\t')
        ++*p;
}

/* Up to n digits; how many there were. */
static int take_digits(const char **p, int n, int64_t *out)
{
    int taken = 0;

    *out = 0;
    while (taken < n && isdigit((unsigned char)**p)) {
        *out = 10 * *out + (*(*p)++ - '0');
        taken++;
    }
    return taken;
}

/* "(seconds.fraction)" */
static int take_time(struct can_line *l, const char **p)
{
    int64_t seconds, fraction;

    skip_blanks(p);
    if (**p != '(')
        return 0;
    ++*p;
    if (!take_digits(p, 10, &seconds) || seconds >= INT64_MAX / SECOND_NS ||
        *(*p)++ != '.')
        return -EINVAL;
    int n = take_digits(p, 9, &fraction);
    if (!n || *(*p)++ != ')')
        return -EINVAL;
    for (; n < 9; n++)
        fraction *= 10;
    l->dated = true;
    l->stamp_ns = seconds * SECOND_NS + fraction;
    return 0;
}

static int take_interface(struct can_line *l, const char **p)
{
    size_t n;

    skip_blanks(p);
    n = strcspn(*p, " \t\r\n");
    if (!n || n >= sizeof l->interface)
        return -EINVAL;
    for (size_t i = 0; i < n; i++)
        if (!isgraph((unsigned char)(*p)[i]))
            return -EINVAL;
    memcpy(l->interface, *p, n);
    l->interface[n] = '\0';
    *p += n;
    skip_blanks(p);
    return 0;
}

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    c = (char)(c | 0x20);
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* Three digits, or eight: an identifier of 29 bits or an error frame. */
static int take_id(struct can_line *l, const char **p)
{
    int n = 0, digit;

    while (n < 8 && (digit = hex_digit(**p)) >= 0) {
        l->frame.id = l->frame.id << 4 | (uint32_t)digit;
        ++*p;
        n++;
    }
    if (n != 3 && n != 8)
        return -EINVAL;
    l->data = n == 3;
    return l->data && l->frame.id > 0x7ff ? -EINVAL : 0;
}

/* One byte; -EAGAIN: none is there. */
static int take_byte(struct can_line *l, const char **p, size_t most)
{
    int high = hex_digit((*p)[0]);
    int low = high < 0 ? -1 : hex_digit((*p)[1]);

    if (high < 0)
        return -EAGAIN;
    if (low < 0 || l->frame.size == most)
        return -EINVAL;
    l->frame.data[l->frame.size++] = (uint8_t)(high << 4 | low);
    *p += 2;
    return 0;
}

/* Behind the data of a log: its raw length code, and the direction. */
static bool ends_log(const char *p)
{
    if (*p == '_' && hex_digit(p[1]) > 8)
        p += 2;
    skip_blanks(&p);
    if (*p == 'R' || *p == 'T')
        p++;
    return p[strspn(p, " \t\r\n")] == '\0';
}

/* "#" and the data of a classic frame, "#R" of a remote one, "##" with a digit of flags
 * of FD. */
static int take_log(struct can_line *l, const char *p)
{
    int err;

    p++;
    if (*p == '#') {
        l->frame.fd = true;
        p++;
        if (hex_digit(*p++) < 0)
            return -EINVAL;
    } else if (*p == 'R') {
        l->data = false;
        p++;
        p += hex_digit(*p) >= 0;
        return ends_log(p) ? 0 : -EINVAL;
    }
    do
        if (*p == '.') /* which some write between bytes */
            p++;
    while (!(err = take_byte(l, &p, l->frame.fd ? 64 : 8)));
    return err == -EAGAIN && ends_log(p) ? 0 : -EINVAL;
}

/* "[8]" of a classic frame, two digits of FD; then the bytes. */
static int take_screen(struct can_line *l, const char *p)
{
    int64_t size = 0;

    p++;
    l->frame.fd = p[0] && p[1] != ']';
    if (!take_digits(&p, 2, &size) || *p++ != ']' || size > (l->frame.fd ? 64 : 8))
        return -EINVAL;
    skip_blanks(&p);
    if (!strncmp(p, "remote request", 14)) {
        l->data = false;
        return 0;
    }
    for (int64_t i = 0; i < size; i++) {
        if (take_byte(l, &p, (size_t)size))
            return -EINVAL;
        skip_blanks(&p);
    }
    return *p == '\0' || *p == '\r' || *p == '\n' || *p == '\'' || *p == 'E' ? 0
                                                                             : -EINVAL;
}

/* Direction, bit rate switch and error state, "RX B -", in front of the identifier. */
static void skip_extra(const char **p)
{
    if (strncmp(*p, "RX ", 3) && strncmp(*p, "TX ", 3))
        return;
    *p += 3;
    *p += strspn(*p, " -BE");
}

int can_line_parse(struct can_line *out, const char *text)
{
    const char *p = text;

    memset(out, 0, sizeof *out);
    if (take_time(out, &p) || take_interface(out, &p))
        return -EINVAL;
    skip_extra(&p);
    if (take_id(out, &p))
        return -EINVAL;
    if (*p == '#')
        return take_log(out, p);
    skip_blanks(&p);
    return *p == '[' ? take_screen(out, p) : -EINVAL;
}
