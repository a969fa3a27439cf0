/* SPDX-License-Identifier: MIT */
/* recon/frontend/air.h -- what the air has done between the two passes of a scan, as
 * dsp/drift.h has found it ping by ping, in words. */
#ifndef ANLOS_RECON_FRONTEND_AIR_H
#define ANLOS_RECON_FRONTEND_AIR_H

#include <stdbool.h>
#include <stddef.h>

struct air {
    double sound_speed_m_s;  /* the survey's */
    size_t expected;         /* pings of a scan */
    size_t pings, corrected; /* with a background; whose background was stretched */
    double sum, largest;     /* of the stretches; the largest with its sign */
};

/* At 0.4%, 2.3 K, some -40 dB of the background are left, because its pulses are
 * stretched too (dsp/timescale.h), and DRIFT_MAX_STRETCH is near. */
#define AIR_DISTRUST 0.004

void air_start(struct air *a, double sound_speed_m_s, size_t expected);
void air_add(struct air *a, double stretch, bool corrected);

/* What another thread has added. */
void air_join(struct air *a, const struct air *other);

/* The change of temperature in K that a stretch would be: the speed of sound goes with
 * the root of the absolute temperature, so dT = -2 T stretch. */
double air_kelvin(const struct air *a, double stretch);

/* The background does not fit any more. */
bool air_is_distrusted(const struct air *a);

/* "air -0.6 K (0.10%) since the background, at most -0.7 K (0.11%)"; empty: no ping was
 * corrected by 0.05 K. */
void air_text(const struct air *a, char *out, size_t size);

#endif
