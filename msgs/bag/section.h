/* SPDX-License-Identifier: MIT */
/* msgs/bag/section.h -- which records may stand where in a bag. */
#ifndef ANLOS_MSGS_BAG_SECTION_H
#define ANLOS_MSGS_BAG_SECTION_H

#include <stdbool.h>

#include "msgs/bag/record.h"

enum bag_section {
    BAG_AT_START,   /* after the magic: the header */
    BAG_IN_DATA,    /* up to the data end */
    BAG_IN_SUMMARY, /* up to the footer */
    BAG_AT_END,     /* the closing magic */
};

/* The opcode is a known one. */
bool bag_section_allows(enum bag_section section, uint8_t opcode);

/* Where the file is after a record with that opcode. */
enum bag_section bag_section_after(enum bag_section section, uint8_t opcode);

/* May it stand in a chunk? */
bool bag_chunk_allows(uint8_t opcode);

#endif
