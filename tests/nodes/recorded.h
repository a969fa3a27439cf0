/* SPDX-License-Identifier: MIT */
/* tests/nodes/recorded.h -- the small simulated scene point.yaml beside it as a
 * recording: a folder with survey.yaml, scene/ and background/, and room for results. */
#ifndef ANLOS_TESTS_NODES_RECORDED_H
#define ANLOS_TESTS_NODES_RECORDED_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "tests/nodes/command.h"

struct recorded {
    char folder[64];
    char survey[128], scene[128], background[128], out[128];
};

static inline int recorded_create(void **state)
{
    struct recorded *f = calloc(1, sizeof *f);
    struct command_result r;
    if (!f)
        return -1;
    strcpy(f->folder, "/tmp/anlos-recorded-XXXXXX");
    if (!mkdtemp(f->folder))
        return -1;
    setenv("XDG_CACHE_HOME", f->folder, 1);
    snprintf(f->survey, sizeof f->survey, "%s/r/survey.yaml", f->folder);
    snprintf(f->scene, sizeof f->scene, "%s/r/scene", f->folder);
    snprintf(f->background, sizeof f->background, "%s/r/background", f->folder);
    snprintf(f->out, sizeof f->out, "%s/r", f->folder);
    char *words[] = {"sim", SOURCE_DIR "/tests/nodes/point.yaml", "--out", f->out, NULL};
    command_run(&r, command_sim, words);
    snprintf(f->out, sizeof f->out, "%s/out", f->folder);
    *state = f;
    return r.code;
}

static inline int recorded_remove(const char *path)
{
    char command[256];
    snprintf(command, sizeof command, "rm -rf '%s'", path);
    return system(command);
}

/* After each test. */
static inline int recorded_forget_results(void **state)
{
    const struct recorded *f = *state;
    return recorded_remove(f->out);
}

static inline int recorded_destroy(void **state)
{
    struct recorded *f = *state;
    int err = recorded_remove(f->folder);
    free(f);
    return err;
}

#endif
