/* SPDX-License-Identifier: MIT */
#include "hal/device.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

const char *device_arg(const char *uri, const char *scheme)
{
    size_t n = strlen(scheme);
    if (strncmp(uri, scheme, n) || uri[n] != ':')
        return NULL;
    return uri + n + 1;
}

/* "one, two or three" */
static const char *list_words(const char *const *words, char *out, size_t size)
{
    out[0] = 0;
    for (size_t i = 0; words[i]; i++)
        text_add(out, size, words[i + 1] ? ", " : " or ", "%s", words[i]);
    return out;
}

static bool is_known(const char *const *known, const char *key)
{
    for (; known && *known; known++)
        if (!strcmp(*known, key))
            return true;
    return !known;
}

static int parse_option(struct device *d, char *text, const char *const *known,
                        struct error *why)
{
    char list[320];
    char *equals = strchr(text, '=');
    if (!equals || equals == text)
        return error_say(why, -EINVAL, "option \"%s\": expected key=value", text);
    *equals = 0;
    if (!is_known(known, text))
        return error_say(why, -EINVAL, "there is no option \"%s\"; expected %s", text,
                         known[0] ? list_words(known, list, sizeof list) : "none");
    if (device_option(d, text))
        return error_say(why, -EINVAL, "option \"%s\" is given twice", text);
    if (d->n_options == DEVICE_MAX_OPTIONS)
        return error_say(why, -EINVAL, "more than %d options", DEVICE_MAX_OPTIONS);
    d->options[d->n_options].key = text;
    d->options[d->n_options++].value = equals + 1;
    return 0;
}

int device_parse(struct device *out, const char *arg, const char *const *known,
                 struct error *why)
{
    char *rest = NULL;
    *out = (struct device){.text = strdup(arg)};
    if (!out->text)
        return error_say(why, -ENOMEM, "out of memory");
    out->path = out->text;
    char *question = strchr(out->text, '?');
    if (!question)
        return 0;
    *question = 0;
    for (char *o = strtok_r(question + 1, "&", &rest); o;
         o = strtok_r(NULL, "&", &rest)) {
        int err = parse_option(out, o, known, why);
        if (err) {
            device_clear(out);
            return err;
        }
    }
    return 0;
}

const char *device_option(const struct device *d, const char *key)
{
    for (size_t i = 0; i < d->n_options; i++)
        if (!strcmp(d->options[i].key, key))
            return d->options[i].value;
    return NULL;
}

int device_number(const struct device *d, const char *key, double min, double max,
                  double *value, struct error *why)
{
    char *end;
    const char *text = device_option(d, key);
    if (!text)
        return 0;
    double x = strtod(text, &end);
    if (end == text || *end || !(x >= min && x <= max))
        return error_say(why, -EINVAL, "option %s=%s: expected a number in %g..%g", key,
                         text, min, max);
    *value = x;
    return 0;
}

int device_choice(const struct device *d, const char *key, const char *const *words,
                  struct error *why)
{
    char list[320];
    const char *text = device_option(d, key);
    if (!text)
        return 0;
    for (int i = 0; words[i]; i++)
        if (!strcmp(words[i], text))
            return i;
    return error_say(why, -EINVAL, "option %s=%s: expected %s", key, text,
                     list_words(words, list, sizeof list));
}

void device_clear(struct device *d)
{
    free(d->text);
    *d = (struct device){.text = NULL};
}
