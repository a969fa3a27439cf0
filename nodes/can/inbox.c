/* SPDX-License-Identifier: MIT */
#include "nodes/can/inbox.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "dsp/error.h"
#include "msgs/can/frames.h"
#include "recon/ego.h"
#include "recon/walls/walls.h"

/* The rules, by the cycle of the vehicle and what a wrong one does.
 *
 * EgoMotion comes 50 times a second and turns every track, so it is judged hardest: a
 * loop of up to 12 old frames comes to two wrong ones in 13, and longer ones look to the
 * counter of 15 like lost frames (CAN_MAX_DELTA) or like none.  Known with the 13th, 240
 * ms after the first. WallIn mirrors whatever is seen, ten times a second: of 6 one may
 * be wrong; known with the 6th, 500 ms after the first. So it is of where walls end.
 * Ambient comes once a second and changes slowly: it has to be heard twice, and one of
 * the newest three has to be good, which is as long as a temperature is kept.  So it is
 * of SaveRequest, which takes two good frames more (inbox_save).
 *
 * In VALID a wrong frame is allowed, damaged or not (of Ambient two of three, one of them
 * damaged); of 256 that are damaged the CRC misses one, so none is allowed on the way
 * there. */
static const struct input {
    enum can_id id;
    enum inbox_kind kind;
    const char *name, *count;
    int64_t silence_ns;
    struct e2e_sm_config rules; /* window; init, valid, invalid: good, damaged */
} inputs[INBOX_INPUTS] = {
    [INBOX_EGO_MOTION] = {CAN_ID_EGO_MOTION,
                          INBOX_EGO,
                          "EgoMotion",
                          "ego_motion_invalid",
                          INBOX_EGO_NS,
                          {13, 12, 0, 12, 1, 13, 0}},
    [INBOX_AIR] = {CAN_ID_AMBIENT,
                   INBOX_AMBIENT,
                   "Ambient",
                   "ambient_invalid",
                   INBOX_AMBIENT_NS,
                   {3, 1, 0, 1, 1, 2, 0}},
    [INBOX_WALL_IN] = {CAN_ID_WALL_IN,
                       INBOX_WALLS_GIVEN,
                       "WallIn",
                       "wall_in_invalid",
                       INBOX_WALL_NS,
                       {6, 5, 0, 5, 1, 6, 0}},
    [INBOX_SAVE_REQUEST] = {CAN_ID_SAVE_REQUEST,
                            INBOX_SAVE,
                            "SaveRequest",
                            "save_request_invalid",
                            INBOX_SAVE_NS,
                            {3, 1, 0, 1, 1, 2, 0}},
    [INBOX_WALL_ENDS_IN] = {CAN_ID_WALL_ENDS_IN,
                            INBOX_WALL_ENDS,
                            "WallEndsIn",
                            "wall_ends_in_invalid",
                            INBOX_WALL_NS,
                            {6, 5, 0, 5, 1, 6, 0}},
};

void inbox_init(struct inbox *i, uint32_t base)
{
    *i = (struct inbox){.checks = {.base = base}};
    anlos__ego_motion__init(&i->ego);
    anlos__ambient__init(&i->ambient);
    anlos__wall_list__init(&i->wall_list);
    i->wall_list.walls = i->wall_pointers;
}

size_t inbox_ids(const struct inbox *i, uint32_t ids[CANBUS_MAX_INPUTS])
{
    for (size_t k = 0; k < INBOX_INPUTS; k++)
        ids[k] = i->checks.base + inputs[k].id;
    return INBOX_INPUTS;
}

static enum inbox_kind take_ego(struct inbox *i, const struct can_frame_data *f,
                                int64_t now_ns)
{
    struct can_ego_motion in;

    if (can_unpack_ego_motion(f, &in))
        return INBOX_WRONG;
    const struct ego_motion motion = {in.speed_m_s, in.yaw_rate_rad_s};
    if (in.validity != CAN_VALID || !ego_motion_is_plausible(&motion))
        return INBOX_NOTHING;
    i->ego.speed_m_s = in.speed_m_s;
    i->ego.yaw_rate_rad_s = in.yaw_rate_rad_s;
    i->ego.standstill = in.standstill == CAN_STANDS;
    i->ego.valid = true;
    i->ego_ns = now_ns;
    i->moves = true;
    return INBOX_EGO;
}

static enum inbox_kind take_ambient(struct inbox *i, const struct can_frame_data *f)
{
    struct can_ambient in;

    if (can_unpack_ambient(f, &in))
        return INBOX_WRONG;
    i->ambient.temperature_c = in.temperature_c;
    i->ambient.humidity = in.humidity;
    return INBOX_AMBIENT;
}

/* Upright: its normal lies in the plane of the vehicle.  The turn about the upright axis
 * is all that the vehicle knows; it says nothing of a tilt. */
