/* SPDX-License-Identifier: MIT */
#include "nodes/can/config.h"

void can_config_sender(struct sender_config *out, const struct launchfile *l)
{
    *out = (struct sender_config){
        .base_id = CAN_BASE_DEFAULT,
        .bus = {.rate = {.nominal_bit_s = 500e3, .data_bit_s = 2e6}, .load = 0.5},
    };
    if (!l)
        return;
    out->base_id = l->can.base_id + CAN_SENSOR_STEP * l->can.sensor;
    out->bus = (struct bus_budget_config){
        .rate = {.nominal_bit_s = l->can.bitrate, .data_bit_s = l->can.data_bitrate},
        .fd = l->can.fd,
        .motion = l->can.motion,
        .view = l->can.field_of_view,
        .load = l->can.load};
    out->stale_ns = l->scan.fixed ? WATCH_STALE_NS : 0;
}

void can_config_watch(struct watch_config *out, const struct launchfile *l)
{
    *out = (struct watch_config){.fixed = l->scan.fixed,
                                 .wall = launchfile_has_node(l, "wall")};
}
