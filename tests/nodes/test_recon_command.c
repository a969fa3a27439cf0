/* SPDX-License-Identifier: MIT */
/* `anlos recon` on a recording of one point, computed here in double precision. */
#include <dirent.h>
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <sndfile.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/recon/job.h"
#include "nodes/rt/stop.h"
#include "tests/hal/folder.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

enum { RATE = 48000, CHIRP = 960, SLOT = 1920, MICS = 2, SPEAKERS = 2, POSITIONS = 3 };
enum { FRAMES = SPEAKERS * SLOT };

static const double sound_speed_m_s = 340.0;
static const double target_m[3] = {0.14, 0.1, 1.0};
static const double element_y_m[2] = {0.0, 0.2},
                    position_x_m[POSITIONS] = {0.0, 0.1, 0.2};

static const char survey_head[] =
    "sound_speed_m_s: 340\n"
    "sample_rate_hz: 48000\n"
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: "
    "0.02, phase: cosine}\n"
    "slot_samples: 1920\n"
    "speakers_m: [[0, 0, 0], [0, 0.2, 0]]\n"
    "microphones_m: [[0.08, 0, 0], [0.08, 0.2, 0]]\n"
    "stage: {axis: [1, 0, 0], positions_m: [0, 0.1, 0.2]}\n";
static const char survey_volume[] =
    "volume: {x_m: [0.04, 0.24, 0.01], y_m: [0, 0.2, 0.01], "
    "z_m: [0.8, 1.2, 0.005]}\n";

struct fixture {
    char folder[64];
    char survey[96], scene[96], background[96], out[128];
};

/* The chirp at a time after its start; 0 outside. */
static double chirp_at(double t)
{
    if (t < 0.0 || t >= 0.02)
        return 0.0;
    return cos(2.0 * M_PI * (2000.0 * t + 0.5 * 18000.0 / 0.02 * t * t));
}

static double distance(double x, double y, double z)
{
    return sqrt(x * x + y * y + z * z);
}

/* [frame][microphone]: direct sound, and the echo of the target when it is there. */
static void record(float *x, int position, bool with_target)
{
    for (int n = 0; n < FRAMES; n++) {
        for (int i = 0; i < MICS; i++) {
            double sum = 0.0;
            for (int j = 0; j < SPEAKERS; j++) {
                double t = (double)(n - j * SLOT) / RATE;
                double direct = distance(0.08, element_y_m[i] - element_y_m[j], 0.0);
                double out = distance(target_m[0] - position_x_m[position],
                                      target_m[1] - element_y_m[j], target_m[2]);
                double back = distance(target_m[0] - position_x_m[position] - 0.08,
                                       target_m[1] - element_y_m[i], target_m[2]);
                sum += 0.02 / direct * chirp_at(t - direct / sound_speed_m_s);
                if (with_target)
                    sum += 0.01 / (out * back) *
                           chirp_at(t - (out + back) / sound_speed_m_s);
            }
            x[n * MICS + i] = (float)sum;
        }
    }
}

static void write_wav(const char *folder, int position, const float *x, int channels,
                      int rate, int frames)
{
    char path[128];
    SF_INFO info = {.samplerate = rate,
                    .channels = channels,
                    .format = SF_FORMAT_WAV | SF_FORMAT_FLOAT};
    snprintf(path, sizeof path, "%s/pos%02d.wav", folder, position);
    SNDFILE *f = sf_open(path, SFM_WRITE, &info);
    assert_non_null(f);
    assert_int_equal(sf_writef_float(f, x, frames), frames);
    sf_close(f);
}

static void write_text(const char *path, const char *a, const char *b)
{
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(a, f);
    fputs(b, f);
    fclose(f);
}

static int set_up(void **state)
{
    static float x[FRAMES * MICS];
    struct fixture *f = calloc(1, sizeof *f);
    strcpy(f->folder, "/tmp/anlos-recon-XXXXXX");
    if (!f || !mkdtemp(f->folder))
        return -1;
    setenv("XDG_CACHE_HOME", f->folder, 1);
    snprintf(f->survey, sizeof f->survey, "%s/survey.yaml", f->folder);
    snprintf(f->scene, sizeof f->scene, "%s/scene", f->folder);
    snprintf(f->background, sizeof f->background, "%s/background", f->folder);
    snprintf(f->out, sizeof f->out, "%s/out/image", f->folder);
    mkdir(f->scene, 0777);
    mkdir(f->background, 0777);
    for (int k = 0; k < POSITIONS; k++) {
        record(x, k, true);
        write_wav(f->scene, k, x, MICS, RATE, FRAMES);
        record(x, k, false);
        write_wav(f->background, k, x, MICS, RATE, FRAMES);
    }
    write_text(f->survey, survey_head, survey_volume);
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *f = *state;
    int err = folder_remove(f->folder);
    free(f);
    return err;
}

