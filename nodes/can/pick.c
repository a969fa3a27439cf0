#include "nodes/can/pick.h"

#include <math.h>

struct worth {
    double existence; /* in tenths; -1: it is no probability, and less than any */
    double distance_m;
};

/* The vehicle's origin is as good as its nearest edge: objects are metres away. */
static struct worth worth_of(double existence, const double p[3])
{
    double d = sqrt(p[0] * p[0] + p[1] * p[1]);
    bool known = existence >= 0.0 && existence <= 1.0;

    return (struct worth){known ? round(10.0 * existence) : -1.0,
                          isnan(d) ? INFINITY : d};
}

static struct worth worth_of_detection(const Anlos__Detection *d)
{
    const double nowhere[3] = {NAN, NAN, NAN};
    const double p[3] = {d->position_m ? d->position_m->x : 0,
                         d->position_m ? d->position_m->y : 0, 0};

    return worth_of(d->existence, d->position_m ? p : nowhere);
}

static bool is_less(struct worth a, struct worth b)
{
    if (a.existence < b.existence || b.existence < a.existence)
        return a.existence < b.existence;
    return a.distance_m > b.distance_m;
}

/* Of those that are picked, the one of the least worth goes; of equal ones the last. */
static void drop_least(struct worth *worths, size_t *picked, size_t n)
{
    size_t least = 0;

    for (size_t i = 1; i < n; i++)
        if (!is_less(worths[least], worths[i]))
            least = i;
    for (size_t i = least; i + 1 < n; i++) {
        worths[i] = worths[i + 1];
        picked[i] = picked[i + 1];
    }
}

struct pick {
    size_t max, n;
    struct worth worths[CAN_MAX_OBJECTS + 1];
    size_t picked[CAN_MAX_OBJECTS + 1];
};

static void add(struct pick *p, size_t index, struct worth worth)
{
    p->worths[p->n] = worth;
    p->picked[p->n++] = index;
    if (p->n > p->max)
        drop_least(p->worths, p->picked, p->n--);
}

static size_t give(const struct pick *p, size_t *picked)
{
    for (size_t i = 0; i < p->n; i++)
        picked[i] = p->picked[i];
    return p->n;
}

size_t pick_detections(const Anlos__DetectionList *list, size_t max, size_t *picked)
{
    struct pick p = {.max = max};

    for (size_t i = 0; i < list->n_detections; i++)
        add(&p, i, worth_of_detection(list->detections[i]));
    return give(&p, picked);
}

size_t pick_objects(const struct can_object *objects, size_t n, size_t max,
                    size_t *picked)
{
    struct pick p = {.max = max};

    for (size_t i = 0; i < n; i++)
        add(&p, i, worth_of(objects[i].existence, objects[i].position_m));
    return give(&p, picked);
}
