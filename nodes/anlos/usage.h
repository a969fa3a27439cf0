/* SPDX-License-Identifier: MIT */
/* nodes/anlos/usage.h -- how the commands talk about their command line. */
#ifndef ANLOS_NODES_ANLOS_USAGE_H
#define ANLOS_NODES_ANLOS_USAGE_H

#include <float.h>
#include <getopt.h> /* optarg, optind */
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "dsp/error.h"
#include "nodes/rt/choice.h"
#include "nodes/rt/stop.h"

/* Prints "anlos COMMAND: text" and where help is; returns EXIT_BAD_INPUT. */
int usage_error(const char *command, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

struct json_t; /* jansson */

/* What a command's work returned, 0 or a negative errno, as an exit code: EXIT_BAD_INPUT
 * where another argument or file would do, such as one that may be read or written;
 * EXIT_INTERRUPTED of -EINTR; EXIT_FAILED of the rest, such as a full disk. */
int usage_exit_code(int err);

/* The same; says why not. */
int usage_outcome(const char *command, int err, const struct error *why);

/* Standard streams that are closed stay so, and what is opened next does not become one
 * of them: what is said would be written into it.  Before any file is opened.  0, or a
 * negative errno. */
int usage_hold_streams(void);

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

/* An option: --help is one of every command, and not in its table.  --help=OPTION prints
 * the names of its value one by one, as the completion of a shell asks for them. */
struct usage_option {
    const char *name; /* NULL: the end of the table */
    enum usage_kind {
        USAGE_IS_SWITCH, /* without a value */
        USAGE_IS_VALUE,  /* with one; of `names`, if it has any */
        USAGE_IS_FLAG,   /* kept: bool, which becomes true */
        USAGE_IS_TEXT,   /* const char *, borrowed from argv */
        USAGE_IS_COUNT,  /* size_t */
        USAGE_IS_NUMBER  /* double */
    } kind;
    int code;           /* is returned; 0: not, of one that is kept */
    size_t at;          /* where it is kept in the struct that usage.into points to */
    size_t min, max;    /* of a count */
    double least, most; /* of a number, */
    double unit;        /* which is kept times this; 0: as it is */
    /* What an error says of either; NULL: from where to where.  Of a text: what it is
     * that may not be empty; NULL: it may. */
    const char *expected;
    char letter;         /* its short form; 0: none */
    choice_names *names; /* NULL: any */
    bool list;           /* several of them with commas between: the command checks */
};

#define USAGE_SWITCH(c)         .kind = USAGE_IS_SWITCH, .code = (c)
#define USAGE_VALUE(c)          .kind = USAGE_IS_VALUE, .code = (c)
#define USAGE_NAME(c, list)     USAGE_VALUE(c), .names = (list)
#define USAGE_FLAG(type, field) USAGE_KEPT(FLAG, type, field, bool)
#define USAGE_TEXT(type, field) USAGE_KEPT(TEXT, type, field, const char *)
#define USAGE_COUNT(type, field, least, most)                                            \
    USAGE_KEPT(COUNT, type, field, size_t), .min = (least), .max = (most)
#define USAGE_NUMBER(type, field, from, to)                                              \
    USAGE_KEPT(NUMBER, type, field, double), .least = (from), .most = (to)
#define USAGE_ABOVE_0                    DBL_TRUE_MIN
#define USAGE_ANY                        DBL_MAX
#define USAGE_KEPT(what, type, field, c) /* nothing else compiles than what it is */     \
    .kind = USAGE_IS_##what,                                                             \
    .at = offsetof(type, field) + _Generic(((type *)0)->field, c : 0)

struct usage {
    const char *command, *help;
    const struct usage_option *options;
    void *into;                  /* NULL: none is kept */
    int (*print_help)(FILE *to); /* in place of help: 0, or it could not be written */
    bool words;                  /* code 1: optarg is no option; else they follow */
    bool begun;
};

/* The code of the next option that has one, with optarg; 0: no more, optind stands at
 * what follows.  Prints the help and what is wrong with an option itself, such as a value
 * that is none of its names: then it is ~exit code, below 0. */
int usage_next(struct usage *u, int argc, char **argv);

/* Of names[], NULL at its end, the one that was probably meant; NULL: none is near. */
const char *usage_nearest(const char *word, const char *const *names);

/* A whole number from min to max.  0, -EINVAL. */
int usage_count(const char *text, size_t min, size_t max, size_t *out);

/* n finite numbers with commas between.  0, -EINVAL. */
int usage_numbers(const char *text, size_t n, double *out);

/* As many threads as a node has: nodes/rt/process.h. */
size_t usage_default_threads(void);

#endif
