/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_finder.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PERIOD_NS 100000000LL  /* from list to list */
#define QUIET_NS  1000000000LL /* without pings */

struct wall_finder {
    struct wall_finder_config cfg;
    struct wall_map map;
    struct wall_listener *listener; /* of walls from echoes, once the survey is known */
    struct wall_receiver receiver;  /* where pings come; else not open */
    struct survey survey;
    uint64_t survey_id;   /* 0: there is none */
    int64_t published_ns; /* stamp of the newest list */
    int64_t heard_ns;     /* when the newest ping came in; 0: none has */
    int64_t ping_ns;      /* its capture stamp */
};

void wall_finder_config_default(struct wall_finder_config *cfg)
{
    const double vertical_rad = 2.0 * M_PI / 180.0;

    *cfg = (struct wall_finder_config){
        .map = {.from = WALL_FROM_SURVEY, .lost_s = 3.0, .vertical_rad = vertical_rad},
        .listener = {.vertical = true,
                     .vertical_rad = vertical_rad,
                     .reach_m = 5.0,
                     .every_s = 0.5}};
}

int wall_finder_create(struct wall_finder **out, const struct wall_finder_config *cfg)
{
    struct wall_finder *f = calloc(1, sizeof *f);

    if (!f)
        return -ENOMEM;
    f->cfg = *cfg;
    wall_map_init(&f->map, &cfg->map);
    *out = f;
    return 0;
}

int wall_finder_survey(struct wall_finder *f, const struct survey *survey,
                       struct error *why)
{
    struct survey fresh;
    uint64_t id = survey_id(survey);

    if (f->survey_id == id)
        return 0;
    int err = survey_copy(&fresh, survey);
    if (err)
        return error_say(why, err, "survey: %s", strerror(-err));
    bool keep = f->survey_id && f->survey.sound_speed_m_s == fresh.sound_speed_m_s &&
                survey_is_same_array(&f->survey, &fresh);
    wall_listener_destroy(f->listener);
    f->listener = NULL;
    wall_receiver_clear(&f->receiver);
    survey_clear(&f->survey);
    f->survey = fresh;
    wall_map_survey(&f->map, &f->survey, keep);
    if (f->cfg.map.from == WALL_FROM_ECHOES)
        err = wall_listener_create(&f->listener, &f->cfg.listener, &f->survey, why);
    if (!err && f->listener && f->cfg.takes_pings)
        err = wall_receiver_open(&f->receiver, &f->survey, f->cfg.listener.reach_m, NULL,
                                 why);
    f->survey_id = err ? 0 : id; /* the same one again fails again */
    return err;
}

uint64_t wall_finder_survey_id(const struct wall_finder *f)
{
    return f->survey_id;
}

void wall_finder_ego(struct wall_finder *f, const struct ego_motion *motion,
                     int64_t capture_ns)
{
    wall_map_ego(&f->map, motion, capture_ns);
}

bool wall_finder_returns(struct wall_finder *f, const struct wall_returns *returns,
                         int64_t now_ns)
{
    const struct ping *ping = &returns->ping;
    struct wall_estimates heard;
    bool blind = false;

    if (!f->listener)
        return false;
    if (!f->heard_ns) /* what is heard is told from the first ping on */
        f->published_ns = 0;
    f->heard_ns = now_ns;
    f->ping_ns = ping->capture_ns;
    wall_map_advance(&f->map, ping->capture_ns);
    if (wall_listener_take(f->listener, returns, wall_map_path(&f->map), &heard,
                           &blind) &&
        !blind)
        wall_map_estimates(&f->map, &heard);
    return true;
}

bool wall_finder_ping(struct wall_finder *f, const struct ping *ping, int64_t now_ns)
{
    struct wall_returns returns = {.ping = *ping};

    if (f->receiver.survey)
        wall_receiver_take(&f->receiver, ping, NULL, &returns);
    return wall_finder_returns(f, &returns, now_ns);
}

int wall_finder_given(struct wall_finder *f, const struct walls *given,
                      int64_t capture_ns, struct error *why)
{
    return f->survey_id ? wall_map_given(&f->map, given, capture_ns, why) : 0;
}

/* What is heard is told as it was at the newest ping.  What is not heard itself is told
 * for the present; so is what was heard, when no pings come any more. */
const struct walls *wall_finder_list(struct wall_finder *f, int64_t now_ns,
                                     int64_t *stamp_ns)
{
    if (f->cfg.map.from != WALL_FROM_ECHOES || now_ns - f->heard_ns >= QUIET_NS)
        wall_map_advance(&f->map, now_ns);
    else
        now_ns = f->ping_ns;
    if (!f->survey_id ||
        (now_ns >= f->published_ns && now_ns - f->published_ns < PERIOD_NS))
        return NULL;
    *stamp_ns = f->published_ns = now_ns;
    return wall_map_list(&f->map);
}

struct wall_map *wall_finder_map(struct wall_finder *f)
{
    return &f->map;
}

size_t wall_finder_unusable(const struct wall_finder *f)
{
    return f->listener ? wall_listener_unusable(f->listener) : 0;
}

void wall_finder_destroy(struct wall_finder *f)
{
    if (!f)
        return;
    wall_listener_destroy(f->listener);
    wall_receiver_clear(&f->receiver);
    survey_clear(&f->survey);
    free(f);
}
