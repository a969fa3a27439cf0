/* SPDX-License-Identifier: MIT */
#include "nodes/array/acquisition.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "msgs/stage.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/topics.h"
#include "nodes/rt/stage_line.h"
#include "recon/geometry.h"

#define MAX_SHOTS        8
#define SURVEY_PERIOD_NS 1000000000LL
#define LOOK_NS          100000000LL /* at the device */
#define MAX_FAILURES     5           /* in a row: then start the device anew */

/* A stage that does not stop: which of its reports tell where a ping was taken, and how
 * far beside its place in the survey one may be.  Before the first slot it is known to be
 * up to speed for so long (nodes/scan/scan.c), and behind the last one it brakes. */
#define LINE_NS        1000000000LL
#define LINE_STEADY_NS 140000000LL
#define LINE_FIRST_NS  300000000LL /* for so long the scan's own line will do */
#define MOST_OFF_M     1e-3
#define MOST_M         100.0 /* of a place or a speed in a command: no stage has more */

/* -- how the survey changes -------------------------------------------------------------
 */

#define DIFFERS 0.0025 /* of the speed of sound: 1 cm at 4 m */
#define REST_NS 60000000000LL

/* Cramer's formula is one of -20..50 C, and good to 0.1 % a little beyond. */
static bool is_plausible(const Anlos__Ambient *a)
{
    return a->temperature_c >= -40.0 && a->temperature_c <= 60.0;
}

bool ambient_take(struct ambient *a, const struct survey *measured, struct survey *s,
                  const Anlos__Ambient *said, int64_t now_ns)
{
    if (!is_plausible(said) || (a->changed_ns && now_ns - a->changed_ns < REST_NS))
        return false;
    double humidity = isnan(said->humidity) ? 0.0 : said->humidity;
    double speed_m_s = survey_humid_sound_speed_m_s(said->temperature_c, humidity);
    if (fabs(speed_m_s / s->sound_speed_m_s - 1.0) <= DIFFERS)
        return false;
    s->temperature_c = said->temperature_c;
    s->sound_speed_m_s = speed_m_s;
    s->gate_m[1] = fmin(measured->gate_m[1], survey_gate_limit_m(s));
    a->changed_ns = now_ns;
    return true;
}

/* Who went farther, in one step or in many, has come off. */
int places_correct(struct survey *s, const struct survey *measured,
                   const Anlos__MovedElement *m, struct error *why)
{
    const char *kind = m->speaker ? "speaker" : "microphone";
    size_t n = m->speaker ? s->n_speakers : s->n_microphones;

    if (m->element < 1 || m->element > n)
        return error_say(why, -EINVAL, "%s %u, expected 1 to %zu", kind, m->element, n);
    size_t i = m->element - 1;
    double *at_m = (m->speaker ? s->speakers_m : s->microphones_m)[i];
    const double *from_m =
        (m->speaker ? measured->speakers_m : measured->microphones_m)[i];
    const double to_m[3] = {at_m[0] + m->x_m, at_m[1] + m->y_m, at_m[2] + m->z_m};
    double way_m = geometry_distance(from_m, to_m);
    if (!(way_m <= SURVEY_SAME_M))
        return error_say(
            why, -EINVAL,
            "%s %u is %.1f cm from its surveyed place, expected at most %.0f", kind,
            m->element, 1e2 * way_m, 1e2 * SURVEY_SAME_M);
    memcpy(at_m, to_m, sizeof to_m);
    return 0;
}

/* -- shots and pings --------------------------------------------------------------------
 */

struct shot {
    Anlos__FireCommand command; /* without its speakers */
    uint32_t *speakers;         /* [n_speakers of the survey] */
    size_t n_speakers;
    bool displaced;
    struct places { /* of its pings on a stage that does not stop */
        size_t n, n_off, n_unknown;
        double sum_m, worst_m, jitter_m;
    } places;
};

