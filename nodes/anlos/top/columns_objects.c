/* The columns of hidden objects. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "nodes/anlos/top/columns.h"

#define CELL TEXT_CELL_SIZE

static void number(char out[CELL], int digits, double value)
{
    if (isfinite(value))
        snprintf(out, CELL, "%.*f", digits, value);
    else
        snprintf(out, CELL, "-");
}

static void object_id(const void *row, char out[CELL])
{
    snprintf(out, CELL, "%" PRIu32, ((const struct table_object *)row)->id);
}

static void object_state(const void *row, char out[CELL])
{
    static const char *const names[] = {"new", "measured", "predicted", "deleted"};
    unsigned state = (unsigned)((const struct table_object *)row)->measurement;
    snprintf(out, CELL, "%s", state < 4 ? names[state] : "?");
}

static void object_x(const void *row, char out[CELL])
{
    number(out, 2, ((const struct table_object *)row)->at_m[0]);
}

static void object_y(const void *row, char out[CELL])
{
    number(out, 2, ((const struct table_object *)row)->at_m[1]);
}

static void object_z(const void *row, char out[CELL])
{
    number(out, 2, ((const struct table_object *)row)->at_m[2]);
}

static void object_vx(const void *row, char out[CELL])
{
    number(out, 2, ((const struct table_object *)row)->velocity_m_s[0]);
}

static void object_vy(const void *row, char out[CELL])
{
    number(out, 2, ((const struct table_object *)row)->velocity_m_s[1]);
}

static void object_exists(const void *row, char out[CELL])
{
    number(out, 0, 100.0 * ((const struct table_object *)row)->existence);
}

static void object_class(const void *row, char out[CELL])
{
    static const char *const names[] = {"-", "point", "plate", "extended"};
    unsigned shape = (unsigned)((const struct table_object *)row)->shape;
    snprintf(out, CELL, "%s", shape < 4 ? names[shape] : "?");
}

static void object_age(const void *row, char out[CELL])
{
    number(out, 1, ((const struct table_object *)row)->age_s);
}

static void object_unseen(const void *row, char out[CELL])
{
    number(out, 1, ((const struct table_object *)row)->unseen_s);
}

static void object_frame(const void *row, char out[CELL])
{
    const struct table_object *o = row;
    snprintf(out, CELL, "%s%s", o->in_vehicle_frame ? "vehicle" : "array",
             o->mirrored ? "" : ", as imaged");
}

const struct column columns_objects[] = {
    {"OBJECT", 6, true, 0, object_id},
    {"STATE", 9, true, 0, object_state},
    {"X m", 6, false, 1, object_x},
    {"Y m", 6, false, 1, object_y},
    {"VX m/s", 6, false, 2, object_vx},
    {"VY m/s", 6, false, 2, object_vy},
    {"EXISTS%", 7, false, 3, object_exists},
    {"AGE s", 6, false, 4, object_age},
    {"UNSEEN", 6, false, 6, object_unseen},
    {"CLASS", 8, true, 5, object_class},
    {"Z m", 6, false, 7, object_z},
    {"FRAME", 0, true, 8, object_frame},
    {NULL, 0, false, 0, NULL},
};
