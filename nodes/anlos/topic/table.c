#include "nodes/anlos/topic/table.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "nodes/anlos/top/text.h"

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
