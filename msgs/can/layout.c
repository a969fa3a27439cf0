/* SPDX-License-Identifier: MIT */
#include "msgs/can/layout.h"

#include <math.h>
#include <string.h>

#include "msgs/can/frames.h"

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

/* What holds the value: its type is the compiler's to tell. */
#define SCALED(noun, field, factor)                                                      \
    {                                                                                    \
        _Generic(((struct noun *)0)->field, double                                       \
                 : CAN_MEMBER_DOUBLE, bool                                               \
                 : CAN_MEMBER_BOOL, uint8_t                                              \
                 : CAN_MEMBER_U8, uint16_t                                               \
                 : CAN_MEMBER_U16, uint32_t                                              \
                 : CAN_MEMBER_U32),                                                      \
            offsetof(struct noun, field), factor                                         \
    }
#define IN(noun, field) SCALED(noun, field, 1)
#define NOWHERE                                                                          \
    {                                                                                    \
        CAN_MEMBER_NONE, 0, 1                                                            \
    }
#define PERCENT 100
#define DEGREES (180 / M_PI)

static const char *const states[] = {"Init",  "Calibrating", "Active",  "Degraded",
                                     "Fault", "Blocked",     "Standby", NULL};
static const char *const sources[] = {"Live", "Replay", "Simulation", NULL};
static const char *const time_syncs[] = {"NotSynchronised", "Synchronised", NULL};
static const char *const truncations[] = {"Complete", "Truncated", NULL};
static const char *const measurements[] = {"New", "Measured", "Predicted", "Deleted",
                                           NULL};
static const char *const classes[] = {"Unknown",  "Point",     "Plate",
                                      "Extended", "Multipath", NULL};
static const char *const motions[] = {"Unknown", "Standing", "Moving", NULL};
static const char *const standstills[] = {"Rolling", "Standing", NULL};
static const char *const validities[] = {"Invalid", "Valid", NULL};
static const char *const presences[] = {"Past", "Present", NULL};
static const char *const answers[] = {"No", "Yes", NULL};
static const char *const requests[] = {"Idle", "Save", NULL};
static const char *const reasons[] = {"Unspecified",      "Driver",  "Collision",
                                      "EmergencyBraking", "Evasion", "MissedObject",
                                      "FalseObject",      "Test",    NULL};

/* A trouble code is the number of a fault + 1. */
static const char *const troubles[] = {"None",
                                       "ImageStale",
                                       "EgoMotionMissing",
                                       "TemperatureUnknown",
                                       "ChannelsDead",
                                       "ElementErrors",
                                       "WallLost",
                                       "ClockJump",
                                       "InputE2eWrong",
                                       "ArrayAway",
                                       "NodeLost",
                                       "Clipped",
                                       "ListsDropped",
                                       "RangeReduced",
                                       "ElementsCovered",
                                       "ElementsMoved",
                                       "Interference",
                                       NULL};
#define FAULTS (troubles + 1)

#define NUMBER  CAN_SIGNAL_NUMBER
#define SIGMA   CAN_SIGNAL_SIGMA
#define CHOICE  CAN_SIGNAL_CHOICE
#define COUNTER CAN_SIGNAL_COUNTER
#define BITS    CAN_SIGNAL_BITS
#define FLOAT   CAN_SIGNAL_FLOAT
#define NEVER   CAN_NEVER_MISSING

/* clang-format off */
#define E2E_P11                                                                     \
    {"E2eCrc",           "", 0,  8, NUMBER,  1, 0, 0, 255, NEVER, NOWHERE, NULL},   \
    {"E2eCounter",       "", 8,  4, COUNTER, 1, 0, 0, 14,  NEVER, NOWHERE, NULL},   \
    {"E2eDataIdNibble",  "", 12, 4, NUMBER,  1, 0, 0, 15,  NEVER, NOWHERE, NULL}
#define E2E_P05                                                                     \
    {"E2eCrc",           "", 0, 16, NUMBER,  1, 0, 0, 65535, NEVER, NOWHERE, NULL}, \
    {"E2eCounter",       "", 16, 8, COUNTER, 1, 0, 0, 255, NEVER, NOWHERE, NULL}
