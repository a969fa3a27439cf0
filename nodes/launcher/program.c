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
    const struct {
        const char *name, *value; /* NULL: it is not said */
    } options[] = {
        {"--launch", a->launch},
        {"--run-dir", cfg->run_dir},
        {"--log-level", log_level_name(a->log_level)},
        {"--log-format", a->log_format == LOG_FORMAT_JSON ? "json" : NULL},
        {"--out", a->out},
        {"--record", a->record},
        {"--snapshot", a->snapshot},
        {"--bag", a->bag},
        {"--rate", a->rate},
    };

    *v++ = p->path;
    for (size_t i = 0; i < sizeof options / sizeof *options; i++) {
        if (!options[i].value)
            continue;
        *v++ = (char *)options[i].name;
        *v++ = (char *)options[i].value;
    }
    if (a->realtime)
        *v++ = (char *)"--realtime";
    if (a->replay)
        *v++ = (char *)"--replay";
    *v = NULL;
    return 0;
}
