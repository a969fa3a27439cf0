/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "msgs/can/frames.h"
#include "nodes/can/inbox.h"
#include "recon/walls/walls.h"
#include "tests/nodes/near.h"

#define MS 1000000LL

struct rig {
    struct inbox inbox;
    struct can_protection vehicle;
    int64_t now_ns;
};

static void start_silent(struct rig *r)
{
    *r = (struct rig){.vehicle = {.base = 0x420}, .now_ns = 5000 * MS};
    inbox_init(&r->inbox, 0x420);
}

/* As it comes from the vehicle. */
static void protect(struct rig *r, struct can_frame_data *f)
{
    can_protect(&r->vehicle, f);
    can_protection_sent(&r->vehicle, f);
}

static enum inbox_kind give(struct rig *r, struct can_frame_data *f)
{
    protect(r, f);
    return inbox_take(&r->inbox, f, r->now_ns);
}

static void pack_ego(struct can_frame_data *f, double speed_m_s, enum can_validity v)
{
    const struct can_ego_motion ego = {.speed_m_s = speed_m_s,
                                       .yaw_rate_rad_s = -0.1,
                                       .standstill = CAN_ROLLS,
                                       .validity = v};

    can_pack_ego_motion(f, 0x420, &ego);
}

static enum inbox_kind give_ego(struct rig *r, double speed_m_s, enum can_validity v)
{
    struct can_frame_data f;

    pack_ego(&f, speed_m_s, v);
    return give(r, &f);
}

static enum inbox_kind give_air(struct rig *r)
{
    const struct can_ambient air = {.temperature_c = 20, .humidity = NAN};
    struct can_frame_data f;

    can_pack_ambient(&f, 0x420, &air);
    return give(r, &f);
}

static enum inbox_kind give_wall(struct rig *r, uint8_t id, enum can_validity v)
{
    const struct can_wall_in wall = {.id = id,
                                     .validity = v,
                                     .azimuth_rad = 0.5,
                                     .distance_m = 4.0,
                                     .sigma_azimuth_rad = 0.02,
                                     .sigma_distance_m = 0.1};
    struct can_frame_data f;

    can_pack_wall_in(&f, 0x420, &wall);
    return give(r, &f);
}

static enum inbox_kind give_ends(struct rig *r, uint8_t id, enum can_validity v,
                                 double from_m, double to_m)
{
    const struct can_wall_ends_in ends = {id, v, from_m, to_m};
    struct can_frame_data f;

    can_pack_wall_ends_in(&f, 0x420, &ends);
    return give(r, &f);
}

/* One that knows each input: as many frames as it takes, none of which says anything. */
static void start(struct rig *r)
{
    const struct can_ambient no_air = {NAN, NAN};
    struct can_frame_data f;

    start_silent(r);
    for (int i = 0; i < 12; i++)
        assert_int_equal(give_ego(r, 0.0, CAN_INVALID), INBOX_NOTHING);
    for (int i = 0; i < 5; i++)
        assert_int_equal(give_wall(r, 0, CAN_INVALID), INBOX_NOTHING);
    can_pack_ambient(&f, 0x420, &no_air);
    assert_int_equal(give(r, &f), INBOX_NOTHING);
    for (int i = 0; i < 5; i++)
        assert_int_equal(give_ends(r, 0, CAN_INVALID, 0, 0), INBOX_NOTHING);
    r->inbox.unbelieved = 0;
}

static void the_five_inputs_of_this_sensor_are_listened_to(void **state)
{
    struct rig r;
    uint32_t ids[CANBUS_MAX_INPUTS];

    (void)state;
    start(&r);
    assert_int_equal(inbox_ids(&r.inbox, ids), 5);
    assert_int_equal(ids[0], 0x42c);
    assert_int_equal(ids[1], 0x42d);
    assert_int_equal(ids[2], 0x42e);
    assert_int_equal(ids[3], 0x42f);
    assert_int_equal(ids[4], 0x42b);
}

static void motion_is_said_as_the_vehicle_says_it(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    assert_int_equal(give_ego(&r, 2.5, CAN_VALID), INBOX_EGO);
    assert_true(r.inbox.ego.valid);
    assert_false(r.inbox.ego.standstill);
    assert_near(r.inbox.ego.speed_m_s, 2.5, 0.005);
    assert_near(r.inbox.ego.yaw_rate_rad_s, -0.1, 1e-4);
}

static void motion_ends_once_after_100_ms_of_silence(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    assert_false(inbox_ego_ends(&r.inbox, 9000 * MS)); /* there never was any */
    give_ego(&r, 1.0, CAN_VALID);
    assert_false(inbox_ego_ends(&r.inbox, r.now_ns + 99 * MS));
    assert_true(inbox_ego_ends(&r.inbox, r.now_ns + 100 * MS));
    assert_false(r.inbox.ego.valid);
    assert_false(inbox_ego_ends(&r.inbox, r.now_ns + 200 * MS));
    assert_int_equal(give_ego(&r, 1.0, CAN_VALID), INBOX_EGO);
    assert_true(r.inbox.ego.valid);
}