#define OBJECT                                                                      \
    {"Id",      "", 16, 8, COUNTER, 1, 0, 0, 255, NEVER, IN(can_object, id), NULL}, \
    {"Counter", "", 24, 4, COUNTER, 1, 0, 0, 15,  NEVER, IN(can_object, counter), NULL}

/* name, unit, start, length, kind, factor, offset, min, max, missing, member, names */
static const struct can_signal status[] = {
    E2E_P11,
    {"State",       "",     16, 3,  CHOICE, 1,   0,   0, 6,     7,     IN(can_status, state), states},
    {"Source",      "",     19, 2,  CHOICE, 1,   0,   0, 2,     3,     IN(can_status, source), sources},
    {"Faults",      "",     24, 16, BITS,   1,   0,   0, 65535, NEVER, IN(can_status, faults), FAULTS},
    {"Temperature", "degC", 40, 8,  NUMBER, 0.5, -40, 0, 254,   255,   IN(can_status, temperature_c), NULL},
    {"SoundSpeed",  "m/s",  48, 10, NUMBER, 0.1, 280, 0, 1022,  1023,  IN(can_status, sound_speed_m_s), NULL},
    {"Range",       "m",    58, 6,  NUMBER, 0.2, -0.2, 1, 63,   0,     IN(can_status, range_m), NULL},
    {"Shutdown",    "",     21, 1,  CHOICE, 1,   0,   0, 1,     NEVER, IN(can_status, shutdown), answers},
};

static const struct can_signal diagnosis[] = {
    E2E_P11,
    {"Cpu",            "%",  16, 7,  NUMBER,  1, 0,   0, 100,  127,   SCALED(can_diagnosis, cpu, PERCENT), NULL},
    {"SignalToNoise",  "dB", 23, 7,  NUMBER,  1, -30, 0, 126,  127,   IN(can_diagnosis, snr_db), NULL},
    {"DroppedPings",   "",   30, 10, COUNTER, 1, 0,   0, 1023, NEVER, IN(can_diagnosis, dropped), NULL},
    {"VersionMajor",   "",   40, 4,  NUMBER,  1, 0,   0, 15,   NEVER, IN(can_diagnosis, version_major), NULL},
    {"VersionMinor",   "",   44, 5,  NUMBER,  1, 0,   0, 31,   NEVER, IN(can_diagnosis, version_minor), NULL},
    {"VersionPatch",   "",   49, 5,  NUMBER,  1, 0,   0, 31,   NEVER, IN(can_diagnosis, version_patch), NULL},
    {"TroubleCode",    "",   54, 5,  CHOICE,  1, 0,   0, CAN_FAULTS, 31, IN(can_diagnosis, trouble), troubles},
    {"TroublePresent", "",   59, 1,  CHOICE,  1, 0,   0, 1,    NEVER, IN(can_diagnosis, trouble_present), presences},
    {"TroubleCount",   "",   60, 4,  NUMBER,  1, 0,   0, 15,   NEVER, IN(can_diagnosis, trouble_count), NULL},
};

static const struct can_signal list_header[] = {
    E2E_P11,
    {"Number",    "",   16, 6,  NUMBER,  1,  0, 0, CAN_MAX_OBJECTS, NEVER, IN(can_list_header, number), NULL},
    {"TimeSync",  "",   22, 2,  CHOICE,  1,  0, 0, 1,    3,     IN(can_list_header, time_sync), time_syncs},
    {"Counter",   "",   24, 12, COUNTER, 1,  0, 0, 4095, NEVER, IN(can_list_header, counter), NULL},
    {"Latency",   "ms", 36, 12, NUMBER,  1,  0, 0, 4094, 4095,  IN(can_list_header, latency_ms), NULL},
    {"Cycle",     "ms", 48, 12, NUMBER,  10, 0, 0, 4094, 4095,  IN(can_list_header, cycle_ms), NULL},
    {"Truncated", "",   60, 1,  CHOICE,  1,  0, 0, 1,    NEVER, IN(can_list_header, truncated), truncations},
    {"InterfaceVersion", "", 61, 3, NUMBER, 1, 0, 0, 7,  NEVER, IN(can_list_header, version), NULL},
};

