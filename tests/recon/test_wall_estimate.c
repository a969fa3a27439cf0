/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/walls/wall_estimate.h"
#include "tests/recon/reference.h"

enum { MOST = 4096 };

static const double degree = M_PI / 180.0;

static double normal_random(unsigned long long *seed)
{
    double u = reference_random(seed), v = reference_random(seed);
    return sqrt(-2.0 * log(1.0 - u)) * cos(2.0 * M_PI * v);
}

/* Echoes of image sources, as a list that grows. */
struct hall {
    struct wall_echo echoes[MOST];
    size_t n, n_pairs;
    size_t n_speakers, n_microphones;
    double speakers[64][3], microphones[64][3];
    double speaker_error[64], microphone_error[64]; /* of paths */
    double noise_m, stretch, delay_m;
    unsigned long long seed;
};

/* 8 speakers and 8 microphones over 1.6 m along x. */
static struct hall *bumper(unsigned long long seed)
{
    struct hall *h = calloc(1, sizeof *h);
    assert_non_null(h);
    h->seed = seed;
    h->n_speakers = h->n_microphones = 8;
    for (int i = 0; i < 8; i++) {
        h->speakers[i][0] = -0.8 + 0.2 * i;
        h->microphones[i][0] = -0.75 + 0.21 * i;
    }
    return h;
}

/* 8 and 8 upright over 0.9 m at 4 places along x, the paper's scan made thin. */
static struct hall *scan(unsigned long long seed)
{
    struct hall *h = calloc(1, sizeof *h);
    assert_non_null(h);
    h->seed = seed;
    h->n_speakers = h->n_microphones = 32;
    for (int k = 0; k < 32; k++) {
        h->speakers[k][0] = h->microphones[k][0] = 0.33 * (k / 8);
        h->microphones[k][0] += 0.05;
        h->speakers[k][1] = 0.12 * (k % 8);
        h->microphones[k][1] = 0.06 + 0.12 * (k % 8);
    }
    return h;
}

static struct wall stands(double azimuth, double tilt, double distance_m)
{
    return (struct wall){
        .normal = {sin(azimuth) * cos(tilt), sin(tilt), cos(azimuth) * cos(tilt)},
        .distance_m = distance_m};
}

static void mirror(const struct wall *w, const double p[3], double q[3])
{
    double beyond = p[0] * w->normal[0] + p[1] * w->normal[1] + p[2] * w->normal[2] -
                    w->distance_m;
    for (int a = 0; a < 3; a++)
        q[a] = p[a] - 2.0 * beyond * w->normal[a];
}

