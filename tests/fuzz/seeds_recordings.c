/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <matio.h>
#include <sndfile.h>
#include <stdio.h>
#include <unistd.h>

#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/seeds.h"

#define FRAMES 230 /* of two slots of 100 and what rings on; see target_wav.c */

static void put_wav(const struct seeds *s, const char *name, int format, int channels)
{
    SF_INFO info = {.samplerate = 8000, .channels = channels, .format = format};
    float x[FRAMES * 2];

    for (int i = 0; i < FRAMES * channels; i++)
        x[i] = 0.5f * sinf((float)(i / channels) * (0.2f + 0.005f * (float)i));
    SNDFILE *f = sf_open(seeds_path(s, "wav", name), SFM_WRITE, &info);
    FUZZ_REQUIRE(f && sf_writef_float(f, x, FRAMES) == FRAMES);
    FUZZ_REQUIRE(!sf_close(f));
}

static void put_wavs(const struct seeds *s)
{
    put_wav(s, "stereo-16.wav", SF_FORMAT_WAV | SF_FORMAT_PCM_16, 2);
    put_wav(s, "stereo-24.wav", SF_FORMAT_WAVEX | SF_FORMAT_PCM_24, 2);
    put_wav(s, "stereo-float.wav", SF_FORMAT_WAV | SF_FORMAT_FLOAT, 2);
    put_wav(s, "stereo-adpcm.wav", SF_FORMAT_WAV | SF_FORMAT_IMA_ADPCM, 2);
    put_wav(s, "stereo-rf64.wav", SF_FORMAT_RF64 | SF_FORMAT_PCM_16, 2);
    put_wav(s, "stereo-rifx.wav", SF_FORMAT_WAV | SF_ENDIAN_BIG | SF_FORMAT_PCM_16, 2);
    put_wav(s, "stereo-w64.wav", SF_FORMAT_W64 | SF_FORMAT_FLOAT, 2);
    put_wav(s, "mono-double.wav", SF_FORMAT_WAV | SF_FORMAT_DOUBLE, 1);
    put_wav(s, "mono-ulaw.wav", SF_FORMAT_WAV | SF_FORMAT_ULAW, 1);
}

static void put_variable(mat_t *mat, const char *name, enum matio_classes class,
                         enum matio_types type, int rank, const size_t *extents,
                         void *data, int flags, enum matio_compression compression)
{
    size_t dims[4] = {1, 1, 1, 1};

    for (int d = 0; d < rank; d++)
        dims[d] = extents[d];
    matvar_t *v = Mat_VarCreate(name, class, type, rank, dims, data, flags);
    FUZZ_REQUIRE(v && !Mat_VarWrite(mat, v, compression));
    Mat_VarFree(v);
}

static void put_mat(const struct seeds *s, const char *name, enum mat_ft version,
                    enum matio_compression compression)
{
    static const size_t one[] = {1, 1}, scan[] = {3, 3, 8}, traces[] = {2, 2, 2, 3};
    double width = 0.5, counts[72], half[24];
    mat_complex_split_t both = {counts, half};
    const char *path = seeds_path(s, "mat", name);

    for (int i = 0; i < 72; i++)
        counts[i] = i % 7;
    for (int i = 0; i < 24; i++)
        half[i] = i;
    unlink(path);
    mat_t *mat = Mat_CreateVer(path, "seed", version);
    FUZZ_REQUIRE(mat);
    put_variable(mat, "rect_data", MAT_C_DOUBLE, MAT_T_DOUBLE, 3, scan, counts, 0,
                 compression);
    put_variable(mat, "width", MAT_C_DOUBLE, MAT_T_DOUBLE, 2, one, &width, 0,
                 compression);
    put_variable(mat, "traces", MAT_C_DOUBLE, MAT_T_DOUBLE, 4, traces, &both,
                 MAT_F_COMPLEX, compression);
    FUZZ_REQUIRE(!Mat_Close(mat));
}

void seeds_recordings(const struct seeds *s)
{
    put_wavs(s);
    put_mat(s, "v5.mat", MAT_FT_MAT5, MAT_COMPRESSION_NONE);
    put_mat(s, "v5-zlib.mat", MAT_FT_MAT5, MAT_COMPRESSION_ZLIB);
    put_mat(s, "v7.3.mat", MAT_FT_MAT73, MAT_COMPRESSION_NONE);
}
