/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>
#include <math.h>
#include <time.h>
#include <unistd.h>

#include <sndfile.h>

#include "hal/recording/recording.h"
#include "recon/tail.h"

enum {
    SPEAKERS = 3,
    MICROPHONES = 2,
    POSITIONS = 2,
    SLOT = 100,
    FRAMES = SPEAKERS * SLOT
};

static double speakers_m[SPEAKERS][3], microphones_m[MICROPHONES][3];
static double positions_m[POSITIONS] = {0, 0.1};

/* A slot of 100 samples at 48 kHz ends 0.36 m away: with a gate to 0.3 m the tail is some
 * samples of the chirp and a margin. */
static struct survey make_survey(void)
{
    return (struct survey){.sound_speed_m_s = 343,
                           .sample_rate_hz = 48000,
                           .chirp_start_hz = 2000,
                           .chirp_stop_hz = 20000,
                           .chirp_duration_s = 50 / 48000.0,
                           .slot_samples = SLOT,
                           .n_speakers = SPEAKERS,
                           .n_microphones = MICROPHONES,
                           .n_positions = POSITIONS,
                           .speakers_m = speakers_m,
                           .microphones_m = microphones_m,
                           .stage_axis = {1, 0, 0},
                           .stage_positions_m = positions_m,
                           .has_gate = true,
                           .gate_m = {0.1, 0.3}};
}

/* Values that 16 bits hold, different for each sample and channel. */
static float value_of(size_t frame, size_t channel)
{
    return (float)((int)((frame * 37 + channel * 1001) % 20001) - 10000) / 32768;
}

static void write_wav(struct scratch *s, const char *name, int format, int rate,
                      size_t channels, size_t frames)
{
    SF_INFO info = {
        .samplerate = rate, .channels = (int)channels, .format = SF_FORMAT_WAV | format};
    SNDFILE *f = sf_open(scratch_path(s, name), SFM_WRITE, &info);
    float frame[16];
    assert_non_null(f);
    for (size_t i = 0; i < frames; i++) {
        for (size_t c = 0; c < channels; c++)
            frame[c] = value_of(i, c);
        assert_int_equal(sf_writef_float(f, frame, 1), 1);
    }
    assert_int_equal(sf_close(f), 0);
}

static void write_good(struct scratch *s, const char *name)
{
    write_wav(s, name, SF_FORMAT_FLOAT, 48000, MICROPHONES, FRAMES);
}

static void samples_are_the_same_in_every_format(void **state)
{
    static const int formats[] = {SF_FORMAT_PCM_16, SF_FORMAT_PCM_24, SF_FORMAT_PCM_32,
                                  SF_FORMAT_FLOAT, SF_FORMAT_DOUBLE};
    struct survey survey = make_survey();
    size_t n = FRAMES + tail_samples(&survey);
    float *samples = malloc(MICROPHONES * n * sizeof *samples);
    assert_non_null(samples);
    assert_true(n > FRAMES);
    for (size_t k = 0; k < sizeof formats / sizeof *formats; k++) {
        struct error why = {.text = ""};
        struct recording *r;
        uint32_t clipped[MICROPHONES], not_finite[MICROPHONES];
        write_wav(*state, "b.wav", formats[k], 48000, MICROPHONES, FRAMES - 7);
        write_wav(*state, "a.WAV", formats[k], 48000, MICROPHONES, FRAMES);
        scratch_write(*state, "notes.txt", "not sound");
        if (recording_open(&r, ((struct scratch *)*state)->folder, &survey, &why))
            fail_msg("%s", why.text);
        assert_int_equal(recording_frames(r), n);
        for (size_t p = 0; p < POSITIONS; p++) {
            memset(samples, 0xff, MICROPHONES * n * sizeof *samples);
            assert_int_equal(recording_read(r, p, samples, clipped, not_finite, &why), 0);
            for (size_t c = 0; c < MICROPHONES; c++) {
                for (size_t i = 0; i < n; i++)
                    assert_true(samples[c * n + i] ==
                                (i < (p ? FRAMES - 7 : FRAMES) ? value_of(i, c) : 0));
                assert_int_equal(clipped[c], 0);
                assert_int_equal(not_finite[c], 0);
            }
        }
        assert_int_equal(recording_read(r, 2, samples, clipped, not_finite, &why),
                         -EINVAL);
        recording_close(r);
    }
    free(samples);
}

