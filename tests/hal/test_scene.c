/* SPDX-License-Identifier: MIT */
/* What a scene file may say, and the truth that comes of it. */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/room/room.h"

#define SCENE                                                                            \
    "array: paper\n"                                                                     \
    "temperature_c: 20\n"                                                                \
    "wall: {normal: [1, 0, 1], distance_m: 1.131370849898476}\n"

static struct room *load(void **state, const char *text)
{
    struct error why = {.text = ""};
    struct room *r;
    if (room_load(&r, scratch_write(*state, "scene.yaml", text), &why))
        fail_msg("%s", why.text);
    return r;
}

/* Lindell 2019, section 4. */
static void the_papers_array_has_its_measures(void **state)
{
    struct room *r = load(state, SCENE);
    const struct survey *s = room_survey(r);
    assert_int_equal(s->source, SURVEY_SIMULATION);
    assert_int_equal(s->n_speakers, 16);
    assert_int_equal(s->n_microphones, 16);
    assert_int_equal(s->n_positions, 32);
    assert_true(s->sample_rate_hz == 48000 && s->slot_samples == 3000);
    assert_true(s->chirp_start_hz == 2000 && s->chirp_stop_hz == 20000);
    assert_true(s->chirp_duration_s == 0.0625);
    for (int i = 0; i < 16; i++) {
        assert_true(s->speakers_m[i][0] == 0 && s->microphones_m[i][0] == 0.08);
        assert_true(fabs(s->speakers_m[i][1] - i / 15.0) < 1e-12);
        assert_true(s->speakers_m[i][1] == s->microphones_m[i][1]);
    }
    assert_true(s->stage_positions_m[31] == 1 && s->stage_axis[0] == 1);
    assert_int_equal(room_frames(r, 16), 16 * 3000 + room_tail(r));
    room_destroy(r);
}

/* The wall is x + z = 1.6: what is at (x, y, z) is imaged at (1.6 - z, y, 1.6 - x). */
static void objects_know_where_they_are_imaged(void **state)
{
    struct room *r = load(
        state, SCENE "objects:\n"
                     "  - {name: a, kind: point, position_m: [-1, 0.5, 1.2], "
                     "scattering_length_m: 0.1}\n"
                     "  - {name: b, kind: letter, letter: L, size_m: [0.2, 0.3], "
                     "stroke_m: 0.05, position_m: [-1.2, 0.4, 1], facing: [1, 0, 0]}\n"
                     "  - {name: c, kind: polygon, outline_m: [[0, 0], [0.4, 0], "
                     "[0, 0.2]], position_m: [-1, 0, 1], facing: [1, 0, 0]}\n");
    const struct room_object *o;
    assert_int_equal(room_objects(r, &o), 3);
    static const double virtual_m[3][3] = {
        {0.4, 0.5, 2.6}, {0.6, 0.4, 2.8}, {0.8, 0.1, 2.6}};
    static const double extent_m[3][3] = {{0, 0, 0}, {0, 0.3, 0.2}, {0, 0.2, 0.4}};
    static const char *const names[] = {"a", "b", "c"};
    static const char *const kinds[] = {"point", "letter", "polygon"};
    for (int i = 0; i < 3; i++) {
        assert_string_equal(o[i].name, names[i]);
        assert_string_equal(o[i].kind, kinds[i]);
        for (int a = 0; a < 3; a++)
            assert_true(fabs(o[i].extent_m[a] - extent_m[i][a]) < 1e-9);
    }
    for (int a = 0; a < 3; a++) {
        assert_true(fabs(o[0].virtual_m[a] - virtual_m[0][a]) < 1e-9);
        assert_true(fabs(o[1].virtual_m[a] - virtual_m[1][a]) < 1e-9);
    }
    /* The middle of the triangle's box: 0.2 to the right of position_m as its front is
     * seen, that is along -z, and 0.1 up. */
    assert_true(fabs(o[2].position_m[2] - 0.8) < 1e-9);
    assert_true(fabs(o[2].position_m[1] - 0.1) < 1e-9);
    room_destroy(r);
}

/* The survey tells of all; the room mirrors at the first. */
static void of_several_walls_the_room_has_the_first(void **state)
{
    struct room *r = load(state,
                          "array: bumper\ntemperature_c: 20\ngate_m: [1, 4]\n"
                          "walls:\n"
                          "  - {normal: [0, 0, 1], distance_m: 2, gate_m: [1, 3]}\n"
                          "  - {normal: [1, 0, 0], distance_m: 3, gate_m: [3, 4]}\n"
                          "objects:\n"
                          "  - {name: point, kind: point, position_m: [0.5, 0, 1],\n"
                          "     scattering_length_m: 0.1}\n");
    const struct room_object *o;

    assert_int_equal(room_survey(r)->n_walls, 2);
    assert_int_equal(room_objects(r, &o), 1);
    assert_true(fabs(o->virtual_m[0] - 0.5) <= 1e-9);
    assert_true(fabs(o->virtual_m[2] - 3.0) <= 1e-9);
    room_destroy(r);
}

