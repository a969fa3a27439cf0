#include "nodes/anlos/top/share.h"

/* The panels that stay when there is little room, the last to go first. */
static const enum look_panel by_weight[LOOK_PANELS] = {
    LOOK_NODES, LOOK_OBJECTS, LOOK_TOPICS, LOOK_DETAIL, LOOK_LOG};

/* One that is not there stays away. */
static void grow(struct share *s, size_t to, size_t *left)
{
    size_t more = s->got && to > s->got ? to - s->got : 0;

    if (more > *left)
        more = *left;
    s->got += more;
    *left -= more;
}

void share_height(struct share s[LOOK_PANELS], enum look_panel focus, size_t left)
{
    s[focus].got = 1;
    left--;
    grow(&s[focus], s[focus].least, &left);
    for (size_t i = 0; i < LOOK_PANELS; i++) {
        struct share *other = &s[by_weight[i]];
        if (other->got || !other->least || other->least > left)
            continue;
        other->got = other->least;
        left -= other->least;
    }
    grow(&s[focus], s[focus].most, &left);
    for (size_t i = 0; i < LOOK_PANELS; i++)
        grow(&s[by_weight[i]], s[by_weight[i]].fair, &left);
    for (size_t i = 0; i < LOOK_PANELS; i++)
        grow(&s[by_weight[i]], s[by_weight[i]].most, &left);
}

struct share share_want(size_t least_rows, size_t fair_rows, size_t rows)
{
    return (struct share){.least = 1 + (rows < least_rows ? rows : least_rows),
                          .fair = 1 + fair_rows,
                          .most = 1 + rows};
}
