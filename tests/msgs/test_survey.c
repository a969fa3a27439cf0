#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/survey.h"

/* Borrows static arrays: not to be cleared. */
static struct survey example(void)
{
    static double speakers[2][3], microphones[3][3], positions[4];
    static double frequencies[3][3], gains[3][3];
    static struct survey_response responses[3];
    for (int i = 0; i < 2; i++)
        memcpy(speakers[i], (double[3]){0.1, 0.06 * i, -0.02}, sizeof speakers[i]);
    for (int i = 0; i < 3; i++) {
        memcpy(microphones[i], (double[3]){-0.1, 0.03 + 0.06 * i, 0.01 / 3},
               sizeof microphones[i]);
        snprintf(responses[i].serial, sizeof responses[i].serial, "mic-%d", i);
        responses[i].n_points = 3;
        responses[i].frequency_hz = memcpy(
            frequencies[i], (double[3]){100, 1000.5, 20000}, sizeof frequencies[i]);
        responses[i].gain_db =
            memcpy(gains[i], (double[3]){-1.5, 0, 0.1 * i}, sizeof gains[i]);
    }
    memcpy(positions, (double[4]){0, 0.03, 0.06, 0.09}, sizeof positions);
    return (struct survey){
        .source = ANLOS__SOURCE__SIMULATION,
        .sound_speed_m_s = 343.2,
        .temperature_c = 20.25,
        .sample_rate_hz = 48000,
        .chirp_start_hz = 2000,
        .chirp_stop_hz = 20000,
        .chirp_duration_s = 0.0625,
        .chirp_sine = true,
        .slot_samples = 3000,
        .latency_samples = 17.5,
        .n_speakers = 2,
        .n_microphones = 3,
        .n_positions = 4,
        .speakers_m = speakers,
        .microphones_m = microphones,
        .stage_axis = {1, 0, 0},
        .stage_positions_m = positions,
        .has_gate = true,
        .gate_m = {0.5, 4},
        .has_volume = true,
        .volume_m = {{-1, 1, 0.01}, {-0.5, 0.5, 0.02}, {1, 3, 0.005}},
        .has_wall = true,
        .wall_normal = {0.6, 0, 0.8},
        .wall_distance_m = 1.25,
        .has_mount = true,
        .mount_origin_m = {3.5, 0.25, 0.5},
        .mount_x_axis = {0, 1, 0},
        .mount_y_axis = {0, 0, 1},
        .n_responses = 3,
        .responses = responses,
    };
}

