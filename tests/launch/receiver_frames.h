/* SPDX-License-Identifier: MIT */
/* tests/launch/receiver_frames.h -- a sensor that the test plays: its frames bit by bit,
 * as msgs/can/anlos.dbc lays them out, by nothing of what is under test. */
#ifndef ANLOS_TESTS_LAUNCH_RECEIVER_FRAMES_H
#define ANLOS_TESTS_LAUNCH_RECEIVER_FRAMES_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum {
    STATUS,
    DIAGNOSIS,
    HEADER,
    TIME,
    STATE,
    DYNAMICS,
    QUALITY,
    MOTION,
    FD,
    VIEW,
    KINDS
};

struct sensor_frame {
    uint32_t id;
    uint8_t length;
    uint8_t data[64];
};

struct sensor {
    uint32_t first_id;
    unsigned counters[KINDS];
    unsigned list; /* the measurement counter */
    uint32_t capture_s;
};

/* The remainder of a division by x^width + poly, most significant bit first. */
static inline uint32_t sensor_crc(unsigned width, uint32_t poly, uint32_t crc,
                                  const uint8_t *data, size_t n)
{
    for (size_t i = 0; i < 8 * n; i++) {
        bool in = data[i / 8] >> (7 - i % 8) & 1, out = crc >> (width - 1) & 1;
        crc = (crc << 1 & ((1u << width) - 1)) ^ (in != out ? poly : 0);
    }
    return crc;
}

static inline void sensor_put(struct sensor_frame *f, unsigned start, unsigned length,
                              int64_t value)
{
    for (unsigned i = 0; i < length; i++) {
        uint8_t bit = (uint8_t)(1u << (start + i) % 8);
        uint8_t *byte = &f->data[(start + i) / 8];
        *byte = (uint8_t)(value >> i & 1 ? *byte | bit : *byte & ~bit);
    }
}

static inline void sensor_put_float(struct sensor_frame *f, unsigned start, float value)
{
    uint32_t raw;

    memcpy(&raw, &value, sizeof raw);
    sensor_put(f, start, 32, raw);
}

static inline bool sensor_is_fd(const struct sensor_frame *f)
{
    return f->id % 0x10 == FD;
}

/* Its protection, with that counter. */
static inline void sensor_protect(struct sensor_frame *f, unsigned counter)
{
    if (sensor_is_fd(f)) {
        const uint8_t id[2] = {(uint8_t)f->id, (uint8_t)(f->id >> 8)};
        sensor_put(f, 16, 8, counter);
        uint32_t crc = sensor_crc(16, 0x1021, 0xFFFF, f->data + 2, 62);
        sensor_put(f, 0, 16, sensor_crc(16, 0x1021, crc, id, 2));
    } else {
        const uint8_t id[2] = {(uint8_t)f->id, 0};
        sensor_put(f, 8, 4, counter);
        sensor_put(f, 12, 4, f->id >> 8);
        uint32_t crc = sensor_crc(8, 0x1D, 0, id, 2);
        sensor_put(f, 0, 8, sensor_crc(8, 0x1D, crc, f->data + 1, 7));
    }
}

static inline struct sensor_frame sensor_blank(const struct sensor *s, unsigned kind)
{
    struct sensor_frame f = {.id = s->first_id + kind, .length = kind == FD ? 64 : 8};

    return f;
}

/* Goes out: with the next counter of its kind. */
static inline struct sensor_frame sensor_next(struct sensor *s, struct sensor_frame f)
{
    unsigned kind = f.id - s->first_id;

    sensor_protect(&f, s->counters[kind]);
    s->counters[kind] = (s->counters[kind] + 1) % (kind == FD ? 256 : 15);
    return f;
}

static inline struct sensor_frame sensor_status(const struct sensor *s, unsigned state,
                                                unsigned source)
{
    struct sensor_frame f = sensor_blank(s, STATUS);

    sensor_put(&f, 16, 3, state);
    sensor_put(&f, 19, 2, source);
    sensor_put(&f, 40, 8, 120);  /* 20 degrees */
    sensor_put(&f, 48, 10, 634); /* 343.4 m/s */
    sensor_put(&f, 58, 6, 21);   /* 4 m */
    return f;
}

static inline struct sensor_frame sensor_header(const struct sensor *s, unsigned number)
{
    struct sensor_frame f = sensor_blank(s, HEADER);

    sensor_put(&f, 16, 6, number);
    sensor_put(&f, 24, 12, s->list);
    sensor_put(&f, 36, 12, 60); /* ms */
    sensor_put(&f, 48, 12, 3);  /* 30 ms */
    sensor_put(&f, 61, 3, 2);
    return f;
}

static inline struct sensor_frame sensor_time(const struct sensor *s)
{
    struct sensor_frame f = sensor_blank(s, TIME);

    sensor_put(&f, 16, 32, s->capture_s);
    sensor_put(&f, 48, 16, 0x8000);
    return f;
}

/* kind: STATE, DYNAMICS, QUALITY, MOTION or FD, of the list of now; all signals are 0. */
static inline struct sensor_frame sensor_object(const struct sensor *s, unsigned kind,
                                                unsigned id)
{
    struct sensor_frame f = sensor_blank(s, kind);

    sensor_put(&f, kind == FD ? 24 : 16, 8, id);
    sensor_put(&f, kind == FD ? 32 : 24, kind == FD ? 12 : 4, s->list);
    return f;
}

/* A corner of an area of the list of now; x, y in steps of 2 cm. */
static inline struct sensor_frame sensor_corner(const struct sensor *s, unsigned area,
                                                unsigned corner, unsigned corners, int x,
                                                int y)
{
    struct sensor_frame f = sensor_blank(s, VIEW);

    sensor_put(&f, 16, 4, s->list & 15);
    sensor_put(&f, 20, 4, 3); /* the wall */
    sensor_put(&f, 24, 4, area);
    sensor_put(&f, 28, 4, corner);
    sensor_put(&f, 32, 4, corners);
    sensor_put(&f, 36, 14, x);
    sensor_put(&f, 50, 14, y);
    return f;
}

#endif
