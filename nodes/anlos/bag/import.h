/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/import.h -- what `anlos bag import` makes bags of. */
#ifndef ANLOS_NODES_ANLOS_BAG_IMPORT_H
#define ANLOS_NODES_ANLOS_BAG_IMPORT_H

#include "msgs/array.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "nodes/anlos/bag/bag.h"
#include "recon/survey.h"

/* A bag of messages of the array node that never went over a bus.  Its times begin a
 * second after 1970: who recorded the sound did not say when, and equal recordings
 * become equal bags. */

#define IMPORT_START_NS 1000000000LL

struct import_bag;

/* 0, -EEXIST, as verb_writer_create. */
int import_bag_begin(struct import_bag **out, const char *path,
                     enum bag_compression compression, struct error *why);

/* What pings name; a text that is kept with them may be NULL.  To be said first.  0,
 * -EINVAL (does not pass survey_check), -ENOMEM, errors of writing. */
int import_bag_survey(struct import_bag *b, const struct survey *s, const char *yaml,
                      size_t yaml_size, struct error *why);

/* A ping that begins then and lasts slot_ns; the survey is repeated before it each
 * second. Its survey_id is filled in.  0, -EMSGSIZE, -ENOMEM, errors of writing. */
int import_bag_ping(struct import_bag *b, Anlos__Ping *p, int64_t capture_ns,
                    int64_t length_ns, struct error *why);

/* How the vehicle moved; in the order of time with the pings, by when they end.  As
 * import_bag_ping. */
int import_bag_ego(struct import_bag *b, const Anlos__EgoMotion *m, int64_t capture_ns,
                   struct error *why);

/* Text to text under a name. */
int import_bag_metadata(struct import_bag *b, const char *name,
                        const char *const (*pairs)[2], size_t n, struct error *why);

/* err 0: the file gets its name; else it is removed.  Frees b. */
int import_bag_end(struct import_bag *b, int err, struct error *why);

struct import_options { /* borrow from argv */
    const char *from, *out;
    const char *survey, *background, *ego; /* of a recording; NULL: beside it, or none */
    enum bag_compression compression;
};

/* A recording folder: survey and pings, as the array node publishes them; of an array
 * that stands all of them, and how the vehicle moved (ego.csv).  0, -EINTR
 * (Ctrl-C), errors of array_open and of import_bag_ping. */
int import_recording(struct import_bag *bag, const struct import_options *o,
                     struct error *why);

/* An optical confocal scan (nodes/anlos/confocal/file.h) as if it had been made with
 * sound: each place of the scan has sent a pulse that fills the band in which the scan
 * stands out of the noise, and hears the root of the counts answer it (waves of light,
 * Lindell 2019).  Ranges stay, and times are those of sound of 343 m/s.  Errors of
 * confocal_file_load and of import_bag_ping. */
int import_mat(struct import_bag *bag, const struct import_options *o, struct error *why);

#endif
