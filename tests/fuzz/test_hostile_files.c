/* SPDX-License-Identifier: MIT */
/* Files that were made to do harm, to all who read YAML, text and sound: refused within
 * 1 GB and some seconds. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <sys/resource.h>
#include <unistd.h>

#include "hal/recording/pings_file.h"
#include "hal/recording/recording.h"
#include "hal/room/scene.h"
#include "hal/survey/calibration.h"
#include "hal/survey/file.h"
#include "hal/survey/response_file.h"
#include "hal/survey/rig_file.h"
#include "nodes/anlos/psf/file.h"
#include "nodes/rt/launchfile.h"
#include "tests/msgs/memory_limit.h"

#define MB        ((size_t)1 << 20)
#define MAX_CPU_S 60 /* of all tests, with a sanitizer on a busy machine */

static struct error why;

/* The errors of all who may read it. */
static void assert_all_refuse(const char *path, int expected)
{
    struct survey s;
    struct scene *scene;
    struct rig rig;
    struct calibration *c;
    struct launchfile *l;

    assert_int_equal(survey_load(&s, path, &why), expected);
    assert_int_equal(scene_load(&scene, &s, path, &why), expected);
    assert_int_equal(rig_load(&rig, path, &why), expected);
    assert_int_equal(calibration_load(&c, path, &why), expected);
    assert_int_equal(launchfile_load(&l, path, NULL, &why), expected);
    assert_true(why.text[0]);
}

/* A file of `size` bytes: the text again and again. */
static const char *repeated(struct scratch *s, const char *text, size_t size)
{
    const char *path = scratch_path(s, "hostile.yaml");
    FILE *f = fopen(path, "w");

    assert_non_null(f);
    for (size_t n = strlen(text), at = 0; at < size; at += n)
        assert_int_equal(fwrite(text, 1, n, f), n);
    assert_int_equal(fclose(f), 0);
    return path;
}

static void a_file_of_a_gigabyte_is_refused_before_it_is_read(void **state)
{
    const char *path = scratch_write(*state, "large.yaml", "nodes: [scan]\n");

    assert_int_equal(truncate(path, 1 << 30), 0);
    assert_all_refuse(path, -EINVAL);
    assert_contains(why.text, "larger than");
}

/* Of what takes the most time and memory for its bytes. */
static void nothing_in_a_file_takes_memory_without_end(void **state)
{
    static const char *const texts[] = {
        "[", "{", "- ", "? ",   "a: ",    "a,",  "-\n", "&a ",
        "!", "%", "\"", "# \n", "--- \n", "|\n", "'"};

    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        assert_all_refuse(repeated(*state, texts[i], MB / 4), -EINVAL);
    assert_all_refuse(repeated(*state, "a,", MB), -EINVAL);
    assert_all_refuse(repeated(*state, "- a\n", MB), -EINVAL);
}

/* A list of lists of lists ... of the same: 9^12 elements out of 600 bytes. */
static void aliases_that_multiply_are_refused(void **state)
{
    char text[4000] = "speakers_m: &a0 [0, 0, 0]\n", line[128];

    for (int depth = 1; depth < 12; depth++) {
        snprintf(line, sizeof line,
                 "k%d: &a%d [*a%d, *a%d, *a%d, *a%d, *a%d, *a%d, *a%d, *a%d, *a%d]\n",
                 depth, depth, depth - 1, depth - 1, depth - 1, depth - 1, depth - 1,
                 depth - 1, depth - 1, depth - 1, depth - 1);
        strcat(text, line);
    }
    strcat(text, "nodes: *a11\nobjects: *a11\n");
    assert_all_refuse(scratch_write(*state, "laughs.yaml", text), -EINVAL);
    /* And one where every key is known. */
    assert_all_refuse(
        scratch_write(*state, "self.yaml",
                      "nodes: &n [*n, *n]\nstage: &s {uri: *s}\narray: &a [*a]\n"),
        -EINVAL);
}

static void counts_beyond_all_bounds_are_refused(void **state)
{
    struct survey s;
    char *text = malloc(3 * MB);
    size_t used = (size_t)sprintf(
        text, "sound_speed_m_s: 343\nsample_rate_hz: 48000\n"
              "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03}\n"
              "slot_samples: 1500\nmicrophones_m: [[0, 0, 0]]\nspeakers_m:\n");

    for (int i = 0; i < 100000; i++)
        used += (size_t)sprintf(text + used, "- [0, 0, %d]\n", i % 10);
    const char *path = scratch_write(*state, "survey.yaml", text);
    free(text);
    assert_int_equal(survey_load(&s, path, &why), -EINVAL);
    assert_contains(why.text, "at most 4096");
}

