#include "nodes/rt/volume_grid.h"

#include <math.h>

#include "msgs/tensor.h"

/* Beyond these it is no image of sound, and what draws axes would never come to an end.
 */
#define FARTHEST_M 1e4
#define FINEST_M   1e-6

static int read_vec3(const Anlos__Vec3 *v, double out[3])
{
    if (!v || !isfinite(v->x) || !isfinite(v->y) || !isfinite(v->z))
        return -1;
    out[0] = v->x;
    out[1] = v->y;
    out[2] = v->z;
    return 0;
}

const float *volume_grid(const Anlos__Volume *v, struct grid *out)
{
    size_t extents[3];
    const float *x = v->intensity ? tensor_f32(v->intensity, 3, extents) : NULL;

    if (!x || read_vec3(v->origin_m, out->origin_m) || read_vec3(v->step_m, out->step_m))
        return NULL;
    for (int i = 0; i < 3; i++) {
        out->n[i] = extents[2 - i];
        if (!(fabs(out->origin_m[i]) <= FARTHEST_M && out->step_m[i] >= FINEST_M &&
              (double)out->n[i] * out->step_m[i] <= FARTHEST_M))
            return NULL;
    }
    return x;
}
