/* SPDX-License-Identifier: MIT */
/* Bytes as frames on the vehicle's bus, into the receiver of launch/receiver: any length
 * and time, protected or not, so that lists come together too. */
#include <math.h>
#include <string.h>

#include "launch/receiver/anlos_receiver.h"
#include "tests/fuzz/fuzz.h"
#include "tests/launch/receiver_frames.h"

#define PROTECTED 0x10 /* bits of the byte before each frame; below is its kind */
#define ODD       0x20 /* a byte with its length follows */
#define LATE      0x40 /* a byte with 16 ms each follows; else a millisecond goes by */

struct input {
    const uint8_t *data;
    size_t size;
};

static uint8_t take(struct input *in)
{
    if (!in->size)
        return 0;
    in->size--;
    return *in->data++;
}

static void check_value(struct anlos_value v)
{
    FUZZ_REQUIRE(isfinite(v.value) && v.quality <= ANLOS_AT_LIMIT);
    FUZZ_REQUIRE(v.quality != ANLOS_NOT_AVAILABLE || v.value == 0.0f);
}

static void check_object(const struct anlos_object *o)
{
    const struct anlos_value values[] = {
        o->x_m,
        o->y_m,
        o->z_m,
        o->vx_m_s,
        o->vy_m_s,
        o->existence,
        o->sigma_x_m,
        o->sigma_y_m,
        o->correlation_xy,
        o->sigma_v_m_s,
        o->length_m,
        o->width_m,
        o->height_m,
        o->sigma_z_m,
        o->correlation_xz,
        o->correlation_yz,
        o->shape_probability,
        o->unseen_s,
        o->age_s,
    };

    for (size_t i = 0; i < sizeof values / sizeof *values; i++)
        check_value(values[i]);
    FUZZ_REQUIRE(o->existence.value >= 0.0f && o->existence.value <= 1.0f);
    FUZZ_REQUIRE(o->sigma_x_m.value >= 0.0f && fabsf(o->correlation_xy.value) <= 1.0f);
    FUZZ_REQUIRE(o->measurement <= ANLOS_DELETED && o->shape <= ANLOS_MULTIPATH &&
                 o->motion <= ANLOS_MOVING);
}

static void check_view(const struct anlos_view *v, uint32_t events)
{
    FUZZ_REQUIRE(
        v->trust == ANLOS_TRUST_NONE ||
        (v->list && v->list_link == ANLOS_VALID && v->status_link == ANLOS_VALID));
    FUZZ_REQUIRE(!(events & ANLOS_EVENT_LIST) || v->list);
    check_value(v->status.temperature_c);
    check_value(v->status.range_m);
    if (!v->list)
        return;
    FUZZ_REQUIRE(v->list->n_objects <= ANLOS_OBJECTS);
    for (size_t i = 0; i < v->list->n_objects; i++) {
        check_object(&v->list->objects[i]);
        for (size_t k = 0; k < i; k++)
            FUZZ_REQUIRE(v->list->objects[i].id != v->list->objects[k].id);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct input in = {data, size};
    struct sensor s = {.first_id = 0x400};
    struct anlos_receiver r;
    struct anlos_view view;
    uint32_t now_ms = UINT32_MAX - 1000;

    FUZZ_REQUIRE(!anlos_receiver_init(&r, NULL));
    while (in.size) {
        uint8_t how = take(&in);
        struct sensor_frame f = sensor_blank(&s, (how & 0xF) % KINDS);
        if (how & ODD)
            f.length = take(&in);
        now_ms += how & LATE ? 16u * take(&in) : 1;
        size_t n = f.length < in.size ? f.length : in.size;
        n = n < sizeof f.data ? n : sizeof f.data;
        memcpy(f.data, in.data, n);
        in.data += n;
        in.size -= n;
        if (how & PROTECTED)
            f = sensor_next(&s, f);
        uint32_t events =
            anlos_receiver_frame(&r, f.id, f.data, f.length < 64 ? f.length : 64, now_ms);
        anlos_receiver_get(&r, now_ms, &view);
        check_view(&view, events);
    }
    return 0;
}
