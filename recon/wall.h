/* recon/wall.h -- the image shows mirrored objects; this puts them where they are. */
#ifndef ANLOS_RECON_WALL_H
#define ANLOS_RECON_WALL_H

struct wall { /* { p : normal . p = distance_m }, normal of length 1 */
    double normal[3];
    double distance_m;
};

/* The mirror image of p. */
void wall_mirror(const struct wall *w, const double p[3], double out[3]);

/* The covariance (xx xy xz yy yz zz) of a mirrored point. */
void wall_mirror_covariance(const struct wall *w, const double c[6], double out[6]);

#endif
