/* SPDX-License-Identifier: MIT */
/* msgs/bag/copy.h -- messages of bags into another one: the schemas and channels that
 * they need go with them, once, also where several bags define the same. */
#ifndef ANLOS_MSGS_BAG_COPY_H
#define ANLOS_MSGS_BAG_COPY_H

#include "msgs/bag/catalog.h"
#include "msgs/bag/writer.h"

struct bag_copy;

/* The writer outlives it.  0, -ENOMEM. */
int bag_copy_create(struct bag_copy **out, struct bag_writer *to);

/* A bag to copy from, which outlives it too; they count from 0.  0, -ENOMEM. */
int bag_copy_add(struct bag_copy *c, const struct bag_catalog *from);

/* The id in the new bag of a channel of bag number `from`; 0: that bag does not define
 * it.  0, or as bag_writer_channel. */
int bag_copy_channel(struct bag_copy *c, size_t from, uint16_t old, uint16_t *id,
                     struct error *why);

/* The catalog of bag number `from` has another schema or channel than before under the id
 * of r: from now on it is that one. */
void bag_copy_redefined(struct bag_copy *c, size_t from, const struct bag_record *r);

/* A message of bag number `from`.  0, -EBADMSG (its channel is defined nowhere), or as
 * bag_writer_message. */
int bag_copy_message(struct bag_copy *c, size_t from, const struct bag_message *m,
                     struct error *why);

/* All attachments and metadata of bag number `from`, but what others had as well.  0, as
 * bag_catalog_read and bag_writer_attachment. */
int bag_copy_rest(struct bag_copy *c, size_t from, struct error *why);
void bag_copy_destroy(struct bag_copy *c);

#endif
