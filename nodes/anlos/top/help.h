/* nodes/anlos/top/help.h -- the page that key h shows. */
#ifndef ANLOS_NODES_ANLOS_TOP_HELP_H
#define ANLOS_NODES_ANLOS_TOP_HELP_H

#include "nodes/anlos/top/page.h"

void help_draw(struct page *p);

#endif
