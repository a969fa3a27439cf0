/* SPDX-License-Identifier: MIT */
/* `anlos recon --method auto`: what it says, chooses, keeps and refuses. */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/anlos/recon/auto.h"
#include "nodes/anlos/recon/report.h"
#include "nodes/rt/stop.h"
#include "tests/nodes/near.h"
#include "tests/nodes/simulated.h"
#include "tests/nodes/traces_write.h"

#define WORDS 24

static const double truth_m[3] = {0.13, 0.11, 1.2}; /* as imaged, behind the wall */

static int set_up(void **state)
{
    int err = simulated_create(state);
    if (err)
        return err;
    simulated_record(*state, "free",
                     SIMULATED_BASE SIMULATED_POINT SIMULATED_ARRAY SIMULATED_STAGE);
    simulated_record(
        *state, "named",
        SIMULATED_BASE SIMULATED_POINT SIMULATED_ARRAY SIMULATED_STAGE SIMULATED_VOLUME);
    return 0;
}

static void run(const struct simulated *s, struct command_result *r, char *const more[])
{
    char *words[WORDS] = {
        "recon",          "--survey",     (char *)s->survey,     "--wav",
        (char *)s->scene, "--background", (char *)s->background, "--out",
        (char *)s->out};
    size_t n = 9;
    while (*more && n + 1 < WORDS)
        words[n++] = *more++;
    command_run(r, command_recon, words);
}
#define MORE(...) ((char *const[]){__VA_ARGS__, NULL})

static void expect_point(const struct recon_job *job, double error_m)
{
    const Anlos__DetectionList *list = job->detections;
    assert_true(list->n_detections > 0);
    const Anlos__Vec3 *at = list->detections[0]->virtual_m;
    assert_near(hypot(at->x - truth_m[0], at->y - truth_m[1]), 0.0, error_m);
    assert_near(at->z, truth_m[2], fmax(error_m, 2e-3));
}

static double error_of(const struct recon_job *job)
{
    const Anlos__Vec3 *at = job->detections->detections[0]->virtual_m;
    return hypot(at->x - truth_m[0], at->y - truth_m[1]);
}

/* -- as a command, before this process has threads --------------------------------------
 */

static double number(const json_t *in, const char *key)
{
    const json_t *value = json_object_get(in, key);
    if (!json_is_number(value))
        fail_msg("%s is missing", key);
    return json_number_value(value);
}

static void expect_plan(const json_t *plan)
{
    const json_t *seen = json_object_get(plan, "seen"), *candidate;
    size_t i, taken = 0;
    assert_true(json_is_true(json_object_get(seen, "looked")));
    assert_true(number(seen, "snr_db") > 30.0);
    assert_int_equal(number(seen, "objects"), 1);
    assert_true(number(plan, "predicted_s") > 0.0);
    assert_true(number(plan, "taken_s") > 0.0);
    assert_true(number(plan, "predicted_error_m") > 0.0);
    assert_true(json_is_null(json_object_get(plan, "budget_s")));
    json_array_foreach(json_object_get(plan, "candidates"), i, candidate)
        taken += !json_object_get(candidate, "why_not");
    assert_true(i > 1);
    assert_int_equal(taken, 1);
}

static json_t *load_report(const struct simulated *s)
{
    char path[160];
    snprintf(path, sizeof path, "%s/report.json", s->out);
    json_t *report = json_load_file(path, 0, NULL);
    assert_non_null(report);
    return report;
}

/* The volume that the survey names is kept as it is. */
static void the_plan_is_reported_and_told(void **state)
{
    static const int named[3] = {12, 12, 61};
    struct simulated *s = *state;
    struct command_result r;
    simulated_use(s, "named");
    run(s, &r, MORE("--method", "auto", "--error-cm", "5"));
    if (r.code)
        fail_msg("%s", r.err);
    json_t *report = load_report(s);
    const json_t *plan = json_object_get(report, "plan");
    const json_t *size = json_object_get(json_object_get(report, "grid"), "size");
    expect_plan(plan);
    assert_int_equal(json_array_size(json_object_get(plan, "left_out")), 0);
    for (size_t a = 0; a < 3; a++)
        assert_int_equal(json_integer_value(json_array_get(size, a)), named[a]);
    assert_non_null(strstr(r.out, "dB above noise, depths 1."));
    assert_non_null(strstr(r.out, "elements stand right to 0.5 mm"));
    assert_non_null(strstr(r.out, " ms predicted, "));
    assert_null(strstr(r.out, "left out"));
    json_decref(report);
}

