#include "nodes/record/choice.h"

#include <errno.h>
#include <fnmatch.h>
#include <stdlib.h>

#include "nodes/rt/patterns.h"

/* The first pattern that no topic matches, in out. */
static bool finds_stray(const char *patterns, char out[PATTERN_SIZE])
{
    while (patterns && (patterns = patterns_next(patterns, out))) {
        const struct topic *t = topics_all();
        while (t->name && fnmatch(out, t->name, 0))
            t++;
        if (!t->name)
            return true;
    }
    return false;
}

int choice_make(struct choice *c, const char *topics, const char *exclude,
                struct complaint *why)
{
    char stray[PATTERN_SIZE];
    size_t all = 0;

    *c = (struct choice){0};
    if (finds_stray(topics, stray) || finds_stray(exclude, stray))
        return complain(why, -EINVAL,
                        "no topic is called \"%s\"; 'anlos topic list' has their names",
                        stray);
    while (topics_all()[all].name)
        all++;
    c->topics = calloc(all, sizeof *c->topics);
    if (!c->topics)
        return complain(why, -ENOMEM, "out of memory");
    for (const struct topic *t = topics_all(); t->name; t++)
        if (patterns_match(topics, t->name) &&
            !(exclude && patterns_match(exclude, t->name)))
            c->topics[c->n++] = t;
    if (c->n)
        return 0;
    choice_clear(c);
    return complain(why, -EINVAL, "no topic is left to be recorded");
}

void choice_clear(struct choice *c)
{
    free(c->topics);
    *c = (struct choice){0};
}
