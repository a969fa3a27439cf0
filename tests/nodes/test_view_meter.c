/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>
#include <string.h>

#include "msgs/tensor.h"
#include "nodes/view/meter.h"

#define N_MICS 4
#define N      1003

struct shot {
    float x[N_MICS][N];
    uint32_t clipped[N_MICS], not_finite[N_MICS];
    struct tensor_view view;
    Anlos__Ping ping;
};

/* Whole periods of a sine of that amplitude in every microphone. */
static Anlos__Ping *shoot(struct shot *s, uint32_t speaker, double amplitude)
{
    memset(s, 0, sizeof *s);
    for (size_t m = 0; m < N_MICS; m++)
        for (size_t i = 0; i < N; i++)
            s->x[m][i] = (float)(amplitude * sin(2.0 * M_PI * 17.0 * (double)i / N));
    anlos__ping__init(&s->ping);
    s->ping.samples = tensor_borrow_f32(&s->view, s->x[0], 2, (size_t)N_MICS, (size_t)N);
    s->ping.scan = 1;
    s->ping.speaker = speaker;
    s->ping.valid = true;
    s->ping.clipped = s->clipped;
    s->ping.not_finite = s->not_finite;
    s->ping.n_clipped = s->ping.n_not_finite = N_MICS;
    s->ping.temperature_c = 21.5;
    return &s->ping;
}

static const char *said(const struct meter *m, const char *kind, size_t i)
{
    static char text[32];
    json_t *o = meter_json(m);
    json_t *channel = json_array_get(json_object_get(o, kind), i);
    size_t at = strcmp(kind, "speakers") ? 2 : 1;

    snprintf(text, sizeof text, "%s", json_string_value(json_array_get(channel, at)));
    json_decref(o);
    return text;
}

static void a_sine_is_as_loud_as_it_is(void **state)
{
    static struct shot s;
    struct meter m;

    (void)state;
    meter_init(&m);
    assert_int_equal(meter_ping(&m, shoot(&s, 0, 0.5), true), 0);
    json_t *o = meter_json(&m);
    json_t *mic = json_array_get(json_object_get(o, "microphones"), 2);
    assert_true(fabs(json_real_value(json_array_get(mic, 0)) + 6.0206) < 0.01);
    assert_true(fabs(json_real_value(json_array_get(mic, 1)) + 9.0309) < 0.01);
    assert_true(fabs(json_real_value(json_object_get(o, "temperature_c")) - 21.5) < 1e-9);
    assert_string_equal(said(&m, "microphones", 2), "ok");
    json_decref(o);
    meter_clear(&m);
}

static void an_offset_is_no_sound(void **state)
{
    static struct shot s;
    struct meter m;

    (void)state;
    meter_init(&m);
    shoot(&s, 0, 0.1);
    for (size_t i = 0; i < N; i++)
        s.x[1][i] = 0.25f;
    assert_int_equal(meter_ping(&m, &s.ping, true), 0);
    assert_string_equal(said(&m, "microphones", 1), "dead");
    assert_string_equal(said(&m, "microphones", 0), "ok");
    assert_true(fabs(m.microphones[1].peak - 0.25) < 1e-6);
    meter_clear(&m);
}

static void what_is_wrong_with_a_channel_is_named(void **state)
{
    static struct shot s;
    struct meter m;

    (void)state;
    meter_init(&m);
    shoot(&s, 0, 0.1);
    for (size_t i = 0; i < N; i++)
        s.x[0][i] *= 5e-4f; /* 66 dB below the others */
    s.clipped[1] = 11;      /* over 1 % */
    s.clipped[2] = 10;      /* just under */
    s.not_finite[3] = 1;
    assert_int_equal(meter_ping(&m, &s.ping, true), 0);
    assert_string_equal(said(&m, "microphones", 0), "dead");
    assert_string_equal(said(&m, "microphones", 1), "clipped");
    assert_string_equal(said(&m, "microphones", 2), "ok");
    assert_string_equal(said(&m, "microphones", 3), "damaged");
    meter_clear(&m);
}

static void clipping_is_counted_even_when_nobody_looks(void **state)
{
    static struct shot s;
    struct meter m;

    (void)state;
    meter_init(&m);
    for (int i = 0; i < 5; i++) {
        shoot(&s, 0, 0.1);
        s.clipped[1] = 3;
        s.ping.valid = i != 2;
        assert_int_equal(meter_ping(&m, &s.ping, i == 0), 0);
    }
    assert_int_equal(m.microphones[1].clipped, 15);
    assert_int_equal(m.pings, 5);
    assert_int_equal(m.invalid, 1);
    shoot(&s, 0, 0.1);
    s.ping.scan = 2; /* the next scan begins at zero */
    assert_int_equal(meter_ping(&m, &s.ping, false), 0);
    assert_int_equal(m.microphones[1].clipped, 0);
    assert_int_equal(m.pings, 1);
    meter_clear(&m);
}

static void a_speaker_that_is_hardly_heard_is_faint(void **state)
{
    static struct shot s;
    struct meter m;

    (void)state;
    meter_init(&m);
    for (uint32_t k = 0; k < 5; k++)
        if (k != 3)
            assert_int_equal(meter_ping(&m, shoot(&s, k, k == 1 ? 0.009 : 0.1), true), 0);
    assert_string_equal(said(&m, "speakers", 0), "ok");
    assert_string_equal(said(&m, "speakers", 1), "faint"); /* 20.9 dB below */
    assert_string_equal(said(&m, "speakers", 3), "not heard yet");
    assert_string_equal(said(&m, "speakers", 4), "ok");
    meter_clear(&m);
}

static void what_is_no_ping_is_refused(void **state)
{
    static struct shot s;
    struct meter m;

    (void)state;
    meter_init(&m);
    shoot(&s, METER_MAX_CHANNELS, 0.1);
    assert_int_equal(meter_ping(&m, &s.ping, true), -EINVAL);
    shoot(&s, 0, 0.1);
    s.ping.samples = NULL;
    assert_int_equal(meter_ping(&m, &s.ping, true), -EINVAL);
    shoot(&s, 0, 0.1);
    s.ping.n_clipped = s.ping.n_not_finite = 1; /* fewer counts than channels */
    assert_int_equal(meter_ping(&m, &s.ping, true), 0);
    meter_clear(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sine_is_as_loud_as_it_is),
        cmocka_unit_test(an_offset_is_no_sound),
        cmocka_unit_test(what_is_wrong_with_a_channel_is_named),
        cmocka_unit_test(clipping_is_counted_even_when_nobody_looks),
        cmocka_unit_test(a_speaker_that_is_hardly_heard_is_faint),
        cmocka_unit_test(what_is_no_ping_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
