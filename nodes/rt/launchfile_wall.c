#include "nodes/rt/launchfile_wall.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "hal/survey/place.h"

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

static int copy_names(struct launchfile *l, const struct launch_text_wall *t,
                      struct error *why)
{
    static const char *const from[] = {[WALL_FROM_SURVEY] = "survey",
                                       [WALL_FROM_TOPIC] = "topic",
                                       [WALL_FROM_ECHOES] = "echoes"};
    const char *prior = t->prior ? t->prior : "vertical";
    size_t k = 0;

    while (t->from && k < COUNT(from) && strcmp(t->from, from[k]) != 0)
        k++;
    if (k == COUNT(from))
        return yaml_error_say(why, -EINVAL, l->path, "wall.from",
                              "expected survey, topic or echoes, not %s", t->from);
    l->wall.from = (enum wall_from)k;
    l->wall.vertical = !strcmp(prior, "vertical");
    if (!l->wall.vertical && strcmp(prior, "none") != 0)
        return yaml_error_say(why, -EINVAL, l->path, "wall.prior",
                              "expected vertical or none, not %s", prior);
    return 0;
}

static int copy_numbers(struct launchfile *l, const struct launch_text_wall *t,
                        struct error *why)
{
    const struct {
        const char *key;
        const double *text;
        double *value, otherwise, min, max;
    } numbers[] = {
        {"wall.vertical_deg", t->vertical_deg, &l->wall.vertical_deg, 2.0, 0.1, 20.0},
        {"wall.reach_m", t->reach_m, &l->wall.reach_m, 5.0, 0.3, 20.0},
        {"wall.every_s", t->every_s, &l->wall.every_s, 0.5, 0.05, 60.0},
        {"wall.lost_s", t->lost_s, &l->wall.lost_s, 3.0, 0.1, 600.0},
    };

    for (size_t i = 0; i < COUNT(numbers); i++) {
        double value = numbers[i].text ? *numbers[i].text : numbers[i].otherwise;
        int err = yaml_check_range(l->path, numbers[i].key, value, numbers[i].min,
                                   numbers[i].max, why);
        if (err)
            return err;
        *numbers[i].value = value;
    }
    return 0;
}

static int copy_free_view(struct launchfile *l, const struct launch_text_wall *t,
                          struct error *why)
{
    if (t->free_view_m_count == 1 || t->free_view_m_count == 2)
        return yaml_error_say(why, -EINVAL, l->path, "wall.free_view_m",
                              "expected at least 3 corners, each [x, z]");
    for (unsigned i = 0; i < t->free_view_m_count; i++)
        for (int a = 0; a < 2; a++) {
            char key[48];
            double x = t->free_view_m[i][a];
            snprintf(key, sizeof key, "wall.free_view_m[%u]", i);
            if (!(fabs(x) <= 1000.0))
                return yaml_error_say(why, -EINVAL, l->path, key,
                                      "expected [x, z] within 1000 m, not %g", x);
            l->wall.free_view_m[i][a] = x;
        }
    l->wall.n_corners = t->free_view_m_count;
    return 0;
}

int launchfile_copy_wall(struct launchfile *l, const struct launch_text *t,
                         struct error *why)
{
    int err = copy_names(l, &t->wall, why);

    if (!err)
        err = copy_numbers(l, &t->wall, why);
    return err ? err : copy_free_view(l, &t->wall, why);
}