static void a_hopeless_budget_is_told_and_still_gives_an_image(void **state)
{
    struct simulated *s = *state;
    struct command_result r;
    simulated_use(s, "free");
    run(s, &r, MORE("--method", "auto", "--budget-ms", "1e-6"));
    if (r.code)
        fail_msg("%s", r.err);
    assert_non_null(strstr(r.out, "nothing fits the budget"));
    assert_non_null(strstr(r.out, "a look would take more than it saves"));
    assert_non_null(strstr(r.out, "; of 1e-06 ms in all "));
    assert_non_null(strstr(r.out, "left out: speakers but every 4th"));
    assert_non_null(strstr(r.err, "18 of 24 pings are left out to save time"));
    json_t *report = load_report(s);
    const json_t *plan = json_object_get(report, "plan");
    assert_true(json_is_false(json_object_get(json_object_get(plan, "seen"), "looked")));
    assert_true(number(plan, "budget_s") < 1e-8);
    const json_t *pings = json_object_get(report, "pings");
    assert_int_equal(number(pings, "used"), 6);
    assert_int_equal(number(pings, "left_out"), 18);
    assert_int_equal(number(pings, "lost"), 0);
    json_decref(report);
}

static void expect_refused(const struct simulated *s, char *const more[],
                           const char *text)
{
    struct command_result r;
    run(s, &r, more);
    if (r.code != 2 || !strstr(r.err, text))
        fail_msg("code %d: %s, expected %s", r.code, r.err, text);
    assert_int_equal(access(s->out, F_OK), -1);
}

static void goals_that_are_none_are_refused(void **state)
{
    static char *const bad[] = {"0", "-1", "text", "inf", "nan", "", "1,2", "1e9"};
    struct simulated *s = *state;
    simulated_use(s, "refused");
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        expect_refused(s, MORE("--method", "auto", "--budget-ms", bad[i]),
                       "expected a number above 0");
        expect_refused(s, MORE("--method", "auto", "--error-cm", bad[i]),
                       "expected a number above 0");
    }
}

static void goals_without_auto_are_refused(void **state)
{
    struct simulated *s = *state;
    simulated_use(s, "refused");
    expect_refused(s, MORE("--budget-ms", "10"), "--budget-ms is for --method auto");
    expect_refused(s, MORE("--error-cm", "1"), "--error-cm is for --method auto");
    expect_refused(s, MORE("--method", "fast", "--error-cm", "1"),
                   "--error-cm is for --method auto");
    struct command_result r;
    char *scan[] = {"recon", "--confocal",  "x", "--out",
                    s->out,  "--budget-ms", "1", NULL};
    command_run(&r, command_recon, scan);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "--budget-ms is for --method auto"));
}

static void what_auto_chooses_itself_is_refused(void **state)
{
    struct simulated *s = *state;
    simulated_use(s, "refused");
    expect_refused(s, MORE("--method", "auto", "--set", "dmo=never"),
                   "auto chooses one itself");
    expect_refused(s, MORE("--method", "auto", "--psf", "x"),
                   "--psf is for --method iterative");
}

/* -- in this process --------------------------------------------------------------------
 */

static void image(const struct simulated *s, struct recon_job *job, double budget_s,
                  double error_m)
{
    static struct recon_options o; /* borrowed by the job */
    o = simulated_options(s, recon_auto_name);
    o.budget_s = budget_s;
    o.error_m = error_m;
    simulated_image(job, &o);
}