static void fill_wall(struct inbox_wall *w, const struct can_wall_in *in, int64_t now_ns)
{
    anlos__wall__init(&w->message);
    anlos__vec3__init(&w->normal);
    w->normal.x = cos(in->azimuth_rad);
    w->normal.y = sin(in->azimuth_rad);
    w->message.id = in->id;
    w->message.origin = ANLOS__WALL__ORIGIN__GIVEN;
    w->message.normal = &w->normal;
    w->message.distance_m = in->distance_m;
    w->message.existence = 1.0;
    w->given_ns = now_ns;
    if (w->ends_ns && now_ns - w->ends_ns <= INBOX_WALL_NS) {
        memcpy(w->ends_m, w->next_ends_m, sizeof w->ends_m);
        w->message.ends_m = w->ends_m;
        w->message.n_ends_m = 2;
    }
    if (isnan(in->sigma_azimuth_rad) || isnan(in->sigma_distance_m))
        return;
    w->covariance[0] = in->sigma_azimuth_rad * in->sigma_azimuth_rad;
    w->covariance[5] = in->sigma_distance_m * in->sigma_distance_m;
    w->message.covariance = w->covariance;
    w->message.n_covariance = 6;
}

/* Given lately, and not taken back. */
static bool is_known(const struct inbox_wall *w, int64_t now_ns)
{
    return w->given_ns && now_ns - w->given_ns <= INBOX_WALL_NS;
}

static void list_walls(struct inbox *i, int64_t now_ns)
{
    i->wall_list.n_walls = 0;
    for (size_t k = 0; k < INBOX_WALLS && i->wall_list.n_walls < WALLS_MAX; k++) {
        struct inbox_wall *w = &i->walls[k];
        if (!is_known(w, now_ns))
            continue;
        w->message.unseen_s = 1e-9 * (double)(now_ns - w->given_ns);
        i->wall_pointers[i->wall_list.n_walls++] = &w->message;
    }
}

static enum inbox_kind take_wall(struct inbox *i, const struct can_frame_data *f,
                                 int64_t now_ns)
{
    struct can_wall_in in;

    if (can_unpack_wall_in(f, &in))
        return INBOX_WRONG;
    if (!in.id || in.id > INBOX_WALLS || in.validity == CAN_VALIDITY_UNKNOWN)
        return INBOX_NOTHING;
    bool known = in.validity == CAN_VALID && !isnan(in.azimuth_rad) &&
                 !isnan(in.distance_m);
    if (known)
        fill_wall(&i->walls[in.id - 1], &in, now_ns);
    else
        i->walls[in.id - 1].given_ns = i->walls[in.id - 1].ends_ns = 0;
    list_walls(i, now_ns);
    return INBOX_WALLS_GIVEN;
}

/* The level axis of a wall goes to the right of who looks at it from the vehicle. */
static enum inbox_kind take_ends(struct inbox *i, const struct can_frame_data *f,
                                 int64_t now_ns)
{
    struct can_wall_ends_in in;

    if (can_unpack_wall_ends_in(f, &in))
        return INBOX_WRONG;
    if (!in.id || in.id > INBOX_WALLS || in.validity == CAN_VALIDITY_UNKNOWN)
        return INBOX_NOTHING;
    struct inbox_wall *w = &i->walls[in.id - 1];
    w->ends_ns = 0;
    if (in.validity != CAN_VALID || isnan(in.from_m) || isnan(in.to_m))
        return INBOX_NOTHING;
    if (!(in.from_m < in.to_m))
        return INBOX_WRONG;
    w->next_ends_m[0] = -in.to_m;
    w->next_ends_m[1] = -in.from_m;
    w->ends_ns = now_ns;
    return INBOX_NOTHING;
}

static bool was_taken(const struct inbox_save *s, uint16_t number)
{
    for (size_t i = 0; i < s->n_taken && i < INBOX_NUMBERS; i++)
        if (s->numbers[i] == number)
            return true;
    return false;
}

static enum inbox_kind take_save(struct inbox *i, const struct can_frame_data *f)
{
    struct inbox_save *s = &i->save;
    struct can_save_request in;

    if (can_unpack_save_request(f, &in))
        return INBOX_WRONG;
    s->idle |= in.request == CAN_IDLE;
    bool same = s->n_same && in.number == s->newest.number;
    s->n_same = in.request != CAN_SAVE ? 0
                : !same                ? 1
                : s->n_same < 3        ? s->n_same + 1
                                       : 3;
    s->newest = in;
    if (s->n_same != 2)
        return INBOX_NOTHING;
    if (!s->idle || was_taken(s, in.number)) {
        s->again++;
        return INBOX_SAVE_AGAIN;
    }
    s->numbers[s->n_taken++ % INBOX_NUMBERS] = in.number;
    s->idle = false;
    return INBOX_SAVE;
}

static bool is_silent(const struct inbox_trust *t, size_t input, int64_t now_ns)
{
    return t->sm.state != E2E_NODATA && now_ns - t->heard_ns > inputs[input].silence_ns;
}

/* A vehicle that was started again, or plugged in, is not out of sequence. */
static void begin_anew(struct inbox *i, size_t input)
{
    e2e_sm_reset(&i->trust[input].sm);
    i->trust[input].wrong = E2E_OK;
    can_checks_forget(&i->checks, inputs[input].id);
    if (input == INBOX_SAVE_REQUEST) {
        i->save.idle = false;
        i->save.n_same = 0;
    }
}

