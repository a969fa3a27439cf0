/* SPDX-License-Identifier: MIT */
/* nodes/anlos/psf/file.h -- psf.json: a point spread function as `anlos psf` measured or
 * computed it, for `--method iterative --psf FILE`. */
#ifndef ANLOS_NODES_ANLOS_PSF_FILE_H
#define ANLOS_NODES_ANLOS_PSF_FILE_H

#include "dsp/error.h"
#include "recon/inverse/psf.h"

struct psf_file {
    struct psf psf;
    char method[32]; /* of the image of the point */
    double band_hz[2];
    bool measured; /* from a recording; else from the geometry */
};

/* psf.json, also with widths and axes for who reads it.  0, or as export_json. */
int psf_file_write(const char *folder, const struct psf_file *p, struct error *why);

/* Reads centre, covariance, band and method; the rest may be missing.  0, -EINVAL (JSON
 * or its values: the error names the file and the key), -ENOENT and other errno. */
int psf_file_load(struct psf_file *out, const char *path, struct error *why);

#endif
