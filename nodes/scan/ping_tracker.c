/* SPDX-License-Identifier: MIT */
#include "nodes/scan/ping_tracker.h"

#include <errno.h>
#include <stdlib.h>

enum state { TODO, FIRED, RECORDED, DONE, LOST };

struct entry {
    enum state state;
    unsigned attempts; /* firings that came to nothing */
    bool fired_before;
    bool gone;      /* done, but dsp was restarted and has it no more */
    uint64_t order; /* of the newest firing */
};

struct ping_tracker {
    struct ping_tracker_size size;
    size_t n;              /* pings of a pass */
    struct entry *entries; /* [2][n_positions][n_speakers]; scene, then background */
    uint64_t next_order;
    unsigned retaken;
};

int ping_tracker_create(struct ping_tracker **out, const struct ping_tracker_size *size)
{
    if (!size->n_positions || !size->n_speakers ||
        size->n_speakers > SIZE_MAX / size->n_positions / 4)
        return -EINVAL;
    struct ping_tracker *l = calloc(1, sizeof *l);
    if (!l)
        return -ENOMEM;
    l->size = *size;
    l->n = size->n_positions * size->n_speakers;
    l->entries = calloc(2 * l->n, sizeof *l->entries);
    if (!l->entries) {
        free(l);
        return -ENOMEM;
    }
    *out = l;
    return 0;
}

static bool is_under_way(const struct entry *e)
{
    return e->state == FIRED || e->state == RECORDED;
}

static bool is_settled(const struct entry *e)
{
    return e->state == DONE || e->state == LOST;
}

static struct entry *pass_entries(const struct ping_tracker *l, Anlos__Pass pass)
{
    return l->entries + (pass == ANLOS__PASS__BACKGROUND ? l->n : 0);
}

/* Index within the pass, or n: there is no such ping. */
static size_t index_of(const struct ping_tracker *l, const struct ping_tracker_ping *p)
{
    if (p->position >= l->size.n_positions || p->speaker >= l->size.n_speakers)
        return l->n;
    if (p->pass != ANLOS__PASS__SCENE &&
        (p->pass != ANLOS__PASS__BACKGROUND || !l->size.background))
        return l->n;
    return p->position * l->size.n_speakers + p->speaker;
}

void ping_tracker_count(const struct ping_tracker *l, struct ping_tracker_count *out)
{
    size_t n = l->size.background ? 2 * l->n : l->n;

    *out = (struct ping_tracker_count){.expected = n, .retaken = l->retaken};
    for (size_t i = 0; i < n; i++) {
        const struct entry *e = &l->entries[i];
        out->done += e->state == DONE;
        out->lost += e->state == LOST;
        out->recording += e->state == FIRED;
        out->under_way += is_under_way(e);
        out->scene_done += i < l->n && e->state == DONE;
    }
}

Anlos__Pass ping_tracker_pass(const struct ping_tracker *l)
{
    const struct entry *background = pass_entries(l, ANLOS__PASS__BACKGROUND);

    if (l->size.background)
        for (size_t i = 0; i < l->n; i++)
            if (!is_settled(&background[i]))
                return ANLOS__PASS__BACKGROUND;
    return ANLOS__PASS__SCENE;
}

size_t ping_tracker_missing(const struct ping_tracker *l, Anlos__Pass pass,
                            size_t position, uint32_t *speakers)
{
    const struct entry *e = pass_entries(l, pass) + position * l->size.n_speakers;
    size_t n = 0;

    for (size_t s = 0; s < l->size.n_speakers; s++)
        if (e[s].state == TODO)
            speakers[n++] = (uint32_t)s;
    return n;
}

/* Without its background a scene ping is of no use. */
static void give_up(struct ping_tracker *l, Anlos__Pass pass, size_t i)
{
    struct entry *scene = &pass_entries(l, ANLOS__PASS__SCENE)[i];

    pass_entries(l, pass)[i].state = LOST;
    if (pass == ANLOS__PASS__BACKGROUND && scene->state != DONE)
        scene->state = LOST;
}

