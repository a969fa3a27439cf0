/* SPDX-License-Identifier: MIT */
/* nodes/record/session.h -- what a recording says of itself, whatever is in it: who made
 * it when and with what, and the launch file with its inputs (msgs/bag/manifest.h). */
#ifndef ANLOS_NODES_RECORD_SESSION_H
#define ANLOS_NODES_RECORD_SESSION_H

#include <stdint.h>

#include "nodes/record/attachments.h"
#include "nodes/rt/launchfile.h"

struct session {                  /* starts as {0} */
    const char *topics, *exclude; /* patterns; exclude may be NULL */
    int64_t start_ns;
    char *launch; /* the launch file's attachment; NULL: none */
    struct attachments attachments;
};

/* Takes the launch file and what its array's URI names.  What cannot be read is left
 * out: *left_out says which (empty: nothing).  0, -ENOMEM, and errno of reading the
 * launch file itself. */
int session_add_launch(struct session *s, const struct launchfile *l,
                       struct error *left_out, struct error *why);

/* part: which file of the recording, from 1.  Errors of the writer. */
int session_write(const struct session *s, unsigned part, int64_t now_ns,
                  struct bag_writer *w, struct error *why);
void session_clear(struct session *s);

#endif
