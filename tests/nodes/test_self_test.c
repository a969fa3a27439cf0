/* SPDX-License-Identifier: MIT */
/* Microphones that hear nothing and speakers that nobody hears, in the simulated room: a
 * person at 4 m is as loud as the noise, and what is dead has that noise, too.  Judged
 * beside the compression for the image; with another window than its own the self-test
 * compresses for itself. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/array.h"
#include "recon/frontend/frontend.h"

#define DRIVE SOURCE_DIR "/launch/scenes/drive-person.yaml"

static const struct range_config fixed = {.ranges = true,
                                          .n_pings = 8,
                                          .sum = FRAMES_POWER,
                                          .false_alarm_rate = 1e-4,
                                          .person_m = 0.05};

struct rig {
    struct fake_clock clock;
    struct array *array;
    struct frontend *frontend;
    uint64_t survey_id;
    struct self_test_faults faults;
    char note[512];
    int64_t began_ns;
    bool forgets; /* the sound, once it is compressed */
};

static struct self_test *self_test(const struct rig *r)
{
    const char *why;

    return frontend_self_test(r->frontend, &why);
}

/* But for the lines of a key that comes again. */
static void copy(FILE *to, const char *path, const char *key)
{
    size_t length = strcspn(key, ":") + 1;
    char line[512];
    FILE *from = fopen(path, "r");

    assert_non_null(from);
    while (fgets(line, sizeof line, from))
        if (strncmp(line, key, length))
            assert_true(fputs(line, to) >= 0);
    fclose(from);
}

static void start_with(struct rig *r, struct scratch *s, const char *faults,
                       const char *options, const uint32_t *speakers, size_t n,
                       enum window window)
{
    const struct frontend_config cfg = {
        .window = window, .judges_array = true, .range = fixed};
    const struct array_shot shot = {
        .speakers = speakers, .n_speakers = n, .endless = true};
    struct error why = {""};
    char uri[700];
    FILE *f = fopen(scratch_path(s, "scene.yaml"), "w");

    assert_non_null(f);
    copy(f, DRIVE, faults);
    fprintf(f, "\n%s", faults);
    assert_int_equal(fclose(f), 0);
    snprintf(uri, sizeof uri, "sim:%s?%s", s->path, options);
    *r = (struct rig){.began_ns = INT64_C(1700000000000000000)};
    fake_clock_set(&r->clock, r->began_ns);
    if (array_open(&r->array, uri, &r->clock.source, &why) ||
        frontend_create(&r->frontend, &cfg) ||
        frontend_survey(r->frontend, array_survey(r->array), &why))
        fail_msg("%s", why.text);
    assert_non_null(self_test(r));
    r->survey_id = survey_id(array_survey(r->array));
    assert_int_equal(array_fire(r->array, &shot), 0);
}

static void start(struct rig *r, struct scratch *s, const char *faults,
                  const char *options, const uint32_t *speakers, size_t n)
{
    start_with(r, s, faults, options, speakers, n, WINDOW_HANN);
}

/* So many pings; the time since the start. */
static double go_on(struct rig *r, size_t n, const uint32_t *speakers)
{
    size_t n_mics = array_survey(r->array)->n_microphones;

    for (size_t i = 0; i < n; i++) {
        struct array_ping heard;
        struct error why;
        assert_int_equal(array_next(r->array, &heard, &why), 0);
        size_t n_bytes = n_mics * heard.n_samples * sizeof(float);
        float *samples = malloc(n_bytes);
        assert_non_null(samples);
        memcpy(samples, heard.samples, n_bytes);
        const struct ping ping = {.survey_id = r->survey_id,
                                  .capture_ns = heard.t0_ns,
                                  .frame = 1,
                                  .speaker = speakers[heard.shot_index],
                                  .temperature_c = NAN,
                                  .down = heard.down,
                                  .valid = heard.valid,
                                  .n_microphones = n_mics,
                                  .n_samples = heard.n_samples,
                                  .samples = samples,
                                  .clipped = heard.clipped,
                                  .not_finite = heard.not_finite};
        struct frontend_output out;
        frontend_ping(r->frontend, &ping, &out);
        if (r->forgets)
            memset(samples, 0, n_bytes);
        assert_true(
            frontend_judge(r->frontend, &ping, &r->faults, r->note, sizeof r->note));
        free(samples);
    }
    return 1e-9 * (double)(r->clock.now_ns - r->began_ns);
}