static void depth_that_holds_nothing_is_left_out(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    simulated_use(s, "free");
    image(s, &job, 0.0, 0.0); /* time is no matter, so there is a look */
    const struct grid *g = &job.processing.grid;
    double last_m = g->origin_m[2] + g->step_m[2] * (double)(g->n[2] - 1);
    assert_true(g->origin_m[2] > 1.0 && g->origin_m[2] < 1.15);
    assert_true(last_m > 1.25 && last_m < 1.4);
    assert_true(job.automatic->looked);
    expect_point(&job, 2e-3);
    json_t *plan = recon_auto_report(job.automatic, &job);
    const json_t *left_out = json_object_get(plan, "left_out");
    assert_int_equal(json_array_size(left_out), 1);
    assert_non_null(
        strstr(json_string_value(json_array_get(left_out, 0)), "depths before 1."));
    json_decref(plan);
    recon_job_clear(&job);
}

/* What was promised is kept against where the point really is. */
static void steps_follow_the_error_that_is_allowed(void **state)
{
    static const double allowed_m[3] = {0.03, 0.003, 0.0005};
    struct simulated *s = *state;
    double step_m[3];
    simulated_use(s, "free");
    for (int i = 0; i < 3; i++) {
        struct recon_job job;
        image(s, &job, 0.0, allowed_m[i]);
        step_m[i] = job.processing.grid.step_m[1];
        assert_true(job.automatic->plan.error_m <= allowed_m[i]);
        assert_true(error_of(&job) <= allowed_m[i]);
        recon_job_clear(&job);
    }
    assert_true(step_m[0] > 1.3 * step_m[1] && step_m[1] > 1.3 * step_m[2]);
}

static void more_than_ample_time_changes_nothing(void **state)
{
    struct simulated *s = *state;
    struct recon_job more, less;
    simulated_use(s, "free");
    image(s, &less, 60.0, 0.0);
    image(s, &more, 600.0, 0.0);
    assert_string_equal(more.method, less.method);
    assert_memory_equal(&more.processing.grid, &less.processing.grid,
                        sizeof(struct grid));
    assert_memory_equal(more.intensity, less.intensity,
                        grid_size(&more.processing.grid) * sizeof *more.intensity);
    recon_job_clear(&more);
    recon_job_clear(&less);
}

static void a_trace_with_what_is_no_number_counts_as_masked(void **state)
{
    (void)state;
    static const struct recon_options options = {.threads = 1};
    static struct recon_job job; /* one speaker, three microphones, traces of 8 samples */
    static const double speaker[1][3] = {{0}}, microphones[3][3] = {{0}},
                        position[1] = {0};
    struct error why;
    float complex traces[3 * 8] = {0};
    const bool masked[3] = {false, false, true};
    job.processing.geometry = (struct geometry){.sound_speed_m_s = 343.0,
                                                .n_speakers = 1,
                                                .n_microphones = 3,
                                                .n_positions = 1,
                                                .speakers_m = speaker,
                                                .microphones_m = microphones,
                                                .stage_axis = {1.0, 0.0, 0.0},
                                                .stage_positions_m = position};
    job.format.n_samples = 8;
    job.options = &options;
    traces[8 + 5] = NAN;
    assert_int_equal(recon_auto_create(&job.automatic, &job, &why), 0);
    struct recon_sink sink = recon_auto_sink(job.automatic);
    sink.take(sink.ctx, 0, 0, traces, masked);
    assert_true(job.automatic->heard[0]);
    assert_false(job.automatic->heard[1]);
    assert_false(job.automatic->heard[2]);
    recon_auto_destroy(job.automatic);
}

static void no_time_to_look_still_finds_the_point(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    simulated_use(s, "free");
    image(s, &job, 1e-9, 0.0);
    assert_false(job.automatic->looked);
    const struct grid *got = &job.processing.grid, *whole = &job.automatic->whole;
    for (int i = 0; i < 3; i++) { /* nothing is known, so all of it is imaged */
        assert_near(got->origin_m[i], whole->origin_m[i], 1e-9);
        assert_near(got->step_m[i] * (double)(got->n[i] - 1),
                    whole->step_m[i] * (double)(whole->n[i] - 1), got->step_m[i]);
    }
    assert_true(isnan(job.automatic->probe.coherence.element_m));
    assert_int_equal(imager_pings(job.imager), 6);
    expect_point(&job, 0.02);
    recon_job_clear(&job);
}

