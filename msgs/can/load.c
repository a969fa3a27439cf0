/* SPDX-License-Identifier: MIT */
#include "msgs/can/load.h"

#include "msgs/can/frames.h"

/* Stuff bits go into the first 34 bits and the data; 13 follow unstuffed. */
static double classic_s(const struct can_bus_rate *rate, size_t size)
{
    size_t stuffed = 34 + 8 * size;

    return (double)(stuffed + (stuffed - 1) / 4 + 13) / rate->nominal_bit_s;
}

/* 17 bits up to the switch of rates, then 5 and the data, stuffed; the stuff count and
 * the CRC with a fixed stuff bit before each four bits; 13 bits at the first rate again.
 * As many stuff bits as can are counted at the slow one. */
static double fd_s(const struct can_bus_rate *rate, size_t size)
{
    const size_t before = 17, ahead = (before - 1) / 4;
    size_t fast = 5 + 8 * size;
    size_t stuff = (before + fast - 1) / 4;
    size_t crc = size > 16 ? 4 + 21 + 7 : 4 + 17 + 6;

    return (double)(before + ahead + 13) / rate->nominal_bit_s +
           (double)(fast + stuff - ahead + crc) / rate->data_bit_s;
}

double can_frame_s(const struct can_bus_rate *rate, size_t size, bool fd)
{
    return fd ? fd_s(rate, size) : classic_s(rate, size);
}

static double message_s(const struct can_bus_rate *rate, enum can_id id)
{
    const struct can_message *m = can_message_find(0, id);

    return can_frame_s(rate, m->size, m->fd);
}

double can_list_s(const struct can_bus_rate *rate, size_t n_objects, bool fd_objects,
                  bool motion)
{
    double object_s = fd_objects ? message_s(rate, CAN_ID_OBJECT_FD)
                                 : message_s(rate, CAN_ID_OBJECT_STATE) +
                                       message_s(rate, CAN_ID_OBJECT_DYNAMICS) +
                                       message_s(rate, CAN_ID_OBJECT_QUALITY);

    if (motion)
        object_s += message_s(rate, CAN_ID_OBJECT_MOTION);
    return message_s(rate, CAN_ID_LIST_HEADER) + message_s(rate, CAN_ID_TIME) +
           (double)n_objects * object_s;
}

double can_view_s(const struct can_bus_rate *rate, size_t n_corners)
{
    return (double)n_corners * message_s(rate, CAN_ID_FIELD_OF_VIEW);
}

double can_cycles_s(const struct can_bus_rate *rate)
{
    double sum = CAN_STATUS_CHANGES * message_s(rate, CAN_ID_STATUS) +
                 CAN_SAVE_REPEATS * message_s(rate, CAN_ID_SAVE_REQUEST);
    size_t n;
    const struct can_message *m = can_messages(&n);

    for (size_t i = 0; i < n; i++)
        if (m[i].cycle_ms)
            sum += (1e3 / m[i].cycle_ms + 1.0) * message_s(rate, m[i].id);
    return sum;
}
