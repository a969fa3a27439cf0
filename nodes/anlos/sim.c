/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <limits.h>
#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "dsp/error.h"
#include "dsp/pool.h"
#include "hal/recording/recording.h"
#include "hal/room/room.h"
#include "hal/survey/file.h"
#include "hal/survey/firing.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"

/* A scene file to a recording on disk: both passes as WAV files, survey.yaml with its
 * calibration curves, truth.json. */

struct sim_options { /* borrow from argv */
    const char *scene, *out;
    struct firing firing; /* what follows the scene's name, as in an array's URI */
    size_t threads;
    bool progress; /* a line on stderr that is rewritten */
};

/* The file truth.json, what is really there in a simulated recording. */

static json_t *object_json(const struct room_object *o, const struct survey *s)
{
    json_t *j = json_object();
    double vehicle[3];
    survey_to_vehicle(s, o->position_m, vehicle);
    json_object_set_new(j, "name", json_string(o->name));
    json_object_set_new(j, "kind", json_string(o->kind));
    json_object_set_new(j, "position_m", export_reals(o->position_m, 3));
    json_object_set_new(j, "virtual_m", export_reals(o->virtual_m, 3));
    json_object_set_new(j, "vehicle_m",
                        s->has_mount ? export_reals(vehicle, 3) : json_null());
    json_object_set_new(j, "extent_m", export_reals(o->extent_m, 3));
    return j;
}

/* Writes FOLDER/truth.json.  0 or a negative errno. */
static int sim_truth_write(const struct room *room, const char *scene_path,
                           const char *folder, struct error *why)
{
    const struct survey *s = room_survey(room);
    const struct room_object *objects;
    size_t n = room_objects(room, &objects);
    json_t *all = json_array(), *truth = json_object();

    json_object_set_new(truth, "scene", json_string(scene_path));
    json_object_set_new(truth, "sound_speed_m_s", export_real(s->sound_speed_m_s));
    if (s->has_wall)
        json_object_set_new(truth, "wall",
                            json_pack("{so, so}", "normal",
                                      export_reals(s->wall_normal, 3), "distance_m",
                                      export_real(s->wall_distance_m)));
    else
        json_object_set_new(truth, "wall", json_null());
    for (size_t i = 0; i < n; i++)
        json_array_append_new(all, object_json(&objects[i], s));
    json_object_set_new(truth, "objects", all);
    int err = export_json(folder, "truth.json", truth, why);
    json_decref(truth);
    return err;
}

struct sim_worker { /* a room records for one thread at a time, so each has its own */
    struct room *room;
    float *samples; /* [n_microphones][frames] */
};

struct sim_job {
    const struct sim_options *options;
    const struct survey *survey; /* of the first worker's room */
    size_t frames;
    struct sim_worker *workers; /* [options->threads] */
    uint32_t *speakers;         /* 0..n_speakers-1 */
    float *whole[2];            /* of a stage that does not stop: scene, background */
    size_t n_whole;             /* [n_microphones][n_whole] */
    struct export_stage stage;
    char folder[2][PATH_MAX]; /* scene, background; inside the stage */
    pthread_mutex_t lock;     /* of what follows */
    size_t done;
    int err;
    struct error why;
};

static const char *const pass_names[2] = {"scene", "background"};

static int create_workers(struct sim_job *job, struct error *why)
{
    const char *scene = job->options->scene;
    int err = 0;
    job->workers = calloc(job->options->threads, sizeof *job->workers);
    if (!job->workers)
        return error_say(why, -ENOMEM, "out of memory");
    for (size_t t = 0; !err && t < job->options->threads; t++)
        err =
            room_load_drawn(&job->workers[t].room, scene, &job->options->firing, 0, why);
    if (err)
        return err;
    if (room_is_drive(job->workers[0].room))
        return error_say(
            why, -EINVAL,
            "%s: a drive has no end; `anlos launch` plays it, and records it "
            "with --record BAG",
            scene);
    job->survey = room_survey(job->workers[0].room);
    job->frames = room_frames(job->workers[0].room, job->survey->n_speakers);
    job->speakers = malloc(job->survey->n_speakers * sizeof *job->speakers);
    for (size_t j = 0; job->speakers && j < job->survey->n_speakers; j++)
        job->speakers[j] = (uint32_t)j;
    for (size_t t = 0; t < job->options->threads; t++) {
        job->workers[t].samples =
            malloc(job->survey->n_microphones * job->frames * sizeof(float));
        if (!job->workers[t].samples || !job->speakers)
            return error_say(why, -ENOMEM, "out of memory");
    }
    return 0;
}

static int check_vacant(const char *out, struct error *why)
{
    static const char *const names[] = {"scene", "background", "calibration",
                                        "survey.yaml", "truth.json"};
    return export_vacant(out, names, sizeof names / sizeof *names, why);
}