static Anlos__Survey *message_of(const struct survey *s)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    assert_int_equal(survey_pack(s, &bytes, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    assert_non_null(m);
    return m;
}

static void assert_same(const void *a, const void *b, size_t n_doubles)
{
    assert_memory_equal(a, b, n_doubles * sizeof(double));
}

static void assert_surveys_equal(const struct survey *a, const struct survey *b)
{
    assert_int_equal(a->source, b->source);
    assert_same(&a->sound_speed_m_s, &b->sound_speed_m_s, 1);
    assert_true(a->temperature_c == b->temperature_c ||
                (isnan(a->temperature_c) && isnan(b->temperature_c)));
    assert_same(&a->sample_rate_hz, &b->sample_rate_hz, 1);
    assert_same(&a->chirp_start_hz, &b->chirp_start_hz, 1);
    assert_same(&a->chirp_stop_hz, &b->chirp_stop_hz, 1);
    assert_same(&a->chirp_duration_s, &b->chirp_duration_s, 1);
    assert_int_equal(a->chirp_sine, b->chirp_sine);
    assert_int_equal(a->slot_samples, b->slot_samples);
    assert_same(&a->latency_samples, &b->latency_samples, 1);
    assert_int_equal(a->n_speakers, b->n_speakers);
    assert_same(a->speakers_m, b->speakers_m, 3 * a->n_speakers);
    assert_int_equal(a->n_microphones, b->n_microphones);
    assert_same(a->microphones_m, b->microphones_m, 3 * a->n_microphones);
    assert_same(a->stage_axis, b->stage_axis, 3);
    assert_int_equal(a->n_positions, b->n_positions);
    assert_same(a->stage_positions_m, b->stage_positions_m, a->n_positions);
    assert_int_equal(a->has_gate, b->has_gate);
    assert_same(a->gate_m, b->gate_m, 2);
    assert_int_equal(a->has_volume, b->has_volume);
    assert_same(a->volume_m, b->volume_m, 9);
    assert_int_equal(a->has_wall, b->has_wall);
    assert_same(a->wall_normal, b->wall_normal, 3);
    assert_same(&a->wall_distance_m, &b->wall_distance_m, 1);
    assert_int_equal(a->has_mount, b->has_mount);
    assert_same(a->mount_origin_m, b->mount_origin_m, 3);
    assert_same(a->mount_x_axis, b->mount_x_axis, 3);
    assert_same(a->mount_y_axis, b->mount_y_axis, 3);
    assert_int_equal(a->n_responses, b->n_responses);
    for (size_t i = 0; i < a->n_responses; i++) {
        const struct survey_response *p = &a->responses[i], *q = &b->responses[i];
        assert_string_equal(p->serial, q->serial);
        assert_int_equal(p->n_points, q->n_points);
        assert_same(p->frequency_hz, q->frequency_hz, p->n_points);
        assert_same(p->gain_db, q->gain_db, p->n_points);
    }
}

/* One speaker, one microphone, places ping by ping, and a replica. */
static struct survey foreign_example(void)
{
    static double pings[5000][2][3];
    static double zeros[5000];
    static float replica[100];
    struct survey s = example();
    for (int k = 0; k < 5000; k++)
        for (int c = 0; c < 6; c++)
            pings[k][c / 3][c % 3] = 0.001 * k + 0.1 * c;
    for (int i = 0; i < 100; i++)
        replica[i] = 0.01f * (float)(i - 50);
    s.n_speakers = s.n_microphones = 1;
    s.n_responses = 0;
    s.n_positions = 5000; /* more than a stage may have */
    s.stage_positions_m = zeros;
    s.pings_m = pings;
    s.n_replica = 100;
    s.replica = replica;
    return s;
}

static void places_and_replica_come_back_too(void **state)
{
    (void)state;
    struct survey s = foreign_example(), back, copy;
    struct complaint why = {""};
    Anlos__Survey *m = message_of(&s);
    if (survey_from_message(&back, m, &why))
        fail_msg("%s", why.text);
    assert_int_equal(survey_copy(&copy, &back), 0);
    survey_clear(&back);
    assert_int_equal(copy.n_positions, 5000);
    assert_memory_equal(copy.pings_m, s.pings_m, 5000 * sizeof *s.pings_m);
    assert_int_equal(copy.n_replica, 100);
    assert_memory_equal(copy.replica, s.replica, 100 * sizeof *s.replica);
    assert_true(survey_id(&copy) == survey_id(&s));
    copy.pings_m[4999][1][2] += 1e-9;
    assert_false(survey_id(&copy) == survey_id(&s));
    copy.pings_m[4999][1][2] = s.pings_m[4999][1][2];
    copy.replica[7] += 1e-6f;
    assert_false(survey_id(&copy) == survey_id(&s));
    survey_clear(&copy);
    m->n_pings_m -= 6; /* one place short */
    assert_int_equal(survey_from_message(&back, m, &why), -EINVAL);
    assert_non_null(strstr(why.text, "pings_m"));
    anlos__survey__free_unpacked(m, NULL);
}

static void places_and_replica_are_checked(void **state)
{
    (void)state;
    struct complaint why;
    struct survey s = foreign_example();
    s.n_microphones = 2;
    assert_int_equal(survey_check(&s, &why), -EINVAL);
    assert_non_null(strstr(why.text, "one speaker and one microphone"));
    s = foreign_example();
    s.pings_m[17][0][1] = NAN;
    assert_int_equal(survey_check(&s, &why), -EINVAL);
    assert_non_null(strstr(why.text, "pings speaker[17]"));
    s.pings_m[17][0][1] = 0;
    s.replica[3] = INFINITY;
    assert_int_equal(survey_check(&s, &why), -EINVAL);
    assert_non_null(strstr(why.text, "replica sample 3"));
    s.replica[3] = 0;
    s.n_replica = s.slot_samples + 1;
    assert_int_equal(survey_check(&s, &why), -EINVAL);
    assert_non_null(strstr(why.text, "replica has 3001 samples"));
}

static void a_survey_comes_back_from_its_message(void **state)
{
    (void)state;
    struct survey s = example(), back;
    struct complaint why = {""};
    Anlos__Survey *m = message_of(&s);
    assert_int_equal(survey_from_message(&back, m, &why), 0);
    anlos__survey__free_unpacked(m, NULL); /* the copy owns its arrays */
    assert_surveys_equal(&s, &back);
    assert_true(survey_id(&s) == survey_id(&back));
    survey_clear(&back);
}

static void a_survey_of_the_least_comes_back_too(void **state)
{
    (void)state;
    struct survey s = example(), back;
    s.has_gate = s.has_volume = s.has_wall = s.has_mount = false;
    memset(s.gate_m, 0, sizeof s.gate_m);
    memset(s.volume_m, 0, sizeof s.volume_m);
    memset(s.wall_normal, 0, sizeof s.wall_normal);
    s.wall_distance_m = 0;
    memset(s.mount_origin_m, 0, sizeof s.mount_origin_m);
    memset(s.mount_x_axis, 0, sizeof s.mount_x_axis);
    memset(s.mount_y_axis, 0, sizeof s.mount_y_axis);
    s.n_responses = 0;
    s.responses = NULL;
    s.n_speakers = s.n_microphones = s.n_positions = 1;
    s.temperature_c = NAN;
    Anlos__Survey *m = message_of(&s);
    assert_int_equal(survey_from_message(&back, m, NULL), 0);
    anlos__survey__free_unpacked(m, NULL);
    assert_surveys_equal(&s, &back);
    survey_clear(&back);
}

static void a_copy_is_equal_and_its_own(void **state)
{
    (void)state;
    struct survey s = example(), copy;
    assert_int_equal(survey_copy(&copy, &s), 0);
    assert_surveys_equal(&s, &copy);
    assert_ptr_not_equal(copy.speakers_m, s.speakers_m);
    assert_ptr_not_equal(copy.responses[0].gain_db, s.responses[0].gain_db);
    survey_clear(&copy);
    assert_null(copy.speakers_m);
    assert_int_equal(copy.n_responses, 0);
    survey_clear(&copy);
}

struct change { /* one number of the example, and what is said about it */
    size_t offset;
    double value;
    const char *says; /* NULL: still a good survey */
};

#define AT(field) offsetof(struct survey, field)

static const struct change numbers[] = {
    {AT(sound_speed_m_s), 299.9, "sound_speed_m_s"},
    {AT(sound_speed_m_s), 360.1, "300 to 360"},
    {AT(sound_speed_m_s), NAN, "sound_speed_m_s"},
    {AT(sound_speed_m_s), 300, NULL},
    {AT(sound_speed_m_s), 360, NULL},
    {AT(temperature_c), 81, "temperature_c"},
    {AT(temperature_c), -INFINITY, "temperature_c"},
    {AT(temperature_c), NAN, NULL},
    {AT(sample_rate_hz), 7999, "sample_rate_hz"},
    {AT(sample_rate_hz), 400001, "sample_rate_hz"},
    {AT(sample_rate_hz), 40000, "stop_hz is 20000"}, /* at Nyquist, not inside it */
    {AT(chirp_start_hz), 0, "start_hz"},
    {AT(chirp_start_hz), NAN, "start_hz"},
    {AT(chirp_start_hz), 20000, "both"},
    {AT(chirp_start_hz), 23999, NULL}, /* a falling chirp */
    {AT(chirp_stop_hz), 24000, "stop_hz"},
    {AT(chirp_duration_s), 0, "duration_s"},
    {AT(chirp_duration_s), -1, "duration_s"},
    {AT(chirp_duration_s), 1.0001, "duration_s"}, /* over 16 slots */
    {AT(chirp_duration_s), NAN, "duration_s"},
    {AT(latency_samples), -0.5, "latency_samples"},
    {AT(latency_samples), 3000, "latency_samples"},
    {AT(latency_samples), 2999.5, NULL},
    {AT(latency_samples), NAN, "latency_samples"},
    {AT(stage_axis[0]), 1.0011, "stage axis"},
    {AT(stage_axis[0]), 1.0009, NULL},
    {AT(stage_axis[1]), NAN, "stage axis"},
    {AT(gate_m[0]), -0.1, "gate_m"},
    {AT(gate_m[0]), 4, "near < far"},
    {AT(gate_m[0]), NAN, "gate_m"},
    {AT(gate_m[1]), 10.72, NULL}, /* 0.0625 s * 343.2 m/s / 2 = 10.725 m */
    {AT(gate_m[1]), 10.73, "gate beyond the slot"},
    {AT(gate_m[1]), INFINITY, "gate_m"},
    {AT(volume_m[0][0]), 1.5, "x_m"},
    {AT(volume_m[1][2]), 0, "y_m"},
    {AT(volume_m[2][2]), -0.1, "z_m"},
    {AT(volume_m[2][1]), NAN, "z_m"},
    {AT(volume_m[2][2]), 1e-5, "200000 steps"},
    {AT(volume_m[0][1]), -1, NULL}, /* a plane */
    {AT(wall_normal[0]), 0.7, "wall normal"},
    {AT(wall_distance_m), 1001, "wall distance_m"},
    {AT(wall_distance_m), NAN, "wall distance_m"},
    {AT(mount_origin_m[2]), -1001, "mount origin_m"},
    {AT(mount_x_axis[1]), 0.5, "mount x_axis"},
    {AT(mount_y_axis[2]), 2, "mount y_axis"},
};

static void each_number_out_of_range_is_refused_by_name(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        const struct change *c = &numbers[i];
        struct survey s = example();
        struct complaint why = {""};
        memcpy((char *)&s + c->offset, &c->value, sizeof c->value);
        int err = survey_check(&s, &why);
        if (c->says && (err != -EINVAL || !strstr(why.text, c->says)))
            fail_msg("change %zu: %d, \"%s\", expected \"%s\"", i, err, why.text,
                     c->says);
        if (!c->says && err)
            fail_msg("change %zu: refused: %s", i, why.text);
    }
}

