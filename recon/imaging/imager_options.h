/* SPDX-License-Identifier: MIT */
/* recon/imaging/imager_options.h -- what some methods can be told, by name: the table
 * behind
 * `--set NAME=VALUE` and the `options` of a launch file. */
#ifndef ANLOS_RECON_IMAGING_IMAGER_OPTIONS_H
#define ANLOS_RECON_IMAGING_IMAGER_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>

struct psf;

struct imager_options {
    const char *base;  /* iterative: the method whose image it deconvolves, or "lct" */
    size_t iterations; /* iterative, sparse: at most */
    double tolerance;  /* iterative, sparse: relative residual that ends them */
    double l1, tv;     /* iterative, sparse: weights relative to the data's largest */
    bool tv_isotropic; /* iterative */
    double rho;        /* iterative: penalty to start with, relative */
    const struct psf *psf; /* iterative: as measured; NULL: from the geometry */
    double snr_db;         /* lct: of the Wiener filter */
    int dmo;               /* fast: dip moveout, 1 always, 0 never, -1 where it matters */
    double sharpen;        /* fast: recon/coherent/fk.h */
    bool taper;       /* fast: the same, of recon/planning/probe alone; not set by name */
    int lightcone;    /* paper: 1 always, 0 never, -1 unless it sees a mirror */
    double coherence; /* backprojection: exponent of the coherence factor; 0: off */

    unsigned given; /* bit i: number i of the table was set by name */
};

void imager_options_default(struct imager_options *o);

enum imager_option_kind {
    IMAGER_OPTION_REAL,
    IMAGER_OPTION_COUNT,
    IMAGER_OPTION_SWITCH, /* yes, no */
    IMAGER_OPTION_METHOD, /* a method's name, but not iterative's */
    IMAGER_OPTION_CHOICE, /* auto, always, never */
};

struct imager_option {
    const char *name;
    enum imager_option_kind kind;
    double min, max;     /* of numbers */
    size_t offset;       /* in struct imager_options */
    const char *methods; /* that use it, "iterative\0sparse\0", as imager_methods() */
    const char *help;    /* a line */
};

/* The table, ended by one without a name. */
extern const struct imager_option imager_option_table[];

/* Takes "NAME=VALUE".  0, or -EINVAL and in why[size] what was expected: a name that is
 * not there, a value that is none or out of range. */
int imager_option_set(struct imager_options *o, const char *text, char *why, size_t size);

/* What was given of the one, in place of what the other has. */
void imager_options_overlay(struct imager_options *o, const struct imager_options *given);

/* Does the method use what was given?  iterative uses also what its base does.
 * 0, or -EINVAL and in why[size] the option and whose it is. */
int imager_options_check(const struct imager_options *o, const char *method, char *why,
                         size_t size);

/* Does the method use it? */
bool imager_option_concerns(const struct imager_option *option,
                            const struct imager_options *o, const char *method);

/* Was it set by name? */
bool imager_option_is_given(const struct imager_options *o, const char *name);

/* What it takes ("0 to 1"), and its value in o, as words. */
void imager_option_range(const struct imager_option *option, char *text, size_t size);
void imager_option_value(const struct imager_option *option,
                         const struct imager_options *o, char *text, size_t size);

#endif
