/* SPDX-License-Identifier: MIT */
#include "msgs/bag/compression.h"

#include <errno.h>
#include <lz4frame.h>
#include <string.h>
#include <zstd.h>
#include <zstd_errors.h>

static const char *const names[] = {
    [BAG_NONE] = "", [BAG_ZSTD] = "zstd", [BAG_LZ4] = "lz4"};

const char *bag_compression_name(enum bag_compression c)
{
    return names[c];
}

int bag_compression_find(enum bag_compression *out, struct bytes name)
{
    for (int c = BAG_NONE; c <= BAG_LZ4; c++) {
        if (bytes_equal(name, bytes_of(names[c]))) {
            *out = (enum bag_compression)c;
            return 0;
        }
    }
    return -ENOTSUP;
}

/* Both libraries take memory of their own; that there is none is no fault of the data.
 * other: what any other error is. */
static int zstd_error(size_t result, int other)
{
    if (!ZSTD_isError(result))
        return 0;
    return ZSTD_getErrorCode(result) == ZSTD_error_memory_allocation ? -ENOMEM : other;
}

/* Its codes are no part of the shared library's interface; their names are. */
static int lz4_error(size_t result, int other)
{
    if (!LZ4F_isError(result))
        return 0;
    return strcmp(LZ4F_getErrorName(result), "ERROR_allocation_failed") ? other : -ENOMEM;
}

static int compress_zstd(struct bytes_buffer *out, int level, struct bytes plain)
{
    if (bytes_reserve(out, ZSTD_compressBound(plain.size)))
        return -ENOMEM;
    out->size = ZSTD_compress(out->data, out->capacity, plain.data, plain.size, level);
    return zstd_error(out->size, -EIO);
}

static int compress_lz4(struct bytes_buffer *out, int level, struct bytes plain)
{
    LZ4F_preferences_t how = {.compressionLevel = level};

    how.frameInfo.contentSize = plain.size;
    if (bytes_reserve(out, LZ4F_compressFrameBound(plain.size, &how)))
        return -ENOMEM;
    out->size =
        LZ4F_compressFrame(out->data, out->capacity, plain.data, plain.size, &how);
    return lz4_error(out->size, -EIO);
}

int bag_compress(struct bytes_buffer *out, enum bag_compression c, int level,
                 struct bytes plain)
{
    int err = 0;

    out->size = 0;
    if (c == BAG_ZSTD)
        err = compress_zstd(out, level, plain);
    else if (c == BAG_LZ4)
        err = compress_lz4(out, level, plain);
    else
        bytes_put(out, plain);
    if (err)
        out->size = 0;
    return out->failed ? -ENOMEM : err;
}

static int decompress_zstd(struct bytes_buffer *out, struct bytes packed, size_t size)
{
    size_t n = ZSTD_decompress(out->data, size, packed.data, packed.size);

    int err = zstd_error(n, -EBADMSG);

    return err || n == size ? err : -EBADMSG;
}

/* Whole frames follow one another until the input ends.  *whole: all of it was used, and
 * the last frame had its end. */
static int run_lz4(struct bytes_buffer *out, struct bytes packed, size_t size,
                   bool *whole)
{
    LZ4F_dctx *context;
    size_t hint = 0;

    if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)))
        return -ENOMEM;
    while (packed.size) {
        size_t n_out = size - out->size, n_in = packed.size;
        hint = LZ4F_decompress(context, out->data + out->size, &n_out, packed.data, &n_in,
                               NULL);
        if (LZ4F_isError(hint) || (!n_in && !n_out))
            break;
        out->size += n_out;
        packed.data += n_in;
        packed.size -= n_in;
    }
    LZ4F_freeDecompressionContext(context);
    *whole = !packed.size && !hint;
    return lz4_error(hint, 0);
}

static int decompress_lz4(struct bytes_buffer *out, struct bytes packed, size_t size)
{
    bool whole;
    int err = run_lz4(out, packed, size, &whole);

    return err ? err : whole && out->size == size ? 0 : -EBADMSG;
}

static int start_zstd(struct bytes_buffer *out, struct bytes packed, size_t size)
{
    ZSTD_DCtx *context = ZSTD_createDCtx();
    ZSTD_inBuffer in = {packed.data, packed.size, 0};
    ZSTD_outBuffer to = {out->data, size, 0};

    if (!context)
        return -ENOMEM;
    size_t n = 0;
    while (in.pos < in.size && to.pos < to.size && !ZSTD_isError(n))
        n = ZSTD_decompressStream(context, &to, &in);
    ZSTD_freeDCtx(context);
    out->size = to.pos;
    return zstd_error(n, 0);
}

int bag_decompress(struct bytes_buffer *out, enum bag_compression c, struct bytes packed,
                   uint64_t plain_size)
{
    int err = 0;

    out->size = 0;
    if (c == BAG_NONE && packed.size != plain_size)
        return -EBADMSG;
    /* One byte more: an empty chunk too has an address. */
    if (bytes_reserve(out, (size_t)plain_size + 1))
        return -ENOMEM;
    if (c == BAG_ZSTD)
        err = decompress_zstd(out, packed, (size_t)plain_size);
    else if (c == BAG_LZ4)
        err = decompress_lz4(out, packed, (size_t)plain_size);
    else
        bytes_put(out, packed);
    if (!err)
        out->size = (size_t)plain_size;
    return err;
}

int bag_decompress_start(struct bytes_buffer *out, enum bag_compression c,
                         struct bytes packed, uint64_t max)
{
    bool whole;

    out->size = 0;
    if (bytes_reserve(out, (size_t)max + 1))
        return -ENOMEM;
    if (c == BAG_ZSTD)
        return start_zstd(out, packed, (size_t)max);
    if (c == BAG_LZ4)
        return run_lz4(out, packed, (size_t)max, &whole);
    packed.size = packed.size < max ? packed.size : (size_t)max;
    bytes_put(out, packed);
    return 0;
}
