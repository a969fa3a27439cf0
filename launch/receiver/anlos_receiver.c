/* SPDX-License-Identifier: MIT */
#include "anlos_receiver.h"

#include <string.h>

/* The float frames are IEEE 754, and so has float to be. */
typedef char anlos_float_is_32_bits[(sizeof(float) == sizeof(uint32_t)) ? 1 : -1];

enum kind {
    KIND_STATUS = 0,
    KIND_DIAGNOSIS = 1,
    KIND_HEADER = 2,
    KIND_TIME = 3,
    KIND_OBJECT_STATE = 4,
    KIND_OBJECT_DYNAMICS = 5,
    KIND_OBJECT_QUALITY = 6,
    KIND_OBJECT_FD = 7,
    KIND_OBJECT_MOTION = 8, /* optional: no list waits for it */
    KIND_FIELD_OF_VIEW = 9  /* nor for this */
};

enum check { CHECK_NONE = 0, CHECK_OK = 1, CHECK_ERROR = 2, CHECK_OTHER = 3 };

struct outcome {
    enum check check;
    uint32_t delta;
};

/* AUTOSAR: MaxDeltaCounter, so that two frames in a row may get lost; and of the state
 * machine WindowSize, MinOkState and MaxErrorState, for Init, Valid and Invalid. */
#define MAX_DELTA         3u
#define WINDOW_INIT       2u
#define MIN_OK_INIT       2u
#define MAX_WRONG_INIT    0u
#define MIN_OK_VALID      1u
#define MAX_WRONG_VALID   1u
#define MIN_OK_INVALID    ANLOS_WINDOW
#define MAX_WRONG_INVALID 0u

#define COUNTERS_P11  15u
#define COUNTERS_P05  256u
#define LIST_COUNTERS 4096u

#define PART_STATE    0x01u
#define PART_DYNAMICS 0x02u
#define PART_QUALITY  0x04u
#define PARTS_CLASSIC 0x07u
#define PART_FD       0x08u

#define CORNERS_DISAGREE 0xFFu

/* ---- Protection ------------------------------------------------------------------- */

/* Polynomial x^8 + x^4 + x^3 + x^2 + 1, most significant bit first. */
static uint8_t crc8(uint8_t crc, const uint8_t *data, uint32_t n)
{
    uint32_t c = crc;

    for (uint32_t i = 0; i < n; i++) {
        c ^= data[i];
        for (uint32_t bit = 0; bit < 8u; bit++) {
            c = ((c & 0x80u) != 0u) ? ((c << 1) ^ 0x1Du) : (c << 1);
            c &= 0xFFu;
        }
    }
    return (uint8_t)c;
}

/* Polynomial x^16 + x^12 + x^5 + 1, most significant bit first. */
static uint16_t crc16(uint16_t crc, const uint8_t *data, uint32_t n)
{
    uint32_t c = crc;

    for (uint32_t i = 0; i < n; i++) {
        c ^= (uint32_t)data[i] << 8;
        for (uint32_t bit = 0; bit < 8u; bit++) {
            c = ((c & 0x8000u) != 0u) ? ((c << 1) ^ 0x1021u) : (c << 1);
            c &= 0xFFFFu;
        }
    }
    return (uint16_t)c;
}

/* Profile 11, data ID in nibble mode: start value and final XOR are 0, unlike those of
 * the CRC-8 that gave it its name. */
static int good_p11(uint32_t data_id, const uint8_t *data)
{
    const uint8_t head[2] = {(uint8_t)(data_id & 0xFFu), 0u};
    uint8_t crc = crc8(crc8(0u, head, 2u), &data[1], 7u);

    return (data[0] == crc) && (((uint32_t)data[1] >> 4) == ((data_id >> 8) & 0xFu)) &&
           (((uint32_t)data[1] & 0xFu) < COUNTERS_P11);
}

/* Profile 5: the data ID comes last, low byte first. */
static int good_p05(uint32_t data_id, const uint8_t *data)
{
    const uint8_t tail[2] = {(uint8_t)(data_id & 0xFFu), (uint8_t)(data_id >> 8)};
    uint16_t crc = crc16(crc16(0xFFFFu, &data[2], 62u), tail, 2u);

    return (((uint32_t)data[1] << 8) | data[0]) == crc;
}

static uint32_t newest_that_are(const struct anlos_channel *c, enum check what,
                                uint32_t size)
{
    uint32_t n = 0;

    for (uint32_t i = 0; i < size; i++) {
        n += (c->newest[i] == (uint8_t)what) ? 1u : 0u;
    }
    return n;
}

static int within(const struct anlos_channel *c, uint32_t size, uint32_t min_ok,
                  uint32_t max_wrong)
{
    return (newest_that_are(c, CHECK_OK, size) >= min_ok) &&
           (newest_that_are(c, CHECK_ERROR, size) <= max_wrong);
}

