/* SPDX-License-Identifier: MIT */
#include "hal/array.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hal/device.h"

struct array {
    const struct array_ops *ops;
    void *state;
    size_t n_left; /* pings of the shot that were not read yet; endless: 1 */
    bool endless, continuous;
    uint32_t *speakers; /* [survey's n_speakers], of the shot */
};

static const struct array_ops *const backends[] = {&array_sim_ops, &array_wav_ops,
                                                   &array_alsa_ops};

static const struct array_ops *find_backend(const char *uri, const char **arg)
{
    for (size_t i = 0; i < sizeof backends / sizeof *backends; i++) {
        *arg = device_arg(uri, backends[i]->scheme);
        if (*arg)
            return backends[i];
    }
    return NULL;
}

int array_open(struct array **out, const char *uri, const struct clock_source *clock,
               struct error *why)
{
    const char *arg;
    const struct array_ops *ops = find_backend(uri, &arg);
    *out = NULL;
    if (!ops)
        return error_say(
            why, -ENODEV,
            "%s: no such kind of array; expected sim:SCENE.yaml, wav:FOLDER or "
            "alsa:DEVICE?rig=FILE.yaml",
            uri);
    struct array *a = calloc(1, sizeof *a);
    if (!a)
        return error_say(why, -ENOMEM, "%s: out of memory", uri);
    a->ops = ops;
    struct error inner = {.text = ""};
    int err = ops->open(&a->state, arg, clock, &inner);
    if (err) {
        free(a);
        return error_say(why, err, "%s: %s", uri, inner.text);
    }
    a->speakers = calloc(array_survey(a)->n_speakers, sizeof *a->speakers);
    if (!a->speakers) {
        array_close(a);
        return error_say(why, -ENOMEM, "%s: out of memory", uri);
    }
    *out = a;
    return 0;
}

const struct survey *array_survey(const struct array *a)
{
    return a->ops->survey(a->state);
}

static bool is_continuous(const struct survey *s, const struct array_shot *shot)
{
    return s->continuous && !shot->endless && shot->n_speakers == s->n_speakers &&
           shot->n_rounds <= s->n_positions - shot->position;
}

int array_fire(struct array *a, const struct array_shot *shot)
{
    const struct survey *s = array_survey(a);
    if (a->n_left || shot->position >= s->n_positions || !shot->n_speakers ||
        shot->n_speakers > s->n_speakers || (shot->endless && s->pings_m) ||
        (shot->endless && !survey_round_fits(s, shot->n_speakers)) ||
        (shot->n_rounds && !is_continuous(s, shot)))
        return -EINVAL;
    for (size_t i = 0; i < shot->n_speakers; i++)
        if (shot->speakers[i] >= s->n_speakers)
            return -EINVAL;
    memcpy(a->speakers, shot->speakers, shot->n_speakers * sizeof *a->speakers);
    struct array_shot copy = *shot;
    copy.speakers = a->speakers;
    int err = a->ops->fire(a->state, &copy);
    if (!err) {
        a->endless = shot->endless;
        a->continuous = shot->n_rounds > 0;
        a->n_left = shot->endless ? 1 : shot->n_speakers;
        if (a->continuous)
            a->n_left *= shot->n_rounds;
    }
    return err;
}

/* An error ends the shot, unless it comes of waiting: the array is ready for the next. */
int array_next(struct array *a, struct array_ping *out, struct error *why)
{
    if (!a->n_left)
        return -ENODATA;
    int err = a->ops->next(a->state, out, why);
    if (!err) {
        a->n_left -= !a->endless;
        out->down = a->ops->is_down ? a->ops->is_down(a->state, out->shot_index)
                                    : survey_is_down(array_survey(a), out->shot_index);
    } else if (err != -EINTR && err != -EAGAIN) {
        a->n_left = 0;
    }
    return err;
}

void array_halt(struct array *a)
{
    if (!a->n_left || !(a->endless || a->continuous))
        return;
    if (a->ops->halt)
        a->ops->halt(a->state);
    a->n_left = 0;
}

size_t array_counts(struct array *a, struct device_count out[DEVICE_MAX_COUNTS])
{
    return a->ops->counts ? a->ops->counts(a->state, out) : 0;
}

int array_condition(struct array *a, struct error *why)
{
    return a->ops->condition ? a->ops->condition(a->state, why) : 0;
}

bool array_notice(struct array *a, struct error *out)
{
    return a->ops->notice && a->ops->notice(a->state, out);
}

void array_close(struct array *a)
{
    if (!a)
        return;
    a->ops->close(a->state);
    free(a->speakers);
    free(a);
}
