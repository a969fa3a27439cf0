/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/speed_error/names.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/recon/auto.h"
#include "recon/imaging/imager.h"

bool bench_names_have(const char *list, const char *name)
{
    for (const char *m = list; *m; m += strlen(m) + 1)
        if (!strcmp(m, name))
            return true;
    return false;
}

bool bench_names_file(const char *name)
{
    size_t n = strlen(name);
    return n > 5 && !strcmp(name + n - 5, ".yaml");
}

char *bench_names_split(const char *text)
{
    char *out = calloc(strlen(text) + 2, 1);
    for (size_t i = 0; out && text[i]; i++)
        out[i] = text[i] == ',' ? 0 : text[i];
    return out;
}

static void join_names(char *text, size_t size, const char *names)
{
    text[0] = 0;
    for (const char *m = names; *m; m += strlen(m) + 1)
        text_add(text, size, ", ", "%s", m);
}

int bench_names_check(const char *what, const char *names, const char *known,
                      struct error *why)
{
    char list[512], hint[NEAREST_HINT_SIZE];
    for (const char *m = names; *m; m += strlen(m) + 1) {
        if (bench_names_have(known, m) || (!strcmp(what, "scene") && bench_names_file(m)))
            continue;
        join_names(list, sizeof list, known);
        return error_say(why, -ENOENT, "%s: no such %s; expected one of %s%s%s", m, what,
                         list, strcmp(what, "scene") ? "" : ", or a scene file (.yaml)",
                         nearest_hint(hint, m, known));
    }
    return *names ? 0 : error_say(why, -EINVAL, "expected the name of a %s", what);
}

static size_t list_size(const char *list)
{
    size_t n = 0;
    for (const char *m = list; *m; m += strlen(m) + 1)
        n += strlen(m) + 1;
    return n;
}

char *bench_names_all_methods(void)
{
    size_t n = list_size(imager_methods());
    char *out = calloc(n + strlen(recon_auto_name) + 2, 1);
    if (!out)
        return NULL;
    memcpy(out, imager_methods(), n);
    memcpy(out + n, recon_auto_name, strlen(recon_auto_name));
    return out;
}

int bench_names_methods(char **out, const char *asked, const char *usual,
                        const char *known, struct error *why)
{
    if (asked) {
        *out = bench_names_split(asked);
        return *out ? bench_names_check("method", *out, known, why)
                    : error_say(why, -ENOMEM, "out of memory");
    }
    if (!usual)
        usual = known;
    size_t n = list_size(usual) + 1;
    *out = malloc(n);
    if (!*out)
        return error_say(why, -ENOMEM, "out of memory");
    memcpy(*out, usual, n);
    return 0;
}
