/* SPDX-License-Identifier: MIT */
/* tests/nodes/simulated.h -- scenes given as text, simulated into recordings whose WAV
 * files can be changed afterwards, and imaged in this process.  Include after cmocka.h.
 */
#ifndef ANLOS_TESTS_NODES_SIMULATED_H
#define ANLOS_TESTS_NODES_SIMULATED_H

#include <sndfile.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/recon/job.h"
#include "tests/nodes/command.h"

/* A point at (0.13, 0.11, 0.4), imaged at z = 1.2, and 4 speakers and microphones at 6
 * places; keys that a test wants otherwise come before or after. */
#define SIMULATED_BASE                                                                   \
    "sound_speed_m_s: 343\nsample_rate_hz: 48000\n"                                      \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03125}\n"                     \
    "wall: {normal: [0, 0, 1], distance_m: 0.8}\ngate_m: [0.5, 1.8]\n"                   \
    "seed: 1\nlevel: 0.02\nnoise: {snr_db: 30}\n"
#define SIMULATED_POINT                                                                  \
    "objects: [{name: point, kind: point, position_m: [0.13, 0.11, 0.4], "               \
    "scattering_length_m: 0.05}]\n"
#define SIMULATED_ARRAY                                                                  \
    "slot_samples: 1500\n"                                                               \
    "speakers_m: [[0, 0, 0], [0, 0.08, 0], [0, 0.16, 0], [0, 0.24, 0]]\n"                \
    "microphones_m: [[0.04, 0, 0], [0.04, 0.08, 0], [0.04, 0.16, 0], [0.04, 0.24, 0]]\n"
#define SIMULATED_STAGE                                                                  \
    "stage: {axis: [1, 0, 0], positions_m: [0, 0.04, 0.08, 0.12, 0.16, 0.2]}\n"
#define SIMULATED_VOLUME                                                                 \
    "volume: {x_m: [0.02, 0.24, 0.02], y_m: [0, 0.22, 0.02], z_m: [0.9, 1.5, 0.01]}\n"

struct simulated {
    char folder[64]; /* with all recordings */
    char survey[128], scene[128], background[128], out[128];
};

static inline int simulated_create(void **state)
{
    struct simulated *s = calloc(1, sizeof *s);
    if (!s)
        return -1;
    strcpy(s->folder, "/tmp/anlos-simulated-XXXXXX");
    *state = s;
    return mkdtemp(s->folder) ? 0 : -1;
}

static inline int simulated_destroy(void **state)
{
    char command[128];
    struct simulated *s = *state;
    snprintf(command, sizeof command, "rm -rf '%s'", s->folder);
    free(s);
    return system(command);
}

/* From now on it is the recording of this name. */
static inline void simulated_use(struct simulated *s, const char *name)
{
    snprintf(s->survey, sizeof s->survey, "%s/%s/survey.yaml", s->folder, name);
    snprintf(s->scene, sizeof s->scene, "%s/%s/scene", s->folder, name);
    snprintf(s->background, sizeof s->background, "%s/%s/background", s->folder, name);
    snprintf(s->out, sizeof s->out, "%s/%s/out", s->folder, name);
}

static inline void simulated_write(const char *path, const char *text)
{
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
}

static inline void simulated_record(struct simulated *s, const char *name,
                                    const char *scene)
{
    struct command_result r;
    char path[128], out[128];
    snprintf(path, sizeof path, "%s/%s.yaml", s->folder, name);
    snprintf(out, sizeof out, "%s/%s", s->folder, name);
    simulated_write(path, scene);
    char *words[] = {"sim", path, "--out", out, NULL};
    command_run(&r, command_sim, words);
    if (r.code)
        fail_msg("sim: code %d: %s", r.code, r.err);
    simulated_use(s, name);
}

/* Calls change on the samples [*frames][channels] of each file; *frames may shrink. */
static inline void simulated_change(const char *folder, size_t n_files,
                                    void (*change)(float *x, sf_count_t *frames,
                                                   int channels))
{
    for (size_t k = 0; k < n_files; k++) {
        char path[160];
        SF_INFO info = {0};
        snprintf(path, sizeof path, "%s/pos%02zu.wav", folder, k);
        SNDFILE *f = sf_open(path, SFM_READ, &info);
        assert_non_null(f);
        float *x = malloc((size_t)(info.frames * info.channels) * sizeof *x);
        assert_non_null(x);
        assert_int_equal(sf_readf_float(f, x, info.frames), info.frames);
        sf_close(f);
        sf_count_t frames = info.frames;
        change(x, &frames, info.channels);
        f = sf_open(path, SFM_WRITE, &info);
        assert_non_null(f);
        assert_int_equal(sf_writef_float(f, x, frames), frames);
        sf_close(f);
        free(x);
    }
}

static inline struct recon_options simulated_options(const struct simulated *s,
                                                     const char *method)
{
    return (struct recon_options){.survey = s->survey,
                                  .wav = s->scene,
                                  .background = s->background,
                                  .method = method,
                                  .out = s->out,
                                  .threads = 1,
                                  .window = WINDOW_HANN,
                                  .compression = COMPRESSION_MATCHED_FILTER};
}

/* Opens, plans and runs; recon_job_clear it. */
static inline void simulated_image(struct recon_job *job, const struct recon_options *o)
{
    struct error why = {0};
    int err = recon_job_open(job, o, &why);
    if (!err)
        err = recon_job_plan(job, &why);
    if (!err)
        err = recon_job_run(job, &why);
    if (err)
        fail_msg("%d: %s", err, why.text);
}

#endif
