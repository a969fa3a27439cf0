#include "nodes/rt/replay_order.h"

#include "msgs/topics.h"

static bool is_of_vehicle(const struct bus_message *m)
{
    return m->topic == topic_ego() || m->topic == topic_ambient() ||
           m->topic == topic_wall() || m->topic == topic_wall_given();
}

static bool is_sound(const struct bus_message *m)
{
    return m->topic == topic_ping() || m->topic == topic_traces() ||
           m->topic == topic_volume();
}

bool replay_order_takes(const struct bus_message *m)
{
    return m->envelope.replayed && (is_of_vehicle(m) || is_sound(m));
}

static struct bus_message *at(struct replay_line *l, size_t i)
{
    return &l->list[(l->first + i) % REPLAY_ORDER_MAX];
}

/* Walls and motion overtake each other; a recording that begins again is another matter.
 */
static void push(struct replay_line *l, const struct bus_message *m)
{
    size_t i = l->n++;
    int64_t late_ns;

    while (i &&
           (late_ns = at(l, i - 1)->envelope.publish_ns - m->envelope.publish_ns) > 0 &&
           late_ns <= REPLAY_ORDER_WALL_NS) {
        *at(l, i) = *at(l, i - 1);
        i--;
    }
    *at(l, i) = *m;
}

static void pop(struct replay_line *l, struct bus_message *out)
{
    *out = l->list[l->first];
    l->first = (l->first + 1) % REPLAY_ORDER_MAX;
    l->n--;
}

static int64_t stamp_of(const struct replay_line *l)
{
    return l->list[l->first].envelope.publish_ns;
}

void replay_order_put(struct replay_order *o, struct bus_message *m, int64_t now_ns)
{
    o->came_ns = now_ns;
    if (m->topic == topic_ego()) {
        o->moves = true;
        o->motion_ns = m->envelope.publish_ns;
    }
    if (m->topic == topic_wall()) {
        o->walls = true;
        o->walls_ns = m->envelope.publish_ns;
    }
    push(is_sound(m) ? &o->sound : &o->vehicle, m);
}

/* Of a line that is full the first goes on, whatever it waits for. */
static bool is_full(const struct replay_line *l)
{
    return l->n == REPLAY_ORDER_MAX;
}

/* Has all been heard that the vehicle said before? */
static bool is_complete(const struct replay_order *o, int64_t stamp_ns)
{
    if (o->moves && o->motion_ns < stamp_ns)
        return false;
    return !o->walls || o->walls_ns >= stamp_ns ||
           stamp_ns - o->walls_ns > REPLAY_ORDER_WALL_NS ||
           (o->moves && o->motion_ns - stamp_ns > REPLAY_ORDER_WALL_NS);
}

/* What waits for motion that does not come goes on after a while. */
bool replay_order_take(struct replay_order *o, struct bus_message *out, int64_t now_ns,
                       int64_t *due_ns)
{
    struct replay_line *next = NULL;
    bool tired = now_ns - o->came_ns >= REPLAY_ORDER_WAIT_NS;

    *due_ns = INT64_MAX;
    if (o->sound.n && o->vehicle.n && stamp_of(&o->vehicle) < stamp_of(&o->sound))
        next = &o->vehicle;
    else if (o->sound.n &&
             (is_complete(o, stamp_of(&o->sound)) || tired || is_full(&o->sound)))
        next = &o->sound;
    else if (o->vehicle.n && (tired || is_full(&o->vehicle)))
        next = &o->vehicle;
    if (next)
        pop(next, out);
    else if (o->sound.n || o->vehicle.n)
        *due_ns = o->came_ns + REPLAY_ORDER_WAIT_NS;
    return next;
}

void replay_order_leave(struct replay_order *o, int64_t now_ns)
{
    o->left_ns = now_ns;
}

void replay_order_return(struct replay_order *o, int64_t now_ns)
{
    if (o->left_ns)
        o->came_ns += now_ns - o->left_ns;
    o->left_ns = 0;
}

void replay_order_clear(struct replay_order *o)
{
    struct bus_message m;

    while (o->sound.n) {
        pop(&o->sound, &m);
        bus_message_free(&m);
    }
    while (o->vehicle.n) {
        pop(&o->vehicle, &m);
        bus_message_free(&m);
    }
}
