/* SPDX-License-Identifier: MIT */
/* msgs/bag/manifest.h -- the names under which a recording carries what it takes to
 * reconstruct it anywhere.  Each file of a recording that was split has all of it.
 *
 * Attachments
 *   survey.yaml              the survey of the first message, as survey_load reads it,
 *                            beside it whatever it names: calibration/SERIAL.txt,
 *                            survey.yaml-pings.csv, survey.yaml-replica.wav.  There
 *                            again when another survey comes: the last one counts
 *   launch/FILE              the launch file; the session says which one it is
 *   launch/PATH              what its array's URI names -- scene, rig, calibration --
 *                            under the path that it has there.  One that is absolute or
 *                            leaves the folder is launch/FILE
 *
 * Metadata
 *   anlos                    of the session: keys below
 *   anlos.survey             the survey in short: keys below
 *   anlos.snapshot           of a bag of the last seconds, for each request:
 *                            keys below
 *   anlos.loss               once for each flush interval in which messages were lost:
 *                            from_ns, to_ns (of the recorder's clock), topic -> count
 *   anlos.lost               at the end: topic -> lost in all, for every topic recorded,
 *                            0 too.  A bag without it was cut off: anlos.loss is there */
#ifndef ANLOS_MSGS_BAG_MANIFEST_H
#define ANLOS_MSGS_BAG_MANIFEST_H

/* Attachments. */
#define MANIFEST_SURVEY        "survey.yaml"
#define MANIFEST_CALIBRATION   "calibration" /* folder of the curves beside it */
#define MANIFEST_LAUNCH_FOLDER "launch/"

/* Metadata "anlos". */
#define MANIFEST_SESSION  "anlos"
#define MANIFEST_VERSION  "version"
#define MANIFEST_REVISION "revision" /* git's, "-dirty" if so; or the version */
#define MANIFEST_HOST     "host"
#define MANIFEST_STARTED  "started"    /* 2026-03-01T12:00:00.123456789Z */
#define MANIFEST_START_NS "started_ns" /* the same, since 1970 */
#define MANIFEST_LAUNCH   "launch"     /* the launch file's attachment; or not there */
#define MANIFEST_TOPICS   "topics"     /* patterns */
#define MANIFEST_EXCLUDE  "exclude"    /* patterns; may be empty */
#define MANIFEST_PART     "part"       /* which file of the recording, from 1 */

/* Metadata "anlos.survey": numbers as texts. */
#define MANIFEST_GEOMETRY    "anlos.survey"
#define MANIFEST_SURVEY_ID   "survey_id"     /* 16 hexadecimal digits */
#define MANIFEST_SOURCE      "source"        /* LIVE, SIMULATION or REPLAY */
#define MANIFEST_TEMPERATURE "temperature_c" /* not there: not known */
#define MANIFEST_SOUND_SPEED "sound_speed_m_s"
#define MANIFEST_RATE        "sample_rate_hz"
#define MANIFEST_SPEAKERS    "speakers"
#define MANIFEST_MICROPHONES "microphones"
#define MANIFEST_POSITIONS   "positions"  /* of the stage */
#define MANIFEST_STAGE_AXIS  "stage_axis" /* x, y, z */
#define MANIFEST_STAGE_FIRST "stage_first_m"
#define MANIFEST_STAGE_LAST  "stage_last_m"

/* Metadata "anlos.snapshot". */
#define MANIFEST_SNAPSHOT "anlos.snapshot"
#define MANIFEST_REASON   "reason"
#define MANIFEST_FROM     "from"     /* which node wants it; of a fault: which has it */
#define MANIFEST_AT_NS    "at_ns"    /* by the recorder's clock */
#define MANIFEST_BEFORE   "before_s" /* that was to be kept before, */
#define MANIFEST_KEPT     "kept_s"   /* what there was of it, */
#define MANIFEST_AFTER    "after_s"  /* and what is to come after */

/* Metadata "anlos.loss" and "anlos.lost". */
#define MANIFEST_LOSS    "anlos.loss"
#define MANIFEST_FROM_NS "from_ns"
#define MANIFEST_TO_NS   "to_ns"
#define MANIFEST_LOST    "anlos.lost"

#endif
