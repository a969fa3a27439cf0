/* SPDX-License-Identifier: MIT */
/* tests/hal/canbus_count.h -- what a CAN bus counts, by its name. */
#ifndef ANLOS_TESTS_HAL_CANBUS_COUNT_H
#define ANLOS_TESTS_HAL_CANBUS_COUNT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "hal/canbus.h"

static inline uint64_t canbus_count(struct canbus *b, const char *name)
{
    struct device_count counts[CANBUS_MAX_COUNTS];
    size_t n = canbus_counts(b, counts);

    for (size_t i = 0; i < n; i++)
        if (!strcmp(counts[i].name, name))
            return counts[i].value;
    fail_msg("nothing counts %s", name);
    return 0;
}

#endif
