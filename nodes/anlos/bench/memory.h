/* nodes/anlos/bench/memory.h -- the most memory that a stretch of this process's work
 * held, by what Linux counts (proc(5): clear_refs, VmHWM). */
#ifndef ANLOS_NODES_ANLOS_BENCH_MEMORY_H
#define ANLOS_NODES_ANLOS_BENCH_MEMORY_H

/* Gives back what is free and starts the count; returns what is held now, in bytes.
 * NaN: this system does not tell. */
double bench_memory_begin(void);

/* The most that was held since then, less what was held then. */
double bench_memory_end(double began);

#endif
