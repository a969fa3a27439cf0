#include "nodes/anlos/bench/drive_truth.h"

static size_t room_at(const void *context, double t_s, struct room_truth *out, size_t max)
{
    return room_truth(context, t_s, out, max);
}

struct drive_truth drive_truth_room(const struct room *r)
{
    return (struct drive_truth){.at = room_at, .context = r};
}
