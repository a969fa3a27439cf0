/* nodes/anlos/bench/machine.h -- what figures were measured on. */
#ifndef ANLOS_NODES_ANLOS_BENCH_MACHINE_H
#define ANLOS_NODES_ANLOS_BENCH_MACHINE_H

#include <stddef.h>

/* "AMD EPYC 7763, 2 processors, Linux 6.1; gcc 12.2.0; FFTW 3.3.10". */
void bench_machine(char *text, size_t size);

#endif
