/* SPDX-License-Identifier: MIT */
/* `anlos bag import FILE.mat`: an optical scan of one point in closed form. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <math.h>
#include <matio.h>
#include <unistd.h>

#include "msgs/array.pb-c.h"
#include "msgs/convert.h"
#include "msgs/tensor.h"
#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/stream.h"
#include "nodes/anlos/commands.h"
#include "recon/survey.h"
#include "tests/nodes/command.h"
#include "tests/nodes/mat_write.h"
#include "tests/nodes/optical_point.h"

#define LAST_M 0.68 /* before traces are let down at their end, 0.72 m */

static double counts[PLACES * PLACES * BINS];

static const char *write_scan(struct scratch *s, const char *name)
{
    size_t dims[3] = {PLACES, PLACES, BINS};

    optical_point_fill(counts);
    mat_t *mat = Mat_CreateVer(scratch_path(s, name), NULL, MAT_FT_MAT5);
    matvar_t *v =
        Mat_VarCreate("rect_data", MAT_C_DOUBLE, MAT_T_DOUBLE, 3, dims, counts, 0);
    assert_int_equal(Mat_VarWrite(mat, v, MAT_COMPRESSION_ZLIB), 0);
    Mat_VarFree(v);
    mat_put_number(mat, "width", half_side_m);
    mat_put_number(mat, "bin_s", bin_s);
    Mat_Close(mat);
    return s->path;
}

/* The range of the strongest echo of what was sent, by what the survey says of time and
 * sound. */
static double loudest_m(const struct survey *s, const float *x, size_t n)
{
    double most = 0.0;
    size_t best = 0;

    for (size_t i = 0; i + s->n_replica <= n; i++) {
        double sum = 0.0;
        for (size_t k = 0; k < s->n_replica; k++)
            sum += (double)x[i + k] * (double)s->replica[k];
        if (sum > most) {
            most = sum;
            best = i;
        }
    }
    return 0.5 * s->sound_speed_m_s * ((double)best - s->latency_samples) /
           s->sample_rate_hz;
}

static void check_ping(const struct survey *s, const Anlos__Ping *p)
{
    size_t extents[2];
    const float *x = tensor_f32(p->samples, 2, extents);
    const double *place = s->pings_m[p->position][1];
    double r = sqrt(pow(place[0] - at_m[0], 2) + pow(place[1] - at_m[1], 2) +
                    pow(place[2] - at_m[2], 2));

    assert_non_null(x);
    assert_int_equal(extents[0], 1);
    assert_true(extents[1] >= s->slot_samples);
    if (r > LAST_M)
        return;
    /* A bin of time is 2.4 mm of range. */
    if (!(fabs(loudest_m(s, x, extents[1]) - r) <= 0.0024))
        fail_msg("ping %u: %g m, not %g", p->position, loudest_m(s, x, extents[1]), r);
    for (size_t i = 0; i < extents[1]; i++)
        assert_true(fabsf(x[i]) <= 1.0f);
}

static void each_place_hears_the_point_at_its_range(void **state)
{
    char from[600], to[600];
    struct error why = {""};
    struct import_options o = {.from = from, .out = to};
    struct import_bag *bag;
    struct stream_message m;
    struct stream *in;
    struct survey s = {.n_positions = 0};
    size_t n = 0;

    snprintf(from, sizeof from, "%s", write_scan(*state, "point.mat"));
    snprintf(to, sizeof to, "%s", scratch_path(*state, "point.mcap"));
    assert_int_equal(import_bag_begin(&bag, to, BAG_ZSTD, &why), 0);
    if (import_bag_end(bag, import_mat(bag, &o, &why), &why))
        fail_msg("%s", why.text);
    assert_int_equal(stream_open(&in, to, &why), 0);
    while (!stream_next(in, &m, &why)) {
        ProtobufCMessage *content;
        assert_int_equal(stream_unpack(&content, in, &m, &why), 0);
        if (m.topic == topic_ping()) {
            assert_true(s.n_positions > 0); /* the survey came before */
            check_ping(&s, (Anlos__Ping *)content);
            n++;
        } else if (!s.n_positions &&
                   survey_from_message(&s, (Anlos__Survey *)content, &why)) {
            fail_msg("%s", why.text);
        }
        protobuf_c_message_free_unpacked(content, NULL);
    }
    assert_int_equal(n, PLACES * PLACES);
    assert_int_equal(s.n_positions, PLACES * PLACES);
    assert_int_equal(s.source, ANLOS__SOURCE__REPLAY);
    survey_clear(&s);
    stream_close(in);
}

static void its_image_has_the_point_where_it_is(void **state)
{
    struct scratch *s = *state;
    struct command_result r;
    char mat[600], bag[600], folder[600], survey[640], scene[640], image[600];
    double x, y, z;

    setenv("XDG_CACHE_HOME", s->folder, 1);
    snprintf(mat, sizeof mat, "%s", write_scan(s, "point.mat"));
    snprintf(bag, sizeof bag, "%s", scratch_path(s, "point.mcap"));
    snprintf(folder, sizeof folder, "%s", scratch_path(s, "recording"));
    snprintf(image, sizeof image, "%s", scratch_path(s, "image"));
    snprintf(survey, sizeof survey, "%s/survey.yaml", folder);
    snprintf(scene, sizeof scene, "%s/scene", folder);
    char *import[] = {"bag", "import", mat, "-o", bag, NULL};
    char *export[] = {"bag", "export", bag, "--format", "wav", "-o", folder, NULL};
    char *recon[] = {"recon", "--survey", survey, "--wav", scene, "--out", image, NULL};
    command_run(&r, command_bag, import);
    assert_int_equal(r.code, 0);
    command_run(&r, command_bag, export);
    assert_int_equal(r.code, 0);
    command_run(&r, command_recon, recon);
    if (r.code)
        fail_msg("%s", r.err);
    const char *row = strstr(r.out, "   1 ");
    assert_non_null(row);
    assert_int_equal(sscanf(row, " 1 %lf %lf %lf", &x, &y, &z), 3);
    /* The width of the image: half a pitch aside, half a pulse of 60 ps in depth. */
    if (!(fabs(x - at_m[0]) <= 0.02 && fabs(y - at_m[1]) <= 0.02 &&
          fabs(z - at_m[2]) <= 0.005))
        fail_msg("%g %g %g", x, y, z);
}

static void what_is_no_scan_is_refused(void **state)
{
    struct command_result r;
    char mat[600], bag[600];

    snprintf(mat, sizeof mat, "%s", scratch_write(*state, "no.mat", "nothing"));
    snprintf(bag, sizeof bag, "%s", scratch_path(*state, "no.mcap"));
    char *words[] = {"bag", "import", mat, "-o", bag, NULL};
    command_run(&r, command_bag, words);
    assert_int_equal(r.code, 2);
    assert_contains(r.err, "no.mat");
    assert_int_not_equal(access(bag, F_OK), 0);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)
    const struct CMUnitTest tests[] = {
        TEST(each_place_hears_the_point_at_its_range),
        TEST(its_image_has_the_point_where_it_is),
        TEST(what_is_no_scan_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
