/* SPDX-License-Identifier: MIT */
/* The guest's cards as `anlos array` sees them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "hal/alsa/devices.h"

static void every_card_is_listed_with_its_directions(void **state)
{
    struct alsa_device *all;
    size_t n, n_found = 0;
    (void)state;
    assert_int_equal(alsa_devices_list(&all, &n), 0);
    for (size_t i = 0; i < n; i++) {
        bool before_plugins = i == 0 || all[i - 1].is_card;
        if (strcmp(all[i].name, "hw:CARD=Loopback,DEV=0") &&
            strcmp(all[i].name, "hw:CARD=Loopback,DEV=1"))
            continue;
        assert_true(all[i].is_card && before_plugins);
        assert_true(all[i].playback && all[i].capture);
        assert_string_equal(all[i].description, "Loopback: Loopback PCM");
        n_found++;
    }
    assert_int_equal(n_found, 2);
    free(all);
}

static void assert_can(const struct alsa_capability *c)
{
    for (int f = 0; f < SAMPLE_FORMATS; f++)
        assert_true(c->formats[f]);
    assert_true(c->mmap && c->rw);
    assert_int_equal(c->channels_min, 1);
    assert_int_equal(c->channels_max, 32);
    for (int i = 0; i < ALSA_RATES; i++)
        assert_true(c->rates[i]);
    assert_true(c->period_min < c->period_max && c->buffer_min < c->buffer_max);
}

static void a_card_says_what_it_can_do(void **state)
{
    struct alsa_probe p;
    struct error why = {.text = ""};
    (void)state;
    assert_int_equal(alsa_probe(&p, "hw:CARD=Loopback,DEV=0", &why), 0);
    assert_true(p.has_playback && p.has_capture);
    assert_can(&p.playback);
    assert_can(&p.capture);
    assert_true(p.one_clock);
    assert_non_null(strstr(p.clock_reason, "one call starts both"));
}

/* dsnoop only records, dmix only plays. */
static void a_device_of_one_direction_is_no_array(void **state)
{
    struct alsa_probe p;
    struct error why = {.text = ""};
    (void)state;
    assert_int_equal(alsa_probe(&p, "dsnoop:CARD=Loopback,DEV=0", &why), 0);
    assert_true(!p.has_playback && p.has_capture && !p.one_clock);
    assert_string_equal(p.clock_reason, "there is no playback");
    assert_int_equal(alsa_probe(&p, "dmix:CARD=Loopback,DEV=0", &why), 0);
    assert_true(p.has_playback && !p.has_capture && !p.one_clock);
    assert_string_equal(p.clock_reason, "there is no capture");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_card_is_listed_with_its_directions),
        cmocka_unit_test(a_card_says_what_it_can_do),
        cmocka_unit_test(a_device_of_one_direction_is_no_array),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