/* E2E_SMCheck.  Silence, its NONEWDATA, is left to the time-outs, which restart. */
static void channel_step(struct anlos_channel *c, enum check check)
{
    for (uint32_t i = ANLOS_WINDOW - 1u; i > 0u; i--) {
        c->newest[i] = c->newest[i - 1u];
    }
    c->newest[0] = (uint8_t)check;
    switch (c->state) {
    case (uint8_t)ANLOS_NODATA:
        if (check != CHECK_ERROR) {
            c->state = (uint8_t)ANLOS_INIT;
        }
        break;
    case (uint8_t)ANLOS_INIT:
        if (newest_that_are(c, CHECK_ERROR, WINDOW_INIT) > MAX_WRONG_INIT) {
            c->state = (uint8_t)ANLOS_INVALID;
        } else if (within(c, WINDOW_INIT, MIN_OK_INIT, MAX_WRONG_INIT)) {
            c->state = (uint8_t)ANLOS_VALID;
        } else {
            /* too few yet */
        }
        if (c->state != (uint8_t)ANLOS_INIT) {
            for (uint32_t i = WINDOW_INIT; i < ANLOS_WINDOW; i++) {
                c->newest[i] = (uint8_t)CHECK_NONE;
            }
        }
        break;
    case (uint8_t)ANLOS_VALID:
        if (!within(c, ANLOS_WINDOW, MIN_OK_VALID, MAX_WRONG_VALID)) {
            c->state = (uint8_t)ANLOS_INVALID;
        }
        break;
    default:
        if (within(c, ANLOS_WINDOW, MIN_OK_INVALID, MAX_WRONG_INVALID)) {
            c->state = (uint8_t)ANLOS_VALID;
        }
        break;
    }
}

/* After silence.  What is not believed has to prove itself all the same. */
static void channels_restart(struct anlos_receiver *r, enum kind first, enum kind last)
{
    for (uint32_t k = (uint32_t)first; k <= (uint32_t)last; k++) {
        if (r->channels[k].state != (uint8_t)ANLOS_INVALID) {
            (void)memset(&r->channels[k], 0, sizeof r->channels[k]);
        }
    }
}

/* The first one is good whatever its counter: nothing is there to compare it with. */
static struct outcome channel_take(struct anlos_receiver *r, enum kind kind, uint32_t id,
                                   const uint8_t *data, uint32_t length)
{
    struct anlos_channel *c = &r->channels[kind];
    int fd = kind == KIND_OBJECT_FD;
    uint32_t counters = fd ? COUNTERS_P05 : COUNTERS_P11;
    struct outcome o = {CHECK_ERROR, 0u};

    if ((length != (fd ? 64u : 8u)) || (fd ? !good_p05(id, data) : !good_p11(id, data))) {
        r->counts.frames_damaged++;
    } else {
        uint32_t counter = fd ? data[2] : ((uint32_t)data[1] & 0xFu);
        o.delta = (c->heard != 0u) ? ((counter + counters - c->counter) % counters) : 1u;
        c->counter = (uint8_t)counter;
        c->heard = 1u;
        if (o.delta == 0u) {
            o.check = CHECK_OTHER;
            r->counts.frames_repeated++;
        } else if (o.delta > MAX_DELTA) {
            o.check = CHECK_OTHER;
            r->counts.frames_out_of_sequence++;
        } else {
            o.check = CHECK_OK;
            r->counts.frames_good++;
            r->counts.frames_lost += o.delta - 1u;
        }
    }
    channel_step(c, o.check);
    return o;
}

static int channel_valid(const struct anlos_receiver *r, enum kind kind)
{
    return r->channels[kind].state == (uint8_t)ANLOS_VALID;
}

static enum anlos_link channel_link(const struct anlos_channel *c)
{
    static const enum anlos_link links[4] = {ANLOS_NODATA, ANLOS_INIT, ANLOS_VALID,
                                             ANLOS_INVALID};

    return links[c->state & 3u];
}

/* ---- Signals ---------------------------------------------------------------------- */

/* length: 1..32. */
static uint32_t signal_raw(const uint8_t *data, uint32_t start, uint32_t length)
{
    uint32_t last = (start + length - 1u) / 8u;
    uint64_t v = 0;

    for (uint32_t i = (last - (start / 8u)) + 1u; i > 0u; i--) {
        v = (v << 8) | data[(start / 8u) + i - 1u];
    }
    v >>= start % 8u;
    return (uint32_t)(v & ((UINT64_C(1) << length) - 1u));
}

/* Two's complement; length: 2..31. */
static int32_t signal_signed(const uint8_t *data, uint32_t start, uint32_t length)
{
    int32_t v = (int32_t)signal_raw(data, start, length);
    int32_t half = (int32_t)(UINT32_C(1) << (length - 1u));

    return (v < half) ? v : ((v - half) - half);
}

static struct anlos_value value_none(void)
{
    const struct anlos_value v = {0.0f, ANLOS_NOT_AVAILABLE};

    return v;
}

/* Raw values beyond low..high are NotAvailable, or mean nothing in this version. */
static struct anlos_value value_of(int32_t raw, int32_t low, int32_t high, float step,
                                   float offset)
{
    struct anlos_value v = value_none();

    if ((raw >= low) && (raw <= high)) {
        v.value = ((float)raw * step) + offset;
        v.quality = ANLOS_AVAILABLE;
    }
    return v;
}

/* The same of one that is clamped to its ends: low only where it is below 0. */
static struct anlos_value value_clamped(int32_t raw, int32_t low, int32_t high,
                                        float step, float offset)
{
    struct anlos_value v = value_of(raw, low, high, step, offset);

    if ((raw == high) || ((raw == low) && ((low < 0) || (offset < 0.0f)))) {
        v.quality = ANLOS_AT_LIMIT;
    }
    return v;
}

