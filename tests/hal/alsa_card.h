/* SPDX-License-Identifier: MIT */
/* tests/hal/alsa_card.h -- a sound card without a kernel's sound: alsa-lib's file plugin
 * writes what is played into a file and reads what is recorded from a pipe, which paces
 * it. */
#ifndef ANLOS_TESTS_HAL_ALSA_CARD_H
#define ANLOS_TESTS_HAL_ALSA_CARD_H

#include "scratch.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdbool.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/array.h"
#include "rig.h"

enum { SLOT = 1500, CHIRP = 480, BUFFER = 960, OUTPUTS = 4, INPUTS = 3 };
/* Fits into a pipe in every format; enough for two slots, their tail, and what is written
 * ahead. */
enum { FRAMES = 5300 };

/* The cards live in a file of their own; alsa-lib reads the path once. */
static char folder[64];

static inline int card_set_up(void **state)
{
    char path[128], text[1024];
    (void)state;
    strcpy(folder, "/tmp/anlos-alsa-XXXXXX");
    if (!mkdtemp(folder))
        return -1;
    snprintf(path, sizeof path, "%s/asound.conf", folder);
    snprintf(text, sizeof text,
             "pcm.null { type null }\n"
             "pcm.out { type file slave.pcm null file \"%s/out\" format raw }\n"
             "pcm.in { type file slave.pcm null file /dev/null infile \"%s/in\" "
             "format raw }\n"
             "pcm.card { type asym playback.pcm out capture.pcm in }\n",
             folder, folder);
    FILE *f = fopen(path, "w");
    if (!f || fputs(text, f) < 0 || fclose(f))
        return -1;
    snprintf(text, sizeof text, "%s/in", folder);
    return setenv("ALSA_CONFIG_PATH", path, 1) || mkfifo(text, 0600);
}

static inline int card_tear_down(void **state)
{
    char command[128];
    (void)state;
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

struct card {
    struct array *array;
    int pipe;
    const char *format;
    size_t bytes; /* of a sample */
};

/* survey: the rig's, up to its device. */
static inline void card_open_survey(struct card *c, struct scratch *s, const char *survey,
                                    const char *format, const char *device,
                                    const char *options)
{
    char text[2000], uri[1200];
    struct error why = {.text = ""};
    c->format = format;
    c->bytes = !strcmp(format, "S16") ? 2 : !strcmp(format, "S24_3") ? 3 : 4;
    snprintf(text, sizeof text, "%s/out", folder);
    unlink(text);
    snprintf(text, sizeof text, "%s/in", folder);
    c->pipe = open(text, O_RDWR); /* nobody waits for the other end */
    assert_true(c->pipe >= 0);
    snprintf(text, sizeof text,
             "%sdevice: {format: %s, access: rw, buffer_ms: 20, "
             "level_db: 0, outputs: [1, 3], inputs: [2, 0, 1]%s}\n",
             survey, format, device);
    snprintf(uri, sizeof uri, "alsa:card?rig=%s%s", scratch_write(s, "rig.yaml", text),
             options);
    if (array_open(&c->array, uri, clock_system(), &why))
        fail_msg("%s", why.text);
}

static inline void card_open(struct card *c, struct scratch *s, const char *format,
                             const char *device, const char *options)
{
    card_open_survey(c, s, RIG_SURVEY "gate_m: [0.3, 4]\n", format, device, options);
}

static inline void card_close(struct card *c)
{
    close(c->pipe);
    array_close(c->array);
}

/* What microphone channel c hears in frame n, in steps of 2^-15. */
static inline int heard(size_t n, size_t c)
{
    return (int)((7 * n + 5000 * c) % 40000) - 20000;
}

static inline void put(const struct card *c, int value, unsigned char *out)
{
    int32_t word = (int32_t)((uint32_t)value << 16);
    float single = (float)value / 32768;
    if (!strcmp(c->format, "float")) {
        memcpy(out, &single, 4);
        return;
    }
    if (!strcmp(c->format, "S24")) /* the low three of four bytes */
        word >>= 8;
    size_t skip = !strcmp(c->format, "S24") ? 0 : 4 - c->bytes;
    memcpy(out, (const unsigned char *)&word + skip, c->bytes);
}

static inline void feed(const struct card *c, int (*sound)(size_t, size_t))
{
    static unsigned char bytes[FRAMES * INPUTS * 4];
    size_t size = FRAMES * INPUTS * c->bytes;
    for (size_t n = 0; n < FRAMES; n++)
        for (size_t k = 0; k < INPUTS; k++)
            put(c, sound(n, k), bytes + (n * INPUTS + k) * c->bytes);
    assert_int_equal(write(c->pipe, bytes, size), (ssize_t)size);
}

static inline void next(struct card *c, struct array_ping *ping)
{
    struct error why = {.text = ""};
    if (array_next(c->array, ping, &why))
        fail_msg("%s", why.text);
}

static inline double get(const struct card *c, const unsigned char *in)
{
    int32_t word = 0;
    float single;
    if (!strcmp(c->format, "float")) {
        memcpy(&single, in, 4);
        return single;
    }
    size_t skip = !strcmp(c->format, "S24") ? 0 : 4 - c->bytes;
    memcpy((unsigned char *)&word + skip, in, c->bytes);
    if (!strcmp(c->format, "S24"))
        word = (int32_t)((uint32_t)word << 8);
    return word / 2147483648.0;
}

/* Frame `frame` of what was played, channel k. */
static inline double played(const struct card *c, const unsigned char *out, size_t frame,
                            size_t k)
{
    return get(c, out + (frame * OUTPUTS + k) * c->bytes);
}

static inline double chirp(size_t i)
{
    double t = (double)i / 48000;
    return (float)cos(2 * M_PI * (2000 * t + 0.5 * 18000 / 0.01 * t * t));
}

/* Reads what was played; its first frame that is not silent. */
static inline size_t read_played(const struct card *c, unsigned char *out, size_t size)
{
    char path[128];
    snprintf(path, sizeof path, "%s/out", folder);
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    size_t n = fread(out, 1, size, f) / (OUTPUTS * c->bytes);
    fclose(f);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < OUTPUTS; k++)
            if (played(c, out, i, k) != 0)
                return i;
    fail_msg("nothing was played in %zu frames", n);
    return 0;
}

#endif
