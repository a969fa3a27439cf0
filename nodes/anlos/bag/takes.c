#include "nodes/anlos/bag/takes.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"

#define MOST_SURVEYS 1000 /* of different ids, which are compared with one another */

struct fact { /* of a ping */
    uint64_t number, survey_id;
    double stage_m;
    uint32_t scan, pass, position, speaker, frame;
    bool valid;
};

struct facts {
    struct fact *list; /* [n] */
    size_t n, room;
    Anlos__Survey **surveys; /* [n_surveys], of different ids */
    size_t n_surveys;
    uint64_t newest_id; /* of what does not say of which survey it is */
};

static int add_survey(struct facts *f, Anlos__Survey *survey)
{
    survey_complete_id(survey);
    f->newest_id = survey->id;
    for (size_t i = 0; i < f->n_surveys; i++) {
        if (f->surveys[i]->id == survey->id) {
            anlos__survey__free_unpacked(survey, NULL);
            return 0;
        }
    }
    if (f->n_surveys == MOST_SURVEYS) {
        anlos__survey__free_unpacked(survey, NULL);
        return -EFBIG;
    }
    Anlos__Survey **grown =
        realloc(f->surveys, (f->n_surveys + 1) * sizeof(Anlos__Survey *));
    if (!grown) {
        anlos__survey__free_unpacked(survey, NULL);
        return -ENOMEM;
    }
    f->surveys = grown;
    f->surveys[f->n_surveys++] = survey;
    return 0;
}

static int add_ping(struct facts *f, const Anlos__Ping *p, uint64_t number)
{
    if (f->n == f->room) {
        size_t room = f->room ? 2 * f->room : 256;
        struct fact *grown = realloc(f->list, room * sizeof *grown);
        if (!grown)
            return -ENOMEM;
        f->list = grown;
        f->room = room;
    }
    f->list[f->n++] =
        (struct fact){.number = number,
                      .survey_id = p->survey_id ? p->survey_id : f->newest_id,
                      .stage_m = p->stage_m,
                      .scan = p->scan,
                      .pass = p->pass,
                      .position = p->position,
                      .speaker = p->speaker,
                      .frame = p->frame,
                      .valid = p->valid};
    return 0;
}

static int read_facts(struct facts *f, struct stream *s, struct complaint *why)
{
    struct stream_message m;
    uint64_t number = 0;
    int err = 0;

    while (!err && !(err = stream_next(s, &m, why))) {
        ProtobufCMessage *content = stream_unpack(&m);
        number++;
        if (!content)
            return complain(why, -EBADMSG, "a message of \"%s\" is none",
                            m.topic ? m.topic->name : "another program");
        if (m.topic == topic_survey()) {
            err = add_survey(f, (Anlos__Survey *)content);
        } else {
            err = add_ping(f, (Anlos__Ping *)content, number);
            protobuf_c_message_free_unpacked(content, NULL);
        }
        if (err == -EFBIG)
            complain(why, err, "more than %d different surveys", MOST_SURVEYS);
        else if (err)
            complain(why, err, "out of memory");
    }
    return err == -ENODATA ? 0 : err;
}

static void free_facts(struct facts *f)
{
    for (size_t i = 0; i < f->n_surveys; i++)
        anlos__survey__free_unpacked(f->surveys[i], NULL);
    free(f->surveys);
    free(f->list);
}

/* The last ping of the scan says which survey is its. */
static int choose_survey(struct takes *t, const struct facts *f, size_t scan,
                         uint64_t *id, struct complaint *why)
{
    const struct fact *last = NULL;

    for (size_t i = 0; i < f->n; i++)
        if (!scan || f->list[i].scan == scan)
            last = &f->list[i];
    if (!last)
        return scan ? complain(why, -ENODATA, "no pings of scan %zu", scan)
                    : complain(why, -ENODATA, "no pings");
    t->scan = last->scan;
    *id = last->survey_id;
    for (size_t i = 0; i < f->n_surveys; i++)
        if (f->surveys[i]->id == *id)
            return survey_from_message(&t->survey, f->surveys[i], why);
    return complain(why, -ENODATA, "the survey of the pings is not in the bag");
}

static bool find_slot(const struct takes *t, uint32_t pass, uint32_t position,
                      uint32_t speaker, size_t *slot)
{
    const struct survey *s = &t->survey;

    *slot = ((size_t)pass * s->n_positions + position) * s->n_speakers + speaker;
    return pass < 2 && position < s->n_positions && speaker < s->n_speakers;
}

bool takes_has(const struct takes *t, const Anlos__Ping *p)
{
    size_t slot;

    return p->scan == t->scan &&
           (!p->survey_id || p->survey_id == survey_id(&t->survey)) &&
           find_slot(t, (uint32_t)p->pass, p->position, p->speaker, &slot);
}

bool takes_slot(const struct takes *t, const Anlos__Ping *p, size_t *slot)
{
    return find_slot(t, (uint32_t)p->pass, p->position, p->speaker, slot);
}

static void choose(struct takes *t, const struct facts *f, uint64_t survey_id)
{
    size_t slot;

    for (size_t i = 0; i < f->n; i++) {
        const struct fact *p = &f->list[i];
        if (p->scan != t->scan) {
            t->n_others++;
            continue;
        }
        if (p->survey_id != survey_id ||
            !find_slot(t, p->pass, p->position, p->speaker, &slot)) {
            t->n_unplaced++;
            continue;
        }
        t->has_background |= p->pass == ANLOS__PASS__BACKGROUND;
        t->endless |= p->frame != 0;
        if (t->endless)
            continue;
        t->n_retaken += !p->valid || t->chosen[slot];
        if (!p->valid)
            continue;
        t->chosen[slot] = p->number;
        if (!t->survey.pings_m && isfinite(p->stage_m))
            t->survey.stage_positions_m[p->position] = p->stage_m;
    }
}

int takes_find(struct takes *t, struct stream *s, size_t scan, struct complaint *why)
{
    struct facts f = {.list = NULL};
    uint64_t id = 0;

    memset(t, 0, sizeof *t);
    int err = read_facts(&f, s, why);
    if (!err)
        err = choose_survey(t, &f, scan, &id, why);
    size_t n = t->survey.n_positions * t->survey.n_speakers;
    if (!err) {
        t->chosen = calloc(2 * n, sizeof *t->chosen);
        err = t->chosen ? 0 : complain(why, -ENOMEM, "out of memory");
    }
    if (!err) {
        choose(t, &f, id);
        for (size_t i = 0; !t->endless && i < (t->has_background ? 2 * n : n); i++)
            t->n_missing += !t->chosen[i];
    }
    free_facts(&f);
    return err;
}

void takes_clear(struct takes *t)
{
    survey_clear(&t->survey);
    free(t->chosen);
    memset(t, 0, sizeof *t);
}
