/* SPDX-License-Identifier: MIT */
/* nodes/scan/main.c: "health", "survey", "stage/state", "ping", "receipt" ->
 * "stage/command", "array/fire", "scan/status" */
#include <string.h>

#include "nodes/scan/controller.h"
#include "nodes/scan/peers.h"

#define SILENCE_S 5.0

/* A display or a report that is away does not keep an array that stands from listening.
 */
static bool is_needed(const char *node, bool fixed)
{
    static const char *const not_needed[] = {"scan", "record", "view", "report", "stage"};
    size_t n = fixed ? 5 : 2;

    for (size_t i = 0; i < n; i++)
        if (!strcmp(node, not_needed[i]))
            return false;
    return true;
}

static int open_scan(struct controller *c)
{
    const struct launchfile *l = node_launch(c->node);
    const char *needs[PEERS_MAX];
    struct scan_config cfg = {.background = l->scan.background,
                              .background_frames = l->scan.background_frames,
                              .has_stage = launchfile_moves_stage(l),
                              .window = l->scan.window,
                              .retries = l->scan.retries,
                              .speakers = l->scan.speakers,
                              .n_speakers = l->scan.n_speakers,
                              .timeout_s = l->scan.timeout_s,
                              .silence_s = SILENCE_S,
                              .needs = needs};

    for (unsigned i = 0; i < l->n_nodes && cfg.n_needs < PEERS_MAX; i++)
        if (is_needed(l->nodes[i], l->scan.fixed))
            needs[cfg.n_needs++] = l->nodes[i];
    return l->scan.fixed ? fixed_scan_create(&c->fixed, &cfg)
                         : scan_create(&c->scan, &cfg);
}

int main(int argc, char **argv)
{
    struct controller c = {.state = (Anlos__ScanStatus__State)-1};
    struct error why = {""};
    int err =
        node_create(&c.node, "scan",
                    "Steps the stage, fires the array, takes again what was lost; or "
                    "keeps an array going that stands.",
                    argc, argv);

    if (!c.node)
        return err;
    err = open_scan(&c);
    return loop_main(c.node, &controller_loop, &c, err, &why);
}
