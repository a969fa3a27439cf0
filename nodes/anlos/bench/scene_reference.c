#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/file.h"
#include "nodes/anlos/bench/files.h"
#include "nodes/rt/export_file.h"

static void write_points(FILE *f, const char *key, const json_t *y, double x_m)
{
    fprintf(f, "%s:\n", key);
    for (size_t i = 0; i < json_array_size(y); i++)
        fprintf(f, "  - [%.17g, %.17g, 0]\n", x_m,
                json_number_value(json_array_get(y, i)));
}

static double real(const json_t *in, const char *key)
{
    return json_number_value(json_object_get(in, key));
}

/* Serial numbers in the order of the channels: the second word of each line. */
static int write_calibration(FILE *f, const char *folder, struct complaint *why)
{
    char path[PATH_MAX], absolute[PATH_MAX], line[256], serial[64];
    int err = bench_join(path, folder, "channel_mapping.txt", "", why);
    if (err)
        return err;
    FILE *map = fopen(path, "r");
    if (!map || !realpath(folder, absolute)) {
        err = complain(why, -errno, "%s: %s", path, strerror(errno));
        if (map)
            fclose(map);
        return err;
    }
    fprintf(f, "calibration:\n  folder: \"%s\"\n  serials: [", absolute);
    bool first = true;
    while (fgets(line, sizeof line, map)) {
        if (sscanf(line, "%*d %63s", serial) != 1)
            continue; /* the heading */
        fprintf(f, "%s\"%s\"", first ? "" : ", ", serial);
        first = false;
    }
    fputs("]\n", f);
    fclose(map);
    return 0;
}

static int write_survey(const json_t *meta, const char *folder, const char *name,
                        const char *calibration, struct complaint *why)
{
    const json_t *chirp = json_object_get(meta, "chirp");
    const json_t *y = json_object_get(meta, "elem_y"),
                 *x = json_object_get(meta, "scan_x");
    struct export_file e;
    char file[128];
    snprintf(file, sizeof file, "%.100s.yaml", name);
    int err = export_file_open(&e, folder, file, why);
    if (err)
        return err;
    fprintf(e.f,
            "sound_speed_m_s: %.17g\nsample_rate_hz: %.17g\nslot_samples: %.0f\n"
            "latency_samples: %.17g\n"
            "chirp: {start_hz: %.17g, stop_hz: %.17g, duration_s: %.17g}\n",
            real(meta, "c"), real(meta, "fs"), real(chirp, "samples"),
            real(meta, "wav_lead_samples"), real(chirp, "f0"), real(chirp, "f1"),
            real(chirp, "samples") / real(meta, "fs"));
    write_points(e.f, "speakers_m", y, 0.0);
    write_points(e.f, "microphones_m", y, real(meta, "mic_dx"));
    fputs("stage:\n  axis: [1, 0, 0]\n  positions_m:\n", e.f);
    for (size_t i = 0; i < json_array_size(x); i++)
        fprintf(e.f, "    - %.17g\n", json_number_value(json_array_get(x, i)));
    if (calibration)
        err = write_calibration(e.f, calibration, why);
    if (!err)
        return export_file_commit(&e, why);
    struct complaint second;
    return export_file_abandon(&e, err, &second);
}

static int read_mask(struct bench_truth *t, const json_t *from, const char *path,
                     struct complaint *why)
{
    struct bench_mask m = {.z_m = real(from, "z")};
    const json_t *bars = json_object_get(from, "rects");
    int err = bench_read_numbers(json_object_get(from, "ctr"), m.centre_m, 2);
    m.n_bars = json_array_size(bars);
    if (err || m.n_bars > BENCH_MAX_BARS)
        return complain(why, -EINVAL, "%s: masks: expected ctr and up to %d rects", path,
                        BENCH_MAX_BARS);
    for (size_t b = 0; b < m.n_bars; b++)
        if (bench_read_numbers(json_array_get(bars, b), m.bars_m[b], 4))
            return complain(why, -EINVAL, "%s: rects: expected four numbers", path);
    return bench_truth_add_mask(t, &m, why);
}

static int read_truth(struct bench_truth *t, const json_t *meta, const char *path,
                      struct complaint *why)
{
    const json_t *truth = json_object_get(meta, "truth");
    const json_t *points = json_object_get(truth, "points");
    const json_t *masks = json_object_get(truth, "masks");
    double at[3];
    int err = 0;
    for (size_t i = 0; !err && i < json_array_size(points); i++)
        err = bench_read_numbers(json_object_get(json_array_get(points, i), "p"), at, 3)
                  ? complain(why, -EINVAL, "%s: points: expected three numbers", path)
                  : bench_truth_add_point(t, at, why);
    for (size_t i = 0; !err && i < json_array_size(masks); i++)
        err = read_mask(t, json_array_get(masks, i), path, why);
    if (!err && !t->n_points && !t->n_masks)
        err = complain(why, -EINVAL, "%s: truth: expected points or masks", path);
    return err;
}

int bench_read_reference(struct bench_scene *s, const char *recordings, const char *name,
                         const char *calibration, const char *survey_folder,
                         struct complaint *why)
{
    char path[PATH_MAX], background[PATH_MAX];
    json_t *meta = NULL;
    int err = bench_join(path, recordings, name, ".json", why);
    if (!err)
        err = bench_read_json(&meta, path, why);
    if (!err)
        err = read_truth(&s->truth, meta, path, why);
    if (!err)
        err = write_survey(meta, survey_folder, name, calibration, why);
    json_decref(meta);
    if (!err)
        err = bench_join(path, survey_folder, name, ".yaml", why);
    if (!err)
        err = survey_load(&s->survey, path, why);
    if (!err)
        err = bench_join(path, recordings, name, "_wav", why);
    if (!err)
        err = bench_join(background, recordings, name, "_bg_wav", why);
    return err ? err : bench_read_passes(s, path, background, why);
}
