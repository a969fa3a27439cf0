/* SPDX-License-Identifier: MIT */
/* Against a device of the test's own, whose moves take as long as the test wants. */
#include "scratch.h"

#include <errno.h>
#include <poll.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <time.h>

#include "hal/stage/worker.h"

#define DEADLINE_MS 60000

struct fake {
    struct stage_worker *worker;
    struct fake_clock clock;
    sem_t go;          /* each home and move ends by one of these, or is cancelled */
    _Atomic int error; /* with which it ends */
    _Atomic int rest_error;
    _Atomic int homes, moves, begun;
    _Atomic double target_m, speed_m_s;
};

static bool take(sem_t *s)
{
    struct timespec soon;
    clock_gettime(CLOCK_REALTIME, &soon);
    soon.tv_nsec += 2000000;
    if (soon.tv_nsec >= 1000000000) {
        soon.tv_sec++;
        soon.tv_nsec -= 1000000000;
    }
    return !sem_timedwait(s, &soon);
}

static int act(struct fake *f, char text[STAGE_TEXT_SIZE])
{
    f->begun++;
    while (!take(&f->go))
        if (stage_worker_cancelled(f->worker))
            return -ECANCELED;
    strcpy(text, f->error ? "it broke" : "");
    return f->error;
}

static int fake_home(void *device, char text[STAGE_TEXT_SIZE])
{
    struct fake *f = device;
    f->homes++;
    return act(f, text);
}

static int fake_move(void *device, double target_m, double speed_m_s,
                     char text[STAGE_TEXT_SIZE])
{
    struct fake *f = device;
    f->moves++;
    f->target_m = target_m;
    f->speed_m_s = speed_m_s;
    int err = act(f, text);
    if (!err)
        stage_worker_at(f->worker, target_m);
    return err;
}

static int fake_rest(void *device, int wake_fd, char text[STAGE_TEXT_SIZE])
{
    struct fake *f = device;
    struct pollfd p = {.fd = wake_fd, .events = POLLIN};
    poll(&p, 1, 5);
    strcpy(text, f->rest_error ? "it was pushed" : "");
    return atomic_exchange(&f->rest_error, 0);
}

static struct fake *start(bool homed, bool home_first)
{
    static const struct stage_worker_ops ops = {
        .home = fake_home, .move = fake_move, .rest = fake_rest};
    const struct stage_worker_config cfg = {
        .settle_s = 0.5, .homed = homed, .home_first = home_first};
    struct fake *f = calloc(1, sizeof *f);
    assert_non_null(f);
    sem_init(&f->go, 0, 0);
    fake_clock_set(&f->clock, INT64_C(1000000000000));
    assert_int_equal(
        stage_worker_create(&f->worker, &cfg, &ops, f, &f->clock.source, NULL), 0);
    return f;
}

static void finish(struct fake *f)
{
    stage_worker_destroy(f->worker);
    sem_destroy(&f->go);
    free(f);
}

static struct stage_status await(struct fake *f, enum stage_motion motion)
{
    struct stage_status s;
    for (int i = 0; i < DEADLINE_MS; i++) {
        stage_worker_status(f->worker, &s);
        if (s.motion == motion)
            return s;
        poll(NULL, 0, 1);
    }
    fail_msg("motion %d, expected %d", s.motion, motion);
    return s;
}

static void await_begun(struct fake *f, int n)
{
    for (int i = 0; f->begun < n; i++) {
        assert_true(i < DEADLINE_MS);
        poll(NULL, 0, 1);
    }
}

static void a_move_homes_first_moves_and_settles(void **state)
{
    struct fake *f = start(false, true);
    (void)state;
    assert_int_equal(stage_worker_move(f->worker, 0.3, 0), 0);
    struct stage_status s = await(f, STAGE_MOVING);
    assert_false(s.homed);
    assert_true(s.target_m == 0.3);
    await_begun(f, 1);
    assert_int_equal(f->homes, 1);
    sem_post(&f->go);
    await_begun(f, 2);
    sem_post(&f->go);
    s = await(f, STAGE_SETTLING);
    assert_true(s.homed && s.position_m == 0.3);
    f->clock.now_ns += INT64_C(499000000);
    stage_worker_status(f->worker, &s);
    assert_int_equal(s.motion, STAGE_SETTLING);
    f->clock.now_ns += INT64_C(2000000);
    stage_worker_status(f->worker, &s);
    assert_int_equal(s.motion, STAGE_IDLE);
    assert_int_equal(f->moves, 1);
    finish(f);
}

static void the_newest_of_many_commands_is_done(void **state)
{
    struct fake *f = start(true, true);
    (void)state;
    for (int i = 1; i <= 9; i++)
        assert_int_equal(stage_worker_move(f->worker, 0.1 * i, 0), 0);
    for (int i = 0; f->target_m != 0.1 * 9; i++) {
        assert_true(i < DEADLINE_MS);
        poll(NULL, 0, 1);
    }
    sem_post(&f->go);
    assert_true(await(f, STAGE_SETTLING).position_m == 0.1 * 9);
    assert_int_equal(f->homes, 0);
    finish(f);
}

