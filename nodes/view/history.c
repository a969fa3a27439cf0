/* SPDX-License-Identifier: MIT */
#include "nodes/view/history.h"

#include <math.h>
#include <string.h>

#include "nodes/rt/export.h"
#include "nodes/rt/list_figures.h"

#define LEAST_STEP_NS 1000000

void history_roll(struct history *h, int64_t step_ns)
{
    memset(h, 0, sizeof *h);
    h->step_ns = step_ns;
    h->rolls = true;
}

void history_span(struct history *h, int64_t start_ns, int64_t end_ns)
{
    memset(h, 0, sizeof *h);
    h->start_ns = start_ns;
    h->step_ns = (end_ns - start_ns) / HISTORY_POINTS + 1;
    if (h->step_ns < LEAST_STEP_NS)
        h->step_ns = LEAST_STEP_NS;
}

static int64_t step_of(const struct history *h, int64_t at_ns)
{
    return (at_ns - h->start_ns) / h->step_ns + 1;
}

void history_take(struct history *h, const Anlos__DetectionList *list, int64_t capture_ns,
                  int64_t publish_ns, int64_t at_ns)
{
    int64_t step = step_of(h, at_ns);

    if (at_ns < h->start_ns || (!h->rolls && step > HISTORY_POINTS))
        return;
    struct history_point *p = &h->points[step % HISTORY_POINTS];
    if (p->step > step)
        return; /* it is long past */
    if (p->step < step)
        *p = (struct history_point){.step = step, .snr_db = NAN, .latency_s = NAN};
    struct list_figures f = list_figures(list, capture_ns, publish_ns);
    p->snr_db = fmax(p->snr_db, f.snr_db);
    p->latency_s = fmax(p->latency_s, f.latency_s);
    p->n_objects = f.n_objects > p->n_objects ? f.n_objects : p->n_objects;
}

json_t *history_json(const struct history *h, int64_t now_ns)
{
    int64_t first = h->rolls ? step_of(h, now_ns) - HISTORY_POINTS + 1 : 1;
    json_t *snr = json_array(), *latency = json_array(), *objects = json_array();
    bool any = false;

    for (int64_t step = first; step < first + HISTORY_POINTS; step++) {
        const struct history_point *p =
            &h->points[(step % HISTORY_POINTS + HISTORY_POINTS) % HISTORY_POINTS];
        bool there = step > 0 && p->step == step;
        any |= there;
        json_array_append_new(snr,
                              export_real(there ? round(10.0 * p->snr_db) / 10.0 : NAN));
        json_array_append_new(latency,
                              export_real(there ? round(1e3 * p->latency_s) : NAN));
        json_array_append_new(objects, there ? json_integer(p->n_objects) : json_null());
    }
    int64_t from_ns = h->start_ns + (first - 1) * h->step_ns;
    json_t *out = json_pack("{ss sf sf so so so}", "type", "history", "from_s",
                            1e-9 * (double)(from_ns - (h->rolls ? now_ns : h->start_ns)),
                            "step_s", 1e-9 * (double)h->step_ns, "snr_db", snr,
                            "latency_ms", latency, "objects", objects);
    if (any)
        return out;
    json_decref(out);
    return NULL;
}
