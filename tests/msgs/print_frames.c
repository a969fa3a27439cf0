/* SPDX-License-Identifier: MIT */
/* Frames in the format of candump -L, each followed by what went into it:
 * "# Message Signal=value ...", NaN for what is not known, values out of range as they
 * were.  For check_dbc.py. */
#include <math.h>
#include <stdio.h>

#include "msgs/can/e2e.h"
#include "msgs/can/frames.h"

static struct can_protection protection = {.base = CAN_BASE_DEFAULT};

static void print_frame(struct can_frame_data *f)
{
    can_protect(&protection, f);
    can_protection_sent(&protection, f);
    printf("(1764000000.250000) can0 %03X#%s", (unsigned)f->id, f->fd ? "#1" : "");
    for (int i = 0; i < f->size; i++)
        printf("%02X", f->data[i]);
    printf("\n");
}

static void print_classic(const struct can_object *o)
{
    struct can_frame_data f;
    can_pack_object_state(&f, CAN_BASE_DEFAULT, o);
    print_frame(&f);
    printf("# ObjectState Id=%d Counter=%d Measurement=%u X=%.9g Y=%.9g Z=%.9g\n", o->id,
           o->counter & 15, o->measurement, o->position_m[0], o->position_m[1],
           o->position_m[2]);
    can_pack_object_dynamics(&f, CAN_BASE_DEFAULT, o);
    print_frame(&f);
    printf("# ObjectDynamics Id=%d Counter=%d Vx=%.9g Vy=%.9g Existence=%.9g Class=%u "
           "DynamicProperty=%u\n",
           o->id, o->counter & 15, o->velocity_m_s[0], o->velocity_m_s[1],
           100 * o->existence, o->class, o->motion);
    can_pack_object_quality(&f, CAN_BASE_DEFAULT, o);
    print_frame(&f);
    printf("# ObjectQuality Id=%d Counter=%d SigmaX=%.9g SigmaY=%.9g Correlation=%.9g "
           "SigmaV=%.9g Length=%.9g Width=%.9g\n",
           o->id, o->counter & 15, o->sigma_m[0], o->sigma_m[1], o->correlation,
           o->sigma_v_m_s, o->length_m, o->width_m);
}

static void print_motion(const struct can_object *o)
{
    const double degrees = 180 / acos(-1);
    struct can_frame_data f;
    can_pack_object_motion(&f, CAN_BASE_DEFAULT, o);
    print_frame(&f);
    printf("# ObjectMotion Id=%d Counter=%d Course=%.9g SigmaCourse=%.9g SigmaVx=%.9g "
           "SigmaVy=%.9g CorrelationV=%.9g\n",
           o->id, o->counter & 15, degrees * o->course_rad, degrees * o->sigma_course_rad,
           o->sigma_velocity_m_s[0], o->sigma_velocity_m_s[1], o->velocity_correlation);
}

static void print_fd(const struct can_object *o)
{
    static const char *const axes[] = {"XX", "XY", "XZ", "YY", "YZ", "ZZ"};
    struct can_frame_data f;
    can_pack_object_fd(&f, CAN_BASE_DEFAULT, o);
    print_frame(&f);
    printf("# ObjectFD Id=%d Counter=%d Measurement=%u BehindNoWall=%d InFreeView=%d "
           "Class=%u DynamicProperty=%u ClassProbability=%.9g Existence=%.9g",
           o->id, o->counter & 4095, o->measurement, o->behind_no_wall, o->in_free_view,
           o->class, o->motion, 100 * o->class_probability, 100 * o->existence);
    printf(" SigmaV=%.9g Length=%.9g Width=%.9g Height=%.9g Unseen=%.9g Age=%.9g "
           "WallId=%d X=%.17g Y=%.17g Z=%.17g Vx=%.17g Vy=%.17g",
           o->sigma_v_m_s, o->length_m, o->width_m, o->height_m, o->unseen_s, o->age_s,
           o->wall, o->position_m[0], o->position_m[1], o->position_m[2],
           o->velocity_m_s[0], o->velocity_m_s[1]);
    for (int i = 0; i < 6; i++)
        printf(" Covariance%s=%.17g", axes[i], o->covariance_m2[i]);
    printf("\n");
}

/* Everything at one value of a kind: 0, NaN, far too large, far too small. */
static struct can_object object_of(double value)
{
    struct can_object o = {.id = 255,
                           .counter = UINT16_MAX,
                           .position_m = {value, value, value},
                           .measurement = CAN_DELETED,
                           .existence = value,
                           .velocity_m_s = {value, value},
                           .sigma_m = {value, value},
                           .correlation = value,
                           .length_m = value,
                           .width_m = value,
                           .class = CAN_EXTENDED,
                           .motion = CAN_MOVING,
                           .sigma_v_m_s = value,
                           .course_rad = value,
                           .sigma_course_rad = value,
                           .sigma_velocity_m_s = {value, value},
                           .velocity_correlation = value,
                           .height_m = value,
                           .class_probability = value,
                           .age_s = value,
                           .unseen_s = value,
                           .wall = 255,
                           .behind_no_wall = true,
                           .in_free_view = true};
    for (int i = 0; i < 6; i++)
        o.covariance_m2[i] = value;
    return o;
}