static struct anlos_value value_float(const uint8_t *data, uint32_t start, float low,
                                      float high)
{
    struct anlos_value v = value_none();
    uint32_t raw = signal_raw(data, start, 32u);
    float f;

    (void)memcpy(&f, &raw, sizeof f);
    if ((f >= low) && (f <= high)) { /* neither holds for NaN */
        v.value = f;
        v.quality = ((f > low) && (f < high)) ? ANLOS_AVAILABLE : ANLOS_AT_LIMIT;
    }
    return v;
}

static uint32_t signal_enum(const uint8_t *data, uint32_t start, uint32_t length,
                            uint32_t high)
{
    uint32_t raw = signal_raw(data, start, length);

    return (raw <= high) ? raw : 0u; /* a later version's is Unknown here */
}

static enum anlos_class class_of(const uint8_t *data, uint32_t start)
{
    static const enum anlos_class classes[5] = {
        ANLOS_CLASS_UNKNOWN, ANLOS_POINT, ANLOS_PLATE, ANLOS_EXTENDED, ANLOS_MULTIPATH};

    return classes[signal_enum(data, start, 4u, 4u)];
}

static enum anlos_motion motion_of(const uint8_t *data, uint32_t start)
{
    static const enum anlos_motion motions[3] = {ANLOS_MOTION_UNKNOWN, ANLOS_STANDING,
                                                 ANLOS_MOVING};

    return motions[signal_enum(data, start, 3u, 2u)];
}

static enum anlos_measurement measurement_of(const uint8_t *data, uint32_t start)
{
    static const enum anlos_measurement measurements[4] = {
        ANLOS_NEW, ANLOS_MEASURED, ANLOS_PREDICTED, ANLOS_DELETED};

    return measurements[signal_raw(data, start, 2u)];
}

static void status_take(struct anlos_status *s, const uint8_t *d)
{
    static const enum anlos_state states[8] = {
        ANLOS_STATE_INIT,     ANLOS_STATE_CALIBRATING, ANLOS_STATE_ACTIVE,
        ANLOS_STATE_DEGRADED, ANLOS_STATE_FAULT,       ANLOS_STATE_BLOCKED,
        ANLOS_STATE_STANDBY,  ANLOS_STATE_UNKNOWN};
    static const enum anlos_source sources[4] = {ANLOS_SOURCE_LIVE, ANLOS_SOURCE_REPLAY,
                                                 ANLOS_SOURCE_SIMULATION,
                                                 ANLOS_SOURCE_UNKNOWN};

    s->state = states[signal_raw(d, 16u, 3u)];
    if (signal_raw(d, 21u, 1u) != 0u) {
        s->state = ANLOS_STATE_SHUTDOWN;
    }
    s->source = sources[signal_raw(d, 19u, 2u)];
    s->faults = (uint16_t)signal_raw(d, 24u, 16u);
    s->temperature_c =
        value_clamped((int32_t)signal_raw(d, 40u, 8u), 0, 254, 0.5f, -40.0f);
    s->sound_speed_m_s =
        value_of((int32_t)signal_raw(d, 48u, 10u), 0, 1022, 0.1f, 280.0f);
    s->range_m = value_of((int32_t)signal_raw(d, 58u, 6u), 1, 63, 0.2f, -0.2f);
    if (signal_raw(d, 58u, 6u) == 63u) {
        s->range_m.quality = ANLOS_AT_LIMIT;
    }
}

/* That it was stopped stays so until it says something else. */
static void status_forget(struct anlos_status *s)
{
    enum anlos_state state = (s->state == ANLOS_STATE_SHUTDOWN) ? ANLOS_STATE_SHUTDOWN
                                                                : ANLOS_STATE_UNKNOWN;

    (void)memset(s, 0, sizeof *s);
    s->state = state;
    s->source = ANLOS_SOURCE_UNKNOWN;
}

static void diagnosis_take(struct anlos_diagnosis *g, const uint8_t *d)
{
    uint32_t code = signal_raw(d, 54u, 5u);

    g->cpu = value_of((int32_t)signal_raw(d, 16u, 7u), 0, 100, 0.01f, 0.0f);
    g->signal_to_noise_db =
        value_clamped((int32_t)signal_raw(d, 23u, 7u), 0, 126, 1.0f, -30.0f);
    g->dropped_pings = (uint16_t)signal_raw(d, 30u, 10u);
    g->version[0] = (uint8_t)signal_raw(d, 40u, 4u);
    g->version[1] = (uint8_t)signal_raw(d, 44u, 5u);
    g->version[2] = (uint8_t)signal_raw(d, 49u, 5u);
    if ((code >= 1u) && (code <= ANLOS_TROUBLES)) {
        uint32_t bit = UINT32_C(1) << (code - 1u);
        uint32_t others = (uint32_t)g->trouble_present & ~bit;
        g->trouble_count[code - 1u] = (uint8_t)signal_raw(d, 60u, 4u);
        g->trouble_present =
            (uint16_t)(others | ((signal_raw(d, 59u, 1u) != 0u) ? bit : 0u));
    }
}

/* ---- Objects ---------------------------------------------------------------------- */

static void object_state(struct anlos_object *o, const uint8_t *d)
{
    o->measurement = measurement_of(d, 28u);
    o->x_m = value_clamped(signal_signed(d, 30u, 13u), -4095, 4095, 0.02f, 0.0f);
    o->y_m = value_clamped(signal_signed(d, 43u, 12u), -2047, 2047, 0.02f, 0.0f);
    o->z_m = value_clamped(signal_signed(d, 55u, 9u), -255, 255, 0.05f, 0.0f);
}

