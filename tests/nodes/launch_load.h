/* SPDX-License-Identifier: MIT */
/* tests/nodes/launch_load.h -- a launch file out of a text: loaded, or refused. */
#ifndef ANLOS_TESTS_NODES_LAUNCH_LOAD_H
#define ANLOS_TESTS_NODES_LAUNCH_LOAD_H

#include "tests/hal/scratch.h"

#include <errno.h>

#include "nodes/rt/launchfile.h"

static inline struct launchfile *launch_load_with(struct scratch *s, const char *text,
                                                  const struct launchfile_options *o)
{
    struct error why = {""};
    struct launchfile *l = NULL;

    if (launchfile_load(&l, scratch_write(s, "a.yaml", text), o, &why))
        fail_msg("%s", why.text);
    return l;
}

static inline struct launchfile *launch_load(struct scratch *s, const char *text)
{
    return launch_load_with(s, text, NULL);
}

/* Loading fails, and the error is the path and then exactly this. */
static inline void assert_refused(struct scratch *s, const char *text, const char *rest)
{
    struct error why = {""};
    struct launchfile *l = NULL;
    const char *path = scratch_write(s, "a.yaml", text);

    assert_int_equal(launchfile_load(&l, path, NULL, &why), -EINVAL);
    assert_null(l);
    assert_error(why.text, path, rest);
}

#endif
