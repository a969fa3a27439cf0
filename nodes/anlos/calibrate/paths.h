/* nodes/anlos/calibrate/paths.h -- sound on ways whose length is known: when it came by
 * each pair of speaker and microphone. */
#ifndef ANLOS_NODES_ANLOS_CALIBRATE_PATHS_H
#define ANLOS_NODES_ANLOS_CALIBRATE_PATHS_H

#include "dsp/arrival.h"
#include "dsp/time_zero.h"
#include "nodes/anlos/calibrate/sounding.h"

struct path {
    double distance_m;
    bool ignored; /* not to be heard */
    bool heard;
    struct arrival arrival; /* if heard */
};

/* [n_speakers][n_microphones], straight from speaker to microphone.  free() it; NULL: no
 * memory. */
struct path *paths_direct(const struct survey *s);

/* By way of a plane { p : normal . p = distance_m }, at a stage position. */
struct path *paths_reflected(const struct survey *s, size_t position,
                             const double normal[3], double distance_m);

/* The first arrival of each pair that stands out of its trace. */
int paths_hear_first(struct path *paths, struct sounding *s);

/* The strongest arrival within window_s around where it is expected.  0, -ENOMEM. */
int paths_hear_near(struct path *paths, struct sounding *s, double latency_s,
                    double speed_m_s, double window_s);

/* How far around: 6 pulses of the chirp's band, 0.25 ms at least. */
double paths_window_s(const struct survey *s);

/* out[n] of paths[n], for dsp/time_zero.h. */
void paths_pairs(const struct path *paths, size_t n, struct time_zero_pair *out);

/* Direct paths: heard anywhere first, then where the latency that fits most of them
 * says.  0, -ENODATA (none is heard), -ENOMEM. */
int paths_fit_latency(struct path *direct, struct sounding *s, double speed_m_s,
                      struct time_zero *out, struct complaint *why);

#endif
