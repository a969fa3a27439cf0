/* SPDX-License-Identifier: MIT */
/* Surveys with `pings` and `replica`, and their recordings. */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include <sndfile.h>

#include "hal/recording/recording.h"
#include "hal/recording/replica_file.h"
#include "hal/survey/file.h"
#include "recon/tail.h"

enum { RATE = 48000, PINGS = 5, SLOT = 400, CHIRP = 300 };

#define HEAD                                                                             \
    "sound_speed_m_s: 343\n"                                                             \
    "sample_rate_hz: 48000\n"                                                            \
    "slot_samples: 400\n"
#define PLACES "pings: pings.csv\n"
#define SWEEP  "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.005}\n"
#define VOLUME                                                                           \
    "volume: {x_m: [-0.1, 0.1, 0.01], y_m: [-0.1, 0.1, 0.01], z_m: [0.3, 0.5, 0.01]}\n"

static void write_wav(struct scratch *s, const char *name, int channels, int rate,
                      const float *x, size_t frames)
{
    SF_INFO info = {.samplerate = rate,
                    .channels = channels,
                    .format = SF_FORMAT_WAV | SF_FORMAT_FLOAT};
    SNDFILE *f = sf_open(scratch_path(s, name), SFM_WRITE, &info);
    assert_non_null(f);
    assert_int_equal(sf_writef_float(f, x, (sf_count_t)frames), frames);
    sf_close(f);
}

static void sweep(float *x, size_t n, double start_hz, double stop_hz)
{
    for (size_t i = 0; i < n; i++) {
        double t = (double)i / RATE, duration = (double)n / RATE;
        x[i] = (float)cos(2.0 * M_PI *
                          (start_hz * t + 0.5 * (stop_hz - start_hz) / duration * t * t));
    }
}

static void write_pings(struct scratch *s)
{
    char text[1024] = "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m\n";
    for (int k = 0; k < PINGS; k++)
        snprintf(text + strlen(text), 100, "%g,0,%g,%g,0.05,0\n", 0.1 * k, -0.01 * k,
                 0.1 * k + 0.02);
    scratch_write(s, "pings.csv", text);
}

static int load(struct scratch *s, const char *text, struct survey *out,
                struct error *why)
{
    why->text[0] = 0;
    return survey_load(out, scratch_write(s, "survey.yaml", text), why);
}

static void expect(struct scratch *s, const char *text, const char *part)
{
    struct error why;
    struct survey survey;
    assert_true(load(s, text, &survey, &why) < 0);
    if (!strstr(why.text, part))
        fail_msg("\"%s\" has no \"%s\"", why.text, part);
}

static void pings_playback_publisher_place_of_an_array(void **state)
{
    struct error why;
    struct survey s;
    write_pings(*state);
    if (load(*state, HEAD SWEEP PLACES VOLUME, &s, &why))
        fail_msg("%s", why.text);
    assert_int_equal(s.n_positions, PINGS);
    assert_int_equal(s.n_speakers * s.n_microphones, 1);
    assert_true(s.pings_m[3][0][2] == -0.03 && s.pings_m[2][1][1] == 0.05);
    /* The far corner of the volume is 0.8 m from the farthest ping: the tail is bounded
     * by the slot. */
    assert_int_equal(tail_samples(&s) > 0, 1);
    survey_clear(&s);
}

static void a_replica_stands_in_place_of_a_chirp(void **state)
{
    struct error why;
    struct survey s;
    float x[CHIRP + 50] = {0};
    sweep(x, CHIRP, 5000.0, 15000.0);
    write_wav(*state, "replica.wav", 1, RATE, x, CHIRP + 50);
    write_pings(*state);
    if (load(*state, HEAD PLACES VOLUME "replica: replica.wav\n", &s, &why))
        fail_msg("%s", why.text);
    assert_int_equal(s.n_replica, CHIRP); /* without the silence at its end */
    assert_memory_equal(s.replica, x, CHIRP * sizeof *x);
    assert_true(fabs(s.chirp_duration_s - (double)CHIRP / RATE) < 1e-12);
    assert_true(fabs(s.chirp_start_hz - 5000.0) < 600.0);
    assert_true(fabs(s.chirp_stop_hz - 15000.0) < 600.0);
    survey_clear(&s);
}

