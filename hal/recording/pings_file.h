/* SPDX-License-Identifier: MIT */
/* hal/recording/pings_file.h -- pings.csv: where speaker and microphone stood for each
 * ping, for arrays that no stage carries along a line (turntables, hand-held, towed).
 *
 * One line a ping, in the order of emission: six numbers, speaker x, y, z and microphone
 * x, y, z in m.  A first line may name the columns: tx_x_m tx_y_m tx_z_m rx_x_m rx_y_m
 * rx_z_m (or speaker_x_m ..., microphone_x_m ...) in any order, among others, which are
 * left alone.  Separated by commas, semicolons or tabs; empty lines and those that begin
 * with # do not count. */
#ifndef ANLOS_HAL_RECORDING_PINGS_FILE_H
#define ANLOS_HAL_RECORDING_PINGS_FILE_H

#include <stddef.h>

#include "dsp/error.h"

/* *out: [*n][speaker, microphone], 1 to SURVEY_MAX_PINGS; free() it.  The error is
 * "file:line: what was expected".  0, -EINVAL, -ENOENT and other errno of reading,
 * -ENOMEM. */
int pings_load(double (**out)[2][3], size_t *n, const char *path, struct error *why);

/* Writes pings[n][speaker, microphone] to PATH-pings.csv.  0, -ENOMEM, other negative
 * errno. */
int pings_save(const double (*pings)[2][3], size_t n, const char *path);

#endif