/* A firing came to nothing. */
static void miss(struct ping_tracker *l, Anlos__Pass pass, size_t i)
{
    struct entry *e = &pass_entries(l, pass)[i];

    if (++e->attempts > l->size.retries)
        give_up(l, pass, i);
    else
        e->state = TODO;
}

void ping_tracker_fire(struct ping_tracker *l, const struct ping_tracker_ping *ping)
{
    size_t i = index_of(l, ping);

    if (i == l->n)
        return;
    struct entry *e = &pass_entries(l, ping->pass)[i];
    l->retaken += e->fired_before;
    e->fired_before = true;
    e->gone = false;
    e->state = FIRED;
    e->order = l->next_order++;
}

void ping_tracker_recorded(struct ping_tracker *l, const struct ping_tracker_ping *ping)
{
    size_t i = index_of(l, ping);

    if (i == l->n)
        return;
    struct entry *e = pass_entries(l, ping->pass);
    /* What was to be recorded before it never will be. */
    for (size_t k = 0; k < l->n; k++)
        if (e[k].state == FIRED && e[i].state == FIRED && e[k].order < e[i].order)
            e[k].state = RECORDED;
    if (e[i].state == FIRED)
        e[i].state = RECORDED;
}

void ping_tracker_receipt(struct ping_tracker *l, const struct ping_tracker_ping *ping,
                          bool usable)
{
    size_t i = index_of(l, ping);

    if (i == l->n)
        return;
    struct entry *entries = pass_entries(l, ping->pass);
    struct entry *e = &entries[i];
    if (is_under_way(e))
        for (size_t k = 0; k < l->n; k++)
            if (is_under_way(&entries[k]) && entries[k].order < e->order)
                miss(l, ping->pass, k);
    if (usable) {
        e->state = DONE;
        return;
    }
    /* dsp asks for a background that it had once: the scene ping that showed it is used
     * up, through no fault of its own. */
    if (ping->pass == ANLOS__PASS__BACKGROUND) {
        struct entry *scene = &pass_entries(l, ANLOS__PASS__SCENE)[i];
        if (is_under_way(scene))
            scene->state = TODO;
        if (e->state == DONE || is_under_way(e))
            miss(l, ping->pass, i);
    } else if (is_under_way(e)) {
        miss(l, ping->pass, i);
    }
}

void ping_tracker_time_out(struct ping_tracker *l)
{
    for (size_t i = 0; i < l->n; i++) {
        if (is_under_way(&l->entries[l->n + i]))
            miss(l, ANLOS__PASS__BACKGROUND, i);
        if (is_under_way(&l->entries[i]))
            miss(l, ANLOS__PASS__SCENE, i);
    }
}

void ping_tracker_forget_under_way(struct ping_tracker *l)
{
    for (size_t i = 0; i < 2 * l->n; i++)
        if (is_under_way(&l->entries[i]))
            l->entries[i].state = TODO;
}

static void take_again(struct entry *e)
{
    e->state = TODO;
    e->attempts = 0;
}

void ping_tracker_forget_background(struct ping_tracker *l)
{
    if (!l->size.background)
        return;
    for (size_t i = 0; i < l->n; i++) {
        struct entry *e = &l->entries[l->n + i];
        if (e->state != DONE)
            continue;
        if (is_settled(&l->entries[i]))
            e->gone = true;
        else
            take_again(e);
    }
}

void ping_tracker_forget_scene(struct ping_tracker *l)
{
    for (size_t i = 0; i < l->n; i++) {
        struct entry *background = &l->entries[l->n + i];
        if (l->entries[i].state != DONE)
            continue;
        take_again(&l->entries[i]);
        if (background->gone)
            take_again(background);
    }
}

void ping_tracker_destroy(struct ping_tracker *l)
{
    if (!l)
        return;
    free(l->entries);
    free(l);
}