static void object_dynamics(struct anlos_object *o, const uint8_t *d)
{
    o->vx_m_s = value_clamped(signal_signed(d, 28u, 11u), -1023, 1023, 0.05f, 0.0f);
    o->vy_m_s = value_clamped(signal_signed(d, 39u, 11u), -1023, 1023, 0.05f, 0.0f);
    o->existence = value_of((int32_t)signal_raw(d, 50u, 7u), 0, 100, 0.01f, 0.0f);
    o->shape = class_of(d, 57u);
    o->motion = motion_of(d, 61u);
}

static void object_quality(struct anlos_object *o, const uint8_t *d)
{
    o->sigma_x_m = value_clamped((int32_t)signal_raw(d, 28u, 7u), 0, 126, 0.02f, 0.0f);
    o->sigma_y_m = value_clamped((int32_t)signal_raw(d, 35u, 7u), 0, 126, 0.02f, 0.0f);
    o->correlation_xy = value_of(signal_signed(d, 42u, 6u), -25, 25, 0.04f, 0.0f);
    o->sigma_v_m_s = value_clamped((int32_t)signal_raw(d, 48u, 5u), 0, 30, 0.1f, 0.0f);
    o->length_m = value_clamped((int32_t)signal_raw(d, 53u, 6u), 0, 62, 0.1f, 0.0f);
    o->width_m = value_clamped((int32_t)signal_raw(d, 59u, 5u), 0, 30, 0.1f, 0.0f);
}

/* Newton's, which comes down to the root from above: of 1e-12 to 1e6, less counts as 0.
 */
static float root(float a)
{
    float x = 0.0f;

    if (a > 1e-12f) {
        x = (a > 1.0f) ? a : 1.0f;
        for (uint32_t i = 0; i < 30u; i++) {
            x = 0.5f * (x + (a / x));
        }
    }
    return x;
}

static struct anlos_value sigma_of(struct anlos_value variance)
{
    struct anlos_value v = variance;

    if (v.quality != ANLOS_NOT_AVAILABLE) {
        v.value = root(v.value);
        v.quality = (v.value >= 1000.0f) ? ANLOS_AT_LIMIT : ANLOS_AVAILABLE;
    }
    return v;
}

static struct anlos_value correlation_of(struct anlos_value covariance,
                                         struct anlos_value a, struct anlos_value b)
{
    struct anlos_value v = value_none();
    float both = a.value * b.value;

    if ((covariance.quality != ANLOS_NOT_AVAILABLE) && (both > 0.0f)) {
        float c = covariance.value / both;
        v.value = (c > 1.0f) ? 1.0f : ((c < -1.0f) ? -1.0f : c);
        v.quality = ANLOS_AVAILABLE;
    }
    return v;
}

static void object_motion(struct anlos_object *o, const uint8_t *d)
{
    const float radians = 0.017453292f;

    o->course_rad = value_of(signal_signed(d, 28u, 9u), -180, 180, radians, 0.0f);
    o->sigma_course_rad =
        value_clamped((int32_t)signal_raw(d, 37u, 6u), 0, 62, radians, 0.0f);
    o->sigma_vx_m_s = value_clamped((int32_t)signal_raw(d, 43u, 7u), 0, 126, 0.05f, 0.0f);
    o->sigma_vy_m_s = value_clamped((int32_t)signal_raw(d, 50u, 7u), 0, 126, 0.05f, 0.0f);
    o->correlation_v = value_of(signal_signed(d, 57u, 6u), -25, 25, 0.04f, 0.0f);
}

static struct anlos_value value_12(const uint8_t *d, uint32_t start)
{
    return value_clamped((int32_t)signal_raw(d, start, 12u), 0, 4094, 0.01f, 0.0f);
}

static void object_fd(struct anlos_object *o, const uint8_t *d)
{
    o->fd = 1u;
    o->measurement = measurement_of(d, 44u);
    o->behind_no_wall = (uint8_t)signal_raw(d, 46u, 1u);
    o->in_free_view = (uint8_t)signal_raw(d, 47u, 1u);
    o->shape = class_of(d, 48u);
    o->motion = motion_of(d, 52u);
    o->shape_probability = value_of((int32_t)signal_raw(d, 55u, 7u), 0, 100, 0.01f, 0.0f);
    o->existence = value_of((int32_t)signal_raw(d, 62u, 14u), 0, 10000, 0.0001f, 0.0f);
    o->sigma_v_m_s = value_12(d, 76u);
    o->length_m = value_12(d, 88u);
    o->width_m = value_12(d, 100u);
    o->height_m = value_12(d, 112u);
    o->unseen_s = value_12(d, 124u);
    o->age_s = value_clamped((int32_t)signal_raw(d, 136u, 16u), 0, 65534, 0.1f, 0.0f);
    o->wall_id = (uint8_t)signal_raw(d, 152u, 8u);
    o->x_m = value_float(d, 160u, -1000.0f, 1000.0f);
    o->y_m = value_float(d, 192u, -1000.0f, 1000.0f);
    o->z_m = value_float(d, 224u, -1000.0f, 1000.0f);
    o->vx_m_s = value_float(d, 256u, -1000.0f, 1000.0f);
    o->vy_m_s = value_float(d, 288u, -1000.0f, 1000.0f);
    o->sigma_x_m = sigma_of(value_float(d, 320u, 0.0f, 1e6f));
    o->sigma_y_m = sigma_of(value_float(d, 416u, 0.0f, 1e6f));
    o->sigma_z_m = sigma_of(value_float(d, 480u, 0.0f, 1e6f));
    o->correlation_xy =
        correlation_of(value_float(d, 352u, -1e6f, 1e6f), o->sigma_x_m, o->sigma_y_m);
    o->correlation_xz =
        correlation_of(value_float(d, 384u, -1e6f, 1e6f), o->sigma_x_m, o->sigma_z_m);
    o->correlation_yz =
        correlation_of(value_float(d, 448u, -1e6f, 1e6f), o->sigma_y_m, o->sigma_z_m);
}

