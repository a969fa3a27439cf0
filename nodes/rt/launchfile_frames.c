#include "nodes/rt/launchfile_frames.h"

#include <errno.h>
#include <string.h>

#include "hal/survey/place.h"

static int refuse_of_stepped(const struct launchfile *l, const struct launch_text *t,
                             struct error *why)
{
    const struct launch_text_frames *f = &t->recon.frames;

    if (l->scan.fixed || !(f->pings || f->sum || f->every))
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, "recon.frames",
                          "is of an array that stands; expected it with scan.mode: "
                          "fixed");
}

static int refuse_of_fixed(const struct launchfile *l, const struct launch_text *t,
                           struct error *why)
{
    bool has_option = false;

    if (!l->scan.fixed)
        return 0;
    for (const struct imager_option *i = imager_option_table; i->name; i++)
        has_option = has_option || launch_text_option(t, i->name);
    const char *key = t->recon.method    ? "recon.method"
                      : has_option       ? "recon.options"
                      : t->recon.preview ? "recon.preview"
                                         : NULL;
    if (!key)
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, key,
                          "is for scans: with scan.mode: fixed expected recon.frames");
}

static int copy(struct launchfile *l, const struct launch_text *t, struct error *why)
{
    const struct launch_text_frames *f = &t->recon.frames;
    const char *sum = f->sum ? f->sum : "power", *every = f->every ? f->every : "frame";

    l->recon.frames.pings = f->pings ? *f->pings : 0;
    l->recon.frames.sum = strcmp(sum, "power") ? FRAMES_COHERENT : FRAMES_POWER;
    l->recon.frames.every_ping = !strcmp(every, "ping");
    if (l->recon.frames.pings > FRAMES_MAX_PINGS)
        return yaml_error_say(why, -EINVAL, l->path, "recon.frames.pings",
                              "expected 0 to %d, not %u", FRAMES_MAX_PINGS,
                              l->recon.frames.pings);
    if (strcmp(sum, "power") && strcmp(sum, "coherent"))
        return yaml_error_say(why, -EINVAL, l->path, "recon.frames.sum",
                              "expected coherent or power, not %s", sum);
    if (strcmp(every, "ping") && strcmp(every, "frame"))
        return yaml_error_say(why, -EINVAL, l->path, "recon.frames.every",
                              "expected ping or frame, not %s", every);
    return 0;
}

int launchfile_copy_frames(struct launchfile *l, const struct launch_text *t,
                           struct error *why)
{
    int err = refuse_of_stepped(l, t, why);

    if (!err)
        err = refuse_of_fixed(l, t, why);
    return err ? err : copy(l, t, why);
}
