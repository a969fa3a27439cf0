#include "hal/alsa/report.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

int alsa_report_create(struct alsa_report *out)
{
    memset(out, 0, sizeof *out);
    return -pthread_mutex_init(&out->mutex, NULL);
}

uint64_t alsa_report_count(struct alsa_report *r, enum alsa_count what, uint64_t n)
{
    return atomic_fetch_add(&r->counts[what], n) + n;
}

size_t alsa_report_counts(struct alsa_report *r,
                          struct device_count out[DEVICE_MAX_COUNTS])
{
    static const char *const names[ALSA_COUNTS] = {
        [ALSA_OVERRUNS] = "overruns",
        [ALSA_UNDERRUNS] = "underruns",
        [ALSA_STALLS] = "stalls",
        [ALSA_SLOTS_INVALID] = "slots_invalid",
        [ALSA_RESTARTS] = "restarts",
        [ALSA_REOPENED] = "reopened",
        [ALSA_SLOTS_SKIPPED] = "slots_skipped"};
    for (size_t i = 0; i < ALSA_COUNTS; i++)
        out[i] =
            (struct device_count){.name = names[i], .value = atomic_load(&r->counts[i])};
    return ALSA_COUNTS;
}

void alsa_report_notice(struct alsa_report *r, const char *format, ...)
{
    va_list args;
    pthread_mutex_lock(&r->mutex);
    if (r->n == ALSA_NOTICES) {
        r->first = (r->first + 1) % ALSA_NOTICES;
        r->n--;
    }
    struct complaint *notice = &r->notices[(r->first + r->n++) % ALSA_NOTICES];
    va_start(args, format);
    vsnprintf(notice->text, sizeof notice->text, format, args);
    va_end(args);
    pthread_mutex_unlock(&r->mutex);
}

bool alsa_report_take(struct alsa_report *r, struct complaint *out)
{
    pthread_mutex_lock(&r->mutex);
    bool there = r->n > 0;
    if (there) {
        *out = r->notices[r->first];
        r->first = (r->first + 1) % ALSA_NOTICES;
        r->n--;
    }
    pthread_mutex_unlock(&r->mutex);
    return there;
}

void alsa_report_set(struct alsa_report *r, int err, const char *format, ...)
{
    va_list args;
    pthread_mutex_lock(&r->mutex);
    r->away = err;
    va_start(args, format);
    vsnprintf(r->condition.text, sizeof r->condition.text, format, args);
    va_end(args);
    pthread_mutex_unlock(&r->mutex);
}

int alsa_report_condition(struct alsa_report *r, struct complaint *why)
{
    pthread_mutex_lock(&r->mutex);
    int err = r->away;
    if (err)
        complain(why, err, "%s", r->condition.text);
    pthread_mutex_unlock(&r->mutex);
    return err;
}

void alsa_report_destroy(struct alsa_report *r)
{
    pthread_mutex_destroy(&r->mutex);
}
