#include "nodes/view/hang_up.h"

#include <arpa/inet.h>
#include <dirent.h>
#include <stdlib.h>
#include <sys/socket.h>

static unsigned own_port(int fd)
{
    union {
        struct sockaddr any;
        struct sockaddr_in v4;
        struct sockaddr_in6 v6;
        struct sockaddr_storage room;
    } a;
    socklen_t size = sizeof a;

    if (getsockname(fd, &a.any, &size))
        return 0;
    return a.any.sa_family == AF_INET    ? ntohs(a.v4.sin_port)
           : a.any.sa_family == AF_INET6 ? ntohs(a.v6.sin6_port)
                                         : 0;
}

void hang_up(unsigned port)
{
    DIR *d = opendir("/proc/self/fd");

    if (!d)
        return;
    for (struct dirent *e = readdir(d); e; e = readdir(d)) {
        int fd = atoi(e->d_name);
        if (fd > 2 && port && own_port(fd) == port)
            shutdown(fd, SHUT_RDWR);
    }
    closedir(d);
}