/* The first 16 pings tell the pace; on two threads none of the last position is among
 * them. */
static void on_a_budget_fewer_pings_are_compressed(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    simulated_use(s, "free");
    image(s, &job, 1e-9, 0.0);
    size_t n = job.format.n_samples, position = 4 * 4 * n;
    for (size_t j = 0; j < 4; j++) {
        const float complex *traces = job.automatic->traces + 5 * position + j * 4 * n;
        double sum = 0.0;
        for (size_t q = 0; q < 4 * n; q++)
            sum += cabs((double complex)traces[q]);
        assert_true(j == 0 ? sum > 0.0 : sum == 0.0);
    }
    recon_job_clear(&job);
}

/* 6 speakers and 6 microphones, so that their mean displacement is nearly what it is
 * said to be. */
#define SIX_OF_EACH                                                                      \
    "slot_samples: 1500\n"                                                               \
    "speakers_m: [[0, 0, 0], [0, 0.05, 0], [0, 0.1, 0], [0, 0.15, 0], [0, 0.2, 0], "     \
    "[0, 0.25, 0]]\n"                                                                    \
    "microphones_m: [[0.04, 0, 0], [0.04, 0.05, 0], [0.04, 0.1, 0], [0.04, 0.15, 0], "   \
    "[0.04, 0.2, 0], [0.04, 0.25, 0]]\n"

static void elements_a_centimetre_off_leave_power_alone(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    simulated_record(s, "off",
                     SIMULATED_BASE SIMULATED_POINT SIX_OF_EACH SIMULATED_STAGE
                     "errors: {element_m: 0.01}\n");
    image(s, &job, 0.0, 0.0);
    assert_string_equal(job.method, "incoherent");
    assert_non_null(strstr(job.method_because, "phase says nothing"));
    assert_near(log2(job.automatic->probe.coherence.element_m / 0.01), 0.0, 1.0);
    expect_point(&job, 0.05);
    recon_job_clear(&job);
}

/* Half of the speakers have been compressed when it shows. */
static void power_has_the_speakers_that_were_left_out_compressed_after_all(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    struct error why;
    simulated_use(s, "off");
    struct recon_options o = simulated_options(s, recon_auto_name);
    assert_int_equal(recon_job_open(&job, &o, &why), 0);
    assert_int_equal(recon_job_plan(&job, &why), 0);
    recon_auto_pace_follow(job.automatic->pace, 2);
    assert_int_equal(recon_job_run(&job, &why), 0);
    assert_string_equal(job.method, "incoherent");
    assert_int_equal(imager_pings(job.imager), 36);
    expect_point(&job, 0.05);
    recon_job_clear(&job);
}

static void elements_that_stand_right_keep_their_phase(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    simulated_record(s, "right",
                     SIMULATED_BASE SIMULATED_POINT SIX_OF_EACH SIMULATED_STAGE);
    image(s, &job, 0.0, 0.0);
    assert_string_not_equal(job.method, "incoherent");
    assert_near(job.automatic->probe.coherence.element_m, 0.0, 5e-4);
    expect_point(&job, 2e-3);
    recon_job_clear(&job);
}

