/* Frames in the format of candump -L, each followed by what went into it:
 * "# Message Signal=value ...", NaN for what is not known.  For check_dbc.py. */
#include <math.h>
#include <stdio.h>

#include "msgs/can/frames.h"

static void print_frame(const struct can_frame_data *f)
{
    printf("(1764000000.250000) can0 %03X#", (unsigned)f->id);
    for (int i = 0; i < f->size; i++)
        printf("%02X", f->data[i]);
    printf("\n");
}

static void print_object(const struct can_object *o)
{
    struct can_frame_data f;
    can_pack_object_state(&f, CAN_BASE_DEFAULT, o);
    print_frame(&f);
    printf("# ObjectState Id=%d Counter=%d Measurement=%d X=%.9g Y=%.9g Z=%.9g\n", o->id,
           o->counter, o->measurement, o->position_m[0], o->position_m[1],
           o->position_m[2]);
    can_pack_object_dynamics(&f, CAN_BASE_DEFAULT, o);
    print_frame(&f);
    printf("# ObjectDynamics Id=%d Counter=%d Vx=%.9g Vy=%.9g Existence=%.9g Class=0 "
           "DynamicProperty=0\n",
           o->id, o->counter, o->velocity_m_s[0], o->velocity_m_s[1], 100 * o->existence);
    can_pack_object_quality(&f, CAN_BASE_DEFAULT, o);
    print_frame(&f);
    printf("# ObjectQuality Id=%d Counter=%d SigmaX=%.9g SigmaY=%.9g Correlation=%.9g "
           "SigmaV=nan Length=%.9g Width=%.9g\n",
           o->id, o->counter, o->sigma_m[0], o->sigma_m[1], o->correlation, o->length_m,
           o->width_m);
}

static void print_objects(void)
{
    const struct can_object objects[] = {
        {1, 0, {0, 0, 0}, CAN_NEW, 0, {0, 0}, {0, 0}, 0, 0, 0},
        {255,
         15,
         {81.9, 40.94, 12.75},
         CAN_DELETED,
         1,
         {51.15, 51.15},
         {2.52, 2.52},
         1,
         6.2,
         3},
        {128,
         8,
         {-81.9, -40.94, -12.75},
         CAN_MEASURED,
         0.5,
         {-51.15, -51.15},
         {0.01, 1.111},
         -1,
         0.1,
         0.1},
        {42,
         5,
         {3.217, -1.913, 0.871},
         CAN_PREDICTED,
         0.934,
         {-1.42, 0.03},
         {0.013, 0.048},
         0.37,
         1.23,
         0.57},
        {7, 3, {NAN, NAN, NAN}, CAN_MEASURED, NAN, {NAN, NAN}, {NAN, NAN}, NAN, NAN, NAN},
    };
    for (size_t i = 0; i < sizeof objects / sizeof *objects; i++)
        print_object(&objects[i]);
}

int main(void)
{
    struct can_frame_data f;
    const struct can_status status[] = {
        {CAN_ACTIVE, CAN_LIVE, 0, 21.4, 343.97},
        {CAN_STANDBY, CAN_SIMULATION, 0xffff, -40, 280},
        {CAN_DEGRADED, CAN_REPLAY, 0x8001, NAN, NAN},
    };
    for (size_t i = 0; i < sizeof status / sizeof *status; i++) {
        can_pack_status(&f, CAN_BASE_DEFAULT, &status[i]);
        print_frame(&f);
        printf("# Status State=%d Source=%d Faults=%d Temperature=%.9g SoundSpeed=%.9g\n",
               status[i].state, status[i].source, status[i].faults,
               status[i].temperature_c, status[i].sound_speed_m_s);
    }
    const struct can_list_header headers[] = {{0, 0, 0, 0, false},
                                              {32, 4095, 4094, 40940, true},
                                              {5, 1234, 58.4, 250, false},
                                              {1, 1, NAN, NAN, false}};
    for (size_t i = 0; i < sizeof headers / sizeof *headers; i++) {
        can_pack_list_header(&f, CAN_BASE_DEFAULT, &headers[i]);
        print_frame(&f);
        printf("# ListHeader Number=%d Counter=%d Latency=%.9g Cycle=%.9g Truncated=%d "
               "TimeSync=0 InterfaceVersion=1\n",
               headers[i].number, headers[i].counter, headers[i].latency_ms,
               headers[i].cycle_ms, headers[i].truncated);
    }
    can_pack_time(&f, CAN_BASE_DEFAULT, INT64_C(4294967295750000000));
    print_frame(&f);
    printf("# Time Seconds=4294967295 Fraction=0.75\n");
    print_objects();
    return fflush(stdout) != 0 || ferror(stdout);
}
