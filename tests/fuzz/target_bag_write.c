/* SPDX-License-Identifier: MIT */
/* A bag through everything that makes a new one of it: recover, filter, merge.  What
 * comes out is whole, whatever went in. */
#include <errno.h>
#include <math.h>

#include "msgs/bag/check.h"
#include "msgs/bag/reader.h"
#include "msgs/bag/recover.h"
#include "nodes/anlos/bag/bag.h"
#include "tests/fuzz/fuzz.h"

static uint64_t count_messages(const char *path)
{
    struct error why = {""};
    struct bag_reader *r;
    struct bag_record record;
    uint64_t n = 0;
    int err;

    FUZZ_REQUIRE(!bag_reader_open(&r, path, &why));
    while (!(err = bag_reader_next(r, &record, &why)))
        n += record.opcode == BAG_MESSAGE;
    FUZZ_REQUIRE(err == -ENODATA);
    bag_reader_close(r);
    return n;
}

static void require_whole(const char *path, uint64_t n_messages)
{
    struct error why = {""};
    uint64_t n_faults = 0;

    FUZZ_REQUIRE(!bag_check(&n_faults, path, NULL, &why));
    FUZZ_REQUIRE(!n_faults);
    FUZZ_REQUIRE(count_messages(path) == n_messages);
}

static void recover(const char *path)
{
    struct error why = {""};
    struct bag_recovery result;
    const char *saved = fuzz_path("saved.mcap");

    if (!bag_recover(&result, path, saved, NULL, &why))
        require_whole(saved, result.n_messages);
    else
        FUZZ_REQUIRE(why.text[0]);
    fuzz_remove("saved.mcap");
}

static void select_from(const char *const *files, size_t n_files)
{
    struct error why = {""};
    const char *out = fuzz_path("out.mcap");
    const struct selection s = {.files = (char *const *)files,
                                .n_files = n_files,
                                .exclude = n_files > 1 ? NULL : "*odd",
                                .end_s = n_files > 1 ? INFINITY : 1e-6,
                                .compression = BAG_LZ4,
                                .out = out};
    struct selection_result result;

    if (!selection_write(&s, &result, &why))
        require_whole(out, result.n_written);
    else
        FUZZ_REQUIRE(why.text[0]);
    fuzz_remove("out.mcap");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *path = fuzz_file("in.mcap", data, size);
    const char *const files[] = {path, path};

    recover(path);
    select_from(files, 1);
    select_from(files, 2);
    return 0;
}
