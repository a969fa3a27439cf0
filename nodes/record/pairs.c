/* SPDX-License-Identifier: MIT */
#include "nodes/record/pairs.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "hal/text_file.h"

void pairs_text(struct pairs *p, const char *key, const char *value)
{
    bag_map_put(&p->map, bytes_of(key), bytes_of(value));
}

void pairs_count(struct pairs *p, const char *key, uint64_t value)
{
    char text[24];

    snprintf(text, sizeof text, "%" PRIu64, value);
    pairs_text(p, key, text);
}

void pairs_stamp(struct pairs *p, const char *key, int64_t ns)
{
    char text[24];

    snprintf(text, sizeof text, "%" PRId64, ns);
    pairs_text(p, key, text);
}

void pairs_number(struct pairs *p, const char *key, double value)
{
    char text[DECIMAL_SIZE];

    if (!isnan(value))
        pairs_text(p, key, decimal_print(value, text));
}

int pairs_write(const struct pairs *p, const char *name, struct bag_writer *w,
                struct error *why)
{
    const struct bag_metadata m = {bytes_of(name), bytes_in(&p->map)};

    return p->map.failed ? error_say(why, -ENOMEM, "out of memory")
                         : bag_writer_metadata(w, &m, why);
}

void pairs_clear(struct pairs *p)
{
    bytes_free(&p->map);
}
