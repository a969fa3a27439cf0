#include "dsp/microphone.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#define MAX_GAIN_DB 200.0 /* beyond it the number means something else */

static bool text_is_blank(const char *s)
{
    while (isspace((unsigned char)*s))
        s++;
    return *s == '\0';
}

static bool text_parse(const char *s, double *frequency_hz, double *gain_db)
{
    char *end;

    *frequency_hz = strtod(s, &end);
    if (end == s || !isspace((unsigned char)*end))
        return false;
    s = end;
    *gain_db = strtod(s, &end);
    if (end == s || (*end != '\0' && !isspace((unsigned char)*end)))
        return false;
    return isfinite(*frequency_hz) && *frequency_hz > 0.0 &&
           fabs(*gain_db) <= MAX_GAIN_DB;
}

static int points_append(struct microphone *m, size_t *room, double frequency_hz,
                         double gain_db)
{
    if (m->n_points == *room) {
        size_t n = *room ? 2 * *room : 256;
        double *p = realloc(m->frequency_hz, n * sizeof(*p));
        if (!p)
            return -ENOMEM;
        m->frequency_hz = p;
        p = realloc(m->gain_db, n * sizeof(*p));
        if (!p)
            return -ENOMEM;
        m->gain_db = p;
        *room = n;
    }
    m->frequency_hz[m->n_points] = frequency_hz;
    m->gain_db[m->n_points++] = gain_db;
    return 0;
}

/* One line: a head line, a point, or an error. */
static int line_read(struct microphone *m, size_t *room, const char *text)
{
    double frequency_hz, gain_db;

    if (text_is_blank(text))
        return 0;
    if (!text_parse(text, &frequency_hz, &gain_db))
        return m->n_points ? -EINVAL : 0;
    if (m->n_points && frequency_hz <= m->frequency_hz[m->n_points - 1])
        return -EINVAL;
    return points_append(m, room, frequency_hz, gain_db);
}

int microphone_load(struct microphone *out, const char *path, size_t *line)
{
    struct microphone m = {0};
    size_t room = 0, size = 0, number = 0;
    char *text = NULL;
    FILE *f;
    int err = 0;

    *line = 0;
    f = fopen(path, "re");
    if (!f)
        return -errno;
    errno = 0;
    while (!err && getline(&text, &size, f) >= 0) {
        number++;
        err = line_read(&m, &room, text);
        if (err == -EINVAL)
            *line = number;
    }
    if (!err && !feof(f)) /* a folder, a disk error, no memory */
        err = errno ? -errno : -EIO;
    if (!err && !m.n_points)
        err = -EINVAL;
    free(text);
    fclose(f);
    if (err)
        microphone_clear(&m);
    else
        *out = m;
    return err;
}

double microphone_gain(const struct microphone *m, double frequency_hz)
{
    const double *f = m->frequency_hz, *g = m->gain_db;
    size_t low = 0, high = m->n_points;
    double db;

    if (!high)
        return 1.0;
    high--;
    if (frequency_hz <= f[0]) {
        db = g[0];
    } else if (frequency_hz >= f[high]) {
        db = g[high];
    } else {
        while (high - low > 1) {
            size_t middle = low + (high - low) / 2;
            if (f[middle] <= frequency_hz)
                low = middle;
            else
                high = middle;
        }
        db = g[low] + (g[high] - g[low]) * (frequency_hz - f[low]) / (f[high] - f[low]);
    }
    return pow(10.0, db / 20.0);
}

void microphone_clear(struct microphone *m)
{
    free(m->frequency_hz);
    free(m->gain_db);
    *m = (struct microphone){0};
}
