/* SPDX-License-Identifier: MIT */
/* Bytes as what a diagnostic tester asks, request after request: each begins with a byte
 * of its length (its low 6 bits), whether all were asked (40), and whether something
 * fails at that time (80). */
#include <stdlib.h>
#include <string.h>

#include "nodes/can/uds.h"
#include "tests/fuzz/fuzz.h"

static void check_answer(const uint8_t *request, size_t size, const uint8_t *answer,
                         size_t n, int refusal)
{
    FUZZ_REQUIRE(n <= UDS_ANSWER_SIZE);
    if (!n)
        return;
    FUZZ_REQUIRE(size > 0);
    if (refusal)
        FUZZ_REQUIRE(n == 3 && answer[0] == 0x7f && answer[1] == request[0] &&
                     answer[2] == refusal);
    else
        FUZZ_REQUIRE(answer[0] == (request[0] | 0x40));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct trouble_memory m;
    uint8_t answer[UDS_ANSWER_SIZE];
    int64_t now_ns = 0;

    trouble_init(&m, (1u << CAN_FAULTS) - 1);
    while (size > 0) {
        const uint8_t kind = *data++;
        size_t length = kind & 0x3f, n;
        size--;
        length = length > size ? size : length;
        const struct freeze_frame now = {
            .faults = kind & 0x80 ? (uint16_t)(kind << 3 | kind) : 0};
        trouble_step(&m, &now, true, now_ns += 1000000000);
        uint8_t *request = malloc(length ? length : 1); /* not a byte behind it */
        FUZZ_REQUIRE(request);
        memcpy(request, data, length);
        int refusal = uds_answer(&m, &now, request, length, kind & 0x40, answer, &n);
        check_answer(request, length, answer, n, refusal);
        free(request);
        data += length;
        size -= length;
    }
    return 0;
}
