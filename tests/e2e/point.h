/* SPDX-License-Identifier: MIT */
/* tests/e2e/point.h -- the scene of one point that the small systems image, and whether
 * they have found it. */
#ifndef ANLOS_TESTS_E2E_POINT_H
#define ANLOS_TESTS_E2E_POINT_H

#include "tests/hal/scratch.h"

#include <jansson.h>
#include <math.h>

#include "hal/room/room.h"

#define SCENE SOURCE_DIR "/launch/scenes/point.yaml"

/* What detections.json holds: the one object of the scene, within 3 cm of where it is, in
 * the vehicle frame. */
static inline void assert_point_found(const json_t *o)
{
    const struct room_object *object;
    struct room *room = NULL;
    double truth[3], square = 0.0;
    const json_t *list = json_object_get(o, "detections");

    assert_int_equal(room_load(&room, SCENE, NULL), 0);
    assert_int_equal(room_objects(room, &object), 1);
    survey_to_vehicle(room_survey(room), object->position_m, truth);
    assert_string_equal(json_string_value(json_object_get(o, "frame")), "vehicle");
    assert_int_equal(json_array_size(list), 1);
    const json_t *at = json_object_get(json_array_get(list, 0), "position_m");
    for (size_t i = 0; i < 3; i++) {
        double d = json_number_value(json_array_get(at, i)) - truth[i];
        square += d * d;
    }
    if (!(sqrt(square) <= 0.03))
        fail_msg("the point is reported %.3f m away", sqrt(square));
    room_destroy(room);
}

#endif
