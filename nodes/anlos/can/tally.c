/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/can/can.h"
#include "nodes/anlos/usage.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
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

static void begin(struct lists *l, const struct can_frame_data *f)
{
    l->cut += l->under_way;
    memset(l->frames, 0, sizeof l->frames);
    l->under_way = !can_unpack_list_header(f, &l->header);
}

/* The frames of objects carry the low bits of their list's counter. */
static bool belongs(const struct lists *l, enum can_id id, const struct can_frame_data *f)
{
    struct can_object o = {0};
    struct can_view_corner c;

    switch (id) {
    case CAN_ID_TIME:
        return true;
    case CAN_ID_OBJECT_STATE:
        return !can_unpack_object_state(f, &o) && o.counter == (l->header.counter & 15);
    case CAN_ID_OBJECT_DYNAMICS:
        return !can_unpack_object_dynamics(f, &o) &&
               o.counter == (l->header.counter & 15);
    case CAN_ID_OBJECT_QUALITY:
        return !can_unpack_object_quality(f, &o) && o.counter == (l->header.counter & 15);
    case CAN_ID_OBJECT_MOTION: /* optional: a list is whole without */
        return !can_unpack_object_motion(f, &o) && o.counter == (l->header.counter & 15);
    case CAN_ID_FIELD_OF_VIEW: /* so is this */
        return !can_unpack_field_of_view(f, &c) && c.counter == (l->header.counter & 15);
    case CAN_ID_OBJECT_FD:
        return !can_unpack_object_fd(f, &o) && o.counter == l->header.counter;
    default:
        return false;
    }
}

static bool is_whole(const struct lists *l)
{
    unsigned n = l->header.number;
    const unsigned *frames = l->frames;
    bool classic = frames[CAN_ID_OBJECT_STATE] == n &&
                   frames[CAN_ID_OBJECT_DYNAMICS] == n &&
                   frames[CAN_ID_OBJECT_QUALITY] == n;

    return frames[CAN_ID_TIME] == 1 && (classic || frames[CAN_ID_OBJECT_FD] == n);
}

/* An undamaged frame of a sensor, in the order in which they came. */
static void lists_take(struct lists *l, enum can_id id, const struct can_frame_data *f)
{
    if (id == CAN_ID_LIST_HEADER)
        begin(l, f);
    else if (l->under_way && belongs(l, id, f))
        l->frames[id]++;
    if (l->under_way && is_whole(l)) {
        l->whole++;
        l->under_way = false;
    }
}

struct tally_frame tally_take(struct tally *t, const struct can_line *l)
{
    struct tally_frame f = {0};

    if (l->data)
        f.m = can_message_find(t->checks.base, l->frame.id);
    if (!f.m) {
        t->unknown += l->data;
        t->other += !l->data;
        return f;
    }
    struct tally_message *sum = &t->messages[f.m->id];
    f.wrong_size = l->frame.size != f.m->size || l->frame.fd != f.m->fd;
    sum->frames++;
    sum->wrong_size += f.wrong_size;
    if (!f.wrong_size) {
        f.verdict = can_check(&t->checks, &l->frame);
        sum->verdicts[f.verdict]++;
        if (e2e_is_usable(f.verdict))
            lists_take(&t->lists, f.m->id, &l->frame);
    }
    if (l->dated) {
        sum->first_ns = sum->n_dated++ ? sum->first_ns : l->stamp_ns;
        sum->last_ns = l->stamp_ns;
    }
    return f;
}

void tally_no_frame(struct tally *t, uint64_t number)
{
    if (!t->no_frames++)
        t->first_no_frame = number;
}

const char *tally_verdict_text(const struct tally_frame *f)
{
    return f->wrong_size ? "wrong size" : e2e_verdict_text(f->verdict);
}

uint64_t tally_frames(const struct tally *t)
{
    uint64_t n = 0;

    for (size_t i = 0; i < CAN_SENSOR_STEP; i++)
        n += t->messages[i].frames;
    return n;
}

