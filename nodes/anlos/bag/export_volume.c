/* The image of a scan: its last volume that is no preview, or the last preview of a scan
 * that was not finished. */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/bag/export.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/rt/export.h"
#include "nodes/rt/volume_grid.h"

struct image {
    Anlos__Volume *volume;
    Anlos__DetectionList *detections; /* of the same scan, or NULL */
};

static void clear(struct image *i)
{
    if (i->volume)
        anlos__volume__free_unpacked(i->volume, NULL);
    if (i->detections)
        anlos__detection_list__free_unpacked(i->detections, NULL);
}

static void take_volume(struct image *i, Anlos__Volume *v, size_t scan)
{
    bool wanted = !scan || v->scan == scan;
    bool worse = i->volume && i->volume->scan == v->scan && !i->volume->preview &&
                 v->preview;

    if (!wanted || worse) {
        anlos__volume__free_unpacked(v, NULL);
        return;
    }
    if (i->volume)
        anlos__volume__free_unpacked(i->volume, NULL);
    i->volume = v;
}

static void take_detections(struct image *i, Anlos__DetectionList *d)
{
    if (i->detections)
        anlos__detection_list__free_unpacked(i->detections, NULL);
    i->detections = d;
}

static int find_image(struct image *out, struct stream *s, const struct export_options *o,
                      struct complaint *why)
{
    struct stream_message m;
    int err;

    while (!(err = stream_next(s, &m, why))) {
        ProtobufCMessage *content = stream_unpack(&m);
        if (!content)
            return complain(why, -EBADMSG, "%s: a message of \"%s\" is none", o->file,
                            m.topic ? m.topic->name : "volume");
        if (m.topic == topic_volume())
            take_volume(out, (Anlos__Volume *)content, o->scan);
        else
            take_detections(out, (Anlos__DetectionList *)content);
    }
    if (err != -ENODATA)
        return err;
    if (!out->volume)
        return complain(why, -ENODATA,
                        o->scan ? "%s: no volume of scan %zu"
                                : "%s: no "
                                  "volume",
                        o->file, o->scan);
    if (out->detections && out->detections->scan != out->volume->scan)
        take_detections(out, NULL);
    return 0;
}

static int say(const struct image *i, const char *out)
{
    printf("%s: the image of scan %u, %u of %u pings%s\n", out, i->volume->scan,
           i->volume->pings_used, i->volume->pings_expected,
           i->volume->preview ? ", a preview" : "");
    return 0;
}

static const float *intensity_of(const struct image *i, struct grid *grid,
                                 const struct export_options *o, struct complaint *why)
{
    const float *intensity = volume_grid(i->volume, grid);

    if (!intensity)
        complain(why, -EBADMSG, "%s: the volume does not hold", o->file);
    return intensity;
}

static int write_nrrd(const struct image *i, const struct export_options *o,
                      struct complaint *why)
{
    struct verb_output out;
    struct grid grid;
    const float *intensity = intensity_of(i, &grid, o, why);
    int err = intensity ? verb_output_begin(&out, o->out, why) : -EBADMSG;

    if (err)
        return err;
    char *slash = strrchr(out.temporary, '/');
    if (slash)
        *slash = '\0';
    err = export_nrrd(!slash                   ? "."
                      : slash == out.temporary ? "/"
                                               : out.temporary,
                      slash ? slash + 1 : out.temporary, &grid, intensity, why);
    if (slash)
        *slash = '/';
    return verb_output_end(&out, err, why);
}

int export_nrrd_file(struct stream *s, const struct export_options *o,
                     struct complaint *why)
{
    struct image image = {NULL, NULL};
    int err = find_image(&image, s, o, why);

    if (!err)
        err = write_nrrd(&image, o, why);
    if (!err)
        err = say(&image, o->out);
    clear(&image);
    return err;
}

static int check_vacant(const char *out, struct complaint *why)
{
    static const char *const names[] = {"projection_xy.png", "projection_xz.png",
                                        "projection_yz.png"};
    return export_vacant(out, names, sizeof names / sizeof *names, why);
}

static int write_png(const struct image *i, const struct export_options *o,
                     struct complaint *why)
{
    struct export_stage stage;
    struct grid grid;
    const float *intensity = intensity_of(i, &grid, o, why);
    int err = intensity ? check_vacant(o->out, why) : -EBADMSG;

    if (!err)
        err = export_stage_begin(&stage, o->out, why);
    if (err)
        return err;
    err = export_projections(stage.path, &grid, intensity, i->detections, why);
    if (!err)
        err = export_stage_commit(&stage, why);
    if (err)
        export_stage_abandon(&stage);
    return err;
}

int export_png(struct stream *s, const struct export_options *o, struct complaint *why)
{
    struct image image = {NULL, NULL};
    int err = find_image(&image, s, o, why);

    if (!err)
        err = write_png(&image, o, why);
    if (!err)
        err = say(&image, o->out);
    clear(&image);
    return err;
}
