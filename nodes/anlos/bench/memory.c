#include "nodes/anlos/bench/memory.h"

#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* Bytes of a line "NAME:  123 kB" of /proc/self/status. */
static double status_bytes(const char *name)
{
    FILE *f = fopen("/proc/self/status", "r");
    char line[256];
    double kilobytes = NAN;
    size_t n = strlen(name);
    while (f && isnan(kilobytes) && fgets(line, sizeof line, f))
        if (!strncmp(line, name, n) && sscanf(line + n, ": %lf", &kilobytes) != 1)
            break;
    if (f)
        fclose(f);
    return 1024.0 * kilobytes;
}

double bench_memory_begin(void)
{
    malloc_trim(0);
    FILE *f = fopen("/proc/self/clear_refs", "w");
    if (!f)
        return NAN;
    int failed = fputs("5", f) < 0; /* forgets the high-water mark */
    failed = fclose(f) || failed;
    return failed ? NAN : status_bytes("VmRSS");
}

double bench_memory_end(double began)
{
    double most = status_bytes("VmHWM");
    return isnan(most - began) ? NAN : fmax(most - began, 0.0);
}
