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

#if defined(__x86_64__) && defined(__linux__) && !defined(VECTOR_SANITIZED) &&           \
    (!defined(__clang__) || __clang_major__ >= 14)
#define VECTOR_CLONES                                                                    \
    __attribute__((target_clones("default", "arch=haswell", "arch=skylake-avx512")))
#else
#define VECTOR_CLONES
#endif

#endif
