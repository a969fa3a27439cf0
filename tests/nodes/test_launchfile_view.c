/* SPDX-License-Identifier: MIT */
#include "tests/nodes/launch_load.h"

static void the_page_is_for_this_machine_alone_unless_told(void **state)
{
    struct launchfile *l = launch_load(*state, "nodes: [view]\n");

    assert_string_equal(l->view.address, "127.0.0.1");
    assert_int_equal(l->view.port, 8765);
    assert_false(l->view.save);
    assert_null(l->view.bag);
    launchfile_destroy(l);
}

static void a_bag_is_beside_the_launch_file(void **state)
{
    struct scratch *s = *state;
    char expected[128];
    struct launchfile *l = launch_load(s, "nodes: [view]\nview: {address: 0.0.0.0, port: "
                                          "80, bag: bags/a.mcap, save: true}\n");

    snprintf(expected, sizeof expected, "%s/bags/a.mcap", s->folder);
    assert_string_equal(l->view.bag, expected);
    assert_string_equal(l->view.address, "0.0.0.0");
    assert_int_equal(l->view.port, 80);
    assert_true(l->view.save);
    launchfile_destroy(l);
    l = launch_load(s, "nodes: [view]\nview: {bag: /a.mcap}\n");
    assert_string_equal(l->view.bag, "/a.mcap");
    launchfile_destroy(l);
}

static void there_are_65536_ports(void **state)
{
    struct error why = {""};
    struct launchfile *l = NULL;
    const char *path = scratch_write(*state, "a.yaml",
                                     "nodes: [view]\n"
                                     "view:\n"
                                     "  port: 65536\n");

    assert_int_equal(launchfile_load(&l, path, NULL, &why), -EINVAL);
    assert_error(why.text, path, ":3: view.port: expected 0 (any) to 65535, not 65536");
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_page_is_for_this_machine_alone_unless_told),
        TEST(a_bag_is_beside_the_launch_file),
        TEST(there_are_65536_ports),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