static void wrong_scenes_are_named_with_line_and_key(void **state)
{
    static const struct {
        const char *text, *place, *part;
    } cases[] = {
        {SCENE "colour: red\n", "scene.yaml:4: colour: no such key", "objects"},
        {"array: paper\ntemperature_c: 20\n", "scene.yaml:1: ", "\"wall\" is missing"},
        {"temperature_c: 20\nwall: {normal: [0, 0, 1], distance_m: 1}\n",
         "scene.yaml:1: ", "\"speakers_m\" is missing, or \"array: paper\""},
        {SCENE "speakers_m: [[0, 0, 0]]\n",
         "scene.yaml:4: speakers_m: ", "\"array: paper\" says this already"},
        {"array: ring\n", "scene.yaml:1: array: ", "expected one of"},
        {SCENE "level: -1\n", "scene.yaml:4: level: ", "-1 is outside 0..1000"},
        {SCENE "wall_sound: {reflectivity: 2}\n", "scene.yaml:4: wall_sound.reflectivity",
         "2 is outside 0..1"},
        {SCENE "noise: {snr_db: 30}\n", "scene.yaml:4: noise.snr_db: ", "no objects"},
        {SCENE "noise:\n  snr_db: 30\n  rms: 1\n",
         "scene.yaml:6: noise.rms: ", "found both"},
        {SCENE "objects:\n  - {name: a, kind: ball, position_m: [0, 0, 0]}\n",
         "scene.yaml:5: objects[0].kind: ", "found \"ball\""},
        {SCENE "objects:\n  - {name: a, kind: point, position_m: [0, 0, 0.5]}\n",
         "scene.yaml:5: ", "a point needs the key \"scattering_length_m\""},
        {SCENE "objects:\n  - name: a\n    kind: point\n    position_m: [0, 0, 0.5]\n"
               "    scattering_length_m: 1\n    side_m: 1\n",
         "scene.yaml:9: objects[0].side_m: ", "a point does not have this"},
        {SCENE "objects:\n  - name: a\n    kind: letter\n    position_m: [0, 0, 0.5]\n"
               "    letter: X\n    size_m: [0.2, 0.3]\n    stroke_m: 0.05\n",
         "scene.yaml:8: objects[0].letter: ", "expected one of C, E"},
        {SCENE "objects:\n  - name: a\n    kind: rectangle\n    position_m: [0, 0, 0.5]\n"
               "    size_m: [0.2, 0]\n",
         "scene.yaml:8: objects[0].size_m: ", "0 is outside 0.005..5"},
        {SCENE "objects:\n  - name: a\n    kind: rectangle\n    position_m: [0, 0, 0.5]\n"
               "    size_m: [0.2, 0.2]\n    facing: [0, 0, 0]\n",
         "scene.yaml:9: objects[0].facing: ", "expected a direction"},
        {SCENE "objects:\n  - name: a\n    kind: point\n    position_m: [1, 0, 2]\n"
               "    scattering_length_m: 1\n",
         "scene.yaml:7: objects[0].position_m: ", "a is 0.990 m behind the wall"},
        {"array: paper\ntemperature_c: 20\nwall:\n  normal: [0, 0, 1]\n  distance_m: 0\n",
         "scene.yaml:5: wall.distance_m: ", "the wall goes through the array"},
        {SCENE "microphones: {ripple_db: 1}\n"
               "calibration: {folder: x, serials: [a]}\n",
         "scene.yaml:4: microphones: ", "calibration says what"},
        {SCENE "clutter: {points: 3, scattering_length_m: 1, near_m: 2, far_m: 1}\n",
         "scene.yaml:4: clutter.far_m: ", "1 is outside 2..100"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        struct room *r;
        assert_int_equal(
            room_load(&r, scratch_write(*state, "scene.yaml", cases[i].text), &why),
            -EINVAL);
        assert_null(r);
        assert_contains(why.text, cases[i].place);
        assert_contains(why.text, cases[i].part);
    }
}

/* Each object is imaged inside the volume, in front of the array, far from the others. */
static void assert_scene_is_fit_to_image(const char *name, size_t n_objects)
{
    struct error why = {.text = ""};
    struct room *r;
    char path[512];
    const struct room_object *o;
    snprintf(path, sizeof path, SOURCE_DIR "/launch/scenes/%s", name);
    if (room_load(&r, path, &why))
        fail_msg("%s", why.text);
    const struct survey *s = room_survey(r);
    assert_int_equal(room_objects(r, &o), n_objects);
    assert_true(s->has_volume && s->has_gate && s->has_mount && s->has_wall);
    for (size_t i = 0; i < n_objects; i++) {
        for (int a = 0; a < 3; a++)
            assert_true(o[i].virtual_m[a] > s->volume_m[a][0] &&
                        o[i].virtual_m[a] < s->volume_m[a][1]);
        for (size_t j = 0; j < i; j++)
            assert_true(hypot(hypot(o[i].virtual_m[0] - o[j].virtual_m[0],
                                    o[i].virtual_m[1] - o[j].virtual_m[1]),
                              o[i].virtual_m[2] - o[j].virtual_m[2]) > 0.4);
    }
    room_destroy(r);
}

static void the_scenes_that_come_with_it_can_be_imaged(void **state)
{
    (void)state;
    assert_scene_is_fit_to_image("corner.yaml", 3);
    assert_scene_is_fit_to_image("point.yaml", 1);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_papers_array_has_its_measures),
        TEST(objects_know_where_they_are_imaged),
        TEST(of_several_walls_the_room_has_the_first),
        TEST(wrong_scenes_are_named_with_line_and_key),
        TEST(the_scenes_that_come_with_it_can_be_imaged),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
