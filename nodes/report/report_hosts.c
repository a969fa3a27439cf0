#include "nodes/report/report_hosts.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/rt/export.h"

int report_hosts_take(struct report_hosts *h, const Anlos__HostStatus *status)
{
    size_t i = 0, size = anlos__host_status__get_packed_size(status);
    uint8_t *bytes = malloc(size ? size : 1);

    if (!bytes)
        return -ENOMEM;
    anlos__host_status__pack(status, bytes);
    Anlos__HostStatus *fresh = anlos__host_status__unpack(NULL, size, bytes);
    free(bytes);
    if (!fresh)
        return -ENOMEM;
    while (i < h->n && strcmp(h->list[i]->host, fresh->host) != 0)
        i++;
    if (i == HOSTS_MAX) { /* a stranger */
        anlos__host_status__free_unpacked(fresh, NULL);
        return 0;
    }
    if (i == h->n)
        h->n++;
    else
        anlos__host_status__free_unpacked(h->list[i], NULL);
    h->list[i] = fresh;
    return 0;
}

/* What one host has measured of another; NULL: nothing. */
static const Anlos__HostSight *find(const struct report_hosts *h, const char *by,
                                    const char *of)
{
    for (size_t i = 0; i < h->n; i++)
        for (size_t k = 0; k < h->list[i]->n_sights; k++) {
            const Anlos__HostSight *s = h->list[i]->sights[k];
            if (!strcmp(h->list[i]->host, by) && !strcmp(s->host, of) &&
                s->round_trip_s != 0.0)
                return s;
        }
    return NULL;
}

double report_hosts_ahead_s(const struct report_hosts *h, const char *of,
                            const char *than)
{
    const Anlos__HostSight *one = find(h, than, of), *other = find(h, of, than);

    return one ? one->clock_ahead_s : other ? -other->clock_ahead_s : 0.0;
}

json_t *report_hosts_json(const struct report_hosts *h)
{
    json_t *list = json_array();

    for (size_t i = 0; i < h->n; i++)
        for (size_t k = 0; k < h->list[i]->n_sights; k++) {
            const Anlos__HostSight *s = h->list[i]->sights[k];
            json_t *o = json_object();
            json_object_set_new(o, "host", json_string(s->host));
            json_object_set_new(o, "seen_by", json_string(h->list[i]->host));
            json_object_set_new(o, "clock_ahead_s", export_real(s->clock_ahead_s));
            json_object_set_new(o, "round_trip_s", export_real(s->round_trip_s));
            json_object_set_new(o, "silences", json_integer((json_int_t)s->silences));
            json_array_append_new(list, o);
        }
    return list;
}

void report_hosts_clear(struct report_hosts *h)
{
    for (size_t i = 0; i < h->n; i++)
        anlos__host_status__free_unpacked(h->list[i], NULL);
    *h = (struct report_hosts){0};
}
