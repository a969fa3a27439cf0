/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>

#include "hal/recording/riff.h"

static const unsigned char format[] = {'f', 'm', 't', ' ', 16, 0, 0, 0};
static const unsigned char zeros[64];

struct riff {
    FILE *f;
    const char *path;
};

static void put(struct riff *r, const void *bytes, size_t n)
{
    assert_int_equal(fwrite(bytes, 1, n, r->f), n);
}

static struct riff begin(struct scratch *s, const char *magic)
{
    struct riff r = {.path = scratch_path(s, "a.wav")};
    r.f = fopen(r.path, "wb");
    assert_non_null(r.f);
    put(&r, magic, 4);
    put(&r, zeros, 4); /* nobody reads the size of all */
    put(&r, "WAVE", 4);
    return r;
}

/* The chunk's name, and a size of one byte. */
static void put_head(struct riff *r, const char *name, unsigned char size)
{
    const unsigned char bytes[4] = {size};
    put(r, name, 4);
    put(r, bytes, 4);
}

static void assert_data(struct riff *r, uint64_t promised, uint64_t present)
{
    uint64_t a, b;
    assert_int_equal(fclose(r->f), 0);
    assert_int_equal(riff_data_size(r->path, &a, &b), 0);
    assert_int_equal(a, promised);
    assert_int_equal(b, present);
}

static void a_chunk_of_odd_length_is_padded(void **state)
{
    struct riff r = begin(*state, "RIFF");
    put(&r, format, sizeof format);
    put(&r, zeros, 16);
    put_head(&r, "LIST", 3);
    put(&r, zeros, 4);
    put_head(&r, "data", 10);
    put(&r, zeros, 10);
    assert_data(&r, 10, 10);
}

static void what_is_missing_at_the_end_shows(void **state)
{
    struct riff r = begin(*state, "RIFF");
    put_head(&r, "data", 40);
    put(&r, zeros, 7);
    assert_data(&r, 40, 7);
}

static void a_writer_that_never_closed_promised_nothing(void **state)
{
    static const unsigned char unknown[4] = {255, 255, 255, 255};
    struct riff r = begin(*state, "RIFF");
    put_head(&r, "data", 0);
    put(&r, zeros, 12);
    assert_data(&r, 12, 12);
    r = begin(*state, "RIFF");
    put(&r, "data", 4);
    put(&r, unknown, 4);
    put(&r, zeros, 12);
    assert_data(&r, 12, 12);
}

/* ds64: sizes of all, of the data (u64 each), of the samples; RF64 leaves 0xffffffff in
 * the chunk itself. */
static void the_size_of_an_rf64_file_stands_in_ds64(void **state)
{
    static const unsigned char unknown[4] = {255, 255, 255, 255}, size[8] = {20};
    struct riff r = begin(*state, "RF64");
    put_head(&r, "ds64", 28);
    put(&r, zeros, 8);
    put(&r, size, 8);
    put(&r, zeros, 12);
    put(&r, "data", 4);
    put(&r, unknown, 4);
    put(&r, zeros, 12);
    assert_data(&r, 20, 12);
}

static void other_files_are_refused(void **state)
{
    struct scratch *s = *state;
    uint64_t a, b;
    assert_int_equal(riff_data_size(scratch_write(s, "a.wav", "RIFF"), &a, &b), -EINVAL);
    assert_int_equal(riff_data_size(scratch_write(s, "a.wav", "RIFF....WAVE"), &a, &b),
                     -EINVAL);
    assert_int_equal(
        riff_data_size(scratch_write(s, "a.wav", "OggS....WAVEdata...."), &a, &b),
        -EINVAL);
    assert_int_equal(riff_data_size(scratch_path(s, "none"), &a, &b), -ENOENT);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_chunk_of_odd_length_is_padded),
        TEST(what_is_missing_at_the_end_shows),
        TEST(a_writer_that_never_closed_promised_nothing),
        TEST(the_size_of_an_rf64_file_stands_in_ds64),
        TEST(other_files_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
