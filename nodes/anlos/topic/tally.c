/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/topic/topic.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "dsp/rank.h"
#include "msgs/topics.h"
#include "nodes/anlos/text.h"

int tally_open(struct tally *t, const struct topic *const *topics, size_t n, bool delays)
{
    *t = (struct tally){.delays = delays, .room = n + 16};
    t->rows = calloc(t->room, sizeof *t->rows);
    if (!t->rows)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        t->rows[i].topic = topics[i];
    t->n_rows = n;
    return 0;
}

/* A new row before row i. */
static struct tally_row *insert_row(struct tally *t, size_t i, const struct topic *topic)
{
    if (list_grow(&t->rows, t->n_rows, &t->room, sizeof *t->rows))
        return NULL;
    memmove(&t->rows[i + 1], &t->rows[i], (t->n_rows - i) * sizeof *t->rows);
    t->n_rows++;
    t->rows[i] = (struct tally_row){.topic = topic};
    return &t->rows[i];
}

/* The row of topic and sender, made when there is none. */
static struct tally_row *find_row(struct tally *t, const struct bus_message *m)
{
    size_t end = t->n_rows;
    struct tally_row *r = NULL;

    for (size_t i = 0; i < t->n_rows; i++) {
        if (t->rows[i].topic != m->topic)
            continue;
        if (!t->rows[i].node[0])
            r = &t->rows[i];
        else if (!strcmp(t->rows[i].node, m->envelope.node))
            return &t->rows[i];
        end = i + 1;
    }
    if (!r)
        r = insert_row(t, end, m->topic);
    if (!r)
        return NULL;
    snprintf(r->node, sizeof r->node, "%s", m->envelope.node);
    if (t->delays) {
        r->capture = calloc(1, sizeof *r->capture);
        r->published = calloc(1, sizeof *r->published);
        if (!r->capture || !r->published)
            return NULL;
    }
    return r;
}

static void add_interval(struct tally_row *r, int64_t arrival_ns)
{
    double interval_s = 1e-9 * (double)(arrival_ns - r->last_ns);
    double before_s = r->messages > 1 ? tally_interval_s(r) : interval_s;

    if (r->messages == 1 || interval_s < r->interval_min_s)
        r->interval_min_s = interval_s;
    if (r->messages == 1 || interval_s > r->interval_max_s)
        r->interval_max_s = interval_s;
    double mean_s = 1e-9 * (double)(arrival_ns - r->first_ns) / (double)r->messages;
    r->interval_m2_s2 += (interval_s - before_s) * (interval_s - mean_s);
}

static void add_sequence(struct tally_row *r, const struct envelope *e)
{
    if (r->messages && e->epoch_ns == r->epoch_ns && e->sequence > r->next)
        r->gaps += e->sequence - r->next;
    r->epoch_ns = e->epoch_ns;
    r->next = e->sequence + 1;
}

static void add_delay(struct tally_delays *d, int64_t from_ns, int64_t to_ns)
{
    if (d && from_ns)
        d->s[d->n++ % TALLY_DELAYS] = 1e-9 * (double)(to_ns - from_ns);
}

int tally_add(struct tally *t, const struct bus_message *m, int64_t arrival_ns)
{
    const struct envelope *e = &m->envelope;
    struct tally_row *r = find_row(t, m);

    if (!r)
        return -ENOMEM;
    add_sequence(r, e);
    if (r->messages)
        add_interval(r, arrival_ns);
    else
        r->first_ns = arrival_ns;
    if (!r->messages || e->payload_size < r->min_size)
        r->min_size = e->payload_size;
    if (e->payload_size > r->max_size)
        r->max_size = e->payload_size;
    r->last_ns = arrival_ns;
    r->messages++;
    r->bytes += e->payload_size;
    r->replayed += e->replayed;
    if (!e->replayed) {
        add_delay(r->capture, e->capture_ns, arrival_ns);
        add_delay(r->published, e->publish_ns, arrival_ns);
    }
    return 0;
}

void tally_survey(struct tally *t, const Anlos__Survey *survey)
{
    double hz = survey->sample_rate_hz / survey->slot_samples *
                (survey->together > 1 ? survey->together : 1);

    t->pings_hz = isfinite(hz) && hz > 0.0 ? hz : 0.0;
}

double tally_expected_hz(const struct tally *t, const struct topic *topic)
{
    return table_is_of_pings(topic) && t->pings_hz > 0.0 ? t->pings_hz : topic->rate_hz;
}

void tally_clear(struct tally *t)
{
    for (size_t i = 0; i < t->n_rows; i++) {
        free(t->rows[i].capture);
        free(t->rows[i].published);
    }
    free(t->rows);
    *t = (struct tally){0};
}

double tally_interval_s(const struct tally_row *r)
{
    return r->messages > 1
               ? 1e-9 * (double)(r->last_ns - r->first_ns) / (double)(r->messages - 1)
               : NAN;
}

double tally_interval_std_s(const struct tally_row *r)
{
    return r->messages > 1 ? sqrt(r->interval_m2_s2 / (double)(r->messages - 1)) : NAN;
}

double tally_quantile_s(const struct tally_delays *d, double share)
{
    double ranked[TALLY_DELAYS];
    size_t n = !d ? 0 : d->n < TALLY_DELAYS ? d->n : TALLY_DELAYS;

    if (!n)
        return NAN;
    memcpy(ranked, d->s, n * sizeof *ranked);
    size_t rank = (size_t)ceil(share * (double)n);
    return rank_double(ranked, n, rank ? rank : 1);
}