/* ---- Lists ------------------------------------------------------------------------ */

/* The place of an object in the list; n_objects: it is a new one. */
static uint32_t object_find(const struct anlos_receiver *r, uint8_t id)
{
    uint32_t i = 0;

    while ((i < r->next.n_objects) && (r->next.objects[i].id != id)) {
        i++;
    }
    return i;
}

static uint32_t list_drop(struct anlos_receiver *r, uint32_t *counted)
{
    (*counted)++;
    r->assembling = 0u;
    return ANLOS_EVENT_DROPPED;
}

/* Against the list before: the same again, an older one, or one that goes on.  A counter
 * that goes back is a sensor that restarted when its sound is newer. */
static int list_is_news(const struct anlos_receiver *r)
{
    const struct anlos_list *a = &r->list;
    const struct anlos_list *b = &r->next;
    uint32_t delta = ((uint32_t)b->counter + LIST_COUNTERS - a->counter) % LIST_COUNTERS;
    int later =
        (b->capture_s > a->capture_s) ||
        ((b->capture_s == a->capture_s) && (b->capture_fraction > a->capture_fraction));
    int news = 1;

    if (r->listed != 0u) {
        news = (delta != 0u) && ((delta < (LIST_COUNTERS / 2u)) || later);
    }
    return news;
}

static int list_proven(const struct anlos_receiver *r)
{
    int proven = channel_valid(r, KIND_HEADER) && channel_valid(r, KIND_TIME);

    if (r->number > 0u) {
        if (r->next.objects[0].fd != 0u) {
            proven = proven && channel_valid(r, KIND_OBJECT_FD);
        } else {
            proven = proven && channel_valid(r, KIND_OBJECT_STATE) &&
                     channel_valid(r, KIND_OBJECT_DYNAMICS) &&
                     channel_valid(r, KIND_OBJECT_QUALITY);
        }
    }
    return proven;
}

/* What came of them, of any order; one that did not come leaves its object without. */
static void list_add_motions(struct anlos_receiver *r)
{
    for (uint32_t i = 0; channel_valid(r, KIND_OBJECT_MOTION) && (i < r->n_motions);
         i++) {
        const uint8_t *d = r->motions[i];
        uint32_t k = object_find(r, (uint8_t)signal_raw(d, 16u, 8u));
        if (k < r->next.n_objects) {
            object_motion(&r->next.objects[k], d);
        }
    }
}

/* The areas of which all corners came; without one of them it would be another area. */
static void list_add_areas(struct anlos_receiver *r)
{
    struct anlos_list *l = &r->next;

    if ((r->viewed != 0u) && channel_valid(r, KIND_FIELD_OF_VIEW)) {
        l->view_known = 1u;
        for (uint32_t i = 0; i < ANLOS_AREAS; i++) {
            uint32_t n = r->corners_said[i];
            if ((n >= 3u) && (n <= ANLOS_CORNERS) &&
                (r->corners_come[i] == ((1u << n) - 1u))) {
                l->areas[l->n_areas] = r->areas[i];
                l->areas[l->n_areas].n_corners = (uint8_t)n;
                l->n_areas++;
            }
        }
    }
}

static int list_whole(const struct anlos_receiver *r)
{
    int whole = r->timed != 0u;

    for (uint32_t i = 0; whole && (i < r->number); i++) {
        whole = (r->parts[i] == PARTS_CLASSIC) || (r->parts[i] == PART_FD);
    }
    return whole;
}

static uint32_t list_finish(struct anlos_receiver *r)
{
    uint32_t events = 0;

    if (list_whole(r)) {
        if (!list_proven(r)) {
            events = list_drop(r, &r->counts.lists_unproven);
        } else if (!list_is_news(r)) {
            events = list_drop(r, &r->counts.lists_repeated);
        } else {
            list_add_motions(r);
            list_add_areas(r);
            r->list = r->next;
            r->listed = 1u;
            r->assembling = 0u;
            r->list_watch.running = 1u;
            r->list_watch.good_ms = r->next.header_ms;
            r->counts.lists_whole++;
            events = ANLOS_EVENT_LIST;
        }
    }
    return events;
}

/* Lists of which no header came.  One that is sent again has the same counter. */
static void count_lost(struct anlos_receiver *r, uint32_t counter)
{
    uint32_t delta = (counter + LIST_COUNTERS - r->header_counter) % LIST_COUNTERS;

    if ((r->header_seen != 0u) && (delta != 0u) && (delta < (LIST_COUNTERS / 2u))) {
        r->counts.lists_lost += delta - 1u;
    }
    r->header_counter = (uint16_t)counter;
    r->header_seen = 1u;
}

