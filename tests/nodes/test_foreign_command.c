/* SPDX-License-Identifier: MIT */
/* `anlos recon` on what other laboratories recorded: traces, and pings with places of
 * their own in one WAV. */
#include <dirent.h>
#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <sndfile.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/anlos/commands.h"
#include "tests/hal/folder.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"
#include "tests/nodes/traces_write.h"

#define VOLUME "-0.02,0.04,0.002,-0.01,0.05,0.002,-0.04,0.03,0.005"

enum { RATE = 96000, SLOT = 1100, CHIRP = 480 };

static const struct scatterer point = {{0.0123, 0.0213, -0.0052}, 1.0};

struct fixture {
    struct turntable turntable;
    char folder[64], out[96], a[96], b[96];
};

static int set_up(void **state)
{
    struct fixture *f = calloc(1, sizeof *f);
    strcpy(f->folder, "/tmp/anlos-foreign-XXXXXX");
    if (!mkdtemp(f->folder))
        return -1;
    setenv("XDG_CACHE_HOME", f->folder, 1);
    turntable_default(&f->turntable);
    snprintf(f->out, sizeof f->out, "%s/out", f->folder);
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

static void expect_point(const struct fixture *f)
{
    char path[160];
    snprintf(path, sizeof path, "%s/detections.json", f->out);
    json_t *j = json_load_file(path, 0, NULL);
    const json_t *list = json_object_get(j, "detections");
    assert_int_equal(json_array_size(list), 1);
    const json_t *at = json_object_get(json_array_get(list, 0), "virtual_m");
    for (size_t a = 0; a < 3; a++)
        assert_near(json_number_value(json_array_get(at, a)), point.at_m[a], 1e-3);
    json_decref(j);
}

static void write_mat(struct fixture *f)
{
    struct traces_write w = {.format = {0.0035, 100000.0, 20000.0, 350}};
    w.silent[5] = w.nan[6] = true;
    snprintf(f->a, sizeof f->a, "%s/traces.mat", f->folder);
    traces_write(&w, &f->turntable, f->a, &point, 1);
}

static void a_point_in_traces_is_within_a_millimetre(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    write_mat(f);
    char *words[] = {"recon",    "--traces",       f->a,    "--volume", VOLUME,
                     "--method", "backprojection", "--out", f->out,     NULL};
    command_run(&r, command_recon, words);
    if (r.code)
        print_error("%s", r.err);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.err, "1 traces have samples that are not finite"));
    assert_non_null(strstr(r.err, "1 traces are silent"));
    expect_point(f);
    char path[160];
    snprintf(path, sizeof path, "%s/report.json", f->out);
    json_t *j = json_load_file(path, 0, NULL);
    const json_t *pings = json_object_get(j, "pings");
    assert_int_equal(json_integer_value(json_object_get(pings, "expected")), 180);
    assert_int_equal(json_integer_value(json_object_get(pings, "used")), 178);
    assert_int_equal(json_integer_value(json_object_get(pings, "lost")), 2);
    const json_t *recording = json_object_get(j, "recording");
    assert_string_equal(json_string_value(json_object_get(recording, "traces")), f->a);
    json_decref(j);
}

static void the_other_methods_for_any_array_find_it_too(void **state)
{
    static char method[2][12] = {"incoherent", "sparse"};
    struct fixture *f = *state;
    write_mat(f);
    for (int q = 0; q < 2; q++) {
        struct command_result r;
        char *words[] = {"recon",    "--traces", f->a,    "--volume", VOLUME,
                         "--method", method[q],  "--out", f->out,     NULL};
        command_run(&r, command_recon, words);
        if (r.code)
            print_error("%s", r.err);
        assert_int_equal(r.code, 0);
        assert_non_null(strstr(r.out, method[q]));
        expect_point(f);
    }
}

/* Nobody named a method: the one that takes any geometry. */
static void expect_chosen(const struct fixture *f, const struct command_result *r)
{
    char path[160];
    snprintf(path, sizeof path, "%s/report.json", f->out);
    json_t *j = json_load_file(path, 0, NULL);
    assert_string_equal(json_string_value(json_object_get(j, "method")),
                        "backprojection");
    assert_string_equal(json_string_value(json_object_get(j, "method_because")),
                        "each ping has places of its own");
    json_decref(j);
    assert_non_null(
        strstr(r->out, "method backprojection (each ping has places of its own)"));
    assert_null(strstr(r->out, "wall"));
}