static void parts_that_are_not_there_are_not_checked(void **state)
{
    (void)state;
    struct survey s = example();
    s.has_gate = s.has_volume = s.has_wall = s.has_mount = false;
    s.gate_m[1] = s.volume_m[0][0] = s.wall_normal[0] = s.mount_x_axis[0] = NAN;
    assert_int_equal(survey_check(&s, NULL), 0);
}

static void assert_refused(const struct survey *s, const char *says)
{
    struct complaint why = {""};
    assert_int_equal(survey_check(s, &why), -EINVAL);
    if (!strstr(why.text, says))
        fail_msg("\"%s\" does not say \"%s\"", why.text, says);
}

/* Each list is of a length that it may have, all together would take days. */
static void more_paths_than_can_be_planned_for_are_refused(void **state)
{
    (void)state;
    static double elements[SURVEY_MAX_ELEMENTS][3], positions[SURVEY_MAX_ELEMENTS];
    struct survey s = example();
    s.speakers_m = s.microphones_m = elements;
    s.stage_positions_m = positions;
    s.n_responses = 0;
    s.n_speakers = s.n_microphones = s.n_positions = 256;
    assert_int_equal(survey_check(&s, NULL), 0);
    s.n_positions = 257;
    assert_refused(&s, "257 positions; expected at most 16777216 paths");
    s.n_speakers = s.n_microphones = s.n_positions = SURVEY_MAX_ELEMENTS;
    assert_refused(&s, "expected at most 16777216 paths");
}