uint64_t tally_wrong(const struct tally *t)
{
    uint64_t n = t->no_frames + t->lists.cut;

    for (size_t i = 0; i < CAN_SENSOR_STEP; i++) {
        n += t->messages[i].wrong_size;
        for (int v = 0; v < TALLY_VERDICTS; v++)
            if (!e2e_is_usable((enum e2e_verdict)v))
                n += t->messages[i].verdicts[v];
    }
    return n;
}

/* Mean time from one to the next; 0: not known, or of objects, which come together. */
static double period_ms(const struct can_message *message, const struct tally_message *m)
{
    if (m->n_dated < 2 || (!message->cycle_ms && message->id != CAN_ID_LIST_HEADER))
        return 0;
    return 1e-6 * (double)(m->last_ns - m->first_ns) / (double)(m->n_dated - 1);
}

static void print_message(const struct can_message *m, const struct tally *t, FILE *to)
{
    const struct tally_message *sum = &t->messages[m->id];

    if (!sum->frames)
        return;
    fprintf(to, "%03X %-14s %8" PRIu64 " frames", t->checks.base + m->id, m->name,
            sum->frames);
    if (period_ms(m, sum) > 0)
        fprintf(to, ", every %.1f ms", period_ms(m, sum));
    for (int v = E2E_OK + 1; v < TALLY_VERDICTS; v++)
        if (sum->verdicts[v])
            fprintf(to, ", %" PRIu64 " %s", sum->verdicts[v],
                    e2e_verdict_text((enum e2e_verdict)v));
    if (sum->wrong_size)
        fprintf(to, ", %" PRIu64 " wrong size", sum->wrong_size);
    putc('\n', to);
}

void tally_print(const struct tally *t, FILE *to)
{
    size_t n;
    const struct can_message *m = can_messages(&n);

    if (tally_frames(t))
        putc('\n', to); /* between them and their sums */
    for (size_t i = 0; i < n; i++)
        print_message(&m[i], t, to);
    if (t->lists.whole || t->lists.cut)
        fprintf(to, "lists: %" PRIu64 " whole, %" PRIu64 " cut\n", t->lists.whole,
                t->lists.cut);
    if (t->unknown)
        fprintf(to, "frames of other identifiers: %" PRIu64 "\n", t->unknown);
    if (t->other)
        fprintf(to, "remote, error and 29-bit frames: %" PRIu64 "\n", t->other);
    if (t->no_frames)
        fprintf(to,
                "lines that are no frames: %" PRIu64 ", the first is line %" PRIu64 "\n",
                t->no_frames, t->first_no_frame);
}

static json_t *message_json(const struct can_message *message,
                            const struct tally_message *m)
{
    json_t *o = json_pack("{sI}", "frames", (json_int_t)m->frames);

    if (period_ms(message, m) > 0)
        json_object_set_new(o, "period_ms", json_real(period_ms(message, m)));
    for (int v = 0; v < TALLY_VERDICTS; v++)
        if (m->verdicts[v])
            json_object_set_new(o, e2e_verdict_text((enum e2e_verdict)v),
                                json_integer((json_int_t)m->verdicts[v]));
    if (m->wrong_size)
        json_object_set_new(o, "wrong size", json_integer((json_int_t)m->wrong_size));
    return o;
}

int tally_print_json(const struct tally *t, FILE *to)
{
    size_t n;
    const struct can_message *m = can_messages(&n);
    json_t *messages = json_object();

    for (size_t i = 0; i < n; i++)
        if (t->messages[m[i].id].frames)
            json_object_set_new(messages, m[i].name,
                                message_json(&m[i], &t->messages[m[i].id]));
    json_t *o = json_pack("{s{so, sI, sI, sI, sI, sI}}", "summary", "messages", messages,
                          "lists_whole", (json_int_t)t->lists.whole, "lists_cut",
                          (json_int_t)t->lists.cut, "other_identifiers",
                          (json_int_t)t->unknown, "remote_error_29_bit",
                          (json_int_t)t->other, "no_frames", (json_int_t)t->no_frames);
    return usage_json_line(o, to);
}
