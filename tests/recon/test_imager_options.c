/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "recon/imaging/imager.h"

static struct imager_options set(const char *text)
{
    struct imager_options o;
    char why[512] = "";
    imager_options_default(&o);
    if (imager_option_set(&o, text, why, sizeof why))
        fail_msg("%s", why);
    return o;
}

static void expect_refusal(const char *text, const char *part)
{
    struct imager_options o, before;
    char why[512] = "";
    imager_options_default(&o);
    before = o;
    assert_int_equal(imager_option_set(&o, text, why, sizeof why), -EINVAL);
    if (!strstr(why, part))
        fail_msg("\"%s\" has no \"%s\"", why, part);
    assert_memory_equal(&o, &before, sizeof o);
}

static void each_kind_of_value_is_taken(void **state)
{
    (void)state;
    assert_true(set("l1=0.25").l1 == 0.25);
    assert_true(set("tv=0").tv == 0.0);
    assert_true(set("rho=1e3").rho == 1000.0);
    assert_true(set("snr_db=-5").snr_db == -5.0);
    assert_true(set("tolerance=1e-4").tolerance == 1e-4);
    assert_true(set("coherence=1").coherence == 1.0);
    assert_int_equal(set("iterations=17").iterations, 17);
    assert_true(set("tv_isotropic=yes").tv_isotropic);
    assert_true(set("tv_isotropic=true").tv_isotropic);
    assert_false(set("tv_isotropic=no").tv_isotropic);
    assert_int_equal(set("lightcone=always").lightcone, 1);
    assert_int_equal(set("lightcone=never").lightcone, 0);
    assert_int_equal(set("lightcone=auto").lightcone, -1);
    assert_string_equal(set("base=lct").base, "lct");
}

static void the_base_outlives_the_text(void **state)
{
    (void)state;
    char text[] = "base=paper";
    struct imager_options o = set(text);
    memset(text, 'x', sizeof text - 1);
    assert_string_equal(o.base, "paper");
}

static void what_is_wrong_is_said_with_what_is_right(void **state)
{
    (void)state;
    expect_refusal("l2=1", "l2: no such option; expected one of base, iterations");
    expect_refusal("", "no such option");
    expect_refusal("=1", "no such option");
    expect_refusal("l=1", "l: no such option"); /* a beginning is no name */
    expect_refusal("l1", "expected l1=VALUE, with a value of 0 to 1");
    expect_refusal("l1=", "l1=: expected 0 to 1");
    expect_refusal("l1=1.5", "l1=1.5: expected 0 to 1");
    expect_refusal("l1=-0.1", "expected 0 to 1");
    expect_refusal("l1=nan", "expected 0 to 1");
    expect_refusal("l1=0.1x", "expected 0 to 1");
    expect_refusal("iterations=0", "a whole number, 1 to 100000");
    expect_refusal("iterations=1.5", "a whole number");
    expect_refusal("tv_isotropic=maybe", "one of yes, no");
    expect_refusal("lightcone=1", "one of auto, never, always");
    expect_refusal("base=iterative", "one of fast, backprojection");
    expect_refusal("base=", "one of fast");
}

static void every_option_takes_its_own_default(void **state)
{
    (void)state;
    struct imager_options defaults;
    imager_options_default(&defaults);
    for (const struct imager_option *i = imager_option_table; i->name; i++) {
        char value[64], text[128], again[64];
        imager_option_value(i, &defaults, value, sizeof value);
        snprintf(text, sizeof text, "%s=%s", i->name, value);
        struct imager_options o = set(text);
        imager_option_value(i, &o, again, sizeof again);
        assert_string_equal(again, value);
        for (const char *m = i->methods; *m; m += strlen(m) + 1)
            assert_true(imager_has_method(m));
    }
}

static void only_what_was_set_counts_as_given(void **state)
{
    (void)state;
    struct imager_options o = set("tv=0.01");
    assert_true(imager_option_is_given(&o, "tv"));
    assert_false(imager_option_is_given(&o, "l1"));
    assert_false(imager_option_is_given(&o, "nothing"));
}

static int check(const char *text, const char *base, const char *method, char why[256])
{
    struct imager_options o = set(text);
    o.base = base;
    why[0] = '\0';
    return imager_options_check(&o, method, why, 256);
}

static void an_option_belongs_to_methods(void **state)
{
    (void)state;
    char why[256];
    assert_int_equal(check("l1=0.1", "fast", "iterative", why), 0);
    assert_int_equal(check("l1=0.1", "fast", "sparse", why), 0);
    assert_int_equal(check("l1=0.1", "fast", "fast", why), -EINVAL);
    assert_string_equal(why,
                        "l1: method 'fast' does not use it; it is for iterative, sparse");
    assert_int_equal(check("tv=0.1", "fast", "sparse", why), -EINVAL);
}

static void iterative_takes_the_options_of_its_base(void **state)
{
    (void)state;
    char why[256];
    assert_int_equal(check("lightcone=never", "paper", "iterative", why), 0);
    assert_int_equal(check("lightcone=never", "fast", "iterative", why), -EINVAL);
    assert_int_equal(check("coherence=1", "backprojection", "iterative", why), 0);
    assert_int_equal(check("coherence=1", "backprojection", "paper", why), -EINVAL);
    /* the operator has no Wiener filter */
    assert_int_equal(check("snr_db=3", "lct", "iterative", why), -EINVAL);
    assert_int_equal(check("snr_db=3", "lct", "lct", why), 0);
}

static void methods_are_known_by_name(void **state)
{
    (void)state;
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
        assert_true(imager_has_method(m));
    assert_false(imager_has_method("magic"));
    assert_false(imager_has_method(""));
    assert_false(imager_has_method("fas"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_kind_of_value_is_taken),
        cmocka_unit_test(the_base_outlives_the_text),
        cmocka_unit_test(what_is_wrong_is_said_with_what_is_right),
        cmocka_unit_test(every_option_takes_its_own_default),
        cmocka_unit_test(only_what_was_set_counts_as_given),
        cmocka_unit_test(an_option_belongs_to_methods),
        cmocka_unit_test(iterative_takes_the_options_of_its_base),
        cmocka_unit_test(methods_are_known_by_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
