/* SPDX-License-Identifier: MIT */
/* nodes/view/page.h -- the files of the web page, built into the program (page.cmake). */
#ifndef ANLOS_NODES_VIEW_PAGE_H
#define ANLOS_NODES_VIEW_PAGE_H

#include <stddef.h>
#include <stdint.h>

struct page_file {
    const char *path; /* "/style.css"; index.html is "/" too */
    const char *type; /* as of HTTP's Content-Type */
    const uint8_t *data;
    size_t size;
};

/* Ends with path == NULL. */
extern const struct page_file page_files[];

#endif