static void motion_that_the_vehicle_does_not_trust_is_as_good_as_none(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    give_ego(&r, 1.0, CAN_VALID);
    for (int i = 0; i < 5; i++) {
        r.now_ns += 20 * MS;
        enum can_validity v = i % 2 ? CAN_INVALID : CAN_VALIDITY_UNKNOWN;
        assert_int_equal(give_ego(&r, 3.0, v), INBOX_NOTHING);
    }
    assert_int_equal(give_ego(&r, NAN, CAN_VALID), INBOX_NOTHING);
    assert_near(r.inbox.ego.speed_m_s, 1.0, 1e-9);
    assert_true(inbox_ego_ends(&r.inbox, r.now_ns));
    assert_int_equal(r.inbox.wrong, 0);
}

/* Its frame may say up to 327 m/s. */
static void no_vehicle_goes_faster_than_100_m_s(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    assert_int_equal(give_ego(&r, -100.0, CAN_VALID), INBOX_EGO);
    assert_int_equal(give_ego(&r, 100.1, CAN_VALID), INBOX_NOTHING);
    assert_int_equal(give_ego(&r, -327.0, CAN_VALID), INBOX_NOTHING);
    assert_near(r.inbox.ego.speed_m_s, -100.0, 1e-9);
    assert_int_equal(r.inbox.wrong, 0);
}

static void a_damaged_frame_is_not_used(void **state)
{
    struct rig r;
    struct can_frame_data f;

    (void)state;
    start(&r);
    give_ego(&r, 1.0, CAN_VALID);
    for (unsigned bit = 0; bit < 64; bit++) {
        pack_ego(&f, 2.0, CAN_VALID);
        protect(&r, &f);
        f.data[bit / 8] ^= (uint8_t)(1u << bit % 8);
        assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
    }
    assert_near(r.inbox.ego.speed_m_s, 1.0, 1e-9);
    assert_int_equal(r.inbox.wrong, 64);
}

static void nor_is_one_that_comes_again_or_of_another_frame(void **state)
{
    struct rig r;
    struct can_frame_data f;

    (void)state;
    start(&r);
    pack_ego(&f, 2.0, CAN_VALID);
    assert_int_equal(give(&r, &f), INBOX_EGO);
    assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
    pack_ego(&f, 3.0, CAN_VALID);
    protect(&r, &f);
    f.id = 0x42d;
    assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
}

/* So many frames come before one is believed. */
static int count_unbelieved(struct rig *r)
{
    int n = 0;

    while (give_ego(r, 2.0, CAN_VALID) == INBOX_NOTHING) {
        n++;
        r->now_ns += 20 * MS;
    }
    return n;
}

/* It was away for a while: what it counts now is what counts. */
static void after_a_silence_any_counter_is_the_first(void **state)
{
    struct rig r;
    struct can_frame_data f;

    (void)state;
    start(&r);
    give_ego(&r, 1.0, CAN_VALID);
    for (int i = 0; i < 7; i++) {
        pack_ego(&f, 2.0, CAN_VALID);
        protect(&r, &f);
    }
    r.now_ns += 140 * MS;
    assert_true(inbox_ego_ends(&r.inbox, r.now_ns));
    assert_int_equal(count_unbelieved(&r), 12);
    assert_int_equal(r.inbox.wrong, 0);
    assert_int_equal(r.inbox.unbelieved, 12);
}

static void so_is_it_of_what_comes_every_second(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    assert_int_equal(give_air(&r), INBOX_AMBIENT);
    r.vehicle.counters[CAN_ID_AMBIENT] = 9; /* 8 were lost, in a second */
    r.now_ns += 1000 * MS;
    assert_int_equal(give_air(&r), INBOX_WRONG);
    r.vehicle.counters[CAN_ID_AMBIENT] = 3;
    r.now_ns += 3001 * MS;
    assert_int_equal(give_air(&r), INBOX_NOTHING);
    r.now_ns += 1000 * MS;
    assert_int_equal(give_air(&r), INBOX_AMBIENT);
}

static void the_air_is_what_the_vehicle_measures(void **state)
{
    const struct can_ambient air = {.temperature_c = -12.5, .humidity = 0.8};
    struct rig r;
    struct can_frame_data f;

    (void)state;
    start(&r);
    can_pack_ambient(&f, 0x420, &air);
    assert_int_equal(give(&r, &f), INBOX_AMBIENT);
    assert_near(r.inbox.ambient.temperature_c, -12.5, 0.25);
    assert_near(r.inbox.ambient.humidity, 0.8, 0.01);
    can_pack_ambient(&f, 0x420, &(struct can_ambient){NAN, NAN});
    assert_int_equal(give(&r, &f), INBOX_AMBIENT);
    assert_true(isnan(r.inbox.ambient.temperature_c));
}