static void counts_and_lists_are_refused_by_name(void **state)
{
    (void)state;
    struct survey s = example();
    s.slot_samples = 0;
    assert_refused(&s, "slot_samples");
    s = example();
    s.slot_samples = SIZE_MAX;
    assert_refused(&s, "slot_samples");
    s = example();
    s.n_speakers = 0;
    assert_refused(&s, "speakers_m");
    s = example();
    s.n_microphones = SURVEY_MAX_ELEMENTS + 1;
    assert_refused(&s, "microphones_m");
    s = example();
    s.stage_positions_m = NULL;
    assert_refused(&s, "positions_m");
    s = example();
    s.speakers_m[1][2] = NAN;
    assert_refused(&s, "speakers_m[1]");
    s = example();
    s.microphones_m[2][0] = 1001;
    assert_refused(&s, "microphones_m[2]");
    s = example();
    s.stage_positions_m[3] = INFINITY;
    assert_refused(&s, "positions_m[3]");
    s = example();
    s.source = (Anlos__Source)7;
    assert_refused(&s, "source");
    s = example();
    s.mount_y_axis[1] = 0.6; /* still a unit vector */
    s.mount_y_axis[2] = 0.8;
    assert_refused(&s, "right angles");
}

static void calibration_is_refused_by_serial(void **state)
{
    (void)state;
    struct survey s = example();
    s.n_responses = 2;
    assert_refused(&s, "one for each of the 3");
    s = example();
    s.responses[1].n_points = 1;
    assert_refused(&s, "mic-1");
    s = example();
    s.responses[2].frequency_hz[2] = 1000.5;
    assert_refused(&s, "mic-2: frequency 2");
    s = example();
    s.responses[0].frequency_hz[0] = -1;
    assert_refused(&s, "mic-0: frequency 0");
    s = example();
    s.responses[0].gain_db[1] = NAN;
    assert_refused(&s, "mic-0: gain 1");
    s = example();
    memset(s.responses[0].serial, 'x', sizeof s.responses[0].serial);
    assert_refused(&s, "does not end");
}

