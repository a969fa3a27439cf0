/* hal/stage/zaber_drive.h -- a Zaber axis that homes, moves and is watched: metres, and
 * faults in plain words.  Driven from one thread, a stage worker's. */
#ifndef ANLOS_HAL_STAGE_ZABER_DRIVE_H
#define ANLOS_HAL_STAGE_ZABER_DRIVE_H

#include "hal/stage/worker.h"
#include "hal/stage/zaber_port.h"

struct zaber_drive {
    struct zaber_port port;
    struct stage_worker
        *worker;       /* whom to tell the place, and to ask for newer commands */
    double m_per_step; /* of a microstep */
    bool homed;
    double rest_m;   /* where it was left */
    char warning[3]; /* the flag that was noted last */
    _Atomic uint64_t homings, limit_hits, warnings;
};

/* What the device says of itself; it may know its place from before. */
struct zaber_facts {
    double resolution; /* microsteps of a full step */
    double min, max;   /* microsteps */
    double position;   /* microsteps */
    bool homed;
    bool fault; /* it has stopped by itself: a person has to look */
};

/* facts->resolution: 0 on entry asks the device.  0, or -errno with why in text. */
int zaber_drive_ask(struct zaber_drive *z, struct zaber_facts *facts,
                    char text[STAGE_TEXT_SIZE]);

/* The operations of a stage worker, with the drive as their device. */
int zaber_drive_home(void *drive, char text[STAGE_TEXT_SIZE]);
int zaber_drive_move(void *drive, double target_m, char text[STAGE_TEXT_SIZE]);
int zaber_drive_rest(void *drive, int wake_fd, char text[STAGE_TEXT_SIZE]);

#endif