/* The steps of the signals: 0.1 degree, 0.01 m, their sigmas rounded up. */
static void a_wall_is_upright_in_the_vehicle_frame(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    assert_int_equal(give_wall(&r, 3, CAN_VALID), INBOX_WALLS_GIVEN);
    assert_int_equal(r.inbox.wall_list.n_walls, 1);
    const Anlos__Wall *w = r.inbox.wall_list.walls[0];
    assert_int_equal(w->id, 3);
    assert_int_equal(w->origin, ANLOS__WALL__ORIGIN__GIVEN);
    assert_near(w->normal->x, cos(0.5), 2e-3);
    assert_near(w->normal->y, sin(0.5), 2e-3);
    assert_true(w->normal->z >= 0.0 && w->normal->z <= 0.0);
    assert_near(w->distance_m, 4.0, 0.02);
    assert_int_equal(w->n_covariance, 6);
    assert_true(w->covariance[0] >= 0.02 * 0.02 - 1e-9 && w->covariance[0] < 0.002);
    assert_true(w->covariance[5] >= 0.1 * 0.1 - 1e-9 && w->covariance[5] < 0.04);
}

static void walls_are_kept_until_they_are_taken_back_or_old(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    give_wall(&r, 1, CAN_VALID);
    r.now_ns += 500 * MS;
    give_wall(&r, 2, CAN_VALID);
    assert_int_equal(r.inbox.wall_list.n_walls, 2);
    assert_near(r.inbox.wall_list.walls[0]->unseen_s, 0.5, 1e-9);
    assert_int_equal(give_wall(&r, 2, CAN_INVALID), INBOX_WALLS_GIVEN);
    assert_int_equal(r.inbox.wall_list.n_walls, 1);
    assert_int_equal(r.inbox.wall_list.walls[0]->id, 1);
    r.now_ns += 1501 * MS;
    give_wall(&r, 3, CAN_VALID);
    assert_int_equal(r.inbox.wall_list.n_walls, 1);
    assert_int_equal(r.inbox.wall_list.walls[0]->id, 3);
    assert_int_equal(give_wall(&r, 0, CAN_VALID), INBOX_NOTHING);
    assert_int_equal(give_wall(&r, INBOX_WALLS, CAN_VALID), INBOX_WALLS_GIVEN);
    assert_int_equal(r.inbox.wall_list.n_walls, 2);
}

static void of_more_walls_than_a_message_has_the_first_are_listed(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    for (uint8_t id = INBOX_WALLS; id >= 1; id--)
        assert_int_equal(give_wall(&r, id, CAN_VALID), INBOX_WALLS_GIVEN);
    assert_int_equal(r.inbox.wall_list.n_walls, WALLS_MAX);
    for (uint32_t k = 0; k < WALLS_MAX; k++)
        assert_int_equal(r.inbox.wall_list.walls[k]->id, k + 1);
}

/* Nothing else has to come from the vehicle. */
static void a_wall_ends_once_after_2_s_of_silence(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    assert_false(inbox_walls_end(&r.inbox, 9000 * MS)); /* there never was any */
    give_wall(&r, 1, CAN_VALID);
    r.now_ns += 500 * MS;
    give_wall(&r, 2, CAN_VALID);
    assert_false(inbox_walls_end(&r.inbox, r.now_ns + 1500 * MS));
    assert_true(inbox_walls_end(&r.inbox, r.now_ns + 1501 * MS));
    assert_int_equal(r.inbox.wall_list.n_walls, 1);
    assert_int_equal(r.inbox.wall_list.walls[0]->id, 2);
    assert_false(inbox_walls_end(&r.inbox, r.now_ns + 2000 * MS));
    assert_true(inbox_walls_end(&r.inbox, r.now_ns + 2001 * MS));
    assert_int_equal(r.inbox.wall_list.n_walls, 0);
    assert_false(inbox_walls_end(&r.inbox, r.now_ns + 9000 * MS));
}

/* It is not there to end. */
static void a_wall_that_was_taken_back_does_not_end_again(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    give_wall(&r, 1, CAN_VALID);
    give_wall(&r, 1, CAN_INVALID);
    assert_false(inbox_walls_end(&r.inbox, r.now_ns + 9000 * MS));
}

/* Each 20 ms the same frame, for 10 s. */
struct stuck {
    unsigned taken, valid; /* as new motion; frames at which the motion was valid */
};

static struct stuck stick(struct rig *r)
{
    struct stuck s = {0, 0};
    struct can_frame_data f;

    pack_ego(&f, 2.5, CAN_VALID);
    protect(r, &f);
    for (int i = 0; i < 500; i++) {
        s.taken += inbox_take(&r->inbox, &f, r->now_ns) == INBOX_EGO;
        inbox_ego_ends(&r->inbox, r->now_ns);
        inbox_step(&r->inbox, r->now_ns);
        s.valid += r->inbox.ego.valid;
        r->now_ns += 20 * MS;
    }
    return s;
}

static void drive(struct rig *r, int frames)
{
    for (int i = 0; i < frames; i++) {
        assert_int_equal(give_ego(r, 2.5, CAN_VALID), INBOX_EGO);
        r->now_ns += 20 * MS;
    }
}

/* The first of them is new; what it says ends after 100 ms, which are 5 frames. */
static void a_stuck_vehicle_is_not_believed_for_longer_than_a_silent_one(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    drive(&r, 50);
    struct stuck s = stick(&r);
    assert_int_equal(s.taken, 1);
    assert_int_equal(s.valid, 5);
    assert_true(inbox_doubts(&r.inbox));
    assert_int_equal(r.inbox.wrong, 499);
}

