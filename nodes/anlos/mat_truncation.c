#include "nodes/anlos/mat_truncation.h"

#include <stdint.h>
#include <sys/stat.h>
#include <unistd.h>

#define V5_HEADER     128
#define V5_COMPRESSED 15

static uint32_t word_at(const uint8_t *p, bool little)
{
    return little ? p[0] | p[1] << 8 | p[2] << 16 | (uint32_t)p[3] << 24
                  : p[3] | p[2] << 8 | p[1] << 16 | (uint32_t)p[0] << 24;
}

bool mat_truncation_check(int fd)
{
    uint8_t head[V5_HEADER], tag[8];
    struct stat st;
    if (fstat(fd, &st) || pread(fd, head, sizeof head, 0) != (ssize_t)sizeof head)
        return false;
    bool little = head[126] == 'I' && head[127] == 'M';
    bool big = head[126] == 'M' && head[127] == 'I';
    if ((!little && !big) || head[little ? 125 : 124] != 1) /* version 0x0100 */
        return false;
    off_t at = V5_HEADER;
    while (at < st.st_size) {
        if (pread(fd, tag, sizeof tag, at) != (ssize_t)sizeof tag)
            return true;
        uint32_t type = word_at(tag, little), size = word_at(tag + 4, little);
        at += 8;
        if (type >> 16) /* a small element: its data are in the tag */
            continue;
        at += type == V5_COMPRESSED ? (off_t)size : ((off_t)size + 7) / 8 * 8;
    }
    return at > st.st_size;
}
