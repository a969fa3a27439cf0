/* SPDX-License-Identifier: MIT */
#include "hal/stage/zaber_message.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static unsigned checksum_of(const char *text, size_t n)
{
    unsigned sum = 0;

    for (size_t i = 0; i < n; i++)
        sum += (unsigned char)text[i];
    return -sum & 0xff;
}

/* Cuts ":HH" off the end.  0, -EILSEQ. */
static int take_checksum(struct zaber_message *m, char *text)
{
    char *colon = strrchr(text, ':');

    if (!colon)
        return 0;
    if (!isxdigit((unsigned char)colon[1]) || !isxdigit((unsigned char)colon[2]) ||
        colon[3])
        return -EILSEQ;
    m->has_checksum = true;
    if (strtoul(colon + 1, NULL, 16) != checksum_of(text, (size_t)(colon - text)))
        return -EILSEQ;
    *colon = '\0';
    return 0;
}

/* A number of one or two digits at *text, and the blank after it. */
static int take_number(const char **text, unsigned *out)
{
    const char *p = *text;

    *out = 0;
    while (isdigit((unsigned char)*p) && p - *text < 2)
        *out = 10 * *out + (unsigned)(*p++ - '0');
    if (p == *text || *p != ' ')
        return -EBADMSG;
    *text = p + 1;
    return 0;
}

/* One of two words at *text, and the blank after it; *second: which. */
static int take_word(const char **text, const char *first, const char *other,
                     bool *second)
{
    const char *words[] = {first, other};

    for (int i = 0; i < 2; i++) {
        size_t n = strlen(words[i]);
        if (!strncmp(*text, words[i], n) && (*text)[n] == ' ') {
            *second = i == 1;
            *text += n + 1;
            return 0;
        }
    }
    return -EBADMSG;
}

static int take_warning(struct zaber_message *m, const char **text)
{
    if (strlen(*text) < 2)
        return -EBADMSG;
    memcpy(m->warning, *text, 2);
    *text += 2;
    if (**text == ' ')
        ++*text;
    else if (**text)
        return -EBADMSG;
    return 0;
}

static int take_reply(struct zaber_message *m, const char **text)
{
    bool rejected;
    unsigned id;

    if (isdigit((unsigned char)**text)) {
        if (take_number(text, &id))
            return -EBADMSG;
        m->id = (int)id;
    }
    if (take_word(text, "OK", "RJ", &rejected) ||
        take_word(text, "IDLE", "BUSY", &m->busy))
        return -EBADMSG;
    m->accepted = !rejected;
    return take_warning(m, text);
}

static const char *last_start(const char *line)
{
    const char *start = NULL;

    for (const char *p = line; *p; p++)
        if (strchr("@!#", *p))
            start = p;
    return start;
}

int zaber_parse(struct zaber_message *out, const char *line)
{
    const char *start = last_start(line);
    char text[ZABER_DATA_SIZE];

    *out = (struct zaber_message){.id = -1, .warning = "--"};
    if (!start || strlen(start + 1) >= sizeof text)
        return -EBADMSG;
    strcpy(text, start + 1);
    int err = take_checksum(out, text);
    if (err)
        return err;
    const char *rest = text;
    if (take_number(&rest, &out->device) || take_number(&rest, &out->axis))
        return -EBADMSG;
    switch (*start) {
    case '@':
        out->kind = ZABER_REPLY;
        err = take_reply(out, &rest);
        break;
    case '!':
        out->kind = ZABER_ALERT;
        err = take_word(&rest, "IDLE", "BUSY", &out->busy);
        if (!err)
            err = take_warning(out, &rest);
        break;
    default:
        out->kind = ZABER_INFO;
    }
    snprintf(out->data, sizeof out->data, "%s", rest);
    return err;
}

int zaber_format(char out[ZABER_COMMAND_SIZE], unsigned device, unsigned axis, int id,
                 const char *command, bool checksum)
{
    int n =
        snprintf(out, ZABER_COMMAND_SIZE, "/%u %u %02d %s", device, axis, id, command);

    if (n < 0 || n + 5 > ZABER_COMMAND_SIZE)
        return -EMSGSIZE;
    if (checksum)
        n += snprintf(out + n, 4, ":%02X", checksum_of(out + 1, (size_t)n - 1));
    out[n++] = '\n';
    out[n] = '\0';
    return n;
}

