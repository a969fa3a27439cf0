/* SPDX-License-Identifier: MIT */
/* Reads "identifier data" in hexadecimal, one frame a line, and prints what the sensor
 * makes of it: the verdict of the end-to-end protection, and each signal in its unit.
 * For check_dbc.py. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "msgs/can/e2e.h"
#include "msgs/can/frames.h"

static struct can_checks checks = {.base = CAN_BASE_DEFAULT};

static void print_input(const struct can_frame_data *f)
{
    const double degrees = 180 / acos(-1);
    struct can_ego_motion e;
    struct can_ambient a;
    struct can_wall_in w;
    struct can_wall_ends_in x;
    struct can_save_request r;
    if (f->id == CAN_BASE_DEFAULT + CAN_ID_EGO_MOTION && !can_unpack_ego_motion(f, &e))
        printf("Speed=%.9g YawRate=%.9g Standstill=%u Validity=%u\n", e.speed_m_s,
               e.yaw_rate_rad_s * degrees, e.standstill, e.validity);
    else if (f->id == CAN_BASE_DEFAULT + CAN_ID_AMBIENT && !can_unpack_ambient(f, &a))
        printf("Temperature=%.9g Humidity=%.9g\n", a.temperature_c, a.humidity * 100);
    else if (f->id == CAN_BASE_DEFAULT + CAN_ID_WALL_IN && !can_unpack_wall_in(f, &w))
        printf("Azimuth=%.9g Distance=%.9g SigmaAzimuth=%.9g SigmaDistance=%.9g "
               "WallId=%u Validity=%u\n",
               w.azimuth_rad * degrees, w.distance_m, w.sigma_azimuth_rad * degrees,
               w.sigma_distance_m, w.id, w.validity);
    else if (f->id == CAN_BASE_DEFAULT + CAN_ID_WALL_ENDS_IN &&
             !can_unpack_wall_ends_in(f, &x))
        printf("From=%.9g To=%.9g WallId=%u Validity=%u\n", x.from_m, x.to_m, x.id,
               x.validity);
    else if (f->id == CAN_BASE_DEFAULT + CAN_ID_SAVE_REQUEST &&
             !can_unpack_save_request(f, &r))
        printf("Number=%u Reason=%u Request=%u\n", r.number, r.reason, r.request);
    else
        printf("nothing\n");
}

int main(void)
{
    char line[300], data[200];
    while (fgets(line, sizeof line, stdin)) {
        struct can_frame_data f = {.size = 0};
        unsigned id, byte;
        if (sscanf(line, "%x %199s", &id, data) != 2)
            return 1;
        f.id = id;
        for (const char *at = data; sscanf(at, "%2x", &byte) == 1; at += 2)
            f.data[f.size++] = (uint8_t)byte;
        printf("%s|", e2e_verdict_text(can_check(&checks, &f)));
        print_input(&f);
    }
    return fflush(stdout) != 0 || ferror(stdout);
}