static void one_that_is_stuck_from_the_start_is_never_believed(void **state)
{
    struct rig r;

    (void)state;
    start_silent(&r);
    struct stuck s = stick(&r);
    assert_int_equal(s.taken, 0);
    assert_int_equal(s.valid, 0);
}

static void nor_is_one_after_a_silence(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    drive(&r, 50);
    r.now_ns += 5000 * MS;
    inbox_ego_ends(&r.inbox, r.now_ns);
    struct stuck s = stick(&r);
    assert_int_equal(s.taken + s.valid, 0);
}

/* 13 good ones in a row. */
static void a_vehicle_that_is_well_again_is_believed_again(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    drive(&r, 50);
    stick(&r);
    assert_int_equal(count_unbelieved(&r), 12);
    assert_true(r.inbox.ego.valid);
    assert_false(inbox_doubts(&r.inbox));
    assert_int_equal(r.inbox.trust[INBOX_EGO_MOTION].invalid, 1);
}

/* What was recorded comes again and again.  12 + 3 are a round of the counter: longer
 * ones cannot be told from frames that got lost. */
static void a_loop_of_old_frames_is_not_believed(void **state)
{
    for (size_t length = 1; length <= 12; length++) {
        struct can_frame_data loop[12];
        struct rig r;
        unsigned taken = 0;
        (void)state;
        start(&r);
        drive(&r, 50);
        for (size_t i = 0; i < length; i++) {
            pack_ego(&loop[i], 2.5, CAN_VALID);
            protect(&r, &loop[i]);
        }
        for (size_t i = 0; i < 500; i++) {
            r.now_ns += 20 * MS;
            taken += inbox_take(&r.inbox, &loop[i % length], r.now_ns) == INBOX_EGO;
            inbox_step(&r.inbox, r.now_ns);
        }
        /* The second wrong one of 13 comes with the third round at the latest. */
        assert_in_range(taken, length, 2 * length);
    }
}

/* Two of three get lost, and each 13th is damaged besides. */
static void a_bus_that_loses_frames_is_believed(void **state)
{
    struct rig r;
    struct can_frame_data f;

    (void)state;
    start(&r);
    for (int i = 0; i < 300; i++) {
        r.now_ns += 60 * MS;
        for (int k = 0; k < 2; k++) {
            pack_ego(&f, 1.0, CAN_VALID);
            protect(&r, &f);
        }
        assert_int_equal(give_ego(&r, 1.0, CAN_VALID), INBOX_EGO);
        f.data[3] ^= 1;
        if (i % 13 == 0)
            assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
    }
}

/* The frames of somebody else come between those of the vehicle. */
static void
motion_that_is_every_other_time_of_another_sender_is_not_believed(void **state)
{
    struct can_protection other = {.base = 0x410};
    struct can_frame_data f;
    struct rig r;
    unsigned taken = 0;

    (void)state;
    start(&r);
    drive(&r, 20);
    for (int i = 0; i < 500; i++) {
        r.now_ns += 10 * MS;
        pack_ego(&f, 9.0, CAN_VALID);
        f.id = 0x41c;
        can_protect(&other, &f);
        can_protection_sent(&other, &f);
        f.id = 0x42c;
        assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
        r.now_ns += 10 * MS;
        taken += give_ego(&r, 1.0, CAN_VALID) == INBOX_EGO;
    }
    assert_int_equal(taken, 1);
    assert_int_equal(r.inbox.trust[INBOX_EGO_MOTION].invalid, 1);
}

/* Of each the same frame, at its pace, for 20 s; how long what it said is kept. */
static void air_and_walls_that_are_stuck_are_not_believed_either(void **state)
{
    const struct can_ambient air = {.temperature_c = 20, .humidity = NAN};
    struct can_frame_data f;
    struct rig r;

    (void)state;
    start(&r);
    can_pack_ambient(&f, 0x420, &air);
    assert_int_equal(give(&r, &f), INBOX_AMBIENT);
    for (int i = 0; i < 20; i++) {
        r.now_ns += 1000 * MS;
        inbox_step(&r.inbox, r.now_ns);
        assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
        assert_int_equal(inbox_doubts(&r.inbox), i >= 2);
    }
    start(&r);
    give_wall(&r, 1, CAN_VALID);
    const struct can_wall_in wall = {
        .id = 1, .validity = CAN_VALID, .azimuth_rad = 0.5, .distance_m = 2.0};
    can_pack_wall_in(&f, 0x420, &wall);
    assert_int_equal(give(&r, &f), INBOX_WALLS_GIVEN);
    for (int i = 1; i <= 200; i++) {
        r.now_ns += 100 * MS;
        inbox_step(&r.inbox, r.now_ns);
        assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
        assert_int_equal(inbox_walls_end(&r.inbox, r.now_ns), i == 21);
    }
    assert_true(inbox_doubts(&r.inbox));
}

/* From 2 m on the right to 1 m on the left: -1 to 2 along the level axis, to the right.
 */
