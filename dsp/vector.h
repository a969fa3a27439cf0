/* SPDX-License-Identifier: MIT */
/* dsp/vector.h -- hot loops compiled for several instruction sets, the best one chosen
 * when the program is loaded: the build stays plain x86-64 and runs anywhere.  Plain code
 * on other machines, with compilers that cannot, and under sanitizers (their runtime is
 * not up yet when the loader chooses). */
#ifndef ANLOS_DSP_VECTOR_H
#define ANLOS_DSP_VECTOR_H

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) ||               \
    __has_feature(undefined_behavior_sanitizer)
#define VECTOR_SANITIZED 1
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define VECTOR_SANITIZED 1
#endif

/* By features, never by a processor's name: GCC chooses "arch=haswell" on a Haswell
 * alone, and plain code on everything newer.  Not with clang 14: two static loops of one
 * name in two files get one resolver, and the link fails. */
#if !defined(__x86_64__) || !defined(__linux__) || defined(VECTOR_SANITIZED)
#define VECTOR_CLONES
#elif !defined(__clang__) && __GNUC__ >= 12
#define VECTOR_CLONES                                                                    \
    __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define VECTOR_CLONES
#endif

/* A part of such a loop: compiled into each version of its callers. */
#define VECTOR_INLINE static inline __attribute__((always_inline))

/* 16 floats at once, in as many registers as the machine needs, at any float's address.
 * For locals of VECTOR_CLONES functions, never for arguments, and not for sums that live
 * across a loop: GCC 12 keeps those in memory where the machine's registers are shorter
 * (AVX2: 20 times slower).  A float[VECTOR_LANES] and an inner loop over it become
 * registers of any length. */
#define VECTOR_LANES 16
typedef float vector16 __attribute__((vector_size(64), aligned(4), may_alias));

/* Before a loop over lanes whose passes do not touch each other's data, which the
 * compiler cannot see: registers of any length, where it would keep vector16 of shorter
 * machines in memory (GCC 12: 4 times slower).  Checked addresses are no vectors, and
 * clang warns of what it was asked for and cannot do: it is not asked under sanitizers.
 */
#if defined(__clang__) && defined(VECTOR_SANITIZED)
#define VECTOR_LOOP
#elif defined(__clang__)
#define VECTOR_LOOP _Pragma("clang loop vectorize(assume_safety)")
#else
#define VECTOR_LOOP _Pragma("GCC ivdep")
#endif

#endif
