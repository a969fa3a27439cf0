/* SPDX-License-Identifier: MIT */
/* nodes/anlos/doctor/doctor.c -- `anlos doctor`: what is configured, what is present,
 * what is wrong, what to do. */
#include "nodes/anlos/doctor/doctor.h"

#include <string.h>
#include <unistd.h>

#include "hal/clock.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/doctor/findings.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/terminal.h"

#define DEADLINE_NS 10000000000LL

static const char help[] =
    "anlos doctor -- what is configured, what is present, what is wrong, what to do\n"
    "\n"
    "usage: anlos doctor [--launch FILE [--host NAME]] [--json] [--run-dir DIR]\n"
    "\n"
    "Looks at the machine (cores, memory, clock, limits for real time, buffers of the\n"
    "kernel, libraries and programs), at the run folder and who runs in it, and\n"
    "\n"
    "  --launch FILE   at a launch file: whether it loads, whether each device that it\n"
    "                  names is there, permitted and good enough, room for its results,\n"
    "                  whether its nodes run, and whether this machine keeps the pace\n"
    "                  of its simulated drive.  Without it: which devices there are\n"
    "  --host NAME     which one of the launch file's hosts this machine is\n"
    "\n"
    "  --json          as JSON\n"
    "  --run-dir DIR   where the system's sockets are, default $XDG_RUNTIME_DIR/anlos, "
    "else\n"
    "                  /tmp/anlos-UID\n"
    "  --help          this text\n"
    "\n"
    "Each line is ok, note (it works, but could do better) or wrong, with what to do "
    "about\n"
    "it.  Takes 4 seconds while a system runs and 10 at most, changes nothing, and does\n"
    "not disturb what runs.\n"
    "\n"
    "examples\n"
    "  anlos doctor --launch launch/demo.yaml\n"
    "  anlos doctor --json | jq '.findings[] | select(.level == \"wrong\")'\n"
    "\n"
    "exit codes: 0 nothing is wrong; 1 something is; 2 bad arguments; 130 stopped by\n"
    "Ctrl-C\n";

static const struct usage_option options[] = {
    {"launch", USAGE_TEXT(struct doctor, launch)},
    {"host", USAGE_TEXT(struct doctor, host)},
    {"json", USAGE_SWITCH('j')},
    {"run-dir", USAGE_TEXT(struct doctor, run_dir)},
    {.name = NULL},
};

static const struct check checks[] = {
    {"machine", doctor_machine},  {"clock", doctor_clock},
    {"limits", doctor_limits},    {"libraries", doctor_libraries},
    {"launch", doctor_launch},    {"array", doctor_array},
    {"stage", doctor_stage},      {"can", doctor_can},
    {"view", doctor_view},        {"devices", doctor_present},
    {"run-dir", doctor_run_dir},  {"nodes", doctor_system},
    {"load", doctor_load_budget},
};

#define N_CHECKS (sizeof checks / sizeof *checks)

/* All at once: the slowest decides how long it takes. */
static void look(const struct doctor *d, struct findings *f)
{
    struct check_job jobs[N_CHECKS];
    int64_t deadline_ns = clock_monotonic_ns() + DEADLINE_NS;

    for (size_t i = 0; i < N_CHECKS; i++)
        check_start(&jobs[i], &checks[i], d);
    for (size_t i = 0; i < N_CHECKS; i++)
        check_finish(&jobs[i], &checks[i], deadline_ns, f);
}

static int print(const struct findings *f, bool json)
{
    if (!json) {
        findings_print(f, colour_wanted(STDOUT_FILENO), stdout);
        return usage_flush("doctor");
    }
    return usage_json("doctor", findings_json(f));
}

int command_doctor(int argc, char **argv)
{
    struct doctor d = {0};
    struct findings f = {0};
    struct usage usage = {
        .command = "doctor", .help = help, .options = options, .into = &d};
    bool json = false;
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        json = true;
    if (code)
        return ~code;
    if (d.host && !d.launch)
        return usage_error("doctor", "--host: of which launch file? --launch FILE");
    if (optind < argc)
        return usage_error("doctor",
                           "%s: expected options only; a launch file is "
                           "--launch FILE",
                           argv[optind]);
    look(&d, &f);
    bool failed = print(&f, json) != EXIT_WORKED;
    bool wrong = f.full || findings_count(&f, FINDING_WRONG) > 0;
    findings_clear(&f);
    return failed || wrong ? EXIT_FAILED : EXIT_WORKED;
}
