/* dsp/vector.h -- hot loops compiled for several instruction sets, the best one chosen
 * when the program is loaded: the build stays plain x86-64 and runs anywhere.  Nothing on
 * other machines, with compilers that cannot, and under sanitizers (their runtime is not
 * up yet when the loader chooses). */
#ifndef ANLOS_DSP_VECTOR_H
#define ANLOS_DSP_VECTOR_H

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define VECTOR_SANITIZED 1
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define VECTOR_SANITIZED 1
#endif

/* By features, not by processor names: "arch=haswell" is chosen on a Haswell alone. */
#if !defined(__x86_64__) || !defined(__linux__) || defined(VECTOR_SANITIZED)
#define VECTOR_CLONES
#elif defined(__clang__) && __clang_major__ >= 14
#define VECTOR_CLONES __attribute__((target_clones("default", "fma", "avx512f")))
#elif !defined(__clang__) && __GNUC__ >= 12
#define VECTOR_CLONES                                                                    \
    __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define VECTOR_CLONES
#endif

/* A part of such a loop: compiled into each of its callers' versions. */
#define VECTOR_INLINE static inline __attribute__((always_inline))

#endif
