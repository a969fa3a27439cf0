#include "msgs/can/signal.h"

#include <math.h>
#include <string.h>

static void put_bits(struct can_frame_data *f, const struct can_signal *s, uint64_t bits)
{
    for (unsigned i = 0; i < s->length; i++)
        if (bits >> i & 1)
            f->data[(s->start + i) / 8] |= (uint8_t)(1u << (s->start + i) % 8);
}

static uint64_t take_bits(const struct can_frame_data *f, const struct can_signal *s)
{
    uint64_t bits = 0;

    for (unsigned i = 0; i < s->length; i++)
        if (f->data[(s->start + i) / 8] >> (s->start + i) % 8 & 1)
            bits |= UINT64_C(1) << i;
    return bits;
}

static double float_of(int64_t pattern)
{
    uint32_t bits = (uint32_t)pattern;
    float value;

    memcpy(&value, &bits, sizeof value);
    return (double)value;
}

static int64_t clamp(const struct can_signal *s, double steps)
{
    /* compared as double: an infinite or huge value never becomes an integer */
    return steps <= (double)s->min   ? s->min
           : steps >= (double)s->max ? s->max
                                     : (int64_t)steps;
}

bool can_signal_fits(const struct can_signal *s, const void *content)
{
    double value = *(const double *)((const char *)content + s->member.at);
    double steps = value * s->member.scale;

    if (s->kind != CAN_SIGNAL_FLOAT)
        steps = round((steps - s->offset) / s->factor);
    return isnan(value) || (steps >= (double)s->min && steps <= (double)s->max);
}

static int64_t raw_of_float(const struct can_signal *s, double value)
{
    float narrow = (float)fmin(fmax(value, (double)s->min), (double)s->max);
    uint32_t bits;

    if (isnan(value)) /* which fmin and fmax would let go by */
        narrow = NAN;
    memcpy(&bits, &narrow, sizeof bits);
    return bits;
}

/* Less than a millionth of a step over is rounding. */
static int64_t raw_of_double(const struct can_signal *s, double value)
{
    double steps = (value * s->member.scale - s->offset) / s->factor;

    if (s->kind == CAN_SIGNAL_FLOAT)
        return raw_of_float(s, value * s->member.scale);
    if (isnan(steps))
        return s->missing;
    return clamp(s, s->kind == CAN_SIGNAL_SIGMA ? ceil(steps - 1e-6) : round(steps));
}

/* What is no choice is not known: 0 where nothing else says so. */
static int64_t choice(const struct can_signal *s, int64_t value)
{
    if (value <= s->max)
        return value;
    return s->missing == CAN_NEVER_MISSING ? 0 : s->missing;
}

static int64_t raw_of_integer(const struct can_signal *s, int64_t value)
{
    if (s->kind == CAN_SIGNAL_COUNTER || s->kind == CAN_SIGNAL_BITS)
        return value; /* the bits that fit */
    if (s->kind == CAN_SIGNAL_CHOICE)
        return choice(s, value);
    return clamp(s, (double)value);
}

void can_signal_put(const struct can_signal *s, struct can_frame_data *f,
                    const void *content)
{
    const void *from = (const char *)content + s->member.at;
    int64_t raw = 0;

    switch (s->member.type) {
    case CAN_MEMBER_NONE:
        return;
    case CAN_MEMBER_DOUBLE:
        raw = raw_of_double(s, *(const double *)from);
        break;
    case CAN_MEMBER_BOOL:
        raw = raw_of_integer(s, *(const bool *)from);
        break;
    case CAN_MEMBER_U8:
        raw = raw_of_integer(s, *(const uint8_t *)from);
        break;
    case CAN_MEMBER_U16:
        raw = raw_of_integer(s, *(const uint16_t *)from);
        break;
    case CAN_MEMBER_U32:
        raw = raw_of_integer(s, *(const uint32_t *)from);
        break;
    }
    put_bits(f, s, (uint64_t)raw);
}

void can_signal_take(const struct can_signal *s, const struct can_frame_data *f,
                     void *content)
{
    void *to = (char *)content + s->member.at;
    int64_t raw = can_signal_raw(s, f);

    if (s->kind == CAN_SIGNAL_CHOICE)
        raw = choice(s, raw);
    switch (s->member.type) {
    case CAN_MEMBER_NONE:
        break;
    case CAN_MEMBER_DOUBLE:
        *(double *)to = can_signal_physical(s, f) / s->member.scale;
        break;
    case CAN_MEMBER_BOOL:
        *(bool *)to = raw != 0;
        break;
    case CAN_MEMBER_U8:
        *(uint8_t *)to = (uint8_t)raw;
        break;
    case CAN_MEMBER_U16:
        *(uint16_t *)to = (uint16_t)raw;
        break;
    case CAN_MEMBER_U32:
        *(uint32_t *)to = (uint32_t)raw;
        break;
    }
}

int64_t can_signal_raw(const struct can_signal *s, const struct can_frame_data *f)
{
    uint64_t bits = take_bits(f, s);

    if (s->kind != CAN_SIGNAL_FLOAT && s->min < 0 && bits >> (s->length - 1))
        return (int64_t)bits - (INT64_C(1) << s->length);
    return (int64_t)bits;
}

bool can_signal_is_missing(const struct can_signal *s, const struct can_frame_data *f)
{
    int64_t raw = can_signal_raw(s, f);

    if (s->kind == CAN_SIGNAL_FLOAT)
        return isnan(float_of(raw));
    if (s->missing == CAN_NEVER_MISSING)
        return false;
    bool is_number = s->kind == CAN_SIGNAL_NUMBER || s->kind == CAN_SIGNAL_SIGMA;
    return raw == s->missing || (is_number && (raw < s->min || raw > s->max));
}

double can_signal_physical(const struct can_signal *s, const struct can_frame_data *f)
{
    int64_t raw = can_signal_raw(s, f);

    if (can_signal_is_missing(s, f))
        return NAN;
    return s->kind == CAN_SIGNAL_FLOAT ? float_of(raw)
                                       : (double)raw * s->factor + s->offset;
}

const char *can_signal_name(const struct can_signal *s, int64_t raw)
{
    if (!s->names || raw < 0)
        return NULL;
    for (int64_t i = 0; s->names[i]; i++)
        if (i == raw)
            return s->names[i];
    return NULL;
}