/* Uneven lines, and near enough to need dip moveout, which wants them even. */
static void a_way_that_the_array_cannot_go_is_not_chosen(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    simulated_record(
        s, "uneven",
        "sound_speed_m_s: 343\nsample_rate_hz: 48000\nslot_samples: 1500\n"
        "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03125}\n"
        "wall: {normal: [0, 0, 1], distance_m: 0.3}\ngate_m: [0.3, 1.0]\n"
        "seed: 1\nlevel: 0.02\nnoise: {snr_db: 30}\n"
        "objects: [{name: point, kind: point, position_m: [0.13, 0.11, 0.1], "
        "scattering_length_m: 0.05}]\n"
        "speakers_m: [[0, 0, 0], [0, 0.07, 0], [0, 0.16, 0], [0, 0.24, 0]]\n"
        "microphones_m: [[0.04, 0, 0], [0.04, 0.08, 0], [0.04, 0.15, 0], "
        "[0.04, 0.24, 0]]\n"
        "stage: {axis: [1, 0, 0], positions_m: [0, 0.03, 0.07, 0.12, 0.16, 0.2]}\n");
    image(s, &job, 0.0, 0.0);
    const Anlos__Vec3 *at = job.detections->detections[0]->virtual_m;
    assert_near(at->x, 0.13, 3e-3);
    assert_near(at->y, 0.11, 3e-3);
    assert_near(at->z, 0.5, 3e-3);
    struct recon_auto *a = job.automatic; /* as if dip moveout had been chosen */
    a->plan.dip = true;
    assert_true(recon_auto_retreat(a, &job));
    assert_false(a->plan.dip);
    for (size_t i = 0; i < a->plan.n_candidates; i++)
        assert_false(a->plan.candidates[i].dip);
    assert_true(recon_auto_retreat(a, &job));
    assert_string_equal(job.method, "backprojection");
    assert_false(recon_auto_retreat(a, &job));
    recon_job_clear(&job);
}

/* As if a shape had been seen, when another way turns out to be closed. */
static void as_many_iterations_are_done_as_were_planned(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    simulated_use(s, "free");
    image(s, &job, 60.0, 0.0);
    struct recon_auto *a = job.automatic;
    a->probe.objects[0].extent_m = 0.8;
    a->plan.dip = true;
    job.imaging.iterations = 7;
    assert_true(recon_auto_retreat(a, &job));
    assert_string_equal(job.method, "iterative");
    assert_int_equal(job.imaging.iterations, 200);
    json_t *plan = recon_auto_report(a, &job), *candidate;
    size_t i, told = 0;
    json_array_foreach(json_object_get(plan, "candidates"), i, candidate)
        told += json_integer_value(json_object_get(candidate, "iterations")) == 200;
    assert_int_equal(told, 1);
    json_decref(plan);
    recon_job_clear(&job);
}

static void one_speaker_and_one_position_are_enough_for_a_range(void **state)
{
    static const char *const arrays[2] = {
        SIMULATED_BASE SIMULATED_POINT SIMULATED_STAGE
        "slot_samples: 1500\nspeakers_m: [[0, 0.12, 0]]\n"
        "microphones_m: [[0.04, 0, 0], [0.04, 0.12, 0], [0.04, 0.24, 0]]\n",
        SIMULATED_BASE SIMULATED_POINT SIMULATED_ARRAY
        "stage: {axis: [1, 0, 0], positions_m: [0.1]}\n"};
    struct simulated *s = *state;
    for (int i = 0; i < 2; i++) {
        struct recon_job job;
        simulated_record(s, i ? "place" : "speaker", arrays[i]);
        image(s, &job, 0.0, 0.0);
        assert_true(job.detections->n_detections > 0);
        assert_near(job.detections->detections[0]->virtual_m->z, 1.2, 0.02);
        recon_job_clear(&job);
    }
}

static void silence_second(float *x, sf_count_t *frames, int channels)
{
    for (sf_count_t n = 0; n < *frames; n++)
        x[n * channels + 1] = 0.0f;
}

static void silence_all(float *x, sf_count_t *frames, int channels)
{
    memset(x, 0, (size_t)(*frames * channels) * sizeof *x);
}

static void a_silent_microphone_is_left_out(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    simulated_record(s, "silent",
                     SIMULATED_BASE SIMULATED_POINT SIMULATED_ARRAY SIMULATED_STAGE);
    simulated_change(s->scene, 6, silence_second);
    image(s, &job, 0.0, 0.0);
    expect_point(&job, 2e-3);
    assert_near(job.automatic->probe.coherence.element_m, 0.0, 5e-4);
    for (size_t q = 0; q < 6 * 4 * 4; q++)
        assert_int_equal(job.automatic->heard[q], q % 4 != 1);
    recon_job_clear(&job);
}

