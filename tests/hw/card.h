/* SPDX-License-Identifier: MIT */
/* tests/hw/card.h -- the guest's sound card as a hand that pulls its plug. */
#ifndef ANLOS_TESTS_HW_CARD_H
#define ANLOS_TESTS_HW_CARD_H

#include <pthread.h>

/* Unplugs it by a thread, to be joined: that ends when all have closed it. */
void card_unplug(pthread_t *hand);
void card_plug(void);

#endif
