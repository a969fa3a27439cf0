/* SPDX-License-Identifier: MIT */
#include "tests/recon/reference.h"

#include <math.h>

/* Of the integral over frequency: unambiguous over 0.38 m of depth. */
#define BAND_STEPS 40

double reference_distance(const double a[3], const double b[3])
{
    return sqrt(pow(a[0] - b[0], 2.0) + pow(a[1] - b[1], 2.0) + pow(a[2] - b[2], 2.0));
}

double reference_pulse(const double band_hz[2], double t_s)
{
    double u = fabs((band_hz[1] - band_hz[0]) * t_s);
    if (u < 1e-6)
        return 1.0;
    if (fabs(u - 1.0) < 1e-6)
        return 0.5;
    return sin(M_PI * u) / (M_PI * u) / (1.0 - u * u);
}

double complex reference_echo(const double band_hz[2], double carrier_hz, double delay_s,
                              double t_s)
{
    double middle_hz = 0.5 * (band_hz[0] + band_hz[1]);
    double turns = middle_hz * (t_s - delay_s) - carrier_hz * t_s;
    return reference_pulse(band_hz, t_s - delay_s) * cexp(2.0 * M_PI * I * turns);
}

void reference_trace(const struct trace_format *f, const double band_hz[2],
                     double sound_speed_m_s, const double speaker[3],
                     const double microphone[3], const struct scatterer *points,
                     size_t n_points, float complex *out)
{
    for (size_t n = 0; n < f->n_samples; n++) {
        double t = f->t0_s + (double)n / f->rate_hz;
        double complex sum = 0.0;
        for (size_t p = 0; p < n_points; p++) {
            double r_s = reference_distance(speaker, points[p].at_m);
            double r_m = reference_distance(microphone, points[p].at_m);
            double delay_s = (r_s + r_m) / sound_speed_m_s;
            sum += points[p].gain / (r_s * r_m) *
                   reference_echo(band_hz, f->carrier_hz, delay_s, t);
        }
        out[n] = (float complex)sum;
    }
}

/* The integral over the band, Hann-weighted, of k^power (i / r + k) exp(i k (r - r_s)).
 */
static double complex band_integral(const double band_hz[2], double c, double power,
                                    double r, double r_s)
{
    double complex sum = 0.0;
    for (int q = 1; q < BAND_STEPS; q++) {
        double x = (double)q / BAND_STEPS;
        double k = 4.0 * M_PI / c * (band_hz[0] + x * (band_hz[1] - band_hz[0]));
        sum += (0.5 - 0.5 * cos(2.0 * M_PI * x)) * pow(k, power) * (I / r + k) *
               cexp(I * k * (r - r_s));
    }
    return sum;
}

double complex reference_migrated(const double band_hz[2], double sound_speed_m_s,
                                  const double *x_m, size_t nx, const double *y_m,
                                  size_t ny, double plane_z_m, double gain_power,
                                  const struct scatterer *points, size_t n_points,
                                  const double voxel[3])
{
    double complex sum = 0.0;
    for (size_t q = 0; q < nx * ny; q++) {
        const double midpoint[3] = {x_m[q / ny], y_m[q % ny], plane_z_m};
        double r = reference_distance(midpoint, voxel), depth_m = voxel[2] - plane_z_m;
        double obliquity = pow(depth_m / r, gain_power) / r;
        for (size_t p = 0; p < n_points; p++) {
            double r_s = reference_distance(midpoint, points[p].at_m);
            sum += obliquity * points[p].gain / r_s *
                   band_integral(band_hz, sound_speed_m_s, gain_power, r, r_s);
        }
    }
    return sum;
}

double reference_random(unsigned long long *state)
{
    unsigned long long z = *state += 0x9e3779b97f4a7c15ull;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    z ^= z >> 31;
    return ((double)(z >> 11) + 0.5) / 9007199254740992.0;
}
