/* SPDX-License-Identifier: MIT */
#include "msgs/can/frames.h"

#include <errno.h>
#include <math.h>
#include <string.h>

static const int64_t second_ns = 1000000000;

/* content: the structure that the signals' members count from. */
static void pack(struct can_frame_data *out, uint32_t base, enum can_id id,
                 const void *content)
{
    const struct can_message *m = can_message_find(0, id);

    memset(out, 0, sizeof *out);
    out->id = base + id;
    out->size = m->size;
    out->fd = m->fd;
    for (size_t i = 0; i < m->n_signals; i++)
        can_signal_put(&m->signals[i], out, content);
}

static int unpack(const struct can_frame_data *f, enum can_id id, void *content)
{
    const struct can_message *m = can_message_find(0, id);

    if (f->size != m->size || f->fd != m->fd)
        return -EINVAL;
    for (size_t i = 0; i < m->n_signals; i++)
        can_signal_take(&m->signals[i], f, content);
    return 0;
}

void can_pack_status(struct can_frame_data *out, uint32_t base,
                     const struct can_status *s)
{
    pack(out, base, CAN_ID_STATUS, s);
}

void can_pack_diagnosis(struct can_frame_data *out, uint32_t base,
                        const struct can_diagnosis *d)
{
    pack(out, base, CAN_ID_DIAGNOSIS, d);
}

void can_pack_list_header(struct can_frame_data *out, uint32_t base,
                          const struct can_list_header *h)
{
    struct can_list_header sent = *h;

    sent.version = CAN_INTERFACE_VERSION;
    pack(out, base, CAN_ID_LIST_HEADER, &sent);
}

void can_pack_time(struct can_frame_data *out, uint32_t base, int64_t stamp_ns)
{
    struct can_time t = {0};

    if (stamp_ns > 0) {
        int64_t seconds = stamp_ns / second_ns;
        t.seconds = seconds < UINT32_MAX ? (uint32_t)seconds : UINT32_MAX;
        t.fraction = (uint16_t)(stamp_ns % second_ns * 65536 / second_ns);
    }
    pack(out, base, CAN_ID_TIME, &t);
}

void can_pack_object_state(struct can_frame_data *out, uint32_t base,
                           const struct can_object *o)
{
    pack(out, base, CAN_ID_OBJECT_STATE, o);
}

void can_pack_object_dynamics(struct can_frame_data *out, uint32_t base,
                              const struct can_object *o)
{
    pack(out, base, CAN_ID_OBJECT_DYNAMICS, o);
}

void can_pack_object_quality(struct can_frame_data *out, uint32_t base,
                             const struct can_object *o)
{
    pack(out, base, CAN_ID_OBJECT_QUALITY, o);
}

void can_pack_object_motion(struct can_frame_data *out, uint32_t base,
                            const struct can_object *o)
{
    pack(out, base, CAN_ID_OBJECT_MOTION, o);
}

void can_pack_object_fd(struct can_frame_data *out, uint32_t base,
                        const struct can_object *o)
{
    pack(out, base, CAN_ID_OBJECT_FD, o);
}

bool can_object_fits(const struct can_object *o, bool fd, size_t offset)
{
    static const enum can_id classic[] = {CAN_ID_OBJECT_MOTION, CAN_ID_OBJECT_STATE,
                                          CAN_ID_OBJECT_DYNAMICS, CAN_ID_OBJECT_QUALITY},
                             flexible[] = {CAN_ID_OBJECT_MOTION, CAN_ID_OBJECT_FD};
    const enum can_id *ids = fd ? flexible : classic;
    bool fits = true;

    for (size_t i = 0; i < (fd ? 2 : 4); i++) {
        const struct can_message *m = can_message_find(0, ids[i]);
        for (size_t k = 0; k < m->n_signals; k++)
            if (m->signals[k].member.type == CAN_MEMBER_DOUBLE &&
                m->signals[k].member.at == offset)
                fits &= can_signal_fits(&m->signals[k], o);
    }
    return fits;
}

