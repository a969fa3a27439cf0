/* SPDX-License-Identifier: MIT */
/* `alsa:` on snd-aloop, round after round of its speakers for some seconds. */
#include "tests/hw/cable.h"

#include <errno.h>

enum { PINGS = 45 };

/* When the first emission arrives at microphone 0, less its channel's own delay, of a
 * ping that begins `at` frames after it; 0: not yet. */
static size_t find_delay(const struct array_ping *ping, size_t at)
{
    for (size_t i = 0; i < ping->n_samples; i++)
        if (ping->samples[i] != 0)
            return at + i - 1;
    return 0;
}

static size_t find_start(const struct echo *e)
{
    for (size_t f = 0; f < atomic_load(&e->n_heard); f++)
        if (echo_sum(e, f, 0) != 0)
            return f;
    fail_msg("nothing was played");
    return 0;
}

/* What the far end has heard since, to the bit; `delay` frames are on their way. */
static size_t check_ping(const struct echo *e, const struct array_ping *ping, size_t from,
                         size_t delay)
{
    double full = full_scale(e->way);
    size_t n_heard = atomic_load(&e->n_heard), n_loud = 0;
    for (size_t m = 0; m < MICROPHONES; m++)
        for (size_t i = 0; i < ping->n_samples; i++) {
            size_t frame = from + i;
            if (frame < delay + 2 * m + 1 || frame - delay >= n_heard)
                continue;
            float expected = (float)(echo_sum(e, frame, delay + 2 * m + 1) / full);
            float x = ping->samples[m * ping->n_samples + i];
            assert_true(x == (m == 3 ? -expected : expected));
            n_loud += expected != 0;
        }
    assert_true(n_loud > MICROPHONES * cable_chirp(e->way) / 2);
    return 1;
}

/* Every ping comes, in order, and holds what was heard. */
static void take_rounds(struct cable *c, const struct way *w)
{
    const struct array_shot shot = {
        .speakers = cable_order, .n_speakers = SPEAKERS, .endless = true};
    struct error why = {.text = ""};
    struct array_ping ping;
    size_t start = 0, delay = 0, n_checked = 0;
    assert_int_equal(array_fire(c->array, &shot), 0);
    for (size_t k = 0; k < PINGS; k++) {
        int err = array_next(c->array, &ping, &why);
        if (err)
            fail_msg("%s", why.text);
        assert_int_equal((ping.frame - 1) * SPEAKERS + ping.shot_index, k);
        assert_true(ping.valid);
        size_t at = k * cable_slot(w);
        if (!delay) {
            delay = find_delay(&ping, at);
            start = delay ? find_start(&c->echo) : 0;
        }
        if (delay && at > delay)
            n_checked += check_ping(&c->echo, &ping, start + at, delay);
    }
    assert_int_equal(n_checked, PINGS - 2); /* from the third on */
    array_halt(c->array);
    assert_int_equal(array_next(c->array, &ping, &why), -ENODATA);
}

static void rounds_come_without_a_break_and_a_shot_follows(void **state)
{
    static const struct way ways[] = {
        {"S32", "rw", SND_PCM_FORMAT_S32, 8, 48000, NULL},
        {"S16", "mmap", SND_PCM_FORMAT_S16, 16, 48000, NULL},
    };
    static struct taken pings[SPEAKERS];
    for (size_t i = 0; i < sizeof ways / sizeof *ways; i++) {
        struct cable *c = *state;
        cable_open(c, &ways[i]);
        take_rounds(c, &ways[i]);
        cable_shoot(c->array, pings);
        cable_check_whole(c);
        cable_close(c);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, cable_setup, cable_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(rounds_come_without_a_break_and_a_shot_follows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
