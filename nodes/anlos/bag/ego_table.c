/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/bag/ego_table.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/list.h"
#include "hal/table_file.h"
#include "hal/text_file.h"

enum { TIME, SPEED, YAW_RATE, STANDSTILL, VALID, N_COLUMNS };

static const struct table_column columns[N_COLUMNS] = {
    [TIME] = {"time_s", true},
    [SPEED] = {"speed_m_s", true},
    [YAW_RATE] = {"yaw_rate_rad_s", true},
    [STANDSTILL] = {"standstill", false},
    [VALID] = {"valid", false}};

/* What is not known is empty. */
static bool read_number(const char *text, bool needed, double *out)
{
    *out = NAN;
    return (!*text && !needed) || table_number(text, out);
}

static void print_number(FILE *f, double x)
{
    char text[DECIMAL_SIZE];

    fprintf(f, ",%s", isfinite(x) ? decimal_print(x, text) : "");
}

static const char *read_row(struct ego_row *row, char *const *f)
{
    Anlos__EgoMotion *m = &row->motion;
    uint64_t standstill, valid = 1;

    anlos__ego_motion__init(m);
    if (!table_time(f[TIME], &row->time_ns))
        return "time_s: expected seconds from 0";
    if (f[VALID] && !table_count(f[VALID], 1, &valid))
        return "valid: expected 0 or 1";
    if (!read_number(f[SPEED], valid, &m->speed_m_s))
        return "speed_m_s: expected m/s";
    if (!read_number(f[YAW_RATE], valid, &m->yaw_rate_rad_s))
        return "yaw_rate_rad_s: expected rad/s";
    standstill = m->speed_m_s == 0.0 && m->yaw_rate_rad_s == 0.0;
    if (f[STANDSTILL] && !table_count(f[STANDSTILL], 1, &standstill))
        return "standstill: expected 0 or 1";
    m->standstill = standstill;
    m->valid = valid;
    return NULL;
}

static const char *take_row(void *ctx, char *const *fields)
{
    struct ego_table *t = ctx;

    if (list_grow(&t->rows, t->n, &t->room, sizeof *t->rows))
        return "out of memory";
    const char *wrong = read_row(&t->rows[t->n], fields);
    if (!wrong && t->n && t->rows[t->n].time_ns < t->rows[t->n - 1].time_ns)
        wrong = "time_s: before that of the line above";
    t->n += !wrong;
    return wrong;
}

int ego_table_load(struct ego_table *out, const char *path, struct error *why)
{
    *out = (struct ego_table){.rows = NULL};
    return table_load(path, columns, N_COLUMNS, take_row, out, why);
}

void ego_table_clear(struct ego_table *t)
{
    free(t->rows);
    *t = (struct ego_table){.rows = NULL};
}

void ego_row_print(FILE *f, const struct ego_row *row)
{
    if (!row) {
        fputs("time_s,speed_m_s,yaw_rate_rad_s,standstill,valid\n", f);
        return;
    }
    fprintf(f, "%" PRId64 ".%09" PRId64, row->time_ns / 1000000000,
            row->time_ns % 1000000000);
    print_number(f, row->motion.speed_m_s);
    print_number(f, row->motion.yaw_rate_rad_s);
    fprintf(f, ",%d,%d\n", row->motion.standstill, row->motion.valid);
}