/* Paths stand in files that anyone may have written. */
static void what_has_no_end_is_no_file(void **state)
{
    struct scratch *s = *state;
    double(*pings)[2][3];
    struct survey_response r;
    struct psf_file psf;
    size_t n;
    char link_path[600];

    snprintf(link_path, sizeof link_path, "%s", scratch_path(s, "zero.txt"));
    assert_int_equal(symlink("/dev/zero", link_path), 0);
    assert_int_equal(pings_load(&pings, &n, "/dev/zero", &why), -EINVAL);
    assert_contains(why.text, "not a regular file");
    assert_int_equal(response_load(&r, s->folder, "zero", &why), -EINVAL);
    assert_int_equal(psf_file_load(&psf, "/dev/zero", &why), -EINVAL);
    assert_all_refuse("/dev/zero", -EINVAL);
    snprintf(link_path, sizeof link_path, "%s", scratch_path(s, "pipe.txt"));
    assert_int_equal(mkfifo(link_path, 0600), 0);
    assert_int_equal(pings_load(&pings, &n, link_path, &why), -EINVAL);
    assert_int_equal(response_load(&r, s->folder, "pipe", &why), -EINVAL);
    assert_int_equal(psf_file_load(&psf, link_path, &why), -EINVAL);
    assert_all_refuse(link_path, -EINVAL);
}

static void put_le(FILE *f, uint64_t value, int n_bytes)
{
    for (int i = 0; i < n_bytes; i++)
        fputc((int)(value >> 8 * i & 0xff), f);
}

/* A header that promises `frames` of n channels of a format, and no sound. */
static void write_wav(const char *path, unsigned format, unsigned n_channels,
                      unsigned rate, uint64_t size)
{
    FILE *f = fopen(path, "wb");

    assert_non_null(f);
    fputs("RIFF", f);
    put_le(f, 36 + size, 4);
    fputs("WAVEfmt ", f);
    put_le(f, 16, 4);
    put_le(f, format, 2);
    put_le(f, n_channels, 2);
    put_le(f, rate, 4);
    put_le(f, (uint64_t)rate * n_channels * 2, 4);
    put_le(f, n_channels * 2, 2);
    put_le(f, 16, 2);
    fputs("data", f);
    put_le(f, size, 4);
    put_le(f, 0, 8);
    assert_int_equal(fclose(f), 0);
}

static void a_wav_header_is_not_believed(void **state)
{
    struct scratch *s = *state;
    double place[1][3] = {{0}}, at[1] = {0};
    const struct survey survey = {.sound_speed_m_s = 343,
                                  .sample_rate_hz = 48000,
                                  .chirp_duration_s = 0.01,
                                  .slot_samples = 1500,
                                  .n_speakers = 1,
                                  .n_microphones = 1,
                                  .n_positions = 1,
                                  .speakers_m = place,
                                  .microphones_m = place,
                                  .stage_axis = {1, 0, 0},
                                  .stage_positions_m = at};
    const struct {
        unsigned format, n_channels, rate;
        uint64_t size;
    } headers[] = {
        {1, 1, 48000, 0xfffffff0},
        {1, 65535, 48000, 1000},
        {1, 0, 48000, 8},
        {1, 1, 0xffffffff, 8},
        {1, 1, 0, 8},
        {0x11, 1, 48000, 8},
        {0x55, 1, 48000, 8},
        {7, 1, 48000, 8},
    };
    struct recording *r;
    char path[600];

    snprintf(path, sizeof path, "%s", scratch_path(s, "pos00.wav"));
    for (size_t i = 0; i < sizeof headers / sizeof *headers; i++) {
        write_wav(path, headers[i].format, headers[i].n_channels, headers[i].rate,
                  headers[i].size);
        why.text[0] = '\0';
        assert_int_equal(recording_open(&r, s->folder, &survey, &why), -EINVAL);
        assert_contains(why.text, path);
    }
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)
    const struct CMUnitTest tests[] = {
        TEST(a_file_of_a_gigabyte_is_refused_before_it_is_read),
        TEST(nothing_in_a_file_takes_memory_without_end),
        TEST(aliases_that_multiply_are_refused),
        TEST(counts_beyond_all_bounds_are_refused),
        TEST(what_has_no_end_is_no_file),
        TEST(a_wav_header_is_not_believed),
    };
    const struct rlimit cpu = {MAX_CPU_S, MAX_CPU_S};
    if (memory_limit(1024 * MB) || setrlimit(RLIMIT_CPU, &cpu))
        return 1;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