static const struct can_signal time[] = {
    E2E_P11,
    {"Seconds",  "s", 16, 32, NUMBER, 1,        0, 0, UINT32_MAX, NEVER, IN(can_time, seconds), NULL},
    {"Fraction", "s", 48, 16, NUMBER, 0x1p-16,  0, 0, 65535,      NEVER, IN(can_time, fraction), NULL},
};

static const struct can_signal object_state[] = {
    E2E_P11,
    OBJECT,
    {"Measurement", "",  28, 2,  CHOICE, 1,    0, 0,     3,    NEVER, IN(can_object, measurement), measurements},
    {"X",           "m", 30, 13, NUMBER, 0.02, 0, -4095, 4095, -4096, IN(can_object, position_m[0]), NULL},
    {"Y",           "m", 43, 12, NUMBER, 0.02, 0, -2047, 2047, -2048, IN(can_object, position_m[1]), NULL},
    {"Z",           "m", 55, 9,  NUMBER, 0.05, 0, -255,  255,  -256,  IN(can_object, position_m[2]), NULL},
};

static const struct can_signal object_dynamics[] = {
    E2E_P11,
    OBJECT,
    {"Vx",        "m/s", 28, 11, NUMBER, 0.05, 0, -1023, 1023, -1024, IN(can_object, velocity_m_s[0]), NULL},
    {"Vy",        "m/s", 39, 11, NUMBER, 0.05, 0, -1023, 1023, -1024, IN(can_object, velocity_m_s[1]), NULL},
    {"Existence", "%",   50, 7,  NUMBER, 1,    0, 0,     100,  127,   SCALED(can_object, existence, PERCENT), NULL},
    {"Class",     "",    57, 4,  CHOICE, 1,    0, 0,     4,    NEVER, IN(can_object, class), classes},
    {"DynamicProperty", "", 61, 3, CHOICE, 1,  0, 0,     2,    NEVER, IN(can_object, motion), motions},
};

static const struct can_signal object_quality[] = {
    E2E_P11,
    OBJECT,
    {"SigmaX",      "m",   28, 7, SIGMA,  0.02, 0, 0,   126, 127, IN(can_object, sigma_m[0]), NULL},
    {"SigmaY",      "m",   35, 7, SIGMA,  0.02, 0, 0,   126, 127, IN(can_object, sigma_m[1]), NULL},
    {"Correlation", "",    42, 6, NUMBER, 0.04, 0, -25, 25,  -32, IN(can_object, correlation), NULL},
    {"SigmaV",      "m/s", 48, 5, SIGMA,  0.1,  0, 0,   30,  31,  IN(can_object, sigma_v_m_s), NULL},
    {"Length",      "m",   53, 6, NUMBER, 0.1,  0, 0,   62,  63,  IN(can_object, length_m), NULL},
    {"Width",       "m",   59, 5, NUMBER, 0.1,  0, 0,   30,  31,  IN(can_object, width_m), NULL},
};

static const struct can_signal object_motion[] = {
    E2E_P11,
    OBJECT,
    {"Course",       "deg", 28, 9, NUMBER, 1,    0, -180, 180, -256, SCALED(can_object, course_rad, DEGREES), NULL},
    {"SigmaCourse",  "deg", 37, 6, SIGMA,  1,    0, 0,    62,  63,   SCALED(can_object, sigma_course_rad, DEGREES), NULL},
    {"SigmaVx",      "m/s", 43, 7, SIGMA,  0.05, 0, 0,    126, 127,  IN(can_object, sigma_velocity_m_s[0]), NULL},
    {"SigmaVy",      "m/s", 50, 7, SIGMA,  0.05, 0, 0,    126, 127,  IN(can_object, sigma_velocity_m_s[1]), NULL},
    {"CorrelationV", "",    57, 6, NUMBER, 0.04, 0, -25,  25,  -32,  IN(can_object, velocity_correlation), NULL},
};