/* Numbers without any pattern, from -1 to 1. */
static double draw(void)
{
    static uint32_t state = 12345;
    state = state * 1664525u + 1013904223u;
    return (double)(state >> 8) / 8388608.0 - 1;
}

static struct can_object object_at_random(int i)
{
    struct can_object o = {.id = (uint8_t)i,
                           .counter = (uint16_t)(37 * i),
                           .position_m = {80 * draw(), 40 * draw(), 12 * draw()},
                           .measurement = (enum can_measurement)(i % 4),
                           .existence = fabs(draw()),
                           .velocity_m_s = {50 * draw(), 50 * draw()},
                           .sigma_m = {2.5 * fabs(draw()), 2.5 * fabs(draw())},
                           .correlation = draw(),
                           .length_m = 6 * fabs(draw()),
                           .width_m = 3 * fabs(draw()),
                           .class = (enum can_class)(i / 4 % 4),
                           .motion = (enum can_motion)(i % 3),
                           .sigma_v_m_s = 3 * fabs(draw()),
                           .height_m = 40 * fabs(draw()),
                           .class_probability = fabs(draw()),
                           .age_s = 6000 * fabs(draw()),
                           .unseen_s = 40 * fabs(draw()),
                           .wall = (uint8_t)(3 * i),
                           .behind_no_wall = i % 2,
                           .in_free_view = i / 2 % 2};
    o.course_rad = acos(-1) * draw();
    o.sigma_course_rad = fabs(draw());
    o.sigma_velocity_m_s[0] = 6 * fabs(draw());
    o.sigma_velocity_m_s[1] = 6 * fabs(draw());
    o.velocity_correlation = draw();
    for (int k = 0; k < 6; k++)
        o.covariance_m2[k] = k == 0 || k == 3 || k == 5 ? fabs(draw()) : draw();
    return o;
}

static void print_objects(void)
{
    const double ends[] = {0, -0.0, NAN, 1e9, -1e9, INFINITY, -INFINITY};
    struct can_object o;
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        o = object_of(ends[i]);
        print_classic(&o);
        print_fd(&o);
        print_motion(&o);
    }
    for (int i = 0; i < 300; i++) {
        o = object_at_random(i % 256);
        print_classic(&o);
        print_fd(&o);
        print_motion(&o);
    }
}

static void print_states(void)
{
    struct can_frame_data f;
    const struct can_status status[] = {
        {CAN_ACTIVE, CAN_LIVE, 0, 21.4, 343.97, 4.0, false},
        {CAN_STANDBY, CAN_SIMULATION, 0xffff, -40, 280, 0.0, true},
        {CAN_DEGRADED, CAN_REPLAY, 0x8001, NAN, NAN, NAN, false},
        {CAN_FAULT, CAN_LIVE, 1 << CAN_FAULT_CLIPPED, 1000, INFINITY, 99.0, false},
    };
    for (size_t i = 0; i < sizeof status / sizeof *status; i++) {
        const struct can_status *s = &status[i];
        can_pack_status(&f, CAN_BASE_DEFAULT, s);
        print_frame(&f);
        printf("# Status State=%u Source=%u Faults=%d Temperature=%.9g SoundSpeed=%.9g "
               "Range=%.9g Shutdown=%d\n",
               s->state, s->source, s->faults, s->temperature_c, s->sound_speed_m_s,
               s->range_m, s->shutdown);
    }
    const struct can_diagnosis diagnoses[] = {
        {0.5, 18.3, 1023, 15, 31, 30, 12, true, 15},
        {NAN, NAN, 0, 0, 0, 0, 0, false, 0},
        {2, -100, 7, 1, 2, 3, 5, false, 4},
    };
    for (size_t i = 0; i < sizeof diagnoses / sizeof *diagnoses; i++) {
        const struct can_diagnosis *d = &diagnoses[i];
        can_pack_diagnosis(&f, CAN_BASE_DEFAULT, d);
        print_frame(&f);
        printf("# Diagnosis Cpu=%.9g SignalToNoise=%.9g DroppedPings=%d VersionMajor=%d "
               "VersionMinor=%d VersionPatch=%d TroubleCode=%d TroublePresent=%d "
               "TroubleCount=%d\n",
               100 * d->cpu, d->snr_db, d->dropped, d->version_major, d->version_minor,
               d->version_patch, d->trouble, d->trouble_present, d->trouble_count);
    }
}

