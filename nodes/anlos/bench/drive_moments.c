#include "nodes/anlos/bench/drive_moments.h"

#include <errno.h>
#include <stdlib.h>

int drive_moments_add(struct drive_moments *m, const struct drive_moment *moment)
{
    if (m->n == m->room) {
        size_t room = m->room ? 2 * m->room : 256;
        struct drive_moment *at = realloc(m->at, room * sizeof *at);
        if (!at)
            return -ENOMEM;
        m->at = at;
        m->room = room;
    }
    m->at[m->n++] = *moment;
    return 0;
}