static const struct can_signal object_fd[] = {
    E2E_P05,
    {"Id",               "",    24,  8,  COUNTER, 1,    0, 0, 255,   NEVER, IN(can_object, id), NULL},
    {"Counter",          "",    32,  12, COUNTER, 1,    0, 0, 4095,  NEVER, IN(can_object, counter), NULL},
    {"Measurement",      "",    44,  2,  CHOICE,  1,    0, 0, 3,     NEVER, IN(can_object, measurement), measurements},
    {"BehindNoWall",     "",    46,  1,  CHOICE,  1,    0, 0, 1,     NEVER, IN(can_object, behind_no_wall), answers},
    {"InFreeView",       "",    47,  1,  CHOICE,  1,    0, 0, 1,     NEVER, IN(can_object, in_free_view), answers},
    {"Class",            "",    48,  4,  CHOICE,  1,    0, 0, 4,     NEVER, IN(can_object, class), classes},
    {"DynamicProperty",  "",    52,  3,  CHOICE,  1,    0, 0, 2,     NEVER, IN(can_object, motion), motions},
    {"ClassProbability", "%",   55,  7,  NUMBER,  1,    0, 0, 100,   127,   SCALED(can_object, class_probability, PERCENT), NULL},
    {"Existence",        "%",   62,  14, NUMBER,  0.01, 0, 0, 10000, 16383, SCALED(can_object, existence, PERCENT), NULL},
    {"SigmaV",           "m/s", 76,  12, SIGMA,   0.01, 0, 0, 4094,  4095,  IN(can_object, sigma_v_m_s), NULL},
    {"Length",           "m",   88,  12, NUMBER,  0.01, 0, 0, 4094,  4095,  IN(can_object, length_m), NULL},
    {"Width",            "m",   100, 12, NUMBER,  0.01, 0, 0, 4094,  4095,  IN(can_object, width_m), NULL},
    {"Height",           "m",   112, 12, NUMBER,  0.01, 0, 0, 4094,  4095,  IN(can_object, height_m), NULL},
    {"Unseen",           "s",   124, 12, NUMBER,  0.01, 0, 0, 4094,  4095,  IN(can_object, unseen_s), NULL},
    {"Age",              "s",   136, 16, NUMBER,  0.1,  0, 0, 65534, 65535, IN(can_object, age_s), NULL},
    {"WallId",           "",    152, 8,  NUMBER,  1,    0, 0, 255,   NEVER, IN(can_object, wall), NULL},
    {"X",                "m",   160, 32, FLOAT,   1,    0, -1000, 1000, NEVER, IN(can_object, position_m[0]), NULL},
    {"Y",                "m",   192, 32, FLOAT,   1,    0, -1000, 1000, NEVER, IN(can_object, position_m[1]), NULL},
    {"Z",                "m",   224, 32, FLOAT,   1,    0, -1000, 1000, NEVER, IN(can_object, position_m[2]), NULL},
    {"Vx",               "m/s", 256, 32, FLOAT,   1,    0, -1000, 1000, NEVER, IN(can_object, velocity_m_s[0]), NULL},
    {"Vy",               "m/s", 288, 32, FLOAT,   1,    0, -1000, 1000, NEVER, IN(can_object, velocity_m_s[1]), NULL},
    {"CovarianceXX",     "m^2", 320, 32, FLOAT,   1,    0, 0,        1000000, NEVER, IN(can_object, covariance_m2[0]), NULL},
    {"CovarianceXY",     "m^2", 352, 32, FLOAT,   1,    0, -1000000, 1000000, NEVER, IN(can_object, covariance_m2[1]), NULL},
    {"CovarianceXZ",     "m^2", 384, 32, FLOAT,   1,    0, -1000000, 1000000, NEVER, IN(can_object, covariance_m2[2]), NULL},
    {"CovarianceYY",     "m^2", 416, 32, FLOAT,   1,    0, 0,        1000000, NEVER, IN(can_object, covariance_m2[3]), NULL},
    {"CovarianceYZ",     "m^2", 448, 32, FLOAT,   1,    0, -1000000, 1000000, NEVER, IN(can_object, covariance_m2[4]), NULL},
    {"CovarianceZZ",     "m^2", 480, 32, FLOAT,   1,    0, 0,        1000000, NEVER, IN(can_object, covariance_m2[5]), NULL},
};

