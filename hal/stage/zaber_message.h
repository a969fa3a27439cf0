/* SPDX-License-Identifier: MIT */
/* hal/stage/zaber_message.h -- the Zaber ASCII protocol, version 2, as text: no line, no
 * clock.
 *
 *   command   /1 1 07 move abs 1000:E9       device, axis, message id, checksum
 *   reply     @01 1 07 OK BUSY WR 0:91       OK or RJ, IDLE or BUSY, warning flag, data
 *   alert     !01 1 IDLE --
 *
 * The checksum is the two's complement of the sum of what stands between the first
 * character and the colon, in two hexadecimal digits. */
#ifndef ANLOS_HAL_STAGE_ZABER_MESSAGE_H
#define ANLOS_HAL_STAGE_ZABER_MESSAGE_H

#include <stdbool.h>
#include <stddef.h>

enum { ZABER_DATA_SIZE = 64, ZABER_COMMAND_SIZE = 80 };

enum zaber_kind { ZABER_REPLY, ZABER_ALERT, ZABER_INFO };

struct zaber_message {
    enum zaber_kind kind;
    unsigned device, axis;
    int id; /* -1: none */
    bool accepted, busy;
    char warning[3]; /* "--": none */
    char data[ZABER_DATA_SIZE];
    bool has_checksum;
};

/* A line without its end; what stands before the message's first character is noise, and
 * ignored.  0, -EBADMSG (not of the protocol), -EILSEQ (wrong checksum). */
int zaber_parse(struct zaber_message *out, const char *line);

/* "/1 1 07 COMMAND\n", with a checksum or without.  Returns its length, or -EMSGSIZE. */
int zaber_format(char out[ZABER_COMMAND_SIZE], unsigned device, unsigned axis, int id,
                 const char *command, bool checksum);

enum zaber_severity {
    ZABER_FINE,
    ZABER_NOTE,    /* it works, a person should know */
    ZABER_UNHOMED, /* it has no reference position */
    ZABER_FAULT,   /* it stopped, or cannot move */
};

/* What a warning flag means: *words in plain ones. */
enum zaber_severity zaber_warning(const char *flag, const char **words);

/* Why a command was rejected (the data of RJ), in plain words. */
const char *zaber_rejection(const char *data);

#endif
