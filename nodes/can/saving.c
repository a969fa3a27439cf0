/* SPDX-License-Identifier: MIT */
#include "nodes/can/saving.h"

#include <stdio.h>

static const char *const reasons[] = {
    [CAN_UNSPECIFIED] = "no reason given",
    [CAN_DRIVER] = "driver",
    [CAN_COLLISION] = "collision",
    [CAN_EMERGENCY_BRAKING] = "emergency braking",
    [CAN_EVASION] = "evasion",
    [CAN_MISSED_OBJECT] = "missed object",
    [CAN_FALSE_OBJECT] = "false object",
    [CAN_TEST] = "test",
};

static const char *reason_text(enum can_reason reason)
{
    size_t i = (size_t)reason;

    return reasons[i < sizeof reasons / sizeof *reasons ? i : CAN_UNSPECIFIED];
}

static void fail(struct saving *s, const char *why)
{
    snprintf(s->failed, sizeof s->failed, "the vehicle's request to save (%s): %s",
             s->reason, why);
    s->id = 0;
    s->unsaved++;
}

void saving_begin(struct saving *s, const struct can_save_request *request,
                  int64_t now_ns)
{
    if (s->id)
        s->unsaved++;
    snprintf(s->reason, sizeof s->reason, "vehicle, %s, %u", reason_text(request->reason),
             (unsigned)request->number);
    s->id = now_ns ? (uint64_t)now_ns : 1;
    s->next_ns = now_ns;
    s->end_ns = now_ns + SAVING_NS;
    s->failed[0] = s->answer[0] = '\0';
    s->asked++;
}

bool saving_due(struct saving *s, int64_t now_ns, Anlos__SaveRequest *out)
{
    if (!s->id || now_ns < s->next_ns)
        return false;
    s->next_ns = now_ns + SAVING_AGAIN;
    anlos__save_request__init(out);
    out->id = s->id;
    out->reason = s->reason;
    return true;
}

bool saving_status(struct saving *s, const Anlos__SaveStatus *status)
{
    if (!s->id || status->request_id != s->id)
        return false;
    if (status->error[0]) {
        snprintf(s->answer, sizeof s->answer, "%.150s", status->error);
        return false;
    }
    s->id = 0;
    return true;
}

bool saving_ends(struct saving *s, int64_t now_ns)
{
    if (!s->id || now_ns < s->end_ns)
        return false;
    fail(s, s->answer[0] ? s->answer
                         : "nobody keeps the last seconds (anlos launch --snapshot)");
    return true;
}

void saving_counts(const struct saving *s, struct device_count out[SAVING_COUNTS])
{
    out[0] = (struct device_count){"saves_asked", s->asked};
    out[1] = (struct device_count){"saves_failed", s->unsaved};
}