static void a_survey_may_name_the_volume_of_traces(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    write_mat(f);
    snprintf(f->b, sizeof f->b, "%s/place.yaml", f->folder);
    FILE *place = fopen(f->b, "w");
    fputs("volume:\n  x_m: [-0.02, 0.04, 0.002]\n  y_m: [-0.01, 0.05, 0.002]\n"
          "  z_m: [-0.04, 0.03, 0.005]\n",
          place);
    fclose(place);
    char *words[] = {"recon", "--traces", f->a, "--survey", f->b, "--out", f->out, NULL};
    command_run(&r, command_recon, words);
    if (r.code)
        print_error("%s", r.err);
    assert_int_equal(r.code, 0);
    expect_point(f);
    expect_chosen(f, &r);
    assert_non_null(strstr(r.out, "1 object, positions as tx_m and rx_m have them"));
}

/* Writes the place that the gate is of, and images the traces there; the brightest. */
static float brightest(struct fixture *f, const char *gate)
{
    struct command_result r;
    char path[160];
    int before = 0, c;
    float most = 0.0f, v;
    snprintf(f->b, sizeof f->b, "%s/place.yaml", f->folder);
    FILE *file = fopen(f->b, "w");
    fprintf(file,
            "volume: {x_m: [-0.02, 0.3, 0.01], y_m: [-0.01, 0.05, 0.01], "
            "z_m: [-0.04, 0.03, 0.005]}\n%s",
            gate);
    fclose(file);
    char *words[] = {"recon", "--traces", f->a, "--survey", f->b, "--out", f->out, NULL};
    command_run(&r, command_recon, words);
    if (r.code)
        fail_msg("code %d: %s", r.code, r.err);
    snprintf(path, sizeof path, "%s/volume.nrrd", f->out);
    file = fopen(path, "rb");
    while ((c = fgetc(file)) != EOF && !(before == '\n' && c == '\n'))
        before = c;
    while (fread(&v, sizeof v, 1, file) == 1)
        most = fmaxf(most, v);
    fclose(file);
    return most;
}

/* Pings go around the point 0.8 to 0.9 m away; the volume reaches up to 0.55 m to some.
 */
static void traces_outside_of_the_gate_are_not_imaged(void **state)
{
    struct fixture *f = *state;
    write_mat(f);
    float seen = brightest(f, "gate_m: [0.6, 1.1]\n");
    assert_true(seen > 0.0f);
    assert_true(brightest(f, "gate_m: [0.6, 0.7]\n") < 1e-3f * seen);
    assert_true(brightest(f, "gate_m: [1.0, 1.1]\n") < 1e-3f * seen);
}

static void expect_refusal(char *const words[], const char *part)
{
    struct command_result r;
    struct stat st;
    command_run(&r, command_recon, words);
    if (r.code != 2 || !strstr(r.err, part))
        fail_msg("code %d: \"%s\" has no \"%s\"", r.code, r.err, part);
    for (size_t i = 0; words[i]; i++)
        if (!strcmp(words[i], "--out"))
            assert_int_equal(stat(words[i + 1], &st), -1);
}