static void walls_have_the_ends_that_were_said_before(void **state)
{
    struct rig r;
    (void)state;
    start(&r);
    const Anlos__WallList *list = &r.inbox.wall_list;
    assert_int_equal(give_ends(&r, 2, CAN_VALID, -2.0, 1.0), INBOX_NOTHING);
    assert_int_equal(list->n_walls, 0); /* ends alone are no wall */
    give_wall(&r, 1, CAN_VALID);
    give_wall(&r, 2, CAN_VALID);
    assert_int_equal(list->n_walls, 2);
    assert_int_equal(list->walls[0]->n_ends_m, 0);
    assert_int_equal(list->walls[1]->n_ends_m, 2);
    assert_near(list->walls[1]->ends_m[0], -1.0, 1e-9);
    assert_near(list->walls[1]->ends_m[1], 2.0, 1e-9);
    give_ends(&r, 2, CAN_VALID, -3.0, 1.0); /* of the next frame */
    give_wall(&r, 1, CAN_VALID);
    assert_near(list->walls[1]->ends_m[1], 2.0, 1e-9);
    give_wall(&r, 2, CAN_VALID);
    assert_near(list->walls[1]->ends_m[1], 3.0, 1e-9);
}

static void ends_are_forgotten_with_time_and_with_their_wall(void **state)
{
    struct rig r;
    (void)state;
    start(&r);
    const Anlos__WallList *list = &r.inbox.wall_list;
    give_ends(&r, 1, CAN_VALID, -2.0, 1.0);
    for (int i = 0; i <= 21; i++) { /* wall by wall, until the ends are 2.1 s old */
        give_wall(&r, 1, CAN_VALID);
        assert_int_equal(list->walls[0]->n_ends_m, i <= 20 ? 2 : 0);
        r.now_ns += 100 * MS;
    }
    start(&r);
    give_ends(&r, 1, CAN_VALID, -2.0, 1.0);
    give_wall(&r, 1, CAN_VALID);
    give_ends(&r, 1, CAN_INVALID, -2.0, 1.0); /* endless from now on */
    give_wall(&r, 1, CAN_VALID);
    assert_int_equal(list->walls[0]->n_ends_m, 0);
    give_ends(&r, 1, CAN_VALID, -2.0, 1.0);
    give_wall(&r, 1, CAN_INVALID); /* taken back, ends and all */
    give_wall(&r, 1, CAN_VALID);
    assert_int_equal(list->walls[0]->n_ends_m, 0);
    give_ends(&r, 1, CAN_VALID, -2.0, 1.0);
    assert_int_equal(give_ends(&r, 1, CAN_VALID, 1.0, 1.0), INBOX_WRONG);
    assert_int_equal(r.inbox.wrong, 1);
    give_wall(&r, 1, CAN_VALID);
    assert_int_equal(list->walls[0]->n_ends_m, 0);
}

static void damage_air(struct rig *r)
{
    const struct can_ambient air = {.temperature_c = 20, .humidity = NAN};
    struct can_frame_data f;

    can_pack_ambient(&f, 0x420, &air);
    protect(r, &f);
    f.data[3] ^= 1;
    assert_int_equal(inbox_take(&r->inbox, &f, r->now_ns += 1000 * MS), INBOX_WRONG);
}

/* And then to be heard twice, as at the start. */
static void of_three_of_the_air_one_may_be_damaged(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    give_air(&r);
    damage_air(&r);
    assert_false(inbox_doubts(&r.inbox));
    assert_int_equal(give_air(&r), INBOX_AMBIENT);
    damage_air(&r);
    assert_true(inbox_doubts(&r.inbox));
    assert_int_equal(give_air(&r), INBOX_NOTHING);
    assert_int_equal(give_air(&r), INBOX_AMBIENT);
    assert_false(inbox_doubts(&r.inbox));
}

static void of_six_walls_one_may_be_damaged(void **state)
{
    struct can_wall_in wall = {.id = 1, .validity = CAN_VALID, .distance_m = 4.0};
    struct can_frame_data f;
    struct rig r;

    (void)state;
    start(&r);
    for (int i = 0; i < 20; i++) {
        assert_int_equal(give_wall(&r, 1, CAN_VALID), INBOX_WALLS_GIVEN);
        if (i % 5 != 4)
            continue;
        can_pack_wall_in(&f, 0x420, &wall);
        protect(&r, &f);
        f.data[3] ^= 1;
        assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
        assert_false(inbox_doubts(&r.inbox));
    }
}

static void an_input_that_is_silent_has_no_data_and_no_doubt(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    stick(&r);
    assert_true(inbox_doubts(&r.inbox));
    r.now_ns += 80 * MS;
    inbox_step(&r.inbox, r.now_ns);
    assert_true(inbox_doubts(&r.inbox));
    r.now_ns += MS;
    inbox_step(&r.inbox, r.now_ns);
    assert_false(inbox_doubts(&r.inbox));
    assert_int_equal(r.inbox.trust[INBOX_EGO_MOTION].sm.state, E2E_NODATA);
}

