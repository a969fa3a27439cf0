/* SPDX-License-Identifier: MIT */
#include "tests/hw/cable.h"

#include <errno.h>

const uint32_t cable_order[SPEAKERS] = {2, 0, 1};

size_t cable_slot(const struct way *w)
{
    return w->rate_hz / 16;
}

size_t cable_chirp(const struct way *w)
{
    return w->rate_hz / 100;
}

const char *cable_rig(struct scratch *s, const struct way *w)
{
    char text[2000];
    snprintf(text, sizeof text,
             "sound_speed_m_s: 343\nsample_rate_hz: %u\nslot_samples: %zu\n"
             "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.01}\n"
             "speakers_m: [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]\n"
             "microphones_m: [[0, 0.1, 0], [0.1, 0.1, 0], [0.2, 0.1, 0], [0.3, 0.1, 0]]\n"
             "gate_m: [0.3, 4.0]\n"
             "device: {format: %s, access: %s, buffer_ms: 250, level_db: 0,\n"
             "  outputs: [%u, %u, %u], inputs: [1, 3, 5, 7],\n"
             "  invert_outputs: [1], invert_inputs: [3]}\n",
             w->rate_hz, cable_slot(w), w->format, w->access, w->n_channels - 1,
             w->n_channels - 2, w->n_channels - 3);
    return scratch_write(s, "rig.yaml", text);
}

void cable_start_far_end(struct cable *c)
{
    const struct way *w = c->echo.way;
    const struct far_end_config cfg = {.format = w->far_format,
                                       .n_channels = w->n_channels,
                                       .rate_hz = w->rate_hz,
                                       .buffer_frames = 3 * (w->rate_hz / 10),
                                       .ahead_frames = w->rate_hz / 10,
                                       .answer = echo_give,
                                       .ctx = &c->echo};
    c->far = far_end_start(&cfg);
}

void cable_stop_far_end(struct cable *c)
{
    if (c->far)
        far_end_stop(c->far);
    c->far = NULL;
}

static struct array *open_array(struct scratch *s, const struct way *w)
{
    struct error why = {.text = ""};
    struct array *a;
    char uri[600];
    snprintf(uri, sizeof uri, "alsa:%s?stagger=no&rig=%s",
             w->device ? w->device : "hw:Loopback,0,0", cable_rig(s, w));
    if (array_open(&a, uri, clock_system(), &why))
        fail_msg("%s", why.text);
    return a;
}

void cable_open(struct cable *c, const struct way *w)
{
    c->echo = (struct echo){.way = w};
    c->echo.heard = calloc((size_t)HEARD_MAX * w->n_channels, sizeof *c->echo.heard);
    assert_non_null(c->echo.heard);
    cable_start_far_end(c);
    c->array = open_array(c->scratch, w);
}

void cable_close_array(struct cable *c)
{
    if (c->array)
        array_close(c->array);
    c->array = NULL;
}

void cable_close(struct cable *c)
{
    cable_close_array(c);
    cable_stop_far_end(c);
    free(c->echo.heard);
    c->echo.heard = NULL;
}

uint64_t cable_count(const struct cable *c, const char *name)
{
    struct device_count counts[DEVICE_MAX_COUNTS];
    size_t n = array_counts(c->array, counts);
    for (size_t i = 0; i < n; i++)
        if (!strcmp(counts[i].name, name))
            return counts[i].value;
    fail_msg("there is no count %s", name);
    return 0;
}

void cable_check_whole(const struct cable *c)
{
    assert_int_equal(cable_count(c, "restarts"), 0);
    assert_false(far_end_broke(c->far));
}

int cable_setup(void **state)
{
    struct cable *c = calloc(1, sizeof *c);
    if (!c || scratch_open((void **)&c->scratch)) {
        free(c);
        return -1;
    }
    *state = c;
    return 0;
}

int cable_teardown(void **state)
{
    struct cable *c = *state;
    cable_close(c);
    int err = scratch_close((void **)&c->scratch);
    free(c);
    return err;
}

void cable_shoot(struct array *a, struct taken *out)
{
    struct array_shot shot = {.speakers = cable_order, .n_speakers = SPEAKERS};
    struct error why = {.text = ""};
    struct array_ping ping;
    assert_int_equal(array_fire(a, &shot), 0);
    for (size_t j = 0; j < SPEAKERS; j++) {
        if (array_next(a, &ping, &why))
            fail_msg("%s", why.text);
        assert_true(ping.valid);
        assert_true(ping.n_samples <= N_SAMPLES_MAX);
        out[j].n_samples = ping.n_samples;
        for (size_t m = 0; m < MICROPHONES; m++)
            memcpy(out[j].samples[m], ping.samples + m * ping.n_samples,
                   ping.n_samples * sizeof(float));
    }
    assert_int_equal(array_next(a, &ping, &why), -ENODATA);
}
