/* SPDX-License-Identifier: MIT */
/* A log of candump through the receiver for the vehicle: what it hands over of each list,
 * as JSON of the same names as anlos_receiver.py prints. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "launch/receiver/anlos_receiver.h"

static const char *const links[] = {"NODATA", "INIT", "VALID", "INVALID"};
static const char *const trusts[] = {"none", "objects", "full"};
static const char *const states[] = {"Init",     "Calibrating", "Active",
                                     "Degraded", "Fault",       "Blocked",
                                     "Standby",  NULL,          "Shutdown"};
static const char *const measurements[] = {"New", "Measured", "Predicted", "Deleted"};
static const char *const classes[] = {"Unknown", "Point", "Plate", "Extended",
                                      "Multipath"};
static const char *const motions[] = {"Unknown", "Standing", "Moving"};

static void print_value(const char *name, struct anlos_value v)
{
    if (v.quality == ANLOS_NOT_AVAILABLE)
        printf("\"%s\":null,", name);
    else
        printf("\"%s\":%.9g,", name, (double)v.value);
}

static void print_object(const struct anlos_object *o)
{
    const struct {
        const char *name;
        struct anlos_value v;
    } values[] = {
        {"x_m", o->x_m},
        {"y_m", o->y_m},
        {"z_m", o->z_m},
        {"vx_m_s", o->vx_m_s},
        {"vy_m_s", o->vy_m_s},
        {"existence", o->existence},
        {"sigma_x_m", o->sigma_x_m},
        {"sigma_y_m", o->sigma_y_m},
        {"correlation_xy", o->correlation_xy},
        {"sigma_v_m_s", o->sigma_v_m_s},
        {"length_m", o->length_m},
        {"width_m", o->width_m},
        {"course_rad", o->course_rad},
        {"sigma_course_rad", o->sigma_course_rad},
        {"sigma_vx_m_s", o->sigma_vx_m_s},
        {"sigma_vy_m_s", o->sigma_vy_m_s},
        {"correlation_v", o->correlation_v},
        {"height_m", o->height_m},
        {"sigma_z_m", o->sigma_z_m},
        {"correlation_xz", o->correlation_xz},
        {"correlation_yz", o->correlation_yz},
        {"shape_probability", o->shape_probability},
        {"unseen_s", o->unseen_s},
        {"age_s", o->age_s},
    };
    const char *comma = "";

    printf("{\"id\":%u,\"measurement\":\"%s\",\"shape\":\"%s\",\"motion\":\"%s\",", o->id,
           measurements[o->measurement], classes[o->shape], motions[o->motion]);
    for (size_t i = 0; i < sizeof values / sizeof *values; i++)
        print_value(values[i].name, values[i].v);
    printf("\"wall_id\":%u,\"behind_no_wall\":%s,\"in_free_view\":%s,\"fd\":%s,"
           "\"at_limit\":[",
           o->wall_id, o->behind_no_wall ? "true" : "false",
           o->in_free_view ? "true" : "false", o->fd ? "true" : "false");
    for (size_t i = 0; i < sizeof values / sizeof *values; i++)
        if (values[i].v.quality == ANLOS_AT_LIMIT) {
            printf("%s\"%s\"", comma, values[i].name);
            comma = ",";
        }
    printf("]}");
}

static void print_list(const struct anlos_view *v, int64_t time_us)
{
    const struct anlos_list *l = v->list;

    printf("{\"time_us\":%" PRId64 ",\"trust\":\"%s\",\"links\":{\"status\":\"%s\","
           "\"list\":\"%s\",\"diagnosis\":\"%s\"},",
           time_us, trusts[v->trust], links[v->status_link], links[v->list_link],
           links[v->diagnosis_link]);
    printf(states[v->status.state] ? "\"state\":\"%s\"," : "\"state\":null,",
           states[v->status.state]);
    print_value("temperature_c", v->status.temperature_c);
    print_value("sound_speed_m_s", v->status.sound_speed_m_s);
    print_value("range_m", v->status.range_m);
    printf("\"counter\":%u,", l->counter);
    printf(v->age_known ? "\"age_ms\":%u," : "\"age_ms\":null,", v->age_ms);
    print_value("latency_s", l->latency_s);
    print_value("cycle_s", l->cycle_s);
    printf("\"truncated\":%s,\"synchronised\":%s,\"capture_s\":%" PRIu32
           ",\"capture_fraction\":%u,\"objects\":[",
           l->truncated ? "true" : "false", l->synchronised ? "true" : "false",
           l->capture_s, l->capture_fraction);
    for (size_t i = 0; i < l->n_objects; i++) {
        printf(i ? "," : "");
        print_object(&l->objects[i]);
    }
    printf(l->view_known ? "],\"areas\":[" : "],\"areas\":null}\n");
    if (!l->view_known)
        return;
    for (size_t i = 0; i < l->n_areas; i++) {
        const struct anlos_area *a = &l->areas[i];
        printf("%s{\"wall_id\":%u,\"corners_m\":[", i ? "," : "", a->wall_id);
        for (size_t k = 0; k < a->n_corners; k++)
            printf("%s[%.9g,%.9g]", k ? "," : "", (double)a->x_m[k], (double)a->y_m[k]);
        printf("]}");
    }
    printf("]}\n");
}

/* The bytes of a line; -1: it is none of a data frame with 11 bits. */
static int parse(const char *line, int64_t *time_us, uint32_t *id, uint8_t *data)
{
    int64_t s, us;
    int at = 0, n = 0;
    unsigned byte;

    if (sscanf(line, "(%" SCNd64 ".%6" SCNd64 ") %*s %n", &s, &us, &at) != 2 || !at ||
        sscanf(line + at, "%3" SCNx32 "#%n", id, &n) != 1 || n != 4)
        return -1;
    *time_us = s * 1000000 + us;
    line += at + n;
    if (*line == '#')
        line += 2;
    for (n = 0; n < 64 && sscanf(line + 2 * n, "%2x", &byte) == 1; n++)
        data[n] = (uint8_t)byte;
    return n;
}

