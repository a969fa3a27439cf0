#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/vector.h"
#include "recon/power/incoherent.h"

#define DEEPER    1.4    /* a slab ends where it is so many times as far as it begins */
#define FINENESS  0.0085 /* voxels over distance: a sixth of a point's width there */
#define WORTH     1.3    /* times the image's own steps; else those are used */
#define MAX_SLABS 64

/* The step that goes into the stage's, if it has one along x: for the fast way. */
static double divide_pitch(const struct geometry *g, double step_m)
{
    if (g->n_positions < 2 || fabs(g->stage_axis[0] - 1.0) > 1e-9)
        return step_m;
    double pitch_m =
        fabs(g->stage_positions_m[g->n_positions - 1] - g->stage_positions_m[0]) /
        (double)(g->n_positions - 1);
    return pitch_m > 0.0 ? pitch_m / ceil(pitch_m / step_m - 1e-6) : step_m;
}

/* One voxel around the image on either side, for the interpolation. */
static void coarsen(struct grid *g, int axis, double step_m)
{
    double across_m = g->step_m[axis] * (double)(g->n[axis] - 1);
    g->n[axis] = (size_t)ceil(across_m / step_m - 1e-6) + 3;
    g->origin_m[axis] -= step_m;
    g->step_m[axis] = step_m;
}

static void choose_grid(const struct geometry *g, const struct grid *image,
                        struct incoherent_slab *slab, double distance_m)
{
    struct grid *part = &slab->grid;
    struct grid own = *image;
    own.n[2] = slab->n_planes;
    own.origin_m[2] += image->step_m[2] * (double)slab->first_plane;
    *part = own;
    if (g->pings_m)
        return;
    for (int axis = 0; axis < 2; axis++) {
        double step_m = FINENESS * distance_m;
        if (axis == 0)
            step_m = divide_pitch(g, step_m);
        if (step_m > WORTH * image->step_m[axis] && image->n[axis] > 4)
            coarsen(part, axis, step_m);
    }
    if (part->n[0] == own.n[0] && part->n[1] == own.n[1])
        *part = own;
}

/* The slab that begins with this plane. */
static void choose_slab(const struct geometry *g, const struct grid *image, size_t plane,
                        bool last, struct incoherent_slab *slab)
{
    double low[3], high[3];
    geometry_aperture(g, low, high);
    double at_m = image->origin_m[2] + image->step_m[2] * (double)plane;
    double distance_m = fmax(at_m - 0.5 * (low[2] + high[2]), 0.1);
    double planes = ceil((DEEPER - 1.0) * distance_m / image->step_m[2]);
    size_t left = image->n[2] - plane;
    slab->first_plane = plane;
    slab->n_planes = planes < (double)left && !last ? (size_t)planes : left;
    choose_grid(g, image, slab, distance_m);
}

double incoherent_voxels(const struct geometry *g, const struct grid *image, bool *scan)
{
    double voxels = 0.0;
    size_t n = 0;
    *scan = g->n_positions >= VECTOR_LANES;
    for (size_t z = 0; z < image->n[2]; n++) {
        struct incoherent_slab slab;
        choose_slab(g, image, z, n + 1 == MAX_SLABS, &slab);
        voxels += (double)grid_size(&slab.grid);
        *scan = *scan && geometry_stage_stride(g, slab.grid.step_m[0]);
        z += slab.n_planes;
    }
    return voxels;
}

int incoherent_slabs_create(struct incoherent *b)
{
    size_t largest = 0;
    int err = 0;
    b->slabs = calloc(MAX_SLABS, sizeof *b->slabs);
    if (!b->slabs)
        return -ENOMEM;
    for (size_t z = 0; !err && z < b->grid.n[2]; b->n_slabs++) {
        struct incoherent_slab *slab = &b->slabs[b->n_slabs];
        choose_slab(&b->geometry, &b->grid, z, b->n_slabs + 1 == MAX_SLABS, slab);
        z += slab->n_planes;
        struct grid part = b->grid;
        part.n[2] = slab->n_planes;
        part.origin_m[2] = slab->grid.origin_m[2];
        if (slab->grid.n[0] == part.n[0] && slab->grid.n[1] == part.n[1])
            continue;
        err =
            resample_create(&slab->resample, &slab->grid, &part, RESAMPLE_CUBIC, b->pool);
        size_t size = grid_size(&slab->grid);
        largest = size > largest ? size : largest;
    }
    if (!err && largest && !(b->coarse = malloc(largest * sizeof *b->coarse)))
        err = -ENOMEM;
    return err;
}

void incoherent_slabs_destroy(struct incoherent *b)
{
    for (size_t i = 0; i < b->n_slabs; i++)
        resample_destroy(b->slabs[i].resample);
    free(b->slabs);
    free(b->coarse);
}
