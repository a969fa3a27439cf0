#include "nodes/anlos/can/lists.h"

#include <string.h>

static void begin(struct lists *l, const struct can_frame_data *f)
{
    l->cut += l->under_way;
    memset(l->frames, 0, sizeof l->frames);
    l->under_way = !can_unpack_list_header(f, &l->header);
}

/* The frames of objects carry the low bits of their list's counter. */
static bool belongs(const struct lists *l, enum can_id id, const struct can_frame_data *f)
{
    struct can_object o = {0};

    switch (id) {
    case CAN_ID_TIME:
        return true;
    case CAN_ID_OBJECT_STATE:
        return !can_unpack_object_state(f, &o) && o.counter == (l->header.counter & 15);
    case CAN_ID_OBJECT_DYNAMICS:
        return !can_unpack_object_dynamics(f, &o) &&
               o.counter == (l->header.counter & 15);
    case CAN_ID_OBJECT_QUALITY:
        return !can_unpack_object_quality(f, &o) && o.counter == (l->header.counter & 15);
    case CAN_ID_OBJECT_FD:
        return !can_unpack_object_fd(f, &o) && o.counter == l->header.counter;
    default:
        return false;
    }
}

static bool is_whole(const struct lists *l)
{
    unsigned n = l->header.number;
    const unsigned *frames = l->frames;
    bool classic = frames[CAN_ID_OBJECT_STATE] == n &&
                   frames[CAN_ID_OBJECT_DYNAMICS] == n &&
                   frames[CAN_ID_OBJECT_QUALITY] == n;

    return frames[CAN_ID_TIME] == 1 && (classic || frames[CAN_ID_OBJECT_FD] == n);
}

void lists_take(struct lists *l, enum can_id id, const struct can_frame_data *f)
{
    if (id == CAN_ID_LIST_HEADER)
        begin(l, f);
    else if (l->under_way && belongs(l, id, f))
        l->frames[id]++;
    if (l->under_way && is_whole(l)) {
        l->whole++;
        l->under_way = false;
    }
}