static void write_channel(struct scratch *s, const char *name, int format,
                          const float *channel)
{
    SF_INFO info = {
        .samplerate = 48000, .channels = MICROPHONES, .format = SF_FORMAT_WAV | format};
    SNDFILE *f = sf_open(scratch_path(s, name), SFM_WRITE, &info);
    assert_non_null(f);
    sf_command(f, SFC_SET_CLIPPING, NULL, SF_TRUE);
    for (size_t i = 0; i < FRAMES; i++) {
        float frame[MICROPHONES] = {channel[i], 0.01f * (float)sin((double)i)};
        assert_int_equal(sf_writef_float(f, frame, 1), 1);
    }
    assert_int_equal(sf_close(f), 0);
}

static void count_slots(struct scratch *s, uint32_t *clipped, uint32_t *not_finite,
                        float *samples)
{
    struct survey survey = make_survey();
    struct error why = {.text = ""};
    struct recording *r;
    write_good(s, "b.wav");
    if (recording_open(&r, s->folder, &survey, &why))
        fail_msg("%s", why.text);
    assert_int_equal(recording_read_slots(r, 0, samples, clipped, not_finite, &why), 0);
    recording_close(r);
}

/* Slot 0: two full-scale samples are no run, then three are; slot 2: four, with sign. */
static void runs_at_full_scale_are_clipped_in_their_slot(void **state)
{
    float x[FRAMES] = {0}, samples[MICROPHONES * 2 * FRAMES];
    uint32_t clipped[SPEAKERS * MICROPHONES], not_finite[SPEAKERS * MICROPHONES];
    static const size_t high[] = {10, 11, 20, 21, 22};
    for (size_t i = 0; i < sizeof high / sizeof *high; i++)
        x[high[i]] = 1;
    for (size_t i = 250; i < 254; i++)
        x[i] = i % 2 ? 1.0f : -1.0f;
    write_channel(*state, "a.wav", SF_FORMAT_PCM_16, x);
    count_slots(*state, clipped, not_finite, samples);
    static const uint32_t expected[] = {3, 0, 0, 0, 4, 0};
    assert_memory_equal(clipped, expected, sizeof expected);
    for (size_t i = 0; i < SPEAKERS * MICROPHONES; i++)
        assert_int_equal(not_finite[i], 0);
}

/* Float files may exceed 1; what is cut off there stays equal for some samples. */
static void flat_tops_of_float_files_are_clipped(void **state)
{
    float x[FRAMES] = {0}, samples[MICROPHONES * 2 * FRAMES];
    uint32_t clipped[SPEAKERS * MICROPHONES], not_finite[SPEAKERS * MICROPHONES];
    for (size_t i = 0; i < FRAMES; i++)
        x[i] = 3 * (float)sin(0.37 * (double)i);
    for (size_t i = 120; i < 125; i++)
        x[i] = 2.5f;
    for (size_t i = 130; i < 136; i++)
        x[i] = 0.5f; /* equal, but not high */
    write_channel(*state, "a.wav", SF_FORMAT_FLOAT, x);
    count_slots(*state, clipped, not_finite, samples);
    static const uint32_t expected[] = {0, 0, 5, 0, 0, 0};
    assert_memory_equal(clipped, expected, sizeof expected);
}

static void samples_that_are_not_finite_become_0_and_are_counted(void **state)
{
    float x[FRAMES] = {0}, samples[MICROPHONES * 2 * FRAMES];
    uint32_t clipped[SPEAKERS * MICROPHONES], not_finite[SPEAKERS * MICROPHONES];
    for (size_t i = 0; i < FRAMES; i++)
        x[i] = (float)sin(0.37 * (double)i);
    x[5] = NAN;
    x[199] = INFINITY;
    x[150] = -INFINITY;
    write_channel(*state, "a.wav", SF_FORMAT_FLOAT, x);
    count_slots(*state, clipped, not_finite, samples);
    static const uint32_t expected[] = {1, 0, 2, 0, 0, 0};
    assert_memory_equal(not_finite, expected, sizeof expected);
    assert_true(samples[5] == 0 && samples[199] == 0 && samples[150] == 0);
    assert_true(samples[6] == x[6]);
    for (size_t i = 0; i < SPEAKERS * MICROPHONES; i++)
        assert_int_equal(clipped[i], 0);
}

static void cut_file(struct scratch *s, const char *name, long by)
{
    struct stat st;
    assert_int_equal(stat(scratch_path(s, name), &st), 0);
    assert_int_equal(truncate(s->path, st.st_size - by), 0);
}

static void bad_truncated(struct scratch *s)
{
    write_good(s, "b.wav");
    cut_file(s, "b.wav", 8);
}