static void silence_is_refused(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    struct error why = {0};
    simulated_use(s, "silent"); /* of the test before */
    simulated_change(s->scene, 6, silence_all);
    struct recon_options o = simulated_options(s, recon_auto_name);
    assert_int_equal(recon_job_open(&job, &o, &why), 0);
    assert_int_equal(recon_job_plan(&job, &why), 0);
    assert_int_equal(recon_job_run(&job, &why), -ENODATA);
    assert_non_null(strstr(why.text, "no microphone is usable"));
    recon_job_clear(&job);
}

/* The wall sends nothing back here, and the direct sound is before the gate. */
static void it_works_without_a_background(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    simulated_use(s, "free");
    struct recon_options o = simulated_options(s, recon_auto_name);
    o.background = NULL;
    simulated_image(&job, &o);
    expect_point(&job, 3e-3);
    recon_job_clear(&job);
}

/* One microphone and one speaker drawn along a line, as one WAV and a table. */
#define LINE_PLACES 24
#define LINE_SLOT   3000

static void write_line(const struct simulated *s, char folder[160])
{
    char path[192];
    SF_INFO info = {.samplerate = 48000, .channels = 1};
    info.format = SF_FORMAT_WAV | SF_FORMAT_FLOAT;
    snprintf(folder, 160, "%s-all", s->scene);
    assert_int_equal(mkdir(folder, 0777), 0);
    snprintf(path, sizeof path, "%s/all.wav", folder);
    SNDFILE *all = sf_open(path, SFM_WRITE, &info);
    assert_non_null(all);
    snprintf(path, sizeof path, "%s/pings.csv", s->folder);
    FILE *csv = fopen(path, "w");
    assert_non_null(csv);
    for (int k = 0; k < LINE_PLACES; k++) {
        float x[LINE_SLOT];
        SF_INFO one = {0};
        snprintf(path, sizeof path, "%s/pos%02d.wav", s->scene, k);
        SNDFILE *f = sf_open(path, SFM_READ, &one);
        assert_non_null(f);
        assert_int_equal(sf_readf_float(f, x, LINE_SLOT), LINE_SLOT);
        sf_close(f);
        assert_int_equal(sf_writef_float(all, x, LINE_SLOT), LINE_SLOT);
        fprintf(csv, "%.3f,0.1,0,%.3f,0.1,0\n", 0.012 * k, 0.012 * k + 0.04);
    }
    sf_close(all);
    fclose(csv);
}

static void pings_with_places_of_their_own_are_back_projected(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    char scene[4096], at[16], folder[160];
    strcpy(scene, SIMULATED_BASE SIMULATED_POINT
           "slot_samples: 3000\n"
           "speakers_m: [[0, 0.1, 0]]\nmicrophones_m: [[0.04, 0.1, 0]]\n"
           "stage: {axis: [1, 0, 0], positions_m: [0");
    for (int k = 1; k < LINE_PLACES; k++) {
        snprintf(at, sizeof at, ", %.3f", 0.012 * k);
        strcat(scene, at);
    }
    simulated_record(s, "line", strcat(scene, "]}\n"));
    write_line(s, folder);
    snprintf(s->survey, sizeof s->survey, "%s/line.yaml", s->folder);
    simulated_write(s->survey,
                    "sound_speed_m_s: 343\nsample_rate_hz: 48000\nslot_samples: 3000\n"
                    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03125}\n"
                    "pings: pings.csv\ngate_m: [0.5, 1.8]\n"
                    "volume: {x_m: [0, 0.26, 0.01], y_m: [0.11, 0.11, 0.01], "
                    "z_m: [1.0, 1.4, 0.005]}\n");
    struct recon_options o = simulated_options(s, recon_auto_name);
    o.wav = folder;
    o.background = NULL;
    simulated_image(&job, &o);
    assert_string_equal(job.method, "backprojection");
    assert_non_null(strstr(job.method_because, "lattice"));
    assert_int_equal(imager_pings(job.imager), LINE_PLACES);
    assert_near(job.detections->detections[0]->virtual_m->x, 0.13, 3e-3);
    assert_near(job.detections->detections[0]->virtual_m->z, 1.2, 3e-3);
    recon_job_clear(&job);
}