static void the_band_of_a_replica_is_where_its_sound_is(void **state)
{
    (void)state;
    float x[4000];
    double band_hz[2];
    sweep(x, 4000, 18000.0, 3000.0); /* a falling one */
    assert_int_equal(replica_band(x, 4000, RATE, band_hz), 0);
    assert_true(fabs(band_hz[0] - 3000.0) < 300.0 && fabs(band_hz[1] - 18000.0) < 300.0);
    memset(x, 0, sizeof x);
    assert_int_equal(replica_band(x, 4000, RATE, band_hz), -EINVAL);
    sweep(x, 4000, 6000.0, 6000.0); /* one tone has no depth */
    assert_int_equal(replica_band(x, 4000, RATE, band_hz), -EINVAL);
    x[0] = NAN;
    assert_int_equal(replica_band(x, 4000, RATE, band_hz), -EINVAL);
}

static void each_part_is_said_once_and_not_left_out(void **state)
{
    struct scratch *s = *state;
    float x[2 * CHIRP];
    sweep(x, CHIRP, 5000.0, 15000.0);
    write_pings(s);
    write_wav(s, "replica.wav", 1, RATE, x, CHIRP);
    write_wav(s, "slow.wav", 1, 44100, x, CHIRP);
    write_wav(s, "two.wav", 2, RATE, x, CHIRP / 2);
    memset(x, 0, sizeof x);
    write_wav(s, "silent.wav", 1, RATE, x, CHIRP);
    write_wav(s, "long.wav", 1, RATE, x, 2 * CHIRP);
    expect(s, HEAD SWEEP PLACES VOLUME "speakers_m: [[0, 0, 0]]\n",
           "survey.yaml:7: speakers_m: the key \"pings\" says this already");
    expect(s, HEAD SWEEP PLACES VOLUME "stage: {axis: [1, 0, 0], positions_m: [0]}\n",
           "survey.yaml:7: stage: ");
    expect(s, HEAD SWEEP PLACES "replica: replica.wav\n", "survey.yaml:4: chirp: ");
    expect(s, HEAD PLACES, "the key \"chirp\" is missing, or \"replica\"");
    expect(s, HEAD SWEEP, "the key \"speakers_m\" is missing, or \"pings\"");
    expect(s, HEAD SWEEP "pings: none.csv\n", "none.csv: No such file");
    expect(s, HEAD PLACES "replica: none.wav\n", "none.wav: No such file");
    expect(s, HEAD PLACES "replica: slow.wav\n", "44100 Hz");
    expect(s, HEAD PLACES "replica: two.wav\n", "2 channels, expected one");
    expect(s, HEAD PLACES "replica: silent.wav\n", "silent.wav: silent");
    expect(s, HEAD PLACES "replica: pings.csv\n", "pings.csv: no WAV file");
    scratch_write(s, "far.csv", "0,0,0,0,0,0\n0,0,0,0,2000,0\n");
    expect(s, HEAD SWEEP "pings: far.csv\n", "pings microphone[1]");
}

static void what_was_saved_is_read_back(void **state)
{
    struct error why;
    struct survey s, again;
    float x[CHIRP];
    char path[512];
    sweep(x, CHIRP, 5000.0, 15000.0);
    write_wav(*state, "replica.wav", 1, RATE, x, CHIRP);
    write_pings(*state);
    assert_int_equal(load(*state, HEAD PLACES VOLUME "replica: replica.wav\n", &s, &why),
                     0);
    strcpy(path, scratch_path(*state, "saved.yaml"));
    assert_int_equal(survey_save(&s, path, NULL, &why), 0);
    if (survey_load(&again, path, &why))
        fail_msg("%s", why.text);
    assert_int_equal(again.n_positions, PINGS);
    assert_memory_equal(again.pings_m, s.pings_m, PINGS * sizeof *s.pings_m);
    assert_int_equal(again.n_replica, CHIRP);
    assert_memory_equal(again.replica, x, sizeof x);
    assert_true(survey_id(&again) == survey_id(&s));
    survey_clear(&again);
    survey_clear(&s);
}

