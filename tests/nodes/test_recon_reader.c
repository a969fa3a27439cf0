/* SPDX-License-Identifier: MIT */
/* The traces that `anlos recon` makes of a scene and its background, between which the
 * air has changed or not. */
#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <unistd.h>

#include <cmocka.h>

#include "command.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/recon/report.h"
#include "tests/nodes/near.h"
#include "tests/nodes/simulated.h"

/* 0.1% of 343 m/s, at c ~ sqrt(T) and T = 292.8 K. */
#define WARMER_K    0.5856
#define POSITIONS   6
#define SPEAKERS    4
#define MICROPHONES 4
#define ROOM                                                                             \
    SIMULATED_BASE SIMULATED_POINT SIMULATED_ARRAY SIMULATED_STAGE SIMULATED_VOLUME      \
        "clutter: {points: 60, scattering_length_m: 0.05, near_m: 0.6, far_m: 1.7}\n"

static int set_up(void **state)
{
    int err = simulated_create(state);
    if (err)
        return err;
    simulated_record(*state, "still", ROOM);
    simulated_record(*state, "warmer", ROOM "drift: {background_c: 0.5856}\n");
    return 0;
}

static void image(const struct simulated *s, struct recon_job *job)
{
    static struct recon_options o; /* borrowed by the job */
    o = simulated_options(s, "fast");
    simulated_image(job, &o);
}

/* Warnings with this in them. */
static size_t count_warnings(const struct recon_job *job, const char *part)
{
    json_t *warnings = recon_report_warnings(job);
    const json_t *text;
    size_t i, n = 0;
    json_array_foreach(warnings, i, text)
        n += strstr(json_string_value(text), part) != NULL;
    json_decref(warnings);
    return n;
}

/* The peak, and the brightest voxel more than so far from it, in dB of intensity. */
static void measure(const struct recon_job *job, double *peak_db, double *side_db)
{
    const struct grid *g = &job->processing.grid;
    static const double at_m[3] = {0.13, 0.11, 1.2}, away_m[3] = {0.09, 0.09, 0.06};
    float peak = 0.0f, side = 0.0f;
    for (size_t v = 0; v < grid_size(g); v++) {
        const size_t index[3] = {v % g->n[0], v / g->n[0] % g->n[1],
                                 v / (g->n[0] * g->n[1])};
        bool near = true;
        for (int a = 0; a < 3; a++)
            near &= fabs(g->origin_m[a] + g->step_m[a] * (double)index[a] - at_m[a]) <
                    away_m[a];
        assert_true(isfinite(job->intensity[v]));
        if (near)
            peak = fmaxf(peak, job->intensity[v]);
        else
            side = fmaxf(side, job->intensity[v]);
    }
    *peak_db = 10.0 * log10((double)peak);
    *side_db = 10.0 * log10((double)side);
}

static void expect_point(const struct recon_job *job)
{
    assert_true(job->detections->n_detections > 0);
    const Anlos__Vec3 *at = job->detections->detections[0]->virtual_m;
    assert_near(at->x, 0.13, 3e-3);
    assert_near(at->y, 0.11, 3e-3);
    assert_near(at->z, 1.2, 3e-3);
}

/* -- no drift ---------------------------------------------------------------------------
 */

static const struct simulated *subtracting;

static void subtract_file(float *x, sf_count_t *frames, int channels)
{
    static int k;
    char path[160];
    SF_INFO info = {0};
    snprintf(path, sizeof path, "%s/pos%02d.wav", subtracting->background, k++);
    SNDFILE *f = sf_open(path, SFM_READ, &info);
    assert_non_null(f);
    float *background = malloc((size_t)(*frames * channels) * sizeof *background);
    assert_non_null(background);
    assert_int_equal(sf_readf_float(f, background, *frames), *frames);
    sf_close(f);
    for (sf_count_t i = 0; i < *frames * channels; i++)
        x[i] -= background[i];
    free(background);
}

static double difference_of(const float *x, const float *y, size_t n)
{
    double sum = 0.0, of = 0.0;
    for (size_t i = 0; i < n; i++) {
        sum += ((double)x[i] - (double)y[i]) * ((double)x[i] - (double)y[i]);
        of += (double)y[i] * (double)y[i];
    }
    return sqrt(sum / of);
}

