#include "hal/stage/zaber_port.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>

#include "hal/stage/serial.h"

enum { TRIES = 3, N_IDS = 100 };

int zaber_port_open(struct zaber_port *p, const struct zaber_port_config *cfg,
                    struct complaint *why)
{
    p->cfg = *cfg;
    return serial_open(&p->serial, cfg->path, cfg->baud, why);
}

int zaber_port_reopen(struct zaber_port *p)
{
    struct complaint why = {.text = ""};

    if (p->serial)
        return 0;
    int err = serial_open(&p->serial, p->cfg.path, p->cfg.baud, &why);
    if (!err)
        p->reopened++;
    return err;
}

static int send(struct zaber_port *p, const char *command)
{
    char text[ZABER_COMMAND_SIZE];
    bool checksum = p->cfg.checksum == ZABER_CHECKSUM_ON ||
                    (p->cfg.checksum == ZABER_CHECKSUM_AUTO && p->checksums);

    p->id = (p->id + 1) % N_IDS;
    int n = zaber_format(text, p->cfg.device, p->cfg.axis, p->id, command, checksum);
    return n < 0 ? n : serial_write(p->serial, text, (size_t)n);
}

/* Is the line the answer?  What is not is counted. */
static bool is_answer(struct zaber_port *p, struct zaber_message *m, const char *line)
{
    int err = zaber_parse(m, line);
    bool lacks = !err && !m->has_checksum && p->cfg.checksum == ZABER_CHECKSUM_ON;

    if (err == -EILSEQ || lacks) {
        p->checksum_errors++;
        return false;
    }
    if (err) {
        p->garbled++;
        return false;
    }
    if (m->device != p->cfg.device || m->kind != ZABER_REPLY)
        return false;
    if (m->id != p->id) {
        p->stale++;
        return false;
    }
    p->checksums = m->has_checksum;
    return true;
}

static int await(struct zaber_port *p, struct zaber_message *reply)
{
    int64_t deadline_ns = serial_now_ns() + (int64_t)(1e9 * p->cfg.timeout_s);
    char line[SERIAL_LINE_SIZE];

    for (;;) {
        int err = serial_read_line(p->serial, line, deadline_ns);
        if (err == -EMSGSIZE)
            p->garbled++;
        else if (err)
            return err;
        else if (is_answer(p, reply, line))
            return 0;
    }
}

static void lose(struct zaber_port *p)
{
    serial_close(p->serial);
    p->serial = NULL;
}

int zaber_port_ask(struct zaber_port *p, struct zaber_message *reply, const char *format,
                   ...)
{
    char command[ZABER_COMMAND_SIZE];
    va_list args;
    int err = -ENODEV;

    va_start(args, format);
    vsnprintf(command, sizeof command, format, args);
    va_end(args);
    for (int i = 0; i < TRIES && p->serial; i++) {
        p->retries += i > 0;
        err = send(p, command);
        if (!err)
            err = await(p, reply);
        if (!err)
            return reply->accepted ? 0 : -EPROTO;
        if (err != -ETIMEDOUT)
            lose(p);
    }
    return err;
}

void zaber_port_shout(struct zaber_port *p, const char *command)
{
    if (p->serial && send(p, command))
        lose(p);
}

void zaber_port_close(struct zaber_port *p)
{
    if (p->serial)
        lose(p);
}