enum { WORD = 24 };

static const char *word_ms(char out[WORD], double s)
{
    double ms = 1e3 * s;

    if (!isfinite(ms))
        snprintf(out, WORD, "-");
    else
        snprintf(out, WORD, "%.*f", fabs(ms) < 9.995 ? 2 : fabs(ms) < 99.95, ms);
    return out;
}

static const char *word_bytes(char out[WORD], double bytes)
{
    if (!isfinite(bytes))
        snprintf(out, WORD, "-");
    else if (bytes < 1e3)
        snprintf(out, WORD, "%.0f B", bytes);
    else if (bytes < 1e6)
        snprintf(out, WORD, "%.1f kB", 1e-3 * bytes);
    else
        snprintf(out, WORD, "%.1f MB", 1e-6 * bytes);
    return out;
}

static const char *word_node(const struct tally_row *r)
{
    return r->node[0] ? r->node : "-";
}

/* All of them have room in 80 columns. */
void topic_table_rates(const struct tally *t, double elapsed_s, FILE *f)
{
    char w[4][WORD], rate[TEXT_CELL_SIZE];

    (void)elapsed_s;
    fprintf(f, "%-13s %-8s %7s %11s %7s %6s %6s %6s %6s\n", "topic", "from", "number",
            "Hz/expected", "mean ms", "min", "max", "std", "gaps");
    for (size_t i = 0; i < t->n_rows; i++) {
        const struct tally_row *r = &t->rows[i];
        bool some = r->messages > 1;
        double mean_s = tally_interval_s(r);
        double expected_hz = round(10.0 * tally_expected_hz(t, r->topic)) / 10.0;
        text_rate(rate, sizeof rate, 1.0 / mean_s, expected_hz);
        fprintf(f, "%-13s %-8s %7" PRIu64 " %11s %7s %6s %6s %6s %6" PRIu64 "\n",
                r->topic->name, word_node(r), r->messages, rate, word_ms(w[0], mean_s),
                word_ms(w[1], some ? r->interval_min_s : NAN),
                word_ms(w[2], some ? r->interval_max_s : NAN),
                word_ms(w[3], tally_interval_std_s(r)), r->gaps);
    }
}

void topic_table_sizes(const struct tally *t, double elapsed_s, FILE *f)
{
    char w[4][WORD];
    uint64_t messages = 0, bytes = 0;

    fprintf(f, "%-13s %-8s %7s %12s %10s %10s %10s\n", "topic", "from", "number",
            "a second", "mean", "min", "max");
    for (size_t i = 0; i < t->n_rows; i++) {
        const struct tally_row *r = &t->rows[i];
        bool some = r->messages > 0;
        messages += r->messages;
        bytes += r->bytes;
        fprintf(f, "%-13s %-8s %7" PRIu64 " %12s %10s %10s %10s\n", r->topic->name,
                word_node(r), r->messages, word_bytes(w[0], (double)r->bytes / elapsed_s),
                word_bytes(w[1], (double)r->bytes / (double)r->messages),
                word_bytes(w[2], some ? (double)r->min_size : NAN),
                word_bytes(w[3], some ? (double)r->max_size : NAN));
    }
    if (t->n_rows > 1)
        fprintf(f, "%-13s %-8s %7" PRIu64 " %12s\n", "all", "", messages,
                word_bytes(w[0], (double)bytes / elapsed_s));
}

void topic_table_delays(const struct tally *t, double elapsed_s, FILE *f)
{
    char w[4][WORD];

    (void)elapsed_s;
    fprintf(f, "%-13s %-8s %7s  %-21s  %s\n", "topic", "from", "number",
            "ms since its sound:", "ms since it was sent:");
    fprintf(f, "%-13s %-8s %7s  %10s %10s  %10s %10s\n", "", "", "", "median", "p99",
            "median", "p99");
    for (size_t i = 0; i < t->n_rows; i++) {
        const struct tally_row *r = &t->rows[i];
        fprintf(f, "%-13s %-8s %7" PRIu64 "  %10s %10s  %10s %10s%s\n", r->topic->name,
                word_node(r), r->messages,
                word_ms(w[0], tally_quantile_s(r->capture, 0.5)),
                word_ms(w[1], tally_quantile_s(r->capture, 0.99)),
                word_ms(w[2], tally_quantile_s(r->published, 0.5)),
                word_ms(w[3], tally_quantile_s(r->published, 0.99)),
                r->replayed ? "  replayed" : "");
    }
}

void topic_table_all(FILE *f)
{
    char w[WORD];

    fprintf(f, "%-14s %-20s %8s  %-7s %6s %9s  %s\n", "topic", "schema", "rate", "policy",
            "depth", "max size", "published by");
    for (const struct topic *t = topics_all(); t->name; t++) {
        snprintf(w, sizeof w, t->rate_hz > 0.0 ? "%g Hz" : "-", t->rate_hz);
        fprintf(f, "%-14s %-20s %8s  %-7s %6zu %6zu kB ", t->name, t->schema->name, w,
                t->policy == TOPIC_ALL ? "all" : "latest", t->depth, t->max_size / 1024);
        for (size_t i = 0; i < 8 && t->publishers[i]; i++)
            fprintf(f, " %s",
                    strcmp(t->publishers[i], "*") ? t->publishers[i] : "every node");
        fprintf(f, "\n");
    }
}
