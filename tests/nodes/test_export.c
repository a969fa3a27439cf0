/* SPDX-License-Identifier: MIT */
#include <cairo.h>
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/rt/export.h"
#include "nodes/rt/export_projection.h"
#include "tests/hal/folder.h"
#include "tests/nodes/near.h"

enum { NX = 7, NY = 5, NZ = 6 };

struct fixture {
    char folder[64];
    struct grid grid;
    float volume[NZ][NY][NX];
};

static int set_up(void **state)
{
    struct fixture *f = calloc(1, sizeof *f);
    strcpy(f->folder, "/tmp/anlos-export-XXXXXX");
    if (!f || !mkdtemp(f->folder))
        return -1;
    f->grid = (struct grid){.origin_m = {-0.05, 0.1, 1.6},
                            .step_m = {0.01, 0.03, 1.0 / 3.0},
                            .n = {NX, NY, NZ}};
    unsigned seed = 1;
    for (size_t i = 0; i < NX * NY * NZ; i++) {
        seed = seed * 1664525u + 1013904223u;
        (&f->volume[0][0][0])[i] = (float)(seed >> 8) / 16777216.0f;
    }
    *state = f;
    return 0;
}

static size_t count_files(const char *folder)
{
    DIR *d = opendir(folder);
    size_t n = 0;
    assert_non_null(d);
    for (struct dirent *e = readdir(d); e; e = readdir(d))
        n += strcmp(e->d_name, ".") && strcmp(e->d_name, "..");
    closedir(d);
    return n;
}

static int tear_down(void **state)
{
    struct fixture *f = *state;
    int err = folder_remove(f->folder);
    free(f);
    return err;
}

static char *read_all(const char *folder, const char *name, size_t *size)
{
    char path[256];
    snprintf(path, sizeof path, "%.100s/%s", folder, name);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    char *data = calloc(1, 1 << 16);
    *size = fread(data, 1, (1 << 16) - 1, file);
    fclose(file);
    return data;
}

static void a_volume_reads_back_from_nrrd(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    size_t size, n[3];
    double step[3], origin[3];
    assert_int_equal(
        export_nrrd(f->folder, "v.nrrd", &f->grid, &f->volume[0][0][0], &why), 0);
    char *data = read_all(f->folder, "v.nrrd", &size);
    char *end = strstr(data, "\n\n");
    assert_non_null(end);
    assert_memory_equal(data, "NRRD0005\n", 9);
    assert_non_null(strstr(data, "\ntype: float\n"));
    assert_non_null(strstr(data, "\nendian: little\n"));
    assert_non_null(strstr(data, "\nencoding: raw\n"));
    assert_non_null(strstr(data, "\nspace units: \"m\" \"m\" \"m\"\n"));
    /* the format asks for the space before what depends on it */
    assert_true(strstr(data, "space dimension: 3") < strstr(data, "space directions:"));
    assert_int_equal(
        sscanf(strstr(data, "sizes:"), "sizes: %zu %zu %zu", &n[0], &n[1], &n[2]), 3);
    assert_int_equal(sscanf(strstr(data, "space directions:"),
                            "space directions: (%lf,0,0) (0,%lf,0) (0,0,%lf)", &step[0],
                            &step[1], &step[2]),
                     3);
    assert_int_equal(sscanf(strstr(data, "space origin:"), "space origin: (%lf,%lf,%lf)",
                            &origin[0], &origin[1], &origin[2]),
                     3);
    for (int a = 0; a < 3; a++) {
        assert_int_equal(n[a], f->grid.n[a]);
        assert_near(step[a], f->grid.step_m[a], 0.0);
        assert_near(origin[a], f->grid.origin_m[a], 0.0);
    }
    assert_int_equal(size - (size_t)(end + 2 - data), sizeof f->volume);
    assert_memory_equal(end + 2, f->volume, sizeof f->volume);
    free(data);
}

static void projections_are_the_maxima_of_all_voxels_behind(void **state)
{
    struct fixture *f = *state;
    for (int across = 0; across < 3; across++) {
        for (int up = 0; up < 3; up++) {
            struct projection p;
            if (across == up)
                continue;
            assert_int_equal(
                projection_create(&p, &f->grid, &f->volume[0][0][0], across, up), 0);
            for (size_t b = 0; b < f->grid.n[up]; b++) {
                for (size_t a = 0; a < f->grid.n[across]; a++) {
                    int along = 3 - across - up;
                    float most = 0.0f;
                    for (size_t c = 0; c < f->grid.n[along]; c++) {
                        size_t at[3];
                        at[across] = a;
                        at[up] = b;
                        at[along] = c;
                        most = fmaxf(most, f->volume[at[2]][at[1]][at[0]]);
                    }
                    assert_true(p.value[b * p.n[0] + a] == most);
                }
            }
            projection_clear(&p);
        }
    }
}

