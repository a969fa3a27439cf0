#include "nodes/anlos/doctor/doctor.h"

#include <inttypes.h>
#include <string.h>

#include "nodes/anlos/node/census.h"
#include "nodes/rt/rundir.h"

static void look_at_health(struct findings *f, const struct census_node *n)
{
    switch (n->row->state) {
    case TABLE_FAULT:
        finding_add(f, FINDING_WRONG, "nodes", "%s has a fault: %s", n->name,
                    n->row->text);
        finding_todo(f, "'anlos node info %s' and its lines in the log say more",
                     n->name);
        break;
    case TABLE_DEGRADED:
        finding_add(f, FINDING_NOTE, "nodes", "%s: %s", n->name, n->row->text);
        break;
    case TABLE_STARTING:
        finding_add(f, FINDING_NOTE, "nodes", "%s is not ready yet: %s", n->name,
                    n->row->text);
        break;
    default:
        break;
    }
}

static void look_at_losses(struct findings *f, const struct census_node *n)
{
    const struct table_node *row = n->row;

    for (size_t i = 0; i < row->n_links; i++) {
        const struct table_link *l = &row->links[i];
        if (!l->gaps && !l->dropped)
            continue;
        finding_add(f, FINDING_NOTE, "losses",
                    "%s: of %s, %" PRIu64 " messages never arrived and %" PRIu64
                    " were pushed out of its queue, %" PRIu64 " came",
                    n->name, l->topic->name, l->gaps, l->dropped, l->messages);
        finding_todo(f, l->dropped
                            ? "it is slower than what comes: 'anlos top' shows its "
                              "share of a core; fewer previews, more cores"
                            : "the buffers above, or a process that was stopped "
                              "for long");
    }
    if (row->refused)
        finding_add(f, FINDING_NOTE, "losses",
                    "%s refused %" PRIu64 " messages: another version of anlos, or "
                    "something foreign in the run folder",
                    n->name, row->refused);
}

static void look_at_node(struct findings *f, const struct census_node *n)
{
    switch (n->life) {
    case CENSUS_DIED:
        finding_add(f, FINDING_NOTE, "nodes",
                    "%s was killed or crashed (process %ld): its sockets are left",
                    n->name, n->pid);
        finding_todo(f,
                     "they go when it starts again; its last lines in the log say why");
        break;
    case CENSUS_SILENT:
        finding_add(f, FINDING_WRONG, "nodes",
                    "%s (process %ld) lives, but its health does not come: it hangs, or "
                    "is busy for seconds",
                    n->name, n->pid);
        finding_todo(f, "'kill -9 %ld' when it stays so: the launcher starts it again",
                     n->pid);
        break;
    case CENSUS_ALIVE:
    case CENSUS_ELSEWHERE:
        look_at_health(f, n);
        look_at_losses(f, n);
        break;
    default:
        break;
    }
}

/* Nodes of the launch file that do not run while others do. */
static void look_for_missing(struct findings *f, const struct doctor *d,
                             const struct launchfile *l, const struct census *c)
{
    for (unsigned i = 0; i < l->n_nodes; i++) {
        const struct census_node *n = census_find(c, l->nodes[i]);
        if (!n || n->life >= CENSUS_ALIVE)
            continue;
        bool elsewhere = l->hosts.n && !doctor_runs(d, l, n->name);
        finding_add(f, FINDING_WRONG, "nodes",
                    elsewhere ? "%s, on another machine, is not heard, others are"
                              : "%s of the launch file does not run, others do",
                    n->name);
        finding_todo(f, elsewhere
                            ? "does it run there? cable, firewall, addresses of hosts"
                            : "the launcher's log says why");
    }
}

void doctor_system(const void *ctx, struct findings *f)
{
    const struct doctor *d = ctx;
    char run_dir[RUNDIR_SIZE];
    struct complaint why = {""};
    struct census *c = NULL;
    struct launchfile *l = doctor_load(d);
    const struct census_config cfg = {.run_dir = run_dir};

    if (rundir_name(run_dir, d->run_dir, &why) || rundir_check(run_dir, &why)) {
        launchfile_destroy(l);
        return; /* doctor_run_dir says so */
    }
    if (census_take(&c, &cfg, &why)) {
        finding_add(f, FINDING_WRONG, "nodes", "%s", why.text);
        launchfile_destroy(l);
        return;
    }
    size_t n = census_count_alive(c), before = f->n;
    for (size_t i = 0; i < c->n; i++)
        look_at_node(f, &c->nodes[i]);
    if (l && n)
        look_for_missing(f, d, l, c);
    if (!n)
        finding_add(f, FINDING_OK, "nodes", "nothing runs in %s", run_dir);
    else
        finding_add(f, FINDING_OK, "nodes", "%zu run in %s%s", n, run_dir,
                    f->n == before ? ", ready, nothing lost" : "");
    census_free(c);
    launchfile_destroy(l);
}
