#include "nodes/launcher/program.h"

#include <errno.h>
#include <stdio.h>

int program_fill(struct program *p, const struct launcher_config *cfg, const char *node)
{
    const struct arguments *a = cfg->arguments;
    char **v = p->argv;
    int n = snprintf(p->path, sizeof p->path, "%s/anlos-%s", cfg->bin_dir, node);

    if (n < 0 || (size_t)n >= sizeof p->path)
        return -ENAMETOOLONG;
    *v++ = p->path;
    *v++ = (char *)"--launch";
    *v++ = (char *)a->launch;
    *v++ = (char *)"--run-dir";
    *v++ = (char *)cfg->run_dir;
    *v++ = (char *)"--log-level";
    *v++ = (char *)log_level_name(a->log_level);
    if (a->out) {
        *v++ = (char *)"--out";
        *v++ = (char *)a->out;
    }
    if (a->realtime)
        *v++ = (char *)"--realtime";
    *v = NULL;
    return 0;
}