static void run(struct fixture *f, struct command_result *r)
{
    char *words[] = {"recon",       "--survey", f->survey,
                     "--wav",       f->scene,   "--background",
                     f->background, "--method", "backprojection",
                     "--threads",   "2",        "--out",
                     f->out,        NULL};
    command_run(r, command_recon, words);
}

static bool exists(const char *path)
{
    struct stat st;
    return !stat(path, &st);
}

/* Exit code 2, the words in the message, and nothing left where the output would be. */
static void expect_refusal(struct fixture *f, const char *word, const char *second)
{
    struct command_result r;
    char parent[128];
    run(f, &r);
    if (r.code != 2 || !strstr(r.err, word) || !strstr(r.err, second))
        print_error("code %d: %s", r.code, r.err);
    assert_int_equal(r.code, 2);
    assert_int_equal(strncmp(r.err, "anlos recon: ", 13), 0);
    assert_non_null(strstr(r.err, word));
    assert_non_null(strstr(r.err, second));
    snprintf(parent, sizeof parent, "%s/out", f->folder);
    assert_false(exists(parent));
}

static void expect_usage(char *const words[], const char *text)
{
    struct command_result r;
    command_run(&r, command_recon, words);
    if (r.code != 2 || !strstr(r.err, text))
        print_error("code %d: %s", r.code, r.err);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, text));
    assert_non_null(strstr(r.err, "--help"));
}

static json_t *load(const struct fixture *f, const char *name)
{
    char path[160];
    snprintf(path, sizeof path, "%s/%s", f->out, name);
    json_t *j = json_load_file(path, 0, NULL);
    assert_non_null(j);
    return j;
}

static void expect_target(const struct fixture *f)
{
    json_t *j = load(f, "detections.json");
    const json_t *p =
        json_object_get(json_array_get(json_object_get(j, "detections"), 0), "virtual_m");
    assert_non_null(p);
    for (size_t a = 0; a < 3; a++)
        assert_near(json_number_value(json_array_get(p, a)), target_m[a],
                    a == 2 ? 0.01 : 0.02);
    json_decref(j);
}

static void a_point_lands_where_it_is(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    static const char *const files[] = {"volume.nrrd",       "projection_xy.png",
                                        "projection_xz.png", "projection_yz.png",
                                        "detections.json",   "report.json"};
    run(f, &r);
    assert_int_equal(r.code, 0);
    assert_string_equal(r.err, "");
    assert_non_null(strstr(r.out, f->out));
    expect_target(f);
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        char path[160];
        snprintf(path, sizeof path, "%s/%s", f->out, files[i]);
        assert_true(exists(path));
    }
    json_t *j = load(f, "report.json");
    const json_t *pings = json_object_get(j, "pings"),
                 *stages = json_object_get(j, "stages");
    assert_int_equal(json_integer_value(json_object_get(pings, "expected")), 6);
    assert_int_equal(json_integer_value(json_object_get(pings, "used")), 6);
    assert_int_equal(json_integer_value(json_object_get(pings, "lost")), 0);
    assert_string_equal(json_string_value(json_object_get(j, "method")),
                        "backprojection");
    assert_true(json_integer_value(json_object_get(j, "peak_memory_bytes")) > 0);
    const char *name;
    json_t *stage;
    double sum = 0.0;
    assert_int_equal(json_object_size(stages), 9);
    json_object_foreach((json_t *)stages, name, stage)
    {
        double wall_s = json_real_value(json_object_get(stage, "wall_s"));
        assert_true(wall_s >= 0.0);
        assert_true(json_real_value(json_object_get(stage, "cpu_s")) >= 0.0);
        sum += strcmp(name, "total") ? wall_s : -wall_s;
    }
    assert_true(sum <= 0.01); /* the stages do not take longer than the whole */
    json_decref(j);
}

