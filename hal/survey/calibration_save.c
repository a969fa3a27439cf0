#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hal/survey/calibration_file.h"
#include "hal/decimal.h"

/* In double quotes, as YAML and JSON have them. */
static void print_text(FILE *f, const char *key, const char *text)
{
    fprintf(f, "%s: \"", key);
    for (; *text; text++) {
        unsigned char c = (unsigned char)*text;
        if (c == '"' || c == '\\')
            fputc('\\', f);
        if (c < ' ')
            fprintf(f, "\\x%02x", c);
        else
            fputc(c, f);
    }
    fputs("\"\n", f);
}

static void print_number(FILE *f, const char *key, double x)
{
    char text[DECIMAL_SIZE];
    if (!isnan(x))
        fprintf(f, "%s: %s\n", key, decimal_print(x, text));
}

static void print_faults(FILE *f, const char *kind,
                         const struct calibration_channel *channels, size_t n)
{
    static const char *const names[] = {"inverted", "dead", "clipped", "noisy"};
    for (unsigned k = 0; k < 4; k++) {
        const char *joint = "";
        fprintf(f, "  %s_%s: [", names[k], kind);
        for (size_t i = 0; i < n; i++) {
            if (!(channels[i].faults & 1u << k))
                continue;
            fprintf(f, "%s%zu", joint, i);
            joint = ", ";
        }
        fputs("]\n", f);
    }
}

static void print_gains(FILE *f, const char *kind,
                        const struct calibration_channel *channels, size_t n)
{
    char text[DECIMAL_SIZE];
    fprintf(f, "  %s_db: [", kind);
    for (size_t i = 0; i < n; i++)
        fprintf(f, "%s%s", i ? ", " : "", decimal_print(channels[i].gain_db, text));
    fputs("]\n", f);
}

static void print_calibration(FILE *f, const struct calibration *c)
{
    fputs("# What anlos calibrate has measured; each of its commands renews a part.\n"
          "# Channels are counted from 0, gains are relative to their mean.\n",
          f);
    print_text(f, "array", c->array);
    print_text(f, "made", c->made);
    print_text(f, "geometry", c->geometry);
    print_number(f, "sample_rate_hz", c->sample_rate_hz);
    fprintf(f, "speakers: %zu\nmicrophones: %zu\n", c->n_speakers, c->n_microphones);
    print_number(f, "latency_samples", c->latency_samples);
    print_number(f, "temperature_c", c->temperature_c);
    print_number(f, "humidity_percent", c->humidity_percent);
    print_number(f, "sound_speed_m_s", c->sound_speed_m_s);
    if (c->has_channels) {
        fputs("channels:\n", f);
        print_faults(f, "speakers", c->speakers, c->n_speakers);
        print_faults(f, "microphones", c->microphones, c->n_microphones);
    }
    if (c->has_gains) {
        fputs("gains:\n", f);
        print_gains(f, "speakers", c->speakers, c->n_speakers);
        print_gains(f, "microphones", c->microphones, c->n_microphones);
    }
    if (c->background)
        print_text(f, "background", c->background);
}

/* Synced before it takes the old one's place: a power cut leaves one of them whole. */
static int write_whole(const struct calibration *c, const char *path, const char *partial)
{
    int err = 0;
    unlink(partial); /* and not through a link that somebody has put there */
    FILE *f = fopen(partial, "wxe");
    if (!f)
        return -errno;
    print_calibration(f, c);
    if (fflush(f) || ferror(f) || fsync(fileno(f)) < 0)
        err = errno ? -errno : -EIO;
    if (fclose(f) && !err)
        err = -errno;
    if (!err && rename(partial, path) < 0)
        err = -errno;
    if (err)
        unlink(partial);
    return err;
}

int calibration_save(const struct calibration *c, const char *path, struct complaint *why)
{
    char *partial;
    if (asprintf(&partial, "%s.part", path) < 0)
        return complain(why, -ENOMEM, "%s: out of memory", path);
    int err = write_whole(c, path, partial);
    free(partial);
    if (err)
        complain(why, err, "%s cannot be written: %s", path, strerror(-err));
    return err;
}
