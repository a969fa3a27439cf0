#include <errno.h>
#include <math.h>

#include "foxglove/transforms.pb-c.h"
#include "nodes/foxglove/convert.h"
#include "nodes/foxglove/parts.h"

static Foxglove__FrameTransform *transform(struct arena *a, int64_t t_ns,
                                           const char *parent, const char *child,
                                           const double origin[3],
                                           const double axes[3][3])
{
    Foxglove__FrameTransform *t = arena_one(a, sizeof *t);

    foxglove__frame_transform__init(t);
    t->timestamp = part_time(a, t_ns);
    t->parent_frame_id = arena_print(a, "%s", parent);
    t->child_frame_id = arena_print(a, "%s", child);
    t->translation = part_vector(a, origin);
    t->rotation = part_quaternion(a, axes);
    return t;
}

/* From where survey_to_vehicle puts the array's origin and the ends of its axes. */
static Foxglove__FrameTransform *mount(struct arena *a, const struct survey *s,
                                       int64_t t_ns)
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    double origin[3], axes[3][3];

    survey_to_vehicle(s, zero, origin);
    for (int i = 0; i < 3; i++) {
        double unit[3] = {i == 0, i == 1, i == 2}, end[3], length = 0.0;
        survey_to_vehicle(s, unit, end);
        for (int k = 0; k < 3; k++)
            length += (end[k] - origin[k]) * (end[k] - origin[k]);
        for (int k = 0; k < 3; k++)
            axes[i][k] = (end[k] - origin[k]) / sqrt(length);
    }
    return transform(a, t_ns, FRAME_VEHICLE, FRAME_ARRAY, origin,
                     (const double(*)[3])axes);
}

int convert_transforms(struct arena *a, const struct setting *s,
                       const struct foxglove_message *m, ProtobufCMessage **out)
{
    Foxglove__FrameTransforms *t = arena_one(a, sizeof *t);
    double along[3];

    if (!s->has_survey)
        return -EAGAIN;
    foxglove__frame_transforms__init(t);
    t->transforms = arena_array(a, 2, sizeof *t->transforms);
    if (!t->transforms)
        return -ENOMEM;
    if (s->survey.has_mount)
        t->transforms[t->n_transforms++] = mount(a, &s->survey, m->publish_ns);
    for (int i = 0; i < 3; i++)
        along[i] = s->stage_m * s->survey.stage_axis[i];
    t->transforms[t->n_transforms++] =
        transform(a, m->publish_ns, FRAME_ARRAY, FRAME_STAGE, along, NULL);
    *out = &t->base;
    return a->failed ? -ENOMEM : 0;
}
