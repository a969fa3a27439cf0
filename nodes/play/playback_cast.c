#include <errno.h>
#include <fnmatch.h>
#include <stdio.h>
#include <string.h>

#include "nodes/play/playback_state.h"
#include "nodes/rt/patterns.h"
#include "nodes/rt/presence.h"

/* What the nodes of a launch file do not say themselves: not what one was told to do, how
 * a node was then, or who had used what. */
static const char launch_exclude[] =
    "stage/command,stage/manual,array/fire,receipt,health,log,clock";

/* They listen, and nothing depends on them; what they said of themselves was of then. */
static const char *const onlookers[] = {"play", "record", "view", "launcher"};

static bool is_onlooker(const char *node)
{
    for (size_t i = 0; i < sizeof onlookers / sizeof *onlookers; i++)
        if (!strcmp(node, onlookers[i]))
            return true;
    return false;
}

static bool is_in_launch(const struct playback_config *cfg, const char *node)
{
    for (size_t i = 0; i < cfg->n_nodes; i++)
        if (!strcmp(cfg->nodes[i], node))
            return true;
    return false;
}

static bool is_asked_for(const struct playback_config *cfg, const char *topic)
{
    if ((cfg->exclude && patterns_match(cfg->exclude, topic)) ||
        !strcmp(topic, topic_progress()->name))
        return false;
    if (cfg->topics)
        return patterns_match(cfg->topics, topic);
    return cfg->alone || !patterns_match(launch_exclude, topic);
}

/* A pattern that nothing matches is a mistake. */
static int check_patterns(struct playback *p, const char *patterns, struct complaint *why)
{
    char pattern[PATTERN_SIZE];
    struct tape_part *part;

    while (patterns && (patterns = patterns_next(patterns, pattern))) {
        bool found = false;
        for (size_t i = 0; (part = tape_part(p->tape, i)); i++)
            found |= !fnmatch(pattern, part->topic->name, 0);
        if (!found)
            return complain(why, -EINVAL,
                            "%s: no topic is called \"%s\"; 'anlos bag info' has their "
                            "names",
                            p->cfg.tape.bag, pattern);
    }
    return 0;
}

/* What the vehicle said comes from the node can, which is told nothing in a replay, and
 * may run. */
static void play_vehicle(const struct playback *p, struct tape_part *part)
{
    const char *vehicle = "vehicle";

    if (is_in_launch(&p->cfg, part->node) && topic_is_published_by(part->topic, vehicle))
        snprintf(part->node, sizeof part->node, "%s", vehicle);
}

/* 0: it is played, 1: not, as somebody else does it. */
static int take_part(struct playback *p, const char *node, const struct topic *t,
                     struct complaint *why)
{
    struct complaint inner = {""};

    if (is_in_launch(&p->cfg, node) || is_onlooker(node))
        return 1;
    int err = stand_in_add(p->stand_in, node, t, &inner);
    if (err == -EADDRINUSE && p->cfg.alone)
        return 1;
    return err ? complain(why, err, "%s", inner.text) : 0;
}

static int take_parts(struct playback *p, struct complaint *why)
{
    struct tape_part *part;
    size_t n = 0;

    for (size_t i = 0; (part = tape_part(p->tape, i)); i++) {
        part->wanted = is_asked_for(&p->cfg, part->topic->name);
        play_vehicle(p, part);
        int taken = part->wanted ? take_part(p, part->node, part->topic, why) : 1;
        if (taken < 0)
            return taken;
        part->wanted = !taken;
        n += part->wanted;
        p->has_status |= part->wanted && part->topic == topic_scan_status();
    }
    if (!n)
        return complain(why, -EINVAL,
                        "%s: nothing is left to play: the nodes that run say all that "
                        "is asked for themselves",
                        p->cfg.tape.bag);
    /* Sound that was imported has no scan beside it. */
    if (is_asked_for(&p->cfg, topic_scan_status()->name))
        p->says_status = !take_part(p, "scan", topic_scan_status(), NULL);
    return 0;
}

static bool plays(const struct playback *p, const struct topic *t)
{
    struct tape_part *part;

    for (size_t i = 0; (part = tape_part(p->tape, i)); i++)
        if (part->topic == t && part->wanted)
            return true;
    return false;
}

static bool speaks(const void *ctx, const char *node, const struct topic *t)
{
    const struct playback *p = ctx;

    return !p->cfg.several_hosts &&
           (stand_in_has(p->stand_in, node, t) ||
            (audience_has(&p->audience, node) && topic_is_published_by(t, node)));
}

/* Its own launch file's nodes live in this replay, or will not start. */
static int refuse_live(const struct playback *p, const struct presence_locks *locks,
                       struct complaint *why)
{
    for (const char *const *n = topics_nodes(); *n; n++)
        if (strcmp(*n, "play") != 0 && strcmp(*n, "record") != 0 &&
            strcmp(*n, "view") != 0 && !is_in_launch(&p->cfg, *n) &&
            presence_of(locks, p->cfg.run_dir, *n) == PRESENCE_ALIVE &&
            !presence_replays(p->cfg.run_dir, *n))
            return complain(why, -EADDRINUSE,
                            "%s: the node \"%s\" of a live system runs here: stop that "
                            "system, or choose another runtime directory (--run-dir)",
                            p->cfg.run_dir, *n);
    return 0;
}

static void find_audience(struct playback *p, const struct presence_locks *locks)
{
    audience_init(&p->audience, speaks, p);
    for (size_t i = 0; i < p->cfg.n_nodes; i++)
        if (!is_onlooker(p->cfg.nodes[i]))
            audience_expect(&p->audience, p->cfg.nodes[i]);
    if (!p->cfg.alone)
        return;
    for (const char *const *n = topics_nodes(); *n; n++) {
        bool ours = false;
        for (size_t i = 0; stand_in_node(p->stand_in, i); i++)
            ours |= !strcmp(stand_in_node(p->stand_in, i), *n);
        if (!ours && !is_onlooker(*n) &&
            presence_of(locks, p->cfg.run_dir, *n) == PRESENCE_ALIVE)
            audience_expect(&p->audience, *n);
    }
}

int playback_cast(struct playback *p, struct complaint *why)
{
    struct presence_locks locks;

    presence_read(&locks, NULL);
    int err = refuse_live(p, &locks, why);
    if (!err)
        err = check_patterns(p, p->cfg.topics, why);
    if (!err)
        err = check_patterns(p, p->cfg.exclude, why);
    if (!err)
        err = take_parts(p, why);
    if (err)
        return err;
    find_audience(p, &locks);
    bool dsp = audience_has(&p->audience, "dsp");
    if (dsp && plays(p, topic_ping()))
        p->flow = topic_ping();
    else if (!dsp && audience_has(&p->audience, "recon") && plays(p, topic_traces()))
        p->flow = topic_traces();
    return 0;
}