/* Against a recording of the differences, without a background: of that each ping is
 * heard a little longer, with the next emission, which the difference does not have. */
static void in_still_air_samples_are_subtracted_from_samples(void **state)
{
    struct simulated *s = *state;
    struct recon_job job, difference;
    simulated_use(s, "still");
    image(s, &job);
    assert_int_equal(job.air.corrected, 0);
    assert_int_equal(job.air.pings, 0);
    assert_int_equal(count_warnings(&job, " pings "), 0);
    expect_point(&job);
    simulated_record(s, "difference", ROOM);
    subtracting = s;
    simulated_change(s->scene, POSITIONS, subtract_file);
    struct recon_options o = simulated_options(s, "fast");
    o.background = NULL;
    simulated_image(&difference, &o);
    double apart = difference_of(job.intensity, difference.intensity,
                                 grid_size(&job.processing.grid));
    print_message("apart by %.1e\n", apart);
    assert_true(apart < 0.001);
    recon_job_clear(&difference);
    recon_job_clear(&job);
}

static void expect_command(int (*command)(int, char **), char *const words[])
{
    struct command_result r;
    command_run(&r, command, words);
    if (r.code)
        print_error("%s\n", r.err);
    assert_int_equal(r.code, 0);
}

static char *read_volume(const char *folder, size_t *size)
{
    char path[256], *bytes = malloc(1 << 24);
    assert_non_null(bytes);
    snprintf(path, sizeof path, "%s/volume.nrrd", folder);
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    *size = fread(bytes, 1, 1 << 24, f);
    fclose(f);
    return bytes;
}

/* A ping ends with the next emission whole, which is not subtracted here: its beginning
 * alone would be a click that passes for echoes. */
static void without_a_background_files_give_what_their_bag_gives(void **state)
{
    struct simulated *s = *state;
    char bag[128], of_bag[160];
    size_t sizes[2];
    simulated_use(s, "still");
    snprintf(bag, sizeof bag, "%s/still.mcap", s->folder);
    snprintf(of_bag, sizeof of_bag, "%s-of-bag", s->out);
#define W(x) ((char *)(x))
    expect_command(command_bag,
                   (char *const[]){W("bag"), W("import"), s->scene, W("--survey"),
                                   s->survey, W("-o"), bag, NULL});
    expect_command(command_recon,
                   (char *const[]){W("recon"), W("--bag"), bag, W("--method"), W("fast"),
                                   W("--out"), of_bag, NULL});
    expect_command(command_recon, (char *const[]){W("recon"), W("--wav"), s->scene,
                                                  W("--survey"), s->survey, W("--method"),
                                                  W("fast"), W("--out"), s->out, NULL});
    char *files = read_volume(s->out, &sizes[0]), *bags = read_volume(of_bag, &sizes[1]);
    assert_int_equal(sizes[0], sizes[1]);
    assert_memory_equal(files, bags, sizes[0]);
    free(files);
    free(bags);
}

/* -- drift ------------------------------------------------------------------------------
 */

static void warmer_air_is_corrected_and_measured(void **state)
{
    struct simulated *s = *state;
    struct recon_job still, warmer;
    double still_db[2], warmer_db[2];
    simulated_use(s, "still");
    image(s, &still);
    simulated_use(s, "warmer");
    image(s, &warmer);
    size_t pings = POSITIONS * SPEAKERS;
    assert_int_equal(warmer.air.pings, pings);
    assert_int_equal(warmer.air.corrected, pings);
    double mean_k = air_kelvin(&warmer.air, warmer.air.sum / (double)pings);
    assert_near(mean_k / -WARMER_K, 1.0, 0.05); /* the scene is the cooler one */
    assert_int_equal(count_warnings(&warmer, " pings "), 0);
    assert_int_equal(imager_pings(warmer.imager), pings);
    expect_point(&warmer);
    measure(&still, &still_db[0], &still_db[1]);
    measure(&warmer, &warmer_db[0], &warmer_db[1]);
    assert_near(warmer_db[0], still_db[0], 0.3);
    assert_near(warmer_db[1], still_db[1], 1.0);
    recon_job_clear(&still);
    recon_job_clear(&warmer);
}

