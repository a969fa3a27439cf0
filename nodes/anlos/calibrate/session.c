#include "nodes/anlos/calibrate/session.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "nodes/rt/uri.h"

static int read_file(struct session *s)
{
    const char *path = s->options->out;
    if (access(path, F_OK) < 0 && errno == ENOENT)
        return 0;
    int err = calibration_load(&s->calibration, path, &s->why);
    s->existed = !err;
    return err;
}

/* An empty "calibrated=" keeps what the array's own configuration may name out of it:
 * what is measured is the array as it is, and that file may be the one to be made. */
static int open_array(struct session *s)
{
    char *uri = uri_set_option(s->options->array, "calibrated", "");
    /* A card records the room anew; what is played from files has to stay. */
    if (uri && uri_has_scheme(uri, "alsa")) {
        char *live = uri_set_option(uri, "background", "");
        free(uri);
        uri = live;
    }
    if (!uri)
        return complain(&s->why, -ENOMEM, "out of memory");
    int err = array_open(&s->array, uri, clock_system(), &s->why);
    free(uri);
    if (!err)
        s->survey = array_survey(s->array);
    return err;
}

static int match(struct session *s)
{
    if (s->existed)
        return calibration_fits(s->calibration, s->survey, s->options->out, &s->why);
    if (calibration_create(&s->calibration, s->survey->n_speakers,
                           s->survey->n_microphones) < 0)
        return complain(&s->why, -ENOMEM, "out of memory");
    return 0;
}

int session_open(struct session *s, const struct calibrate_options *o)
{
    *s = (struct session){.options = o};
    int err = read_file(s);
    if (err || !o->array)
        return err;
    err = open_array(s);
    return err ? err : match(s);
}

int session_save(struct session *s)
{
    struct calibration *c = s->calibration;
    time_t now = (time_t)(clock_now_ns(clock_system()) / 1000000000);
    struct tm utc;
    gmtime_r(&now, &utc);
    strftime(c->made, sizeof c->made, "%Y-%m-%dT%H:%M:%SZ", &utc);
    calibration_name(c, s->survey, s->options->array);
    /* Nothing is written that no array would take. */
    struct survey set = *s->survey; /* borrows its arrays */
    int err = calibration_apply(c, &set, s->options->out, &s->why);
    return err ? err : calibration_save(c, s->options->out, &s->why);
}

void session_close(struct session *s)
{
    array_close(s->array);
    calibration_destroy(s->calibration);
}

double session_round(double x)
{
    return round(1e3 * x) / 1e3;
}

double session_speed_m_s(const struct session *s)
{
    double known = s->calibration->sound_speed_m_s;
    return isnan(known) ? s->survey->sound_speed_m_s : known;
}

int session_check(struct session *s)
{
    if (s->survey->pings_m)
        return complain(&s->why, -EINVAL,
                        "%s: its pings have places of their own; expected an array of "
                        "speakers and microphones",
                        s->options->array);
    if (s->options->position >= s->survey->n_positions)
        return complain(&s->why, -EINVAL, "--position %zu: there are 0 to %zu",
                        s->options->position, s->survey->n_positions - 1);
    return 0;
}

void session_print_retaken(size_t pings)
{
    if (pings)
        printf("  retaken       %zu pings that came invalid\n", pings);
}
