/* msgs/bag/catalog_build.h -- how a catalog is filled, from the summary or by a scan. */
#ifndef ANLOS_MSGS_BAG_CATALOG_BUILD_H
#define ANLOS_MSGS_BAG_CATALOG_BUILD_H

#include "msgs/bag/catalog.h"

/* Appends a copy of the record; a list grows by doubling.  0, -ENOMEM. */
int bag_catalog_keep(struct bag_kept **list, size_t *n, const struct bag_record *r);

/* A schema or channel, unless its id is known.  0, -ENOMEM. */
int bag_catalog_define(struct bag_catalog *c, const struct bag_record *r);

/* A schema or channel in place of what has its id.  0 (as it was, or new), 1 (it was
 * another), -ENOMEM. */
int bag_catalog_redefine(struct bag_catalog *c, const struct bag_record *r);

/* 0, -ENOMEM. */
int bag_catalog_add_block(struct bag_catalog *c, const struct bag_block *block);

/* A message, in a chunk or outside. */
void bag_catalog_count(struct bag_catalog *c, const struct bag_message *m);

/* The index of an attachment or metadata at an offset.  0, -ENOMEM. */
int bag_catalog_add_attachment(struct bag_catalog *c, uint64_t offset, uint64_t length,
                               const struct bag_attachment *a);
int bag_catalog_add_metadata(struct bag_catalog *c, uint64_t offset, uint64_t length,
                             const struct bag_metadata *m);

/* Do any two things that the catalog names share bytes?  0, -EBADMSG, -ENOMEM. */
int bag_catalog_check_spans(const struct bag_catalog *c, struct complaint *why);

/* Fills a catalog that knows its file alone from every record there is.  Errors as
 * bag_catalog_open. */
int bag_catalog_scan(struct bag_catalog *c, struct complaint *why);

#endif
