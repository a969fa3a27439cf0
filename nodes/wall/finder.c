#include "nodes/wall/finder.h"

#include "msgs/convert.h"

#define PERIOD_NS 100000000LL  /* from list to list */
#define QUIET_NS  1000000000LL /* without pings */

void finder_init(struct finder *f, const struct launchfile *l)
{
    *f = (struct finder){
        .from = l->wall.from,
        .listens = {.vertical = l->wall.vertical,
                    .vertical_rad = l->wall.vertical_deg * 3.14159265358979 / 180.0,
                    .reach_m = l->wall.reach_m,
                    .every_s = l->wall.every_s}};
    wall_map_init(&f->wall_map, l);
}

int finder_survey(struct finder *f, const Anlos__Survey *m, struct error *why)
{
    struct survey fresh;

    if (f->has_survey && f->survey_id == m->id)
        return 0;
    int err = survey_from_message(&fresh, m, why);
    if (err)
        return err;
    listener_destroy(f->listener);
    f->listener = NULL;
    survey_clear(&f->survey);
    f->survey = fresh;
    f->survey_id = m->id;
    f->has_survey = true;
    wall_map_survey(&f->wall_map, &f->survey);
    return f->from == WALL_FROM_ECHOES
               ? listener_create(&f->listener, &f->listens, &f->survey, why)
               : 0;
}

void finder_ego(struct finder *f, const Anlos__EgoMotion *m, int64_t capture_ns)
{
    wall_map_ego(&f->wall_map, m, capture_ns);
}

bool finder_ping(struct finder *f, const Anlos__Ping *ping, int64_t capture_ns,
                 int64_t now_ns)
{
    struct wall_estimates heard;
    bool blind = false;

    if (!f->listener)
        return false;
    if (!f->heard_ns) /* what is heard is told from the first ping on */
        f->published_ns = 0;
    f->heard_ns = now_ns;
    f->ping_ns = capture_ns;
    wall_map_advance(&f->wall_map, capture_ns);
    if (listener_ping(f->listener, ping, capture_ns, wall_map_path(&f->wall_map), &heard,
                      &blind) &&
        !blind)
        wall_map_estimates(&f->wall_map, &heard);
    return true;
}

int finder_given(struct finder *f, const Anlos__WallList *m, int64_t capture_ns,
                 struct error *why)
{
    return f->has_survey ? wall_map_given(&f->wall_map, m, capture_ns, why) : 0;
}

/* What is heard is told as it was at the newest ping.  What is not heard itself is told
 * for the present; so is what was heard, when no pings come any more. */
const Anlos__WallList *finder_list(struct finder *f, int64_t now_ns, int64_t *stamp_ns)
{
    if (f->from != WALL_FROM_ECHOES || now_ns - f->heard_ns >= QUIET_NS)
        wall_map_advance(&f->wall_map, now_ns);
    else
        now_ns = f->ping_ns;
    if (!f->has_survey ||
        (now_ns >= f->published_ns && now_ns - f->published_ns < PERIOD_NS))
        return NULL;
    *stamp_ns = f->published_ns = now_ns;
    return wall_map_list(&f->wall_map);
}

size_t finder_unusable(const struct finder *f)
{
    return f->listener ? listener_unusable(f->listener) : 0;
}

void finder_clear(struct finder *f)
{
    listener_destroy(f->listener);
    survey_clear(&f->survey);
    f->listener = NULL;
}