/* The brightest voxel of what was written; the header ends with an empty line. */
static double peak_written(const struct fixture *f)
{
    char path[160], line[512];
    float x, most = 0.0f;

    snprintf(path, sizeof path, "%s/volume.nrrd", f->out);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    while (fgets(line, sizeof line, file) && strcmp(line, "\n") != 0)
        ;
    while (fread(&x, sizeof x, 1, file) == 1)
        most = fmaxf(most, x);
    fclose(file);
    assert_true(most > 0.0f);
    return most;
}

/* The weight that makes a point narrower would make more of what lies beside it. */
static void objects_are_those_of_the_image_before_it_is_sharpened(void **state)
{
    struct fixture *f = *state;
    static const char *const weights[2] = {"sharpen=0", "sharpen=4"};
    json_t *found[2];
    double peak[2];
    char path[2][160];

    for (int i = 0; i < 2; i++) {
        struct command_result r;
        snprintf(path[i], sizeof path[i], "%s/%d", f->folder, i);
        char *words[] = {"recon",
                         "--survey",
                         f->survey,
                         "--wav",
                         f->scene,
                         "--background",
                         f->background,
                         "--method",
                         "fast",
                         "--set",
                         (char *)(uintptr_t)weights[i],
                         "--threads",
                         "1",
                         "--out",
                         path[i],
                         NULL};
        command_run(&r, command_recon, words);
        assert_int_equal(r.code, 0);
        snprintf(f->out, sizeof f->out, "%s", path[i]);
        found[i] = load(f, "detections.json");
        peak[i] = peak_written(f);
    }
    assert_true(json_array_size(json_object_get(found[0], "detections")) > 0);
    assert_true(json_equal(json_object_get(found[0], "detections"),
                           json_object_get(found[1], "detections")));
    assert_true(fabs(peak[1] / peak[0] - 1.0) > 0.01); /* the image is another */
    json_decref(found[0]);
    json_decref(found[1]);
}

/* As sim and bag export leave it, and with a slash behind as the shell completes it. */
static void a_folder_is_a_recording_by_itself(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char folder[80], gone[160];

    snprintf(folder, sizeof folder, "%s/", f->folder);
    char *words[] = {"recon", "--out", f->out, folder, NULL};
    command_run(&r, command_recon, words);
    assert_int_equal(r.code, 0);
    assert_string_equal(r.err, ""); /* with its background, or it would warn */
    expect_target(f);

    snprintf(gone, sizeof gone, "%s.of.another.day", f->background);
    assert_int_equal(rename(f->background, gone), 0);
    command_run(&r, command_recon, words);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.err, "background"));
    char *named[] = {"recon", "--out", f->out, folder, "--background", gone, NULL};
    command_run(&r, command_recon, named);
    assert_int_equal(r.code, 0);
    assert_string_equal(r.err, "");
}

static void what_is_no_recording_is_told(void **state)
{
    struct fixture *f = *state;
    char mat[96];

#define RECORDING(...) ((char *const[]){"recon", "--out", f->out, __VA_ARGS__, NULL})
    expect_usage(RECORDING(f->scene), "expected survey.yaml and scene in it");
    expect_usage(RECORDING("/no/such"), "/no/such: No such file");
    expect_usage(RECORDING(f->folder, f->folder), "unexpected argument");
    expect_usage(RECORDING(f->folder, "--wav", f->scene), "beside --wav");
    expect_usage(RECORDING(f->survey, "--background", "b"), "--bag stands in place of");
    snprintf(mat, sizeof mat, "%s/x.mat", f->folder);
    write_text(mat, "", "");
    expect_usage(RECORDING(mat), "--traces (sound) or --confocal (light)");
#undef RECORDING
    assert_false(exists(f->out));
}

static void without_background_a_warning_says_so(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char *words[] = {"recon",    "--survey",       f->survey, "--wav", f->scene,
                     "--method", "backprojection", "--out",   f->out,  NULL};
    command_run(&r, command_recon, words);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.err, "no background"));
    json_t *j = load(f, "report.json");
    assert_int_equal(json_array_size(json_object_get(j, "warnings")), 1);
    json_decref(j);
}

