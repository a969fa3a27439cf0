/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/program.h"

#include <errno.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int program_own_folder(char *out, size_t size)
{
    char path[4096];
    ssize_t n = readlink("/proc/self/exe", path, sizeof path - 1);

    if (n < 0)
        return -errno;
    path[n] = '\0';
    return snprintf(out, size, "%s", dirname(path)) < (int)size ? 0 : -ENAMETOOLONG;
}

int program_folder(char *out, size_t size)
{
    const char *given = getenv("ANLOS_BIN_DIR");
    char node[4096 + 32];
    int err = program_own_folder(out, size);

    if (given)
        return snprintf(out, size, "%s", given) < (int)size ? 0 : -ENAMETOOLONG;
    if (err)
        return err;
    snprintf(node, sizeof node, "%s/anlos-array", out);
    if (!access(node, F_OK))
        return 0;
    size_t used = strlen(out), left = size - used;
    return snprintf(out + used, left, "/" ANLOS_NODES_FROM_BIN) < (int)left
               ? 0
               : -ENAMETOOLONG;
}

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
    if (a->log_format == LOG_FORMAT_JSON) {
        *v++ = (char *)"--log-format";
        *v++ = (char *)"json";
    }
    if (a->out) {
        *v++ = (char *)"--out";
        *v++ = (char *)a->out;
    }
    if (a->record) {
        *v++ = (char *)"--record";
        *v++ = (char *)a->record;
    }
    if (a->snapshot) {
        *v++ = (char *)"--snapshot";
        *v++ = (char *)a->snapshot;
    }
    if (a->bag) {
        *v++ = (char *)"--bag";
        *v++ = (char *)a->bag;
    }
    if (a->rate) {
        *v++ = (char *)"--rate";
        *v++ = (char *)a->rate;
    }
    if (a->realtime)
        *v++ = (char *)"--realtime";
    if (a->replay)
        *v++ = (char *)"--replay";
    *v = NULL;
    return 0;
}