static void resampling_meets_the_samples_and_keeps_a_ramp(void **state)
{
    (void)state;
    float value[3][8], out[9 * 24];
    struct projection p = {
        .axis = {0, 1}, .n = {8, 3}, .step_m = {1, 1}, .value = &value[0][0]};
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 8; c++)
            value[r][c] = 10.0f + 2.0f * (float)c + 5.0f * (float)r;
    /* three pixels a sample: the middle one lies on it, row 0 is the top */
    assert_int_equal(projection_resample(&p, 24, 9, out), 0);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 8; c++)
            assert_near((double)out[(8 - (3 * r + 1)) * 24 + 3 * c + 1],
                        (double)value[r][c], 1e-4);
    /* between inner samples a ramp stays a ramp */
    assert_near((double)out[4 * 24 + 3 * 3 + 2], 10.0 + 2.0 * (3 + 1.0 / 3.0) + 5.0,
                1e-4);
}

static void resampling_never_goes_below_zero(void **state)
{
    (void)state;
    float value[5] = {0, 0, 1, 0, 0}, out[50];
    struct projection p = {.n = {5, 1}, .step_m = {1, 1}, .value = value};
    assert_int_equal(projection_resample(&p, 50, 1, out), 0);
    for (int i = 0; i < 50; i++)
        assert_true(out[i] >= 0.0f && out[i] <= 1.0001f);
}

static void brighter_means_more(void **state)
{
    (void)state;
    double before = -1.0;
    for (int i = 0; i <= 100; i++) {
        double rgb[3];
        colour_at(i / 100.0, rgb);
        double luminance = 0.2126 * pow(rgb[0], 2.2) + 0.7152 * pow(rgb[1], 2.2) +
                           0.0722 * pow(rgb[2], 2.2);
        assert_true(luminance >= before - 1e-4);
        before = luminance;
    }
    assert_true(before > 0.8);
}

/* Centre of the pixels that only the brightest end of the map has. */
static void find_bright(const char *folder, const char *name, double *across,
                        double *down, double size[2])
{
    char path[256];
    snprintf(path, sizeof path, "%.100s/%s", folder, name);
    cairo_surface_t *png = cairo_image_surface_create_from_png(path);
    assert_int_equal(cairo_surface_status(png), CAIRO_STATUS_SUCCESS);
    int w = cairo_image_surface_get_width(png), h = cairo_image_surface_get_height(png);
    int stride = cairo_image_surface_get_stride(png);
    const unsigned char *data = cairo_image_surface_get_data(png);
    double sum[3] = {0};
    for (int r = 0; r < h; r++) {
        for (int c = 0; c < w * 3 / 4; c++) { /* the colour bar is on the right */
            const unsigned char *bgr = data + r * stride + 4 * c;
            if (bgr[2] > 200 && bgr[1] > 120 && bgr[0] < 120) {
                sum[0] += c;
                sum[1] += r;
                sum[2] += 1;
            }
        }
    }
    cairo_surface_destroy(png);
    assert_true(sum[2] > 20);
    *across = sum[0] / sum[2];
    *down = sum[1] / sum[2];
    size[0] = w;
    size[1] = h;
}

static void pictures_show_high_y_above_and_far_z_away(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    struct grid g = {.step_m = {0.05, 0.05, 0.05}, .n = {20, 20, 20}};
    float *v = calloc(8000, sizeof *v);
    double across, down, size[2];
    v[(17 * 20 + 16) * 20 + 3] = 1.0f; /* small x, large y, large z */
    assert_int_equal(export_projections(f->folder, &g, v, NULL, &why), 0);
    free(v);
    find_bright(f->folder, "projection_xy.png", &across, &down, size);
    assert_true(across < 0.35 * size[0] && down < 0.35 * size[1]);
    find_bright(f->folder, "projection_xz.png", &across, &down, size);
    assert_true(across < 0.35 * size[0] && down < 0.35 * size[1]);
    find_bright(f->folder, "projection_yz.png", &across, &down, size);
    assert_true(across > 0.5 * size[0] && down < 0.35 * size[1]);
    assert_int_equal(count_files(f->folder), 3);
}