static void bad_empty(struct scratch *s)
{
    scratch_write(s, "b.wav", "");
}

static void bad_text(struct scratch *s)
{
    scratch_write(s, "b.wav", "this is not sound, whatever its name says");
}

static void bad_rate(struct scratch *s)
{
    write_wav(s, "b.wav", SF_FORMAT_PCM_16, 44100, MICROPHONES, FRAMES);
}

static void bad_channels(struct scratch *s)
{
    write_wav(s, "b.wav", SF_FORMAT_PCM_16, 48000, 3, FRAMES);
}

static void bad_no_frames(struct scratch *s)
{
    write_wav(s, "b.wav", SF_FORMAT_PCM_16, 48000, MICROPHONES, 0);
}

static void bad_short(struct scratch *s)
{
    write_wav(s, "b.wav", SF_FORMAT_PCM_16, 48000, MICROPHONES, (SPEAKERS - 1) * SLOT);
}

/* Nobody will ever write into it. */
static void bad_pipe(struct scratch *s)
{
    assert_int_equal(mkfifo(scratch_path(s, "b.wav"), 0600), 0);
}

static void bad_fewer(struct scratch *s)
{
    (void)s;
}

static void bad_more(struct scratch *s)
{
    write_good(s, "b.wav");
    write_good(s, "c.wav");
}

static void bad_recordings_are_named_with_what_was_expected(void **state)
{
    static const struct {
        void (*make)(struct scratch *s);
        const char *part;
    } cases[] = {
        {bad_pipe, "b.wav: is no file; expected a WAV file"},
        {bad_truncated,
         "b.wav: truncated: its header promises 2400 bytes of sound, 2392"},
        {bad_empty, "b.wav: no WAV file"},
        {bad_text, "b.wav: no WAV file"},
        {bad_rate, "b.wav: 44100 Hz, but the survey's sample_rate_hz is 48000"},
        {bad_channels, "b.wav: 3 channels, but the survey's microphones_m has 2"},
        {bad_no_frames, "b.wav: holds no sound"},
        {bad_short, "b.wav: 200 frames, but the slot of the last of 3 speakers begins at "
                    "frame 200"},
        {bad_fewer, "1 WAV files, but the survey's stage.positions_m has 2 entries"},
        {bad_more, "3 WAV files, but the survey's stage.positions_m has 2 entries"},
    };
    struct survey survey = make_survey();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        struct recording *r;
        write_good(*state, "a.wav");
        unlink(scratch_path(*state, "b.wav"));
        cases[i].make(*state);
        assert_int_equal(
            recording_open(&r, ((struct scratch *)*state)->folder, &survey, &why),
            -EINVAL);
        assert_null(r);
        assert_contains(why.text, cases[i].part);
    }
}

static void folders_without_a_recording_are_named(void **state)
{
    struct survey survey = make_survey();
    struct error why = {.text = ""};
    struct recording *r;
    assert_int_equal(recording_open(&r, scratch_path(*state, "absent"), &survey, &why),
                     -ENOENT);
    assert_contains(why.text, "absent: no folder of WAV files");
    assert_int_equal(
        recording_open(&r, ((struct scratch *)*state)->folder, &survey, &why), -EINVAL);
    assert_contains(why.text, "expected 2 WAV files, found none");
}

static void a_file_that_vanishes_after_opening_is_an_error(void **state)
{
    struct survey survey = make_survey();
    struct error why = {.text = ""};
    struct recording *r;
    float samples[MICROPHONES * 2 * FRAMES];
    uint32_t clipped[MICROPHONES], not_finite[MICROPHONES];
    write_good(*state, "a.wav");
    write_good(*state, "b.wav");
    assert_int_equal(
        recording_open(&r, ((struct scratch *)*state)->folder, &survey, &why), 0);
    unlink(scratch_path(*state, "b.wav"));
    assert_true(recording_read(r, 1, samples, clipped, not_finite, &why) < 0);
    assert_contains(why.text, "b.wav");
    assert_int_equal(recording_read(r, 0, samples, clipped, not_finite, &why), 0);
    recording_close(r);
}

