/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/psf/file.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "hal/text_file.h"
#include "nodes/rt/export.h"

/* -- writing ----------------------------------------------------------------------------
 */

static json_t *axes_json(const struct psf *p)
{
    double width_m[3], axes[3][3];
    json_t *all = json_array();
    psf_axes(p, width_m, axes);
    for (int a = 0; a < 3; a++)
        json_array_append_new(all,
                              json_pack("{so, so}", "width_m", export_real(width_m[a]),
                                        "direction", export_reals(axes[a], 3)));
    return all;
}

int psf_file_write(const char *folder, const struct psf_file *p, struct error *why)
{
    double width_m[3];
    psf_widths(&p->psf, width_m);
    json_t *o = json_pack(
        "{ss, ss, so, so, so, so, so, so, sI}", "from",
        p->measured ? "recording" : "geometry", "method", p->method, "band_hz",
        export_reals(p->band_hz, 2), "centre_m", export_reals(p->psf.centre_m, 3),
        "covariance_m2", export_reals(p->psf.covariance_m2, 6), "width_m",
        export_reals(width_m, 3), "axes", axes_json(&p->psf), "residual",
        export_real(p->psf.residual), "voxels", (json_int_t)p->psf.n_voxels);
    int err = export_json(folder, "psf.json", o, why);
    json_decref(o);
    return err;
}

/* -- reading ----------------------------------------------------------------------------
 */

static int read_numbers(const json_t *o, const char *key, size_t n, double *out,
                        const char *path, struct error *why)
{
    const json_t *a = json_object_get(o, key);
    bool ok = json_is_array(a) && json_array_size(a) == n;
    for (size_t i = 0; ok && i < n; i++) {
        const json_t *v = json_array_get(a, i);
        ok = json_is_number(v);
        out[i] = json_number_value(v);
    }
    return ok ? 0
              : error_say(why, -EINVAL, "%s: %s: expected an array of %zu numbers", path,
                          key, n);
}

static int read_values(struct psf_file *out, const json_t *o, const char *path,
                       struct error *why)
{
    double precision[6];
    const char *method = json_string_value(json_object_get(o, "method"));
    int err = read_numbers(o, "centre_m", 3, out->psf.centre_m, path, why);
    if (!err)
        err = read_numbers(o, "covariance_m2", 6, out->psf.covariance_m2, path, why);
    if (!err)
        err = read_numbers(o, "band_hz", 2, out->band_hz, path, why);
    if (err)
        return err;
    if (!psf_invert(out->psf.covariance_m2, precision))
        return error_say(why, -EINVAL,
                         "%s: covariance_m2: expected xx xy xz yy yz zz of a positive "
                         "definite matrix",
                         path);
    if (!method || strlen(method) >= sizeof out->method)
        return error_say(why, -EINVAL, "%s: method: expected a method's name", path);
    strcpy(out->method, method);
    const char *from = json_string_value(json_object_get(o, "from"));
    out->measured = from && !strcmp(from, "recording");
    return 0;
}

int psf_file_load(struct psf_file *out, const char *path, struct error *why)
{
    json_error_t error;
    memset(out, 0, sizeof *out);
    FILE *f;
    int err = text_file_open(&f, path, why);
    if (err)
        return err;
    json_t *o = json_loadf(f, 0, &error);
    fclose(f);
    if (!o)
        return error_say(why, -EINVAL,
                         "%s:%d: %s; expected psf.json as anlos psf wrote it", path,
                         error.line, error.text);
    err = read_values(out, o, path, why);
    json_decref(o);
    return err;
}
