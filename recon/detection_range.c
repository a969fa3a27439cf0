#include "recon/detection_range.h"

#include <gsl/gsl_cdf.h>
#include <math.h>

double detection_range_stay(double speed_m_s, double ping_s, double voxel_m, size_t n)
{
    return fmin(1.0 + voxel_m / (speed_m_s * ping_s), (double)n);
}

double detection_range_snr(const struct detection_range *d)
{
    double k = (double)d->n_pings;

    double snr = gsl_cdf_gamma_Qinv(d->false_alarm_rate, k, 1.0) /
                     gsl_cdf_gamma_Qinv(d->probability, k, 1.0) -
                 1.0;

    return snr * k / d->stay;
}

double detection_range_m(const struct detection_range *d, double echo, double noise)
{
    double p2 = d->scattering_m * d->scattering_m;

    if (!(echo > 0.0))
        return 0.0;
    return pow(echo * p2 / (noise * detection_range_snr(d)), 0.25);
}