static uint64_t count(const struct inbox *i, const char *name)
{
    struct device_count counts[INBOX_COUNTS];

    inbox_counts(i, counts);
    for (size_t k = 0; k < INBOX_COUNTS; k++)
        if (!strcmp(counts[k].name, name))
            return counts[k].value;
    fail_msg("no %s is counted", name);
    return 0;
}

/* Silence is where an input begins: of what was wrong before nothing is said any more. */
static void what_was_wrong_before_a_silence_is_not_said_after_it(void **state)
{
    char text[INBOX_TEXT_SIZE];
    struct rig r;

    (void)state;
    start(&r);
    drive(&r, 1);
    stick(&r);
    assert_true(inbox_doubts(&r.inbox));
    r.now_ns += 60000 * MS;
    give_ego(&r, 2.5, CAN_VALID);
    inbox_text(&r.inbox, text, sizeof text);
    assert_string_equal(text, "EgoMotion init");
}

static void what_is_not_believed_is_said_and_counted(void **state)
{
    char text[INBOX_TEXT_SIZE];
    enum e2e_state s;
    struct rig r;

    (void)state;
    start_silent(&r);
    give_air(&r);
    inbox_text(&r.inbox, text, sizeof text);
    assert_string_equal(text, "Ambient init");
    assert_false(inbox_change(&r.inbox, &s, text, sizeof text));
    start(&r);
    drive(&r, 1);
    give_air(&r);
    give_wall(&r, 1, CAN_VALID);
    give_ends(&r, 1, CAN_VALID, -1.0, 1.0);
    inbox_text(&r.inbox, text, sizeof text);
    assert_string_equal(text, "");
    for (int i = 0; i < 3; i++)
        assert_true(inbox_change(&r.inbox, &s, text, sizeof text));
    assert_string_equal(text, "WallIn valid");
    assert_true(inbox_change(&r.inbox, &s, text, sizeof text));
    assert_string_equal(text, "WallEndsIn valid");
    stick(&r);
    inbox_text(&r.inbox, text, sizeof text);
    assert_string_equal(text, "EgoMotion invalid (repeated)");
    assert_true(inbox_change(&r.inbox, &s, text, sizeof text));
    assert_int_equal(s, E2E_INVALID);
    for (int i = 0; i < 3; i++) {
        assert_true(inbox_change(&r.inbox, &s, text, sizeof text));
        assert_int_equal(s, E2E_NODATA); /* nothing else came */
    }
    assert_false(inbox_change(&r.inbox, &s, text, sizeof text));
    count_unbelieved(&r);
    assert_int_equal(count(&r.inbox, "inputs_wrong"), 499);
    assert_int_equal(count(&r.inbox, "inputs_unbelieved"), 12);
    assert_int_equal(count(&r.inbox, "ego_motion_invalid"), 1);
    assert_int_equal(count(&r.inbox, "ambient_invalid"), 0);
    assert_int_equal(count(&r.inbox, "wall_in_invalid"), 0);
    assert_int_equal(count(&r.inbox, "wall_ends_in_invalid"), 0);
}

static void what_does_not_fit_is_cut_off(void **state)
{
    char text[64];
    struct rig r;

    (void)state;
    start_silent(&r);
    give_ego(&r, 0.0, CAN_VALID);
    give_air(&r);
    inbox_text(&r.inbox, text, sizeof text);
    assert_string_equal(text, "EgoMotion init, Ambient init");
    memset(text, '#', sizeof text);
    inbox_text(&r.inbox, text, 20);
    assert_string_equal(text, "EgoMotion init, Amb");
    assert_int_equal(text[20], '#');
}

static enum inbox_kind give_save(struct rig *r, enum can_request request, uint16_t number)
{
    const struct can_save_request save = {
        .number = number, .reason = CAN_DRIVER, .request = request};
    struct can_frame_data f;

    r->now_ns += 100 * MS;
    inbox_step(&r->inbox, r->now_ns);
    can_pack_save_request(&f, 0x420, &save);
    return give(r, &f);
}

/* How many of n frames brought an event. */
static int saves(struct rig *r, enum can_request request, uint16_t number, int n)
{
    int taken = 0;

    for (int i = 0; i < n; i++)
        taken += give_save(r, request, number) == INBOX_SAVE;
    return taken;
}

static void an_event_is_taken_with_the_second_frame_of_it(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    assert_int_equal(saves(&r, CAN_IDLE, 0, 2), 0);
    assert_int_equal(give_save(&r, CAN_SAVE, 7), INBOX_NOTHING);
    assert_int_equal(give_save(&r, CAN_SAVE, 7), INBOX_SAVE);
    assert_int_equal(r.inbox.save.newest.number, 7);
    assert_int_equal(r.inbox.save.newest.reason, CAN_DRIVER);
}

static void one_event_is_taken_once_however_long_it_is_said(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    saves(&r, CAN_IDLE, 0, 2);
    assert_int_equal(saves(&r, CAN_SAVE, 7, 1000), 1);
    assert_int_equal(saves(&r, CAN_IDLE, 7, 10), 0);
    assert_int_equal(count(&r.inbox, "saves_repeated"), 0);
    assert_int_equal(saves(&r, CAN_SAVE, 7, 5), 0); /* the same event again */
    assert_int_equal(count(&r.inbox, "saves_repeated"), 1);
    saves(&r, CAN_IDLE, 7, 1);
    assert_int_equal(saves(&r, CAN_SAVE, 8, 5), 1);
}

