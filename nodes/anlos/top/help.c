#include "nodes/anlos/top/help.h"

#include <stddef.h>

/* The keys first: a low terminal shows no more. */
static const char *const lines[] = {
    "",
    " q            quit                     tab          next panel, back with shift",
    " arrows       select a row, scroll     pages, home, end   further at once",
    " s            sort by the next thing   p, blank     hold what is shown",
    " /            only names with ...      escape       all names again",
    "",
    " state        ready: works; starting, degraded: says what is missing; fault;",
    "              silent: lives, but says nothing; dead: its process is gone;",
    "              off: ran here once.  Of topics: low: under a quarter of what is",
    "              expected; losing: messages got lost in the last 3 s; dead: all",
    "              who publish it are",
    " HZ/EXPECTED  messages a second; of a node, the pings that it is done with, or",
    "              its main output; -: none is expected, as of an array that stands",
    " LATENCY ms   age of the sound when the message went out (of a node without",
    "              output, came in): median/99th percentile of the last 5 s",
    " QUEUE        messages that wait now; of a topic, in the fullest queue",
    " DROPS, GAPS  pushed out of a full queue; never came.  LOST of a topic is both",
    " OBJECT       hidden ones, of the newest list; predicted: not seen just now; VX, VY",
    "              over ground, along the vehicle's axes",
    " REFUSED      messages that were not what they should be",
    " CPU%         100 is one core.  All rates are those of the last 3 s",
};

void help_draw(struct page *p)
{
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++)
        if (p->n_lines < p->height - 1)
            page_add(p, "%s", lines[i]);
}
