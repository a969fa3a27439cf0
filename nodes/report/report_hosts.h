/* nodes/report/report_hosts.h -- of a system on several machines: what each said last of
 * the others, how far apart their clocks are above all. */
#ifndef ANLOS_NODES_REPORT_REPORT_HOSTS_H
#define ANLOS_NODES_REPORT_REPORT_HOSTS_H

#include <jansson.h>

#include "msgs/host.pb-c.h"
#include "msgs/hosts.h"

struct report_hosts { /* zeroed: none */
    size_t n;
    Anlos__HostStatus *list[HOSTS_MAX]; /* owned */
};

/* Copies it.  0, -ENOMEM. */
int report_hosts_take(struct report_hosts *h, const Anlos__HostStatus *status);

/* Seconds by which the clock of one host is ahead of that of another; 0 when nobody has
 * measured it. */
double report_hosts_ahead_s(const struct report_hosts *h, const char *of,
                            const char *than);

/* An array, an object for each pair that was measured. */
json_t *report_hosts_json(const struct report_hosts *h);
void report_hosts_clear(struct report_hosts *h);

#endif