static int create_whole(struct sim_job *job, struct error *why)
{
    const struct survey *s = job->survey;
    if (!s->continuous)
        return 0;
    job->n_whole = s->n_positions * survey_slots(s, s->n_speakers) * s->slot_samples +
                   room_tail(job->workers[0].room);
    for (int pass = 0; pass < 2; pass++) {
        job->whole[pass] = calloc(s->n_microphones * job->n_whole, sizeof(float));
        if (!job->whole[pass])
            return error_say(why, -ENOMEM, "out of memory");
    }
    return 0;
}

/* The slots of one round of a stage that does not stop, and behind the last one its tail.
 */
static int record_round(const struct sim_job *job, struct sim_worker *w, int pass,
                        size_t round)
{
    const struct survey *s = job->survey;
    size_t slots = survey_slots(s, s->n_speakers) * s->slot_samples;
    size_t n = round + 1 < s->n_positions ? slots : job->frames;
    int err = room_stream_round(w->room, pass ? PASS_BACKGROUND : PASS_SCENE, round,
                                w->samples);
    for (size_t m = 0; !err && m < s->n_microphones; m++)
        memcpy(job->whole[pass] + m * job->n_whole + round * slots,
               w->samples + m * job->frames, n * sizeof(float));
    return err;
}

static void show_progress(const struct sim_job *job)
{
    if (job->options->progress)
        fprintf(stderr, "\r%zu of %zu recordings ", job->done,
                2 * job->survey->n_positions);
}

/* The background pass comes second, so that a scene that fails does so soon. */
static void record_item(void *ctx, size_t item, size_t thread)
{
    struct sim_job *job = ctx;
    struct sim_worker *w = &job->workers[thread];
    size_t background = item / job->survey->n_positions;
    size_t position = item % job->survey->n_positions;
    struct error why = {0};

    pthread_mutex_lock(&job->lock);
    bool stop = job->err || interrupt_requested();
    pthread_mutex_unlock(&job->lock);
    if (stop)
        return;
    int err = job->survey->continuous
                  ? record_round(job, w, background > 0, position)
                  : room_record(w->room, background ? PASS_BACKGROUND : PASS_SCENE,
                                position, job->speakers, job->survey->n_speakers, 0,
                                w->samples);
    if (err)
        error_say(&why, err, "%s: position %zu: %s", job->options->scene, position,
                  strerror(-err));
    else if (!job->survey->continuous)
        err = recording_write(job->folder[background], position,
                              job->survey->n_microphones, job->frames,
                              job->survey->sample_rate_hz, w->samples, &why);
    pthread_mutex_lock(&job->lock);
    job->done++;
    if (err && !job->err) {
        job->err = err;
        job->why = why;
    }
    show_progress(job);
    pthread_mutex_unlock(&job->lock);
}

static int record_all(struct sim_job *job, struct error *why)
{
    struct pool *pool;
    for (int pass = 0; pass < 2; pass++) {
        snprintf(job->folder[pass], sizeof job->folder[pass], "%.*s/%s", PATH_MAX - 16,
                 job->stage.path, pass_names[pass]);
        if (mkdir(job->folder[pass], 0777))
            return error_say(why, -errno, "%s: cannot be written: %s", job->options->out,
                             strerror(errno));
    }
    int err = pool_create(&pool, job->options->threads);
    if (err)
        return error_say(why, err, "%zu threads: %s", job->options->threads,
                         strerror(-err));
    pool_run(pool, 2 * job->survey->n_positions, record_item, job);
    pool_destroy(pool);
    if (job->options->progress)
        fputc('\n', stderr);
    if (interrupt_requested())
        return error_say(why, -EINTR, "interrupted");
    if (job->err)
        *why = job->why;
    err = job->err;
    for (int pass = 0; !err && pass < 2 && job->whole[pass]; pass++)
        err = recording_write(job->folder[pass], 0, job->survey->n_microphones,
                              job->n_whole, job->survey->sample_rate_hz, job->whole[pass],
                              why);
    return err;
}

static int write_texts(struct sim_job *job, struct error *why)
{
    char path[PATH_MAX + 32];
    const char *calibration = job->survey->n_responses ? "calibration" : NULL;
    int err =
        sim_truth_write(job->workers[0].room, job->options->scene, job->stage.path, why);
    if (!err) {
        snprintf(path, sizeof path, "%s/survey.yaml", job->stage.path);
        err = survey_save(job->survey, path, calibration, why);
    }
    return err;
}

static void clear_workers(struct sim_job *job)
{
    for (size_t t = 0; job->workers && t < job->options->threads; t++) {
        room_destroy(job->workers[t].room);
        free(job->workers[t].samples);
    }
    free(job->workers);
    free(job->speakers);
    free(job->whole[0]);
    free(job->whole[1]);
}

/* Reads the scene and checks the output folder, renders and writes: everything appears in
 * the folder at the end, or nothing.  *bad_input tells whose fault a failure is.
 * 0, -EINTR (Ctrl-C, see interrupt.h), -EEXIST (the folder holds a recording already),
 * other negative errno. */