/* How much green the brightest point of the image has, 0..1: it rises along the map. */
static double brightest(const char *folder, const char *name)
{
    char path[256];
    double most = 0.0;

    snprintf(path, sizeof path, "%.100s/%s", folder, name);
    cairo_surface_t *png = cairo_image_surface_create_from_png(path);
    assert_int_equal(cairo_surface_status(png), CAIRO_STATUS_SUCCESS);
    int w = cairo_image_surface_get_width(png), h = cairo_image_surface_get_height(png);
    int stride = cairo_image_surface_get_stride(png);
    for (int r = h / 4; r < h / 2; r++)
        for (int c = w / 4; c < w / 2; c++) {
            const unsigned char *bgr = cairo_image_surface_get_data(png) + r * stride +
                                       4 * c;
            most = fmax(most, bgr[1] / 255.0);
        }
    cairo_surface_destroy(png);
    return most;
}

/* Powers of noise are exponential: the largest of n is ln n / ln 2 medians, 11 dB of
 * 8000; 30 dB above the median is the top of the scale at least, and 25 dB of it are
 * drawn: noise reaches a quarter of the map.  What is 40 dB above it is at the top. */
static void an_image_of_noise_does_not_look_like_one_of_objects(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    struct grid g = {.step_m = {0.05, 0.05, 0.05}, .n = {100, 1, 80}};
    float *v = calloc(8000, sizeof *v);
    uint32_t seed = 1;
    double low[3], top[3], grid_line = 0.14;

    assert_non_null(v);
    for (int i = 0; i < 8000; i++) {
        seed = seed * 1664525u + 1013904223u;
        v[i] = -1e-7f * logf(((float)(seed >> 8) + 0.5f) / 0x1p24f);
    }
    colour_at(0.35, low);
    colour_at(0.9, top);
    assert_int_equal(export_projection(f->folder, 1, &g, v, NULL, &why), 0);
    assert_true(brightest(f->folder, "projection_xz.png") < low[1] + grid_line);
    for (int z = 45; z < 55; z++)
        for (int x = 30; x < 40; x++)
            v[z * 100 + x] = 1e-3f;
    assert_int_equal(export_projection(f->folder, 1, &g, v, NULL, &why), 0);
    assert_true(brightest(f->folder, "projection_xz.png") > top[1]);
    free(v);
}

/* A bumper's: 6.4 m wide, one voxel of 10 cm high.  The numbers of its axis need room. */
static void an_image_of_one_plane_is_not_drawn_as_a_hair(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    struct grid g = {.step_m = {0.1, 0.1, 0.1}, .n = {64, 1, 22}};
    float v[64 * 22];
    char path[256];
    long bright = 0;

    for (int i = 0; i < 64 * 22; i++)
        v[i] = i < 64 * 10 ? 1.0f : 0.0f;
    assert_int_equal(export_projection(f->folder, 0, &g, v, NULL, &why), 0);
    snprintf(path, sizeof path, "%.100s/projection_xy.png", f->folder);
    cairo_surface_t *png = cairo_image_surface_create_from_png(path);
    assert_int_equal(cairo_surface_status(png), CAIRO_STATUS_SUCCESS);
    int w = cairo_image_surface_get_width(png), h = cairo_image_surface_get_height(png);
    int stride = cairo_image_surface_get_stride(png);
    for (int r = 0; r < h; r++) {
        const unsigned char *bgr = cairo_image_surface_get_data(png) + r * stride +
                                   4 * (w / 3);
        bright += bgr[2] > 200 && bgr[1] > 200 && bgr[0] < 190;
    }
    cairo_surface_destroy(png);
    assert_true(bright > 100);
}

static void an_empty_volume_and_a_single_voxel_can_be_drawn(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    struct grid g = {.step_m = {0.05, 0.05, 0.05}, .n = {1, 1, 1}};
    float zero = 0.0f;
    assert_int_equal(export_projections(f->folder, &g, &zero, NULL, &why), 0);
    assert_int_equal(count_files(f->folder), 3);
}