struct acquisition {
    struct node *node;
    struct array *array;
    Anlos__Survey *survey;
    struct survey air;   /* the array's, with air and places as they are */
    size_t corrections;  /* of places, since the start */
    bool refused_places; /* the newest, and said so */
    struct ambient ambient;
    struct shot shots[MAX_SHOTS]; /* a ring; the first is the one under way */
    size_t first, n_shots;
    bool fired; /* the first one has been given to the array */
    bool displaced;
    bool ended; /* without being asked to */
    bool commanded;
    uint32_t newest_id; /* of the commands taken, and who sent it */
    int64_t newest_epoch_ns;
    struct tensor_view samples;
    struct stage_line line; /* what the stage reports on its way */
    bool heard;             /* the scan */
    int64_t survey_due_ns;
    int64_t look_due_ns; /* 0: at once */
    unsigned failures;
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

int acquisition_create(struct acquisition **out, struct node *node, struct array *array)
{
    struct acquisition *s = calloc(1, sizeof *s);
    int err = s ? survey_message(&s->survey, array_survey(array)) : -ENOMEM;

    if (err)
        goto fail;
    s->node = node;
    s->array = array;
    err = survey_copy(&s->air, array_survey(array));
    if (err)
        goto fail;
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
    if (c->n_rounds && (!array_survey(s->array)->continuous ||
                        c->n_rounds > s->survey->n_stage_positions_m - c->position))
        return error_say(why, -EINVAL,
                         "fire %u: %u rounds from position %u on of %zu; expected a "
                         "survey that is continuous, and has them",
                         c->id, c->n_rounds, c->position, s->survey->n_stage_positions_m);
    if (c->n_rounds && !(c->start_ns >= 0 && c->start_ns <= INT64_MAX / 2 &&
                         fabs(c->stage_m) <= MOST_M && fabs(c->speed_m_s) <= MOST_M))
        return error_say(why, -EINVAL,
                         "fire %u: rounds from %g m on at %g m/s and %" PRId64 " ns; "
                         "expected up to %g m and m/s, and a time since 1970",
                         c->id, c->stage_m, c->speed_m_s, c->start_ns, MOST_M);
    if ((!c->n_speakers && !c->endless) || c->n_speakers > s->survey->n_speakers_m)
        return error_say(why, -EINVAL, "fire %u: %zu speakers of %zu", c->id,
                         c->n_speakers, s->survey->n_speakers_m);
    for (size_t i = 0; i < c->n_speakers; i++)
        if (c->speakers[i] >= s->survey->n_speakers_m)
            return error_say(why, -EINVAL, "fire %u: speaker %u of %zu", c->id,
                             c->speakers[i], s->survey->n_speakers_m);
    return 0;
}

int acquisition_places(struct acquisition *s, const Anlos__ElementPlaces *said,
                       struct error *why)
{
    struct survey now;