static void traces_from_elsewhere_are_back_projected(void **state)
{
    static const struct scatterer point = {{0.0123, 0.0213, -0.0052}, 1.0};
    static const double volume_m[3][3] = {
        {-0.02, 0.04, 0.002}, {-0.01, 0.05, 0.002}, {-0.04, 0.03, 0.005}};
    const struct simulated *s = *state;
    struct traces_write w = {.format = {0.0035, 100000.0, 20000.0, 350}};
    struct turntable turntable;
    struct recon_job job;
    char path[128];
    turntable_default(&turntable);
    snprintf(path, sizeof path, "%s/traces.mat", s->folder);
    traces_write(&w, &turntable, path, &point, 1);
    struct recon_options o = {.traces = path,
                              .method = recon_auto_name,
                              .out = s->out,
                              .threads = 1,
                              .has_volume = true,
                              .error_m = 0.001};
    memcpy(o.volume_m, volume_m, sizeof volume_m);
    simulated_image(&job, &o);
    assert_string_equal(job.method, "backprojection");
    assert_int_equal(job.processing.grid.n[0], 31); /* as it was asked for */
    assert_near(job.detections->detections[0]->virtual_m->x, point.at_m[0], 1e-3);
    assert_near(job.detections->detections[0]->virtual_m->y, point.at_m[1], 1e-3);
    recon_job_clear(&job);
}

static void ctrl_c_ends_it_before_it_decides(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    struct error why = {0};
    simulated_use(s, "free");
    struct recon_options o = simulated_options(s, recon_auto_name);
    assert_int_equal(recon_job_open(&job, &o, &why), 0);
    assert_int_equal(recon_job_plan(&job, &why), 0);
    interrupt_catch();
    raise(SIGINT);
    assert_int_equal(recon_job_run(&job, &why), -EINTR);
    assert_null(job.imager);
    recon_job_clear(&job);
    signal(SIGINT, SIG_DFL);
    signal(SIGTERM, SIG_DFL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_plan_is_reported_and_told),
        cmocka_unit_test(a_hopeless_budget_is_told_and_still_gives_an_image),
        cmocka_unit_test(goals_that_are_none_are_refused),
        cmocka_unit_test(goals_without_auto_are_refused),
        cmocka_unit_test(what_auto_chooses_itself_is_refused),
        cmocka_unit_test(depth_that_holds_nothing_is_left_out),
        cmocka_unit_test(steps_follow_the_error_that_is_allowed),
        cmocka_unit_test(more_than_ample_time_changes_nothing),
        cmocka_unit_test(a_trace_with_what_is_no_number_counts_as_masked),
        cmocka_unit_test(no_time_to_look_still_finds_the_point),
        cmocka_unit_test(on_a_budget_fewer_pings_are_compressed),
        cmocka_unit_test(elements_a_centimetre_off_leave_power_alone),
        cmocka_unit_test(power_has_the_speakers_that_were_left_out_compressed_after_all),
        cmocka_unit_test(elements_that_stand_right_keep_their_phase),
        cmocka_unit_test(a_way_that_the_array_cannot_go_is_not_chosen),
        cmocka_unit_test(as_many_iterations_are_done_as_were_planned),
        cmocka_unit_test(one_speaker_and_one_position_are_enough_for_a_range),
        cmocka_unit_test(a_silent_microphone_is_left_out),
        cmocka_unit_test(silence_is_refused),
        cmocka_unit_test(it_works_without_a_background),
        cmocka_unit_test(pings_with_places_of_their_own_are_back_projected),
        cmocka_unit_test(traces_from_elsewhere_are_back_projected),
        cmocka_unit_test(ctrl_c_ends_it_before_it_decides), /* last: it is remembered */
    };
    return cmocka_run_group_tests(tests, set_up, simulated_destroy);
}
