/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/bag.h -- `anlos bag VERB`: work on recordings (MCAP, msgs/bag) without
 * a running system.  The verbs, argv[0] is their name; and what they share: how they end,
 * and the file that they make. */
#ifndef ANLOS_NODES_ANLOS_BAG_BAG_H
#define ANLOS_NODES_ANLOS_BAG_BAG_H

#include <limits.h>
#include <stdbool.h>
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

/* Prints "anlos bag VERB: text" unless err is 0 or -EINTR; returns the exit code: 0, 130,
 * 2 for what is wrong with the input (no such file, no bag, damaged, too large, an output
 * that is there already), else 1. */
int verb_end(const char *verb, int err, const struct error *why);

/* A file that appears under its name when it is whole. */
struct verb_output {
    char path[PATH_MAX];
    char temporary[PATH_MAX]; /* to be made by the caller */
};

/* 0, -EEXIST (path is there already), -ENAMETOOLONG. */
int verb_output_begin(struct verb_output *o, const char *path, struct error *why);

/* err 0: gives the file its name; else removes it.  err, or an errno of renaming. */
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
int verb_take_compression(const char *command, const char *text,
                          enum bag_compression *out);

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

#endif
