/* SPDX-License-Identifier: MIT */
/* `alsa:` when something goes wrong: frames that are lost, a card that is unplugged, is
 * in use, or has not what the rig asks for. */
#include "tests/hw/cable.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/hw/card.h"

/* Stops this whole process for longer than any buffer holds. */
static void stand_still(void)
{
    pid_t self = getpid(), child = fork();
    assert_true(child >= 0);
    if (!child) {
        kill(self, SIGSTOP);
        poll(NULL, 0, 800);
        kill(self, SIGCONT);
        _exit(0);
    }
    assert_int_equal(waitpid(child, NULL, 0), child);
}

static bool is_sound(const struct echo *e, size_t from)
{
    for (size_t f = from; f < atomic_load(&e->n_heard); f++)
        if (echo_sum(e, f, 0) != 0)
            return true;
    return false;
}

/* Fires, and stands still while the first slot is heard; how many pings that voids. */
static size_t shoot_badly(struct cable *c)
{
    struct array_shot shot = {.speakers = cable_order, .n_speakers = SPEAKERS};
    struct array_ping ping;
    struct error why = {.text = ""};
    size_t n_void = 0;
    size_t before = atomic_load(&c->echo.n_heard);
    assert_int_equal(array_fire(c->array, &shot), 0);
    while (!is_sound(&c->echo, before))
        poll(NULL, 0, 1);
    stand_still();
    for (size_t j = 0; j < SPEAKERS; j++) {
        assert_int_equal(array_next(c->array, &ping, &why), 0);
        assert_int_equal(ping.shot_index, j);
        n_void += !ping.valid;
    }
    return n_void;
}

/* What had begun is void, the shot is read to its end, and a later one is as good as
 * ever. */
static void lost_frames_void_their_slots_and_the_stream_goes_on(void **state)
{
    static const struct way way = {"S16", "mmap", SND_PCM_FORMAT_S16, 8, 48000, NULL};
    static struct taken pings[SPEAKERS];
    struct cable *c = *state;
    struct error why = {.text = ""};
    cable_open(c, &way);
    size_t n_void = shoot_badly(c);
    assert_true(n_void > 0);
    assert_true(cable_count(c, "slots_invalid") >= n_void);
    assert_true(cable_count(c, "restarts") > 0);
    assert_true(cable_count(c, "overruns") + cable_count(c, "underruns") > 0);
    assert_int_equal(array_condition(c->array, &why), 0);
    assert_true(array_notice(c->array, &why));
    assert_contains(why.text, "frames were lost; started anew");
    cable_shoot(c->array, pings);
}

static void what_is_unplugged_is_waited_for_and_goes_on(void **state)
{
    static const struct way way = {"S32", "rw", SND_PCM_FORMAT_S32, 8, 48000, NULL};
    static struct taken pings[SPEAKERS];
    struct cable *c = *state;
    struct array_shot shot = {.speakers = cable_order, .n_speakers = SPEAKERS};
    struct array_ping ping;
    struct error why = {.text = ""};
    pthread_t thread;
    int err;
    cable_open(c, &way);
    cable_shoot(c->array, pings);
    cable_check_whole(c);
    assert_int_equal(array_condition(c->array, &why), 0);
    card_unplug(&thread);
    while (!array_condition(c->array, &why))
        poll(NULL, 0, 1);
    assert_contains(why.text, "hw:Loopback,0,0: it is gone; tries again in 0.5 s");
    cable_stop_far_end(c);
    assert_int_equal(pthread_join(thread, NULL), 0);
    assert_int_equal(array_fire(c->array, &shot), 0);
    assert_int_equal(array_next(c->array, &ping, &why), -EAGAIN);
    assert_contains(why.text, "it is gone");
    card_plug();
    cable_start_far_end(c);
    for (size_t j = 0; j < SPEAKERS; j++) {
        while ((err = array_next(c->array, &ping, &why)) == -EAGAIN)
            continue;
        assert_int_equal(err, 0);
        assert_true(ping.valid);
    }
    assert_int_equal(array_condition(c->array, &why), 0);
    assert_int_equal(cable_count(c, "reopened"), 1);
    cable_shoot(c->array, pings);
    cable_check_whole(c);
}

/* The far end has set S16, 8 channels, 48000 Hz. */
static void what_the_card_has_not_is_refused_with_what_it_has(void **state)
{
    static const struct {
        const char *from, *to; /* in the rig */
        int err;
        const char *error;
    } cases[] = {
        {"S16", "S32", -EINVAL,
         "hw:Loopback,0,0: playback has no format S32; it has S16, 8..8 channels, 48000 "
         "Hz"},
        {"inputs: [1", "inputs: [8", -EINVAL,
         "hw:Loopback,0,0: capture has no 9 channels; it has S16, 8..8 channels"},
        {"outputs: [7", "outputs: [40", -EINVAL, "playback has no 41 channels"},
        {"sample_rate_hz: 48000", "sample_rate_hz: 96000", -EINVAL,
         "playback has no rate of 96000 Hz; it has S16, 8..8 channels, 48000 Hz"},
        {"sample_rate_hz: 48000", "sample_rate_hz: 48000.5", -EINVAL,
         "playback has no rate of 48000.5 Hz"},
    };
    static const struct way way = {"S16", "rw", SND_PCM_FORMAT_S16, 8, 48000, NULL};
    struct cable *c = *state;
    cable_open(c, &way);
    cable_close_array(c);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        char text[2000] = "", changed[2100], uri[600];
        FILE *f = fopen(cable_rig(c->scratch, &way), "r");
        assert_non_null(f);
        size_t n = fread(text, 1, sizeof text - 1, f);
        fclose(f);
        char *at = strstr(text, cases[i].from);
        assert_true(n > 0 && at);
        snprintf(changed, sizeof changed, "%.*s%s%s", (int)(at - text), text, cases[i].to,
                 at + strlen(cases[i].from));
        snprintf(uri, sizeof uri, "alsa:hw:Loopback,0,0?rig=%s",
                 scratch_write(c->scratch, "changed.yaml", changed));
        assert_int_equal(array_open(&c->array, uri, clock_system(), &why), cases[i].err);
        assert_contains(why.text, cases[i].error);
    }
}

static void a_card_that_is_in_use_or_missing_is_named(void **state)
{
    static const struct way way = {"S16", "rw", SND_PCM_FORMAT_S16, 8, 48000, NULL};
    struct error why = {.text = ""};
    struct cable *c = *state;
    struct array *second;
    char uri[600];
    cable_open(c, &way);
    snprintf(uri, sizeof uri, "alsa:hw:Loopback,0,0?rig=%s/rig.yaml", c->scratch->folder);
    assert_int_equal(array_open(&second, uri, clock_system(), &why), -EBUSY);
    assert_contains(why.text, "hw:Loopback,0,0: playback: another program uses it");
    snprintf(uri, sizeof uri, "alsa:hw:7,0?rig=%s/rig.yaml", c->scratch->folder);
    assert_int_equal(array_open(&second, uri, clock_system(), &why), -ENOENT);
    assert_contains(why.text, "hw:7,0: playback: no such device; there are ");
    assert_contains(why.text, "hw:CARD=Loopback,DEV=0");
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, cable_setup, cable_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(lost_frames_void_their_slots_and_the_stream_goes_on),
        TEST(what_the_card_has_not_is_refused_with_what_it_has),
        TEST(a_card_that_is_in_use_or_missing_is_named),
        TEST(what_is_unplugged_is_waited_for_and_goes_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
