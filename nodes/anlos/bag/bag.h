/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/bag.h -- `anlos bag VERB`: work on recordings (MCAP, msgs/bag) without
 * a running system.  The verbs, argv[0] is their name; and what they share: how they end,
 * and the file that they make. */
#ifndef ANLOS_NODES_ANLOS_BAG_BAG_H
#define ANLOS_NODES_ANLOS_BAG_BAG_H

#include <limits.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "dsp/error.h"
#include "msgs/bag/catalog.h"
#include "msgs/bag/compression.h"
#include "msgs/bag/writer.h"

int bag_record(int argc, char **argv);
int bag_save(int argc, char **argv);
int bag_play(int argc, char **argv);
int bag_info(int argc, char **argv);
int bag_check_command(int argc, char **argv);
int bag_recover_command(int argc, char **argv);
int bag_merge(int argc, char **argv);
int bag_filter(int argc, char **argv);
int bag_export(int argc, char **argv);
int bag_import(int argc, char **argv);

/* Prints "anlos bag VERB: text" unless err is 0 or -EPIPE, of standard output; returns
 * the exit code: 141 of that, 2 of what is too large, else that of usage_exit_code. */
int verb_end(const char *verb, int err, const struct error *why);

/* A file that appears under its name when it is whole. */
struct verb_output {
    char path[PATH_MAX];
    char temporary[PATH_MAX]; /* to be made by the caller */
};

/* 0, -EEXIST (path is there already), -ENAMETOOLONG. */
int verb_output_begin(struct verb_output *o, const char *path, struct error *why);

/* err 0: gives the file its name; else removes it, which is added to what why says of
 * -EINTR (Ctrl-C).  err, or an errno of renaming. */
int verb_output_end(struct verb_output *o, int err, struct error *why);

/* A bag as we write them, under o->temporary.  As bag_writer_create. */
int verb_writer_create(struct bag_writer **out, const struct verb_output *o,
                       const char *profile, enum bag_compression compression,
                       struct error *why);

/* A text file that appears whole, or "-" for stdout: write fills it and returns 0 or a
 * negative errno with an error.  That, or an errno of writing. */
int verb_write_file(const char *path,
                    int (*write)(FILE *f, void *context, struct error *why),
                    void *context, struct error *why);

/* Of the command line, after its options.  0, or what usage_error returns. */
int verb_one_operand(const char *command, const char *what, int argc, char **argv);

/* Of --compression: "zstd", "lz4", "none". */
const char *verb_compression_name(size_t i);
enum bag_compression verb_compression(const char *name); /* one of those */

/* One more of an option that may be given several times: *list, NULL at first, becomes
 * all of them with commas between, in room[VERB_PATTERNS].  0, or what usage_error
 * returns: too many. */
enum { VERB_PATTERNS = 1024 };
int verb_add_patterns(const char *command, const char *text, char room[VERB_PATTERNS],
                      const char **list);

/* A topic by patterns (fnmatch(3)) with commas between; NULL: every one. */
bool verb_matches(const char *patterns, struct bytes topic);

/* The first pattern that no topic of the bags matches, in out.  false: each matches. */
bool verb_finds_stray(const char *patterns, struct bag_catalog *const *bags,
                      size_t n_bags, char out[64]);

/* Of `anlos bag info`: how much of each topic is in a bag, by the message indexes alone
 * where there are any, else by reading all of it. */

struct topic_contents {
    struct bytes name, type;      /* borrowed from the catalog; without a schema empty */
    uint64_t n_messages, n_bytes; /* of their records, before compression */
    uint64_t first_time, last_time;
    char from[96]; /* names of the nodes, spaces between; what does not fit is cut */
};

struct contents {
    struct topic_contents *topics; /* [n] in the order of the bag's channels */
    size_t n;
    uint16_t topic_of[1 << 16];         /* by channel id: index */
    uint64_t packed_bytes, plain_bytes; /* of all chunks; 0: not known */
    struct bytes compression;           /* of the first chunk */
};

/* Clear with contents_clear, also after an error.  The catalog outlives it.  0, -EBADMSG,
 * -EINTR (Ctrl-C), other errors of bag_reader_next. */
int contents_read(struct contents *out, const struct bag_catalog *c, struct error *why);
void contents_clear(struct contents *c);

/* Messages a second; 0: fewer than two, or all at one time. */
double topic_rate_hz(const struct topic_contents *t);

/* What `anlos bag play` says on a terminal of where it is. */

struct playback_status;

/* "  12.3 of 64.1 s  plays at 2x  512 pings, 510 used"; at most size - 1 characters. */
void play_keys_line(const struct playback_status *s, char *text, size_t size);

/* Of `anlos bag merge` and `filter`: some of the messages of several bags, in the order
 * of their times, into a new bag. */

struct selection {
    char *const *files; /* [n_files] */
    size_t n_files;
    const char *topics, *exclude; /* patterns (verb_matches), or NULL */
    char topics_room[VERB_PATTERNS], exclude_room[VERB_PATTERNS]; /* they may lie here */
    double start_s, end_s; /* after the first message of all; end_s may be INFINITY */
    enum bag_compression compression;
    /* Of sound and images (msgs/shuffle.h). */
    enum selection_order { ORDER_KEPT, ORDER_SHUFFLED, ORDER_PLAIN } order;
    const char *out;
};

struct selection_result {
    uint64_t n_messages, n_written;
};

/* 0; -EINVAL (a pattern that no topic matches), -EEXIST, -EINTR (Ctrl-C), errors of
 * msgs/bag.  After an error there is no new file. */
int selection_write(const struct selection *s, struct selection_result *out,
                    struct error *why);

/* What `anlos bag import` makes bags of. */

/* A bag of messages of the array node that never went over a bus.  Its times begin a
 * second after 1970: who recorded the sound did not say when, and equal recordings
 * become equal bags. */

#define IMPORT_START_NS 1000000000LL

struct import_bag;

/* 0, -EEXIST, as verb_writer_create. */
int import_bag_begin(struct import_bag **out, const char *path,
                     enum bag_compression compression, struct error *why);

/* err 0: the file gets its name; else it is removed.  Frees b. */
int import_bag_end(struct import_bag *b, int err, struct error *why);

struct import_options { /* borrow from argv */
    const char *from, *out;
    const char *survey, *background, *ego; /* of a recording; NULL: beside it, or none */
    enum bag_compression compression;
};

/* A recording folder: survey and pings, as the array node publishes them; of an array
 * that stands all of them, and how the vehicle moved (ego.csv).  0, -EINTR
 * (Ctrl-C), errors of array_open and of import_bag_ping. */
int import_recording(struct import_bag *bag, const struct import_options *o,
                     struct error *why);

/* An optical confocal scan (nodes/anlos/confocal/scan.h) as if it had been made with
 * sound: each place of the scan has sent a pulse that fills the band in which the scan
 * stands out of the noise, and hears the root of the counts answer it (waves of light,
 * Lindell 2019).  Ranges stay, and times are those of sound of 343 m/s.  Errors of
 * confocal_file_load and of import_bag_ping. */
int import_mat(struct import_bag *bag, const struct import_options *o, struct error *why);

#endif