/* May a frame that came at came_ns be used? */
static enum inbox_kind judge(struct inbox *i, size_t input,
                             const struct can_frame_data *f, int64_t came_ns)
{
    struct inbox_trust *t = &i->trust[input];

    if (is_silent(t, input, came_ns))
        begin_anew(i, input);
    enum e2e_state before = t->sm.state;
    enum e2e_verdict verdict = can_check(&i->checks, f);
    t->heard_ns = came_ns;
    enum e2e_state state = e2e_sm_check(&t->sm, &inputs[input].rules, verdict);
    t->invalid += state == E2E_INVALID && before != E2E_INVALID;
    if (!e2e_is_usable(verdict)) {
        t->wrong = verdict;
        return INBOX_WRONG;
    }
    i->unbelieved += state != E2E_VALID;
    return state == E2E_VALID ? inputs[input].kind : INBOX_NOTHING;
}

enum inbox_kind inbox_take(struct inbox *i, const struct can_frame_data *f,
                           int64_t came_ns)
{
    enum inbox_kind kind = INBOX_WRONG;
    size_t input = 0;

    while (input < INBOX_INPUTS && f->id != i->checks.base + inputs[input].id)
        input++;
    if (input < INBOX_INPUTS)
        kind = judge(i, input, f, came_ns);
    if (kind == INBOX_EGO)
        kind = take_ego(i, f, came_ns);
    else if (kind == INBOX_AMBIENT)
        kind = take_ambient(i, f);
    else if (kind == INBOX_WALLS_GIVEN)
        kind = take_wall(i, f, came_ns);
    else if (kind == INBOX_WALL_ENDS)
        kind = take_ends(i, f, came_ns);
    else if (kind == INBOX_SAVE)
        kind = take_save(i, f);
    else if (input == INBOX_SAVE_REQUEST)
        i->save.n_same = 0;
    i->wrong += kind == INBOX_WRONG;
    return kind;
}

void inbox_step(struct inbox *i, int64_t now_ns)
{
    for (size_t k = 0; k < INBOX_INPUTS; k++)
        if (is_silent(&i->trust[k], k, now_ns))
            begin_anew(i, k);
}

bool inbox_doubts(const struct inbox *i)
{
    bool doubts = false;

    for (size_t k = 0; k < INBOX_INPUTS; k++)
        doubts |= i->trust[k].sm.state == E2E_INVALID;
    return doubts;
}

static void describe(const struct inbox *i, size_t input, char *text, size_t size)
{
    const struct inbox_trust *t = &i->trust[input];
    bool wrong = t->wrong != E2E_OK && t->sm.state != E2E_VALID;

    snprintf(text, size, "%s %s%s%s%s", inputs[input].name, e2e_state_text(t->sm.state),
             wrong ? " (" : "", wrong ? e2e_verdict_text(t->wrong) : "",
             wrong ? ")" : "");
}

void inbox_text(const struct inbox *i, char *text, size_t size)
{
    char one[64];

    text[0] = '\0';
    for (size_t k = 0; k < INBOX_INPUTS; k++) {
        enum e2e_state state = i->trust[k].sm.state;
        if (state != E2E_INIT && state != E2E_INVALID)
            continue;
        describe(i, k, one, sizeof one);
        text_add(text, size, ", ", "%s", one);
    }
}

bool inbox_change(struct inbox *i, enum e2e_state *state, char *text, size_t size)
{
    for (size_t k = 0; k < INBOX_INPUTS; k++) {
        struct inbox_trust *t = &i->trust[k];
        if (t->sm.state == t->told || (t->sm.state == E2E_INIT && t->told == E2E_NODATA))
            continue;
        *state = t->told = t->sm.state;
        describe(i, k, text, size);
        return true;
    }
    return false;
}

void inbox_counts(const struct inbox *i, struct device_count out[INBOX_COUNTS])
{
    out[0] = (struct device_count){"inputs_wrong", i->wrong};
    out[1] = (struct device_count){"inputs_unbelieved", i->unbelieved};
    out[2] = (struct device_count){"saves_repeated", i->save.again};
    for (size_t k = 0; k < INBOX_INPUTS; k++)
        out[3 + k] = (struct device_count){inputs[k].count, i->trust[k].invalid};
}

bool inbox_ego_ends(struct inbox *i, int64_t now_ns)
{
    if (!i->moves || now_ns - i->ego_ns < INBOX_EGO_NS)
        return false;
    i->moves = false;
    i->ego.valid = false;
    return true;
}

bool inbox_walls_end(struct inbox *i, int64_t now_ns)
{
    bool end = false;

    for (size_t k = 0; k < INBOX_WALLS; k++)
        if (i->walls[k].given_ns && !is_known(&i->walls[k], now_ns)) {
            i->walls[k].given_ns = i->walls[k].ends_ns = 0;
            end = true;
        }
    if (end)
        list_walls(i, now_ns);
    return end;
}