static void print_counts(const struct anlos_counts *c)
{
    printf("{\"counts\":{\"frames_good\":%u,\"frames_lost\":%u,\"frames_damaged\":%u,"
           "\"frames_repeated\":%u,\"frames_out_of_sequence\":%u,\"frames_orphaned\":%u,"
           "\"timeouts\":%u,\"lists_whole\":%u,\"lists_lost\":%u,\"lists_torn\":%u,"
           "\"lists_mixed\":%u,\"lists_repeated\":%u,\"lists_unproven\":%u,"
           "\"lists_refused\":%u}}\n",
           c->frames_good, c->frames_lost, c->frames_damaged, c->frames_repeated,
           c->frames_out_of_sequence, c->frames_orphaned, c->timeouts, c->lists_whole,
           c->lists_lost, c->lists_torn, c->lists_mixed, c->lists_repeated,
           c->lists_unproven, c->lists_refused);
}

int main(int argc, char *argv[])
{
    static struct anlos_receiver r;
    struct anlos_config cfg;
    struct anlos_view view;
    uint8_t data[64];
    char line[512];
    int64_t time_us;
    uint32_t id;
    int n;
    FILE *f = argc == 2 ? fopen(argv[1], "r") : NULL;

    anlos_config_default(&cfg);
    cfg.sources = 7;
    if (!f || anlos_receiver_init(&r, &cfg)) {
        fprintf(stderr, "usage: receiver_log LOG\n");
        return 2;
    }
    while (fgets(line, sizeof line, f)) {
        if ((n = parse(line, &time_us, &id, data)) < 0)
            continue;
        uint32_t now_ms = (uint32_t)(time_us / 1000);
        if (anlos_receiver_frame(&r, id, data, (uint8_t)n, now_ms) & ANLOS_EVENT_LIST) {
            anlos_receiver_get(&r, now_ms, &view);
            print_list(&view, time_us);
        }
    }
    fclose(f);
    print_counts(&r.counts);
    return 0;
}
