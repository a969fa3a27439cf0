#include "nodes/rt/early.h"

#include <inttypes.h>

size_t early_count(const struct early *e, struct device_count *out)
{
    *out = (struct device_count){e->count, e->n};
    return 1;
}

void early_tell(struct early *e, const struct node *node)
{
    if (e->n > e->told)
        node_log(node, LOG_LEVEL_INFO, "%s, passed over: %" PRIu64, e->count,
                 e->n - e->told);
    e->told = e->n;
}
