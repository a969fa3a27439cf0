#include "nodes/anlos/bench/machine.h"

#include <fftw3.h>
#include <stdio.h>
#include <string.h>
#include <sys/utsname.h>

#include "nodes/anlos/usage.h"

#ifdef __clang__
#define COMPILER __VERSION__ /* says its name itself */
#else
#define COMPILER "gcc " __VERSION__
#endif

static void find_processor(char *text, size_t size)
{
    FILE *f = fopen("/proc/cpuinfo", "r");
    char line[256];
    snprintf(text, size, "unknown processor");
    while (f && fgets(line, sizeof line, f)) {
        const char *value = strchr(line, ':');
        if (strncmp(line, "model name", 10) || !value)
            continue;
        value += 1 + strspn(value + 1, " \t");
        snprintf(text, size, "%.*s", (int)strcspn(value, "\n"), value);
        break;
    }
    if (f)
        fclose(f);
}

void bench_machine(char *text, size_t size)
{
    char processor[128];
    struct utsname system = {.sysname = "?"};
    size_t n = usage_default_threads();
    find_processor(processor, sizeof processor);
    uname(&system);
    snprintf(text, size, "%s, %zu processor%s, %s %s; %s; %s", processor, n,
             n == 1 ? "" : "s", system.sysname, system.release, COMPILER, fftwf_version);
}