/* Position k is what begins after k rounds of slots, and rings on into the next one. */
static void a_stage_that_does_not_stop_has_one_file(void **state)
{
    struct survey survey = make_survey();
    struct error why = {.text = ""};
    struct scratch *s = *state;
    size_t tail = tail_samples(&survey), n = FRAMES + tail;
    size_t whole = POSITIONS * FRAMES + tail;
    float *x = malloc(MICROPHONES * whole * sizeof *x);
    float *y = malloc(MICROPHONES * n * sizeof *y);
    uint32_t clipped[MICROPHONES], not_finite[MICROPHONES];
    struct recording *r;
    assert_true(x && y);
    for (size_t i = 0; i < MICROPHONES * whole; i++)
        x[i] = (float)sin(0.01 * (double)(i % 7919 * i));
    assert_int_equal(recording_write(s->folder, 0, MICROPHONES, whole, 48000, x, &why),
                     0);
    survey.continuous = true;
    if (recording_open(&r, s->folder, &survey, &why))
        fail_msg("%s", why.text);
    assert_int_equal(recording_frames(r), n);
    assert_int_equal(recording_spare_slots(r), 0);
    for (size_t k = 0; k < POSITIONS; k++) {
        assert_int_equal(recording_read(r, k, y, clipped, not_finite, &why), 0);
        for (size_t m = 0; m < MICROPHONES; m++)
            assert_memory_equal(y + m * n, x + m * whole + k * FRAMES, n * sizeof *x);
    }
    recording_close(r);
    assert_int_equal(recording_write(s->folder, 1, MICROPHONES, whole, 48000, x, &why),
                     0);
    assert_int_equal(recording_open(&r, s->folder, &survey, &why), -EINVAL);
    assert_contains(why.text, "2 WAV files");
    assert_contains(why.text, "continuous; expected one file");
    free(x);
    free(y);
}

static void what_is_written_reads_back(void **state)
{
    struct survey survey = make_survey();
    struct error why = {.text = ""};
    const char *folder = ((struct scratch *)*state)->folder;
    size_t n = FRAMES + tail_samples(&survey);
    float *x = malloc(MICROPHONES * n * sizeof *x),
          *y = malloc(MICROPHONES * n * sizeof *y);
    uint32_t clipped[MICROPHONES], not_finite[MICROPHONES];
    struct recording *r;
    assert_non_null(x);
    assert_non_null(y);
    for (size_t i = 0; i < MICROPHONES * n; i++)
        x[i] = (float)sin(0.01 * (double)(i * i));
    for (size_t p = 0; p < POSITIONS; p++)
        assert_int_equal(recording_write(folder, p, MICROPHONES, n, 48000, x, &why), 0);
    if (recording_open(&r, folder, &survey, &why))
        fail_msg("%s", why.text);
    assert_int_equal(recording_read(r, 1, y, clipped, not_finite, &why), 0);
    assert_memory_equal(x, y, MICROPHONES * n * sizeof *x);
    recording_close(r);
    assert_true(recording_write("/nowhere", 0, MICROPHONES, n, 48000, x, &why) < 0);
    assert_contains(why.text, "/nowhere/pos00.wav cannot be written");
    free(x);
    free(y);
}

static time_t date = 1700000000;

/* As libsndfile sees it. */
time_t time(time_t *out)
{
    if (out)
        *out = date;
    return date;
}

static size_t read_file(const char *path, char *out, size_t size)
{
    FILE *f = fopen(path, "rb");

    assert_non_null(f);
    size_t n = fread(out, 1, size, f);
    assert_true(n < size);
    fclose(f);
    return n;
}

static void equal_recordings_are_equal_files_whenever_they_are_written(void **state)
{
    static char bytes[2][8192];
    float x[MICROPHONES * FRAMES];
    struct error why = {.text = ""};
    struct scratch *s = *state;
    size_t n[2];

    for (size_t i = 0; i < MICROPHONES * FRAMES; i++)
        x[i] = (float)sin(0.01 * (double)(i * i));
    for (int i = 0; i < 2; i++) {
        date += 100 * i;
        assert_int_equal(
            recording_write(s->folder, 0, MICROPHONES, FRAMES, 48000, x, &why), 0);
        n[i] = read_file(scratch_path(s, "pos00.wav"), bytes[i], sizeof bytes[i]);
    }
    assert_int_equal(n[0], n[1]);
    assert_memory_equal(bytes[0], bytes[1], n[0]);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(samples_are_the_same_in_every_format),
        TEST(runs_at_full_scale_are_clipped_in_their_slot),
        TEST(flat_tops_of_float_files_are_clipped),
        TEST(samples_that_are_not_finite_become_0_and_are_counted),
        TEST(bad_recordings_are_named_with_what_was_expected),
        TEST(folders_without_a_recording_are_named),
        TEST(a_file_that_vanishes_after_opening_is_an_error),
        TEST(what_is_written_reads_back),
        TEST(equal_recordings_are_equal_files_whenever_they_are_written),
        TEST(a_stage_that_does_not_stop_has_one_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
