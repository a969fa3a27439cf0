/* SPDX-License-Identifier: MIT */
/* recon/static_array/velocity_filter.h -- what moves by itself, of all that stands out of
 * an image of several pings, and how?
 *
 * An image by power adds up pings whatever their phases are, because what walks is
 * elsewhere at each of them.  Along the course that it has taken they add up in phase,
 * and along no other: a tenth of a metre a second more or less towards the array turns
 * the phase of 9 kHz by half in 0.2 s.  So a place is looked at along all courses that a
 * body may take, and beside these along those of what stands: over the plane of the
 * image, or behind it (a line of elements hears no elevation: from a vehicle that moves
 * such a thing seems to go its way, up to twice as fast), and as a plane that mirrors
 * each speaker (whose bright spot goes with the speakers that sound in turn).  What is
 * brighter along a course than any of these moves by itself, and is known to after one
 * image: no background is asked for.  What goes as these do is ambiguous: its places have
 * to tell.  What stays where it is is not told, nor what is slower than 0.5 m/s or faster
 * than 2.4 along the sight or across it; what is 3 dB fainter than something as far away
 * to 8 cm, or 11 dB fainter than something whose lobes may lie there, is taken for its
 * lobe; of what is 27 dB brighter a lobe may be told all the same.  (Matched filtering
 * along hypothesised courses: Reed, Gagliardi and Stotts 1983, "Optical moving target
 * detection with 3-D matched filtering", IEEE Trans. AES-24.) */
#ifndef ANLOS_RECON_STATIC_ARRAY_VELOCITY_FILTER_H
#define ANLOS_RECON_STATIC_ARRAY_VELOCITY_FILTER_H

#include "recon/static_array/frames.h"
#include "recon/volume.h"

struct velocity_filter_config {
    struct grid grid;   /* of the images */
    size_t n_pings;     /* of an image at most */
    double turns_per_m; /* of the traces' carrier, in a metre of path */
    double sound_speed_m_s;
};

struct velocity_filter;

struct velocities {
    struct volume_mover movers[VOLUME_MOVERS], ambiguous[VOLUME_MOVERS];
    struct volume_course courses[VOLUME_MOVERS];
    size_t n_movers, n_ambiguous, n_courses;
};

/* 0, -ENOTSUP (images that are no plan view), -ENOMEM. */
int velocity_filter_create(struct velocity_filter **out,
                           const struct velocity_filter_config *cfg);

/* What goes along a course in the newest image of f, by where it is.  Some tenths of a
 * millisecond for each place that stands out.
 *
 * Where what stands was `taken` away all that stands out has moved, and may drive: of the
 * four brightest places in the newest 0.11 s, courses of up to 6 m/s, and how sure each
 * is, in place of movers.  Where chirps of 20 ms run up and down in turn, up to 2 m/s:
 * motion smears these over depth in opposite ways. */
void velocity_filter_find(struct velocity_filter *v, struct frames *f,
                          const float *intensity, bool taken, struct velocities *out);
void velocity_filter_destroy(struct velocity_filter *v);

#endif
