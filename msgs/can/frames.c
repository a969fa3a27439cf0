#include "msgs/can/frames.h"

#include <math.h>
#include <string.h>

/* Bytes 0 and 1 of every frame stay zero: they are the CRC, counter and data ID nibble of
 * AUTOSAR E2E profile 11.  The rest is the layout of anlos.dbc. */
struct signal {
    unsigned start, length;
    double factor, offset;
    int64_t min, max; /* raw; where a value is clamped to */
    int64_t missing;  /* raw, for NaN */
};

/* clang-format off */
static const struct signal
    status_state       = {16,  3, 1,    0,    0, 6, 7},
    status_source      = {19,  2, 1,    0,    0, 2, 3},
    status_faults      = {24, 16, 1,    0,    0, 65535, 65535},
    status_temperature = {40,  8, 0.5,  -40,  0, 254, 255},
    status_sound_speed = {48, 10, 0.1,  280,  0, 1022, 1023},

    header_number      = {16,  6, 1,    0,    0, CAN_MAX_OBJECTS, 63},
    header_counter     = {24, 12, 1,    0,    0, 4095, 4095},
    header_latency     = {36, 12, 1,    0,    0, 4094, 4095},
    header_cycle       = {48, 12, 10,   0,    0, 4094, 4095},
    header_truncated   = {60,  1, 1,    0,    0, 1, 1},
    header_version     = {61,  3, 1,    0,    0, 7, 7},

    time_seconds       = {16, 32, 1,    0,    0, UINT32_MAX, UINT32_MAX},
    time_fraction      = {48, 16, 1,    0,    0, 65535, 65535},

    object_id          = {16,  8, 1,    0,    0, 255, 255},
    object_counter     = {24,  4, 1,    0,    0, 15, 15},
    state_measurement  = {28,  2, 1,    0,    0, 3, 3},
    state_x            = {30, 13, 0.02, 0,    -4095, 4095, -4096},
    state_y            = {43, 12, 0.02, 0,    -2047, 2047, -2048},
    state_z            = {55,  9, 0.05, 0,    -255, 255, -256},

    dynamics_vx        = {28, 11, 0.05, 0,    -1023, 1023, -1024},
    dynamics_vy        = {39, 11, 0.05, 0,    -1023, 1023, -1024},
    dynamics_existence = {50,  7, 1,    0,    0, 100, 127},

    quality_sigma_x     = {28,  7, 0.02, 0,   0, 126, 127},
    quality_sigma_y     = {35,  7, 0.02, 0,   0, 126, 127},
    quality_correlation = {42,  6, 0.04, 0,   -25, 25, -32},
    quality_sigma_v     = {48,  5, 0.1,  0,   0, 30, 31},
    quality_length      = {53,  6, 0.1,  0,   0, 62, 63},
    quality_width       = {59,  5, 0.1,  0,   0, 30, 31};
/* clang-format on */

static void frame_init(struct can_frame_data *f, uint32_t id)
{
    memset(f, 0, sizeof *f);
    f->id = id;
    f->size = 8;
}

static void put_raw(struct can_frame_data *f, const struct signal *s, int64_t raw)
{
    uint64_t bits = (uint64_t)raw & ((UINT64_C(1) << s->length) - 1);
    for (unsigned i = 0; i < s->length; i++)
        if (bits >> i & 1)
            f->data[(s->start + i) / 8] |= (uint8_t)(1u << (s->start + i) % 8);
}

static void put_steps(struct can_frame_data *f, const struct signal *s, double steps)
{
    if (isnan(steps))
        put_raw(f, s, s->missing);
    else /* compared as double: an infinite or huge value never becomes an integer */
        put_raw(f, s,
                steps <= (double)s->min   ? s->min
                : steps >= (double)s->max ? s->max
                                          : (int64_t)steps);
}

static void put_value(struct can_frame_data *f, const struct signal *s, double value)
{
    put_steps(f, s, round((value - s->offset) / s->factor));
}

/* Up to the next step, so that a position is never called better than it is; less than a
 * millionth of a step over is rounding. */
static void put_sigma(struct can_frame_data *f, const struct signal *s, double value)
{
    put_steps(f, s, ceil(value / s->factor - 1e-6));
}

/* An enumerator that does not exist is sent as not available. */
static void put_choice(struct can_frame_data *f, const struct signal *s, unsigned value)
{
    put_raw(f, s, value <= (uint64_t)s->max ? (int64_t)value : s->missing);
}

void can_pack_status(struct can_frame_data *out, uint32_t base,
                     const struct can_status *s)
{
    frame_init(out, base + CAN_ID_STATUS);
    put_choice(out, &status_state, s->state);
    put_choice(out, &status_source, s->source);
    put_raw(out, &status_faults, s->faults);
    put_value(out, &status_temperature, s->temperature_c);
    put_value(out, &status_sound_speed, s->sound_speed_m_s);
}

void can_pack_list_header(struct can_frame_data *out, uint32_t base,
                          const struct can_list_header *h)
{
    frame_init(out, base + CAN_ID_LIST_HEADER);
    put_value(out, &header_number, h->number);
    put_raw(out, &header_counter, h->counter);
    put_value(out, &header_latency, h->latency_ms);
    put_value(out, &header_cycle, h->cycle_ms);
    put_raw(out, &header_truncated, h->truncated);
    put_raw(out, &header_version, CAN_INTERFACE_VERSION);
}

void can_pack_time(struct can_frame_data *out, uint32_t base, int64_t stamp_ns)
{
    const int64_t second_ns = 1000000000;
    frame_init(out, base + CAN_ID_TIME);
    if (stamp_ns < 0)
        stamp_ns = 0;
    int64_t seconds = stamp_ns / second_ns;
    put_raw(out, &time_seconds, seconds < UINT32_MAX ? seconds : UINT32_MAX);
    put_raw(out, &time_fraction, stamp_ns % second_ns * 65536 / second_ns);
}

static void put_object(struct can_frame_data *out, uint32_t id,
                       const struct can_object *o)
{
    frame_init(out, id);
    put_raw(out, &object_id, o->id);
    put_raw(out, &object_counter, o->counter);
}

void can_pack_object_state(struct can_frame_data *out, uint32_t base,
                           const struct can_object *o)
{
    put_object(out, base + CAN_ID_OBJECT_STATE, o);
    put_choice(out, &state_measurement, o->measurement);
    put_value(out, &state_x, o->position_m[0]);
    put_value(out, &state_y, o->position_m[1]);
    put_value(out, &state_z, o->position_m[2]);
}

/* Class and dynamic property stay 0, unknown, until something tells them. */
void can_pack_object_dynamics(struct can_frame_data *out, uint32_t base,
                              const struct can_object *o)
{
    put_object(out, base + CAN_ID_OBJECT_DYNAMICS, o);
    put_value(out, &dynamics_vx, o->velocity_m_s[0]);
    put_value(out, &dynamics_vy, o->velocity_m_s[1]);
    put_value(out, &dynamics_existence, 100 * o->existence);
}

void can_pack_object_quality(struct can_frame_data *out, uint32_t base,
                             const struct can_object *o)
{
    put_object(out, base + CAN_ID_OBJECT_QUALITY, o);
    put_sigma(out, &quality_sigma_x, o->sigma_m[0]);
    put_sigma(out, &quality_sigma_y, o->sigma_m[1]);
    put_value(out, &quality_correlation, o->correlation);
    put_raw(out, &quality_sigma_v, quality_sigma_v.missing); /* nothing measures it */
    put_value(out, &quality_length, o->length_m);
    put_value(out, &quality_width, o->width_m);
}