static const struct can_signal field_of_view[] = {
    E2E_P11,
    {"Counter", "",  16, 4,  COUNTER, 1,    0, 0,     15,   NEVER, IN(can_view_corner, counter), NULL},
    {"WallId",  "",  20, 4,  NUMBER,  1,    0, 0,     15,   NEVER, IN(can_view_corner, wall), NULL},
    {"Area",    "",  24, 4,  NUMBER,  1,    0, 0,     14,   NEVER, IN(can_view_corner, area), NULL},
    {"Corner",  "",  28, 4,  NUMBER,  1,    0, 0,     7,    NEVER, IN(can_view_corner, corner), NULL},
    {"Corners", "",  32, 4,  NUMBER,  1,    0, 0,     8,    NEVER, IN(can_view_corner, corners), NULL},
    {"X",       "m", 36, 14, NUMBER,  0.02, 0, -8191, 8191, -8192, IN(can_view_corner, at_m[0]), NULL},
    {"Y",       "m", 50, 14, NUMBER,  0.02, 0, -8191, 8191, -8192, IN(can_view_corner, at_m[1]), NULL},
};

static const struct can_signal ego_motion[] = {
    E2E_P11,
    {"Speed",      "m/s",   16, 16, NUMBER, 0.01, 0, -32767, 32767, -32768, IN(can_ego_motion, speed_m_s), NULL},
    {"YawRate",    "deg/s", 32, 16, NUMBER, 0.01, 0, -32767, 32767, -32768, SCALED(can_ego_motion, yaw_rate_rad_s, DEGREES), NULL},
    {"Standstill", "",      48, 2,  CHOICE, 1,    0, 0,      1,     3,      IN(can_ego_motion, standstill), standstills},
    {"Validity",   "",      50, 2,  CHOICE, 1,    0, 0,      1,     3,      IN(can_ego_motion, validity), validities},
};

static const struct can_signal ambient[] = {
    E2E_P11,
    {"Temperature", "degC", 16, 11, NUMBER, 0.1, -40, 0, 1250, 2047, IN(can_ambient, temperature_c), NULL},
    {"Humidity",    "%",    27, 8,  NUMBER, 0.5, 0,   0, 200,  255,  SCALED(can_ambient, humidity, PERCENT), NULL},
};

static const struct can_signal wall_in[] = {
    E2E_P11,
    {"Azimuth",       "deg", 16, 16, NUMBER, 0.01, 0, -18000, 18000, -32768, SCALED(can_wall_in, azimuth_rad, DEGREES), NULL},
    {"Distance",      "m",   32, 12, NUMBER, 0.01, 0, 0,      4094,  4095,   IN(can_wall_in, distance_m), NULL},
    {"SigmaAzimuth",  "deg", 44, 7,  SIGMA,  0.1,  0, 0,      126,   127,    SCALED(can_wall_in, sigma_azimuth_rad, DEGREES), NULL},
    {"SigmaDistance", "m",   51, 7,  SIGMA,  0.01, 0, 0,      126,   127,    IN(can_wall_in, sigma_distance_m), NULL},
    {"WallId",        "",    58, 4,  NUMBER, 1,    0, 0,      15,    NEVER,  IN(can_wall_in, id), NULL},
    {"Validity",      "",    62, 2,  CHOICE, 1,    0, 0,      1,     3,      IN(can_wall_in, validity), validities},
};

static const struct can_signal wall_ends_in[] = {
    E2E_P11,
    {"From",     "m", 16, 12, NUMBER, 0.05, 0, -2047, 2047, -2048, IN(can_wall_ends_in, from_m), NULL},
    {"To",       "m", 28, 12, NUMBER, 0.05, 0, -2047, 2047, -2048, IN(can_wall_ends_in, to_m), NULL},
    {"WallId",   "",  58, 4,  NUMBER, 1,    0, 0,     15,   NEVER, IN(can_wall_ends_in, id), NULL},
    {"Validity", "",  62, 2,  CHOICE, 1,    0, 0,     1,    3,     IN(can_wall_ends_in, validity), validities},
};

