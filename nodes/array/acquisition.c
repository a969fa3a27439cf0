/* SPDX-License-Identifier: MIT */
#include "nodes/array/acquisition.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "msgs/tensor.h"

#define MAX_SHOTS 8

struct shot {
    Anlos__FireCommand command; /* without its speakers */
    uint32_t *speakers;         /* [n_speakers of the survey] */
    size_t n_speakers;
    bool displaced;
};

struct acquisition {
    struct array *array;
    Anlos__Survey *survey;
    struct shot shots[MAX_SHOTS]; /* a ring; the first is the one under way */
    size_t first, n_shots;
    bool fired; /* the first one has been given to the array */
    bool displaced;
    bool ended; /* without being asked to */
    bool commanded;
    uint32_t newest_id; /* of the commands taken, and who sent it */
    int64_t newest_epoch_ns;
    struct tensor_view samples;
};

static int survey_message(Anlos__Survey **out, const struct survey *survey)
{
    uint8_t *bytes = NULL;
    size_t size;
    int err = survey_pack(survey, &bytes, &size);

    if (err)
        return err;
    *out = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    return *out ? 0 : -ENOMEM;
}

int acquisition_create(struct acquisition **out, struct array *array)
{
    struct acquisition *s = calloc(1, sizeof *s);
    int err = s ? survey_message(&s->survey, array_survey(array)) : -ENOMEM;

    if (err)
        goto fail;
    s->array = array;
    for (size_t i = 0; i < MAX_SHOTS; i++) {
        s->shots[i].speakers =
            calloc(s->survey->n_speakers_m, sizeof *s->shots[i].speakers);
        if (!s->shots[i].speakers) {
            err = -ENOMEM;
            goto fail;
        }
    }
    *out = s;
    return 0;
fail:
    acquisition_destroy(s);
    return err;
}

const Anlos__Survey *acquisition_survey(const struct acquisition *s)
{
    return s->survey;
}

int acquisition_take_survey(struct acquisition *s, const struct survey *survey)
{
    Anlos__Survey *message;
    int err = survey_message(&message, survey);

    if (err)
        return err;
    anlos__survey__free_unpacked(s->survey, NULL);
    s->survey = message;
    return 0;
}

static int check_command(const struct acquisition *s, const Anlos__FireCommand *c,
                         struct error *why)
{
    if (c->pass != ANLOS__PASS__SCENE && c->pass != ANLOS__PASS__BACKGROUND)
        return error_say(why, -EINVAL, "fire %u: unknown pass %d", c->id, (int)c->pass);
    if (c->position >= s->survey->n_stage_positions_m)
        return error_say(why, -EINVAL, "fire %u: position %u of %zu", c->id, c->position,
                         s->survey->n_stage_positions_m);
    if (c->endless && s->survey->n_stage_positions_m != 1)
        return error_say(why, -EINVAL,
                         "fire %u: without end at one of %zu stage positions; expected a "
                         "survey of an array that stands",
                         c->id, s->survey->n_stage_positions_m);
    if ((!c->n_speakers && !c->endless) || c->n_speakers > s->survey->n_speakers_m)
        return error_say(why, -EINVAL, "fire %u: %zu speakers of %zu", c->id,
                         c->n_speakers, s->survey->n_speakers_m);
    for (size_t i = 0; i < c->n_speakers; i++)
        if (c->speakers[i] >= s->survey->n_speakers_m)
            return error_say(why, -EINVAL, "fire %u: speaker %u of %zu", c->id,
                             c->speakers[i], s->survey->n_speakers_m);
    return 0;
}

int acquisition_fire(struct acquisition *s, const Anlos__FireCommand *command,
                     int64_t epoch_ns, struct error *why)
{
    if (s->commanded && command->id == s->newest_id && epoch_ns == s->newest_epoch_ns)
        return 0;
    int err = check_command(s, command, why);
    if (err)
        return err;
    if (s->n_shots == MAX_SHOTS)
        return error_say(why, -ENOBUFS, "fire %u: %d shots are waiting already",
                         command->id, MAX_SHOTS);
    struct shot *shot = &s->shots[(s->first + s->n_shots) % MAX_SHOTS];
    shot->displaced = s->displaced;
    shot->command = *command;
    shot->command.speakers = NULL;
    shot->n_speakers = command->n_speakers;
    if (command->n_speakers)
        memcpy(shot->speakers, command->speakers,
               command->n_speakers * sizeof *shot->speakers);
    s->n_shots++;
    s->commanded = true;
    s->newest_id = command->id;
    s->newest_epoch_ns = epoch_ns;
    return 0;
}

