/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export.h"

#include <errno.h>
#include <stdio.h>

#include "hal/decimal.h"
#include "nodes/rt/export_file.h"

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ && sizeof(float) == 4,
               "the voxels are written as they lie in memory");

int export_nrrd(const char *folder, const char *name, const struct grid *grid,
                const float *intensity, struct error *why)
{
    struct export_file e;
    char step[3][DECIMAL_SIZE], origin[3][DECIMAL_SIZE];
    int err = export_file_open(&e, folder, name, why);
    if (err)
        return err;

    for (int a = 0; a < 3; a++) {
        decimal_print(grid->step_m[a], step[a]);
        decimal_print(grid->origin_m[a], origin[a]);
    }
    errno = 0;
    int written = fprintf(e.f,
                          "NRRD0005\n"
                          "# anlos " ANLOS_VERSION
                          ": intensity of the hidden scene as mirrored at the wall\n"
                          "# x along the stage, y up along the array, z forward, in m\n"
                          "content: intensity\n"
                          "type: float\n"
                          "dimension: 3\n"
                          "space dimension: 3\n"
                          "sizes: %zu %zu %zu\n"
                          "space directions: (%s,0,0) (0,%s,0) (0,0,%s)\n"
                          "kinds: domain domain domain\n"
                          "labels: \"x\" \"y\" \"z\"\n"
                          "endian: little\n"
                          "encoding: raw\n"
                          "space units: \"m\" \"m\" \"m\"\n"
                          "space origin: (%s,%s,%s)\n\n",
                          grid->n[0], grid->n[1], grid->n[2], step[0], step[1], step[2],
                          origin[0], origin[1], origin[2]);
    if (written < 0 ||
        fwrite(intensity, sizeof *intensity, grid_size(grid), e.f) != grid_size(grid))
        return export_file_abandon(&e, errno ? -errno : -EIO, why);
    return export_file_commit(&e, why);
}
