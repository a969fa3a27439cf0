#include "nodes/anlos/can/tally.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>

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
    int failed = !o || json_dumpf(o, to, JSON_COMPACT | JSON_REAL_PRECISION(9));
    json_decref(o);
    putc('\n', to);
    return failed && !ferror(to) ? -ENOMEM : 0;
}
