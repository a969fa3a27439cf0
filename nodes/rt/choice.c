/* SPDX-License-Identifier: MIT */
#include "nodes/rt/choice.h"

#include <string.h>

size_t choice_index(choice_names *names, const char *name)
{
    size_t i = 0;

    while (names(i) && strcmp(names(i), name))
        i++;
    return i;
}

void choice_list(choice_names *names, char *text, size_t size)
{
    size_t used = 0;

    text[0] = '\0';
    for (size_t i = 0; names(i) && used < size; i++) {
        const char *between = !i ? "" : names(i + 1) ? ", " : " or ";
        used += (size_t)snprintf(text + used, size - used, "%s%s", between, names(i));
    }
}

void choice_print(choice_names *names, FILE *to)
{
    for (size_t i = 0; names(i); i++)
        fprintf(to, "%s\n", names(i));
}