void can_pack_field_of_view(struct can_frame_data *out, uint32_t base,
                            const struct can_view_corner *c)
{
    pack(out, base, CAN_ID_FIELD_OF_VIEW, c);
}

void can_pack_ego_motion(struct can_frame_data *out, uint32_t base,
                         const struct can_ego_motion *e)
{
    pack(out, base, CAN_ID_EGO_MOTION, e);
}

void can_pack_ambient(struct can_frame_data *out, uint32_t base,
                      const struct can_ambient *a)
{
    pack(out, base, CAN_ID_AMBIENT, a);
}

void can_pack_wall_in(struct can_frame_data *out, uint32_t base,
                      const struct can_wall_in *w)
{
    pack(out, base, CAN_ID_WALL_IN, w);
}

void can_pack_wall_ends_in(struct can_frame_data *out, uint32_t base,
                           const struct can_wall_ends_in *w)
{
    pack(out, base, CAN_ID_WALL_ENDS_IN, w);
}

void can_pack_save_request(struct can_frame_data *out, uint32_t base,
                           const struct can_save_request *r)
{
    pack(out, base, CAN_ID_SAVE_REQUEST, r);
}

int can_unpack_status(const struct can_frame_data *f, struct can_status *out)
{
    return unpack(f, CAN_ID_STATUS, out);
}

int can_unpack_diagnosis(const struct can_frame_data *f, struct can_diagnosis *out)
{
    return unpack(f, CAN_ID_DIAGNOSIS, out);
}

int can_unpack_list_header(const struct can_frame_data *f, struct can_list_header *out)
{
    return unpack(f, CAN_ID_LIST_HEADER, out);
}

int can_unpack_time(const struct can_frame_data *f, int64_t *stamp_ns)
{
    struct can_time t;
    int err = unpack(f, CAN_ID_TIME, &t);

    if (!err)
        *stamp_ns = t.seconds * second_ns + t.fraction * second_ns / 65536;
    return err;
}

int can_unpack_object_state(const struct can_frame_data *f, struct can_object *out)
{
    return unpack(f, CAN_ID_OBJECT_STATE, out);
}

int can_unpack_object_dynamics(const struct can_frame_data *f, struct can_object *out)
{
    return unpack(f, CAN_ID_OBJECT_DYNAMICS, out);
}

int can_unpack_object_quality(const struct can_frame_data *f, struct can_object *out)
{
    return unpack(f, CAN_ID_OBJECT_QUALITY, out);
}

int can_unpack_object_motion(const struct can_frame_data *f, struct can_object *out)
{
    return unpack(f, CAN_ID_OBJECT_MOTION, out);
}

int can_unpack_object_fd(const struct can_frame_data *f, struct can_object *out)
{
    return unpack(f, CAN_ID_OBJECT_FD, out);
}

int can_unpack_field_of_view(const struct can_frame_data *f, struct can_view_corner *out)
{
    return unpack(f, CAN_ID_FIELD_OF_VIEW, out);
}

int can_unpack_ego_motion(const struct can_frame_data *f, struct can_ego_motion *out)
{
    return unpack(f, CAN_ID_EGO_MOTION, out);
}

int can_unpack_ambient(const struct can_frame_data *f, struct can_ambient *out)
{
    return unpack(f, CAN_ID_AMBIENT, out);
}

int can_unpack_wall_in(const struct can_frame_data *f, struct can_wall_in *out)
{
    return unpack(f, CAN_ID_WALL_IN, out);
}

int can_unpack_wall_ends_in(const struct can_frame_data *f, struct can_wall_ends_in *out)
{
    return unpack(f, CAN_ID_WALL_ENDS_IN, out);
}

int can_unpack_save_request(const struct can_frame_data *f, struct can_save_request *out)
{
    return unpack(f, CAN_ID_SAVE_REQUEST, out);
}
