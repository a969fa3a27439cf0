/* SPDX-License-Identifier: MIT */
#include "nodes/wall/finding.h"

#include <errno.h>
#include <stdlib.h>

#include "msgs/convert.h"
#include "nodes/rt/launchfile_pipeline.h"

struct finding {
    struct wall_finder *finder;
    struct returns_room room;
    struct walls_view view;
    Anlos__WallList list; /* the newest; borrows from both */
};

int finding_create(struct finding **out, const struct wall_finder_config *cfg)
{
    struct finding *f = calloc(1, sizeof *f);

    if (!f)
        return -ENOMEM;
    int err = wall_finder_create(&f->finder, cfg);
    if (err)
        free(f);
    else
        *out = f;
    return err;
}

int finding_survey(struct finding *f, const Anlos__Survey *m, struct error *why)
{
    struct survey survey;

    if (m->id && wall_finder_survey_id(f->finder) == m->id)
        return 0;
    int err = survey_from_message(&survey, m, why);
    if (err)
        return err;
    err = wall_finder_survey(f->finder, &survey, why);
    survey_clear(&survey);
    return launchfile_name_key(why, err);
}

void finding_ego(struct finding *f, const Anlos__EgoMotion *m, int64_t capture_ns)
{
    struct ego_motion motion;

    wall_finder_ego(f->finder, ego_from_message(&motion, m), capture_ns);
}

bool finding_echoes(struct finding *f, const Anlos__Echoes *m, int64_t capture_ns,
                    int64_t now_ns)
{
    struct wall_returns returns;

    if (returns_from_message(&returns, &f->room, m, capture_ns))
        returns = (struct wall_returns){.ping = {.capture_ns = capture_ns}};
    return wall_finder_returns(f->finder, &returns, now_ns);
}

int finding_given(struct finding *f, const Anlos__WallList *m, int64_t capture_ns,
                  struct error *why)
{
    struct walls given;
    int err = walls_from_message(&given, m, why);

    return err ? err : wall_finder_given(f->finder, &given, capture_ns, why);
}

static const Anlos__WallList *message(struct finding *f, const struct walls *walls)
{
    walls_to_message(walls, wall_finder_map(f->finder)->text, &f->view, &f->list);
    return &f->list;
}

const Anlos__WallList *finding_list(struct finding *f, int64_t now_ns, int64_t *stamp_ns)
{
    const struct walls *walls = wall_finder_list(f->finder, now_ns, stamp_ns);

    return walls ? message(f, walls) : NULL;
}

const Anlos__WallList *finding_walls(struct finding *f)
{
    return message(f, wall_map_list(wall_finder_map(f->finder)));
}

struct wall_finder *finding_finder(const struct finding *f)
{
    return f->finder;
}

void finding_destroy(struct finding *f)
{
    if (!f)
        return;
    wall_finder_destroy(f->finder);
    returns_room_clear(&f->room);
    free(f);
}