static void a_bad_survey_is_not_packed(void **state)
{
    (void)state;
    struct survey s = example();
    uint8_t *bytes = NULL;
    size_t size = 0;
    s.sample_rate_hz = 0;
    assert_int_equal(survey_pack(&s, &bytes, &size), -EINVAL);
    assert_null(bytes);
}

static void the_id_changes_with_every_number(void **state)
{
    (void)state;
    const struct survey original = example();
    const uint64_t id = survey_id(&original);
    assert_true(id != 0);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        struct survey s = example();
        memcpy((char *)&s + numbers[i].offset, &numbers[i].value, sizeof(double));
        assert_true((survey_id(&s) != id) == (numbers[i].offset != AT(temperature_c)));
    }
    struct survey s = example();
    s.chirp_sine = false;
    assert_true(survey_id(&s) != id);
    s = example();
    s.slot_samples++;
    assert_true(survey_id(&s) != id);
    s = example();
    s.n_positions--;
    assert_true(survey_id(&s) != id);
    s = example();
    s.has_wall = false;
    assert_true(survey_id(&s) != id);
    s = example();
    s.microphones_m[1][1] = nextafter(s.microphones_m[1][1], 1);
    assert_true(survey_id(&s) != id);
    s = example();
    s.responses[2].gain_db[1] = 1e-9;
    assert_true(survey_id(&s) != id);
    s = example();
    s.responses[2].serial[0] = 'M';
    assert_true(survey_id(&s) != id);
}

/* What it was before surveys had alternating chirps and shared slots: bags have it. */
static void an_old_surveys_id_stays(void **state)
{
    (void)state;
    struct survey s = example();
    assert_true(survey_id(&s) == UINT64_C(0x43b31253f187fcd8));
    s.together = 1;
    assert_true(survey_id(&s) == UINT64_C(0x43b31253f187fcd8));
    s.chirp_alternates = true;
    const uint64_t alternating = survey_id(&s);
    assert_true(alternating != UINT64_C(0x43b31253f187fcd8));
    s.together = 2;
    assert_true(survey_id(&s) != alternating);
}

