/* SPDX-License-Identifier: MIT */
/* tests/e2e/record_launch.h -- a whole system that records itself. */
#ifndef ANLOS_TESTS_E2E_RECORD_LAUNCH_H
#define ANLOS_TESTS_E2E_RECORD_LAUNCH_H

#include "tests/nodes/record_rig.h"

#include <sys/wait.h>
#include <unistd.h>

#define SCENE SOURCE_DIR "/launch/scenes/point.yaml"

static inline void write_launch(struct scratch *s)
{
    char text[1024];

    snprintf(text, sizeof text,
             "nodes: [stage, array, scan, dsp, recon, track, can, report]\n"
             "array: {uri: 'sim:" SCENE "'}\n"
             "stage: {uri: 'sim:?pace=fast'}\n"
             "scan: {background: true}\n"
             "report: {folder: %s/out}\n"
             "record: {flush_ms: 10}\n",
             s->folder);
    scratch_write(s, "launch.yaml", text);
}

/* `anlos launch --record BAG`, to its end; the exit code.  Writes what it said. */
static inline int launch(struct scratch *s, const char *bag)
{
    char file[128], says[128];
    int status;
    pid_t pid = fork();

    if (pid < 0)
        return -1;
    if (!pid) {
        snprintf(file, sizeof file, "%s/launch.yaml", s->folder);
        snprintf(says, sizeof says, "%s/says", s->folder);
        if (!freopen(says, "w", stdout) || dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
            _exit(98);
        execl(BINARY_DIR "/bin/anlos", "anlos", "launch", file, "--run-dir", s->folder,
              "--record", bag, NULL);
        _exit(99);
    }
    return waitpid(pid, &status, 0) == pid && WIFEXITED(status) ? WEXITSTATUS(status)
                                                                : -1;
}

static inline bool said(struct scratch *s, const char *what, bool print)
{
    char line[500];
    bool found = false;
    FILE *f = fopen(scratch_path(s, "says"), "r");

    while (f && fgets(line, sizeof line, f)) {
        found |= strstr(line, what) != NULL;
        if (print)
            print_message("%s", line);
    }
    if (f)
        fclose(f);
    return found;
}

#endif
