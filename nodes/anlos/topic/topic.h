/* SPDX-License-Identifier: MIT */
/* nodes/anlos/topic/topic.h -- what `anlos topic` does in files of their own: echo, pub,
 * and the account that hz, bw, delay and list print. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_TOPIC_H
#define ANLOS_NODES_ANLOS_TOPIC_TOPIC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "msgs/bus.h"
#include "msgs/survey.pb-c.h"
#include "msgs/topics.h"

/* `anlos topic echo`: messages as they come, on stdout. */

struct echo_options {
    size_t count;      /* 0: without end */
    double timeout_s;  /* without a message; 0: never */
    const char *field; /* only this one; NULL: the whole line */
    bool full;
    bool mcap; /* in place of JSON */
};

/* What got lost on the way goes to stderr, once a second at most and at the end; so does,
 * after 2 s, that nothing comes.  0 (count, or nobody reads on), -EINTR, -ETIMEDOUT,
 * -ENOMEM; what cannot be written shows in ferror(stdout). */
int echo_run(struct bus *bus, const struct topic *const *topics, size_t n,
             const struct echo_options *o);

/* `anlos topic pub`: messages from outside, as JSON.
 *
 * Who may say what.  "ego", "ambient" and "wall/given" are what the vehicle says, and
 * "stage/manual" what a person does: these have a name in msgs/topics.h that is no
 * node's (vehicle, hand), under which they are published, unless a node says the same
 * already (can).  Everything else is a node's own word, and with it what the sensor
 * states: only by force, only in the name of a node that does not run. */

struct pub_options {
    const char *json; /* NULL or "-": from stdin, one a line */
    const char *from; /* in whose name; NULL: as above */
    double rate_hz;   /* a message of `json` again and again, lines at most so fast; 0:
                       * once,   as they come */
    size_t count;     /* 0: once, or to the end of stdin or Ctrl-C */
    bool force;
    bool print; /* each as echo prints it, when it is published */
};

/* An exit code; says what is wrong. */
int pub_run(const char *run_dir, const struct topic *t, const struct pub_options *o);

/* An account of the messages that came: for each topic and sender how many, how large,
 * how far apart, how late, and what is missing between. */

enum { TALLY_DELAYS = 4096 }; /* the newest that are kept of each row */

struct tally_delays {
    size_t n; /* ever added; the newest stands at (n - 1) % TALLY_DELAYS */
    double s[TALLY_DELAYS];
};

struct tally_row {
    const struct topic *topic;
    char node[ENVELOPE_NODE_SIZE]; /* who sent them; empty: nobody so far */
    uint64_t messages, bytes, gaps;
    uint64_t replayed; /* of a recording: their stamps say nothing of delays */
    size_t min_size, max_size;
    int64_t first_ns, last_ns; /* of arrival */
    double interval_min_s, interval_max_s;
    double interval_m2_s2; /* sum of squared deviations from the mean (Welford 1962) */
    int64_t epoch_ns;
    uint64_t next;                  /* sequence expected */
    struct tally_delays *capture;   /* from capture stamp to arrival; NULL: not kept */
    struct tally_delays *published; /* from publish stamp to arrival */
};

struct tally {
    bool delays;
    double pings_hz; /* that the survey has room for; 0: not known */
    size_t n_rows, room;
    struct tally_row *rows; /* topics in the order given; of each, senders as they came */
};

/* A row for each topic.  delays: keep them.  0, -ENOMEM; tally_clear it in any case. */
int tally_open(struct tally *t, const struct topic *const *topics, size_t n, bool delays);

/* A message of one of the topics, as it came at arrival_ns.  0, -ENOMEM. */
int tally_add(struct tally *t, const struct bus_message *m, int64_t arrival_ns);

/* What the array is set up for: how many pings go into a second. */
void tally_survey(struct tally *t, const Anlos__Survey *survey);

/* How often messages should come, by the survey or else by msgs/topics.h; 0: as it
 * happens. */
double tally_expected_hz(const struct tally *t, const struct topic *topic);
void tally_clear(struct tally *t);

/* Intervals between messages; NaN with fewer than two. */
double tally_interval_s(const struct tally_row *r);
double tally_interval_std_s(const struct tally_row *r);

/* The least delay that a share (0..1) of those kept does not exceed; NaN: none is kept.
 */
double tally_quantile_s(const struct tally_delays *d, double share);

/* The tables of `anlos topic hz`, bw and delay, and of list. */

/* How often, measured and expected; the intervals; what is missing. */
void topic_table_rates(const struct tally *t, double elapsed_s, FILE *f);

/* Bytes a second, and of a message. */
void topic_table_sizes(const struct tally *t, double elapsed_s, FILE *f);

/* From capture and from publishing to arrival. */
void topic_table_delays(const struct tally *t, double elapsed_s, FILE *f);

/* Every topic as msgs/topics.h has it. */
void topic_table_all(FILE *f);

#endif
