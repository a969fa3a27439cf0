#include "nodes/foxglove/origin.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#define HOST_SIZE 256

/* The host of "host:port", without the port and an address's brackets.  false: it is
 * none. */
static bool take_host(const char *from, char out[HOST_SIZE])
{
    bool bracket = *from == '[';
    size_t n = strcspn(from + bracket, bracket ? "]" : ":/");

    if (!n || n >= HOST_SIZE)
        return false;
    memcpy(out, from + bracket, n);
    out[n] = '\0';
    return true;
}

static bool is_address(const char *host)
{
    unsigned char address[sizeof(struct in6_addr)];

    return inet_pton(AF_INET, host, address) == 1 ||
           inet_pton(AF_INET6, host, address) == 1;
}

static bool is_here(const char *host)
{
    struct in_addr address;

    if (!strcasecmp(host, "localhost") || !strcmp(host, "::1"))
        return true;
    return inet_pton(AF_INET, host, &address) == 1 && ntohl(address.s_addr) >> 24 == 127;
}

static bool is_foxglove(const char *host)
{
    static const char domain[] = ".foxglove.dev";
    size_t n = strlen(host), m = sizeof domain - 1;

    return n > m && !strcasecmp(host + n - m, domain);
}

bool origin_is_allowed(const char *origin, const char *host)
{
    char page[HOST_SIZE], asked[HOST_SIZE];

    if (!origin || !strcmp(origin, "file://"))
        return true;
    const char *rest = strstr(origin, "://");
    if (!rest || !take_host(rest + 3, page))
        return false;
    if (is_here(page))
        return true;
    if (is_foxglove(page))
        return !strncasecmp(origin, "https://", 8);
    return host && take_host(host, asked) && is_address(page) && !strcmp(page, asked);
}
