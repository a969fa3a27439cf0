/* SPDX-License-Identifier: MIT */
#include "msgs/topics.h"

#include <string.h>

#include "msgs/array.pb-c.h"
#include "msgs/clock.pb-c.h"
#include "msgs/detections.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/host.pb-c.h"
#include "msgs/log.pb-c.h"
#include "msgs/save.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/stage.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/traces.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "msgs/wall.pb-c.h"

#define KB ((size_t)1 << 10)
#define MB ((size_t)1 << 20)

static const char *const nodes[] = {"stage", "array", "scan",   "dsp",      "recon",
                                    "track", "can",   "report", "launcher", "record",
                                    "play",  "view",  "wall",   NULL};

static const struct topic topics[TOPICS_COUNT + 1] = {
#define ROW(name, topic, schema, rate, policy, depth, size, ...)                         \
    {topic, &anlos__##schema##__descriptor, rate, policy, depth, size, {__VA_ARGS__}},
    TOPICS(ROW)};

const struct topic *topics_all(void)
{
    return topics;
}

const struct topic *topics_find(const char *name)
{
    for (const struct topic *t = topics; t->name; t++)
        if (strcmp(t->name, name) == 0)
            return t;
    return NULL;
}

const char *const *topics_nodes(void)
{
    return nodes;
}

bool topics_have_node(const char *name)
{
    const char *const *n = topics_nodes();

    while (*n && strcmp(*n, name))
        n++;
    return *n;
}

const char *topic_publisher(const struct topic *t, size_t i)
{
    const char *const *list = t->publishers;
    if (list[0] && strcmp(list[0], "*") == 0)
        list = nodes;
    for (size_t k = 0; k < i; k++)
        if (!list[k])
            return NULL;
    return list[i];
}

bool topic_is_published_by(const struct topic *t, const char *node)
{
    const char *name;
    for (size_t i = 0; (name = topic_publisher(t, i)); i++)
        if (strcmp(name, node) == 0)
            return true;
    return false;
}

#define FIND(name, ...)                                                                  \
    const struct topic *topic_##name(void)                                               \
    {                                                                                    \
        return &topics[TOPICS_PLACE_##name];                                             \
    }
TOPICS(FIND)
