/* SPDX-License-Identifier: MIT */
/* Bytes as a MATLAB file: an optical confocal scan, and the arrays of traces. */
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "nodes/anlos/confocal/scan.h"
#include "nodes/anlos/mat_file.h"
#include "tests/fuzz/fuzz.h"

static void as_confocal(const char *path)
{
    struct error why = {""};
    struct confocal_file f;
    struct confocal_scan scan;
    double gate_m[2];

    if (confocal_file_load(&f, path, &why)) {
        FUZZ_REQUIRE(why.text[0]);
    } else {
        confocal_file_gate(&f, gate_m);
        if (!confocal_scan_create(&scan, &f, gate_m, 64, 0.0, &why))
            confocal_scan_clear(&scan);
    }
    confocal_file_clear(&f);
}

static void as_arrays(const char *path)
{
    struct error why = {""};
    struct mat_file *f;
    size_t extents[MAT_FILE_MAX_RANK];
    float complex *traces = NULL;
    double *places = NULL, number;

    if (mat_file_open(&f, path, &why))
        return;
    if (!mat_file_read_complex(f, "traces", 4, extents, &traces, &why))
        free(traces);
    if (!mat_file_read_double(f, "width", 2, extents, &places, &why))
        free(places);
    mat_file_read_number(f, "width", &number, &why);
    mat_file_close(f);
}

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#include <sanitizer/common_interface_defs.h>
#define WATCHED 1
#endif
#endif

/* Files are read in child processes, whose end is no crash of this one: it must not be
 * told as one. */
static void forget_fuzzer(void)
{
    static const int crashes[] = {SIGSEGV, SIGBUS, SIGABRT, SIGILL, SIGFPE};

#ifdef WATCHED
    __sanitizer_set_death_callback(NULL);
#endif
    for (size_t i = 0; i < sizeof crashes / sizeof *crashes; i++)
        signal(crashes[i], SIG_DFL);
    if (!freopen("/dev/null", "w", stderr))
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static bool ready;
    const char *path = fuzz_file("in.mat", data, size);

    if (!ready)
        FUZZ_REQUIRE(!pthread_atfork(NULL, NULL, forget_fuzzer));
    ready = true;
    as_confocal(path);
    as_arrays(path);
    return 0;
}