/* Of the eight newest none: 0 is a number as any other. */
static void what_was_taken_is_known_by_eight_numbers(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    for (uint16_t round = 0; round < 2; round++)
        for (uint16_t i = 0; i < INBOX_NUMBERS; i++) {
            saves(&r, CAN_IDLE, 0, 2);
            assert_int_equal(saves(&r, CAN_SAVE, INBOX_NUMBERS - 1 - i, 5), !round);
        }
    saves(&r, CAN_IDLE, 0, 2);
    assert_int_equal(saves(&r, CAN_SAVE, 99, 5), 1);
    saves(&r, CAN_IDLE, 0, 2);
    assert_int_equal(saves(&r, CAN_SAVE, 0, 5), 0);
    assert_int_equal(saves(&r, CAN_SAVE, INBOX_NUMBERS - 1, 5), 1); /* the oldest */
}

/* As a sender does whose number runs away: a new one with each frame, or each second. */
static void without_idle_in_between_there_is_no_other_event(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    saves(&r, CAN_IDLE, 0, 2);
    for (uint16_t i = 0; i < 100; i++)
        assert_int_equal(give_save(&r, CAN_SAVE, i), INBOX_NOTHING);
    assert_int_equal(saves(&r, CAN_SAVE, 200, 5), 1);
    for (uint16_t i = 0; i < 10; i++)
        assert_int_equal(saves(&r, CAN_SAVE, 201 + i, 10), 0);
    assert_int_equal(count(&r.inbox, "saves_repeated"), 10);
}

/* Nobody knows when it began: this node, the sender or the bus may have been away. */
static void what_had_begun_before_it_was_heard_is_no_event(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    assert_int_equal(saves(&r, CAN_SAVE, 7, 20), 0);
    assert_int_equal(count(&r.inbox, "saves_repeated"), 1);
    saves(&r, CAN_IDLE, 7, 2);
    assert_int_equal(saves(&r, CAN_SAVE, 9, 5), 1);
    saves(&r, CAN_IDLE, 9, 2);
    r.now_ns += 4000 * MS; /* silence */
    assert_int_equal(saves(&r, CAN_SAVE, 10, 20), 0);
}

/* Recorded with an event in it, and sent in a loop: at once, and after a silence, which
 * makes its counters good. */
static void replayed_frames_save_nothing_again(void **state)
{
    struct can_frame_data f[45];
    int taken = 0, again = 0;
    struct rig r;

    (void)state;
    start(&r);
    for (int i = 0; i < 45; i++) {
        const struct can_save_request save = {.number = 7,
                                              .reason = CAN_COLLISION,
                                              .request = i / 5 == 4 ? CAN_SAVE
                                                                    : CAN_IDLE};
        can_pack_save_request(&f[i], 0x420, &save);
        protect(&r, &f[i]);
        r.now_ns += 100 * MS;
        taken += inbox_take(&r.inbox, &f[i], r.now_ns) == INBOX_SAVE;
    }
    assert_int_equal(taken, 1);
    for (int loop = 0; loop < 20; loop++) {
        r.now_ns += loop % 2 ? 10000 * MS : 0;
        for (int i = 0; i < 45; i++) {
            r.now_ns += 100 * MS;
            inbox_step(&r.inbox, r.now_ns);
            again += inbox_take(&r.inbox, &f[i], r.now_ns) == INBOX_SAVE;
        }
    }
    assert_int_equal(again, 0);
}

/* The CRC misses one of 256: that one alone says nothing, nor do two around a wrong one.
 */
static void a_single_frame_and_one_beside_a_damaged_one_are_no_event(void **state)
{
    const struct can_save_request save = {.number = 7, .request = CAN_SAVE};
    struct can_frame_data f;
    struct rig r;

    (void)state;
    start(&r);
    for (uint16_t i = 0; i < 10; i++) {
        saves(&r, CAN_IDLE, 0, 2);
        assert_int_equal(give_save(&r, CAN_SAVE, i), INBOX_NOTHING);
    }
    saves(&r, CAN_IDLE, 0, 3);
    give_save(&r, CAN_SAVE, 20);
    can_pack_save_request(&f, 0x420, &save);
    can_protect(&r.vehicle, &f);
    f.data[3] ^= 1;
    assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
    assert_int_equal(give_save(&r, CAN_SAVE, 20), INBOX_NOTHING);
    assert_int_equal(give_save(&r, CAN_SAVE, 20), INBOX_SAVE);
}

static void a_request_that_is_not_available_or_of_a_later_version_is_none(void **state)
{
    struct rig r;

    (void)state;
    start(&r);
    saves(&r, CAN_IDLE, 0, 2);
    assert_int_equal(saves(&r, CAN_REQUEST_UNKNOWN, 7, 10), 0);
    assert_int_equal(saves(&r, (enum can_request)2, 7, 10), 0);
    assert_int_equal(saves(&r, CAN_SAVE, 7, 2), 1);
}

