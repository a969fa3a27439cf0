/* SPDX-License-Identifier: MIT */
/* `alsa:` on snd-aloop, whose far end hears every frame that is played and answers it. */
#include "tests/hw/cable.h"

#include <math.h>

/* The chirp of Lindell 2019, Eq. 5, as a code; inverted: of speaker 1. */
static double chirp_code(const struct way *w, size_t i, bool inverted)
{
    double t = (double)i / w->rate_hz, full = full_scale(w);
    float x = (float)cos(2 * M_PI * (2000 * t + 0.5 * 18000 / 0.01 * t * t));
    if (inverted)
        x = -x;
    if (full == 1)
        return x;
    return fmax(-full, fmin(full - 1, rint(x * full)));
}

/* The frames that the far end heard until the last shot ended: nothing but the shots,
 * their first frames in starts[n_shots], slot after slot at the right channel. */
static void check_heard(const struct echo *e, const uint32_t *speakers, size_t n_shots,
                        size_t *starts)
{
    const struct way *w = e->way;
    size_t slot = cable_slot(w), chirp = cable_chirp(w);
    size_t n_heard = atomic_load(&e->n_heard), shot = 0, end = 0;
    for (size_t f = 0; f < n_heard && (shot < n_shots || f < end); f++) {
        double sum = 0;
        for (size_t c = 0; c < w->n_channels; c++)
            sum += fabs(e->heard[f * w->n_channels + c]);
        if (f >= end && sum > 0) {
            starts[shot++] = f;
            end = f + SPEAKERS * slot;
        }
        if (f >= end)
            continue;
        size_t at = f - starts[shot - 1], i = at % slot;
        uint32_t speaker = speakers[at / slot];
        for (size_t c = 0; c < w->n_channels; c++) {
            double expected = i < chirp && c == w->n_channels - 1 - speaker
                                  ? chirp_code(w, i, speaker == 1)
                                  : 0;
            assert_true(e->heard[f * w->n_channels + c] == expected);
        }
    }
    assert_int_equal(shot, n_shots);
}

/* Sample i of a ping is what the far end heard `delay` frames before, to the bit, where
 * the far end has heard so much already. */
static void check_pings(const struct echo *e, const struct taken *pings, size_t start,
                        size_t delay)
{
    double full = full_scale(e->way);
    size_t n_heard = atomic_load(&e->n_heard), n_loud = 0;
    for (size_t j = 0; j < SPEAKERS; j++)
        for (size_t m = 0; m < 4; m++)
            for (size_t i = 0; i < pings[j].n_samples; i++) {
                size_t frame = start + j * cable_slot(e->way) + i;
                if (frame < delay + 2 * m + 1 || frame - delay >= n_heard)
                    continue;
                float expected = (float)(echo_sum(e, frame, delay + 2 * m + 1) / full);
                assert_true(pings[j].samples[m][i] == (m == 3 ? -expected : expected));
                n_loud += expected != 0;
            }
    assert_true(n_loud > 3 * cable_chirp(e->way));
}

/* When the first emission arrives at microphone 0, less its channel's own delay. */
static size_t find_delay(const struct taken *pings, size_t slot)
{
    for (size_t at = 0; at < SPEAKERS * slot; at++)
        if (pings[at / slot].samples[0][at % slot] != 0)
            return at - 1;
    fail_msg("nothing was heard");
    return 0;
}

/* Only the plugin's two streams cannot be linked, and it is said once. */
static void check_notices(struct array *a, const struct way *w)
{
    struct error notice;
    int n_linked = 0;
    while (array_notice(a, &notice)) {
        print_message("%s\n", notice.text);
        n_linked += strstr(notice.text, "cannot be linked") != NULL;
    }
    assert_int_equal(n_linked, w->device != NULL);
}

static void check_way(struct cable *c, const struct way *w)
{
    static struct taken pings[2][SPEAKERS];
    size_t starts[2];
    cable_open(c, w);
    cable_shoot(c->array, pings[0]);
    cable_shoot(c->array, pings[1]);
    cable_check_whole(c);
    check_notices(c->array, w);
    cable_close_array(c);
    assert_false(far_end_broke(c->far));
    check_heard(&c->echo, cable_order, 2, starts);
    size_t delay = find_delay(pings[0], cable_slot(w));
    check_pings(&c->echo, pings[0], starts[0], delay);
    check_pings(&c->echo, pings[1], starts[1], delay);
    cable_close(c);
}

static void every_format_comes_through_bit_by_bit_in_its_slot(void **state)
{
    static const struct way ways[] = {
        {"S16", "rw", SND_PCM_FORMAT_S16, 16, 48000, NULL},
        {"S16", "mmap", SND_PCM_FORMAT_S16, 32, 48000, NULL},
        {"S24_3", "rw", SND_PCM_FORMAT_S24_3LE, 32, 48000, NULL},
        {"S24_3", "mmap", SND_PCM_FORMAT_S24_3LE, 16, 48000, NULL},
        {"S24", "rw", SND_PCM_FORMAT_S24, 16, 48000, NULL},
        {"S24", "mmap", SND_PCM_FORMAT_S24, 32, 48000, NULL},
        {"S32", "rw", SND_PCM_FORMAT_S32, 32, 48000, NULL},
        {"S32", "mmap", SND_PCM_FORMAT_S32, 16, 48000, NULL},
        {"float", "rw", SND_PCM_FORMAT_FLOAT, 16, 48000, NULL},
        {"float", "mmap", SND_PCM_FORMAT_FLOAT, 32, 48000, NULL},
        {"S24_3", "rw", SND_PCM_FORMAT_S24_3LE, 8, 44100, NULL},
        {"S32", "mmap", SND_PCM_FORMAT_S32, 8, 96000, NULL},
        {"S32", "mmap", SND_PCM_FORMAT_S32, 8, 192000, NULL},
        {"S32", "rw", SND_PCM_FORMAT_S32, 8, 48000, "plughw:Loopback,0,0"},
    };
    for (size_t i = 0; i < sizeof ways / sizeof *ways; i++) {
        print_message("%s %s, %u channels, %u Hz\n", ways[i].format, ways[i].access,
                      ways[i].n_channels, ways[i].rate_hz);
        check_way(*state, &ways[i]);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, cable_setup, cable_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(every_format_comes_through_bit_by_bit_in_its_slot),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
