/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/score/drive_told.h"

#include <math.h>

#include "nodes/can/config.h"

void drive_told_init(struct drive_told *t, const struct launchfile *l)
{
    struct sender_config cfg;

    can_config_sender(&cfg, l);
    *t = (struct drive_told){.last_ns = 0};
    sender_init(&t->sender, &cfg);
}

void drive_told_survey(struct drive_told *t, const Anlos__Survey *survey)
{
    sender_survey(&t->sender, survey);
}

/* Returns how many frames it has. */
static size_t read_object(const struct can_frame_data *f,
                          const struct bus_budget_config *bus, struct can_object *o)
{
    size_t n = bus->motion;

    *o = (struct can_object){.id = 0};
    if (bus->motion)
        can_unpack_object_motion(f++, o);
    if (!bus->fd) {
        can_unpack_object_state(&f[0], o);
        can_unpack_object_dynamics(&f[1], o);
        can_unpack_object_quality(&f[2], o);
        return n + 3;
    }
    can_unpack_object_fd(f, o);
    o->sigma_m[0] = sqrt(o->covariance_m2[0]);
    o->sigma_m[1] = sqrt(o->covariance_m2[3]);
    o->correlation = o->covariance_m2[1] / (o->sigma_m[0] * o->sigma_m[1]);
    return n + 1;
}

void drive_told_list(struct drive_told *t, const Anlos__DetectionList *list,
                     int64_t capture_ns, int64_t now_ns)
{
    struct sender_list out;

    sender_list(&t->sender, list, capture_ns, &out);
    sender_finalize(&t->sender, &out, now_ns, t->last_ns);
    t->last_ns = now_ns;
    t->n = 0;
    for (size_t i = 2; i < out.n_frames; t->n++) /* after header and time */
        i += read_object(&out.frames[i], &t->sender.cfg.bus, &t->objects[t->n]);
    sender_sent(&t->sender, &out);
}
