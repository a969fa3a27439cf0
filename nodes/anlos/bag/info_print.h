/* nodes/anlos/bag/info_print.h -- what is in a bag, on stdout. */
#ifndef ANLOS_NODES_ANLOS_BAG_INFO_PRINT_H
#define ANLOS_NODES_ANLOS_BAG_INFO_PRINT_H

#include "nodes/anlos/bag/contents.h"

/* 0, errors of bag_catalog_read, -EIO (stdout), -ENOMEM. */
int info_print(const struct bag_catalog *bag, const struct contents *c,
               struct complaint *why);
int info_print_json(const struct bag_catalog *bag, const struct contents *c,
                    struct complaint *why);

#endif
