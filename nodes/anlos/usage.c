/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/usage.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "dsp/nearest.h"
#include "nodes/rt/json_whole.h"
#include "nodes/rt/processors.h"

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

int usage_outcome(const char *command, int err, const struct error *why)
{
    if (!err)
        return EXIT_WORKED;
    fprintf(stderr, "anlos %s: %s\n", command, why->text);
    switch (err) {
    case -EINTR:
        return EXIT_INTERRUPTED;
    case -ENOENT:
    case -EINVAL:
    case -ENOTSUP:
    case -ENOTDIR:
        return EXIT_BAD_INPUT;
    default:
        return EXIT_FAILED;
    }
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

static const char *nearest_option(const char *word, size_t n,
                                  const struct option *options)
{
    struct nearest s = nearest_begin(word, n, 3);
    for (; options->name; options++)
        nearest_try(&s, options->name);
    return s.best;
}

int usage_option_error(const char *command, int code, char **argv,
                       const struct option *options)
{
    const char *at = argv[optind - 1];
    if (code == ':')
        return usage_error(command, "%s: expected a value after it", at);
    if (strncmp(at, "--", 2))
        return usage_error(command, "-%c: no such option", optopt);
    size_t n = strcspn(at + 2, "=");
    for (const struct option *o = options; o->name; o++)
        if (strlen(o->name) == n && !strncmp(o->name, at + 2, n))
            return usage_error(command, "--%s: takes no value", o->name);
    const char *near = nearest_option(at + 2, n, options);
    if (near)
        return usage_error(command, "%.*s: no such option; did you mean --%s?",
                           (int)n + 2, at, near);
    return usage_error(command, "%.*s: no such option", (int)n + 2, at);
}

int usage_next(struct usage *u, int argc, char **argv)
{
    opterr = 0;
    if (!u->begun)
        optind = 1;
    u->begun = true;
    int code = getopt_long(argc, argv, u->short_options ? u->short_options : ":h",
                           u->options, NULL);
    if (code == -1)
        return 0;
    if (code == 'h')
        return ~(fputs(u->help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED);
    if (code == '?' || code == ':')
        return ~usage_option_error(u->command, code, argv, u->options);
    return code;
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

int usage_take_count(const char *command, const char *option, const char *text,
                     size_t min, size_t max, size_t *out)
{
    return usage_count(text, min, max, out)
               ? usage_error(command, "--%s %s: expected a number from %zu to %zu",
                             option, text, min, max)
               : 0;
}

int usage_positive(const char *text, double *out)
{
    char *end;
    double v = strtod(text, &end);
    if (end == text || *end || !isfinite(v) || v <= 0.0)
        return -EINVAL;
    *out = v;
    return 0;
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
