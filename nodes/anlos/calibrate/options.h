/* nodes/anlos/calibrate/options.h -- the command line of `anlos calibrate`. */
#ifndef ANLOS_NODES_ANLOS_CALIBRATE_OPTIONS_H
#define ANLOS_NODES_ANLOS_CALIBRATE_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>

struct calibrate_options { /* borrow from argv */
    const char *what;      /* "time-zero" */
    const char *array, *out, *stage, *folder;
    double distance_m, range_m, temperature_c, humidity_percent; /* NaN: not given */
    bool has_pair, fit_speed;
    size_t pair[2]; /* speaker, microphone */
    size_t takes, position;
};

/* true: run it.  false: *exit_code says how it ended (help, or a complaint was printed).
 */
bool calibrate_options_parse(struct calibrate_options *o, int argc, char **argv,
                             int *exit_code);

#endif
