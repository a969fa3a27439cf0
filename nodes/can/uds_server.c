/* SPDX-License-Identifier: MIT */
#include "nodes/can/uds_server.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/can/uds.h"
#include "nodes/rt/uri.h"

enum {
    REQUEST_SIZE = 64, /* any that is longer has a wrong length */
    REQUESTS = 8,      /* in one step */
};

_Static_assert(REQUEST_SIZE > 1 + 2 * UDS_MAX_IDENTIFIERS, "a request may be longer");

int uds_server_open(struct uds_server *s, const struct launchfile *l,
                    const struct watch *w, struct error *why)
{
    struct error inner = {""};

    if (!l->can.diagnosis.request)
        return 0;
    char *interface = uri_path(l->can.uri);
    if (!interface)
        return error_say(why, -ENOMEM, "out of memory");
    const struct isotp_address address = {.interface = interface,
                                          .request = l->can.diagnosis.request,
                                          .response = l->can.diagnosis.response,
                                          .functional = l->can.diagnosis.functional};
    int err = isotp_open(&s->link, &address, &inner);
    if (err)
        error_say(why, err, "%.900s; without can.diagnosis none is needed", inner.text);
    free(interface);
    trouble_init(&s->memory, watch_tested(w));
    return err;
}

static void look(struct freeze_frame *out, const struct watch *w,
                 const struct diagnosis *d, int64_t now_ns, int64_t ahead_ns)
{
    const int64_t unix_ns = now_ns + ahead_ns;

    *out = (struct freeze_frame){
        .unix_ms = unix_ns > 0 ? (uint64_t)(unix_ns / 1000000) : 0,
        .state = watch_state(w),
        .faults = watch_faults(w),
        .latency_s = w->n_lists ? 1e-9 * ((double)w->list_ns - (double)w->capture_ns)
                                : NAN,
        .noise_db = diagnosis_noise_db(d, now_ns),
        .snr_db = diagnosis_snr_db(d, w),
        .range_m = watch_range_m(w),
        .temperature_c = watch_temperature_c(w),
    };
}

static int answer(struct uds_server *s, const struct freeze_frame *now,
                  const uint8_t *request, size_t size, bool functional)
{
    uint8_t data[UDS_ANSWER_SIZE];
    size_t n;
    int refusal = uds_answer(&s->memory, now, request, size, functional, data, &n);

    s->requests++;
    s->refused += refusal != 0;
    s->cleared += !refusal && request[0] == UDS_CLEAR;
    int err = n ? isotp_send(s->link, data, n) : 0;
    s->unsent += err != 0;
    return err;
}

int uds_server_step(struct uds_server *s, const struct watch *w,
                    const struct diagnosis *d, int64_t now_ns, int64_t ahead_ns)
{
    uint8_t request[REQUEST_SIZE];
    struct freeze_frame now;
    bool functional;
    size_t size;
    int err = 0;

    if (!s->link)
        return 0;
    look(&now, w, d, now_ns, ahead_ns);
    trouble_step(&s->memory, &now, w->begun, now_ns);
    for (int i = 0; i < REQUESTS; i++) {
        if (isotp_receive(s->link, request, sizeof request, &size, &functional, now_ns))
            break;
        int sent = answer(s, &now, request, size, functional);
        err = sent ? sent : err;
    }
    return err;
}

size_t uds_server_counts(const struct uds_server *s,
                         struct device_count out[UDS_SERVER_COUNTS])
{
    if (!s->link)
        return 0;
    out[0] = (struct device_count){"diagnosis_requests", s->requests};
    out[1] = (struct device_count){"diagnosis_refused", s->refused};
    out[2] = (struct device_count){"diagnosis_unsent", s->unsent};
    out[3] = (struct device_count){"diagnosis_broken", isotp_broken(s->link)};
    return UDS_SERVER_COUNTS;
}

void uds_server_close(struct uds_server *s)
{
    isotp_close(s->link);
}