/* Of the image. */
static float brightest(const struct fixture *f, const char *gate)
{
    struct recon_options o = {.survey = f->survey,
                              .wav = f->scene,
                              .background = f->background,
                              .method = "backprojection",
                              .threads = 1,
                              .window = WINDOW_HANN,
                              .compression = COMPRESSION_MATCHED_FILTER};
    struct recon_job job;
    struct error why = {0};
    char text[256];
    snprintf(text, sizeof text, "%s%s", survey_volume, gate);
    write_text(f->survey, survey_head, text);
    int err = recon_job_open(&job, &o, &why);
    if (!err)
        err = recon_job_plan(&job, &why);
    if (!err)
        err = recon_job_run(&job, &why);
    if (err)
        fail_msg("%s", why.text);
    float most = 0.0f;
    for (size_t v = 0; v < grid_size(&job.processing.grid); v++)
        most = fmaxf(most, job.intensity[v]);
    recon_job_clear(&job);
    return most;
}

/* The target is 1.00 to 1.02 m away, half the path; the volume begins at 0.8 m. */
static void a_recording_that_is_its_own_background_is_refused(void **state)
{
    struct fixture *f = *state;

    snprintf(f->background, sizeof f->background, "%s", f->scene);
    expect_refusal(f, f->scene, "the same sound");
}

static void a_volume_of_the_command_line_is_named_as_that(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    static char volume[] = "0,.1,.1,0,.1,.1,50,51,1";
    char *words[] = {"recon",    "--survey", f->survey, "--wav", f->scene,
                     "--volume", volume,     "--out",   f->out,  NULL};

    command_run(&r, command_recon, words);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "anlos recon: --volume: z_m begins 50"));
}

static void a_background_that_is_louder_than_the_scene_is_warned_of(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char scene[sizeof f->scene];

    run(f, &r);
    assert_int_equal(r.code, 0);
    assert_null(strstr(r.err, "swapped"));
    memcpy(scene, f->scene, sizeof scene);
    memcpy(f->scene, f->background, sizeof f->scene);
    memcpy(f->background, scene, sizeof f->background);
    run(f, &r);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.err, "swapped?"));
}

static void what_stands_outside_of_the_gate_is_not_imaged(void **state)
{
    const struct fixture *f = *state;
    float seen = brightest(f, "gate_m: [0.3, 1.2]\n");
    assert_true(seen > 0.0f);
    assert_true(brightest(f, "gate_m: [0.3, 0.92]\n") < 1e-3f * seen);
    assert_true(brightest(f, "gate_m: [1.1, 1.3]\n") < 1e-3f * seen);
}

/* Nothing stands in the volume, and what is brightest there is what the point beyond a
 * side leaves in it: hardly less than that is, by so few pairs. */
static void what_is_seen_beside_something_louder_is_less_sure(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    static char volume[] = "-.5,-.2,.02,0,.2,.02,.8,1.2,.01";
    char *words[] = {"recon",  "--survey",     f->survey,     "--wav",
                     f->scene, "--background", f->background, "--method",
                     "fast",   "--out",        f->out,        "--volume",
                     volume,   "--threads",    "1",           NULL};

    command_run(&r, command_recon, words);
    assert_int_equal(r.code, 0);
    json_t *j = load(f, "detections.json");
    const json_t *d, *all = json_object_get(j, "detections");
    size_t i, n = 0;
    json_array_foreach(all, i, d)
    {
        n++;
        assert_true(json_number_value(json_object_get(d, "existence")) < 0.95);
    }
    assert_true(n > 0);
    json_decref(j);
}

static void a_second_run_replaces_the_first(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    run(f, &r);
    assert_int_equal(r.code, 0);
    run(f, &r);
    assert_int_equal(r.code, 0);
    DIR *d = opendir(f->out);
    int n = 0;
    for (struct dirent *e = readdir(d); e; e = readdir(d))
        n += e->d_name[0] != '.' || strlen(e->d_name) > 2;
    closedir(d);
    assert_int_equal(n, 6);
}

static void spoil_channel(struct fixture *f, int position, int channel,
                          float (*spoil)(float x, int n))
{
    static float x[FRAMES * MICS];
    record(x, position, true);
    for (int n = 0; n < FRAMES; n++)
        x[n * MICS + channel] = spoil(x[n * MICS + channel], n);
    write_wav(f->scene, position, x, MICS, RATE, FRAMES);
}

static float silent(float x, int n)
{
    (void)x;
    (void)n;
    return 0.0f;
}

static float nan_once(float x, int n)
{
    return n == 2500 ? NAN : x;
}