static uint32_t take_header(struct anlos_receiver *r, const uint8_t *d, uint32_t delta,
                            uint32_t now_ms)
{
    struct anlos_list *l = &r->next;
    uint32_t number = signal_raw(d, 16u, 6u);
    uint32_t events = 0;

    if (r->assembling != 0u) {
        events |= list_drop(r, &r->counts.lists_torn);
    }
    r->headers += delta;
    (void)memset(l, 0, sizeof *l);
    (void)memset(r->parts, 0, sizeof r->parts);
    r->n_motions = 0u;
    (void)memset(r->areas, 0, sizeof r->areas);
    (void)memset(r->corners_come, 0, sizeof r->corners_come);
    (void)memset(r->corners_said, 0, sizeof r->corners_said);
    r->viewed = 0u;
    l->counter = (uint16_t)signal_raw(d, 24u, 12u);
    count_lost(r, l->counter);
    l->synchronised = (signal_raw(d, 22u, 2u) == 1u) ? 1u : 0u;
    l->latency_s = value_clamped((int32_t)signal_raw(d, 36u, 12u), 0, 4094, 0.001f, 0.0f);
    l->cycle_s = value_clamped((int32_t)signal_raw(d, 48u, 12u), 0, 4094, 0.01f, 0.0f);
    l->truncated = (uint8_t)signal_raw(d, 60u, 1u);
    l->header_ms = now_ms;
    r->timed = 0u;
    if ((number > ANLOS_OBJECTS) || (signal_raw(d, 61u, 3u) != ANLOS_INTERFACE_VERSION)) {
        events |= list_drop(r, &r->counts.lists_refused);
    } else {
        r->number = (uint8_t)number;
        r->assembling = 1u;
    }
    return events;
}

/* Time says not of which list it is: it is the newest header's when no more of its kind
 * got lost than headers came and got lost. */
static uint32_t take_time(struct anlos_receiver *r, const uint8_t *d, uint32_t delta)
{
    uint32_t events;
    uint32_t headers = r->headers;

    r->headers = 0u;
    if (r->assembling == 0u) {
        r->counts.frames_orphaned++;
        events = 0u;
    } else if (delta > headers) {
        events = list_drop(r, &r->counts.lists_mixed);
    } else {
        r->next.capture_s = signal_raw(d, 16u, 32u);
        r->next.capture_fraction = (uint16_t)signal_raw(d, 48u, 16u);
        r->timed = 1u;
        events = list_finish(r);
    }
    return events;
}

static void object_take(struct anlos_object *o, uint8_t part, const uint8_t *d)
{
    switch (part) {
    case PART_STATE:
        object_state(o, d);
        break;
    case PART_DYNAMICS:
        object_dynamics(o, d);
        break;
    case PART_QUALITY:
        object_quality(o, d);
        break;
    default:
        object_fd(o, d);
        break;
    }
}

static uint32_t take_object(struct anlos_receiver *r, uint8_t part, const uint8_t *d)
{
    int fd = part == PART_FD;
    uint8_t id = (uint8_t)signal_raw(d, fd ? 24u : 16u, 8u);
    uint32_t counter = signal_raw(d, fd ? 32u : 24u, fd ? 12u : 4u);
    uint32_t events = 0;
    uint32_t i = object_find(r, id);

    if (r->assembling == 0u) {
        r->counts.frames_orphaned++;
    } else if ((counter != ((uint32_t)r->next.counter & (fd ? 0xFFFu : 0xFu))) ||
               (i >= r->number) || ((r->parts[i] & part) != 0u) ||
               ((r->parts[0] & (fd ? PARTS_CLASSIC : PART_FD)) != 0u)) {
        events = list_drop(r, &r->counts.lists_mixed);
    } else {
        if (i == r->next.n_objects) {
            r->next.objects[i].id = id;
            r->next.n_objects++;
        }
        r->parts[i] = (uint8_t)(r->parts[i] | part);
        object_take(&r->next.objects[i], part, d);
        events = list_finish(r);
    }
    return events;
}

/* Whatever it says, it spoils no list. */
static void take_motion(struct anlos_receiver *r, const uint8_t *d)
{
    if ((r->assembling == 0u) || (r->n_motions >= r->number) ||
        (signal_raw(d, 24u, 4u) != ((uint32_t)r->next.counter & 0xFu))) {
        r->counts.frames_orphaned++;
    } else {
        (void)memcpy(r->motions[r->n_motions], d, sizeof r->motions[0]);
        r->n_motions++;
    }
}

