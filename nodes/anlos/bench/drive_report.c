#include "nodes/anlos/bench/drive_report.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "nodes/rt/export_chart.h"
#include "nodes/rt/export_file.h"

int drive_moments_add(struct drive_moments *m, const struct drive_moment *moment)
{
    if (m->n == m->room) {
        size_t room = m->room ? 2 * m->room : 256;
        struct drive_moment *at = realloc(m->at, room * sizeof *at);
        if (!at)
            return -ENOMEM;
        m->at = at;
        m->room = room;
    }
    m->at[m->n++] = *moment;
    return 0;
}

static double hours(const struct drive_score *s)
{
    return (s->ended_s - s->began_s) / 3600.0;
}

/* -- the table --------------------------------------------------------------------------
 */

void drive_print_head(void)
{
    printf("%-22s %6s %6s %22s %9s %6s %13s %6s %12s\n", "", "GOSPA", "OSPA",
           "local. missed  false", "Pd   far", "false", "echo to track", "lead",
           "error of");
    printf("%-22s %6s %6s %22s %9s %6s %13s %6s %12s\n", "drive", "m", "m",
           "m      m      m", "", "1/h", "mean s  worst", "s", "cm  m/s");
}

/* A number, or a dash of none. */
static void print_number(int width, int digits, double x)
{
    if (isfinite(x))
        printf(" %*.*f", width, digits, x);
    else
        printf(" %*s", width, "-");
}

void drive_print(const char *name, const struct drive_score *s, size_t n_lists)
{
    printf("%-22s", name);
    print_number(6, 3, drive_mean(&s->gospa));
    print_number(6, 3, drive_mean(&s->ospa));
    print_number(8, 3, drive_mean(&s->localisation));
    print_number(6, 3, drive_mean(&s->missed));
    print_number(6, 3, drive_mean(&s->false_ones));
    print_number(4, 2, drive_mean(&s->seen));
    print_number(4, 2, drive_mean(&s->seen_far));
    print_number(6, 1, (double)s->n_false_tracks / hours(s));
    print_number(6, 2, drive_mean(&s->delay));
    print_number(6, 2, s->delay.n ? s->worst_delay_s : NAN);
    print_number(6, 2, drive_mean(&s->lead));
    print_number(6, 1, 100.0 * drive_rms(&s->position2));
    print_number(5, 2, drive_rms(&s->velocity2));
    printf(
        "\n%-22s %zu lists in %.0f s, %.1f Hz; %zu objects came in, %zu left without a "
        "track\n",
        "", n_lists, s->ended_s - s->began_s, (double)n_lists / (s->ended_s - s->began_s),
        s->n_entries, s->n_late);
    fflush(stdout);
}

/* -- files ------------------------------------------------------------------------------
 */

static void put(json_t *o, const char *key, double x)
{
    json_object_set_new(o, key, isfinite(x) ? json_real(x) : json_null());
}

json_t *drive_json(const struct drive_score *s, size_t n_lists)
{
    json_t *o = json_object();

    if (!o)
        return NULL;
    put(o, "seconds", s->ended_s - s->began_s);
    put(o, "lists", (double)n_lists);
    put(o, "cutoff_m", DRIVE_CUTOFF_M);
    put(o, "order", DRIVE_ORDER);
    put(o, "gospa_m", drive_mean(&s->gospa));
    put(o, "ospa_m", drive_mean(&s->ospa));
    put(o, "localisation_m", drive_mean(&s->localisation));
    put(o, "missed_m", drive_mean(&s->missed));
    put(o, "false_m", drive_mean(&s->false_ones));
    put(o, "detection_probability", drive_mean(&s->seen));
    put(o, "detection_probability_far", drive_mean(&s->seen_far));
    put(o, "false_tracks", (double)s->n_false_tracks);
    put(o, "false_tracks_per_hour", (double)s->n_false_tracks / hours(s));
    put(o, "objects_entered", (double)s->n_entries);
    put(o, "objects_without_track", (double)s->n_late);
    put(o, "echo_to_track_s", drive_mean(&s->delay));
    put(o, "echo_to_track_worst_s", s->delay.n ? s->worst_delay_s : NAN);
    put(o, "lead_before_sight_s", drive_mean(&s->lead));
    put(o, "position_rms_m", drive_rms(&s->position2));
    put(o, "velocity_rms_m_s", drive_rms(&s->velocity2));
    return o;
}

static int write_csv(const char *folder, const char *file, const struct drive_moments *m,
                     struct complaint *why)
{
    struct export_file e;
    int err = export_file_open(&e, folder, file, why);

    if (err)
        return err;
    fprintf(e.f, "t_s,gospa_m,ospa_m,localisation_m,missed_m,false_m,objects,tracks,"
                 "detections\n");
    for (size_t i = 0; i < m->n; i++) {
        const struct drive_moment *k = &m->at[i];
        fprintf(e.f, "%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%zu,%zu,%zu\n", k->t_s, k->gospa_m,
                k->ospa_m, k->localisation_m, k->missed_m, k->false_m, k->n_objects,
                k->n_tracks, k->n_detections);
    }
    return export_file_commit(&e, why);
}

static int draw(const char *folder, const char *name, const struct drive_moments *m,
                struct complaint *why)
{
    double *x = malloc(5 * (m->n + 1) * sizeof *x);
    if (!x)
        return complain(why, -ENOMEM, "out of memory");
    double *y[4], most_m = 0.1;
    for (int k = 0; k < 4; k++)
        y[k] = x + (size_t)(k + 1) * (m->n + 1);
    for (size_t i = 0; i < m->n; i++) {
        x[i] = m->at[i].t_s;
        y[0][i] = m->at[i].gospa_m;
        y[1][i] = m->at[i].ospa_m;
        y[2][i] = (double)m->at[i].n_objects;
        y[3][i] = (double)m->at[i].n_tracks;
        for (int k = 0; k < 4; k++)
            most_m = fmax(most_m, y[k][i]);
    }
    const struct chart_series series[] = {
        {"objects", x, y[2], m->n, CHART_DASHED, 0},
        {"tracks", x, y[3], m->n, CHART_POINTS, 1},
        {"OSPA", x, y[1], m->n, CHART_LINE, 2},
        {"GOSPA", x, y[0], m->n, CHART_LINE, 3},
    };
    const struct chart chart = {
        .title = name,
        .label = {"time, s", "GOSPA and OSPA in m; number of objects and tracks"},
        .min = {m->n ? x[0] : 0.0, 0.0},
        .max = {m->n > 1 ? x[m->n - 1] : 1.0, 1.1 * most_m},
        .series = series,
        .n_series = sizeof series / sizeof *series,
        .legend_beside = true};
    int err = export_chart(folder, name, &chart, why);
    free(x);
    return err;
}

int drive_write(const char *folder, const char *name, const struct drive_moments *m,
                struct complaint *why)
{
    char file[300];

    snprintf(file, sizeof file, "%s.csv", name);
    int err = write_csv(folder, file, m, why);
    return err ? err : draw(folder, name, m, why);
}
