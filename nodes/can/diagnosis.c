/* SPDX-License-Identifier: MIT */
#include "nodes/can/diagnosis.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define SECOND_NS 1000000000LL

/* A node that said nothing for so long does nothing. */
#define SILENT_NS (3 * SECOND_NS)

void diagnosis_init(struct diagnosis *d, unsigned n_processors)
{
    *d = (struct diagnosis){.n_processors = n_processors,
                            .noise_db = NAN,
                            .snr_db = NAN,
                            .trouble = CAN_FAULTS - 1};
}

static struct diagnosis_node *find_node(struct diagnosis *d, const char *name)
{
    size_t i = 0;

    while (i < d->n_nodes && strcmp(d->nodes[i].name, name))
        i++;
    if (i == WATCH_MAX_NODES)
        return NULL;
    if (i == d->n_nodes)
        snprintf(d->nodes[d->n_nodes++].name, sizeof d->nodes->name, "%s", name);
    return &d->nodes[i];
}

/* Those that make the image: who looks on may miss what he likes. */
static bool is_on_the_way(const char *node)
{
    return !strcmp(node, "dsp") || !strcmp(node, "recon");
}

static uint64_t missed(const Anlos__Health *health)
{
    uint64_t n = 0;

    for (size_t i = 0; i < health->n_topics; i++) {
        const Anlos__TopicCount *t = health->topics[i];
        if (!t->published && (!strcmp(t->topic, "ping") || !strcmp(t->topic, "traces")))
            n += t->gaps + t->dropped;
    }
    return n;
}

/* A process that was started again has used less than before, and missed less. */
void diagnosis_health(struct diagnosis *d, const Anlos__Health *health, int64_t now_ns)
{
    struct diagnosis_node *n = find_node(d, health->node);

    if (health->sensing) {
        d->noise_db = health->sensing->noise_db;
        d->noise_ns = now_ns;
    }
    if (!n)
        return;
    if (health->cpu_s < n->cpu_s || now_ns - n->heard_ns >= SECOND_NS / 2) {
        n->before_ns = health->cpu_s < n->cpu_s ? 0 : n->heard_ns;
        n->cpu_before_s = n->cpu_s;
        n->heard_ns = now_ns;
        n->cpu_s = health->cpu_s;
    }
    if (!is_on_the_way(health->node))
        return;
    uint64_t dropped = missed(health);
    if (dropped < n->dropped)
        n->dropped_before += n->dropped;
    n->dropped = dropped;
}

void diagnosis_list(struct diagnosis *d, const Anlos__DetectionList *list)
{
    d->snr_db = NAN;
    for (size_t i = 0; i < list->n_detections; i++)
        d->snr_db = fmax(d->snr_db, list->detections[i]->level_db);
}

void diagnosis_scan(struct diagnosis *d, const Anlos__ScanStatus *status)
{
    d->lost_pings = status->pings_lost;
}

static double processors_used(const struct diagnosis *d, int64_t now_ns)
{
    double used = 0.0;

    for (size_t i = 0; i < d->n_nodes; i++) {
        const struct diagnosis_node *n = &d->nodes[i];
        if (n->before_ns && now_ns - n->heard_ns < SILENT_NS)
            used += (n->cpu_s - n->cpu_before_s) /
                    (1e-9 * (double)(n->heard_ns - n->before_ns));
    }
    return used;
}

static void next_trouble(struct diagnosis *d, const struct watch *w,
                         struct can_diagnosis *out)
{
    for (int i = 0; i < CAN_FAULTS; i++) {
        d->trouble = (d->trouble + 1) % CAN_FAULTS;
        if (!w->raised[d->trouble])
            continue;
        out->trouble = (uint8_t)(d->trouble + 1);
        out->trouble_present = w->faults >> d->trouble & 1;
        out->trouble_count = w->raised[d->trouble];
        return;
    }
}

double diagnosis_noise_db(const struct diagnosis *d, int64_t now_ns)
{
    return now_ns - d->noise_ns < SILENT_NS ? d->noise_db : NAN;
}

double diagnosis_snr_db(const struct diagnosis *d, const struct watch *w)
{
    return watch_faults(w) & 1u << CAN_FAULT_IMAGE_STALE ? NAN : d->snr_db;
}

void diagnosis_next(struct diagnosis *d, const struct watch *w, int64_t now_ns,
                    struct can_diagnosis *out)
{
    unsigned major = 0, minor = 0, patch = 0;
    uint64_t dropped = d->lost_pings;

    sscanf(ANLOS_VERSION, "%u.%u.%u", &major, &minor, &patch);
    for (size_t i = 0; i < d->n_nodes; i++)
        dropped += d->nodes[i].dropped_before + d->nodes[i].dropped;
    *out = (struct can_diagnosis){
        .cpu = d->n_nodes ? processors_used(d, now_ns) / d->n_processors : NAN,
        .snr_db = diagnosis_snr_db(d, w),
        .dropped = (uint16_t)dropped,
        .version_major = (uint8_t)major,
        .version_minor = (uint8_t)minor,
        .version_patch = (uint8_t)patch,
    };
    next_trouble(d, w, out);
}