static void bad_arguments_say_what_was_expected(void **state)
{
    struct fixture *f = *state;
    write_mat(f);
    snprintf(f->b, sizeof f->b, "%s/none.mat", f->folder);
    static char method[] = "backprojection", short_volume[] = "0,1,2",
                text[] = "0,1,.1,0,1,.1,0,1,x", turned[] = "0,1,.1,1,0,.1,0,1,.1",
                elsewhere[] = "9,9.1,.1,0,1,.1,0,1,.1", volume[] = VOLUME;
    char *none[] = {"recon", "--traces", f->a, "--method", method, "--out", f->out, NULL};
    expect_refusal(none, "traces.mat: expected --volume, or --survey with a volume");
    char *few[] = {"recon",    "--traces", f->a,    "--volume", short_volume,
                   "--method", method,     "--out", f->out,     NULL};
    expect_refusal(few, "--volume 0,1,2: expected nine numbers");
    few[4] = text;
    expect_refusal(few, "expected nine numbers");
    few[4] = turned;
    expect_refusal(few, "--volume: y is 1, 0, 0.1; expected minimum <= maximum");
    few[4] = elsewhere;
    expect_refusal(few, "echoes of the volume arrive from");
    few[4] = volume;
    few[2] = f->b;
    expect_refusal(few, "none.mat: No such file");
    char *both[] = {"recon",    "--traces", f->a,    "--wav", f->folder,
                    "--volume", volume,     "--out", f->out,  NULL};
    expect_refusal(both, "--traces stands in place of --wav");
    static char window[] = "hamming", compression[] = "deramp";
    char *chirps[] = {"recon",    "--traces", f->a,    "--volume", volume,
                      "--window", window,     "--out", f->out,     NULL};
    expect_refusal(chirps, "--window is for --wav; --traces are compressed already");
    chirps[5] = "--compression";
    chirps[6] = compression;
    expect_refusal(chirps, "--compression is for --wav; --traces are compressed already");
    static char fast[] = "fast";
    char *stage[] = {"recon",    "--traces", f->a,    "--volume", volume,
                     "--method", fast,       "--out", f->out,     NULL};
    expect_refusal(stage, "method 'fast' cannot image this survey: ");
}

static void a_gate_that_holds_nothing_is_refused(void **state)
{
    static const struct {
        const char *gate, *part;
    } cases[] = {
        {"[3.0, 1.0]", "place.yaml:2: gate_m is [3, 1], expected 0 <= near < far"},
        {"[2.0, 3.0]", "outside the gate of 2.00 to 3.00 m; change gate_m or volume"},
        {"[0.2, 0.55]", "gate_m: 0.20 to 0.55 m, but the traces of"},
    };
    struct fixture *f = *state;
    write_mat(f);
    snprintf(f->b, sizeof f->b, "%s/place.yaml", f->folder);
    char *words[] = {"recon", "--traces", f->a, "--survey", f->b, "--out", f->out, NULL};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        FILE *place = fopen(f->b, "w");
        fprintf(place,
                "volume: {x_m: [-0.5, 0.5, 0.1], y_m: [0, 0.1, 0.1], z_m: [0, 0.1, 0.1]}"
                "\ngate_m: %s\n",
                cases[i].gate);
        fclose(place);
        expect_refusal(words, cases[i].part);
    }
}

/* -- one WAV of slots -------------------------------------------------------------------
 */

static double chirp_at(double t)
{
    double duration = (double)CHIRP / RATE;
    if (t < 0.0 || t >= duration)
        return 0.0;
    return cos(2.0 * M_PI * (10000.0 * t + 0.5 * 20000.0 / duration * t * t));
}

