/* SPDX-License-Identifier: MIT */
/* A bag through everything that only reads it; what says that it is whole is held to it.
 */
#include <errno.h>

#include "msgs/bag/check.h"
#include "msgs/bag/cursor.h"
#include "msgs/bag/reader.h"
#include "nodes/anlos/bag/bag.h"
#include "tests/fuzz/fuzz.h"

static int read_records(const char *path, uint64_t *n_messages)
{
    struct error why = {""};
    struct bag_reader *r;
    struct bag_record record;
    int err = bag_reader_open(&r, path, &why);

    if (err)
        return err;
    while (!(err = bag_reader_next(r, &record, &why)))
        *n_messages += record.opcode == BAG_MESSAGE;
    FUZZ_REQUIRE(err == -ENODATA || why.text[0]);
    FUZZ_REQUIRE(bag_reader_next(r, &record, &why) == err); /* an error stays */
    bag_reader_close(r);
    return err;
}

/* The messages from a time on, in order.  Returns how it ended. */
static int walk(const struct bag_catalog *catalog, uint64_t from, uint64_t *n_messages)
{
    struct error why = {""};
    struct bag_cursor *c;
    struct bag_message m;
    uint64_t time = from;
    int err;

    FUZZ_REQUIRE(!bag_cursor_create(&c, catalog));
    bag_cursor_seek(c, from);
    while (!(err = bag_cursor_next(c, &m, &why))) {
        FUZZ_REQUIRE(m.log_time >= time);
        time = m.log_time;
        ++*n_messages;
    }
    bag_cursor_destroy(c);
    return err;
}

static void read_rest(const struct bag_catalog *c, const struct bag_kept *index, size_t n)
{
    struct bytes_buffer bytes = {0};
    struct bag_record r;

    for (size_t i = 0; i < n; i++)
        bag_catalog_read(c, &index[i].record, &bytes, &r, NULL);
    bytes_free(&bytes);
}

static void look(const struct bag_catalog *c)
{
    struct error why = {""};
    struct contents contents;

    if (!contents_read(&contents, c, &why))
        for (size_t i = 0; i < contents.n; i++)
            (void)topic_rate_hz(&contents.topics[i]);
    contents_clear(&contents);
    read_rest(c, c->attachments, c->n_attachments);
    read_rest(c, c->metadata, c->n_metadata);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct error why = {""};
    struct bag_catalog *catalog;
    const char *path = fuzz_file("in.mcap", data, size);
    uint64_t n_faults = 0, n_read = 0, n_walked = 0, n_after = 0;
    int checked = bag_check(&n_faults, path, NULL, &why);
    int read = read_records(path, &n_read);
    bool whole = !checked && !n_faults;

    FUZZ_REQUIRE(!whole || read == -ENODATA);
    int err = bag_catalog_open(&catalog, path, &why);
    FUZZ_REQUIRE(!whole || !err);
    if (err) {
        FUZZ_REQUIRE(why.text[0]);
        return 0;
    }
    look(catalog);
    err = walk(catalog, 0, &n_walked);
    FUZZ_REQUIRE(!whole || (err == -ENODATA && n_walked == n_read));
    walk(catalog, catalog->start_time / 2 + catalog->end_time / 2, &n_after);
    FUZZ_REQUIRE(!whole || n_after <= n_walked);
    bag_catalog_close(catalog);
    return 0;
}
