/* hal/alsa/report.h -- what the thread of a sound card has to tell: counts, whether the
 * card is there, and notices for a person.  Any thread may call any of it. */
#ifndef ANLOS_HAL_ALSA_REPORT_H
#define ANLOS_HAL_ALSA_REPORT_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "hal/device_count.h"
#include "dsp/complaint.h"

enum alsa_count {
    ALSA_OVERRUNS,
    ALSA_UNDERRUNS,
    ALSA_STALLS,
    ALSA_SLOTS_INVALID,
    ALSA_RESTARTS,
    ALSA_REOPENED,
    ALSA_SLOTS_SKIPPED, /* recorded, but nobody took them in time */
    ALSA_COUNTS
};

enum { ALSA_NOTICES = 4 };

struct alsa_report {
    pthread_mutex_t mutex;
    atomic_uint_fast64_t counts[ALSA_COUNTS];
    int away; /* 0, or the errno of what is wrong */
    struct complaint condition;
    struct complaint notices[ALSA_NOTICES]; /* a ring; the oldest makes room */
    size_t first, n;
};

int alsa_report_create(struct alsa_report *out);

/* Adds n, and returns the sum. */
uint64_t alsa_report_count(struct alsa_report *r, enum alsa_count what, uint64_t n);
size_t alsa_report_counts(struct alsa_report *r,
                          struct device_count out[DEVICE_MAX_COUNTS]);
void alsa_report_notice(struct alsa_report *r, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* The oldest notice that was not taken yet.  false: none. */
bool alsa_report_take(struct alsa_report *r, struct complaint *out);

/* err 0: all is well, and the text stays empty. */
void alsa_report_set(struct alsa_report *r, int err, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* What was set last. */
int alsa_report_condition(struct alsa_report *r, struct complaint *why);
void alsa_report_destroy(struct alsa_report *r);

#endif
