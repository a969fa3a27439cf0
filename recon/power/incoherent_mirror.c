#include "recon/power/incoherent_mirror.h"

#include <errno.h>
#include <stdlib.h>

#include "recon/coherent/colocated.h"
#include "recon/planning/scattering.h"

struct incoherent_mirror {
    struct colocated *colocated; /* tells mirrors */
    struct scattering_config scattering;
    float *power, *scratch;
    struct imager *stack; /* images them */
};

static int plan_scattering(struct incoherent_mirror *m)
{
    struct colocated_lattice l;
    colocated_lattice(m->colocated, &l);
    m->scattering = (struct scattering_config){
        l.nx, l.ny, l.pitch_x_m, l.pitch_y_m, l.n_ranges, l.range_m, l.range_step_m};
    m->power = malloc(l.nx * l.ny * l.n_ranges * sizeof *m->power);
    m->scratch = malloc(2 * l.nx * l.ny * sizeof *m->scratch);
    return m->power && m->scratch ? 0 : -ENOMEM;
}

int incoherent_mirror_create(struct incoherent_mirror **out,
                             const struct imager_config *cfg)
{
    struct imager_options options;
    struct imager_config stack = *cfg;
    const char *why;
    struct incoherent_mirror *m = calloc(1, sizeof *m);
    *out = NULL;
    if (!m)
        return -ENOMEM;
    imager_options_default(&options);
    options.lightcone = 0;
    stack.method = "paper";
    stack.options = &options;
    int err = imager_create(&m->stack, &stack, &why);
    if (!err)
        err = colocated_create(&m->colocated, cfg, &why);
    if (!err)
        err = plan_scattering(m);
    if (err) {
        incoherent_mirror_destroy(m);
        return err == -ENOTSUP ? 0 : err;
    }
    *out = m;
    return 0;
}

void incoherent_mirror_add(struct incoherent_mirror *m, size_t position, size_t speaker,
                           const float complex *traces, const bool *masked)
{
    colocated_add(m->colocated, position, speaker, traces, masked);
    imager_add(m->stack, position, speaker, traces, masked);
}

bool incoherent_mirror_image(struct incoherent_mirror *m, float *intensity)
{
    struct scattering s;
    colocated_power(m->colocated, m->power);
    scattering_measure(&m->scattering, m->power, m->scratch, &s);
    if (!scattering_is_specular(&s))
        return false;
    imager_image(m->stack, intensity);
    return true;
}

void incoherent_mirror_reset(struct incoherent_mirror *m)
{
    colocated_reset(m->colocated);
    imager_reset(m->stack);
}

void incoherent_mirror_destroy(struct incoherent_mirror *m)
{
    if (!m)
        return;
    colocated_destroy(m->colocated);
    imager_destroy(m->stack);
    free(m->power);
    free(m->scratch);
    free(m);
}
