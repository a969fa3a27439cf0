/* SPDX-License-Identifier: MIT */
/* nodes/anlos/recon/options.h -- the arguments of `anlos recon`, of which other commands
 * that image a recording take some. */
#ifndef ANLOS_NODES_ANLOS_RECON_OPTIONS_H
#define ANLOS_NODES_ANLOS_RECON_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>

#include "recon/frontend/compressor.h"
#include "recon/imaging/imager_options.h"

struct recon_options {                           /* borrow from argv */
    const char *survey, *wav, *background, *out; /* background: NULL for none */
    const char *method;                          /* NULL: what suits the recording */
    const char *traces;                          /* in place of wav, or NULL */
    const char *confocal;                        /* optical scan, or NULL */
    const char *bag;                             /* recorded scan, or NULL */
    const char *launch; /* settings in place of those in the bag, or NULL */
    bool records;       /* the lists of a bag as a bag again */
    bool no_image;      /* of a bag: neither volume nor projections are written */
    bool has_gate;      /* of the optical scan */
    double gate_m[2];
    bool has_band; /* of the traces */
    double band_hz[2];
    bool has_volume; /* in place of the survey's */
    double volume_m[3][3];
    size_t threads;
    bool has_window, has_compression;
    enum window window;
    enum compression compression;
    struct imager_options *imaging; /* not owned; NULL: the defaults */
    const char *psf;                /* a file for iterative, or NULL */
    double budget_s, error_m;       /* of auto; 0: not given */
};

#define RECON_MAX_THREADS 256

enum recon_option { /* codes of what is more than kept */
                    RECON_OPTION_VOLUME = 1,
                    RECON_OPTION_GATE,
                    RECON_OPTION_BAND,
                    RECON_OPTION_METHOD,
                    RECON_OPTION_SET,
                    RECON_OPTION_WINDOW,
                    RECON_OPTION_COMPRESSION,
                    RECON_OPTION_OTHER, /* from here on a command's own */
};

/* What these may be (nodes/rt/choice.h): any method, those of a recording of sound, and
 * how it is compressed. */
const char *recon_method_name(size_t i);
const char *recon_sound_method_name(size_t i);
const char *recon_window_name(size_t i);
const char *recon_compression_name(size_t i);

/* Everything left out; the defaults of methods go into *imaging. */
void recon_options_default(struct recon_options *o, struct imager_options *imaging);

/* Takes optarg as the value of one of the codes.  0, or EXIT_BAD_INPUT after printing
 * what is wrong with it. */
int recon_options_take(struct recon_options *o, const char *command, int code);

/* All of `anlos recon`.  true: go on; false: end with *exit_code (help was asked for, or
 * something is wrong and was printed). */
bool recon_options_parse(struct recon_options *o, int argc, char **argv, int *exit_code);

/* After all have been taken: those of a recording of sound that do not go together, or
 * are missing.  0, or EXIT_BAD_INPUT after printing. */
int recon_options_check(const struct recon_options *o, const char *command);

#endif
