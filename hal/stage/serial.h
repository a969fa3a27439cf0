/* hal/stage/serial.h -- lines of text over a serial port: 8 data bits, no parity, one
 * stop bit, no flow control. */
#ifndef ANLOS_HAL_STAGE_SERIAL_H
#define ANLOS_HAL_STAGE_SERIAL_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/complaint.h"

enum { SERIAL_LINE_SIZE = 128 };

struct serial;

/* Takes the port for itself.  baud: 9600, 19200, 38400, 57600 or 115200.  0, -EINVAL,
 * -ENOENT, -EACCES, -EBUSY, -ENOTTY, other -errno. */
int serial_open(struct serial **out, const char *path, unsigned baud,
                struct complaint *why);

/* 0, -EIO, -ENODEV (unplugged), -ETIMEDOUT (the other end takes nothing). */
int serial_write(struct serial *s, const char *text, size_t n);

/* The next line without its end (CR, LF or both); empty ones are passed over, bytes that
 * are no printable text become '?'.  deadline_ns of CLOCK_MONOTONIC.  0, -ETIMEDOUT (what
 * came of the line is kept), -EMSGSIZE (a longer one: it is dropped), -EIO, -ENODEV. */
int serial_read_line(struct serial *s, char line[SERIAL_LINE_SIZE], int64_t deadline_ns);
void serial_close(struct serial *s);

/* CLOCK_MONOTONIC, for the deadlines. */
int64_t serial_now_ns(void);

#endif
