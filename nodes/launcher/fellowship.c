#include "nodes/launcher/fellowship.h"

#include <stdio.h>

#include "nodes/rt/exit_code.h"

#define TELL_NS 500000000LL

int fellowship_open(struct fellowship *f, struct bus *bus, const struct hosts *hosts,
                    int64_t epoch_ns, uint64_t launch_file)
{
    *f = (struct fellowship){.bus = bus};
    fellows_init(&f->fellows, hosts, epoch_ns, launch_file);
    return f->fellows.n ? bus_subscribe(bus, topic_host()) : 0;
}

void fellowship_hear(struct fellowship *f, const ProtobufCMessage *m,
                     const struct envelope *e, int64_t now_ns)
{
    fellows_hear(&f->fellows, (const Anlos__HostStatus *)m, e->epoch_ns, e->publish_ns,
                 now_ns);
}

int64_t fellowship_tell(struct fellowship *f, int64_t now_ns)
{
    Anlos__HostStatus status;

    if (!f->fellows.n)
        return INT64_MAX;
    if (now_ns >= f->tell_ns) {
        fellows_say(&f->fellows, &status);
        bus_publish_message(f->bus, topic_host(), 0, now_ns, &status.base);
        f->tell_ns = now_ns + TELL_NS;
    }
    return f->tell_ns;
}

void fellowship_end(struct fellowship *f, int exit_code, const char *results,
                    int64_t now_ns)
{
    char text[FELLOWS_TEXT_SIZE] = "stopped";
    Anlos__HostStatus__State state = ANLOS__HOST_STATUS__STATE__LEFT;

    if (exit_code == EXIT_WORKED) {
        state = ANLOS__HOST_STATUS__STATE__DONE;
        snprintf(text, sizeof text, results ? "done, results are in %.150s" : "done",
                 results);
    } else if (exit_code <= 128) { /* else a signal */
        state = ANLOS__HOST_STATUS__STATE__FAILED;
        snprintf(text, sizeof text, "ended with exit code %d", exit_code);
    }
    fellows_end(&f->fellows, state, text, now_ns);
    f->tell_ns = now_ns;
}

bool fellowship_may_leave(const struct fellowship *f, int64_t now_ns)
{
    return fellows_may_leave(&f->fellows, now_ns);
}