static void print_headers(void)
{
    struct can_frame_data f;
    const struct can_list_header headers[] = {
        {.time_sync = CAN_SYNC_UNKNOWN},
        {32, 4095, 4094, 40940, true, CAN_SYNCHRONISED, 0},
        {5, 1234, 58.4, 250, false, CAN_NOT_SYNCHRONISED, 0},
        {33, 1, NAN, NAN, false, CAN_SYNCHRONISED, 0}};
    for (size_t i = 0; i < sizeof headers / sizeof *headers; i++) {
        const struct can_list_header *h = &headers[i];
        can_pack_list_header(&f, CAN_BASE_DEFAULT, h);
        print_frame(&f);
        printf("# ListHeader Number=%d Counter=%d Latency=%.9g Cycle=%.9g Truncated=%d ",
               h->number, h->counter, h->latency_ms, h->cycle_ms, h->truncated);
        printf(h->time_sync == CAN_SYNC_UNKNOWN ? "TimeSync=nan " : "TimeSync=%u ",
               h->time_sync);
        printf("InterfaceVersion=2\n");
    }
    can_pack_time(&f, CAN_BASE_DEFAULT, INT64_C(4294967295750000000));
    print_frame(&f);
    printf("# Time Seconds=4294967295 Fraction=0.75\n");
}

static void print_view(void)
{
    const double places[] = {0, 1e3, -1e3, NAN, 12.345, -0.031};
    struct can_frame_data f;
    for (unsigned i = 0; i < sizeof places / sizeof *places; i++) {
        const struct can_view_corner c = {.counter = (uint16_t)(37 * i),
                                          .wall = (uint8_t)(3 * i),
                                          .area = (uint8_t)i,
                                          .corner = (uint8_t)i,
                                          .corners = (uint8_t)(i + 2),
                                          .at_m = {places[i], places[5 - i]}};
        can_pack_field_of_view(&f, CAN_BASE_DEFAULT, &c);
        print_frame(&f);
        printf("# FieldOfView Counter=%u WallId=%u Area=%u Corner=%u Corners=%u X=%.9g "
               "Y=%.9g\n",
               c.counter & 15u, c.wall, c.area, c.corner, c.corners, c.at_m[0],
               c.at_m[1]);
    }
}

static void print_inputs(void)
{
    const double values[] = {0, NAN, 1e9, -1e9, 0.123, -0.321};
    const double degrees = 180 / acos(-1);
    struct can_frame_data f;
    for (unsigned i = 0; i < sizeof values / sizeof *values; i++) {
        double v = values[i];
        unsigned choice = i % 2;
        can_pack_ego_motion(&f, CAN_BASE_DEFAULT,
                            &(struct can_ego_motion){v, v, choice, choice});
        print_frame(&f);
        printf("# EgoMotion Speed=%.9g YawRate=%.9g Standstill=%u Validity=%u\n", v,
               v * degrees, choice, choice);
        can_pack_ambient(&f, CAN_BASE_DEFAULT, &(struct can_ambient){v, v});
        print_frame(&f);
        printf("# Ambient Temperature=%.9g Humidity=%.9g\n", v, 100 * v);
        can_pack_wall_in(&f, CAN_BASE_DEFAULT,
                         &(struct can_wall_in){(uint8_t)i, choice, v, v, v, v});
        print_frame(&f);
        printf("# WallIn Azimuth=%.9g Distance=%.9g SigmaAzimuth=%.9g SigmaDistance=%.9g "
               "WallId=%u Validity=%u\n",
               v * degrees, v, v * degrees, v, i, choice);
        can_pack_wall_ends_in(&f, CAN_BASE_DEFAULT,
                              &(struct can_wall_ends_in){(uint8_t)i, choice, v, -v});
        print_frame(&f);
        printf("# WallEndsIn From=%.9g To=%.9g WallId=%u Validity=%u\n", v, -v, i,
               choice);
        can_pack_save_request(
            &f, CAN_BASE_DEFAULT,
            &(struct can_save_request){(uint16_t)(13107 * i), i + 2, choice});
        print_frame(&f);
        printf("# SaveRequest Number=%u Reason=%u Request=%u\n", 13107 * i, i + 2,
               choice);
    }
    can_pack_save_request(
        &f, CAN_BASE_DEFAULT,
        &(struct can_save_request){1, CAN_REASON_UNKNOWN, CAN_REQUEST_UNKNOWN});
    print_frame(&f);
    printf("# SaveRequest Number=1 Reason=nan Request=nan\n");
}

int main(void)
{
    print_states();
    print_headers();
    print_objects();
    print_view();
    print_inputs();
    return fflush(stdout) != 0 || ferror(stdout);
}