    if (array_survey(s->array)->source == SURVEY_REPLAY || !acquisition_is_endless(s) ||
        said->survey_id != s->survey->id)
        return -ESTALE;
    int err = survey_copy(&now, &s->air);
    if (err)
        return error_say(why, err, "%s", strerror(-err));
    for (size_t i = 0; !err && i < said->n_moved; i++)
        err = places_correct(&now, array_survey(s->array), said->moved[i], why);
    if (!err && (err = acquisition_take_survey(s, &now)))
        error_say(why, err, "the survey does not work then: %s", strerror(-err));
    if (err) {
        survey_clear(&now);
        return err;
    }
    survey_clear(&s->air);
    s->air = now;
    s->corrections += said->n_moved;
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
    shot->places = (struct places){.n = 0};
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

void acquisition_stage(struct acquisition *s, double place_m, int64_t at_ns)
{
    stage_line_add(&s->line, at_ns, place_m);
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

/* One without end is over when another one waits; one of a stage that does not stop, too:
 * it has come too late for that. */
static bool is_replaced(struct acquisition *s)
{
    const Anlos__FireCommand *c = &s->shots[s->first].command;
    if (!(c->endless || c->n_rounds) || s->n_shots < 2)
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
                                    .endless = shot->command.endless,
                                    .n_rounds = shot->command.n_rounds,
                                    .start_ns = shot->command.start_ns,
                                    .stage_m_s = shot->command.speed_m_s};
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

/* Of a stage that does not stop: where it was when the emission began, by what it
 * reports. false: too far from where the survey has that ping, or nobody knows. */
static bool find_place(struct acquisition *s, struct shot *shot,
                       const struct array_ping *ping, Anlos__Ping *out)
{
    const struct survey *v = array_survey(s->array);
    struct places *p = &shot->places;
    struct stage_line_fit fit;
    double slot_s = (double)v->slot_samples / v->sample_rate_hz;
    double planned_m = v->stage_positions_m[out->position] +
                       survey_speed_m_s(v) * slot_s *
                           (double)survey_slot_of(v, ping->shot_index);
    out->stage_m = planned_m;
    if (!shot->command.start_ns)
        return true;
    p->n++;
    int64_t first_ns = shot->command.start_ns - LINE_STEADY_NS;
    int64_t last_ns = shot->command.start_ns +
                      llrint(1e9 * slot_s * (double)shot->command.n_rounds *
                             (double)survey_slots(v, v->n_speakers));
    int64_t from_ns = ping->t0_ns - LINE_NS, to_ns = ping->t0_ns + LINE_NS;
    bool known = stage_line_fit(&s->line, from_ns > first_ns ? from_ns : first_ns,
                                to_ns < last_ns ? to_ns : last_ns, &fit);
    if (!known && ping->t0_ns - shot->command.start_ns < LINE_FIRST_NS) {
        fit = (struct stage_line_fit){.at_ns = shot->command.start_ns,
                                      .place_m = shot->command.stage_m,
                                      .speed_m_s = shot->command.speed_m_s};
    } else if (!known) {
        p->n_unknown++;
        return false;
    }
    out->stage_m = stage_line_place_m(&fit, ping->t0_ns);
    double off_m = out->stage_m - planned_m;
    p->sum_m += off_m;
    p->worst_m = fabs(off_m) > fabs(p->worst_m) ? off_m : p->worst_m;
    p->jitter_m = fmax(p->jitter_m, fit.jitter_m);
    p->n_off += fabs(off_m) > MOST_OFF_M;
    return fabs(off_m) <= MOST_OFF_M;
}

/* No -0.00. */
static double shown_mm(double m)
{
    return fabs(m) < 5e-6 ? 0.0 : 1e3 * m;
}

/* At the end of a run. */
static void tell_places(struct acquisition *s, const struct places *p)
{
    size_t known = p->n - p->n_unknown;
    if (!s->node || !p->n)
        return;
    bool good = !p->n_off && !p->n_unknown;
    node_log(
        s->node, good ? LOG_LEVEL_INFO : LOG_LEVEL_WARNING,
        "%zu pings of a stage that does not stop: by its reports it was %+.2f mm from "
        "their places in the mean, %+.2f at most; the reports lie %.2f mm beside a "
        "line; %zu over %.0f mm off and %zu without a report are taken again",
        p->n, known ? shown_mm(p->sum_m / (double)known) : 0.0, shown_mm(p->worst_m),
        1e3 * p->jitter_m, p->n_off, 1e3 * MOST_OFF_M, p->n_unknown);
}

static void write_message(struct acquisition *s, struct shot *shot,
                          const struct array_ping *ping, Anlos__Ping *out)
{
    size_t n_mics = s->survey->n_microphones_m;
    bool rounds = shot->command.n_rounds > 0, placed = true;

    anlos__ping__init(out);
    out->survey_id = s->survey->id;
    out->scan = shot->command.scan;
    out->pass = shot->command.pass;
    out->position = shot->command.position + (rounds ? ping->frame - 1 : 0);
    out->stage_m = shot->command.stage_m;
    if (rounds)
        placed = find_place(s, shot, ping, out);
    out->speaker = shot->speakers[ping->shot_index];
    out->samples =
        tensor_borrow_f32(&s->samples, ping->samples, 2, n_mics, ping->n_samples);
    out->n_clipped = n_mics;
    out->clipped = (uint32_t *)ping->clipped;
    out->n_not_finite = n_mics;
    out->not_finite = (uint32_t *)ping->not_finite;
    out->valid = ping->valid && !shot->displaced && placed;
    out->temperature_c = ping->temperature_c;
    out->down = ping->down;
    out->frame = rounds ? 0 : ping->frame;
}

int acquisition_next(struct acquisition *s, Anlos__Ping *out, int64_t *t0_ns,
                     struct error *why)
{
    struct array_ping ping;

    while (s->n_shots) {
        struct shot *shot = &s->shots[s->first];
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
        tell_places(s, &shot->places);
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
    survey_clear(&s->air);
    free(s);
}

static int take_stage(void *self, const struct node_message *in)
{
    struct acquisition *s = self;
    const Anlos__StageState *stage = (const Anlos__StageState *)in->content;

    acquisition_displaced(s, stage->held ||
                                 stage->state == ANLOS__STAGE_STATE__STATE__FAULT);
    if (stage->state == ANLOS__STAGE_STATE__STATE__MOVING)
        acquisition_stage(s, stage->position_m, in->capture_ns);
    return 0;
}

/* Of an array that goes round without end: a scan is one of one air, and what was
 * recorded had its own. */
static int take_ambient(void *self, const struct node_message *in)
{
    struct acquisition *s = self;
    const Anlos__Ambient *said = (const Anlos__Ambient *)in->content;
    const struct survey *measured = array_survey(s->array);
    double was_m_s = s->air.sound_speed_m_s;

    if (measured->source == SURVEY_REPLAY || !acquisition_is_endless(s) ||
        !ambient_take(&s->ambient, measured, &s->air, said, node_now_ns(s->node)))
        return 0;
    int err = acquisition_take_survey(s, &s->air);
    if (err)
        node_log(s->node, LOG_LEVEL_WARNING,
                 "the vehicle's air has %.1f C, with which the survey does not work: %s",
                 said->temperature_c, strerror(-err));
    else
        node_log(
            s->node, LOG_LEVEL_INFO,
            "the vehicle's air has %.1f C: sound goes at %.1f m/s, not %.1f; imaging "
            "restarts",
            said->temperature_c, s->air.sound_speed_m_s, was_m_s);
    s->survey_due_ns = 0;
    return 0;
}

static void say_places(struct acquisition *s, const Anlos__ElementPlaces *said)
{
    for (size_t i = 0; i < said->n_moved; i++) {
        const Anlos__MovedElement *m = said->moved[i];
        node_log(
            s->node, LOG_LEVEL_WARNING,
            "%s %u is taken to stand x %+.1f, y %+.1f, z %+.1f mm beside where it was "
            "surveyed, from now on and until the next start; imaging restarts.  Put "
            "it right, or run anlos calibrate array",
            m->speaker ? "speaker" : "microphone", m->element, 1e3 * m->x_m, 1e3 * m->y_m,
            1e3 * m->z_m);
    }
}

/* Said once, of those that dsp says again and again. */
static int take_places(void *self, const struct node_message *in)
{
    struct acquisition *s = self;
    const Anlos__ElementPlaces *said = (const Anlos__ElementPlaces *)in->content;
    struct error why = {""};
    int err = acquisition_places(s, said, &why);

    if (!err) {
        say_places(s, said);
        s->survey_due_ns = 0;
    } else if (err != -ESTALE && !s->refused_places) {
        node_log(s->node, LOG_LEVEL_WARNING, "places are not corrected: %s", why.text);
    }
    s->refused_places = err && err != -ESTALE;
    return 0;
}

/* Hearing the scan's status proves that its commands will come through. */
static int take_status(void *self, const struct node_message *in)
{
    struct acquisition *s = self;

    (void)in;
    s->heard = true;
    return 0;
}

static int take_fire(void *self, const struct node_message *in)
{
    struct acquisition *s = self;
    struct error why = {""};

    if (acquisition_fire(s, (const Anlos__FireCommand *)in->content, in->epoch_ns, &why))
        node_log(s->node, LOG_LEVEL_WARNING, "%s", why.text);
    return take_status(self, in);
}

static int64_t survey_due_ns(const void *self)
{
    return ((const struct acquisition *)self)->survey_due_ns;
}

static int publish_survey(void *self)
{
    struct acquisition *s = self;

    s->survey_due_ns = node_machine_ns(s->node) + SURVEY_PERIOD_NS;
    return node_publish(s->node, topic_survey(), 0, &acquisition_survey(s)->base);
}

/* Not ready while the device is away: the scan waits, and gives no ping up. */
static int look_at_device(void *self)
{
    struct acquisition *s = self;
    struct error why;

    while (array_notice(s->array, &why))
        node_log(s->node, LOG_LEVEL_WARNING, "%s", why.text);
    int err = array_condition(s->array, &why);
    node_ended(s->node, acquisition_has_ended(s));
    node_fault(s->node, NODE_FAULT_ARRAY_AWAY, err != 0, 1);
    if (err)
        node_state(s->node, ANLOS__HEALTH__STATE__STARTING, "%s", why.text);
    else if (acquisition_has_ended(s))
        node_state(s->node, ANLOS__HEALTH__STATE__READY, "the recording has ended");
    else if (s->heard && s->corrections)
        node_state(s->node, ANLOS__HEALTH__STATE__READY,
                   "ready, places of elements corrected %zu time%s", s->corrections,
                   s->corrections == 1 ? "" : "s");
    else if (s->heard)
        node_state(s->node, ANLOS__HEALTH__STATE__READY, "ready");
    else
        node_state(s->node, ANLOS__HEALTH__STATE__STARTING, "waits for scan");
    s->look_due_ns = node_machine_ns(s->node) + LOOK_NS;
    return 0;
}

static int64_t look_due_ns(const void *self)
{
    return ((const struct acquisition *)self)->look_due_ns;
}

static int64_t ping_due_ns(const void *self)
{
    return acquisition_busy(self) ? 0 : LOOP_NEVER;
}

static int publish_ping(void *self)
{
    struct acquisition *s = self;
    Anlos__Ping ping;
    int64_t t0_ns;
    struct error why = {""};
    int err = acquisition_next(s, &ping, &t0_ns, &why);

    s->look_due_ns = 0;
    if (!err) {
        s->failures = 0;
        /* A ping that cannot be sent is one that the scan retakes. */
        node_publish(s->node, topic_ping(), t0_ns, &ping.base);
        return 0;
    }
    /* While the device is away the shot waits for it. */
    if (err == -EINTR || err == -ENODATA || err == -EAGAIN)
        return 0;
    bool ends = err == -EINVAL || ++s->failures == MAX_FAILURES;
    node_log(s->node, ends ? LOG_LEVEL_ERROR : LOG_LEVEL_WARNING, "%s",
             why.text[0] ? why.text : strerror(-err));
    return !ends ? 0 : err == -EINVAL ? err : -EIO;
}

static size_t counts(void *self, struct device_count *out)
{
    return array_counts(((struct acquisition *)self)->array, out);
}

static const struct loop_input inputs[] = {
    {.topic = topic_fire, .take = take_fire},
    {.topic = topic_scan_status, .take = take_status},
    {.topic = topic_stage_state, .take = take_stage},
    {.topic = topic_ambient, .take = take_ambient},
    {.topic = topic_places, .take = take_places},
    {.topic = NULL},
};

static const struct loop_timer timers[] = {
    {.due_ns = look_due_ns, .run = look_at_device, .when = LOOP_EACH},
    {.due_ns = survey_due_ns, .run = publish_survey},
    {.due_ns = ping_due_ns, .run = publish_ping, .when = LOOP_LAST},
    {.run = NULL},
};

/* A recording was judged when it was made. */
static void start(void *self)
{
    const struct acquisition *s = self;

    if (array_survey(s->array)->source != SURVEY_REPLAY &&
        !launchfile_has_node(node_launch(s->node), "dsp"))
        node_log(
            s->node, LOG_LEVEL_WARNING,
            "node dsp judges microphones and speakers, and the launch file has none: "
            "what is deaf, mute or covered will not be told; add it to nodes");
}

static void close_all(void *self)
{
    struct acquisition *s = self;

    if (!s)
        return;
    struct array *array = s->array;
    acquisition_destroy(s);
    array_close(array);
}

const struct loop acquisition_loop = {.inputs = inputs,
                                      .timers = timers,
                                      .start = start,
                                      .counts = counts,
                                      .close = close_all};
