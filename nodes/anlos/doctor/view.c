#include "nodes/anlos/doctor/doctor.h"

#include <arpa/inet.h>
#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/* Takes the address for a moment.  0 or a negative errno. */
static int try_address(const char *address, unsigned port)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    int on = 1, fd;

    if (inet_pton(AF_INET, address, &to.sin_addr) != 1)
        return -EADDRNOTAVAIL;
    fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return -errno;
    int err = setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) ||
                      bind(fd, (struct sockaddr *)&to, sizeof to)
                  ? -errno
                  : 0;
    close(fd);
    return err;
}

void doctor_view(const void *ctx, struct findings *f)
{
    struct launchfile *l = doctor_load(ctx);

    if (l && doctor_runs(ctx, l, "view")) {
        int err = try_address(l->view.address, l->view.port);
        if (err == -EADDRINUSE) {
            finding_add(f, FINDING_NOTE, "view",
                        "%s:%u is in use, by a view that runs or "
                        "another program",
                        l->view.address, l->view.port);
            finding_todo(f, "'ss -ltnp' tells by whom; view.port chooses another");
        } else if (err) {
            finding_add(f, FINDING_WRONG, "view", "%s:%u: %s", l->view.address,
                        l->view.port, strerror(-err));
            finding_todo(f, "set view.address and view.port right in the launch file");
        } else {
            finding_add(f, FINDING_OK, "view", "the page will be at http://%s:%u",
                        l->view.address, l->view.port);
        }
    }
    launchfile_destroy(l);
}