/* Nor does a corner.  One that cannot be spoils its area. */
static void take_corner(struct anlos_receiver *r, const uint8_t *d)
{
    uint32_t wall = signal_raw(d, 20u, 4u);
    uint32_t area = signal_raw(d, 24u, 4u);
    uint32_t corner = signal_raw(d, 28u, 4u);
    uint32_t n = signal_raw(d, 32u, 4u);
    struct anlos_value x = value_of(signal_signed(d, 36u, 14u), -8191, 8191, 0.02f, 0.0f);
    struct anlos_value y = value_of(signal_signed(d, 50u, 14u), -8191, 8191, 0.02f, 0.0f);

    if ((r->assembling == 0u) ||
        (signal_raw(d, 16u, 4u) != ((uint32_t)r->next.counter & 0xFu))) {
        r->counts.frames_orphaned++;
    } else if ((n == 0u) || (area >= ANLOS_AREAS)) {
        r->viewed = 1u;
    } else {
        struct anlos_area *a = &r->areas[area];
        r->viewed = 1u;
        if (((r->corners_said[area] != 0u) &&
             ((r->corners_said[area] != n) || (a->wall_id != wall))) ||
            (corner >= n) || (n > ANLOS_CORNERS) || (x.quality == ANLOS_NOT_AVAILABLE) ||
            (y.quality == ANLOS_NOT_AVAILABLE)) {
            r->corners_said[area] = CORNERS_DISAGREE;
        } else {
            a->wall_id = (uint8_t)wall;
            a->x_m[corner] = x.value;
            a->y_m[corner] = y.value;
            r->corners_said[area] = (uint8_t)n;
            r->corners_come[area] = (uint8_t)(r->corners_come[area] | (1u << corner));
        }
    }
}

/* ---- The receiver ----------------------------------------------------------------- */

void anlos_config_default(struct anlos_config *cfg)
{
    (void)memset(cfg, 0, sizeof *cfg);
    cfg->first_id = ANLOS_FIRST_ID;
    cfg->sources = (uint8_t)(1u << (uint32_t)ANLOS_SOURCE_LIVE);
    cfg->status_ms = 350u;
    cfg->list_ms = 600u;
    cfg->diagnosis_ms = 3500u;
    cfg->assembly_ms = 200u;
    cfg->age_ms = 1000u;
}

int anlos_receiver_init(struct anlos_receiver *r, const struct anlos_config *cfg)
{
    int err = -1;

    if (r != NULL) {
        (void)memset(r, 0, sizeof *r);
        if (cfg != NULL) {
            r->cfg = *cfg;
        } else {
            anlos_config_default(&r->cfg);
        }
        status_forget(&r->status);
        if ((r->cfg.first_id <= 0x7F0u) && ((r->cfg.first_id % 0x10u) == 0u) &&
            (r->cfg.status_ms > 0u) && (r->cfg.list_ms > 0u) &&
            (r->cfg.diagnosis_ms > 0u) && (r->cfg.assembly_ms > 0u) &&
            (r->cfg.age_ms > 0u)) {
            err = 0;
        }
    }
    return err;
}

static int kind_of(uint32_t offset, enum kind *kind)
{
    static const enum kind kinds[10] = {
        KIND_STATUS,       KIND_DIAGNOSIS,       KIND_HEADER,         KIND_TIME,
        KIND_OBJECT_STATE, KIND_OBJECT_DYNAMICS, KIND_OBJECT_QUALITY, KIND_OBJECT_MOTION,
        KIND_OBJECT_FD,    KIND_FIELD_OF_VIEW};
    int ours = offset < 10u;

    *kind = ours ? kinds[offset] : KIND_STATUS;
    return ours;
}

static void watch_feed(struct anlos_watch *w, uint32_t now_ms)
{
    w->good_ms = now_ms;
    w->running = 1u;
}

static uint32_t frame_use(struct anlos_receiver *r, enum kind kind, const uint8_t *data,
                          uint32_t delta, uint32_t now_ms)
{
    uint32_t events = 0;

    switch (kind) {
    case KIND_STATUS:
        watch_feed(&r->status_watch, now_ms);
        status_take(&r->status, data);
        if ((r->status.state == ANLOS_STATE_SHUTDOWN) && !channel_valid(r, kind)) {
            r->status.state = ANLOS_STATE_UNKNOWN; /* one frame alone is no proof */
        }
        events = ANLOS_EVENT_STATUS;
        break;
    case KIND_DIAGNOSIS:
        watch_feed(&r->diagnosis_watch, now_ms);
        if (channel_valid(r, KIND_DIAGNOSIS)) {
            diagnosis_take(&r->diagnosis, data);
            events = ANLOS_EVENT_DIAGNOSIS;
        }
        break;
    case KIND_HEADER:
        events = take_header(r, data, delta, now_ms);
        break;
    case KIND_TIME:
        events = take_time(r, data, delta);
        break;
    case KIND_OBJECT_STATE:
        events = take_object(r, PART_STATE, data);
        break;
    case KIND_OBJECT_DYNAMICS:
        events = take_object(r, PART_DYNAMICS, data);
        break;
    case KIND_OBJECT_QUALITY:
        events = take_object(r, PART_QUALITY, data);
        break;
    case KIND_OBJECT_MOTION:
        take_motion(r, data);
        break;
    case KIND_FIELD_OF_VIEW:
        take_corner(r, data);
        break;
    default:
        events = take_object(r, PART_FD, data);
        break;
    }
    return events;
}

uint32_t anlos_receiver_frame(struct anlos_receiver *r, uint32_t id, const uint8_t *data,
                              uint8_t length, uint32_t now_ms)
{
    uint32_t events = ANLOS_EVENT_FOREIGN;
    enum kind kind;

    /* Below the first identifier the difference wraps around and is of no kind. */
    if (kind_of(id - r->cfg.first_id, &kind) && ((data != NULL) || (length == 0u))) {
        events = anlos_receiver_tick(r, now_ms);
        struct outcome o = channel_take(r, kind, id, data, length);
        if (o.check == CHECK_OK) {
            events |= frame_use(r, kind, data, o.delta, now_ms);
        } else {
            events |= ANLOS_EVENT_WRONG;
            if ((o.check == CHECK_OTHER) && (kind == KIND_TIME) && (o.delta != 0u)) {
                r->headers = 0u;
            }
        }
    }
    return events;
}

