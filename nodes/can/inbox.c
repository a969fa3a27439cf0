#include "nodes/can/inbox.h"

#include <math.h>

#include "msgs/can/frames.h"
#include "nodes/rt/walls.h"
#include "recon/ego.h"

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
    ids[0] = i->checks.base + CAN_ID_EGO_MOTION;
    ids[1] = i->checks.base + CAN_ID_AMBIENT;
    ids[2] = i->checks.base + CAN_ID_WALL_IN;
    return 3;
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
        i->walls[in.id - 1].given_ns = 0;
    list_walls(i, now_ns);
    return INBOX_WALLS_GIVEN;
}

/* A vehicle that was started again, or plugged in, is not out of sequence. */
static void forget_who_was_away(struct inbox *i, uint32_t id, int64_t now_ns)
{
    const struct can_message *m = can_message_find(i->checks.base, id);

    if (!m)
        return;
    if (now_ns - i->heard_ns[m->id] > INBOX_AWAY_NS)
        can_checks_forget(&i->checks, m->id);
    i->heard_ns[m->id] = now_ns;
}

enum inbox_kind inbox_take(struct inbox *i, const struct can_frame_data *f,
                           int64_t came_ns)
{
    enum inbox_kind kind = INBOX_NOTHING;

    forget_who_was_away(i, f->id, came_ns);
    if (!e2e_is_usable(can_check(&i->checks, f)))
        kind = INBOX_WRONG;
    else if (f->id == i->checks.base + CAN_ID_EGO_MOTION)
        kind = take_ego(i, f, came_ns);
    else if (f->id == i->checks.base + CAN_ID_AMBIENT)
        kind = take_ambient(i, f);
    else if (f->id == i->checks.base + CAN_ID_WALL_IN)
        kind = take_wall(i, f, came_ns);
    i->wrong += kind == INBOX_WRONG;
    return kind;
}

bool inbox_ego_ends(struct inbox *i, int64_t now_ns)
{
    if (!i->moves || now_ns - i->ego_ns < INBOX_EGO_NS)
        return false;
    i->moves = false;
    i->ego.valid = false;
    can_checks_forget(&i->checks, CAN_ID_EGO_MOTION);
    return true;
}

bool inbox_walls_end(struct inbox *i, int64_t now_ns)
{
    bool end = false;

    for (size_t k = 0; k < INBOX_WALLS; k++)
        if (i->walls[k].given_ns && !is_known(&i->walls[k], now_ns)) {
            i->walls[k].given_ns = 0;
            end = true;
        }
    if (end)
        list_walls(i, now_ns);
    return end;
}
