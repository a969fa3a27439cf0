/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>

#include "hal/recording/pings_file.h"
#include "recon/survey.h"

static int load(struct scratch *s, const char *text, double (**pings)[2][3], size_t *n,
                struct error *why)
{
    why->text[0] = 0;
    return pings_load(pings, n, scratch_write(s, "pings.csv", text), why);
}

static void expect_two(struct scratch *s, const char *text)
{
    struct error why;
    double(*p)[2][3];
    size_t n;
    if (load(s, text, &p, &n, &why))
        fail_msg("%s", why.text);
    assert_int_equal(n, 2);
    static const double expected[2][2][3] = {{{1, 2, 3}, {4, 5, 6}},
                                             {{-1, 0.5, 0.0025}, {7, 8, 9}}};
    assert_memory_equal(p, expected, sizeof expected);
    free(p);
}

static void six_numbers_a_line_are_a_ping(void **state)
{
    expect_two(*state, "1,2,3,4,5,6\n-1,0.5,2.5e-3,7,8,9\n");
    expect_two(*state, "# speaker, microphone\n\n1; 2; 3; 4; 5; 6\r\n"
                       "-1;.5;0.0025;7;8;9"); /* the last line need not end */
    expect_two(*state, "1\t2\t3\t4\t5\t6\n \n-1\t0.5\t0.0025\t7\t8\t9\n\n");
}

static void named_columns_may_stand_anywhere(void **state)
{
    expect_two(*state, "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m\n"
                       "1,2,3,4,5,6\n-1,0.5,0.0025,7,8,9\n");
    expect_two(*state, "\xef\xbb\xbf\"angle\",RX_Z_m,rx_y_m,rx_x_m,tx_z_m,tx_y_m,tx_x_m\n"
                       "a,6,5,4,3,2,1\nb,9,8,7,0.0025,0.5,-1\n");
    expect_two(*state, "speaker_x_m,speaker_y_m,speaker_z_m,microphone_x_m,"
                       "microphone_y_m,microphone_z_m\n"
                       "1,2,3,4,5,6\n-1,0.5,0.0025,7,8,9\n");
}

/* As a spreadsheet writes them where decimals have commas. */
static void between_semicolons_or_tabs_a_comma_begins_the_decimals(void **state)
{
    expect_two(*state, "1,0;2,0;3,0;4,0;5,0;6,0\n-1,0;0,5;0,0025;7,0;8;9\n");
    expect_two(*state, "1,0\t2\t3\t4\t5\t6\n-1\t0,5\t2,5e-3\t7\t8\t9\n");
    expect_two(*state, "tx_x_m;tx_y_m;tx_z_m;rx_x_m;rx_y_m;rx_z_m\n"
                       "1,0;2;3;4;5;6\n-1,0;0,5;0,0025;7;8;9\n");
    expect_two(*state, "1,2,3;4,5,6\n-1,0.5,0.0025;7,8,9\n"); /* separators as before */
}

static void what_is_wrong_is_named_with_its_line(void **state)
{
    static const struct {
        const char *text, *place;
    } cases[] = {
        {"", "pings.csv: expected a line for each ping"},
        {"# nothing\n\n", "pings.csv: expected a line for each ping"},
        {"1,2,3,4,5\n", "pings.csv:1: 5 columns, expected 6"},
        {"1,2,3,4,5,6\n\n1,2,3,4,5,6,7\n", "pings.csv:3: 7 columns, expected 6"},
        {"1,2,3,4,5,6\n1,2,x,4,5,6\n", "pings.csv:2: tx_z_m is \"x\", expected metres"},
        {"1,2,3,4,5,nan\n", "pings.csv:1: rx_z_m is \"nan\""},
        {"1,2,3,4,5,6\n1,inf,3,4,5,6\n", "pings.csv:2: tx_y_m is \"inf\""},
        {"1,2,3,4,5,6\n1,2,3,4,,6\n", "pings.csv:2: rx_y_m is \"\""},
        {"tx_x_m,tx_y_m,rx_x_m,rx_y_m,rx_z_m\n",
         "pings.csv:1: the column tx_z_m is miss"},
        {"tx_x_m,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m\n",
         "pings.csv:1: the column tx_x_m is named twice"},
        {"tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m\n1,2,3,4,5,6,7\n",
         "pings.csv:2: 7 columns, expected 6"},
        {"0,4,0,0,0,1,0,3,0,0,0,1\n", "pings.csv:1: 12 columns, expected 6; where "
                                      "decimals have commas, put semicolons"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why;
        double(*p)[2][3];
        size_t n;
        assert_int_equal(load(*state, cases[i].text, &p, &n, &why), -EINVAL);
        if (!strstr(why.text, cases[i].place))
            fail_msg("\"%s\" has no \"%s\"", why.text, cases[i].place);
    }
}

static void a_missing_file_is_named(void **state)
{
    struct error why = {""};
    double(*p)[2][3];
    size_t n;
    assert_int_equal(pings_load(&p, &n, scratch_path(*state, "none.csv"), &why), -ENOENT);
    assert_non_null(strstr(why.text, "none.csv"));
}

static void there_is_an_end_to_pings(void **state)
{
    struct error why = {""};
    double(*p)[2][3];
    size_t n;
    const char *path = scratch_path(*state, "pings.csv");
    FILE *f = fopen(path, "w");
    for (int k = 0; k < SURVEY_MAX_PINGS; k++)
        fputs("1,2,3,4,5,6\n", f);
    fclose(f);
    assert_int_equal(pings_load(&p, &n, path, &why), 0);
    assert_int_equal(n, SURVEY_MAX_PINGS);
    free(p);
    f = fopen(path, "a");
    fputs("1,2,3,4,5,6\n", f);
    fclose(f);
    assert_int_equal(pings_load(&p, &n, path, &why), -EINVAL);
    assert_non_null(strstr(why.text, "pings.csv:65537: more than 65536 pings"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(six_numbers_a_line_are_a_ping),
        TEST(named_columns_may_stand_anywhere),
        TEST(between_semicolons_or_tabs_a_comma_begins_the_decimals),
        TEST(what_is_wrong_is_named_with_its_line),
        TEST(a_missing_file_is_named),
        TEST(there_is_an_end_to_pings),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
