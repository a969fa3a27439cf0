#include "nodes/anlos/can/show.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>

#include "msgs/can/frames.h"

#define SECOND_NS INT64_C(1000000000)

/* As many digits as a step needs. */
static int decimals(double step)
{
    int n = 0;

    while (n < 6 && step < 1 - 1e-9) {
        step *= 10;
        n++;
    }
    return n;
}

/* Bit 0 first: their names, numbers where there are none, or "none". */
static void show_bits(const struct can_signal *s, int64_t raw, FILE *to)
{
    const char *between = "";

    if (!raw)
        fputs("none", to);
    for (unsigned i = 0; i < s->length; i++) {
        const char *name = can_signal_name(s, i);
        if (!(raw >> i & 1))
            continue;
        if (name)
            fprintf(to, "%s%s", between, name);
        else
            fprintf(to, "%sbit %u", between, i);
        between = "+";
    }
}

static void show_signal(const struct can_signal *s, const struct can_frame_data *f,
                        FILE *to)
{
    int64_t raw = can_signal_raw(s, f);
    const char *name = can_signal_name(s, raw);

    fprintf(to, " %s ", s->name);
    if (s->kind == CAN_SIGNAL_BITS)
        show_bits(s, raw, to);
    else if (can_signal_is_missing(s, f))
        fputs("NotAvailable", to);
    else if (s->kind == CAN_SIGNAL_CHOICE && name)
        fputs(name, to);
    else if (s->kind == CAN_SIGNAL_CHOICE)
        fprintf(to, "%" PRId64, raw);
    else if (s->kind == CAN_SIGNAL_FLOAT)
        fprintf(to, "%.7g", can_signal_physical(s, f));
    else
        fprintf(to, "%.*f", decimals(s->factor), can_signal_physical(s, f));
    if (*s->unit && !can_signal_is_missing(s, f))
        fprintf(to, " %s", s->unit);
}

void show_frame(const struct can_line *l, const struct tally_frame *f, FILE *to)
{
    const char *between = "";

    if (l->dated)
        fprintf(to, "%" PRId64 ".%06" PRId64 "  ", l->stamp_ns / SECOND_NS,
                l->stamp_ns % SECOND_NS / 1000);
    fprintf(to, "%s  %03" PRIX32 " %-14s  %-14s ", l->interface, l->frame.id, f->m->name,
            tally_verdict_text(f));
    for (size_t i = 0; !f->wrong_size && i < f->m->n_signals; i++) {
        if (f->m->signals[i].member.type == CAN_MEMBER_NONE) /* the verdict says it */
            continue;
        fputs(between, to);
        show_signal(&f->m->signals[i], &l->frame, to);
        between = ",";
    }
    if (f->wrong_size)
        fprintf(to, " %d bytes%s, expected %d%s", l->frame.size,
                l->frame.fd ? " of FD" : "", f->m->size, f->m->fd ? " of FD" : "");
    putc('\n', to);
}

static json_t *bits_json(const struct can_signal *s, int64_t raw)
{
    json_t *o = json_array();

    for (unsigned i = 0; i < s->length; i++)
        if (raw >> i & 1) {
            const char *name = can_signal_name(s, i);
            json_array_append_new(o, name ? json_string(name) : json_integer(i));
        }
    return o;
}

static json_t *signal_json(const struct can_signal *s, const struct can_frame_data *f)
{
    int64_t raw = can_signal_raw(s, f);
    const char *name = can_signal_name(s, raw);
    double value = can_signal_physical(s, f);

    if (s->kind == CAN_SIGNAL_BITS)
        return bits_json(s, raw);
    if (can_signal_is_missing(s, f) || !isfinite(value))
        return json_null();
    if (s->kind == CAN_SIGNAL_CHOICE)
        return name ? json_string(name) : json_integer(raw);
    if (s->kind != CAN_SIGNAL_FLOAT && s->factor == 1)
        return json_integer(raw + (json_int_t)s->offset);
    return json_real(value);
}

int show_frame_json(const struct can_line *l, const struct tally_frame *f, FILE *to)
{
    json_t *signals = json_object();

    for (size_t i = 0; !f->wrong_size && i < f->m->n_signals; i++)
        json_object_set_new(signals, f->m->signals[i].name,
                            signal_json(&f->m->signals[i], &l->frame));
    json_t *o = json_pack("{ss, sI, ss, ss, so}", "interface", l->interface, "id",
                          (json_int_t)l->frame.id, "name", f->m->name, "e2e",
                          tally_verdict_text(f), "signals", signals);
    if (o && l->dated)
        json_object_set_new(o, "time_ns", json_integer(l->stamp_ns));
    int failed = !o || json_dumpf(o, to, JSON_COMPACT | JSON_REAL_PRECISION(9));
    json_decref(o);
    putc('\n', to);
    return failed && !ferror(to) ? -ENOMEM : 0;
}
