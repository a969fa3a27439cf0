/* Detections as a table: a line for each, the positions where they really are. */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "hal/decimal.h"
#include "msgs/detections.pb-c.h"
#include "nodes/anlos/bag/export.h"
#include "nodes/anlos/bag/verb.h"

static const char head[] =
    "capture_ns,publish_ns,scan,counter,preview,frame,mirrored,id,x_m,y_m,z_m,"
    "xx_m2,xy_m2,xz_m2,yy_m2,yz_m2,zz_m2,existence,level_db,virtual_x_m,virtual_y_m,"
    "virtual_z_m,extent_x_m,extent_y_m,extent_z_m\n";

static void put_number(FILE *f, double x)
{
    char text[DECIMAL_SIZE];

    if (isfinite(x))
        fprintf(f, ",%s", decimal_print(x, text));
    else
        fputc(',', f); /* empty: none */
}

static void put_vec3(FILE *f, const Anlos__Vec3 *v)
{
    put_number(f, v ? v->x : NAN);
    put_number(f, v ? v->y : NAN);
    put_number(f, v ? v->z : NAN);
}

static void put_detection(FILE *f, const struct envelope *e,
                          const Anlos__DetectionList *list, const Anlos__Detection *d)
{
    fprintf(f, "%" PRId64 ",%" PRId64 ",%u,%u,%d,%s,%d,%u", e->capture_ns, e->publish_ns,
            list->scan, list->counter, list->preview,
            list->in_vehicle_frame ? "vehicle" : "array", list->mirrored, d->id);
    put_vec3(f, d->position_m);
    for (size_t i = 0; i < 6; i++)
        put_number(f, i < d->n_covariance_m2 ? d->covariance_m2[i] : NAN);
    put_number(f, d->existence);
    put_number(f, d->level_db);
    put_vec3(f, d->virtual_m);
    put_vec3(f, d->extent_m);
    fputc('\n', f);
}

struct table {
    struct stream *stream;
    const struct export_options *options;
    size_t n; /* lines */
};

static int write_rows(FILE *f, void *context, struct complaint *why)
{
    struct table *t = context;
    struct stream_message m;
    int err;

    fputs(head, f);
    while (!(err = stream_next(t->stream, &m, why)) && !ferror(f)) {
        Anlos__DetectionList *list = (Anlos__DetectionList *)stream_unpack(&m);
        if (!list)
            return complain(why, -EBADMSG, "%s: a message of \"detections\" is none",
                            t->options->file);
        for (size_t i = 0; i < list->n_detections; i++, t->n++)
            put_detection(f, &m.envelope, list, list->detections[i]);
        anlos__detection_list__free_unpacked(list, NULL);
    }
    return err == -ENODATA ? 0 : err;
}

int export_csv(struct stream *s, const struct export_options *o, struct complaint *why)
{
    struct table t = {s, o, 0};
    int err = verb_write_file(o->out, write_rows, &t, why);

    if (!err && strcmp(o->out, "-"))
        printf("%s: %zu detections\n", o->out, t.n);
    return err;
}