static float limited(float x, int n)
{
    (void)n;
    return fmaxf(fminf(x, 0.05f), -0.05f);
}

static void a_silent_microphone_is_named_and_left_out(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    for (int k = 0; k < POSITIONS; k++)
        spoil_channel(f, k, 1, silent);
    run(f, &r);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.err, "microphone 2: silent in 3 of 3 positions"));
    json_t *j = load(f, "report.json");
    const json_t *masked = json_object_get(
        json_object_get(json_object_get(j, "channels"), "scene"), "microphones_masked");
    assert_int_equal(json_array_size(masked), 1);
    assert_int_equal(json_integer_value(json_array_get(masked, 0)), 2);
    json_decref(j);
}

static void a_nan_is_counted_and_its_position_left_out(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    spoil_channel(f, 1, 0, nan_once);
    run(f, &r);
    assert_int_equal(r.code, 0);
    assert_non_null(
        strstr(r.err, "microphone 1: 1 samples not finite in 1 of 3 positions"));
    expect_target(f);
}

static void clipping_is_counted_in_the_report(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    spoil_channel(f, 0, 0, limited);
    run(f, &r);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.err, "microphone 1:"));
    assert_non_null(strstr(r.err, "clipped"));
    json_t *j = load(f, "report.json");
    const json_t *clipped = json_object_get(
        json_object_get(json_object_get(j, "channels"), "scene"), "clipped_samples");
    assert_true(json_integer_value(json_array_get(clipped, 0)) > 0);
    assert_int_equal(json_integer_value(json_array_get(clipped, 1)), 0);
    json_decref(j);
}

static void a_recording_of_silence_is_refused(void **state)
{
    struct fixture *f = *state;
    static float x[FRAMES * MICS];
    for (int k = 0; k < POSITIONS; k++)
        write_wav(f->scene, k, x, MICS, RATE, FRAMES);
    expect_refusal(f, f->scene, "no microphone is usable");
}

static void missing_files_are_named(void **state)
{
    struct fixture *f = *state;
    char path[128];
    snprintf(path, sizeof path, "%s/pos02.wav", f->scene);
    unlink(path);
    expect_refusal(f, f->scene, "3");
    folder_remove(f->scene);
    expect_refusal(f, f->scene, "");
    mkdir(f->scene, 0777);
    expect_refusal(f, f->scene, "");
    unlink(f->survey);
    expect_refusal(f, f->survey, "");
}

static void more_files_than_positions_are_refused(void **state)
{
    struct fixture *f = *state;
    static float x[FRAMES * MICS];
    record(x, 0, true);
    write_wav(f->background, 3, x, MICS, RATE, FRAMES);
    expect_refusal(f, f->background, "3");
}

static void damaged_files_are_named(void **state)
{
    struct fixture *f = *state;
    char path[128];
    snprintf(path, sizeof path, "%s/pos01.wav", f->scene);
    assert_int_equal(truncate(path, 5000), 0);
    expect_refusal(f, "pos01.wav", "");
    assert_int_equal(truncate(path, 0), 0);
    expect_refusal(f, "pos01.wav", "");
    write_text(path, "this is no sound", "");
    expect_refusal(f, "pos01.wav", "");
}

static void wrong_rate_and_channels_are_told_with_what_was_expected(void **state)
{
    struct fixture *f = *state;
    static float x[FRAMES * 3];
    write_wav(f->scene, 1, x, MICS, 44100, FRAMES);
    expect_refusal(f, "pos01.wav", "48000");
    write_wav(f->scene, 1, x, 3, RATE, FRAMES);
    expect_refusal(f, "pos01.wav", "2");
    write_wav(f->scene, 1, x, MICS, RATE, SLOT - 1);
    expect_refusal(f, "pos01.wav", "");
}

static void a_wrong_survey_is_told_by_line_and_field(void **state)
{
    struct fixture *f = *state;
    write_text(f->survey, survey_head, "volumes: 3\n");
    expect_refusal(f, "survey.yaml:8", "volumes");
    write_text(f->survey, survey_head, "gate_m: [0.5, 99]\n");
    expect_refusal(f, f->survey, "gate_m");
    write_text(f->survey, survey_head, "gate_m: [0.5, \n");
    expect_refusal(f, f->survey, "");
    write_text(f->survey, survey_head + strlen("sound_speed_m_s: 340\n"),
               "sound_speed_m_s: 34\n");
    expect_refusal(f, f->survey, "sound_speed_m_s");
    write_text(f->survey, survey_head,
               "volume: {x_m: [0, 1, 0.01], y_m: [0, 1, 0.01], z_m: [8, 9, 0.01]}\n");
    expect_refusal(f, f->survey, "volume");
}

