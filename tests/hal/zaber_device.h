/* SPDX-License-Identifier: MIT */
/* tests/hal/zaber_device.h -- a Zaber stage at the other end of a pseudo terminal, in a
 * thread of its own: it homes, moves, and misbehaves when told to. */
#ifndef ANLOS_TESTS_HAL_ZABER_DEVICE_H
#define ANLOS_TESTS_HAL_ZABER_DEVICE_H

#include <stdatomic.h>
#include <stdbool.h>

enum zaber_trick {
    TRICK_NONE,
    TRICK_GARBAGE,  /* noise before the answer, and a line of it */
    TRICK_SILENCE,  /* no answer */
    TRICK_HALF,     /* the first half of one */
    TRICK_CHECKSUM, /* a wrong one */
    TRICK_LATE,     /* only with the next command */
    TRICK_ENDLESS,  /* a line that does not end */
    TRICK_STRANGER, /* an answer of another device, and an alert, before its own */
};

struct zaber_device {
    char path[64];
    /* To be set by the test, before it opens the port or at any time. */
    _Atomic int trick, times; /* for so many answers from now on */
    _Atomic bool checksums;
    _Atomic int speed;       /* microsteps/s */
    _Atomic long stall_at;   /* microsteps; 0: nowhere */
    _Atomic long reboot_at;  /* loses its place there */
    _Atomic long blocked_at; /* stops there and says nothing of it */
    _Atomic bool homeless;   /* homing leaves it without a reference */
    _Atomic bool hot;        /* and says so */
    _Atomic long shift;      /* has been pushed so far */
    /* What it saw. */
    _Atomic long position, target;
    _Atomic int homings, stops, commands, checked; /* checked: with a right checksum */
    _Atomic int wrong;                             /* commands that it could not read */
    struct zaber_insides *insides;
};

struct zaber_device *zaber_device_start(bool referenced);
void zaber_device_shift(struct zaber_device *d, long by); /* by hand, at rest */
void zaber_device_unplug(struct zaber_device *d);         /* and stop */

#endif
