/* SPDX-License-Identifier: MIT */
/* tests/nodes/recorder_rig.h -- a recorder without a bus: messages and times as the test
 * gives them. */
#ifndef ANLOS_TESTS_NODES_RECORDER_RIG_H
#define ANLOS_TESTS_NODES_RECORDER_RIG_H

#include "record_rig.h"

#define MS 1000000LL

struct rig {
    struct scratch *scratch;
    struct choice choice;
    struct session session;
    char bag[128];
    char part[128]; /* named last */
    char said[2048];
};

static inline int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scratch_open((void **)&r->scratch) ||
        choice_make(&r->choice, "*", NULL, NULL))
        return -1;
    r->session.topics = "*";
    r->session.start_ns = 1700000000123456789;
    snprintf(r->bag, sizeof r->bag, "%s/a.mcap", r->scratch->folder);
    *state = r;
    return 0;
}

static inline int teardown(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;

    choice_clear(&r->choice);
    session_clear(&r->session);
    free(r);
    return scratch_close(&scratch);
}

static inline void hear(void *context, enum log_level level, const char *text)
{
    struct rig *r = context;
    size_t used = strlen(r->said);

    (void)level;
    snprintf(r->said + used, sizeof r->said - used, "%s\n", text);
}

static inline struct recorder_config config(struct rig *r)
{
    return (struct recorder_config){.path = r->bag,
                                    .topics = r->choice.topics,
                                    .n_topics = r->choice.n,
                                    .flush_ns = 1000 * MS,
                                    .session = &r->session,
                                    .say = hear,
                                    .context = r};
}

static inline struct recorder *start(const struct recorder_config *cfg)
{
    struct error why = {""};
    struct recorder *r;

    if (recorder_create(&r, cfg, 0, &why))
        fail_msg("%s", why.text);
    return r;
}

static inline const char *part_path(struct rig *r, unsigned number)
{
    snprintf(r->part, sizeof r->part, "%s/a_%04u.mcap", r->scratch->folder, number);
    return r->part;
}

#define RIG_TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

#endif