static void a_frame_of_it_that_is_stuck_is_wrong(void **state)
{
    const struct can_save_request save = {.number = 7, .request = CAN_SAVE};
    struct can_frame_data f;
    struct rig r;

    (void)state;
    start(&r);
    saves(&r, CAN_IDLE, 0, 2);
    can_pack_save_request(&f, 0x420, &save);
    assert_int_equal(give(&r, &f), INBOX_NOTHING);
    for (int i = 0; i < 50; i++) {
        assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns += 100 * MS), INBOX_WRONG);
        assert_int_equal(inbox_doubts(&r.inbox), i >= 2); /* one of three is good */
    }
    assert_int_equal(count(&r.inbox, "save_request_invalid"), 1);
}

/* Nobody should have let them through. */
static void a_frame_that_is_no_input_is_wrong_and_nothing_else(void **state)
{
    struct can_frame_data f = {.id = 0x123, .size = 8};
    struct rig r;

    (void)state;
    start(&r);
    struct inbox before = r.inbox;
    assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
    f.id = 0x42c;
    for (uint8_t size = 0; size < 8; size++) {
        f.size = size;
        assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
    }
    pack_ego(&f, 1.0, CAN_VALID);
    can_protect(&r.vehicle, &f);
    f.fd = true;
    assert_int_equal(inbox_take(&r.inbox, &f, r.now_ns), INBOX_WRONG);
    assert_int_equal(r.inbox.wrong, 10);
    assert_false(r.inbox.moves);
    assert_memory_equal(&r.inbox.checks, &before.checks, sizeof before.checks);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_five_inputs_of_this_sensor_are_listened_to),
        cmocka_unit_test(motion_is_said_as_the_vehicle_says_it),
        cmocka_unit_test(motion_ends_once_after_100_ms_of_silence),
        cmocka_unit_test(motion_that_the_vehicle_does_not_trust_is_as_good_as_none),
        cmocka_unit_test(no_vehicle_goes_faster_than_100_m_s),
        cmocka_unit_test(a_damaged_frame_is_not_used),
        cmocka_unit_test(nor_is_one_that_comes_again_or_of_another_frame),
        cmocka_unit_test(after_a_silence_any_counter_is_the_first),
        cmocka_unit_test(so_is_it_of_what_comes_every_second),
        cmocka_unit_test(the_air_is_what_the_vehicle_measures),
        cmocka_unit_test(a_wall_is_upright_in_the_vehicle_frame),
        cmocka_unit_test(walls_are_kept_until_they_are_taken_back_or_old),
        cmocka_unit_test(of_more_walls_than_a_message_has_the_first_are_listed),
        cmocka_unit_test(a_wall_ends_once_after_2_s_of_silence),
        cmocka_unit_test(a_wall_that_was_taken_back_does_not_end_again),
        cmocka_unit_test(a_stuck_vehicle_is_not_believed_for_longer_than_a_silent_one),
        cmocka_unit_test(one_that_is_stuck_from_the_start_is_never_believed),
        cmocka_unit_test(nor_is_one_after_a_silence),
        cmocka_unit_test(a_vehicle_that_is_well_again_is_believed_again),
        cmocka_unit_test(a_loop_of_old_frames_is_not_believed),
        cmocka_unit_test(a_bus_that_loses_frames_is_believed),
        cmocka_unit_test(
            motion_that_is_every_other_time_of_another_sender_is_not_believed),
        cmocka_unit_test(air_and_walls_that_are_stuck_are_not_believed_either),
        cmocka_unit_test(of_three_of_the_air_one_may_be_damaged),
        cmocka_unit_test(walls_have_the_ends_that_were_said_before),
        cmocka_unit_test(ends_are_forgotten_with_time_and_with_their_wall),
        cmocka_unit_test(of_six_walls_one_may_be_damaged),
        cmocka_unit_test(an_input_that_is_silent_has_no_data_and_no_doubt),
        cmocka_unit_test(what_was_wrong_before_a_silence_is_not_said_after_it),
        cmocka_unit_test(what_is_not_believed_is_said_and_counted),
        cmocka_unit_test(what_does_not_fit_is_cut_off),
        cmocka_unit_test(an_event_is_taken_with_the_second_frame_of_it),
        cmocka_unit_test(one_event_is_taken_once_however_long_it_is_said),
        cmocka_unit_test(what_was_taken_is_known_by_eight_numbers),
        cmocka_unit_test(without_idle_in_between_there_is_no_other_event),
        cmocka_unit_test(what_had_begun_before_it_was_heard_is_no_event),
        cmocka_unit_test(replayed_frames_save_nothing_again),
        cmocka_unit_test(a_single_frame_and_one_beside_a_damaged_one_are_no_event),
        cmocka_unit_test(a_request_that_is_not_available_or_of_a_later_version_is_none),
        cmocka_unit_test(a_frame_of_it_that_is_stuck_is_wrong),
        cmocka_unit_test(a_frame_that_is_no_input_is_wrong_and_nothing_else),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
