/* SPDX-License-Identifier: MIT */
/* nodes/scan/scan.h -- the scan as a state machine: messages and time in, commands and
 * status out.  It waits for the nodes it needs and for the survey; then, for each pass
 * (background first) and stage position: move, wait until settled, fire what is missing.
 * It goes on to the next position while receipts are on their way, but never has more
 * than `window` pings under way.  A ping that got lost is taken again, up to `retries`
 * times; a node that was restarted loses what it kept, and that is taken again too.
 * While the stage is in fault or held by hand the scan pauses, and nothing times out.
 *
 * Where the survey says that the stage does not stop, each pass is a run along all
 * positions, with as many pings under way as that has.  What got lost is taken again in
 * another run, from the round before the first to the one after the last of them. */
#ifndef ANLOS_NODES_SCAN_SCAN_H
#define ANLOS_NODES_SCAN_SCAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/array.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/stage.pb-c.h"
#include "msgs/survey.pb-c.h"

struct scan_config { /* also of a scan without end (nodes/scan/fixed_scan.h) */
    bool background;
    bool has_stage; /* else the array stands where the survey says */
    unsigned window, retries;
    double timeout_s;         /* without a ping or a receipt, what is under way is lost */
    double silence_s;         /* a node not heard of for so long is waited for */
    const char *const *needs; /* [n_needs] nodes to wait for */
    size_t n_needs;
    /* Of one without end, which asks the array again after timeout_s without a ping: */
    unsigned background_frames; /* to be recorded, from 1 */
    const uint32_t *speakers;   /* [n_speakers], in this order; must outlive it */
    size_t n_speakers;          /* 0: all */
};

struct scan_action { /* what to publish; the speakers are the scan's */
    bool move, fire;
    Anlos__StageCommand stage_command;
    Anlos__FireCommand fire_command;
};

struct scan;

/* 0, -ENOMEM. */
int scan_create(struct scan **out, const struct scan_config *cfg);

/* Every message, before it is handed to one of the functions below: its sender is alive,
 * and may have been restarted.  false: the message is void, a former process sent it. */
bool scan_hear(struct scan *s, const char *from, int64_t epoch_ns, int64_t now_ns);

/* Another survey than before starts the scan over.  0, -EINVAL, -ENOMEM. */
int scan_survey(struct scan *s, const Anlos__Survey *survey);
void scan_health(struct scan *s, const char *from, const Anlos__Health *health);
/* at_ns: when its position was true */
void scan_stage(struct scan *s, const Anlos__StageState *state, int64_t at_ns);
void scan_ping(struct scan *s, const Anlos__Ping *ping, int64_t now_ns);
void scan_receipt(struct scan *s, const Anlos__Receipt *receipt, int64_t now_ns);

/* What to do now.  Call after each message and at least every 100 ms. */
void scan_step(struct scan *s, int64_t now_ns, struct scan_action *out);

/* The text lives in s. */
void scan_status(const struct scan *s, int64_t now_ns, Anlos__ScanStatus *out);
void scan_destroy(struct scan *s);

#endif