static void what_a_method_cannot_do_is_told_with_the_survey(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char *words[] = {"recon",    "--survey", f->survey, "--wav", f->scene,
                     "--method", "fast",     "--out",   f->out,  NULL};
    write_text(f->survey, survey_head,
               "volume: {x_m: [0, 1, 0.1], y_m: [0, 1, 0.1], z_m: [-2, -1, 0.1]}\n");
    command_run(&r, command_recon, words);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, f->survey));
    assert_non_null(strstr(r.err, "method 'fast' cannot image this survey"));
    assert_false(exists(f->out));
}

static void an_output_that_cannot_be_written_is_refused_before_the_work(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    snprintf(f->out, sizeof f->out, "%s/image", f->survey); /* below a file */
    run(f, &r);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, f->out));
}

static int recon_with_a_full_disk(int argc, char **argv)
{
    struct rlimit limit = {20000, 20000};
    return setrlimit(RLIMIT_FSIZE, &limit) ? 99 : command_recon(argc, argv);
}

static void a_full_disk_ends_with_1_and_leaves_nothing(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char parent[128];
    char *words[] = {"recon",    "--survey",       f->survey, "--wav", f->scene,
                     "--method", "backprojection", "--out",   f->out,  NULL};
    command_run(&r, recon_with_a_full_disk, words);
    assert_int_equal(r.code, 1);
    assert_non_null(strstr(r.err, f->out));
    assert_null(strstr(r.err, ".unfinished"));
    snprintf(parent, sizeof parent, "%s/out", f->folder);
    assert_false(exists(parent));
}

static void wrong_arguments_are_told_with_a_hint(void **state)
{
    (void)state;
#define WORDS(...) ((char *const[]){"recon", __VA_ARGS__, NULL})
    expect_usage(WORDS("--backgroud", "x"), "did you mean --background?");
    expect_usage(WORDS("--survey"), "--survey: expected a value");
    expect_usage(WORDS("--zzz"), "--zzz: no such option");
    expect_usage(WORDS("-q"), "-q: no such option");
    expect_usage(WORDS("--help=x"), "--help=x: there is no option --x");
    expect_usage(WORDS("--out", "x"), "a RECORDING is missing: its folder or bag");
    expect_usage(WORDS("--wav", "x"), "--survey FILE is missing");
    expect_usage(WORDS("--survey", "x"), "--wav DIR is missing");
    expect_usage(WORDS("--survey", "x", "--wav", "y"), "--out DIR is missing");
    expect_usage(WORDS("--threads", "0"), "1 to 256");
    expect_usage(WORDS("--threads", "-1"), "1 to 256");
    expect_usage(WORDS("--threads", "2x"), "1 to 256");
    expect_usage(WORDS("--window", "blackman"), "hann");
    expect_usage(WORDS("--compression", "zip"), "matched_filter");
    expect_usage(
        WORDS("--survey", "x", "--wav", "y", "--out", "z", "--method", "magic"),
        "--method magic: expected auto, fast, backprojection, confocal, lct, paper");
    expect_usage(WORDS("--method", "backprojektion"), "did you mean backprojection?");
    expect_usage(WORDS("--survey", "x", "--wav", "y", "--out", "z", "--method", "fk"),
                 "--method fk: only for --confocal");
    expect_usage(WORDS("--set", "l2=1"),
                 "--set l2: no such option; expected one of base");
    expect_usage(WORDS("--set", "l1"), "expected l1=VALUE");
    expect_usage(WORDS("--set", "l1=2"), "--set l1=2: expected 0 to 1");
    expect_usage(WORDS("--survey", "x", "--wav", "y", "--out", "z", "--method",
                       "backprojection", "--set", "l1=0.1"),
                 "--set l1: method 'backprojection' does not use it");
    expect_usage(WORDS("--survey", "x", "--wav", "y", "--out", "z", "--psf", "p"),
                 "--psf is for --method iterative");
    expect_usage(WORDS("--survey", "x", "--wav", "y", "--out", "z", "--psf", "p",
                       "--method", "iterative", "--set", "base=lct"),
                 "--psf sharpens an image");
    expect_usage(WORDS("--survey", "x", "--wav", "y", "--out", "z", "w"),
                 "w: unexpected argument beside --survey");
#undef WORDS
}

