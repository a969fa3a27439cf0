/* SPDX-License-Identifier: MIT */
#include "hal/survey/response_file.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "dsp/list.h"
#include "hal/text_file.h"

enum { MAX_POINTS = SURVEY_MAX_ELEMENTS };

static int append(struct survey_response *r, size_t *room, double hz, double db)
{
    size_t same = *room; /* they grow alike */

    if (list_grow(&r->frequency_hz, r->n_points, &same, sizeof *r->frequency_hz) ||
        list_grow(&r->gain_db, r->n_points, room, sizeof *r->gain_db))
        return -ENOMEM;
    r->frequency_hz[r->n_points] = hz;
    r->gain_db[r->n_points++] = db;
    return 0;
}

/* Two finite numbers and nothing else but white space. */
static bool parse_point(const char *text, double *hz, double *db)
{
    char *end;
    *hz = strtod(text, &end);
    if (end == text)
        return false;
    text = end;
    *db = strtod(text, &end);
    if (end == text || !isfinite(*hz) || !isfinite(*db))
        return false;
    while (isspace((unsigned char)*end))
        end++;
    return !*end;
}

static bool is_blank(const char *text)
{
    return !text[strspn(text, " \t\r\n")];
}

static int read_points(struct survey_response *r, FILE *f, const char *path,
                       struct error *why)
{
    char text[256];
    size_t line = 0, room = 0;
    double hz, db;
    while (fgets(text, sizeof text, f)) {
        line++;
        if (!parse_point(text, &hz, &db)) {
            if (!r->n_points || is_blank(text))
                continue;
            return error_say(why, -EINVAL, "%s:%zu: expected a frequency in Hz and dB",
                             path, line);
        }
        if (hz < 0 || (r->n_points && hz <= r->frequency_hz[r->n_points - 1]))
            return error_say(why, -EINVAL, "%s:%zu: frequency %g Hz does not rise", path,
                             line, hz);
        if (r->n_points == MAX_POINTS)
            return error_say(why, -EINVAL, "%s:%zu: more than %d points", path, line,
                             MAX_POINTS);
        if (append(r, &room, hz, db) < 0)
            return error_say(why, -ENOMEM, "%s: out of memory", path);
    }
    if (ferror(f))
        return error_say(why, -EIO, "%s: cannot be read", path);
    if (!r->n_points)
        return error_say(why, -EINVAL, "%s: expected lines of frequency in Hz and dB",
                         path);
    return 0;
}

static char *path_of(const char *folder, const char *serial)
{
    char *path = NULL;
    return asprintf(&path, "%s/%s.txt", folder, serial) < 0 ? NULL : path;
}

int response_load(struct survey_response *out, const char *folder, const char *serial,
                  struct error *why)
{
    *out = (struct survey_response){.n_points = 0};
    if (!*serial || strlen(serial) >= sizeof out->serial || strchr(serial, '/'))
        return error_say(why, -EINVAL, "\"%s\" is no serial number of 1..%zu characters",
                         serial, sizeof out->serial - 1);
    char *path = path_of(folder, serial);
    if (!path)
        return error_say(why, -ENOMEM, "out of memory");
    FILE *f;
    int err = text_file_open(&f, path, why);
    if (err)
        goto path;
    strcpy(out->serial, serial);
    err = read_points(out, f, path, why);
    if (err)
        response_clear(out);
    fclose(f);
path:
    free(path);
    return err;
}

static bool same_curve(const struct survey_response *a, const struct survey_response *b)
{
    size_t size = a->n_points * sizeof(double);
    return a->n_points == b->n_points &&
           !memcmp(a->frequency_hz, b->frequency_hz, size) &&
           !memcmp(a->gain_db, b->gain_db, size);
}

static int write_points(const struct survey_response *r, const char *path)
{
    FILE *f = fopen(path, "wxe");
    if (!f)
        return -errno;
    int ok = fprintf(f, "\"SERNO: %s\"\n", r->serial) > 0;
    for (size_t i = 0; ok && i < r->n_points; i++)
        ok = fprintf(f, "%.17g\t%.17g\n", r->frequency_hz[i], r->gain_db[i]) > 0;
    int err = ok ? 0 : -EIO;
    if (fclose(f) && !err)
        err = -errno;
    if (err)
        unlink(path);
    return err;
}

int response_save(const struct survey_response *r, const char *folder, struct error *why)
{
    char *path = path_of(folder, r->serial);
    if (!path)
        return error_say(why, -ENOMEM, "out of memory");
    int err = write_points(r, path);
    if (err == -EEXIST) {
        struct survey_response there;
        err = response_load(&there, folder, r->serial, why);
        if (!err && !same_curve(r, &there))
            err = error_say(why, -EEXIST,
                            "%s: holds another curve; choose another folder", path);
        response_clear(&there);
    } else if (err) {
        error_say(why, err, "%s: %s", path, strerror(-err));
    }
    free(path);
    return err;
}

double response_gain(const struct survey_response *r, double frequency_hz)
{
    size_t low = 0, high = r->n_points - 1;
    if (frequency_hz <= r->frequency_hz[low])
        return pow(10, r->gain_db[low] / 20);
    if (frequency_hz >= r->frequency_hz[high])
        return pow(10, r->gain_db[high] / 20);
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        if (r->frequency_hz[middle] <= frequency_hz)
            low = middle;
        else
            high = middle;
    }
    double t = (frequency_hz - r->frequency_hz[low]) /
               (r->frequency_hz[high] - r->frequency_hz[low]);
    return pow(10, (r->gain_db[low] + t * (r->gain_db[high] - r->gain_db[low])) / 20);
}

void response_clear(struct survey_response *r)
{
    free(r->frequency_hz);
    free(r->gain_db);
    *r = (struct survey_response){.n_points = 0};
}
