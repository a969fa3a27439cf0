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