static void help_teaches_and_ends_with_0(void **state)
{
    (void)state;
    struct command_result r;
    char *words[] = {"recon", "--help", NULL};
    command_run(&r, command_recon, words);
    assert_int_equal(r.code, 0);
    static const char *const parts[] = {"usage:",  "--background", "default",
                                        "example", "volume.nrrd",  "exit codes",
                                        "l1=0.05", "snr_db=20",    "--psf"};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
        assert_non_null(strstr(r.out, parts[i]));
}

static void ctrl_c_stops_between_positions(void **state)
{
    struct fixture *f = *state;
    struct recon_options o = {.survey = f->survey,
                              .wav = f->scene,
                              .method = "backprojection",
                              .out = f->out,
                              .threads = 2,
                              .window = WINDOW_HANN};
    struct recon_job job;
    struct error why = {0};
    assert_int_equal(recon_job_open(&job, &o, &why), 0);
    assert_int_equal(recon_job_plan(&job, &why), 0);
    interrupt_catch();
    raise(SIGINT);
    assert_int_equal(recon_job_run(&job, &why), -EINTR);
    assert_int_equal(imager_pings(job.imager), 0);
    recon_job_clear(&job);
    signal(SIGINT, SIG_DFL);
    signal(SIGTERM, SIG_DFL);
}

/* Back-projection takes seconds, and plans of other methods some tenths. */
static void ctrl_c_ends_what_is_planned_and_what_is_imaged(void **state)
{
    struct fixture *f = *state;
    struct recon_options o = {.survey = f->survey,
                              .wav = f->scene,
                              .method = "backprojection",
                              .out = f->out,
                              .threads = 2,
                              .window = WINDOW_HANN};
    struct recon_job job;
    struct error why = {0};
    interrupt_catch();
    assert_int_equal(recon_job_open(&job, &o, &why), 0);
    assert_int_equal(recon_job_plan(&job, &why), 0);
    assert_false(pool_stopped(job.pool));
    raise(SIGINT);
    assert_int_equal(imager_image(job.imager, job.intensity), -ECANCELED);
    recon_job_clear(&job);
    assert_int_equal(recon_job_open(&job, &o, &why), 0);
    assert_int_equal(recon_job_plan(&job, &why), -EINTR);
    assert_string_equal(why.text, "interrupted");
    assert_null(job.imager);
    recon_job_clear(&job);
    signal(SIGINT, SIG_DFL);
    signal(SIGTERM, SIG_DFL);
}

#define test(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        test(a_point_lands_where_it_is),
        test(objects_are_those_of_the_image_before_it_is_sharpened),
        test(a_folder_is_a_recording_by_itself),
        test(what_is_no_recording_is_told),
        test(without_background_a_warning_says_so),
        test(a_recording_that_is_its_own_background_is_refused),
        test(a_volume_of_the_command_line_is_named_as_that),
        test(a_background_that_is_louder_than_the_scene_is_warned_of),
        test(what_stands_outside_of_the_gate_is_not_imaged),
        test(what_is_seen_beside_something_louder_is_less_sure),
        test(a_second_run_replaces_the_first),
        test(a_silent_microphone_is_named_and_left_out),
        test(a_nan_is_counted_and_its_position_left_out),
        test(clipping_is_counted_in_the_report),
        test(a_recording_of_silence_is_refused),
        test(missing_files_are_named),
        test(more_files_than_positions_are_refused),
        test(damaged_files_are_named),
        test(wrong_rate_and_channels_are_told_with_what_was_expected),
        test(a_wrong_survey_is_told_by_line_and_field),
        test(what_a_method_cannot_do_is_told_with_the_survey),
        test(an_output_that_cannot_be_written_is_refused_before_the_work),
        test(a_full_disk_ends_with_1_and_leaves_nothing),
        test(wrong_arguments_are_told_with_a_hint),
        test(help_teaches_and_ends_with_0),
        test(ctrl_c_stops_between_positions), /* these last: they have had threads */
        test(ctrl_c_ends_what_is_planned_and_what_is_imaged),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
