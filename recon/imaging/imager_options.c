/* SPDX-License-Identifier: MIT */
#include "recon/imaging/imager_options.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/error.h"
#include "recon/imaging/imager.h"

#define AT(field) offsetof(struct imager_options, field)
#define COUNT(a)  (sizeof(a) / sizeof *(a))

const struct imager_option imager_option_table[] = {
    {"base", IMAGER_OPTION_METHOD, 0.0, 0.0, AT(base), "iterative\0",
     "image to sharpen; lct: light-cone operator"},
    {"iterations", IMAGER_OPTION_COUNT, 1.0, 1e5, AT(iterations), "iterative\0sparse\0",
     "at most so many"},
    {"tolerance", IMAGER_OPTION_REAL, 1e-9, 0.5, AT(tolerance), "iterative\0sparse\0",
     "relative residual that ends them"},
    {"l1", IMAGER_OPTION_REAL, 0.0, 1.0, AT(l1), "iterative\0sparse\0",
     "weight of sparsity, over the brightest"},
    {"tv", IMAGER_OPTION_REAL, 0.0, 1.0, AT(tv), "iterative\0",
     "weight of total variation, over the brightest"},
    {"tv_isotropic", IMAGER_OPTION_SWITCH, 0.0, 0.0, AT(tv_isotropic), "iterative\0",
     "variation of gradients, not axis by axis"},
    {"rho", IMAGER_OPTION_REAL, 1e-6, 1e6, AT(rho), "iterative\0",
     "penalty to start with: time, not the result"},
    {"snr_db", IMAGER_OPTION_REAL, -40.0, 100.0, AT(snr_db), "lct\0",
     "of the Wiener filter: more is sharper and noisier"},
    {"dmo", IMAGER_OPTION_CHOICE, 0.0, 0.0, AT(dmo), "fast\0",
     "dip moveout; auto: where targets are near"},
    {"sharpen", IMAGER_OPTION_REAL, 0.0, 8.0, AT(sharpen), "fast\0",
     "weight of high sounds, an exponent: narrower, more sidelobes"},
    {"lightcone", IMAGER_OPTION_CHOICE, 0.0, 0.0, AT(lightcone), "paper\0",
     "transform; auto: unless it sees mirrors"},
    {"coherence", IMAGER_OPTION_REAL, 0.0, 8.0, AT(coherence), "backprojection\0",
     "exponent of the coherence factor; 0: off"},
    {.name = NULL},
};

static const char *const choices[] = {"auto", "never", "always"}; /* -1, 0, 1 */

void imager_options_default(struct imager_options *o)
{
    *o = (struct imager_options){
        .base = "fast",
        .iterations = 200,
        .tolerance = 1e-3,
        .l1 = 0.05,
        .tv = 0.01,
        .rho = 0.06,
        .snr_db = 20.0,
        .dmo = -1,
        .lightcone = -1,
    };
}

static const void *place(const struct imager_option *option,
                         const struct imager_options *o)
{
    return (const char *)o + option->offset;
}

static void *own_place(const struct imager_option *option, struct imager_options *o)
{
    return (char *)o + option->offset;
}

static unsigned bit(const struct imager_option *option)
{
    return 1u << (option - imager_option_table);
}

/* -- words ------------------------------------------------------------------------------
 */

/* Those a base can be. */
static bool is_base(const char *method)
{
    return strcmp(method, "iterative") && imager_has_method(method);
}

void imager_option_range(const struct imager_option *option, char *text, size_t size)
{
    text[0] = '\0';
    switch (option->kind) {
    case IMAGER_OPTION_METHOD:
        for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
            if (is_base(m))
                text_add(text, size, ", ", "%s", m);
        break;
    case IMAGER_OPTION_SWITCH:
        snprintf(text, size, "yes, no");
        break;
    case IMAGER_OPTION_CHOICE:
        for (size_t i = 0; i < COUNT(choices); i++)
            text_add(text, size, ", ", "%s", choices[i]);
        break;
    default:
        snprintf(text, size, "%g to %g", option->min, option->max);
    }
}

void imager_option_value(const struct imager_option *option,
                         const struct imager_options *o, char *text, size_t size)
{
    const void *at = place(option, o);
    switch (option->kind) {
    case IMAGER_OPTION_REAL:
        snprintf(text, size, "%g", *(const double *)at);
        break;
    case IMAGER_OPTION_COUNT:
        snprintf(text, size, "%zu", *(const size_t *)at);
        break;
    case IMAGER_OPTION_SWITCH:
        snprintf(text, size, "%s", *(const bool *)at ? "yes" : "no");
        break;
    case IMAGER_OPTION_METHOD:
        snprintf(text, size, "%s", *(const char *const *)at);
        break;
    case IMAGER_OPTION_CHOICE:
        snprintf(text, size, "%s", choices[*(const int *)at + 1]);
    }
}

/* -- setting ----------------------------------------------------------------------------
 */

