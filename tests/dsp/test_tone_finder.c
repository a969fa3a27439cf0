/* SPDX-License-Identifier: MIT */
/* Pings of 44 ms, one each 24 ms, of an array of four speakers and six microphones: what
 * sounds goes on from ping to ping. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "dsp/tone_finder.h"
#include "hal/random.h"

enum { SPEAKERS = 4, CHANNELS = 6, SAMPLES = 2112, SLOT = 1152 };
#define RATE_HZ  48000.0
#define HISS     1e-4
#define CHIRP_HZ 2000.0
#define BAND_HZ  18000.0
#define CHIRP_S  0.02

struct rig {
    struct tone_finder *f;
    struct random random;
    uint64_t n; /* pings so far */
    double x[CHANNELS][SAMPLES];
};

static int setup(void **state)
{
    static const struct tone_finder_config cfg = {.n_speakers = SPEAKERS,
                                                  .n_channels = CHANNELS,
                                                  .n_samples = SAMPLES,
                                                  .rate_hz = RATE_HZ,
                                                  .band_hz = {2000, 20000}};
    struct rig *r = calloc(1, sizeof *r);

    if (!r || tone_finder_create(&r->f, &cfg))
        return -1;
    random_seed(&r->random, (uint64_t[]){1}, 1);
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    tone_finder_destroy(r->f);
    free(r);
    return 0;
}

/* -- sound -----------------------------------------------------------------------------
 */

static void hiss(struct rig *r, double rms)
{
    for (size_t c = 0; c < CHANNELS; c++)
        for (size_t i = 0; i < SAMPLES; i++)
            r->x[c][i] = rms * random_normal(&r->random);
}

/* Harmonics as they go on, with phases of their own; each channel has another gain. */
static void add_harmonics(struct rig *r, double hz, unsigned from, unsigned to,
                          double rms)
{
    struct random phases;

    random_seed(&phases, (uint64_t[]){7}, 1);
    for (unsigned h = from; h <= to; h++) {
        double turn = 2 * M_PI * h * hz / RATE_HZ,
               phase = 2 * M_PI * random_even(&phases);
        double first = fmod(turn * SLOT * (double)r->n, 2 * M_PI) + phase;
        double level = rms * sqrt(2.0 / (to - from + 1));
        for (size_t i = 0; i < SAMPLES; i++) {
            double x = level * sin(first + turn * (double)i);
            for (size_t c = 0; c < CHANNELS; c++)
                r->x[c][i] += (c % 2 ? 1.0 : -0.5) * x;
        }
    }
}

static void add_chirp(double *x, double at_s, double level)
{
    for (size_t i = 0; i < SAMPLES; i++) {
        double t = (double)i / RATE_HZ - at_s;
        if (t >= 0 && t < CHIRP_S)
            x[i] += level * sin(2 * M_PI * (CHIRP_HZ + 0.5 * BAND_HZ / CHIRP_S * t) * t);
    }
}

/* Our chirp and the next one's with a room's echoes, which are others for each pair and,
 * of an array that moves, in each ping. */
static void add_room(struct rig *r, bool moves)
{
    for (size_t c = 0; c < CHANNELS; c++)
        for (uint64_t k = 0; k < 2; k++) {
            struct random echoes;
            uint64_t n = r->n + k;
            double slot_s = (double)k * SLOT / RATE_HZ;
            random_seed(&echoes, (uint64_t[]){c, n % SPEAKERS, moves ? n : 0}, 3);
            double level = 2e-3 * pow(30, random_even(&echoes)); /* near or far */
            add_chirp(r->x[c], slot_s + 3e-3 * random_even(&echoes), level);
            add_chirp(r->x[c], slot_s + 0.009 + 1e-3 * random_even(&echoes), 0.01);
            for (int e = 0; e < 4; e++)
                add_chirp(r->x[c], slot_s + 0.02 * random_even(&echoes), 0.003);
        }
}

