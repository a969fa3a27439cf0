/* SPDX-License-Identifier: MIT */
#include "nodes/rt/setting.h"

#include "msgs/convert.h"

/* Of what does not hold the nodes that work with it complain. */

bool setting_survey(struct setting *s, const Anlos__Survey *m)
{
    struct error why;
    struct survey fresh;

    if ((s->has_survey && s->survey_id == m->id) || survey_from_message(&fresh, m, &why))
        return false;
    survey_clear(&s->survey);
    s->survey = fresh;
    s->survey_id = m->id;
    s->has_survey = true;
    s->has_walls = false; /* those were of another array */
    walls_from_survey(&s->walls, &s->survey);
    return true;
}

bool setting_walls(struct setting *s, const Anlos__WallList *m)
{
    struct error why;

    if (walls_from_message(&s->walls, m, &why))
        return false;
    s->has_walls = true;
    return true;
}

const struct wall *setting_wall(const struct setting *s)
{
    return s->has_survey && s->walls.n ? &s->walls.list[0].plane : NULL;
}

void setting_clear(struct setting *s)
{
    survey_clear(&s->survey);
    *s = (struct setting){.has_survey = false};
}
