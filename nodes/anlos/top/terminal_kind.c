#include "nodes/anlos/top/terminal_kind.h"

#include <curses.h>
#include <term.h>
#include <unistd.h>

bool terminal_kind_can_place(const char *kind)
{
    int found;

    if (!kind || !*kind || setupterm(kind, STDOUT_FILENO, &found) == ERR)
        return false;
    bool can = cursor_address != NULL;
    del_curterm(cur_term);
    return can;
}
