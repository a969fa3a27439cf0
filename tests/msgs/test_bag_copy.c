/* SPDX-License-Identifier: MIT */
#include "bag_rig.h"

#include <errno.h>

#include "msgs/bag/copy.h"
#include "msgs/bag/cursor.h"

static struct bag_writer *create(struct scratch *s, const char *name)
{
    const struct bag_writer_config cfg = {.profile = "", .library = ""};
    struct error why = {""};
    struct bag_writer *w;

    if (bag_writer_create(&w, scratch_path(s, name), &cfg, &why))
        fail_msg("%s", why.text);
    return w;
}

static uint16_t add_channel(struct bag_writer *w, const char *schema, const char *topic)
{
    struct bag_channel channel = {.topic = bytes_of(topic)};
    uint16_t id;

    assert_int_equal(bag_writer_schema(w, &(struct bag_schema){.name = bytes_of(schema)},
                                       &channel.schema_id, NULL),
                     0);
    assert_int_equal(bag_writer_channel(w, &channel, &id, NULL), 0);
    return id;
}

static void add_message(struct bag_writer *w, uint16_t channel, const char *text)
{
    const struct bag_message m = {.channel_id = channel, .data = bytes_of(text)};

    assert_int_equal(bag_writer_message(w, &m, NULL), 0);
}

static void add_rest(struct bag_writer *w, const char *name)
{
    assert_int_equal(
        bag_writer_attachment(w, &(struct bag_attachment){.name = bytes_of(name)}, NULL),
        0);
    assert_int_equal(
        bag_writer_metadata(w, &(struct bag_metadata){.name = bytes_of("both")}, NULL),
        0);
}

static struct bag_catalog *open_catalog(struct scratch *s, const char *name)
{
    struct error why = {""};
    struct bag_catalog *c;

    if (bag_catalog_open(&c, scratch_path(s, name), &why))
        fail_msg("%s", why.text);
    return c;
}

/* Each message's text says of what topic and schema it is: "x a" of topic x, schema a. */
static void check_copy(struct scratch *s, size_t expected)
{
    struct bag_catalog *c = open_catalog(s, "copy.mcap");
    struct bag_cursor *cursor;
    struct bag_message m;
    size_t n = 0;

    assert_int_equal(c->n_schemas, 2);
    assert_int_equal(c->n_channels, 2);
    assert_int_equal(c->n_attachments, 2);
    assert_int_equal(c->n_metadata, 1);
    assert_int_equal(bag_cursor_create(&cursor, c), 0);
    while (!bag_cursor_next(cursor, &m, NULL)) {
        const struct bag_channel *h = bag_catalog_channel(c, m.channel_id);
        const struct bag_schema *schema = bag_catalog_schema(c, h->schema_id);
        assert_int_equal(m.data.data[0], h->topic.data[0]);
        assert_int_equal(m.data.data[2], schema->name.data[0]);
        n++;
    }
    assert_int_equal(n, expected);
    bag_cursor_destroy(cursor);
    bag_catalog_close(c);
}

/* The same ids stand for different things in the two bags, and the other way round. */
static void what_bags_have_in_common_is_there_once(void **state)
{
    struct scratch *s = *state;
    struct bag_writer *a = create(s, "a.mcap"), *b = create(s, "b.mcap");
    struct bag_catalog *from[2];
    struct bag_copy *copy;
    struct error why = {""};

    add_message(a, add_channel(a, "a", "x"), "x a");
    add_rest(a, "one");
    assert_int_equal(bag_writer_close(a, &why), 0);
    add_message(b, add_channel(b, "b", "y"), "y b");
    add_message(b, add_channel(b, "a", "x"), "x a");
    add_rest(b, "other");
    assert_int_equal(bag_writer_close(b, &why), 0);
    from[0] = open_catalog(s, "a.mcap");
    from[1] = open_catalog(s, "b.mcap");
    struct bag_writer *to = create(s, "copy.mcap");
    assert_int_equal(bag_copy_create(&copy, to), 0);
    for (size_t i = 0; i < 2; i++) {
        struct bag_cursor *c;
        struct bag_message m;
        assert_int_equal(bag_copy_add(copy, from[i]), 0);
        assert_int_equal(bag_copy_rest(copy, i, &why), 0);
        assert_int_equal(bag_cursor_create(&c, from[i]), 0);
        while (!bag_cursor_next(c, &m, &why))
            assert_int_equal(bag_copy_message(copy, i, &m, &why), 0);
        bag_cursor_destroy(c);
    }
    const struct bag_message nameless = {.channel_id = 9};
    assert_int_equal(bag_copy_message(copy, 0, &nameless, &why), -EBADMSG);
    assert_contains(why.text, "a.mcap");
    bag_copy_destroy(copy);
    assert_int_equal(bag_writer_close(to, &why), 0);
    bag_catalog_close(from[0]);
    bag_catalog_close(from[1]);
    check_copy(s, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_bags_have_in_common_is_there_once,
                                        scratch_open, scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
