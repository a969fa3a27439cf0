/* SPDX-License-Identifier: MIT */
#include "recon/static_array/range_doppler.h"

double range_doppler_instant_s(double start_hz, double stop_hz, double duration_s)
{
    return duration_s * stop_hz / (stop_hz - start_hz);
}
