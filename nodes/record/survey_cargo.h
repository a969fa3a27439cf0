/* nodes/record/survey_cargo.h -- the geometry of a recording as files and in short
 * (msgs/bag/manifest.h), from a message of topic "survey". */
#ifndef ANLOS_NODES_RECORD_SURVEY_CARGO_H
#define ANLOS_NODES_RECORD_SURVEY_CARGO_H

#include "msgs/survey.pb-c.h"
#include "nodes/record/cargo.h"
#include "nodes/record/pairs.h"

struct survey_cargo { /* starts as {0} */
    uint64_t id;      /* of the survey; 0: none yet */
    struct cargo files;
    struct pairs geometry;
};

/* Is it another survey than the one before? */
bool survey_cargo_is_news(const struct survey_cargo *s, const Anlos__Survey *m);

/* Takes it, in the place of the one before, by way of a folder in $TMPDIR or /tmp.
 * 0, -EINVAL (does not pass survey_check), -ENOMEM, errno of files; then it has none. */
int survey_cargo_take(struct survey_cargo *s, const Anlos__Survey *m,
                      struct complaint *why);

/* Nothing while there is no survey.  Errors of the writer. */
int survey_cargo_write(const struct survey_cargo *s, int64_t now_ns, struct bag_writer *w,
                       struct complaint *why);
void survey_cargo_clear(struct survey_cargo *s);

#endif
