#include "nodes/anlos/recon/method.h"

#include <errno.h>
#include <string.h>

#include "nodes/anlos/recon/auto.h"

/* Nobody asked for one. */
static void choose_method(struct recon_job *job)
{
    if (job->survey.pings_m) {
        job->method = "backprojection";
        job->method_because = "each ping has places of its own";
    } else {
        job->method = "fast";
        job->method_because = "the default";
    }
}

int recon_method_plan(struct recon_job *job, struct error *why)
{
    const struct recon_options *o = job->options;
    char reason[256];
    job->method = o->method;
    if (!job->method)
        choose_method(job);
    if (o->imaging)
        job->imaging = *o->imaging;
    else
        imager_options_default(&job->imaging);
    if (!strcmp(job->method, recon_auto_name))
        job->method = recon_auto_name;
    else if (imager_options_check(&job->imaging, job->method, reason, sizeof reason))
        return error_say(why, -EINVAL, "--set %s", reason);
    if (o->psf) {
        int err = psf_file_load(&job->psf, o->psf, why);
        if (err)
            return err;
        job->imaging.psf = &job->psf.psf;
    }
    job->processing.imaging = &job->imaging;
    return 0;
}