static void stop(struct rig *r)
{
    frontend_destroy(r->frontend);
    array_close(r->array);
}

static const uint32_t all[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

static const struct self_test_levels *levels(struct rig *r)
{
    static struct self_test_levels l;

    self_test_levels(self_test(r), &l);
    return &l;
}

/* Slots, chirps and directions of every kind. */
static const char *const options[] = {"pace=real", "together=2&alternates=yes",
                                      "chirp_s=0.005&slot_samples=960&far_m=3",
                                      "chirp_s=0.0625", "chirp_s=0.02&slot_samples=3000"};

static const enum window windows[2] = {WINDOW_HANN, WINDOW_HAMMING};

static void what_works_is_heard_in_noise(void **state)
{
    struct rig r;

    for (size_t k = 0; k < 2 * sizeof options / sizeof *options; k++) {
        start_with(&r, *state, "", options[k / 2], all, 16, windows[k % 2]);
        for (int i = 0; i < 40; i++) {
            go_on(&r, 1, all);
            if (r.faults.deaf || r.faults.mute)
                fail_msg("%s, ping %d: %s", options[k / 2], i, r.note);
        }
        assert_int_equal(r.faults.of_microphones, 16);
        assert_int_equal(r.faults.of_speakers, 16);
        assert_string_equal(r.note, "");
        stop(&r);
    }
}

/* Each ping was compressed two times more.  Where chirps overlap that is as it was. */
static void what_was_compressed_for_the_image_is_judged(void **state)
{
    struct rig r;

    for (size_t k = 0; k < sizeof options / sizeof *options; k++) {
        start(&r, *state, "", options[k], all, 16);
        bool overlaps = survey_overlaps(array_survey(r.array));
        go_on(&r, 32, all); /* noise is what a speaker's second ping has new */
        double noise_db = levels(&r)->noise_db;
        assert_int_equal(r.faults.deaf, 0);
        r.forgets = true;
        go_on(&r, 16, all);
        if (overlaps)
            assert_true(levels(&r)->noise_db < noise_db - 3.0);
        else if (r.faults.deaf || !(levels(&r)->noise_db > noise_db - 1.0))
            fail_msg("%s: %zu deaf, noise %.1f dB, not %.1f", options[k], r.faults.deaf,
                     levels(&r)->noise_db, noise_db);
        stop(&r);
    }
}

static void a_dead_microphone_is_known_within_100_ms(void **state)
{
    struct rig r;
    double s = 0.0;

    start(&r, *state, "faults: {microphones: [{channel: 3, dead: true}]}\n", "", all, 16);
    while (!r.faults.deaf && s < 1.0)
        s = go_on(&r, 1, all);
    assert_true(s < 0.1);
    assert_string_equal(r.note, "microphone 4 hears no speaker");
    for (int i = 0; i < 40; i++) {
        go_on(&r, 1, all);
        assert_int_equal(r.faults.deaf, 1);
        assert_int_equal(r.faults.mute, 0);
    }
    stop(&r);
}

static void nine_of_sixteen_are_nine(void **state)
{
    struct rig r;

    start(&r, *state,
          "faults: {microphones: [{channel: 0, dead: true}, {channel: 1, dead: true},\n"
          "  {channel: 2, dead: true}, {channel: 3, dead: true}, {channel: 4, dead: "
          "true},\n"
          "  {channel: 5, dead: true}, {channel: 6, dead: true}, {channel: 7, dead: "
          "true},\n"
          "  {channel: 8, dead: true}]}\n",
          "", all, 16);
    go_on(&r, 16, all);
    assert_int_equal(r.faults.deaf, 9);
    assert_int_equal(r.faults.mute, 0);
    stop(&r);
}

static void a_dead_speaker_is_mute_and_makes_nobody_deaf(void **state)
{
    static const uint32_t some[] = {0, 5, 10, 15};
    struct rig r;

    for (size_t k = 0; k < 2 * sizeof options / sizeof *options; k++) {
        start_with(&r, *state, "faults: {speakers: [{channel: 5, dead: true}]}\n",
                   options[k / 2], some, 4, windows[k % 2]);
        go_on(&r, 1, some);
        assert_int_equal(r.faults.mute, 0);
        for (int i = 0; i < 20; i++) {
            go_on(&r, 1, some);
            if (r.faults.mute != 1 || r.faults.deaf)
                fail_msg("%s, ping %d: %zu, %zu", options[k / 2], i, r.faults.mute,
                         r.faults.deaf);
        }
        assert_int_equal(r.faults.of_speakers, 4);
        assert_string_equal(r.note, "no microphone hears speaker 6");
        stop(&r);
    }
}

static void a_microphone_that_comes_back_hears_at_once(void **state)
{
    struct rig dead, well;

    start(&dead, *state, "faults: {microphones: [{channel: 3, dead: true}]}\n", "", all,
          16);
    go_on(&dead, 10, all);
    assert_int_equal(dead.faults.deaf, 1);
    start(&well, *state, "", "", all, 16);
    frontend_destroy(well.frontend);
    well.frontend = dead.frontend;
    go_on(&well, 1, all);
    assert_int_equal(well.faults.deaf, 0);
    well.frontend = NULL;
    stop(&well);
    stop(&dead);
}

/* -- noise and cover, that come at 3 s and go at 6
 * ----------------------------------------
 */

#define HELD_M 4.0 /* the scene's gate */

/* Until the time since the start. */
static void go_until(struct rig *r, double s)
{
    while (go_on(r, 1, all) < s)
        ;
}

static void
noise_that_rises_reduces_the_range_within_two_seconds_until_it_goes(void **state)
{
    struct rig r;

    start(&r, *state,
          "noise: {snr_db: 0, at_m: 4, rises: [{during_s: [3, 6], by_db: 25}]}\n", "",
          all, 16);
    go_until(&r, 2.9);
    assert_false(levels(&r)->limited);
    assert_true(levels(&r)->range_m == HELD_M);
    double noise_db = levels(&r)->noise_db, echo_db = levels(&r)->echo_db;
    double direct_db = levels(&r)->direct_db;
    go_until(&r, 4.4);
    assert_true(levels(&r)->limited);
    go_until(&r, 5.9);
    assert_true(fabs(levels(&r)->noise_db - noise_db - 25.0) < 1.0);
    assert_true(fabs(levels(&r)->direct_db - direct_db + 25.0) < 0.5);
    assert_true(fabs(levels(&r)->echo_db - echo_db + 25.0) < 1.0);
    assert_true(levels(&r)->range_m < 0.6 * HELD_M);
    assert_int_equal(r.faults.deaf + r.faults.mute, 0);
    go_until(&r, 8.0);
    assert_false(levels(&r)->limited);
    assert_true(levels(&r)->range_m == HELD_M);
    assert_string_equal(r.note, "");
    stop(&r);
}

/* So loud that not even the direct sound of most pairs stands out: nobody is called deaf
 * or mute for it. */
static void in_a_din_no_one_is_called_deaf(void **state)
{
    struct rig r;

    start(&r, *state,
          "noise: {snr_db: 0, at_m: 4, rises: [{during_s: [3, 6], by_db: 75}]}\n", "",
          all, 16);
    go_until(&r, 5.9);
    assert_true(levels(&r)->limited);
    assert_true(levels(&r)->range_m == 0.0);
    assert_int_equal(r.faults.deaf + r.faults.mute, 0);
    assert_int_equal(r.faults.covered_microphones + r.faults.covered_speakers, 0);
    stop(&r);
}

/* The fourth power: 10 dB of noise are a factor of 10^(1/4) in range. */
static void range_falls_with_noise(void **state)
{
    static const char *const noises[] = {"noise: {snr_db: -12, at_m: 4}\n",
                                         "noise: {snr_db: -17, at_m: 4}\n",
                                         "noise: {snr_db: -22, at_m: 4}\n"};
    double before_m = HELD_M;
    struct rig r;

    for (int k = 0; k < 3; k++) {
        start(&r, *state, noises[k], "", all, 16);
        go_until(&r, 2.0);
        assert_true(levels(&r)->limited);
        double m = levels(&r)->range_m;
        assert_true(m < before_m);
        if (k)
            assert_true(fabs(40.0 * log10(before_m / m) - 5.0) < 1.0);
        before_m = m;
        stop(&r);
    }
}

/* What is 1.5 to 4 m away is imaged: a sensor that reached to 1.2 m finds nobody, and
 * does not say "up to 1.2 m".  By the fourth power that is 4.5 dB more noise than for 1.6
 * m. */
static void a_range_that_ends_before_the_gate_begins_is_none(void **state)
{
    struct rig r;

    start(&r, *state, "noise: {snr_db: -22, at_m: 4}\n", "", all, 16);
    go_until(&r, 2.0);
    double near_m = levels(&r)->range_m;
    assert_true(near_m > 1.5 && near_m < 1.8);
    stop(&r);
    start(&r, *state, "noise: {snr_db: -27, at_m: 4}\n", "", all, 16);
    assert_true(near_m * pow(10.0, -5.0 / 40.0) < 1.5);
    go_until(&r, 2.0);
    assert_true(levels(&r)->limited);
    assert_true(levels(&r)->range_m == 0.0);
    stop(&r);
}

static void assert_cover_comes_and_goes(void **state, const char *faults, size_t mics,
                                        size_t speakers, const char *note)
{
    struct rig r;

    start(&r, *state, faults, "", all, 16);
    go_until(&r, 2.9);
    assert_string_equal(r.note, "");
    go_until(&r, 4.0);
    assert_int_equal(r.faults.covered_microphones, mics);
    assert_int_equal(r.faults.covered_speakers, speakers);
    assert_int_equal(r.faults.deaf + r.faults.mute, 0);
    assert_string_equal(r.note, note);
    r.note[0] = '\0';
    go_until(&r, 7.0);
    assert_int_equal(r.faults.covered_microphones + r.faults.covered_speakers, 0);
    assert_non_null(strstr(r.note, "is not covered any more"));
    stop(&r);
}

static void a_covered_microphone_is_named_within_a_second(void **state)
{
    assert_cover_comes_and_goes(
        state, "faults: {microphones: [{channel: 3, gain_db: -25, during_s: [3, 6]}]}\n",
        1, 0, "microphone 4 is covered");
}

static void a_covered_speaker_is_named_within_a_second(void **state)
{
    assert_cover_comes_and_goes(
        state, "faults: {speakers: [{channel: 11, gain_db: -25, during_s: [3, 6]}]}\n", 0,
        1, "speaker 12 is covered");
}

/* What an element lost was learnt before the vehicle said that it is warmer: 2 K are 3.5
 * parts in a thousand of the speed of sound. */
static void other_air_leaves_what_was_learnt(void **state)
{
    struct survey warmer;
    struct error why = {""};
    struct rig r;

    start(&r, *state,
          "faults: {microphones: [{channel: 3, gain_db: -25, during_s: [3, 9]}]}\n", "",
          all, 16);
    go_until(&r, 2.9);
    double direct_db = levels(&r)->direct_db, echo_db = levels(&r)->echo_db;
    assert_int_equal(survey_copy(&warmer, array_survey(r.array)), 0);
    warmer.sound_speed_m_s *= 1.0035;
    assert_int_equal(frontend_survey(r.frontend, &warmer, &why), 0);
    r.survey_id = survey_id(&warmer);
    assert_true(r.survey_id != survey_id(array_survey(r.array)));
    assert_true(levels(&r)->direct_db == direct_db);
    assert_true(fabs(levels(&r)->echo_db - echo_db) < 0.1);
    go_until(&r, 4.0);
    assert_int_equal(r.faults.covered_microphones, 1);
    assert_int_equal(r.faults.deaf + r.faults.mute, 0);
    assert_string_equal(r.note, "microphone 4 is covered");
    survey_clear(&warmer);
    stop(&r);
}

/* It was taken for want of memory, or for nothing. */
static void why_a_range_is_none_is_said(void **state)
{
    struct range_config none = fixed;
    struct self_test *t = NULL;
    struct error why = {""};
    struct rig r;

    start(&r, *state, "", "", all, 16);
    none.n_pings = 0;
    assert_int_equal(self_test_create(&t, &none, array_survey(r.array), NULL, &why),
                     -EINVAL);
    assert_null(t);
    assert_non_null(strstr(why.text, "images of 0 pings"));
    stop(&r);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_works_is_heard_in_noise),
        TEST(what_was_compressed_for_the_image_is_judged),
        TEST(a_dead_microphone_is_known_within_100_ms),
        TEST(nine_of_sixteen_are_nine),
        TEST(a_dead_speaker_is_mute_and_makes_nobody_deaf),
        TEST(a_microphone_that_comes_back_hears_at_once),
        TEST(noise_that_rises_reduces_the_range_within_two_seconds_until_it_goes),
        TEST(in_a_din_no_one_is_called_deaf),
        TEST(range_falls_with_noise),
        TEST(a_range_that_ends_before_the_gate_begins_is_none),
        TEST(a_covered_microphone_is_named_within_a_second),
        TEST(a_covered_speaker_is_named_within_a_second),
        TEST(other_air_leaves_what_was_learnt),
        TEST(why_a_range_is_none_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
