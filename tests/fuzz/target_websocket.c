/* SPDX-License-Identifier: MIT */
/* Bytes as what a client of the view node sends: a request by Foxglove's protocol, as
 * text and as binary, one of the page, and the headers that name a host. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/foxglove/request.h"
#include "nodes/view/server.h"
#include "tests/fuzz/fuzz.h"

/* It is shown to the client. */
static void require_printable(const char *text)
{
    FUZZ_REQUIRE(*text);
    for (; *text; text++)
        FUZZ_REQUIRE(*text >= ' ' && *text <= '~');
}

static void as_foxglove(const uint8_t *data, size_t size, bool binary)
{
    struct error why = {""};
    struct foxglove_request r;

    if (foxglove_request_parse(data, size, binary, &r, &why)) {
        require_printable(why.text);
        return;
    }
    FUZZ_REQUIRE(r.n <= FOXGLOVE_REQUEST_MAX_WISHES);
    foxglove_request_clear(&r);
}

static void as_page(const uint8_t *data, size_t size)
{
    struct request r;

    if (!request_parse(&r, data, size) && r.kind == REQUEST_SEEK)
        FUZZ_REQUIRE(isfinite(r.seek_s));
}

/* The first line is the host, the rest the origin. */
static void as_headers(const uint8_t *data, size_t size)
{
    char *text = malloc(size + 1);

    FUZZ_REQUIRE(text);
    memcpy(text, data, size);
    text[size] = '\0';
    char *origin = text;
    const char *host = strsep(&origin, "\n");
    guard_host(host, "127.0.0.1");
    guard_origin(origin, host);
    free(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    as_foxglove(data, size, false);
    as_foxglove(data, size, true);
    as_page(data, size);
    as_headers(data, size);
    return 0;
}
