/* nodes/wall/finder.h -- the wall node's step: what it hears to the lists of walls that
 * it publishes.  Without bus and clock: a replay in one process calls it as the node
 * does. */
#ifndef ANLOS_NODES_WALL_FINDER_H
#define ANLOS_NODES_WALL_FINDER_H

#include "msgs/survey.pb-c.h"
#include "nodes/wall/listener.h"
#include "nodes/wall/wall_map.h"

struct finder {
    enum wall_from from;
    struct listener_config listens;
    struct wall_map wall_map;
    struct listener *listener; /* with from: echoes, once the survey is known */
    struct survey survey;
    uint64_t survey_id;
    bool has_survey;
    int64_t published_ns; /* stamp of the newest list */
    int64_t heard_ns;     /* when the newest ping came in; 0: none has */
    int64_t ping_ns;      /* its capture stamp */
};

void finder_init(struct finder *f, const struct launchfile *l);

/* 0, or a negative errno with an error. */
int finder_survey(struct finder *f, const Anlos__Survey *m, struct error *why);

void finder_ego(struct finder *f, const Anlos__EgoMotion *m, int64_t capture_ns);

/* now_ns: when it came in.  false: it came before a survey. */
bool finder_ping(struct finder *f, const Anlos__Ping *ping, int64_t capture_ns,
                 int64_t now_ns);

/* 0, or -EINVAL with an error. */
int finder_given(struct finder *f, const Anlos__WallList *m, int64_t capture_ns,
                 struct error *why);

/* After each message, and while there is none: the list that is to be published now, at
 * most ten a second, with its stamp; NULL: none is.  Borrows until the next call. */
const Anlos__WallList *finder_list(struct finder *f, int64_t now_ns, int64_t *stamp_ns);

size_t finder_unusable(const struct finder *f); /* pings of this survey */
void finder_clear(struct finder *f);

#endif
