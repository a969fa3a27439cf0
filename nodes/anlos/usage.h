/* SPDX-License-Identifier: MIT */
/* nodes/anlos/usage.h -- how the commands talk about their command line. */
#ifndef ANLOS_NODES_ANLOS_USAGE_H
#define ANLOS_NODES_ANLOS_USAGE_H

#include <getopt.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "dsp/error.h"
#include "nodes/rt/exit_code.h"

/* Prints "anlos COMMAND: text" and where help is; returns EXIT_BAD_INPUT. */
int usage_error(const char *command, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

struct json_t; /* jansson */

/* What a command's work returned, 0 or a negative errno, as an exit code; says why not.
 */
int usage_outcome(const char *command, int err, const struct error *why);

/* What was printed is out: EXIT_WORKED; else it says why not and returns EXIT_FAILED, or
 * says nothing and returns EXIT_UNREAD, where `| head` has seen enough. */
int usage_flush(const char *command);

/* Takes the object, NULL: no memory, and prints it for people and programs, with 6 digits
 * that count; an exit code as usage_flush. */
int usage_json(const char *command, struct json_t *o);

/* Takes the value, NULL: no memory, and writes it as one line, with 9 digits that count.
 * 0, -ENOMEM; what cannot be written shows in ferror(to). */
int usage_json_line(struct json_t *o, FILE *to);

/* Is there still somebody who reads standard output? */
bool usage_is_read(void);

/* The same of standard output that failed with a negative errno. */
int usage_unwritten(const char *command, int err);

struct usage {
    const char *command, *help;
    const struct option *options;
    const char *short_options; /* as getopt's, with 'h'; NULL: ":h" */
    bool begun;
};

/* The val of the next option, with optarg; 0: no more, optind stands at what follows.
 * Prints the help of 'h' and what is wrong with an option itself: then it is ~exit code,
 * below 0. */
int usage_next(struct usage *u, int argc, char **argv);

/* For getopt_long's '?' and ':' with opterr = 0: says what is wrong with the argument it
 * stands at, and which option is spelled nearly so.  Returns EXIT_BAD_INPUT. */
int usage_option_error(const char *command, int code, char **argv,
                       const struct option *options);

/* Of names[], NULL at its end, the one that was probably meant; NULL: none is near. */
const char *usage_nearest(const char *word, const char *const *names);

/* A whole number from min to max.  0, -EINVAL. */
int usage_count(const char *text, size_t min, size_t max, size_t *out);

/* The same of an option's value: says what is wrong with it.  0, EXIT_BAD_INPUT. */
int usage_take_count(const char *command, const char *option, const char *text,
                     size_t min, size_t max, size_t *out);

/* A number above 0.  0, -EINVAL. */
int usage_positive(const char *text, double *out);

/* n finite numbers with commas between.  0, -EINVAL. */
int usage_numbers(const char *text, size_t n, double *out);

/* As many threads as a node has: nodes/rt/processors.h. */
size_t usage_default_threads(void);

#endif
