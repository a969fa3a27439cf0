/* SPDX-License-Identifier: MIT */
/* Bytes as the small texts that are read line by line or as a whole: places of pings, a
 * microphone's calibration, what a stage says, device URIs, a point spread function, CAN
 * frames. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/device.h"
#include "hal/recording/pings_file.h"
#include "hal/stage/zaber_message.h"
#include "hal/survey/response_file.h"
#include "nodes/anlos/can/can.h"
#include "nodes/anlos/psf/file.h"
#include "nodes/rt/uri.h"
#include "tests/fuzz/fuzz.h"

static void as_pings(const char *path)
{
    struct error why = {""};
    double(*pings)[2][3] = NULL;
    size_t n = 0;

    if (pings_load(&pings, &n, path, &why)) {
        FUZZ_REQUIRE(why.text[0]);
        return;
    }
    FUZZ_REQUIRE(n >= 1 && n <= SURVEY_MAX_PINGS);
    free(pings);
}

static void as_response(const char *path)
{
    struct error why = {""};
    struct survey_response r;
    char folder[4096];

    snprintf(folder, sizeof folder, "%s", path);
    *strrchr(folder, '/') = '\0';
    if (response_load(&r, folder, "in", &why)) {
        FUZZ_REQUIRE(why.text[0]);
        return;
    }
    for (size_t i = 1; i < r.n_points; i++)
        FUZZ_REQUIRE(r.frequency_hz[i] > r.frequency_hz[i - 1]);
    response_gain(&r, 1000.0);
    response_clear(&r);
}

static void as_psf(const char *path)
{
    struct error why = {""};
    struct psf_file psf;

    if (psf_file_load(&psf, path, &why))
        FUZZ_REQUIRE(why.text[0]);
}

/* No line is counted twice. */
static void as_frames(const char *path, bool json, size_t n_lines)
{
    struct decode d = {.tally.checks.base = 0x400, .shown = UINT16_MAX, .json = json};
    FILE *f = fopen(path, "r");

    FUZZ_REQUIRE(f && !decode_file(&d, f));
    fclose(f);
    FUZZ_REQUIRE(tally_frames(&d.tally) + d.tally.unknown + d.tally.other +
                     d.tally.no_frames <=
                 n_lines);
    if (json)
        tally_print_json(&d.tally, stdout);
    else
        tally_print(&d.tally, stdout);
}

static void as_line(const char *line)
{
    struct zaber_message m;
    const char *words;

    if (zaber_parse(&m, line))
        return;
    zaber_warning(m.warning, &words);
    zaber_rejection(m.data);
}

static void as_uri(const char *uri)
{
    static const char *const known[] = {"background", "pace", "rig", NULL};
    struct error why = {""};
    struct device d;
    char *made[] = {uri_path(uri), uri_in_folder(uri, "folder"),
                    uri_option_in_folder(uri, "folder", "background"),
                    uri_set_option(uri, "pace", "real")};

    for (size_t i = 0; i < sizeof made / sizeof *made; i++)
        free(made[i]);
    const char *arg = device_arg(uri, "sim");
    if (arg && !device_parse(&d, arg, known, &why)) {
        device_option(&d, "pace");
        device_clear(&d);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *path = fuzz_file("in.txt", data, size);
    char *text = malloc(size + 1);

    FUZZ_REQUIRE(text);
    memcpy(text, data, size);
    text[size] = '\0';
    as_pings(path);
    as_response(path);
    as_psf(path);
    as_uri(text);
    as_frames(path, true, size + 1);
    as_frames(path, false, size + 1);
    for (char *line = text, *rest = text; line; line = rest) {
        strsep(&rest, "\n");
        as_line(line);
    }
    free(text);
    return 0;
}