/* What a ping's sound is made into. */
static void take(struct rig *r)
{
    float samples[CHANNELS][SAMPLES];

    for (size_t c = 0; c < CHANNELS; c++)
        for (size_t i = 0; i < SAMPLES; i++)
            samples[c][i] = (float)r->x[c][i];
    tone_finder_ping(r->f, r->n % SPEAKERS, &samples[0][0], SAMPLES);
    r->n++;
}

static const struct tone_found *found(const struct rig *r)
{
    return tone_finder_found(r->f);
}

/* -- tests -----------------------------------------------------------------------------
 */

enum {
    SOME = TONE_FINDER_SOME * TONE_FINDER_BLOCK,
    FEW = TONE_FINDER_FEW * TONE_FINDER_BLOCK
};

/* As loud as our own sound is near, and as hiss is; one of 5 kHz has the same phase in
 * each ping. The median of gains 1 and 0.5 of six channels is the mean of their squares'.
 */
static void a_tone_is_named_with_frequency_and_level(void **state)
{
    static const struct {
        double hz, rms;
    } cases[] = {{5013, 0.1}, {7301, 0.003}, {11117, 2e-4}, {5000, 0.05}};
    struct rig *r = *state;

    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        for (int n = 0; n < SOME + TONE_FINDER_BLOCK; n++) {
            hiss(r, HISS);
            add_room(r, false);
            add_harmonics(r, cases[k].hz, 1, 1, cases[k].rms);
            take(r);
        }
        const struct tone_found *t = found(r);
        double rms = cases[k].rms * sqrt((1 + 0.25) / 2);
        assert_int_equal(t->kind, TONE_LINES);
        assert_int_equal(t->n_lines, 1);
        assert_true(fabs(t->frequency_hz - cases[k].hz) < 5);
        assert_true(fabs(t->rms / rms - 1) < 0.3);
    }
}

static void combs_are_named_with_how_far_their_tones_are_apart(void **state)
{
    static const struct {
        double hz;
        unsigned from, to;
    } cases[] = {{50.01, 40, 400}, {60, 34, 330}, {100, 20, 200}, {300, 7, 60}};
    struct rig *r = *state;

    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        for (int n = 0; n < SOME + TONE_FINDER_BLOCK; n++) {
            hiss(r, HISS);
            add_room(r, false);
            add_harmonics(r, cases[k].hz, cases[k].from, cases[k].to, 0.01);
            take(r);
        }
        const struct tone_found *t = found(r);
        assert_int_equal(t->kind, TONE_COMB);
        assert_true(fabs(t->frequency_hz / cases[k].hz - 1) < 1e-3);
        assert_true(fabs(t->rms / (0.01 * sqrt((1 + 0.25) / 2)) - 1) < 0.3);
    }
}

/* Hiss; a room, of an array that stands and of one that moves; another array's chirps in
 * slots of 30 ms, straight and by a wall; a slam, one noise for all, every eighth ping.
 */
static void other_sound_is_none(void **state)
{
    struct rig *r = *state;

    for (int sound = 0; sound < 5; sound++)
        for (int n = 0; n < 12 * TONE_FINDER_BLOCK; n++) {
            hiss(r, HISS);
            if (sound > 0)
                add_room(r, sound == 2);
            for (int k = -2; sound == 3 && k < 3; k++) {
                double now_s = (double)r->n * SLOT / RATE_HZ, its_s = 0.030002;
                double at_s = its_s * (floor(now_s / its_s) + k) - now_s;
                struct random its;
                random_seed(&its,
                            (uint64_t[]){(uint64_t)llround((now_s + at_s) / its_s) % 16},
                            1);
                at_s += 1e-3 * random_even(&its); /* which speaker */
                for (size_t c = 0; c < CHANNELS; c++) {
                    add_chirp(r->x[c], at_s + 1e-4 * (double)c, 0.03);
                    add_chirp(r->x[c], at_s + 0.005 + 2e-4 * (double)c, 0.02);
                }
            }
            for (size_t i = 0; sound == 4 && n % 8 == 0 && i < SAMPLES; i++) {
                double x = 0.2 * random_normal(&r->random);
                for (size_t c = 0; c < CHANNELS; c++)
                    r->x[c][i] += x;
            }
            take(r);
            if (found(r)->kind != TONE_NONE)
                fail_msg("sound %d, ping %d: kind %d, %g Hz", sound, n, found(r)->kind,
                         found(r)->frequency_hz);
        }
}

