/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/usage.h"

#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <math.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "nodes/rt/json_whole.h"
#include "nodes/rt/process.h"

int usage_error(const char *command, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fprintf(stderr, "anlos %s: ", command);
    vfprintf(stderr, format, args);
    fprintf(stderr, "\nTry 'anlos %s --help'.\n", command);
    va_end(args);
    return EXIT_BAD_INPUT;
}

int usage_exit_code(int err)
{
    switch (err) {
    case 0:
        return EXIT_WORKED;
    case -EINTR:
        return EXIT_INTERRUPTED;
    case -ENOENT:
    case -EACCES:
    case -EROFS:
    case -EINVAL:
    case -ENOTSUP:
    case -ENOTDIR:
    case -EISDIR:
    case -EEXIST:
    case -ENAMETOOLONG:
    case -ELOOP:
    case -ENODATA: /* of a recording that is too short */
    case -EBADMSG: /* a bag that is damaged */
        return EXIT_BAD_INPUT;
    default:
        return EXIT_FAILED;
    }
}

int usage_outcome(const char *command, int err, const struct error *why)
{
    if (err)
        fprintf(stderr, "anlos %s: %s\n", command, why->text);
    return usage_exit_code(err);
}

/* Each is opened the wrong way round, so that who uses it gets EBADF as before. */
int usage_hold_streams(void)
{
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++)
        if (fcntl(fd, F_GETFD) < 0 &&
            open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY) < 0)
            return -errno;
    return 0;
}

int usage_flush(const char *command)
{
    errno = 0;
    if (!fflush(stdout) && !ferror(stdout))
        return EXIT_WORKED;
    return usage_unwritten(command, -errno);
}

int usage_json(const char *command, struct json_t *o)
{
    bool whole = json_whole(o) &&
                 (!json_dumpf(o, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(6)) ||
                  ferror(stdout));

    json_decref(o);
    if (whole)
        putchar('\n');
    else
        fprintf(stderr, "anlos %s: out of memory\n", command);
    int code = usage_flush(command);
    return code ? code : whole ? EXIT_WORKED : EXIT_FAILED;
}

int usage_json_line(struct json_t *o, FILE *to)
{
    int failed =
        !json_whole(o) ||
        json_dumpf(o, to, JSON_COMPACT | JSON_ENCODE_ANY | JSON_REAL_PRECISION(9));

    json_decref(o);
    putc('\n', to);
    return failed && !ferror(to) ? -ENOMEM : 0;
}

bool usage_is_read(void)
{
    struct pollfd out = {.fd = STDOUT_FILENO};
    return poll(&out, 1, 0) < 0 || !(out.revents & (POLLERR | POLLHUP));
}

int usage_unwritten(const char *command, int err)
{
    if (err == -EPIPE ||
        (!err && !usage_is_read())) /* the errno of an earlier write is gone */
        return EXIT_UNREAD;
    fprintf(stderr, "anlos %s: standard output: %s\n", command,
            err ? strerror(-err) : "cannot be written");
    return EXIT_FAILED;
}

const char *usage_nearest(const char *word, const char *const *names)
{
    struct nearest s = nearest_begin(word, strlen(word), 2);
    for (; *names; names++)
        nearest_try(&s, *names);
    return s.best;
}

int usage_count(const char *text, size_t min, size_t max, size_t *out)
{
    char *end;
    errno = 0;
    if (*text < '0' || *text > '9')
        return -EINVAL;
    unsigned long long v = strtoull(text, &end, 10);
    if (errno || *end || v < min || v > max)
        return -EINVAL;
    *out = (size_t)v;
    return 0;
}

/* -- options ----------------------------------------------------------------------------
 */

enum {
    MOST_OPTIONS = 32,
    HELP = 256,
    FIRST
}; /* getopt_long's codes, above all letters */

/* As getopt_long takes them, with --help at the end. */
static void make_table(const struct usage *u, struct option out[MOST_OPTIONS + 2],
                       char letters[2 * MOST_OPTIONS + 4])
{
    size_t n = 0;

    letters += sprintf(letters, "%s:h", u->words ? "-" : "");
    for (const struct usage_option *o = u->options; o->name; o++) {
        if (n == MOST_OPTIONS)
            abort(); /* a command's own table; assert would name this file's folder */
        bool bare = o->kind == USAGE_IS_SWITCH || o->kind == USAGE_IS_FLAG;
        if (o->letter)
            letters += sprintf(letters, "%c%s", o->letter, bare ? "" : ":");
        out[n] = (struct option){o->name, bare ? no_argument : required_argument, NULL,
                                 FIRST + (int)n};
        n++;
    }
    out[n++] = (struct option){"help", optional_argument, NULL, HELP};
    out[n] = (struct option){0};
}

