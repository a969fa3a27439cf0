/* hal/alsa/engine.h -- the thread that keeps a sound card going: silence between the
 * shots, a shot at the next free frame, a new start after a break, and new tries while
 * the card is gone.  The calls below are for one other thread. */
#ifndef ANLOS_HAL_ALSA_ENGINE_H
#define ANLOS_HAL_ALSA_ENGINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/alsa/report.h"
#include "hal/alsa/shot.h"
#include "hal/clock.h"
#include "hal/survey/rig_file.h"

struct alsa_engine;

/* Opens the device and starts the thread.  rig and clock must live on; the clock is asked
 * by the thread.  Errors are those of alsa_stream_open, and -ENOMEM. */
int alsa_engine_create(struct alsa_engine **out, const char *device,
                       const struct rig *rig, const struct clock_source *clock,
                       struct complaint *why);

/* What it plays and records, to be fired and read. */
struct alsa_shot *alsa_engine_shot(struct alsa_engine *e);
struct alsa_report *alsa_engine_report(struct alsa_engine *e);

/* Waits until slot k of the shot is settled.  0, -EINTR (a signal), -EAGAIN (the card is
 * away; the complaint says what is done about it, and what is left of the shot follows
 * when it is back). */
int alsa_engine_wait(struct alsa_engine *e, size_t k, struct complaint *why);

/* Ends the thread within the time of a period, dropping what was not played. */
void alsa_engine_destroy(struct alsa_engine *e);

#endif