static void a_place_alone_can_be_read(void **state)
{
    struct error why = {""};
    struct survey s;
    const char *path = scratch_write(*state, "place.yaml",
                                     VOLUME "wall: {normal: [0, 0, 2], distance_m: 1}\n");
    assert_int_equal(survey_load_place(&s, path, &why), 0);
    assert_true(s.has_volume && s.has_wall && !s.has_gate && !s.has_mount);
    assert_true(s.volume_m[2][1] == 0.5 && s.wall_normal[2] == 1.0);
    path = scratch_write(*state, "place.yaml",
                         "volume: {x_m: [1, 0, 1], y_m: [0, 1, 1], z_m: [0, 1, 1]}\n");
    assert_int_equal(survey_load_place(&s, path, &why), -EINVAL);
    assert_non_null(strstr(why.text, "place.yaml:1: "));
    path = scratch_write(*state, "place.yaml", VOLUME "gate_m: [3.0, 1.0]\n");
    assert_int_equal(survey_load_place(&s, path, &why), -EINVAL);
    assert_non_null(
        strstr(why.text, "place.yaml:2: gate_m is [3, 1], expected 0 <= near"));
}

/* Slot k holds the number k + 1. */
static void slots_of_one_file_are_positions(void **state)
{
    struct error why;
    struct survey s;
    struct recording *r;
    static float x[PINGS * SLOT], y[2 * SLOT];
    uint32_t clipped, not_finite;
    write_pings(*state);
    assert_int_equal(load(*state, HEAD SWEEP PLACES VOLUME, &s, &why), 0);
    for (size_t i = 0; i < PINGS * SLOT; i++)
        x[i] = (float)(i / SLOT + 1) * (i % 2 ? 0.01f : -0.01f);
    scratch_folder(*state, "wav");
    write_wav(*state, "wav/all.wav", 1, RATE, x, PINGS * SLOT);
    write_wav(*state, "wav/a-replica.wav", 1, RATE, x, SLOT); /* does not count */
    if (recording_open(&r, scratch_path(*state, "wav"), &s, &why))
        fail_msg("%s", why.text);
    size_t frames = recording_frames(r);
    assert_true(frames >= SLOT && frames <= 2 * SLOT);
    assert_int_equal(recording_spare_slots(r), 0);
    for (size_t k = 0; k < PINGS; k++) {
        assert_int_equal(recording_read(r, k, y, &clipped, &not_finite, &why), 0);
        for (size_t i = 0; i < frames; i++) {
            size_t at = k * SLOT + i;
            assert_true(y[i] == (at < PINGS * SLOT ? x[at] : 0.0f));
        }
    }
    assert_true(recording_read(r, PINGS, y, &clipped, &not_finite, &why) == -EINVAL);
    recording_close(r);

    write_wav(*state, "wav/b.wav", 1, RATE, x, PINGS * SLOT);
    assert_int_equal(recording_open(&r, scratch_path(*state, "wav"), &s, &why), -EINVAL);
    assert_non_null(strstr(why.text, "2 WAV files, but the survey names pings"));
    remove(scratch_path(*state, "wav/b.wav"));
    write_wav(*state, "wav/all.wav", 1, RATE, x, (PINGS - 1) * SLOT);
    assert_int_equal(recording_open(&r, scratch_path(*state, "wav"), &s, &why), -EINVAL);
    assert_non_null(strstr(why.text, "the slot of the last of 5 pings begins at"));
    survey_clear(&s);
}

static void slots_that_no_ping_names_are_counted(void **state)
{
    static const struct {
        size_t frames, spare;
    } cases[] = {
        {PINGS * SLOT + SLOT - 1, 0}, {(PINGS + 1) * SLOT, 1}, {(PINGS + 2) * SLOT, 2}};
    static float x[(PINGS + 2) * SLOT];
    struct error why;
    struct survey s;
    struct recording *r;
    write_pings(*state);
    assert_int_equal(load(*state, HEAD SWEEP PLACES VOLUME, &s, &why), 0);
    scratch_folder(*state, "wav");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_wav(*state, "wav/all.wav", 1, RATE, x, cases[i].frames);
        assert_int_equal(recording_open(&r, scratch_path(*state, "wav"), &s, &why), 0);
        assert_int_equal(recording_spare_slots(r), cases[i].spare);
        recording_close(r);
    }
    survey_clear(&s);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(pings_playback_publisher_place_of_an_array),
        TEST(a_replica_stands_in_place_of_a_chirp),
        TEST(the_band_of_a_replica_is_where_its_sound_is),
        TEST(each_part_is_said_once_and_not_left_out),
        TEST(what_was_saved_is_read_back),
        TEST(a_place_alone_can_be_read),
        TEST(slots_of_one_file_are_positions),
        TEST(slots_that_no_ping_names_are_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