enum zaber_severity zaber_warning(const char *flag, const char **words)
{
    static const struct {
        const char *flag;
        enum zaber_severity severity;
        const char *words;
    } flags[] = {
        {"--", ZABER_FINE, "nothing"},
        {"FF", ZABER_FAULT, "critical system error"},
        {"FN", ZABER_FAULT, "the peripheral is not supported"},
        {"FZ", ZABER_FAULT, "the peripheral is inactive"},
        {"FH", ZABER_FAULT, "emergency stop: the driver is disabled"},
        {"FV", ZABER_FAULT, "voltage too high or too low: the driver is disabled"},
        {"FO", ZABER_FAULT, "the driver is disabled since the start or by command"},
        {"FC", ZABER_FAULT, "too much inrush current: the driver is disabled"},
        {"FM", ZABER_FAULT, "the motor is too hot: the driver is disabled"},
        {"FD", ZABER_FAULT, "the driver is disabled"},
        {"FQ", ZABER_FAULT, "the encoder fails"},
        {"FI", ZABER_FAULT, "the encoder's index is wrong"},
        {"FA", ZABER_FAULT, "the analog encoder is out of step"},
        {"FR", ZABER_FAULT, "overdriven for too long: the driver is disabled"},
        {"FS", ZABER_FAULT, "stalled and stopped"},
        {"FB", ZABER_FAULT, "a stream left its bounds"},
        {"FP", ZABER_FAULT, "left its interpolated path"},
        {"FE", ZABER_FAULT, "ran into a limit"},
        {"FT", ZABER_FAULT, "twisted too far"},
        {"WL", ZABER_FAULT, "a limit switch was hit unexpectedly"},
        {"WM", ZABER_FAULT, "was displaced while it stood still"},
        {"WR", ZABER_UNHOMED, "has no reference position"},
        {"WH", ZABER_UNHOMED, "is not homed"},
        {"WS", ZABER_NOTE, "stalled, and recovered"},
        {"WV", ZABER_NOTE, "its voltage is out of range"},
        {"WT", ZABER_NOTE, "its controller is hot"},
        {"WP", ZABER_NOTE, "its calibration is of an unknown type"},
        {"NC", ZABER_NOTE, "is moved by hand"},
        {"NI", ZABER_NOTE, "its movement was interrupted"},
        {"ND", ZABER_NOTE, "a stream was not continuous"},
        {"NR", ZABER_NOTE, "a value was rounded"},
        {"NT", ZABER_NOTE, "a value was cut off"},
        {"NU", ZABER_NOTE, "waits to update a setting"},
        {"NJ", ZABER_NOTE, "calibrates its joystick"},
    };

    for (size_t i = 0; i < sizeof flags / sizeof *flags; i++)
        if (!strcmp(flag, flags[i].flag)) {
            *words = flags[i].words;
            return flags[i].severity;
        }
    *words = "a warning that is not known here";
    return flag[0] == 'F' ? ZABER_FAULT : ZABER_NOTE;
}

const char *zaber_rejection(const char *data)
{
    static const struct {
        const char *data, *words;
    } reasons[] = {
        {"BADAXIS", "it has no such axis"},
        {"BADCOMMAND", "it does not know the command"},
        {"BADDATA", "the value is out of its range"},
        {"BADMESSAGEID", "it does not take the message id"},
        {"AGAIN", "it cannot do that now"},
        {"STATUSBUSY", "it cannot do that while it moves"},
        {"PARKED", "it is parked"},
        {"DRIVERDISABLED", "its driver is disabled"},
        {"DEVICEONLY", "it takes that for the whole device only"},
        {"NOACCESS", "it does not allow that"},
        {"FULL", "its queue is full"},
    };

    for (size_t i = 0; i < sizeof reasons / sizeof *reasons; i++)
        if (!strcmp(data, reasons[i].data))
            return reasons[i].words;
    return data;
}
