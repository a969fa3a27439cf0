#include "nodes/anlos/bench/drive_run.h"

#include <errno.h>
#include <stdlib.h>

#include "nodes/anlos/bench/drive_pipe.h"
#include "nodes/anlos/bench/drive_score.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/rt/objects.h"

static int score_next(struct drive_pipe *p, struct drive_score *score,
                      struct drive_moments *moments, double *t_s, struct complaint *why)
{
    struct drive_moment moment;
    struct drive_image image;
    int err = drive_pipe_next(p, &image, why);

    if (err)
        return err;
    drive_score_list(score, image.t_s, image.out_s, image.tracks, image.detections,
                     &moment);
    objects_free(image.tracks);
    objects_free(image.detections);
    *t_s = image.t_s;
    return drive_moments_add(moments, &moment) ? complain(why, -ENOMEM, "out of memory")
                                               : 0;
}

static int run(const struct drive_run *r, struct drive_pipe *p, struct drive_score *score,
               struct drive_outcome *out)
{
    int err = drive_pipe_create(p, r->launch, r->scene, r->draw, r->threads, &out->why);

    if (err)
        return err;
    const struct room *room = p->world.room;
    const struct drive_truth truth = drive_truth_room(room);
    double t_s = drive_world_s(p->world.begin_ns);
    double end_s = t_s + (double)r->rounds * room_period_s(room);
    drive_score_init(score, &truth, room_survey(room), t_s);
    while (!err && t_s < end_s && !interrupt_requested())
        err = score_next(p, score, &out->moments, &t_s, &out->why);
    drive_score_end(score);
    out->result = score->result;
    if (!err && interrupt_requested())
        err = complain(&out->why, -EINTR, "interrupted");
    return err;
}

void drive_run(const struct drive_run *r, struct drive_outcome *out)
{
    struct drive_score *score = calloc(1, sizeof *score);
    struct drive_pipe *p = calloc(1, sizeof *p);

    *out = (struct drive_outcome){.err = -ENOMEM};
    if (score && p) {
        out->err = run(r, p, score, out);
        drive_pipe_clear(p);
    } else {
        complain(&out->why, -ENOMEM, "out of memory");
    }
    free(p);
    free(score);
}
