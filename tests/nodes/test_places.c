/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "tests/nodes/near.h"

#include "nodes/array/acquisition.h"

struct array {
    double speakers_m[2][3], microphones_m[3][3];
    struct survey survey;
};

static struct array measured;

static void place(struct array *a)
{
    *a = (struct array){.speakers_m = {{0.1, 0, 0}, {0.2, 0, 0}},
                        .microphones_m = {{0, 0.1, 0}, {0, 0.2, 0}, {0, 0.3, 0}}};
    a->survey = (struct survey){.n_speakers = 2,
                                .n_microphones = 3,
                                .speakers_m = a->speakers_m,
                                .microphones_m = a->microphones_m};
}

static Anlos__MovedElement moved(bool speaker, uint32_t element, double x_m, double y_m,
                                 double z_m)
{
    Anlos__MovedElement m = ANLOS__MOVED_ELEMENT__INIT;

    m.speaker = speaker;
    m.element = element;
    m.x_m = x_m;
    m.y_m = y_m;
    m.z_m = z_m;
    return m;
}

static void an_element_goes_by_what_is_said_from_where_it_is(void **state)
{
    struct array a;
    struct error why = {""};
    Anlos__MovedElement first = moved(false, 3, 0.01, -0.02, 0.03);
    Anlos__MovedElement again = moved(false, 3, 0.01, 0, 0);
    Anlos__MovedElement speaker = moved(true, 1, 0, 0, -0.01);

    (void)state;
    place(&a);
    place(&measured);
    assert_int_equal(places_correct(&a.survey, &measured.survey, &first, &why), 0);
    assert_int_equal(places_correct(&a.survey, &measured.survey, &again, &why), 0);
    assert_int_equal(places_correct(&a.survey, &measured.survey, &speaker, &why), 0);
    assert_near(a.microphones_m[2][0], 0.02, 1e-12);
    assert_near(a.microphones_m[2][1], 0.28, 1e-12);
    assert_near(a.microphones_m[2][2], 0.03, 1e-12);
    assert_near(a.speakers_m[0][2], -0.01, 1e-12);
    assert_near(a.microphones_m[0][1], 0.1, 0.0);
}

static void what_cannot_be_is_refused_and_changes_nothing(void **state)
{
    const struct {
        Anlos__MovedElement m;
        const char *says;
    } cases[] = {
        {moved(true, 3, 0, 0, 0), "speaker 3, expected 1 to 2"},
        {moved(false, 0, 0, 0, 0), "microphone 0, expected 1 to 3"},
        {moved(false, 4, 0, 0, 0), "microphone 4, expected 1 to 3"},
        {moved(false, 2, 0.04, 0.04, 0),
         "microphone 2 is 5.7 cm from its surveyed place"},
        {moved(false, 2, NAN, 0, 0), "microphone 2 is"},
        {moved(true, 2, 0, -INFINITY, 0), "speaker 2 is"},
    };
    struct array a, as_it_was;

    (void)state;
    place(&a);
    place(&measured);
    as_it_was = a;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        struct error why = {""};
        assert_int_equal(places_correct(&a.survey, &measured.survey, &cases[k].m, &why),
                         -EINVAL);
        assert_non_null(strstr(why.text, cases[k].says));
        assert_memory_equal(a.speakers_m, as_it_was.speakers_m, sizeof a.speakers_m);
        assert_memory_equal(a.microphones_m, as_it_was.microphones_m,
                            sizeof a.microphones_m);
    }
}

/* Step by step, each short enough. */
static void nobody_walks_off(void **state)
{
    struct array a;
    struct error why = {""};
    Anlos__MovedElement step = moved(false, 1, 0.02, 0, 0);

    (void)state;
    place(&a);
    place(&measured);
    assert_int_equal(places_correct(&a.survey, &measured.survey, &step, &why), 0);
    assert_int_equal(places_correct(&a.survey, &measured.survey, &step, &why), 0);
    assert_int_equal(places_correct(&a.survey, &measured.survey, &step, &why), -EINVAL);
    assert_non_null(strstr(why.text, "microphone 1 is 6.0 cm"));
    assert_near(a.microphones_m[0][0], 0.04, 1e-12);
    step.x_m = -0.04;
    assert_int_equal(places_correct(&a.survey, &measured.survey, &step, &why), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_element_goes_by_what_is_said_from_where_it_is),
        cmocka_unit_test(what_cannot_be_is_refused_and_changes_nothing),
        cmocka_unit_test(nobody_walks_off),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