static void alternating_chirps_and_shared_slots_come_back_from_a_message(void **state)
{
    (void)state;
    struct survey s = example(), back;
    uint8_t *bytes;
    size_t size;
    s.chirp_alternates = true;
    s.together = 2;
    assert_int_equal(survey_pack(&s, &bytes, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    assert_non_null(m);
    assert_int_equal(survey_from_message(&back, m, NULL), 0);
    anlos__survey__free_unpacked(m, NULL);
    assert_true(back.chirp_alternates);
    assert_int_equal(back.together, 2);
    survey_clear(&back);
}

static void several_walls_come_back_from_a_message(void **state)
{
    (void)state;
    struct survey s = example(), back;
    uint8_t *bytes;
    size_t size;
    s.n_walls = 2;
    memcpy(s.walls[0].normal, s.wall_normal, sizeof s.wall_normal);
    s.walls[0].distance_m = s.wall_distance_m;
    s.walls[0].gate_m[1] = 4;
    s.walls[1] = (struct survey_wall){{1, 0, 0}, 2.5, {2, 3}};
    assert_int_equal(survey_pack(&s, &bytes, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    assert_non_null(m);
    assert_int_equal(survey_from_message(&back, m, NULL), 0);
    assert_int_equal(back.n_walls, 2);
    assert_same(back.walls[1].normal, s.walls[1].normal, 3);
    assert_true(back.walls[1].distance_m == 2.5 && back.walls[1].gate_m[1] == 3);
    survey_clear(&back);
    m->n_walls = 7;
    assert_int_equal(survey_from_message(&back, m, NULL), -EINVAL);
    m->n_walls = 12;
    anlos__survey__free_unpacked(m, NULL);
    s.walls[0].distance_m += 0.1; /* then it is not the wall */
    assert_int_equal(survey_check(&s, NULL), -EINVAL);
}

/* 24 ms of 62.5: the gate has to end 0.1 m before the next speaker is heard at 4.118 m.
 */
static void a_slot_shorter_than_the_chirp_needs_a_gate_within_it(void **state)
{
    (void)state;
    struct survey s = example();
    assert_false(survey_overlaps(&s));
    s.slot_samples = 1152;
    assert_true(survey_overlaps(&s));
    s.gate_m[1] = 4.0;
    assert_int_equal(survey_check(&s, NULL), 0);
    s.gate_m[1] = 4.03;
    assert_refused(&s, "before the next speaker is heard");
    s.has_gate = false;
    assert_refused(&s, "gate_m");
}

static void only_opposite_chirps_sound_together(void **state)
{
    (void)state;
    struct survey s = example();
    s.together = 2;
    assert_refused(&s, "together");
    s.chirp_alternates = true;
    assert_int_equal(survey_check(&s, NULL), 0);
    s.together = 3;
    assert_refused(&s, "together is 3");
}

static void emissions_share_slots_and_alternate_by_their_order(void **state)
{
    (void)state;
    struct survey s = example();
    assert_int_equal(survey_slot_of(&s, 5), 5);
    assert_int_equal(survey_slots(&s, 5), 5);
    assert_int_equal(survey_slots(&s, 0), 0);
    assert_false(survey_is_down(&s, 1));
    s.chirp_alternates = true;
    s.together = 2;
    assert_int_equal(survey_slot_of(&s, 4), 2);
    assert_int_equal(survey_slot_of(&s, 5), 2);
    assert_int_equal(survey_slots(&s, 5), 3);
    assert_true(survey_is_down(&s, 5) && !survey_is_down(&s, 4));
    /* 62.5 ms are not over after two slots of 24 ms. */
    s.slot_samples = 1152;
    assert_false(survey_round_fits(&s, 4));
    assert_true(survey_round_fits(&s, 6));
}

static void the_id_does_not_depend_on_the_source_or_the_sign_of_zero(void **state)
{
    (void)state;
    struct survey s = example();
    const uint64_t id = survey_id(&s);
    s.source = ANLOS__SOURCE__REPLAY;
    s.temperature_c = NAN;
    s.stage_axis[1] = -0.0;
    assert_true(survey_id(&s) == id);
}

typedef void damage(Anlos__Survey *m);

static void lose_axis(Anlos__Survey *m)
{
    anlos__vec3__free_unpacked(m->stage_axis, NULL);
    m->stage_axis = NULL;
}

static void lose_normal(Anlos__Survey *m)
{
    anlos__vec3__free_unpacked(m->wall_normal, NULL);
    m->wall_normal = NULL;
}

static void lose_mount(Anlos__Survey *m)
{
    anlos__vec3__free_unpacked(m->mount_y_axis, NULL);
    m->mount_y_axis = NULL;
}

static void lose_volume(Anlos__Survey *m)
{
    m->n_volume = 8;
}

static void lose_gain(Anlos__Survey *m)
{
    m->responses[1]->n_gain_db--;
}

static void lengthen_serial(Anlos__Survey *m)
{
    free(m->responses[0]->serial);
    m->responses[0]->serial = strdup("a serial of thirty-two characters");
}

static void change_id(Anlos__Survey *m)
{
    m->id++;
}

static void change_number(Anlos__Survey *m)
{
    m->speakers_m[1]->x += 0.001;
}

static void lose_half_of_the_gate(Anlos__Survey *m)
{
    m->gate_far_m = NAN;
}

static void a_damaged_message_is_refused_and_leaves_nothing(void **state)
{
    (void)state;
    static const struct {
        damage *apply;
        const char *says;
    } cases[] = {
        {lose_axis, "stage_axis is missing"},
        {lose_normal, "wall_normal is missing"},
        {lose_mount, "mount_y_axis"},
        {lose_volume, "expected 9"},
        {lose_gain, "mic-1"},
        {lengthen_serial, "serial"},
        {change_id, "is not that of its"},
        {change_number, "is not that of its"},
        {lose_half_of_the_gate, "gate_m"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct survey s = example(), back;
        struct complaint why = {""};
        Anlos__Survey *m = message_of(&s);
        cases[i].apply(m);
        assert_int_equal(survey_from_message(&back, m, &why), -EINVAL);
        if (!strstr(why.text, cases[i].says))
            fail_msg("\"%s\" does not say \"%s\"", why.text, cases[i].says);
        assert_null(back.speakers_m);
        assert_null(back.responses);
        anlos__survey__free_unpacked(m, NULL);
    }
}

static void a_message_with_too_many_elements_is_refused(void **state)
{
    (void)state;
    static double positions[SURVEY_MAX_ELEMENTS + 1];
    struct survey s = example(), back;
    struct complaint why = {""};
    Anlos__Survey *m = message_of(&s);
    size_t n = m->n_stage_positions_m;
    double *own = m->stage_positions_m;
    m->stage_positions_m = positions;
    m->n_stage_positions_m = SURVEY_MAX_ELEMENTS + 1;
    assert_int_equal(survey_from_message(&back, m, &why), -EINVAL);
    assert_non_null(strstr(why.text, "stage_positions_m has 4097"));
    m->stage_positions_m = own;
    m->n_stage_positions_m = n;
    anlos__survey__free_unpacked(m, NULL);
}

/* Where protobuf lets a cut message pass, the content no longer has the id. */
static void a_message_cut_at_any_length_is_refused(void **state)
{
    (void)state;
    struct survey s = example(), back;
    uint8_t *bytes;
    size_t size, refused_by_content = 0;
    assert_int_equal(survey_pack(&s, &bytes, &size), 0);
    for (size_t n = 0; n < size; n++) {
        Anlos__Survey *m = anlos__survey__unpack(NULL, n, bytes);
        if (!m)
            continue;
        assert_int_equal(survey_from_message(&back, m, NULL), -EINVAL);
        refused_by_content++;
        anlos__survey__free_unpacked(m, NULL);
    }
    assert_true(refused_by_content > 10);
    free(bytes);
}

/* Against the ideal gas, sqrt(gamma R T / M), another formula than Cramer's. */
static void the_speed_of_sound_is_that_of_dry_air(void **state)
{
    (void)state;
    for (double t = -20; t <= 50; t += 5) {
        double ideal = sqrt(1.4 * 8.314462618 * (t + 273.15) / 28.9647e-3);
        double c = survey_sound_speed_m_s(t);
        assert_true(fabs(c / ideal - 1) < 1e-3);
    }
}

/* The ideal gas again, with the heat and the mass of water vapour; the vapour's pressure
 * by Buck's formula (1981), not by Giacomo's. */
static void humid_air_is_faster_as_its_vapour_is_lighter(void **state)
{
    const double r = 8.314462618;
    (void)state;
    for (double t = 0; t <= 30; t += 5)
        for (double humidity = 0; humidity <= 1; humidity += 0.25) {
            double saturated_pa = 611.21 * exp((18.678 - t / 234.5) * (t / (257.14 + t)));
            double x = humidity * saturated_pa / 101325;
            double heat = (1 - x) * 29.12 + x * 33.58;
            double mass = (1 - x) * 28.9655e-3 + x * 18.0153e-3;
            double ideal = sqrt(heat / (heat - r) * r * (t + 273.15) / mass);
            double c = survey_humid_sound_speed_m_s(t, humidity);
            assert_true(fabs(c / ideal - 1) < 6e-4);
            double dry = sqrt(29.12 / (29.12 - r) * r * (t + 273.15) / 28.9655e-3);
            assert_true(fabs(c / survey_sound_speed_m_s(t) - ideal / dry) < 1.5e-4);
        }
}

/* Looking along the vehicle's x: array x to the left, y up, z ahead. */
static void array_coordinates_become_vehicle_coordinates(void **state)
{
    (void)state;
    struct survey s = example();
    double p[3] = {1, 2, 3};
    survey_to_vehicle(&s, p, p);
    assert_true(p[0] == 3.5 + 3 && p[1] == 0.25 + 1 && p[2] == 0.5 + 2);
    const double q[3] = {1, 2, 3};
    double out[3];
    s.has_mount = false;
    survey_to_vehicle(&s, q, out);
    assert_memory_equal(out, q, sizeof q);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_survey_comes_back_from_its_message),
        cmocka_unit_test(places_and_replica_come_back_too),
        cmocka_unit_test(places_and_replica_are_checked),
        cmocka_unit_test(a_survey_of_the_least_comes_back_too),
        cmocka_unit_test(a_copy_is_equal_and_its_own),
        cmocka_unit_test(each_number_out_of_range_is_refused_by_name),
        cmocka_unit_test(parts_that_are_not_there_are_not_checked),
        cmocka_unit_test(more_paths_than_can_be_planned_for_are_refused),
        cmocka_unit_test(counts_and_lists_are_refused_by_name),
        cmocka_unit_test(calibration_is_refused_by_serial),
        cmocka_unit_test(a_bad_survey_is_not_packed),
        cmocka_unit_test(the_id_changes_with_every_number),
        cmocka_unit_test(an_old_surveys_id_stays),
        cmocka_unit_test(alternating_chirps_and_shared_slots_come_back_from_a_message),
        cmocka_unit_test(several_walls_come_back_from_a_message),
        cmocka_unit_test(a_slot_shorter_than_the_chirp_needs_a_gate_within_it),
        cmocka_unit_test(only_opposite_chirps_sound_together),
        cmocka_unit_test(emissions_share_slots_and_alternate_by_their_order),
        cmocka_unit_test(the_id_does_not_depend_on_the_source_or_the_sign_of_zero),
        cmocka_unit_test(a_damaged_message_is_refused_and_leaves_nothing),
        cmocka_unit_test(a_message_with_too_many_elements_is_refused),
        cmocka_unit_test(a_message_cut_at_any_length_is_refused),
        cmocka_unit_test(the_speed_of_sound_is_that_of_dry_air),
        cmocka_unit_test(humid_air_is_faster_as_its_vapour_is_lighter),
        cmocka_unit_test(array_coordinates_become_vehicle_coordinates),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
