/* nodes/rt/onlooker.h -- nodes that a system hears and images without. */
#ifndef ANLOS_NODES_RT_ONLOOKER_H
#define ANLOS_NODES_RT_ONLOOKER_H

#include <stdbool.h>

/* Those who only look on may come and go. */
bool onlooker_is(const char *node);

#endif