static const struct can_signal save_request[] = {
    E2E_P11,
    {"Number",  "", 16, 16, COUNTER, 1, 0, 0, 65535, NEVER, IN(can_save_request, number), NULL},
    {"Reason",  "", 32, 4,  CHOICE,  1, 0, 0, 7,     15,    IN(can_save_request, reason), reasons},
    {"Request", "", 36, 2,  CHOICE,  1, 0, 0, 1,     3,     IN(can_save_request, request), requests},
};

#define SIGNALS(table) table, sizeof table / sizeof *table

/* name, id, size, fd, input, cycle_ms, profile, signals */
static const struct can_message messages[] = {
    {"Status",         CAN_ID_STATUS,          8,  false, false, 100,  CAN_PROFILE_11_NIBBLE, SIGNALS(status)},
    {"Diagnosis",      CAN_ID_DIAGNOSIS,       8,  false, false, 1000, CAN_PROFILE_11_NIBBLE, SIGNALS(diagnosis)},
    {"ListHeader",     CAN_ID_LIST_HEADER,     8,  false, false, 0,    CAN_PROFILE_11_NIBBLE, SIGNALS(list_header)},
    {"Time",           CAN_ID_TIME,            8,  false, false, 0,    CAN_PROFILE_11_NIBBLE, SIGNALS(time)},
    {"ObjectState",    CAN_ID_OBJECT_STATE,    8,  false, false, 0,    CAN_PROFILE_11_NIBBLE, SIGNALS(object_state)},
    {"ObjectDynamics", CAN_ID_OBJECT_DYNAMICS, 8,  false, false, 0,    CAN_PROFILE_11_NIBBLE, SIGNALS(object_dynamics)},
    {"ObjectQuality",  CAN_ID_OBJECT_QUALITY,  8,  false, false, 0,    CAN_PROFILE_11_NIBBLE, SIGNALS(object_quality)},
    {"ObjectMotion",   CAN_ID_OBJECT_MOTION,   8,  false, false, 0,    CAN_PROFILE_11_NIBBLE, SIGNALS(object_motion)},
    {"ObjectFD",       CAN_ID_OBJECT_FD,       64, true,  false, 0,    CAN_PROFILE_05,        SIGNALS(object_fd)},
    {"FieldOfView",    CAN_ID_FIELD_OF_VIEW,   8,  false, false, 0,    CAN_PROFILE_11_NIBBLE, SIGNALS(field_of_view)},
    {"WallEndsIn",     CAN_ID_WALL_ENDS_IN,    8,  false, true,  100,  CAN_PROFILE_11_NIBBLE, SIGNALS(wall_ends_in)},
    {"EgoMotion",      CAN_ID_EGO_MOTION,      8,  false, true,  20,   CAN_PROFILE_11_NIBBLE, SIGNALS(ego_motion)},
    {"Ambient",        CAN_ID_AMBIENT,         8,  false, true,  1000, CAN_PROFILE_11_NIBBLE, SIGNALS(ambient)},
    {"WallIn",         CAN_ID_WALL_IN,         8,  false, true,  100,  CAN_PROFILE_11_NIBBLE, SIGNALS(wall_in)},
    {"SaveRequest",    CAN_ID_SAVE_REQUEST,    8,  false, true,  1000, CAN_PROFILE_11_NIBBLE, SIGNALS(save_request)},
};

/* clang-format on */
const struct can_message *can_messages(size_t *n)
{
    *n = sizeof messages / sizeof *messages;
    return messages;
}

const struct can_message *can_message_find(uint32_t base, uint32_t id)
{
    for (size_t i = 0; i < sizeof messages / sizeof *messages; i++)
        if (id == base + messages[i].id)
            return &messages[i];
    return NULL;
}