/* The direct sound and the point's echo, from 11.5 samples after a slot's beginning. */
static void write_recording(struct fixture *f)
{
    static float x[TURNTABLE_PINGS * SLOT], replica[CHIRP];
    SF_INFO info = {
        .samplerate = RATE, .channels = 1, .format = SF_FORMAT_WAV | SF_FORMAT_FLOAT};
    char path[160];
    for (size_t k = 0; k < TURNTABLE_PINGS; k++) {
        const double *s = f->turntable.pings_m[k][0], *m = f->turntable.pings_m[k][1];
        double rs = reference_distance(s, point.at_m);
        double rm = reference_distance(m, point.at_m), direct = reference_distance(s, m);
        for (int i = 0; i < SLOT; i++) {
            double t = (i - 11.5) / RATE;
            x[k * SLOT + (size_t)i] =
                (float)(0.1 / (rs * rm) * chirp_at(t - (rs + rm) / 343.0) +
                        0.02 / direct * chirp_at(t - direct / 343.0));
        }
    }
    for (int i = 0; i < CHIRP; i++)
        replica[i] = (float)chirp_at((double)i / RATE);
    snprintf(f->b, sizeof f->b, "%s/wav", f->folder);
    mkdir(f->b, 0777);
    snprintf(path, sizeof path, "%s/all.wav", f->b);
    SNDFILE *w = sf_open(path, SFM_WRITE, &info);
    sf_writef_float(w, x, TURNTABLE_PINGS * SLOT);
    sf_close(w);
    snprintf(path, sizeof path, "%s/replica.wav", f->folder);
    w = sf_open(path, SFM_WRITE, &info);
    sf_writef_float(w, replica, CHIRP);
    sf_close(w);
    snprintf(path, sizeof path, "%s/pings.csv", f->folder);
    FILE *csv = fopen(path, "w");
    for (size_t k = 0; k < TURNTABLE_PINGS; k++)
        for (int c = 0; c < 6; c++)
            fprintf(csv, "%.12g%c", f->turntable.pings_m[k][c / 3][c % 3],
                    c < 5 ? ',' : '\n');
    fclose(csv);
    snprintf(f->a, sizeof f->a, "%s/survey.yaml", f->folder);
    FILE *survey = fopen(f->a, "w");
    fprintf(survey,
            "sound_speed_m_s: 343\nsample_rate_hz: %d\nslot_samples: %d\n"
            "latency_samples: 11.5\npings: pings.csv\nreplica: replica.wav\n"
            "volume: {x_m: [-0.02, 0.04, 0.002], y_m: [-0.01, 0.05, 0.002], "
            "z_m: [-0.04, 0.03, 0.005]}\n",
            RATE, SLOT);
    fclose(survey);
}

static void pings_in_one_file_are_imaged(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    write_recording(f);
    char *words[] = {"recon", "--survey", f->a, "--wav", f->b, "--out", f->out, NULL};
    command_run(&r, command_recon, words);
    if (r.code)
        print_error("%s", r.err);
    assert_int_equal(r.code, 0);
    assert_null(strstr(r.err, "is coarse"));
    expect_point(f);
    expect_chosen(f, &r);
    assert_non_null(strstr(r.out, "positions in the frame of the pings"));
}

/* The file of places without its fifth line. */
static void a_ping_without_a_place_is_said(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char path[160], line[256], kept[TURNTABLE_PINGS * 128] = "";
    write_recording(f);
    snprintf(path, sizeof path, "%s/pings.csv", f->folder);
    FILE *csv = fopen(path, "r");
    for (int k = 0; fgets(line, sizeof line, csv); k++)
        if (k != 4)
            strcat(kept, line);
    fclose(csv);
    csv = fopen(path, "w");
    fputs(kept, csv);
    fclose(csv);
    char *words[] = {"recon", "--survey", f->a, "--wav", f->b, "--out", f->out, NULL};
    command_run(&r, command_recon, words);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.err, "wav holds 180 slots, but pings names 179: "));
}

static void what_pings_cannot_have_is_said(void **state)
{
    struct fixture *f = *state;
    write_recording(f);
    char *words[] = {
        "recon",          "--survey",      f->a,     "--wav", f->b,   "--method",
        "backprojection", "--compression", "deramp", "--out", f->out, NULL};
    expect_refusal(words, "deramp mixes with a chirp, and the survey names a replica");
    words[6] = "fast";
    words[8] = "matched_filter";
    expect_refusal(words, "each ping has places of its own");
    FILE *survey = fopen(f->a, "w");
    fprintf(survey,
            "sound_speed_m_s: 343\nsample_rate_hz: %d\nslot_samples: %d\n"
            "pings: pings.csv\nreplica: replica.wav\n",
            RATE, SLOT);
    fclose(survey);
    words[6] = "backprojection";
    expect_refusal(words, "survey.yaml: volume: expected x_m, y_m and z_m");
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_point_in_traces_is_within_a_millimetre),
        TEST(the_other_methods_for_any_array_find_it_too),
        TEST(a_survey_may_name_the_volume_of_traces),
        TEST(traces_outside_of_the_gate_are_not_imaged),
        TEST(a_gate_that_holds_nothing_is_refused),
        TEST(bad_arguments_say_what_was_expected),
        TEST(pings_in_one_file_are_imaged),
        TEST(a_ping_without_a_place_is_said),
        TEST(what_pings_cannot_have_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
