/* SPDX-License-Identifier: MIT */
#include "hal/decimal.h"

#include <stdio.h>
#include <stdlib.h>

const char *decimal_print(double x, char out[DECIMAL_SIZE])
{
    for (int digits = 6; digits <= 17; digits++) {
        snprintf(out, DECIMAL_SIZE, "%.*g", digits, x);
        if (strtod(out, NULL) == x)
            break;
    }
    return out;
}
