/* SPDX-License-Identifier: MIT */
#include "msgs/bag/section.h"

bool bag_section_allows(enum bag_section section, uint8_t opcode)
{
    switch (opcode) {
    case BAG_HEADER:
        return section == BAG_AT_START;
    case BAG_MESSAGE:
    case BAG_CHUNK:
    case BAG_MESSAGE_INDEX:
    case BAG_ATTACHMENT:
    case BAG_METADATA:
    case BAG_DATA_END:
        return section == BAG_IN_DATA;
    case BAG_SCHEMA:
    case BAG_CHANNEL:
        return section == BAG_IN_DATA || section == BAG_IN_SUMMARY;
    default:
        return section == BAG_IN_SUMMARY;
    }
}

enum bag_section bag_section_after(enum bag_section section, uint8_t opcode)
{
    switch (opcode) {
    case BAG_HEADER:
        return BAG_IN_DATA;
    case BAG_DATA_END:
        return BAG_IN_SUMMARY;
    case BAG_FOOTER:
        return BAG_AT_END;
    default:
        return section;
    }
}

bool bag_chunk_allows(uint8_t opcode)
{
    return opcode == BAG_SCHEMA || opcode == BAG_CHANNEL || opcode == BAG_MESSAGE;
}
