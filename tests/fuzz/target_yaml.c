/* SPDX-License-Identifier: MIT */
/* A text as each of the files that are YAML: survey, scene, rig, calibration, launch. */
#include "hal/room/scene.h"
#include "hal/survey/calibration.h"
#include "hal/survey/file.h"
#include "hal/survey/rig_file.h"
#include "nodes/rt/launchfile.h"
#include "tests/fuzz/fuzz.h"

static void require_words(int err, const struct error *why)
{
    FUZZ_REQUIRE(!err == !why->text[0]);
}

static void as_survey(const char *path)
{
    struct error why = {""};
    struct survey s;
    int err = survey_load(&s, path, &why);

    require_words(err, &why);
    if (!err) {
        FUZZ_REQUIRE(!survey_check(&s, NULL));
        survey_clear(&s);
    }
    if (!survey_load_place(&s, path, NULL))
        survey_clear(&s);
}

static void as_scene(const char *path)
{
    struct error why = {""};
    struct scene *scene;
    struct survey s;
    int err = scene_load(&scene, &s, path, &why);

    require_words(err, &why);
    if (!err) {
        FUZZ_REQUIRE(!survey_check(&s, NULL));
        scene_free(scene);
        survey_clear(&s);
    }
}

static void as_rig(const char *path)
{
    struct error why = {""};
    struct rig rig;
    int err = rig_load(&rig, path, &why);

    require_words(err, &why);
    if (!err)
        rig_clear(&rig);
}

static void as_calibration(const char *path)
{
    struct error why = {""};
    struct calibration *c;
    int err = calibration_load(&c, path, &why);

    require_words(err, &why);
    if (!err)
        calibration_destroy(c);
}

static void as_launchfile(const char *path)
{
    struct error why = {""};
    struct launchfile *l;
    int err = launchfile_load(&l, path, NULL, &why);

    require_words(err, &why);
    if (!err)
        launchfile_destroy(l);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *path = fuzz_file("in.yaml", data, size);

    as_survey(path);
    as_scene(path);
    as_rig(path);
    as_calibration(path);
    as_launchfile(path);
    return 0;
}