static int sim_job_run(const struct sim_options *options, bool *bad_input,
                       struct error *why)
{
    struct sim_job *job = calloc(1, sizeof *job);
    if (!job)
        return error_say(why, -ENOMEM, "out of memory");
    job->options = options;
    pthread_mutex_init(&job->lock, NULL);

    int err = check_vacant(options->out, why);
    if (!err)
        err = create_workers(job, why);
    if (!err)
        err = create_whole(job, why);
    if (!err)
        err = export_stage_begin(&job->stage, options->out, why);
    *bad_input = err && err != -ENOMEM;
    if (!err) {
        err = record_all(job, why);
        if (!err)
            err = write_texts(job, why);
        err = export_stage_end(&job->stage, err, why);
    }
    clear_workers(job);
    pthread_mutex_destroy(&job->lock);
    free(job);
    return err;
}

#define MAX_THREADS 64

static const char help[] =
    "anlos sim -- make a recording of a simulated scene\n"
    "\n"
    "usage: anlos sim SCENE.yaml --out DIR [--threads N]\n"
    "\n"
    "Renders what every microphone hears at every stage position: direct path, wall and\n"
    "room clutter, and the hidden objects by way of the wall; once with the objects and\n"
    "once without.  launch/scenes/ has examples that explain the file's keys.  Options "
    "may\n"
    "follow the name as in the URI of an array (launch/drive.md, Faster frames):\n"
    "'SCENE.yaml?continuous=yes&slot_samples=1632', a stage that does not stop.\n"
    "\n"
    "  --out DIR       where the recording goes; made when missing.  A recording that "
    "is\n"
    "                  there already is not overwritten.\n"
    "  --threads N     1..64, default: one for each processor\n"
    "  --help          this text\n"
    "\n"
    "files written, all or none\n"
    "  scene/posNN.wav        a file for each stage position: float32, a channel for "
    "each\n"
    "                         microphone, a slot for each speaker; of a stage that does\n"
    "                         not stop (stage: {continuous: true}) one for all\n"
    "  background/posNN.wav   the same room without the hidden objects\n"
    "  survey.yaml            geometry and timing, for `anlos recon`\n"
    "  calibration/           the microphones' curves, when the scene has any\n"
    "  truth.json             the objects: where they are, and where the wall mirrors "
    "them\n"
    "\n"
    "example\n"
    "  anlos sim launch/scenes/corner.yaml --out /tmp/corner\n"
    "\n"
    "exit codes: 0 done; 1 failed (no memory, full disk); 2 bad arguments or scene;\n"
    "130 stopped by Ctrl-C, nothing written\n";

static const struct usage_option options[] = {
    {"out", USAGE_TEXT(struct sim_options, out)},
    {"threads", USAGE_COUNT(struct sim_options, threads, 1, MAX_THREADS)},
    {.name = NULL},
};

/* As a word of a shell's command line. */
static void print_quoted(const char *word)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                "0123456789_-./+:,@%=";
    if (*word && !word[strspn(word, plain)]) {
        fputs(word, stdout);
        return;
    }
    putchar('\'');
    for (; *word; word++) {
        if (*word == '\'')
            fputs("'\\''", stdout);
        else
            putchar(*word);
    }
    putchar('\'');
}

static void print_next_command(const char *out)
{
    char image[PATH_MAX + 8];

    snprintf(image, sizeof image, "%s/image", out);
    printf("%s: scene, background, survey.yaml, truth.json\nnext:\n  anlos recon ", out);
    print_quoted(out);
    printf(" --out ");
    print_quoted(image);
    putchar('\n');
}

int command_sim(int argc, char **argv)
{
    struct sim_options o = {.threads = usage_default_threads(),
                            .progress = isatty(STDERR_FILENO)};
    struct usage usage = {.command = "sim", .help = help, .options = options, .into = &o};
    struct error why = {0};
    bool bad_input = false;
    int code = usage_next(&usage, argc, argv);

    if (code)
        return ~code;
    if (optind == argc)
        return usage_error("sim", "SCENE.yaml is missing");
    if (optind + 1 < argc)
        return usage_error("sim", "%s: unexpected argument", argv[optind + 1]);
    if (!o.out || !o.out[0])
        return usage_error("sim", "--out DIR is missing");
    struct device d;
    static const char *const known[] = {FIRING_KEYS, NULL};
    int err = device_parse(&d, argv[optind], known, &why);
    if (!err)
        err = firing_from_device(&o.firing, &d, &why);
    if (!err)
        err = firing_refuse_uneven(&o.firing, "not of a recording", &why);
    if (err) {
        fprintf(stderr, "anlos sim: %s\n", why.text);
        device_clear(&d);
        return EXIT_BAD_INPUT;
    }
    o.scene = d.path;

    interrupt_catch();
    err = sim_job_run(&o, &bad_input, &why);
    device_clear(&d);
    if (!err) {
        print_next_command(o.out);
        return EXIT_WORKED;
    }
    fprintf(stderr, "anlos sim: %s\n", why.text);
    return err == -EINTR ? EXIT_INTERRUPTED : bad_input ? EXIT_BAD_INPUT : EXIT_FAILED;
}