static void detections_json_is_valid_and_has_null_for_nan(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    Anlos__Vec3 at = ANLOS__VEC3__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, *all[1] = {&d};
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    double covariance[6] = {4e-4, 0, 0, 9e-4, 0, 1e4};
    at.x = 1.25;
    at.z = NAN;
    d.id = 3;
    d.position_m = d.virtual_m = d.extent_m = &at;
    d.covariance_m2 = covariance;
    d.n_covariance_m2 = 6;
    d.existence = 0.5;
    d.level_db = INFINITY;
    d.at_border = 1u << 5 | 1u << 0;
    uint32_t of[2] = {1, 7};
    d.multipath = ANLOS__MULTIPATH__BY_A_FACE;
    d.multipath_of = of;
    d.n_multipath_of = 2;
    list.detections = all;
    list.n_detections = 1;
    list.mirrored = list.in_vehicle_frame = true;
    list.source = ANLOS__SOURCE__SIMULATION;
    list.temperature_c = NAN;
    Anlos__ViewArea area = ANLOS__VIEW_AREA__INIT, *areas[1] = {&area};
    double corners[6] = {1.0, -2.0, 3.0, -2.0, 2.0, 0.5};
    area.wall = 4;
    area.corners_m = corners;
    area.n_corners_m = 6;
    list.views = areas;
    list.n_views = 1;
    assert_int_equal(export_detections(f->folder, &list, &why), 0);

    char path[256];
    json_error_t error;
    snprintf(path, sizeof path, "%s/detections.json", f->folder);
    json_t *j = json_load_file(path, 0, &error);
    assert_non_null(j);
    assert_string_equal(json_string_value(json_object_get(j, "frame")), "vehicle");
    assert_string_equal(json_string_value(json_object_get(j, "source")), "simulation");
    assert_true(json_is_null(json_object_get(j, "temperature_c")));
    const json_t *o = json_array_get(json_object_get(j, "detections"), 0);
    assert_int_equal(json_integer_value(json_object_get(o, "id")), 3);
    assert_true(json_is_null(json_object_get(o, "level_db")));
    const json_t *p = json_object_get(o, "position_m"),
                 *s = json_object_get(o, "sigma_m");
    assert_near(json_real_value(json_array_get(p, 0)), 1.25, 0.0);
    assert_true(json_is_null(json_array_get(p, 2)));
    assert_near(json_real_value(json_array_get(s, 1)), 0.03, 1e-9);
    assert_true(json_is_null(json_array_get(s, 2)));
    const json_t *b = json_object_get(o, "at_border");
    assert_int_equal(json_array_size(b), 2);
    assert_string_equal(json_string_value(json_array_get(b, 0)), "x-");
    assert_string_equal(json_string_value(json_array_get(b, 1)), "z+");
    const json_t *m = json_object_get(o, "multipath"), *ids = json_object_get(m, "of");
    assert_string_equal(json_string_value(json_object_get(m, "by")), "face");
    assert_int_equal(json_array_size(ids), 2);
    assert_int_equal(json_integer_value(json_array_get(ids, 1)), 7);
    const json_t *v = json_array_get(json_object_get(j, "views"), 0);
    assert_int_equal(json_integer_value(json_object_get(v, "wall")), 4);
    const json_t *ring = json_object_get(v, "corners_m");
    assert_int_equal(json_array_size(ring), 3);
    assert_near(json_real_value(json_array_get(json_array_get(ring, 0), 1)), -2.0, 0.0);
    assert_near(json_real_value(json_array_get(json_array_get(ring, 2), 0)), 2.0, 0.0);
    json_decref(j);
    d.multipath = ANLOS__MULTIPATH__NO_MULTIPATH;
    json_t *none = export_multipath(&d);
    assert_true(json_is_null(none));
    json_decref(none);
}

static void keys_keep_the_order_given(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    size_t size;
    json_t *j = json_pack("{si, si, si}", "zebra", 1, "ape", 2, "mole", 3);
    assert_int_equal(export_json(f->folder, "x.json", j, &why), 0);
    json_decref(j);
    char *text = read_all(f->folder, "x.json", &size);
    assert_true(strstr(text, "zebra") < strstr(text, "ape"));
    assert_true(strstr(text, "ape") < strstr(text, "mole"));
    assert_int_equal(text[size - 1], '\n');
    free(text);
}

static void folders_are_made_with_their_parents(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    char path[128];
    struct stat st;
    snprintf(path, sizeof path, "%s/a/b/c", f->folder);
    assert_int_equal(export_folder(path, &why), 0);
    assert_int_equal(stat(path, &st), 0);
    assert_int_equal(count_files(path), 0);
}