/* The paper's way of compressing: what the correction is worth. */
static void deramped_traces_are_not_corrected(void **state)
{
    struct simulated *s = *state;
    struct recon_job job, corrected;
    double db[2], corrected_db[2];
    simulated_use(s, "warmer");
    struct recon_options o = simulated_options(s, "fast");
    o.compression = COMPRESSION_DERAMP;
    simulated_image(&job, &o);
    image(s, &corrected);
    assert_int_equal(job.air.corrected, 0);
    measure(&job, &db[0], &db[1]);
    measure(&corrected, &corrected_db[0], &corrected_db[1]);
    assert_true(db[1] - db[0] > corrected_db[1] - corrected_db[0] + 3.0);
    recon_job_clear(&corrected);
    recon_job_clear(&job);
}

static void end_with_slot(float *x, sf_count_t *frames, int channels)
{
    (void)x;
    (void)channels;
    *frames = SPEAKERS * 1500;
}

/* Files that end with their last slot have lost its echoes, which matters only where the
 * background is stretched. */
static void the_last_ping_is_left_out_only_where_its_file_breaks_off(void **state)
{
    struct simulated *s = *state;
    static const char *const names[2] = {"still-cut", "warmer-cut"};
    for (int warmer = 0; warmer < 2; warmer++) {
        struct recon_job job;
        simulated_record(s, names[warmer],
                         warmer ? ROOM "drift: {background_c: 0.5856}\n" : ROOM);
        simulated_change(s->scene, POSITIONS, end_with_slot);
        simulated_change(s->background, POSITIONS, end_with_slot);
        image(s, &job);
        assert_int_equal(imager_pings(job.imager),
                         POSITIONS * (warmer ? SPEAKERS - 1 : SPEAKERS));
        assert_int_equal(count_warnings(&job, "6 of 24 pings are left out: their files"),
                         warmer);
        assert_int_equal(count_warnings(&job, "pings are lost"), 0);
        expect_point(&job);
        recon_job_clear(&job);
    }
}

static void end_with_first_slot(float *x, sf_count_t *frames, int channels)
{
    (void)x;
    (void)channels;
    *frames = 1500;
}

/* Nothing would be left, and the drift that is found is not right. */
static void a_lone_speaker_s_pings_that_break_off_are_used_with_a_warning(void **state)
{
    struct simulated *s = *state;
    for (int cut = 0; cut < 2; cut++) {
        struct recon_job job;
        simulated_record(
            s, cut ? "lone-cut" : "lone",
            SIMULATED_BASE SIMULATED_POINT SIMULATED_STAGE SIMULATED_VOLUME
            "slot_samples: 1500\nspeakers_m: [[0, 0.12, 0]]\n"
            "microphones_m: [[0.04, 0, 0], [0.04, 0.12, 0], [0.04, 0.24, 0]]\n"
            "clutter: {points: 60, scattering_length_m: 0.05, near_m: 0.6, far_m: 1.7}\n"
            "drift: {background_c: 0.5856}\n");
        if (cut) {
            simulated_change(s->scene, POSITIONS, end_with_first_slot);
            simulated_change(s->background, POSITIONS, end_with_first_slot);
        }
        image(s, &job);
        assert_int_equal(imager_pings(job.imager), POSITIONS);
        assert_int_equal(count_warnings(&job, "6 of 6 pings end with their slot"), cut);
        recon_job_clear(&job);
    }
}

static void damage(float *x, sf_count_t *frames, int channels)
{
    static int k;
    for (sf_count_t n = 0; n < *frames; n++) {
        x[n * channels] = 0.0f;
        if (n < *frames / 10)
            x[n * channels + 1] = 1.0f;
    }
    if (k++ == 0)
        x[100 * channels + 2] = NAN;
}