static double apart(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static bool same_place(const struct hall *h, size_t s, size_t m)
{
    return h->n_speakers != 32 || s / 8 == m / 8;
}

static struct wall_echo *add(struct hall *h, size_t s, size_t m, double path)
{
    struct wall_echo *e = &h->echoes[h->n++];
    assert_true(h->n < MOST);
    memcpy(e->speaker_m, h->speakers[s], sizeof e->speaker_m);
    memcpy(e->microphone_m, h->microphones[m], sizeof e->microphone_m);
    e->speaker = (uint32_t)(s % 8);
    e->microphone = (uint32_t)(m % 8);
    e->pair = (uint32_t)(s * h->n_microphones + m);
    e->weight = 1.0;
    e->path_m = (1.0 + h->stretch) * path + h->delay_m + h->speaker_error[e->speaker] +
                h->microphone_error[e->microphone] + h->noise_m * normal_random(&h->seed);
    return e;
}

/* Each pair hears walls[n]; outliers: and so many echoes from anywhere. */
static void hear(struct hall *h, const struct wall *walls, size_t n, size_t outliers)
{
    for (size_t s = 0; s < h->n_speakers; s++)
        for (size_t m = 0; m < h->n_microphones; m++) {
            if (!same_place(h, s, m))
                continue;
            h->n_pairs++;
            for (size_t k = 0; k < n; k++) {
                double image[3];
                mirror(&walls[k], h->speakers[s], image);
                add(h, s, m, apart(image, h->microphones[m]));
            }
            for (size_t k = 0; k < outliers; k++)
                add(h, s, m, 1.0 + 7.0 * reference_random(&h->seed));
        }
}

/* The corner that two walls make: sound by way of both. */
static void hear_corner(struct hall *h, const struct wall *a, const struct wall *b)
{
    struct hall *sorted = calloc(1, sizeof *sorted);
    assert_non_null(sorted);
    size_t n = h->n;
    memcpy(sorted->echoes, h->echoes, sizeof h->echoes);
    h->n = 0;
    for (size_t i = 0; i < n; i++) {
        h->echoes[h->n++] = sorted->echoes[i];
        if (i + 1 < n && sorted->echoes[i + 1].pair == sorted->echoes[i].pair)
            continue;
        double first[3], image[3];
        size_t s = sorted->echoes[i].pair / h->n_microphones;
        size_t m = sorted->echoes[i].pair % h->n_microphones;
        mirror(a, h->speakers[s], first);
        mirror(b, first, image);
        add(h, s, m, apart(image, h->microphones[m]));
    }
    free(sorted);
}

static void find(struct hall *h, struct wall_estimates *out)
{
    struct wall_estimate_config cfg;
    wall_estimate_default(&cfg);
    assert_int_equal(wall_estimate(out, &cfg, h->echoes, h->n, h->n_pairs), 0);
}

static double azimuth_of(const struct wall *w)
{
    return atan2(w->normal[0], w->normal[2]);
}

static void a_wall_without_noise_is_found_where_it_stands(void **state)
{
    (void)state;
    const double azimuths[] = {0.0, 20.0, -45.0, 60.0};
    for (size_t k = 0; k < 4; k++) {
        struct hall *h = bumper(k + 1);
        struct wall w = stands(azimuths[k] * degree, 0.0, 0.7 + 0.6 * (double)k);
        struct wall_estimates found;
        hear(h, &w, 1, 0);
        find(h, &found);
        assert_int_equal(found.n, 1);
        assert_near(azimuth_of(&found.list[0].wall), azimuths[k] * degree, 1e-6);
        assert_near(found.list[0].wall.distance_m, w.distance_m, 1e-6);
        assert_near(found.list[0].share, 1.0, 1e-12);
        free(h);
    }
}

static void outliers_do_not_move_it(void **state)
{
    (void)state;
    struct hall *h = bumper(5);
    struct wall w = stands(0.3, 0.0, 1.4);
    struct wall_estimates found;
    h->noise_m = 0.002;
    hear(h, &w, 1, 5);
    for (size_t i = 0; i < h->n; i++) /* and a third of the pairs do not hear it */
        if (h->echoes[i].pair % 3 == 0)
            h->echoes[i].path_m = 1.0 + 7.0 * reference_random(&h->seed);
    find(h, &found);
    assert_int_equal(found.n, 1);
    assert_near(azimuth_of(&found.list[0].wall), 0.3, 0.005);
    assert_near(found.list[0].wall.distance_m, 1.4, 0.004);
    free(h);
}

static void noise_alone_makes_no_wall(void **state)
{
    (void)state;
    for (unsigned long long seed = 1; seed <= 10; seed++) {
        struct hall *h = bumper(seed);
        struct wall_estimates found;
        hear(h, NULL, 0, 6);
        find(h, &found);
        assert_int_equal(found.n, 0);
        assert_int_equal(found.n_bent, 0);
        free(h);
    }
}

static void two_walls_are_found_and_their_corner_is_none(void **state)
{
    (void)state;
    struct hall *h = bumper(7);
    const struct wall walls[2] = {stands(0.0, 0.0, 2.0), stands(60 * degree, 0.0, 1.5)};
    struct wall_estimates found;
    h->noise_m = 0.002;
    hear(h, walls, 2, 2);
    hear_corner(h, &walls[0], &walls[1]);
    find(h, &found);
    assert_int_equal(found.n, 2);
    size_t ahead = fabs(azimuth_of(&found.list[0].wall)) < 0.5 ? 0 : 1;
    assert_near(azimuth_of(&found.list[ahead].wall), 0.0, 0.01);
    assert_near(found.list[ahead].wall.distance_m, 2.0, 0.01);
    assert_near(azimuth_of(&found.list[!ahead].wall), 60 * degree, 0.01);
    assert_near(found.list[!ahead].wall.distance_m, 1.5, 0.01);
    free(h);
}

/* A corner of 90 degrees alone: its walls are not to be heard, and it is no plane. */
static void a_corner_is_not_taken_for_a_wall(void **state)
{
    (void)state;
    struct hall *h = bumper(8);
    const struct wall a = stands(45 * degree, 0.0, 1.6),
                      b = stands(-45 * degree, 0.0, 1.6);
    struct wall_estimates found;
    hear(h, NULL, 0, 1); /* something to hang the corner's echoes on */
    hear_corner(h, &a, &b);
    find(h, &found);
    assert_int_equal(found.n, 0);
    free(h);
}

static double way_over(const struct hall *h, size_t s, size_t m, const double at[3])
{
    return apart(h->speakers[s], at) + apart(at, h->microphones[m]);
}

/* Where the wall stands at an angle from the foot of its perpendicular, seen from the
 * middle of its circle. */
static void place_on(const struct wall *w, double radius_m, double angle, double out[3])
{
    double aside = radius_m * sin(angle), back = radius_m * (1.0 - cos(angle));
    out[0] = w->normal[0] * (w->distance_m + back) + w->normal[2] * aside;
    out[1] = 0.0;
    out[2] = w->normal[2] * (w->distance_m + back) - w->normal[0] * aside;
}

/* Each pair hears a part of an upright cylinder that w touches nearest to the origin;
 * radius_m > 0 bulges towards it.  The shortest way over the circle, by thirds. */
static void hear_round(struct hall *h, const struct wall *w, double radius_m)
{
    for (size_t s = 0; s < h->n_speakers; s++)
        for (size_t m = 0; m < h->n_microphones; m++, h->n_pairs++) {
            double low = -1.2 / fabs(radius_m), high = -low, at[3];
            low = fmax(low, -1.2);
            high = fmin(high, 1.2);
            for (int k = 0; k < 80; k++) {
                double a = low + (high - low) / 3.0, b = high - (high - low) / 3.0;
                double there[3];
                place_on(w, radius_m, a, at);
                place_on(w, radius_m, b, there);
                if (way_over(h, s, m, at) < way_over(h, s, m, there))
                    high = b;
                else
                    low = a;
            }
            place_on(w, radius_m, low, at);
            add(h, s, m, way_over(h, s, m, at));
        }
}

/* A plane that touches it would mirror whom it shows to a place a metre off. */
static void a_pillar_is_no_mirror_and_is_told(void **state)
{
    (void)state;
    const double radii_m[3] = {1.0, 2.0, -2.6}, distances_m[3] = {1.6, 3.0, 0.8};
    for (size_t k = 0; k < 3; k++) {
        struct hall *h = bumper(31 + k);
        struct wall w = stands(0.2, 0.0, distances_m[k]);
        struct wall_estimates found;
        h->noise_m = 0.001;
        hear_round(h, &w, radii_m[k]);
        find(h, &found);
        assert_int_equal(found.n, 0);
        assert_int_equal(found.n_bent, 1);
        assert_near(found.curvature_1_m, 1.0 / radii_m[k], 0.05 / fabs(radii_m[k]));
        free(h);
    }
}

/* The plane that touches the cylinder nearest to the middle of the array. */
static struct wall touching(const struct hall *h, const struct wall *w, double radius_m)
{
    double middle_m = 0.0;
    for (size_t i = 0; i < h->n_speakers; i++)
        middle_m += 0.5 * (h->speakers[i][0] + h->microphones[i][0]) /
                    (double)h->n_speakers;
    double x = w->normal[0] * (w->distance_m + radius_m);
    double z = w->normal[2] * (w->distance_m + radius_m);
    double sign = z < 0.0 ? -1.0 : 1.0;
    struct wall out = stands(atan2(sign * (x - middle_m), sign * z), 0.0, 0.0);
    out.distance_m = out.normal[0] * x + out.normal[2] * z - radius_m;
    return out;
}

/* It turns by 1 / radius with each metre; half a metre of that is not known. */
static void a_wall_that_bends_a_little_is_less_certain(void **state)
{
    (void)state;
    const double radii_m[3] = {5.0, 20.0, -10.0};
    for (size_t k = 0; k < 3; k++) {
        struct hall *h = bumper(41 + k);
        struct wall w = stands(-0.3, 0.0, 2.0);
        struct wall near = touching(h, &w, radii_m[k]);
        struct wall_estimates found;
        h->noise_m = 0.001;
        hear_round(h, &w, radii_m[k]);
        find(h, &found);
        assert_int_equal(found.n, 1);
        assert_int_equal(found.n_bent, 0);
        assert_near(azimuth_of(&found.list[0].wall), azimuth_of(&near), 0.001);
        assert_near(found.list[0].wall.distance_m, near.distance_m, 0.001);
        assert_near(found.list[0].share, 1.0, 1e-12);
        assert_near(sqrt(found.list[0].wall.covariance[0]), 0.5 / fabs(radii_m[k]),
                    0.06 / fabs(radii_m[k]));
        free(h);
    }
}

/* By elements that are not where they should be: a turn that is said to be uncertain by
 * more than half a degree could not be. */
static void a_flat_wall_does_not_bend(void **state)
{
    (void)state;
    enum { SEEDS = 60 };
    size_t bent = 0;
    for (unsigned long long seed = 1; seed <= SEEDS; seed++) {
        struct hall *h = bumper(104729 * seed);
        struct wall_estimates found;
        h->noise_m = 0.0005;
        for (int i = 0; i < 8; i++) {
            h->speaker_error[i] = 0.002 * normal_random(&h->seed);
            h->microphone_error[i] = 0.002 * normal_random(&h->seed);
        }
        struct wall w = stands((reference_random(&h->seed) - 0.5) * 1.6, 0.0,
                               0.6 + 2.4 * reference_random(&h->seed));
        hear(h, &w, 1, 0);
        find(h, &found);
        assert_int_equal(found.n, 1);
        bent += sqrt(found.list[0].wall.covariance[0]) > 0.5 * degree;
        free(h);
    }
    print_message("%zu of %d flat walls told to bend\n", bent, SEEDS);
    assert_true(bent <= 2);
}

static void a_thing_is_not_taken_for_a_wall(void **state)
{
    (void)state;
    struct hall *h = bumper(9);
    const double thing[3] = {0.3, 0.0, 1.5};
    struct wall_estimates found;
    for (size_t s = 0; s < 8; s++)
        for (size_t m = 0; m < 8; m++, h->n_pairs++)
            add(h, s, m, way_over(h, s, m, thing));
    find(h, &found);
    assert_int_equal(found.n, 0);
    assert_int_equal(found.n_bent, 0);
    free(h);
}

/* To a line of microphones the ground is a wall as far away as it is below. */
static void the_ground_is_not_taken_for_a_wall_when_its_height_is_known(void **state)
{
    (void)state;
    struct hall *h = bumper(10);
    const struct wall ground = {.normal = {0.0, -1.0, 0.0}, .distance_m = 0.5};
    const struct wall walls[2] = {ground, stands(0.2, 0.0, 1.7)};
    struct wall_estimate_config cfg;
    struct wall_estimates found;
    hear(h, walls, 2, 1);
    wall_estimate_default(&cfg);
    cfg.has_ground = true;
    cfg.ground = ground;
    assert_int_equal(wall_estimate(&found, &cfg, h->echoes, h->n, h->n_pairs), 0);
    assert_int_equal(found.n, 1);
    assert_near(found.list[0].wall.distance_m, 1.7, 1e-6);
    free(h);
}

static void what_is_seen_in_a_wall_is_not_one(void **state)
{
    (void)state;
    struct hall *h = bumper(11);
    const struct wall walls[2] = {stands(0.1, 0.0, 3.0), stands(0.0, 0.0, 1.2)};
    struct wall_estimates found;
    hear(h, walls, 2, 0);
    find(h, &found);
    assert_int_equal(found.n, 1);
    assert_near(found.list[0].wall.distance_m, 1.2, 1e-6);
    assert_true(found.n_rejected >= 1);
    free(h);
}

static void without_a_prior_a_line_does_not_tell_and_an_area_does(void **state)
{
    (void)state;
    struct hall *line = bumper(12), *area = scan(12);
    struct wall w = stands(0.3, 8 * degree, 1.5);
    struct wall_estimate_config cfg;
    struct wall_estimates found;
    wall_estimate_default(&cfg);
    cfg.prior.vertical = false;
    line->noise_m = area->noise_m = 0.001;
    hear(line, &w, 1, 0);
    assert_int_equal(wall_estimate(&found, &cfg, line->echoes, line->n, line->n_pairs),
                     0);
    assert_int_equal(found.n, 0);
    assert_true(found.n_undetermined >= 1);
    hear(area, &w, 1, 1);
    assert_int_equal(wall_estimate(&found, &cfg, area->echoes, area->n, area->n_pairs),
                     0);
    assert_int_equal(found.n, 1);
    assert_near(found.list[0].wall.normal[1], sin(8 * degree), 0.01);
    assert_near(azimuth_of(&found.list[0].wall), 0.3, 0.01);
    free(line);
    free(area);
}

/* An upright line at one place hears nothing of where around it a wall stands. */
static void an_upright_line_does_not_tell_the_azimuth(void **state)
{
    (void)state;
    struct hall *h = scan(13);
    struct wall w = stands(0.3, 0.0, 1.5);
    struct wall_estimates found;
    h->n_speakers = h->n_microphones = 8;
    for (int k = 0; k < 8; k++)
        h->microphones[k][0] = 0.0;
    hear(h, &w, 1, 0);
    find(h, &found);
    assert_int_equal(found.n, 0);
    assert_true(found.n_undetermined >= 1);
    free(h);
}

/* Its error over 3 numbers by the covariance that is said, squared: 3 in the mean. */
static double nees_of(const struct wall *found, const struct wall *truth)
{
    const double *c = found->covariance;
    double e[3], l[3][3] = {{0.0}}, y[3], sum = 0.0;
    wall_difference(found, truth, e);
    const double full[3][3] = {
        {c[0], c[1], c[2]}, {c[1], c[3], c[4]}, {c[2], c[4], c[5]}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k <= i; k++) {
            double left = full[i][k];
            for (int q = 0; q < k; q++)
                left -= l[i][q] * l[k][q];
            l[i][k] = i == k ? sqrt(left) : left / l[k][k];
        }
    for (int i = 0; i < 3; i++) {
        y[i] = e[i];
        for (int q = 0; q < i; q++)
            y[i] -= l[i][q] * y[q];
        y[i] /= l[i][i];
        sum += y[i] * y[i];
    }
    return sum;
}

/* The mean over 30 seeds of what is chi squared with 3 degrees of freedom scatters by
 * 0.45; what is estimated of few residuals adds to it. */
static void check_consistency(struct hall *(*rig)(unsigned long long), double noise_m,
                              double element_m)
{
    enum { SEEDS = 30 };
    double sum = 0.0;
    size_t outside = 0;
    for (unsigned long long seed = 1; seed <= SEEDS; seed++) {
        struct hall *h = rig(7919 * seed);
        struct wall_estimates found;
        h->noise_m = noise_m;
        for (int i = 0; i < 8; i++) {
            h->speaker_error[i] = element_m * normal_random(&h->seed);
            h->microphone_error[i] = element_m * normal_random(&h->seed);
        }
        h->stretch = 1e-3 * normal_random(&h->seed);
        h->delay_m = 2e-3 * normal_random(&h->seed);
        struct wall w = stands((reference_random(&h->seed) - 0.5) * 1.6,
                               2.0 * degree * normal_random(&h->seed),
                               0.6 + 2.4 * reference_random(&h->seed));
        hear(h, &w, 1, 2);
        find(h, &found);
        assert_int_equal(found.n, 1);
        double nees = nees_of(&found.list[0].wall, &w);
        sum += nees / SEEDS;
        outside += nees > 16.3; /* 1 in 1000 */
        free(h);
    }
    print_message("mean normalized error squared %.2f, expected 3\n", sum);
    assert_near(sum, 3.0, 1.0);
    assert_true(outside <= 3);
}

static void errors_are_as_large_as_the_covariance_says(void **state)
{
    (void)state;
    check_consistency(bumper, 0.002, 0.0);
    check_consistency(scan, 0.002, 0.0);
}

static void misplaced_elements_are_in_the_covariance(void **state)
{
    (void)state;
    check_consistency(bumper, 0.0005, 0.002);
    check_consistency(scan, 0.0005, 0.002);
}

/* Pulses at known delays, band-limited as a Hann-windowed matched filter makes them. */
static void make_trace(const struct trace_format *f, const double *delays_s,
                       const double *amplitudes, size_t n, float complex *out)
{
    const double band_hz = 18e3;
    enum { LINES = 400 };
    for (size_t i = 0; i < f->n_samples; i++) {
        double complex sum = 0.0;
        for (size_t k = 0; k < n; k++)
            for (int q = 0; q < LINES; q++) {
                double part = (q + 0.5) / LINES - 0.5, df = band_hz * part;
                double t = f->t0_s + (double)i / f->rate_hz - delays_s[k];
                sum += amplitudes[k] * (1.0 + cos(2.0 * M_PI * part)) / LINES *
                       cexp(2.0 * M_PI * I * (df * t - f->carrier_hz * delays_s[k]));
            }
        out[i] = (float complex)sum;
    }
}

static void peaks_are_told_between_samples(void **state)
{
    (void)state;
    const struct trace_format f = {
        .t0_s = 2e-3, .rate_hz = 36e3, .carrier_hz = 11e3, .n_samples = 300};
    const double c = 343.0, limits[2] = {0.9, 3.4};
    float complex trace[300];
    for (int k = 0; k < 8; k++) {
        const double delays[3] = {4.1e-3 + k / 36e3 / 8.0, 6.2e-3, 2.4e-3};
        const double amplitudes[3] = {0.5, 0.2, 3.0}; /* the last is before the limits */
        struct wall_echo_peak peaks[4];
        make_trace(&f, delays, amplitudes, 3, trace);
        for (int i = 0; i < 300; i++)
            trace[i] += 1e-3f * (float)((i * 7919) % 13 - 6);
        assert_int_equal(wall_echo_peaks(&f, trace, c, limits, 15.0, 20.0, peaks, 4), 2);
        assert_near(peaks[0].path_m, c * delays[0], 2e-4);
        assert_near(peaks[1].path_m, c * delays[1], 3e-4);
        assert_near(peaks[0].amplitude, 0.5, 0.05);
        assert_int_equal(wall_echo_peaks(&f, trace, c, limits, 15.0, 20.0, peaks, 1), 1);
        assert_near(peaks[0].path_m, c * delays[0], 2e-4);
    }
}

/* A pulse of a Hann-shaped band, x = bandwidth times time: its Fourier transform. */
static double hann_pulse(double x)
{
    double sum = 0.0;
    for (int k = -1; k <= 1; k++) {
        double y = M_PI * (x - k);
        sum += (k ? 0.5 : 1.0) * (fabs(y) < 1e-9 ? 1.0 : sin(y) / y);
    }
    return sum;
}

/* The peaks of what one pair hears of paths [n]. */
static void hear_paths(struct hall *h, size_t s, size_t m, const double *paths_m,
                       const double *amplitudes, size_t n)
{
    enum { SAMPLES = 480, MOST_PEAKS = 8, SPREAD = 8 };
    const struct trace_format f = {
        .t0_s = 4e-3, .rate_hz = 36e3, .carrier_hz = 11e3, .n_samples = SAMPLES};
    const double c = 343.0, band_hz = 18e3, limits[2] = {1.4, 5.9};
    float complex trace[SAMPLES] = {0.0f};
    struct wall_echo_peak peaks[MOST_PEAKS];
    for (size_t k = 0; k < n; k++) {
        double delay_s = paths_m[k] / c;
        int at = (int)((delay_s - f.t0_s) * f.rate_hz);
        for (int i = at - SPREAD; i <= at + SPREAD; i++)
            if (i >= 0 && i < SAMPLES)
                trace[i] += (float complex)(
                    amplitudes[k] *
                    hann_pulse(band_hz * (f.t0_s + i / f.rate_hz - delay_s)) *
                    cexp(-2.0 * M_PI * I * f.carrier_hz * delay_s));
    }
    size_t found = wall_echo_peaks(&f, trace, c, limits, 15.0, 20.0, peaks, MOST_PEAKS);
    for (size_t k = 0; k < found; k++)
        add(h, s, m, peaks[k].path_m)->weight = peaks[k].amplitude / peaks[0].amplitude;
    h->n_pairs++;
}

/* Leaves over 4 m, some of them nearer by a hand's breadth than others: each pair hears
 * others of them first.  What stands behind them as a wall is found by the same means. */
static void a_hedge_is_no_mirror(void **state)
{
    (void)state;
    enum { LEAVES = 300 };
    static double leaves[LEAVES][3];
    double paths_m[LEAVES], amplitudes[LEAVES];
    for (unsigned long long seed = 1; seed <= 6; seed++) {
        struct hall *h = bumper(7 * seed), *bare = bumper(seed);
        struct wall_estimates found;
        for (size_t k = 0; k < LEAVES; k++) {
            leaves[k][0] = 4.0 * reference_random(&h->seed) - 2.0;
            leaves[k][1] = 1.5 * reference_random(&h->seed) - 0.5;
            leaves[k][2] = 1.5 + 0.1 * reference_random(&h->seed);
        }
        struct wall w = stands(0.1, 0.0, 1.5);
        for (size_t s = 0; s < h->n_speakers; s++)
            for (size_t m = 0; m < h->n_microphones; m++) {
                double image[3], mirrored_m, amplitude = 0.3;
                for (size_t k = 0; k < LEAVES; k++) {
                    paths_m[k] = way_over(h, s, m, leaves[k]);
                    amplitudes[k] = 1.0 / (apart(h->speakers[s], leaves[k]) *
                                           apart(h->microphones[m], leaves[k]));
                }
                hear_paths(h, s, m, paths_m, amplitudes, LEAVES);
                mirror(&w, bare->speakers[s], image);
                mirrored_m = apart(image, bare->microphones[m]);
                hear_paths(bare, s, m, &mirrored_m, &amplitude, 1);
            }
        find(h, &found);
        assert_int_equal(found.n, 0);
        assert_int_equal(found.n_bent, 0);
        find(bare, &found);
        assert_int_equal(found.n, 1);
        assert_near(azimuth_of(&found.list[0].wall), 0.1, 0.002);
        free(h);
        free(bare);
    }
}

static void silence_and_noise_have_no_peaks(void **state)
{
    (void)state;
    const struct trace_format f = {
        .t0_s = 0.0, .rate_hz = 36e3, .carrier_hz = 11e3, .n_samples = 800};
    const double limits[2] = {0.5, 7.0};
    float complex trace[800] = {0.0f};
    struct wall_echo_peak peaks[4];
    unsigned long long seed = 3;
    assert_int_equal(wall_echo_peaks(&f, trace, 343.0, limits, 15.0, 20.0, peaks, 4), 0);
    for (int i = 0; i < 800; i++)
        trace[i] = (float complex)(normal_random(&seed) + I * normal_random(&seed));
    assert_int_equal(wall_echo_peaks(&f, trace, 343.0, limits, 15.0, 20.0, peaks, 4), 0);
}

/* Of either sign, as arithmetic leaves it. */
static void what_is_no_number_is_no_peak(void **state)
{
    (void)state;
    const struct trace_format f = {
        .t0_s = 2e-3, .rate_hz = 36e3, .carrier_hz = 11e3, .n_samples = 300};
    const double limits[2] = {0.9, 3.4}, delay_s = 4.1e-3, amplitude = 0.5;
    float complex trace[300];
    struct wall_echo_peak peaks[4];
    make_trace(&f, &delay_s, &amplitude, 1, trace);
    for (int i = 0; i < 300; i++)
        trace[i] += 1e-3f * (float)((i * 7919) % 13 - 6);
    for (int i = 200; i < 220; i++)
        trace[i] = copysignf(NAN, i % 2 ? -1.0f : 1.0f);
    assert_int_equal(wall_echo_peaks(&f, trace, 343.0, limits, 15.0, 20.0, peaks, 4), 1);
    assert_near(peaks[0].path_m, 343.0 * delay_s, 3e-4);
}

/* A chirp from an array that drives at a wall, sampled as it is heard and matched against
 * its replica: the peak is where wall_echo_path_m has it.  Emission: at speaker x(t),
 * microphone the same; both at the middle of the emission in the echo. */
static void a_moving_array_hears_the_wall_nearer_or_farther(void **state)
{
    (void)state;
    const double c = 343.0, v = 2.0, d = 1.5, rate = 192e3, t_emit = 0.03;
    for (int down = 0; down < 2; down++) {
        const struct chirp chirp = {.start_hz = down ? 20e3 : 2e3,
                                    .stop_hz = down ? 2e3 : 20e3,
                                    .duration_s = t_emit};
        enum { SAMPLES = 8192, LAGS = 400 };
        static double complex heard[SAMPLES];
        double sweep = (chirp.stop_hz - chirp.start_hz) / t_emit;
        for (int i = 0; i < SAMPLES; i++) {
            /* left at u: the way there and back is c (t - u) = 2 (d - x) - v (t - u),
             * with x = v (u - T / 2) */
            double t = i / rate;
            double u = ((c + v) * t - 2.0 * (d + 0.5 * v * t_emit)) / (c + v - 2.0 * v);
            heard[i] = u < 0.0 || u > t_emit
                           ? 0.0
                           : (1.0 - cos(2.0 * M_PI * u / t_emit)) *
                                 cexp(2.0 * M_PI * I *
                                      (chirp.start_hz * u + 0.5 * sweep * u * u));
        }
        double best = 0.0, at_s = 0.0, power[LAGS];
        for (int k = 0; k < LAGS; k++) {
            double complex sum = 0.0;
            double lag_s = 7.5e-3 + k * 1e-5;
            for (int i = 0; i < SAMPLES; i++) {
                double u = i / rate - lag_s;
                if (u >= 0.0 && u <= t_emit)
                    sum += heard[i] * cexp(-2.0 * M_PI * I *
                                           (chirp.start_hz * u + 0.5 * sweep * u * u));
            }
            power[k] = cabs(sum);
            if (power[k] > best) {
                best = power[k];
                at_s = lag_s;
            }
        }
        const struct wall w = {.normal = {0, 0, 1}, .distance_m = d};
        const struct wall *one = &w;
        const struct wall_echo e = {.lag_s = wall_echo_lag_s(&chirp),
                                    .velocity_m_s = {0.0, 0.0, v},
                                    .microphone_m = {0.0, 0.0, v * at_s}};
        assert_near(wall_echo_path_m(&e, &one, 1), c * at_s, 0.01);
        assert_true(fabs(c * at_s - 2.0 * d) > 0.04);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_wall_without_noise_is_found_where_it_stands),
        cmocka_unit_test(outliers_do_not_move_it),
        cmocka_unit_test(noise_alone_makes_no_wall),
        cmocka_unit_test(two_walls_are_found_and_their_corner_is_none),
        cmocka_unit_test(a_corner_is_not_taken_for_a_wall),
        cmocka_unit_test(a_pillar_is_no_mirror_and_is_told),
        cmocka_unit_test(a_wall_that_bends_a_little_is_less_certain),
        cmocka_unit_test(a_flat_wall_does_not_bend),
        cmocka_unit_test(a_thing_is_not_taken_for_a_wall),
        cmocka_unit_test(the_ground_is_not_taken_for_a_wall_when_its_height_is_known),
        cmocka_unit_test(what_is_seen_in_a_wall_is_not_one),
        cmocka_unit_test(without_a_prior_a_line_does_not_tell_and_an_area_does),
        cmocka_unit_test(an_upright_line_does_not_tell_the_azimuth),
        cmocka_unit_test(errors_are_as_large_as_the_covariance_says),
        cmocka_unit_test(misplaced_elements_are_in_the_covariance),
        cmocka_unit_test(peaks_are_told_between_samples),
        cmocka_unit_test(a_hedge_is_no_mirror),
        cmocka_unit_test(silence_and_noise_have_no_peaks),
        cmocka_unit_test(what_is_no_number_is_no_peak),
        cmocka_unit_test(a_moving_array_hears_the_wall_nearer_or_farther),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
