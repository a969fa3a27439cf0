/* nodes/anlos/array/print.h -- sound cards as tables and as JSON, to standard output. */
#ifndef ANLOS_NODES_ANLOS_ARRAY_PRINT_H
#define ANLOS_NODES_ANLOS_ARRAY_PRINT_H

#include "hal/alsa/devices.h"
#include "hal/alsa/probe.h"

void array_print_list(const struct alsa_device *devices, size_t n);
void array_print_probe(const char *device, const struct alsa_probe *p);

/* 0, -ENOMEM. */
int array_print_list_json(const struct alsa_device *devices, size_t n);
int array_print_probe_json(const char *device, const struct alsa_probe *p);

#endif