void acquisition_displaced(struct acquisition *s, bool displaced)
{
    s->displaced = displaced;
    for (size_t i = 0; displaced && i < s->n_shots; i++)
        s->shots[(s->first + i) % MAX_SHOTS].displaced = true;
}

bool acquisition_busy(const struct acquisition *s)
{
    return s->n_shots > 0;
}

bool acquisition_is_endless(const struct acquisition *s)
{
    return s->n_shots > 0 && s->shots[s->first].command.endless;
}

bool acquisition_has_ended(const struct acquisition *s)
{
    return s->ended && !s->n_shots;
}

static void end_shot(struct acquisition *s)
{
    s->first = (s->first + 1) % MAX_SHOTS;
    s->n_shots--;
    s->fired = false;
}

/* One without end is over when another one waits. */
static bool is_replaced(struct acquisition *s)
{
    if (!s->shots[s->first].command.endless || s->n_shots < 2)
        return false;
    array_halt(s->array);
    end_shot(s);
    return true;
}

static int start_shot(struct acquisition *s, const struct shot *shot, struct error *why)
{
    const struct array_shot fire = {.pass = (enum pass)shot->command.pass,
                                    .position = shot->command.position,
                                    .stage_m = shot->command.stage_m,
                                    .speakers = shot->speakers,
                                    .n_speakers = shot->n_speakers,
                                    .endless = shot->command.endless};
    int err = array_fire(s->array, &fire);

    if (err) {
        error_say(why, err, "position %u cannot be fired: %s", shot->command.position,
                  strerror(-err));
        end_shot(s);
        return err;
    }
    s->fired = true;
    s->ended = false;
    return 0;
}

static void write_message(struct acquisition *s, const struct shot *shot,
                          const struct array_ping *ping, Anlos__Ping *out)
{
    size_t n_mics = s->survey->n_microphones_m;

    anlos__ping__init(out);
    out->survey_id = s->survey->id;
    out->scan = shot->command.scan;
    out->pass = shot->command.pass;
    out->position = shot->command.position;
    out->stage_m = shot->command.stage_m;
    out->speaker = shot->speakers[ping->shot_index];
    out->samples =
        tensor_borrow_f32(&s->samples, ping->samples, 2, n_mics, ping->n_samples);
    out->n_clipped = n_mics;
    out->clipped = (uint32_t *)ping->clipped;
    out->n_not_finite = n_mics;
    out->not_finite = (uint32_t *)ping->not_finite;
    out->valid = ping->valid && !shot->displaced;
    out->temperature_c = ping->temperature_c;
    out->down = ping->down;
    out->frame = ping->frame;
}

int acquisition_next(struct acquisition *s, Anlos__Ping *out, int64_t *t0_ns,
                     struct error *why)
{
    struct array_ping ping;

    while (s->n_shots) {
        const struct shot *shot = &s->shots[s->first];
        if (is_replaced(s))
            continue;
        if (!shot->n_speakers) { /* stop */
            end_shot(s);
            continue;
        }
        int err = s->fired ? 0 : start_shot(s, shot, why);
        if (err)
            return err;
        err = array_next(s->array, &ping, why);
        if (!err) {
            write_message(s, shot, &ping, out);
            *t0_ns = ping.t0_ns;
            return 0;
        }
        if (err == -EINTR || err == -EAGAIN)
            return err;
        s->ended = err == -ENODATA && shot->command.endless;
        end_shot(s);
        if (err != -ENODATA)
            return err;
    }
    return -ENODATA;
}

void acquisition_destroy(struct acquisition *s)
{
    if (!s)
        return;
    for (size_t i = 0; i < MAX_SHOTS; i++)
        free(s->shots[i].speakers);
    if (s->survey)
        anlos__survey__free_unpacked(s->survey, NULL);
    free(s);
}
