#include "nodes/launcher/crew.h"

#include <string.h>

#include "nodes/rt/launchfile_hosts.h"
#include "nodes/rt/onlooker.h"

int crew_fill(struct crew *c, const struct launcher_config *cfg)
{
    for (unsigned i = 0; i < cfg->launch->n_nodes && c->n < CREW_MAX; i++) {
        const char *name = cfg->launch->nodes[i];
        if (!launchfile_runs_here(cfg->launch, name))
            continue;
        int err = program_fill(&c->programs[c->n], cfg, name);
        if (err)
            return err;
        child_init(&c->children[c->n], name, c->programs[c->n].argv);
        c->children[c->n].aside = !strcmp(name, "record");
        c->n++;
    }
    return 0;
}

bool crew_runs(const struct crew *c, bool aside)
{
    for (unsigned i = 0; i < c->n; i++)
        if (c->children[i].pid > 0 && (aside || !c->children[i].aside))
            return true;
    return false;
}

bool crew_goes_on(const struct crew *c)
{
    for (unsigned i = 0; i < c->n; i++)
        if (!c->children[i].aside && (c->children[i].phase == CHILD_RUNNING ||
                                      c->children[i].phase == CHILD_PAUSING))
            return true;
    return false;
}

bool crew_has_aside(const struct crew *c, const char *name)
{
    for (unsigned i = 0; i < c->n; i++)
        if (c->children[i].aside && (!name || !strcmp(c->children[i].name, name)))
            return true;
    return false;
}

unsigned crew_count(const struct crew *c, enum child_phase phase)
{
    unsigned n = 0;

    for (unsigned i = 0; i < c->n; i++)
        n += c->children[i].phase == phase;
    return n;
}

unsigned crew_lost(const struct crew *c)
{
    unsigned n = 0;

    for (unsigned i = 0; i < c->n; i++)
        n += c->children[i].phase != CHILD_RUNNING &&
             c->children[i].phase != CHILD_ENDED && !onlooker_is(c->children[i].name);
    return n;
}

void crew_signal(const struct crew *c, bool aside, int number)
{
    for (unsigned i = 0; i < c->n; i++)
        if (c->children[i].aside == aside)
            child_signal(&c->children[i], number);
}

void crew_start_rest(struct crew *c, int64_t start_ns)
{
    for (unsigned i = 0; i < c->n; i++)
        if (!c->children[i].started_ns && !c->children[i].aside)
            c->children[i].restart_ns = start_ns;
}
