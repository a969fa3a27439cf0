/* SPDX-License-Identifier: MIT */
#include "tests/hal/scratch.h"

#include "nodes/can/vehicle.h"

static const struct can_frame_data frame = {.id = 0x400, .size = 1, .data = {7}};

#define LINE "(0000000001.000000) can0 400#07\n"

/* A node that starts, logs one frame and is gone. */
static void log_one(struct scratch *s, const char *uri)
{
    struct launchfile l = {.can.uri = (char *)uri, .report.folder = s->folder};
    struct error why = {""};
    struct canbus *b;

    if (vehicle_bus_open(&b, &l, &why))
        fail_msg("%s", why.text);
    assert_int_equal(canbus_send(b, &frame, 1000000000), 0);
    canbus_close(b);
}

static void assert_log(struct scratch *s, const char *expected)
{
    char text[512];
    FILE *f = fopen(scratch_path(s, "x.candump"), "r");

    assert_non_null(f);
    text[fread(text, 1, sizeof text - 1, f)] = '\0';
    fclose(f);
    assert_string_equal(text, expected);
}

/* A launcher that began seconds after the file was written, or before. */
static void launch(struct scratch *s, int seconds)
{
    char start[32];
    struct stat st;

    assert_int_equal(stat(scratch_path(s, "x.candump"), &st), 0);
    snprintf(start, sizeof start, "%lld", (st.st_mtim.tv_sec + seconds) * 1000000000LL);
    setenv("ANLOS_LAUNCH_NS", start, 1);
}

static void assert_goes_on(struct scratch *s, const char *uri)
{
    unsetenv("ANLOS_LAUNCH_NS");
    log_one(s, uri);
    log_one(s, uri);
    assert_log(s, LINE);
    launch(s, 5);
    log_one(s, uri);
    assert_log(s, LINE);
    launch(s, -5);
    log_one(s, uri);
    log_one(s, uri);
    assert_log(s, LINE LINE LINE);
}

static void a_log_begins_anew_with_each_run_and_goes_on_within_one(void **state)
{
    struct scratch *s = *state;
    char uri[600];

    snprintf(uri, sizeof uri, "log:%s", scratch_path(s, "x.candump"));
    assert_goes_on(s, uri);
}

static void so_does_that_of_a_simulated_vehicle(void **state)
{
    struct scratch *s = *state;
    char uri[600];

    snprintf(uri, sizeof uri,
             "sim:" SOURCE_DIR "/launch/scenes/drive-nothing.yaml?log=%s&ego=off",
             scratch_path(s, "x.candump"));
    assert_goes_on(s, uri);
}

static void who_wants_it_to_go_on_from_run_to_run_gets_that(void **state)
{
    struct scratch *s = *state;
    char uri[600];

    snprintf(uri, sizeof uri, "log:%s?append=yes", scratch_path(s, "x.candump"));
    unsetenv("ANLOS_LAUNCH_NS");
    log_one(s, uri);
    launch(s, 5);
    log_one(s, uri);
    assert_log(s, LINE LINE);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_log_begins_anew_with_each_run_and_goes_on_within_one),
        TEST(so_does_that_of_a_simulated_vehicle),
        TEST(who_wants_it_to_go_on_from_run_to_run_gets_that),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
