#include <errno.h>
#include <math.h>
#include <stdio.h>

#include "nodes/anlos/calibrate/calibrate.h"
#include "nodes/anlos/calibrate/state.h"

static void print_value(const char *name, double x, const char *unit, const char *how)
{
    if (isnan(x))
        printf("  %-14s not measured: anlos calibrate %s\n", name, how);
    else
        printf("  %-14s %.3f %s\n", name, x, unit);
}

static void print_channels(const char *kind, const struct calibration *c,
                           const struct calibration_channel *channels, size_t n)
{
    char state[STATE_SIZE];
    for (size_t i = 0; i < n; i++) {
        printf("  %-10s %3zu", kind, i);
        if (c->has_gains)
            printf("  %+6.2f dB", channels[i].gain_db);
        if (c->has_channels)
            printf("  %s", state_print(channels[i].faults, state));
        printf("\n");
    }
}

static void print(const struct calibration *c, const char *path)
{
    printf("%s\n  %-14s %s\n  %-14s %s\n", path, "array", c->array, "made", c->made);
    printf("  %-14s %zu speakers, %zu microphones, %g Hz, geometry %s\n", "for",
           c->n_speakers, c->n_microphones, c->sample_rate_hz, c->geometry);
    print_value("latency", c->latency_samples, "samples", "time-zero");
    print_value("sound speed", c->sound_speed_m_s, "m/s", "sound-speed");
    if (!isnan(c->temperature_c))
        printf("  %-14s %.2f C, %.0f %% humidity\n", "air", c->temperature_c,
               c->humidity_percent);
    if (c->background)
        printf("  %-14s %s\n", "background", c->background);
    else
        printf("  %-14s not recorded: anlos calibrate background\n", "background");
    if (!c->has_channels)
        printf("  %-14s not measured: anlos calibrate channels\n", "channels");
    if (!c->has_gains)
        printf("  %-14s not measured: anlos calibrate gains\n", "gains");
    if (!c->has_channels && !c->has_gains)
        return;
    print_channels("speaker", c, c->speakers, c->n_speakers);
    print_channels("microphone", c, c->microphones, c->n_microphones);
}

int calibrate_show(struct session *s, bool *good)
{
    if (!s->existed)
        return error_say(&s->why, -EINVAL, "%s: no such file", s->options->out);
    print(s->calibration, s->options->out);
    if (s->array)
        printf("good: it fits %s\n", s->options->array);
    *good = true;
    return 0;
}
