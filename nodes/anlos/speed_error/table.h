/* nodes/anlos/speed_error/table.h -- the results of `anlos speed-error` as
 * Markdown. */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_TABLE_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_TABLE_H

#include "nodes/anlos/speed_error/noise.h"
#include "nodes/anlos/speed_error/results.h"

/* Writes FOLDER/speed-error.md.  noise: NULL for none.  remark: said at the top, or NULL.
 * 0 or a negative errno. */
int bench_table_write(const struct bench_results *b, const struct bench_noise *noise,
                      const char *remark, const char *folder, struct error *why);

/* What was varied of a case, as words: "2-14 kHz". */
void bench_table_setting(const struct bench_case *c, char *text, size_t size);

#endif