static void damaged_microphones_do_not_mislead_the_drift(void **state)
{
    struct simulated *s = *state;
    struct recon_job job;
    struct channel_summary c[3];
    simulated_record(s, "damaged", ROOM "drift: {background_c: 0.5856}\n");
    simulated_change(s->scene, POSITIONS, damage);
    image(s, &job);
    for (size_t i = 0; i < 3; i++)
        channel_check_summary(job.scene_check, i, &c[i]);
    assert_int_equal(c[0].silent, POSITIONS);
    assert_int_equal(c[1].clipped, POSITIONS);
    assert_int_equal(c[2].damaged, 1);
    double mean_k = air_kelvin(&job.air, job.air.sum / (double)job.air.pings);
    assert_near(mean_k / -WARMER_K, 1.0, 0.05);
    for (size_t v = 0; v < grid_size(&job.processing.grid); v++)
        assert_true(isfinite(job.intensity[v]));
    expect_point(&job);
    recon_job_clear(&job);
}

/* -- threads: last, no process may be made after them -----------------------------------
 */

struct kept { /* all traces of a recording */
    size_t n_samples;
    float complex *traces; /* [position][speaker][microphone][n_samples] */
    bool *masked;          /* [position][speaker][microphone] */
};

static void keep(void *ctx, size_t position, size_t speaker, const float complex *traces,
                 const bool *masked)
{
    const struct kept *k = ctx;
    size_t at = (position * SPEAKERS + speaker) * MICROPHONES;
    memcpy(k->traces + at * k->n_samples, traces,
           MICROPHONES * k->n_samples * sizeof *traces);
    memcpy(k->masked + at, masked, MICROPHONES * sizeof *masked);
}

static void read_all(const struct simulated *s, size_t threads, struct kept *k,
                     struct air *air)
{
    struct recon_job job;
    struct error why = {0};
    struct stopwatch stages[RECON_STAGES] = {0};
    struct recon_options o = simulated_options(s, "fast");
    o.threads = threads;
    assert_int_equal(recon_job_open(&job, &o, &why), 0);
    assert_int_equal(recon_job_plan(&job, &why), 0);
    k->n_samples = job.format.n_samples;
    k->traces =
        calloc(POSITIONS * SPEAKERS * MICROPHONES * k->n_samples, sizeof *k->traces);
    k->masked = calloc(POSITIONS * SPEAKERS * MICROPHONES, sizeof *k->masked);
    assert_non_null(k->traces);
    assert_non_null(k->masked);
    const struct recon_sink sink = {keep, k, NULL};
    assert_int_equal(recon_reader_run(job.reader, &sink, stages, air, &why), 0);
    recon_job_clear(&job);
}

static void the_number_of_threads_changes_no_byte(void **state)
{
    struct simulated *s = *state;
    static const char *const names[2] = {"still", "warmer"};
    for (int i = 0; i < 2; i++) {
        struct kept one, two;
        struct air air[2];
        simulated_use(s, names[i]);
        read_all(s, 1, &one, &air[0]);
        read_all(s, 2, &two, &air[1]);
        size_t n = POSITIONS * SPEAKERS * MICROPHONES;
        assert_int_equal(one.n_samples, two.n_samples);
        assert_memory_equal(one.traces, two.traces,
                            n * one.n_samples * sizeof *one.traces);
        assert_memory_equal(one.masked, two.masked, n);
        assert_int_equal(air[0].corrected, air[1].corrected);
        assert_near(air[0].largest, air[1].largest, 0.0);
        free(one.traces);
        free(one.masked);
        free(two.traces);
        free(two.masked);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(in_still_air_samples_are_subtracted_from_samples),
        cmocka_unit_test(without_a_background_files_give_what_their_bag_gives),
        cmocka_unit_test(warmer_air_is_corrected_and_measured),
        cmocka_unit_test(deramped_traces_are_not_corrected),
        cmocka_unit_test(the_last_ping_is_left_out_only_where_its_file_breaks_off),
        cmocka_unit_test(a_lone_speaker_s_pings_that_break_off_are_used_with_a_warning),
        cmocka_unit_test(damaged_microphones_do_not_mislead_the_drift),
        cmocka_unit_test(the_number_of_threads_changes_no_byte),
    };
    return cmocka_run_group_tests(tests, set_up, simulated_destroy);
}
