/* SPDX-License-Identifier: MIT */
/* Surveys to messages and back, and messages that are none. */
#include "msgs/convert.h"
#include "tests/recon/survey_example.h"

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

static void a_survey_comes_back_from_its_message(void **state)
{
    (void)state;
    struct survey s = example(), back;
    struct error why = {""};
    Anlos__Survey *m = message_of(&s);
    assert_int_equal(survey_from_message(&back, m, &why), 0);
    anlos__survey__free_unpacked(m, NULL); /* the copy owns its arrays */
    assert_surveys_equal(&s, &back);
    assert_true(survey_id(&s) == survey_id(&back));
    survey_clear(&back);
}

static void places_and_replica_come_back_too(void **state)
{
    (void)state;
    struct survey s = foreign_example(), back, copy;
    struct error why = {""};
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

static void alternating_chirps_and_shared_slots_come_back_from_a_message(void **state)
{
    (void)state;
    struct survey s = example(), back;
    uint8_t *bytes;
    size_t size;
    s.chirp_alternates = true;
    s.together = 2;
    s.continuous = true;
    assert_int_equal(survey_pack(&s, &bytes, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    assert_non_null(m);
    assert_int_equal(survey_from_message(&back, m, NULL), 0);
    anlos__survey__free_unpacked(m, NULL);
    assert_true(back.chirp_alternates);
    assert_int_equal(back.together, 2);
    assert_true(back.continuous);
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
    s.wall_ends_m[1][0] = -1.5;
    s.wall_ends_m[1][1] = 2.25;
    assert_int_equal(survey_pack(&s, &bytes, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    assert_non_null(m);
    assert_int_equal(survey_from_message(&back, m, NULL), 0);
    assert_int_equal(back.n_walls, 2);
    assert_same(back.walls[1].normal, s.walls[1].normal, 3);
    assert_true(back.walls[1].distance_m == 2.5 && back.walls[1].gate_m[1] == 3);
    assert_same(back.wall_ends_m[1], s.wall_ends_m[1], 2);
    assert_true(back.wall_ends_m[0][0] == 0 && back.wall_ends_m[0][1] == 0);
    survey_clear(&back);
    m->n_wall_ends = 3;
    assert_int_equal(survey_from_message(&back, m, NULL), -EINVAL);
    m->n_wall_ends = 4;
    m->wall_ends[2] = 3.0; /* from behind to */
    assert_int_equal(survey_from_message(&back, m, NULL), -EINVAL);
    m->wall_ends[2] = -1.5;
    m->n_walls = 7;
    assert_int_equal(survey_from_message(&back, m, NULL), -EINVAL);
    m->n_walls = 12;
    anlos__survey__free_unpacked(m, NULL);
    s.walls[0].distance_m += 0.1; /* then it is not the wall */
    assert_int_equal(survey_check(&s, NULL), -EINVAL);
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
        struct error why = {""};
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
    struct error why = {""};
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_survey_comes_back_from_its_message),
        cmocka_unit_test(places_and_replica_come_back_too),
        cmocka_unit_test(a_survey_of_the_least_comes_back_too),
        cmocka_unit_test(alternating_chirps_and_shared_slots_come_back_from_a_message),
        cmocka_unit_test(several_walls_come_back_from_a_message),
        cmocka_unit_test(a_bad_survey_is_not_packed),
        cmocka_unit_test(a_damaged_message_is_refused_and_leaves_nothing),
        cmocka_unit_test(a_message_with_too_many_elements_is_refused),
        cmocka_unit_test(a_message_cut_at_any_length_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
