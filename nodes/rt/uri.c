/* SPDX-License-Identifier: MIT */
#include "nodes/rt/uri.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/device.h"

bool uri_has_scheme(const char *uri, const char *scheme)
{
    return device_arg(uri, scheme) != NULL;
}

static const char *after_scheme(const char *uri)
{
    const char *colon = strchr(uri, ':');

    return colon ? colon + 1 : uri;
}

char *uri_path(const char *uri)
{
    const char *path = after_scheme(uri);

    return strndup(path, strcspn(path, "?"));
}

/* The value of an option inside the URI, or NULL; *size is its length. */
static const char *find_option(const char *uri, const char *key, size_t *size)
{
    const char *p = strchr(uri, '?');
    size_t n = strlen(key);

    while (p) {
        p++;
        if (!strncmp(p, key, n) && p[n] == '=') {
            *size = strcspn(p + n + 1, "&");
            return p + n + 1;
        }
        p = strchr(p, '&');
    }
    return NULL;
}

char *uri_option(const char *uri, const char *key)
{
    size_t size = 0;
    const char *value = find_option(uri, key, &size);

    return strndup(value ? value : "", size);
}

/* "FOLDER/" at place `at`, unless what stands there is empty or absolute. */
static char *insert_folder(const char *uri, const char *at, size_t size,
                           const char *folder)
{
    char *out = NULL;

    if (!size || *at == '/')
        return strdup(uri);
    if (asprintf(&out, "%.*s%s/%s", (int)(at - uri), uri, folder, at) < 0)
        return NULL;
    return out;
}

char *uri_in_folder(const char *uri, const char *folder)
{
    const char *path = after_scheme(uri);

    return insert_folder(uri, path, strcspn(path, "?"), folder);
}

char *uri_option_in_folder(const char *uri, const char *folder, const char *key)
{
    size_t size;
    const char *value = find_option(uri, key, &size);

    return value ? insert_folder(uri, value, size, folder) : strdup(uri);
}

char *uri_set_option(const char *uri, const char *key, const char *value)
{
    size_t size;
    const char *old = find_option(uri, key, &size);
    char *out = NULL;
    int n;

    if (old)
        n = asprintf(&out, "%.*s%s%s", (int)(old - uri), uri, value, old + size);
    else
        n = asprintf(&out, "%s%c%s=%s", uri, strchr(uri, '?') ? '&' : '?', key, value);
    return n < 0 ? NULL : out;
}

int uri_replace(char **uri, char *result)
{
    if (!result)
        return -ENOMEM;
    free(*uri);
    *uri = result;
    return 0;
}