/* Two blocks of 16 pings until it is there, three of silence until it is gone; the block
 * in which it ends still has it. */
static void it_comes_after_two_blocks_and_goes_after_three(void **state)
{
    struct rig *r = *state;

    for (int n = 0; n < SOME; n++) {
        assert_int_equal(found(r)->kind, TONE_NONE);
        hiss(r, HISS);
        add_harmonics(r, 5013, 1, 1, 0.01);
        take(r);
    }
    assert_int_equal(found(r)->kind, TONE_LINES);
    /* The differences of the first pings without it still have it. */
    for (int n = 0; n < FEW + TONE_FINDER_BLOCK; n++) {
        hiss(r, HISS);
        take(r);
        assert_true(n >= FEW - 1 || found(r)->kind == TONE_LINES);
    }
    assert_int_equal(found(r)->kind, TONE_NONE);
}

/* In two of six channels: a cable's own. */
static void what_few_channels_have_is_not_told(void **state)
{
    struct rig *r = *state;

    for (int n = 0; n < 4 * TONE_FINDER_BLOCK; n++) {
        hiss(r, HISS);
        for (size_t i = 0; i < SAMPLES; i++)
            r->x[0][i] += 0.1 *
                          sin(2 * M_PI * 5013 / RATE_HZ * (double)(r->n * SLOT + i));
        memcpy(r->x[1], r->x[0], sizeof r->x[1]);
        take(r);
        assert_int_equal(found(r)->kind, TONE_NONE);
    }
}

static void it_has_a_name(void **state)
{
    static const struct {
        struct tone_found found;
        const char *text;
    } cases[] = {{{.kind = TONE_NONE}, ""},
                 {{TONE_LINES, 5012.7, 0.1, 1}, "a steady tone of 5013 Hz"},
                 {{TONE_LINES, 5012.7, 0.1, 3}, "3 steady tones, the loudest 5013 Hz"},
                 {{TONE_COMB, 49.98, 0.1, 0}, "a comb of tones 50.0 Hz apart"}};
    char text[64];

    (void)state;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        tone_found_text(&cases[k].found, text, sizeof text);
        assert_string_equal(text, cases[k].text);
    }
}

static void what_makes_no_sense_is_refused(void **state)
{
    struct tone_finder_config cfg = {.n_speakers = 1,
                                     .n_channels = 1,
                                     .n_samples = SAMPLES,
                                     .rate_hz = RATE_HZ,
                                     .band_hz = {2000, 24001}};
    struct tone_finder *f;

    (void)state;
    assert_int_equal(tone_finder_create(&f, &cfg), -22);
    cfg.band_hz[1] = 2100; /* no room for what is around a line */
    assert_int_equal(tone_finder_create(&f, &cfg), -22);
    cfg.band_hz[1] = 20000;
    cfg.n_channels = 0;
    assert_int_equal(tone_finder_create(&f, &cfg), -22);
    assert_null(f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_tone_is_named_with_frequency_and_level, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(
            combs_are_named_with_how_far_their_tones_are_apart, setup, teardown),
        cmocka_unit_test_setup_teardown(other_sound_is_none, setup, teardown),
        cmocka_unit_test_setup_teardown(it_comes_after_two_blocks_and_goes_after_three,
                                        setup, teardown),
        cmocka_unit_test_setup_teardown(what_few_channels_have_is_not_told, setup,
                                        teardown),
        cmocka_unit_test(it_has_a_name),
        cmocka_unit_test(what_makes_no_sense_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
