#include "nodes/anlos/usage.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

int usage_flush(const char *command)
{
    errno = 0;
    if (!fflush(stdout) && !ferror(stdout))
        return EXIT_WORKED;
    fprintf(stderr, "anlos %s: standard output: %s\n", command,
            errno ? strerror(errno) : "cannot be written");
    return EXIT_FAILED;
}

#define LONGEST_WORD 32

/* Insertions, deletions and changes that make b out of a (Levenshtein). */
static size_t edit_distance(const char *a, size_t n, const char *b)
{
    size_t row[LONGEST_WORD + 1], m = strlen(b);
    if (n > LONGEST_WORD || m > LONGEST_WORD)
        return LONGEST_WORD;
    for (size_t j = 0; j <= m; j++)
        row[j] = j;
    for (size_t i = 1; i <= n; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= m; j++) {
            size_t change = diagonal + (a[i - 1] != b[j - 1]);
            size_t shift = 1 + (row[j] < row[j - 1] ? row[j] : row[j - 1]);
            diagonal = row[j];
            row[j] = change < shift ? change : shift;
        }
    }
    return row[m];
}

const char *usage_nearest(const char *word, const char *const *names)
{
    const char *best = NULL;
    size_t least = 3, n = strlen(word);
    for (; *names; names++) {
        size_t d = edit_distance(word, n, *names);
        if (d < least && d < n) {
            least = d;
            best = *names;
        }
    }
    return best;
}

static const char *nearest_option(const char *word, size_t n,
                                  const struct option *options)
{
    const char *best = NULL;
    size_t least = 4;
    for (; options->name; options++) {
        size_t d = edit_distance(word, n, options->name);
        if (d < least && d < n) {
            least = d;
            best = options->name;
        }
    }
    return best;
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
