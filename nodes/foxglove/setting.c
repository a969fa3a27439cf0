/* SPDX-License-Identifier: MIT */
#include "nodes/foxglove/setting.h"

#include <math.h>

#include "msgs/convert.h"
#include "msgs/stage.pb-c.h"

static bool take_survey(struct setting *s, const Anlos__Survey *m)
{
    struct error why;
    struct survey fresh;

    if (s->has_survey && s->survey_id == m->id)
        return false;
    if (survey_from_message(&fresh, m, &why))
        return false; /* the nodes that work with it complain */
    survey_clear(&s->survey);
    s->survey = fresh;
    s->survey_id = m->id;
    s->has_survey = true;
    s->has_walls = false; /* those were of another array */
    walls_from_survey(&s->walls, &s->survey);
    return true;
}

static void take_walls(struct setting *s, const Anlos__WallList *m)
{
    struct error why;

    if (!walls_from_message(&s->walls, m, &why))
        s->has_walls = true;
}

bool setting_take(struct setting *s, const struct foxglove_message *m)
{
    if (m->topic == topic_survey())
        return take_survey(s, (const Anlos__Survey *)m->content);
    if (m->topic == topic_wall())
        take_walls(s, (const Anlos__WallList *)m->content);
    if (m->topic == topic_stage_state()) {
        double at_m = ((const Anlos__StageState *)m->content)->position_m;
        s->stage_m = isfinite(at_m) ? at_m : s->stage_m;
    }
    return false;
}

bool setting_wall(const struct setting *s, struct wall *out)
{
    if (!s->has_survey || !s->walls.n)
        return false;
    *out = s->walls.list[0].plane;
    return true;
}

void setting_clear(struct setting *s)
{
    survey_clear(&s->survey);
    *s = (struct setting){.has_survey = false};
}
