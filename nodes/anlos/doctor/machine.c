#include "nodes/anlos/doctor/doctor.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/timex.h>
#include <unistd.h>

#include "nodes/anlos/usage.h"

#define MEMORY_NOTE_MB  1000
#define MEMORY_WRONG_MB 200 /* what the nodes of the demo need together */

int doctor_read_word(const char *path, char *out, size_t size)
{
    FILE *f = fopen(path, "re");

    if (!f)
        return -errno;
    char *got = fgets(out, (int)size, f);
    fclose(f);
    if (!got)
        return -ENODATA;
    out[strcspn(out, " \t\n")] = '\0';
    return 0;
}

static void look_at_cores(struct findings *f)
{
    size_t n = usage_default_threads();
    double load[1] = {0.0};
    bool busy = getloadavg(load, 1) == 1 && load[0] > 1.5 * (double)n;

    finding_add(f, n < 2 || busy ? FINDING_NOTE : FINDING_OK, "cores",
                "%zu may be used, %.1f are busy", n, load[0]);
    if (busy)
        finding_todo(f, "other programs want more than there is: pings may come late; "
                        "'top' says which");
    else if (n < 2)
        finding_todo(f, "an image while the scan runs wants two");
}

static void look_at_memory(struct findings *f)
{
    char line[128];
    unsigned long kb = 0;
    FILE *m = fopen("/proc/meminfo", "re");

    while (m && fgets(line, sizeof line, m) &&
           sscanf(line, "MemAvailable: %lu kB", &kb) != 1)
        ;
    if (m)
        fclose(m);
    if (!kb)
        return;
    unsigned long mb = kb / 1024;
    finding_add(f,
                mb < MEMORY_WRONG_MB  ? FINDING_WRONG
                : mb < MEMORY_NOTE_MB ? FINDING_NOTE
                                      : FINDING_OK,
                "memory", "%lu MB are free", mb);
    if (mb < MEMORY_NOTE_MB)
        finding_todo(f, "end other programs, or choose a smaller volume in survey.yaml");
}

/* intel_pstate and amd-pstate call "powersave" what is as fast as is needed. */
static void look_at_governor(struct findings *f)
{
    static const char folder[] = "/sys/devices/system/cpu/cpu0/cpufreq/";
    char path[96], governor[32], driver[32] = "";

    snprintf(path, sizeof path, "%sscaling_governor", folder);
    if (doctor_read_word(path, governor, sizeof governor))
        return;
    snprintf(path, sizeof path, "%sscaling_driver", folder);
    if (doctor_read_word(path, driver, sizeof driver))
        driver[0] = '\0';
    bool slow = (!strcmp(governor, "powersave") && !strstr(driver, "pstate")) ||
                !strcmp(governor, "conservative");
    finding_add(f, slow ? FINDING_NOTE : FINDING_OK, "governor",
                "of the clock of core 0: %s%s%s", governor, driver[0] ? ", driver " : "",
                driver);
    if (slow)
        finding_todo(f, "for images as fast as this machine can: 'cpupower frequency-set "
                        "-g performance'");
}

void doctor_machine(const void *ctx, struct findings *f)
{
    (void)ctx;
    look_at_cores(f);
    look_at_memory(f);
    look_at_governor(f);
}

void doctor_clock(const void *ctx, struct findings *f)
{
    struct timex t = {.modes = 0};
    int state = adjtimex(&t);

    (void)ctx;
    if (state < 0) {
        finding_add(f, FINDING_NOTE, "clock", "whether it is synchronised is not known");
    } else if (state == TIME_ERROR || (t.status & STA_UNSYNC)) {
        finding_add(f, FINDING_NOTE, "clock", "is not synchronised with any other");
        finding_todo(f, "stamps of several machines can only be compared when it is: "
                        "'apt-get install chrony'");
    } else {
        finding_add(f, FINDING_OK, "clock", "synchronised, to %.1f ms",
                    1e-3 * (double)t.maxerror);
    }
}