static void a_folder_that_cannot_be_written_is_refused_and_named(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    char path[128];
    snprintf(path, sizeof path, "%s/file", f->folder);
    fclose(fopen(path, "w"));
    assert_int_equal(export_folder(path, &why), -ENOTDIR);
    assert_non_null(strstr(why.text, path));
    strcat(path, "/below");
    assert_int_equal(export_folder(path, &why), -ENOTDIR);
    assert_true(export_folder("/proc/anlos", &why) < 0);
    assert_non_null(strstr(why.text, "/proc/anlos"));
    assert_true(export_folder("", &why) < 0);
    if (geteuid()) { /* the superuser may write everywhere */
        snprintf(path, sizeof path, "%s/closed", f->folder);
        assert_int_equal(mkdir(path, 0555), 0);
        assert_int_equal(export_folder(path, &why), -EACCES);
    }
}

/* A disk that is full after some bytes, as a limit of this process. */
static void limit_files(rlim_t bytes)
{
    struct rlimit limit;
    getrlimit(RLIMIT_FSIZE, &limit);
    limit.rlim_cur = bytes < limit.rlim_max ? bytes : limit.rlim_max;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
}

static void a_full_disk_is_an_error_and_leaves_nothing(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    struct grid g = {.step_m = {0.05, 0.05, 0.05}, .n = {20, 20, 20}};
    float *v = calloc(8000, sizeof *v);
    json_t *j = json_object();
    for (int i = 0; i < 8000; i++)
        v[i] = (float)(i % 97);
    for (int i = 0; i < 500; i++) {
        char key[16];
        snprintf(key, sizeof key, "key %d", i);
        json_object_set_new(j, key, json_integer(i));
    }
    signal(SIGXFSZ, SIG_IGN);
    limit_files(2000);
    int nrrd = export_nrrd(f->folder, "v.nrrd", &g, v, &why);
    int png = export_projections(f->folder, &g, v, NULL, &why);
    int json = export_json(f->folder, "x.json", j, &why);
    limit_files(RLIM_INFINITY);
    free(v);
    json_decref(j);
    assert_int_equal(nrrd, -EFBIG);
    assert_int_equal(png, -EFBIG);
    assert_int_equal(json, -EFBIG);
    assert_non_null(strstr(why.text, "x.json"));
    assert_int_equal(count_files(f->folder), 0);
}

static void a_stage_shows_its_files_at_commit_and_replaces_older_ones(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    struct export_stage stage;
    size_t size;
    json_t *old = json_pack("{si}", "old", 1), *new = json_pack("{si}", "new", 1);
    assert_int_equal(export_json(f->folder, "x.json", old, &why), 0);
    assert_int_equal(export_stage_begin(&stage, f->folder, &why), 0);
    assert_int_equal(export_json(stage.path, "x.json", new, &why), 0);
    char *text = read_all(f->folder, "x.json", &size);
    assert_non_null(strstr(text, "old"));
    free(text);
    assert_int_equal(export_stage_end(&stage, 0, &why), 0);
    text = read_all(f->folder, "x.json", &size);
    assert_non_null(strstr(text, "new"));
    free(text);
    assert_int_equal(count_files(f->folder), 1);
    json_decref(old);
    json_decref(new);
}

static void an_abandoned_stage_takes_the_folders_that_it_made(void **state)
{
    struct fixture *f = *state;
    struct error why = {0};
    struct export_stage stage;
    char path[128], below[PATH_MAX + 16];
    json_t *j = json_object();
    snprintf(path, sizeof path, "%s/new/deep", f->folder);
    assert_int_equal(export_stage_begin(&stage, path, &why), 0);
    snprintf(below, sizeof below, "%s/scene", stage.path);
    assert_int_equal(mkdir(below, 0777), 0);
    assert_int_equal(export_json(below, "x.json", j, &why), 0);
    json_decref(j);
    export_stage_end(&stage, -EIO, NULL);
    assert_int_equal(count_files(f->folder), 0);

    assert_int_equal(export_stage_begin(&stage, f->folder, &why), 0);
    export_stage_end(&stage, -EIO, NULL);
    struct stat st;
    assert_int_equal(stat(f->folder, &st), 0); /* it was there before */
}

/* Its own folder has gone when somebody reads that, who never named it. */
static void an_error_names_the_folder_that_was_asked_for(void **state)
{
    struct fixture *f = *state;
    struct error why = {0}, expected;
    struct export_stage stage;
    assert_int_equal(export_stage_begin(&stage, f->folder, NULL), 0);
    error_say(&why, -ENOSPC, "%s/a.json and %s/deep/b: full", stage.path, stage.path);
    error_say(&expected, -ENOSPC, "%s/a.json and %s/deep/b: full", f->folder, f->folder);
    export_stage_end(&stage, -EIO, &why);
    assert_string_equal(why.text, expected.text);
}

