/* SPDX-License-Identifier: MIT */
#include "recon/imaging/coarse.h"

#include <math.h>

#define TOP     0.45 /* of the band's top */
#define STEP    0.5  /* of a point's width in that band */
#define COARSER 4.0  /* times the steps of an axis without aperture */

void coarse_view(const struct imager_config *wanted, struct imager_config *look)
{
    const struct grid *fine = &wanted->grid;
    double low_hz = wanted->band_hz[0], high_hz = wanted->band_hz[1], width_m[3];

    *look = *wanted;
    look->method = "fast";
    look->options = NULL;
    look->band_hz[1] = fmin(fmax(TOP * high_hz, 2.0 * low_hz), high_hz);
    geometry_resolution(wanted->geometry, look->band_hz,
                        0.5 * (wanted->gate_m[0] + wanted->gate_m[1]), width_m);
    for (int a = 0; a < 3; a++) {
        double extent_m = fine->step_m[a] * (double)(fine->n[a] - 1);
        double wide_m = isfinite(width_m[a]) ? STEP * width_m[a]
                                             : COARSER * fine->step_m[a];
        double step_m = fmax(fine->step_m[a], fmin(wide_m, extent_m));
        double steps = ceil(extent_m / step_m - 1e-6);
        look->grid.n[a] = (size_t)steps + 1;
        if (steps > 0.0)
            look->grid.step_m[a] = extent_m / steps;
    }
}

int coarse_create(struct imager **out, const struct imager_config *look)
{
    struct imager_config cfg = *look;
    struct imager_options plain;
    const char *why;

    imager_options_default(&plain);
    plain.dmo = 0;
    plain.taper = true;
    cfg.options = &plain;
    return imager_create(out, &cfg, &why);
}
