/* SPDX-License-Identifier: MIT */
/* Bytes as a recording's WAV file of two speakers and two microphones, as one of pings
 * with places of their own, and as a replica. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "hal/recording/recording.h"
#include "hal/recording/replica_file.h"
#include "hal/recording/riff.h"
#include "tests/fuzz/fuzz.h"

#define RATE_HZ 8000.0

/* Where elements stand does not matter here. */
static struct survey survey_of(bool pings)
{
    static double places[2][3], stage[2], of_pings[2][2][3];

    return (struct survey){.sample_rate_hz = RATE_HZ,
                           .sound_speed_m_s = 343,
                           .chirp_start_hz = 500,
                           .chirp_stop_hz = 3000,
                           .chirp_duration_s = 0.01,
                           .slot_samples = 100,
                           .n_speakers = pings ? 1 : 2,
                           .n_microphones = pings ? 1 : 2,
                           .n_positions = pings ? 2 : 1,
                           .speakers_m = places,
                           .microphones_m = places,
                           .stage_axis = {1, 0, 0},
                           .stage_positions_m = stage,
                           .pings_m = pings ? of_pings : NULL};
}

static void read_all(const struct recording *r, const struct survey *s)
{
    size_t n = s->n_microphones * recording_frames(r);
    float *samples = malloc(n * sizeof *samples);
    uint32_t counts[2][2];
    struct error why = {""};

    FUZZ_REQUIRE(samples);
    for (size_t p = 0; p < s->n_positions; p++) {
        int err = recording_read(r, p, samples, counts[0], counts[1], &why);
        for (size_t i = 0; i < n && !err; i++)
            FUZZ_REQUIRE(isfinite(samples[i]));
        FUZZ_REQUIRE(!err == !why.text[0]);
        why.text[0] = '\0';
    }
    free(samples);
}

static void as_recording(const char *folder, bool pings)
{
    const struct survey s = survey_of(pings);
    struct error why = {""};
    struct recording *r;

    if (recording_open(&r, folder, &s, &why)) {
        FUZZ_REQUIRE(why.text[0]);
        return;
    }
    read_all(r, &s);
    recording_close(r);
}

static void as_replica(const char *path)
{
    struct error why = {""};
    double band_hz[2];
    float *x = NULL;
    size_t n = 0;

    if (replica_load(&x, &n, path, RATE_HZ, &why)) {
        FUZZ_REQUIRE(why.text[0]);
        return;
    }
    FUZZ_REQUIRE(n >= 2 && n <= REPLICA_MAX_SAMPLES);
    if (!replica_band(x, n, RATE_HZ, band_hz))
        FUZZ_REQUIRE(band_hz[0] > 0 && band_hz[0] < band_hz[1] &&
                     band_hz[1] < RATE_HZ / 2);
    free(x);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *folder = fuzz_path("recording");
    uint64_t promised, present;

    mkdir(folder, 0700);
    const char *path = fuzz_file("recording/pos00.wav", data, size);
    if (!riff_data_size(path, &promised, &present))
        FUZZ_REQUIRE(present <= size);
    as_recording(folder, false);
    as_recording(folder, true);
    as_replica(path);
    return 0;
}