/* Begins a stage in a process of its own, with a file and a folder in it, and kills it.
 */
static void leave_a_stage_behind(const char *folder)
{
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (!pid) {
        struct export_stage stage;
        char below[PATH_MAX + 16];
        json_t *j = json_object();
        if (export_stage_begin(&stage, folder, NULL))
            _exit(1);
        snprintf(below, sizeof below, "%s/scene", stage.path);
        if (mkdir(below, 0777) || export_json(below, "x.json", j, NULL))
            _exit(1);
        raise(SIGKILL);
    }
    int status;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFSIGNALED(status));
}

static void what_a_killed_process_left_is_removed_by_the_next(void **state)
{
    struct fixture *f = *state;
    struct export_stage stage;
    leave_a_stage_behind(f->folder);
    assert_int_equal(count_files(f->folder), 1);
    assert_int_equal(export_stage_begin(&stage, f->folder, NULL), 0);
    assert_int_equal(count_files(f->folder), 1); /* its own */
    export_stage_end(&stage, -EIO, NULL);
    assert_int_equal(count_files(f->folder), 0);
}

static void a_stage_that_lives_is_no_leftover(void **state)
{
    struct fixture *f = *state;
    struct export_stage first, second;
    json_t *j = json_object();
    assert_int_equal(export_stage_begin(&first, f->folder, NULL), 0);
    assert_int_equal(export_stage_begin(&second, f->folder, NULL), 0);
    assert_int_equal(export_json(first.path, "x.json", j, NULL), 0);
    assert_int_equal(export_stage_end(&first, 0, NULL), 0);
    export_stage_end(&second, -EIO, NULL);
    assert_int_equal(count_files(f->folder), 1);
    json_decref(j);
}

/* Who may write into the folder must not thereby remove what lies elsewhere. */
static void a_link_with_a_stages_name_is_left_alone(void **state)
{
    struct fixture *f = *state;
    struct export_stage stage;
    char elsewhere[128], folder[128], link[256];
    json_t *j = json_object();
    snprintf(elsewhere, sizeof elsewhere, "%s/elsewhere", f->folder);
    snprintf(folder, sizeof folder, "%s/out", f->folder);
    snprintf(link, sizeof link, "%s/.unfinished.abcdef", folder);
    assert_int_equal(mkdir(elsewhere, 0777), 0);
    assert_int_equal(mkdir(folder, 0777), 0);
    assert_int_equal(export_json(elsewhere, "x.json", j, NULL), 0);
    assert_int_equal(symlink(elsewhere, link), 0);
    assert_int_equal(export_stage_begin(&stage, folder, NULL), 0);
    export_stage_end(&stage, -EIO, NULL);
    assert_int_equal(count_files(elsewhere), 1);
    json_decref(j);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_volume_reads_back_from_nrrd, set_up, tear_down),
        cmocka_unit_test_setup_teardown(projections_are_the_maxima_of_all_voxels_behind,
                                        set_up, tear_down),
        cmocka_unit_test(resampling_meets_the_samples_and_keeps_a_ramp),
        cmocka_unit_test(resampling_never_goes_below_zero),
        cmocka_unit_test(brighter_means_more),
        cmocka_unit_test_setup_teardown(pictures_show_high_y_above_and_far_z_away, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(
            an_image_of_noise_does_not_look_like_one_of_objects, set_up, tear_down),
        cmocka_unit_test_setup_teardown(an_image_of_one_plane_is_not_drawn_as_a_hair,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(an_empty_volume_and_a_single_voxel_can_be_drawn,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(detections_json_is_valid_and_has_null_for_nan,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(keys_keep_the_order_given, set_up, tear_down),
        cmocka_unit_test_setup_teardown(folders_are_made_with_their_parents, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(
            a_folder_that_cannot_be_written_is_refused_and_named, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_full_disk_is_an_error_and_leaves_nothing,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(
            a_stage_shows_its_files_at_commit_and_replaces_older_ones, set_up, tear_down),
        cmocka_unit_test_setup_teardown(an_abandoned_stage_takes_the_folders_that_it_made,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(an_error_names_the_folder_that_was_asked_for,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(what_a_killed_process_left_is_removed_by_the_next,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_stage_that_lives_is_no_leftover, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(a_link_with_a_stages_name_is_left_alone, set_up,
                                        tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