static bool take_number(const struct imager_option *option, struct imager_options *o,
                        const char *value)
{
    char *end;
    double v = strtod(value, &end);
    if (end == value || *end || !(v >= option->min && v <= option->max))
        return false;
    if (option->kind == IMAGER_OPTION_REAL)
        *(double *)own_place(option, o) = v;
    else if (v == floor(v))
        *(size_t *)own_place(option, o) = (size_t)v;
    else
        return false;
    return true;
}

static bool take_switch(bool *out, const char *value)
{
    static const char *const words[2][3] = {{"no", "false", "0"}, {"yes", "true", "1"}};
    for (int on = 0; on < 2; on++) {
        for (size_t i = 0; i < COUNT(words[on]); i++) {
            if (strcmp(words[on][i], value))
                continue;
            *out = on;
            return true;
        }
    }
    return false;
}

static bool take_choice(int *out, const char *value)
{
    for (size_t i = 0; i < COUNT(choices); i++) {
        if (strcmp(choices[i], value))
            continue;
        *out = (int)i - 1;
        return true;
    }
    return false;
}

/* The name is kept as the table of methods has it, which stays. */
static bool take_base(const char **out, const char *value)
{
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1) {
        if (strcmp(m, value) || !is_base(m))
            continue;
        *out = m;
        return true;
    }
    return false;
}

static bool take(const struct imager_option *option, struct imager_options *o,
                 const char *value)
{
    switch (option->kind) {
    case IMAGER_OPTION_SWITCH:
        return take_switch(own_place(option, o), value);
    case IMAGER_OPTION_CHOICE:
        return take_choice(own_place(option, o), value);
    case IMAGER_OPTION_METHOD:
        return take_base(own_place(option, o), value);
    default:
        return take_number(option, o, value);
    }
}

static const struct imager_option *find(const char *name, size_t n)
{
    for (const struct imager_option *i = imager_option_table; i->name; i++)
        if (strlen(i->name) == n && !strncmp(i->name, name, n))
            return i;
    return NULL;
}

int imager_option_set(struct imager_options *o, const char *text, char *why, size_t size)
{
    size_t n = strcspn(text, "=");
    const struct imager_option *option = find(text, n);
    char list[256] = "";
    if (!option) {
        for (const struct imager_option *i = imager_option_table; i->name; i++)
            text_add(list, sizeof list, ", ", "%s", i->name);
        snprintf(why, size, "%.*s: no such option; expected one of %s", (int)n, text,
                 list);
        return -EINVAL;
    }
    imager_option_range(option, list, sizeof list);
    if (text[n] != '=') {
        snprintf(why, size, "%s: expected %s=VALUE, with a value of %s", text,
                 option->name, list);
        return -EINVAL;
    }
    if (!take(option, o, text + n + 1)) {
        snprintf(why, size, "%s: expected %s%s", text,
                 option->kind == IMAGER_OPTION_COUNT  ? "a whole number, "
                 : option->kind == IMAGER_OPTION_REAL ? ""
                                                      : "one of ",
                 list);
        return -EINVAL;
    }
    o->given |= bit(option);
    return 0;
}

static size_t size_of(enum imager_option_kind kind)
{
    switch (kind) {
    case IMAGER_OPTION_REAL:
        return sizeof(double);
    case IMAGER_OPTION_COUNT:
        return sizeof(size_t);
    case IMAGER_OPTION_SWITCH:
        return sizeof(bool);
    case IMAGER_OPTION_METHOD:
        return sizeof(const char *);
    default:
        return sizeof(int);
    }
}

void imager_options_overlay(struct imager_options *o, const struct imager_options *given)
{
    for (const struct imager_option *i = imager_option_table; i->name; i++)
        if (given->given & bit(i))
            memcpy(own_place(i, o), place(i, given), size_of(i->kind));
    o->given |= given->given;
}

/* -- whose ------------------------------------------------------------------------------
 */

bool imager_option_is_given(const struct imager_options *o, const char *name)
{
    const struct imager_option *option = find(name, strlen(name));
    return option && o->given & bit(option);
}

static bool lists(const struct imager_option *option, const char *method)
{
    for (const char *m = option->methods; *m; m += strlen(m) + 1)
        if (!strcmp(m, method))
            return true;
    return false;
}

bool imager_option_concerns(const struct imager_option *option,
                            const struct imager_options *o, const char *method)
{
    if (lists(option, method))
        return true;
    /* with base lct the operator stands in ADMM, not the transform with its filter */
    return !strcmp(method, "iterative") && strcmp(o->base, "lct") &&
           lists(option, o->base);
}

int imager_options_check(const struct imager_options *o, const char *method, char *why,
                         size_t size)
{
    for (const struct imager_option *i = imager_option_table; i->name; i++) {
        char list[128] = "";
        if (!(o->given & bit(i)) || imager_option_concerns(i, o, method))
            continue;
        for (const char *m = i->methods; *m; m += strlen(m) + 1)
            text_add(list, sizeof list, ", ", "%s", m);
        snprintf(why, size, "%s: method '%s' does not use it; it is for %s", i->name,
                 method, list);
        return -EINVAL;
    }
    return 0;
}