static uint32_t elapsed_ms(uint32_t since_ms, uint32_t now_ms)
{
    uint32_t ms = now_ms - since_ms;

    return (ms <= UINT32_C(0x7FFFFFFF)) ? ms : 0u;
}

static int watch_expired(struct anlos_watch *w, uint32_t limit_ms, uint32_t now_ms)
{
    int expired = (w->running != 0u) && (elapsed_ms(w->good_ms, now_ms) > limit_ms);

    if (expired) {
        w->running = 0u;
    }
    return expired;
}

/* The silence of what was stopped is none to be told. */
static uint32_t timed_out(struct anlos_receiver *r)
{
    uint32_t events = 0;

    if (r->status.state != ANLOS_STATE_SHUTDOWN) {
        r->counts.timeouts++;
        events = ANLOS_EVENT_TIMEOUT;
    }
    return events;
}

uint32_t anlos_receiver_tick(struct anlos_receiver *r, uint32_t now_ms)
{
    uint32_t events = 0;

    if (watch_expired(&r->status_watch, r->cfg.status_ms, now_ms)) {
        channels_restart(r, KIND_STATUS, KIND_STATUS);
        events |= timed_out(r);
        status_forget(&r->status);
    }
    if (watch_expired(&r->diagnosis_watch, r->cfg.diagnosis_ms, now_ms)) {
        channels_restart(r, KIND_DIAGNOSIS, KIND_DIAGNOSIS);
        events |= timed_out(r);
    }
    if ((r->assembling != 0u) &&
        (elapsed_ms(r->next.header_ms, now_ms) > r->cfg.assembly_ms)) {
        events |= list_drop(r, &r->counts.lists_torn);
    }
    if (watch_expired(&r->list_watch, r->cfg.list_ms, now_ms)) {
        if (r->assembling != 0u) {
            events |= list_drop(r, &r->counts.lists_torn);
        }
        channels_restart(r, KIND_HEADER, KIND_FIELD_OF_VIEW);
        r->listed = 0u;
        r->header_seen = 0u;
        events |= timed_out(r);
    }
    return events;
}

/* INVALID when any kind of frames of lists is, but those that none needs, ObjectMotion
 * and FieldOfView; else that of the header and Time. */
static enum anlos_link list_link(const struct anlos_receiver *r)
{
    enum anlos_link link = channel_link(&r->channels[KIND_HEADER]);

    if ((link == ANLOS_VALID) && !channel_valid(r, KIND_TIME)) {
        link = ANLOS_INIT;
    }
    for (uint32_t k = (uint32_t)KIND_HEADER; k <= (uint32_t)KIND_OBJECT_FD; k++) {
        if (r->channels[k].state == (uint8_t)ANLOS_INVALID) {
            link = ANLOS_INVALID;
        }
    }
    return link;
}

static enum anlos_trust trust_of(const struct anlos_receiver *r,
                                 const struct anlos_view *v)
{
    enum anlos_trust trust = ANLOS_TRUST_NONE;

    if ((v->status_link == ANLOS_VALID) && (v->list_link == ANLOS_VALID) &&
        (v->list != NULL) && ((v->age_known == 0u) || (v->age_ms <= r->cfg.age_ms)) &&
        ((((uint32_t)r->cfg.sources >> (uint32_t)v->status.source) & 1u) != 0u)) {
        if ((v->status.state == ANLOS_STATE_ACTIVE) && (v->list->truncated == 0u) &&
            (v->list->latency_s.quality != ANLOS_NOT_AVAILABLE)) {
            trust = ANLOS_TRUST_FULL;
        } else if ((v->status.state == ANLOS_STATE_ACTIVE) ||
                   (v->status.state == ANLOS_STATE_DEGRADED)) {
            trust = ANLOS_TRUST_OBJECTS;
        } else {
            /* the other states vouch for nothing */
        }
    }
    return trust;
}

void anlos_receiver_get(struct anlos_receiver *r, uint32_t now_ms,
                        struct anlos_view *view)
{
    (void)anlos_receiver_tick(r, now_ms);
    (void)memset(view, 0, sizeof *view);
    view->status_link = channel_link(&r->channels[KIND_STATUS]);
    view->diagnosis_link = channel_link(&r->channels[KIND_DIAGNOSIS]);
    view->list_link = list_link(r);
    view->list = (r->listed != 0u) ? &r->list : NULL;
    if (view->status_link == ANLOS_VALID) {
        view->status = r->status;
    } else {
        view->status.state = r->status.state;
        status_forget(&view->status);
    }
    view->diagnosis = r->diagnosis;
    view->counts = r->counts;
    if ((view->list != NULL) && (view->list->latency_s.quality != ANLOS_NOT_AVAILABLE)) {
        view->age_ms = (uint32_t)((view->list->latency_s.value * 1000.0f) + 0.5f) +
                       elapsed_ms(view->list->header_ms, now_ms);
        view->age_known = 1u;
    }
    view->trust = trust_of(r, view);
}