static void after_a_fault_nothing_moves_until_it_is_homed(void **state)
{
    struct fake *f = start(true, true);
    (void)state;
    f->error = -EIO;
    assert_int_equal(stage_worker_move(f->worker, 0.3, 0), 0);
    sem_post(&f->go);
    struct stage_status s = await(f, STAGE_FAULT);
    assert_string_equal(s.text, "it broke");
    assert_false(s.homed);
    assert_int_equal(stage_worker_move(f->worker, 0.1, 0), -ESTALE);
    f->error = 0;
    assert_int_equal(stage_worker_home(f->worker), 0);
    sem_post(&f->go);
    s = await(f, STAGE_SETTLING);
    assert_true(s.homed);
    assert_string_equal(s.text, "");
    assert_int_equal(f->moves, 1);
    finish(f);
}

static void a_fault_at_rest_counts_too(void **state)
{
    struct fake *f = start(true, true);
    (void)state;
    f->rest_error = -EIO;
    assert_string_equal(await(f, STAGE_FAULT).text, "it was pushed");
    assert_int_equal(stage_worker_move(f->worker, 0.1, 0), -ESTALE);
    finish(f);
}

static void a_homing_that_fails_may_be_tried_again(void **state)
{
    struct fake *f = start(false, true);
    (void)state;
    for (int i = 0; i < 3; i++) {
        f->error = i < 2 ? -EIO : 0;
        assert_int_equal(stage_worker_home(f->worker), 0);
        sem_post(&f->go);
        await(f, i < 2 ? STAGE_FAULT : STAGE_SETTLING);
    }
    assert_int_equal(f->homes, 3);
    finish(f);
}

static void a_stop_breaks_off_a_move_and_not_the_place(void **state)
{
    struct fake *f = start(true, true);
    (void)state;
    assert_int_equal(stage_worker_move(f->worker, 0.3, 0), 0);
    await_begun(f, 1);
    stage_worker_at(f->worker, 0.12);
    assert_int_equal(stage_worker_stop(f->worker), 0);
    struct stage_status s = await(f, STAGE_SETTLING);
    assert_true(s.homed && s.position_m == 0.12 && s.target_m == 0.12);
    assert_int_equal(stage_worker_stop(f->worker), 0); /* at rest: nothing to do */
    finish(f);
}

static void a_homing_that_is_stopped_is_a_fault(void **state)
{
    struct fake *f = start(false, true);
    (void)state;
    assert_int_equal(stage_worker_move(f->worker, 0.3, 0), 0); /* homes first */
    await_begun(f, 1);
    assert_int_equal(stage_worker_stop(f->worker), 0);
    assert_non_null(strstr(await(f, STAGE_FAULT).text, "homing was stopped"));
    assert_int_equal(f->moves, 0);
    finish(f);
}

static void without_leave_to_home_first_it_waits_for_a_person(void **state)
{
    struct fake *f = start(false, false);
    (void)state;
    assert_non_null(strstr(await(f, STAGE_FAULT).text, "home it"));
    assert_int_equal(stage_worker_move(f->worker, 0.3, 0), -ESTALE);
    assert_int_equal(f->homes, 0);
    finish(f);
}

static void destroying_it_breaks_off_what_is_under_way(void **state)
{
    struct fake *f = start(true, true);
    (void)state;
    assert_int_equal(stage_worker_move(f->worker, 0.3, 0), 0);
    await_begun(f, 1);
    finish(f);
}

static void the_place_is_told_with_its_time(void **state)
{
    struct fake *f = start(true, false);
    struct stage_status s;
    (void)state;
    stage_worker_was_at(f->worker, 0.25, 12345);
    stage_worker_status(f->worker, &s);
    assert_true(s.position_m == 0.25 && s.at_ns == 12345);
    stage_worker_at(f->worker, 0.5);
    stage_worker_status(f->worker, &s);
    assert_true(s.position_m == 0.5 && s.at_ns == f->clock.now_ns);
    assert_int_equal(stage_worker_move(f->worker, 0.3, 0.07), 0);
    await_begun(f, 1);
    assert_true(f->speed_m_s == 0.07);
    sem_post(&f->go);
    finish(f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_move_homes_first_moves_and_settles),
        cmocka_unit_test(the_newest_of_many_commands_is_done),
        cmocka_unit_test(the_place_is_told_with_its_time),
        cmocka_unit_test(after_a_fault_nothing_moves_until_it_is_homed),
        cmocka_unit_test(a_fault_at_rest_counts_too),
        cmocka_unit_test(a_homing_that_fails_may_be_tried_again),
        cmocka_unit_test(a_stop_breaks_off_a_move_and_not_the_place),
        cmocka_unit_test(a_homing_that_is_stopped_is_a_fault),
        cmocka_unit_test(without_leave_to_home_first_it_waits_for_a_person),
        cmocka_unit_test(destroying_it_breaks_off_what_is_under_way),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
