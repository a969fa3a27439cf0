#include "nodes/view/guard.h"

#include <arpa/inet.h>
#include <stddef.h>
#include <string.h>
#include <strings.h>

#define SCHEME "http://"

/* The name or address in "name:port", "1.2.3.4:port", "[::1]:port".  false: too long, or
 * what follows is no port. */
static bool split(const char *host, char *out, size_t size)
{
    bool bracket = *host == '[';
    const char *start = host + bracket, *end = strpbrk(start, bracket ? "]" : ":");
    size_t n = end ? (size_t)(end - start) : strlen(start);

    if (n >= size || (bracket && !end))
        return false;
    memcpy(out, start, n);
    out[n] = '\0';
    if (!end)
        return n > 0;
    end += bracket;
    return n > 0 &&
           (!*end || (*end == ':' && strspn(end + 1, "0123456789") == strlen(end + 1)));
}

bool guard_host(const char *host, const char *address)
{
    unsigned char binary[sizeof(struct in6_addr)];
    char name[256];

    if (!host || !split(host, name, sizeof name))
        return false;
    if (*host == '[')
        return inet_pton(AF_INET6, name, binary) == 1;
    return !strcasecmp(name, "localhost") || !strcasecmp(name, address) ||
           inet_pton(AF_INET, name, binary) == 1;
}

bool guard_origin(const char *origin, const char *host)
{
    const size_t n = sizeof SCHEME - 1;

    return !origin ||
           (host && !strncasecmp(origin, SCHEME, n) && !strcasecmp(origin + n, host));
}
