/* SPDX-License-Identifier: MIT */
#include "tests/hw/card.h"

#include <stdio.h>
#include <stdlib.h>

static void write_driver(const char *attribute)
{
    char path[128];
    snprintf(path, sizeof path, "/sys/bus/platform/drivers/snd_aloop/%s", attribute);
    FILE *f = fopen(path, "w");
    if (!f || fputs("snd_aloop.0", f) < 0 || fclose(f)) {
        perror(path);
        abort();
    }
}

static void *unbind(void *arg)
{
    write_driver("unbind");
    return arg;
}

void card_unplug(pthread_t *hand)
{
    if (pthread_create(hand, NULL, unbind, NULL))
        abort();
}

void card_plug(void)
{
    write_driver("bind");
}
