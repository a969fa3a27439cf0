/* SPDX-License-Identifier: MIT */
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

static bool is_optional_node(const char *node)
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
        !strcmp(topic, topic_progress()->name) || !strcmp(topic, topic_save()->name))
        return false;
    if (cfg->topics)
        return patterns_match(cfg->topics, topic);
    return cfg->alone || !patterns_match(launch_exclude, topic);
}

/* A pattern that nothing matches is a mistake. */
static int check_patterns(struct playback *p, const char *patterns, struct error *why)
{
    char pattern[PATTERN_SIZE];
    struct bag_iterator_part *part;

    while (patterns && (patterns = patterns_next(patterns, pattern))) {
        bool found = false;
        for (size_t i = 0; (part = bag_iterator_part(p->bag_iterator, i)); i++)
            found |= !fnmatch(pattern, part->topic->name, 0);
        if (!found)
            return error_say(why, -EINVAL,
                             "%s: no topic is called \"%s\"; 'anlos bag info' has their "
                             "names",
                             p->cfg.bag_iterator.bag, pattern);
    }
    return 0;
}

/* What the vehicle said comes from the node can, which is told nothing in a replay, and
 * may run. */
static void play_vehicle(const struct playback *p, struct bag_iterator_part *part)
{
    const char *vehicle = "vehicle";

    if (is_in_launch(&p->cfg, part->node) && topic_is_published_by(part->topic, vehicle))
        snprintf(part->node, sizeof part->node, "%s", vehicle);
}

/* 0: it is played, 1: not, as somebody else does it. */
static int take_part(struct playback *p, const char *node, const struct topic *t,
                     struct error *why)
{
    struct error inner = {""};

    if (is_in_launch(&p->cfg, node) || is_optional_node(node))
        return 1;
    int err = playback_publisher_add(p->playback_publisher, node, t, &inner);
    if (err == -EADDRINUSE && p->cfg.alone)
        return 1;
    return err ? error_say(why, err, "%s", inner.text) : 0;
}

static int take_parts(struct playback *p, struct error *why)
{
    struct bag_iterator_part *part;
    size_t n = 0;

    for (size_t i = 0; (part = bag_iterator_part(p->bag_iterator, i)); i++) {
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
        return error_say(why, -EINVAL,
                         "%s: nothing is left to play: the nodes that run say all that "
                         "is asked for themselves",
                         p->cfg.bag_iterator.bag);
    /* Sound that was imported has no scan beside it. */
    if (is_asked_for(&p->cfg, topic_scan_status()->name))
        p->says_status = !take_part(p, "scan", topic_scan_status(), NULL);
    int err = playback_publisher_await_recorders(p->playback_publisher);
    return err ? error_say(why, err, "out of memory") : 0;
}

static bool plays(const struct playback *p, const struct topic *t)
{
    struct bag_iterator_part *part;

    for (size_t i = 0; (part = bag_iterator_part(p->bag_iterator, i)); i++)
        if (part->topic == t && part->wanted)
            return true;
    return false;
}

static bool speaks(const void *ctx, const char *node, const struct topic *t)
{
    const struct playback *p = ctx;

    return !p->cfg.several_hosts &&
           (playback_publisher_has(p->playback_publisher, node, t) ||
            (subscribers_has(&p->subscribers, node) && topic_is_published_by(t, node)));
}

/* Its own launch file's nodes live in this replay, or will not start. */
static int refuse_live(const struct playback *p, const struct presence_locks *locks,
                       struct error *why)
{
    for (const char *const *n = topics_nodes(); *n; n++)
        if (strcmp(*n, "play") != 0 && strcmp(*n, "record") != 0 &&
            strcmp(*n, "view") != 0 && !is_in_launch(&p->cfg, *n) &&
            presence_of(locks, p->cfg.run_dir, *n) == PRESENCE_ALIVE &&
            !presence_replays(p->cfg.run_dir, *n))
            return error_say(why, -EADDRINUSE,
                             "%s: the node \"%s\" of a live system runs here: stop that "
                             "system, or choose another runtime directory (--run-dir)",
                             p->cfg.run_dir, *n);
    return 0;
}

static void find_subscribers(struct playback *p, const struct presence_locks *locks)
{
    subscribers_init(&p->subscribers, speaks, p);
    for (size_t i = 0; i < p->cfg.n_nodes; i++)
        if (!is_optional_node(p->cfg.nodes[i]))
            subscribers_expect(&p->subscribers, p->cfg.nodes[i]);
    if (!p->cfg.alone)
        return;
    for (const char *const *n = topics_nodes(); *n; n++) {
        bool ours = false;
        for (size_t i = 0; playback_publisher_node(p->playback_publisher, i); i++)
            ours |= !strcmp(playback_publisher_node(p->playback_publisher, i), *n);
        if (!ours && !is_optional_node(*n) &&
            presence_of(locks, p->cfg.run_dir, *n) == PRESENCE_ALIVE)
            subscribers_expect(&p->subscribers, *n);
    }
}

int playback_cast(struct playback *p, struct error *why)
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
    find_subscribers(p, &locks);
    bool dsp = subscribers_has(&p->subscribers, "dsp");
    if (dsp && plays(p, topic_ping()))
        p->flow = topic_ping();
    else if (!dsp && subscribers_has(&p->subscribers, "recon") &&
             plays(p, topic_traces()))
        p->flow = topic_traces();
    return 0;
}
