/* SPDX-License-Identifier: MIT */
/* nodes/rt/names.h -- what the states in messages are called wherever a person reads
 * them; one that is of no known value "unknown". */
#ifndef ANLOS_NODES_RT_NAMES_H
#define ANLOS_NODES_RT_NAMES_H

#include "msgs/detections.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/log.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/stage.pb-c.h"
#include "msgs/tensor.pb-c.h"
#include "msgs/wall.pb-c.h"

const char *name_of_source(Anlos__Source source);
const char *name_of_pass(Anlos__Pass pass);
const char *name_of_scan_state(Anlos__ScanStatus__State state);
const char *name_of_stage_state(Anlos__StageState__State state);
const char *name_of_health_state(Anlos__Health__State state);
const char *name_of_log_level(Anlos__Log__Level level);
const char *name_of_measurement(Anlos__Measurement measurement);
/* "" of a shape that is not known, or of no known value. */
const char *name_of_shape(Anlos__Shape shape);
const char *name_of_wall_origin(Anlos__Wall__Origin origin);

#endif
