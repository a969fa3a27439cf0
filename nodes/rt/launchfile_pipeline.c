/* SPDX-License-Identifier: MIT */
#include "nodes/rt/launchfile_pipeline.h"

#include <math.h>
#include <string.h>

#include "nodes/rt/launchfile.h"
#include "nodes/rt/process.h"

static void track(struct object_tracker_config *out, const struct launch_track *t,
                  double walls_s)
{
    *out = (struct object_tracker_config){
        .detector = {.threshold_db = t->threshold_db,
                     .min_existence = t->min_existence,
                     .cfar = t->cfar,
                     .false_alarm_rate = t->false_alarm_rate},
        .mode = t->mode,
        .clutter = t->clutter,
        .sidelobe_db = t->sidelobe_db,
        .look_s = t->look_s,
        .walls_s = walls_s};
    track_config_default(&out->track);
    out->track.life.confirm_hits = t->confirm_hits;
    out->track.life.confirm_of = t->confirm_of;
    out->track.life.confirm_existence = t->confirm_existence;
    out->track.detection_probability = t->detection_probability;
    out->track.acceleration_psd_m2_s3 = t->acceleration_psd;
    out->track.join_m = t->join_m;
    out->track.coast_s = t->coast_s;
}

static void walls(struct wall_finder_config *out, const struct launchfile *l)
{
    double vertical_rad = l->wall.vertical_deg * M_PI / 180.0;

    *out = (struct wall_finder_config){.map = {.from = l->wall.from,
                                               .lost_s = l->wall.lost_s,
                                               .vertical_rad = vertical_rad,
                                               .n_corners = l->wall.n_corners},
                                       .listener = {.vertical = l->wall.vertical,
                                                    .vertical_rad = vertical_rad,
                                                    .reach_m = l->wall.reach_m,
                                                    .every_s = l->wall.every_s}};
    memcpy(out->map.free_view_m, l->wall.free_view_m, sizeof out->map.free_view_m);
}

static void range(struct range_config *out, const struct launchfile *l)
{
    *out = (struct range_config){.ranges = l->scan.fixed,
                                 .n_pings = l->recon.frames.pings ? l->recon.frames.pings
                                                                  : l->scan.n_speakers,
                                 .sum = l->recon.frames.sum,
                                 .false_alarm_rate = l->track.false_alarm_rate,
                                 .person_m = l->array.person_m};
}

static void imaging(struct pipeline_config *out, const struct launchfile *l)
{
    out->is_static = l->scan.fixed;
    out->array = (struct static_array_config){.frame_pings = l->scan.n_speakers,
                                              .pings = l->recon.frames.pings,
                                              .sum = l->recon.frames.sum,
                                              .every_ping = l->recon.frames.every_ping,
                                              .moving_only = l->dsp.background ==
                                                             BACKGROUND_ADAPTIVE};
    out->scan = (struct scan_imager_config){.method = l->recon.method,
                                            .options = &l->recon.options};
}

/* The stages agree on these. */
static void share(struct pipeline_config *out, size_t threads)
{
    out->array.compression = out->scan.compression = out->frontend.compression;
    out->array.threads = out->scan.threads = threads ? threads : processors_usable();
}

void launchfile_pipeline(struct pipeline_config *out, const struct launchfile *l)
{
    pipeline_config_default(out, l && l->scan.fixed);
    out->scan.method = NULL;
    if (l) {
        out->frontend = (struct frontend_config){.window = l->dsp.window,
                                                 .compression = l->dsp.compression,
                                                 .background = l->dsp.background,
                                                 .background_s = l->dsp.background_s};
        range(&out->frontend.range, l);
        imaging(out, l);
        out->finds_walls = launchfile_has_node(l, "wall");
        walls(&out->walls, l);
        track(&out->tracker, &l->track, l->wall.lost_s);
        out->frontend.hears_walls = out->finds_walls && l->wall.from == WALL_FROM_ECHOES;
        out->frontend.wall_reach_m = l->wall.reach_m;
    }
    share(out, l ? l->recon.threads : 0);
}

static const struct {
    const char *field, *key;
} keys[] = {
    {"array", "scan.mode"},
    {"window", "dsp.window"},
    {"compression", "dsp.compression"},
    {"background", "dsp.background"},
    {"method", "recon.method"},
    {"threads", "recon.threads"},
    {"frame_pings", "scan.speakers"},
    {"image_pings", "recon.frames.pings"},
    {"false_alarm_rate", "track.cfar"},
    {"walls", "wall.from"},
    {"reach_m", "wall.reach_m"},
};

int launchfile_name_key(struct error *why, int err)
{
    size_t length = why && err ? strcspn(why->text, ": ") : 0;

    for (size_t i = 0; length && i < sizeof keys / sizeof *keys; i++) {
        const struct error was = *why;
        bool is_field = strlen(keys[i].field) == length &&
                        !strncmp(was.text, keys[i].field, length) &&
                        (was.text[length] == ':' || was.text[length + 1] == '\'');
        if (is_field)
            return error_say(why, err, "%s%s", keys[i].key, was.text + length);
    }
    return err;
}
