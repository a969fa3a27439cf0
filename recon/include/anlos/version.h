/* SPDX-License-Identifier: MIT */
/* anlos/version.h -- which libanlos this is, and how it may change.
 *
 * Three numbers are the product's version: the last rises with repairs, the middle one
 * with additions.  ANLOS_ABI is that of the interface, and of the shared library
 * (libanlos.so.1): it rises when a program that was compiled before would not run any
 * more, and only then.
 *
 * Structures that a program fills in, or has filled in, begin with their size, as the
 * program was compiled with it:
 *
 *   struct anlos_ping ping = {.size = sizeof ping};
 *
 * They grow at their end alone, and what is added means by 0 what held before; so a
 * program may be older than the library.  It may not be newer: anlos_survey_create, with
 * which every program begins, is told the version of the headers and refuses that with a
 * sentence, and every function refuses a size that cannot be.
 *
 * Threads: a handle is used by one thread at a time; different handles by different
 * threads at once.  Many of them plan Fourier transforms with FFTW, whose planner is not
 * thread-safe: the library takes care of its own calls.  A program that plans with FFTW
 * itself, meanwhile in another thread, calls fftwf_make_planner_thread_safe() first.
 * The library reads no clock, file, environment or socket, and writes to none.
 *
 * Units are SI: _m, _s, _hz, _rad; time is int64_t nanoseconds from anything, 0 or later.
 * The array's frame: x along the stage (horizontal), y up along the array, z forward to
 * the wall. */
#ifndef ANLOS_VERSION_H
#define ANLOS_VERSION_H

#include <stdint.h>

#define ANLOS_ABI           1
#define ANLOS_VERSION_MAJOR 0
#define ANLOS_VERSION_MINOR 1
#define ANLOS_VERSION_PATCH 0
#define ANLOS_VERSION       "0.1.0"

/* All four, to be compared. */
#define ANLOS_VERSION_NUMBER                                                             \
    (((uint32_t)ANLOS_ABI << 24) | ((uint32_t)ANLOS_VERSION_MAJOR << 16) |               \
     ((uint32_t)ANLOS_VERSION_MINOR << 8) | (uint32_t)ANLOS_VERSION_PATCH)

#if defined(__GNUC__)
#define ANLOS_API __attribute__((visibility("default")))
#else
#define ANLOS_API
#endif

#ifdef __cplusplus
#define ANLOS_BEGIN extern "C" {
#define ANLOS_END   }
#else
#define ANLOS_BEGIN
#define ANLOS_END
#endif

ANLOS_BEGIN
/* Of the library that runs: ANLOS_VERSION and ANLOS_VERSION_NUMBER as it was built. */
ANLOS_API const char *anlos_version(void);
ANLOS_API uint32_t anlos_version_number(void);
ANLOS_END

#endif