static int wrong_option(const char *command, int code, char **argv,
                        const struct option *options)
{
    const char *at = argv[optind - 1];
    if (code == ':')
        return usage_error(command, "%s: expected a value after it", at);
    if (strncmp(at, "--", 2))
        return usage_error(command, "-%c: no such option", optopt);
    size_t n = strcspn(at + 2, "=");
    struct nearest s = nearest_begin(at + 2, n, 3);
    for (const struct option *o = options; o->name; o++) {
        if (strlen(o->name) == n && !strncmp(o->name, at + 2, n))
            return usage_error(command, "--%s: takes no value", o->name);
        nearest_try(&s, o->name);
    }
    if (s.best)
        return usage_error(command, "%.*s: no such option; did you mean --%s?",
                           (int)n + 2, at, s.best);
    return usage_error(command, "%.*s: no such option", (int)n + 2, at);
}

/* 0, or an exit code. */
static int check_name(const struct usage *u, const struct usage_option *o)
{
    char list[512];
    struct nearest near = nearest_begin(optarg, strlen(optarg), 2);

    for (size_t i = 0; o->names(i); i++) {
        if (!strcmp(o->names(i), optarg))
            return 0;
        nearest_try(&near, o->names(i));
    }
    choice_list(o->names, list, sizeof list);
    return usage_error(u->command, "--%s %s: expected %s%s%s%s", o->name, optarg, list,
                       near.best ? "; did you mean " : "", near.best ? near.best : "",
                       near.best ? "?" : "");
}

static int refuse_number(const struct usage *u, const struct usage_option *o)
{
    char range[64];

    if (o->kind == USAGE_IS_COUNT)
        snprintf(range, sizeof range, "a number from %zu to %zu", o->min, o->max);
    else
        snprintf(range, sizeof range, "a number from %g to %g", o->least, o->most);
    return usage_error(u->command, "--%s %s: expected %s", o->name, optarg,
                       o->expected ? o->expected : range);
}

/* 0, or an exit code.  What is not kept may have no place. */
static int keep(const struct usage *u, const struct usage_option *o)
{
    char *to = u->into ? (char *)u->into + o->at : NULL;
    const bool yes = true;
    double x;
    size_t n;

    switch (o->kind) {
    case USAGE_IS_FLAG:
        memcpy(to, &yes, sizeof yes);
        return 0;
    case USAGE_IS_TEXT:
        if (o->expected && !*optarg)
            return usage_error(u->command, "--%s: expected %s", o->name, o->expected);
        memcpy(to, &optarg, sizeof optarg);
        return 0;
    case USAGE_IS_COUNT:
        if (usage_count(optarg, o->min, o->max, &n))
            return refuse_number(u, o);
        memcpy(to, &n, sizeof n);
        return 0;
    case USAGE_IS_NUMBER:
        if (usage_numbers(optarg, 1, &x) || !(x >= o->least && x <= o->most))
            return refuse_number(u, o);
        x *= o->unit > 0.0 ? o->unit : 1.0;
        memcpy(to, &x, sizeof x);
        return 0;
    default:
        return 0;
    }
}

/* Of one option: the names that its value may have. */
static int print_names(const struct usage *u, const char *name)
{
    const struct usage_option *o = u->options;

    while (o->name && strcmp(o->name, name))
        o++;
    if (!o->name)
        return usage_error(u->command, "--help=%s: there is no option --%s", name, name);
    if (!o->names)
        return usage_error(u->command, "--help=%s: --%s has no list of values", name,
                           name);
    choice_print(o->names, stdout);
    return EXIT_WORKED;
}

static int print_help(const struct usage *u)
{
    bool failed = u->print_help ? u->print_help(stdout) != 0 : fputs(u->help, stdout) < 0;
    return failed ? EXIT_FAILED : EXIT_WORKED;
}

int usage_next(struct usage *u, int argc, char **argv)
{
    struct option table[MOST_OPTIONS + 2];
    char letters[2 * MOST_OPTIONS + 4];
    int code, wrong = 0;

    make_table(u, table, letters);
    opterr = 0;
    if (!u->begun)
        optind = 1;
    u->begun = true;
    while (!wrong && (code = getopt_long(argc, argv, letters, table, NULL)) != -1) {
        const struct usage_option *o = u->options;
        if (code == 'h' || (code == HELP && !optarg))
            return ~print_help(u);
        if (code == HELP)
            return ~print_names(u, optarg);
        if (code == '?' || code == ':')
            return ~wrong_option(u->command, code, argv, table);
        if (code == 1)
            return code;
        if (code >= FIRST)
            o += code - FIRST;
        while (code < FIRST && o->letter != code)
            o++;
        wrong = o->names && !o->list ? check_name(u, o) : 0;
        if (!wrong)
            wrong = keep(u, o);
        if (!wrong && o->code)
            return o->code;
    }
    return wrong ? ~wrong : 0;
}

int usage_numbers(const char *text, size_t n, double *out)
{
    for (size_t i = 0; i < n; i++) {
        char *end;
        out[i] = strtod(text, &end);
        if (end == text || *end != (i + 1 < n ? ',' : 0) || !isfinite(out[i]))
            return -EINVAL;
        text = end + 1;
    }
    return 0;
}

size_t usage_default_threads(void)
{
    return processors_usable();
}
