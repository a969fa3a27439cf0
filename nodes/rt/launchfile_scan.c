#include "nodes/rt/launchfile_scan.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/place.h"

enum { DEFAULT_FRAMES = 8, MOST_FRAMES = 1000 };
#define DEFAULT_BACKGROUND_S 10.0
#define MOST_BACKGROUND_S    3600.0

static int copy_mode(struct launchfile *l, const struct launch_text *t, struct error *why)
{
    const char *mode = t->scan.mode ? t->scan.mode : "stepped";

    l->scan.fixed = !strcmp(mode, "fixed");
    if (l->scan.fixed || !strcmp(mode, "stepped"))
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, "scan.mode",
                          "expected stepped or fixed, not %s", mode);
}

static int refuse_of_stepped(const struct launchfile *l, const struct launch_text *t,
                             struct error *why)
{
    const char *key = t->scan.speakers_count      ? "scan.speakers"
                      : t->scan.background_frames ? "scan.background_frames"
                      : t->dsp.background_s       ? "dsp.background_s"
                      : t->dsp.background         ? "dsp.background"
                                                  : NULL;

    return key && !l->scan.fixed
               ? yaml_error_say(why, -EINVAL, l->path, key,
                                "is of an array that stands; expected it with scan.mode: "
                                "fixed")
               : 0;
}

static int copy_speakers(struct launchfile *l, const struct launch_text *t,
                         struct error *why)
{
    size_t n = t->scan.speakers_count;

    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < i; k++)
            if (t->scan.speakers[k] == t->scan.speakers[i])
                return yaml_error_say(why, -EINVAL, l->path, "scan.speakers",
                                      "expected each speaker once, but %u is there twice",
                                      t->scan.speakers[i]);
    if (!n)
        return 0;
    l->scan.speakers = malloc(n * sizeof *l->scan.speakers);
    if (!l->scan.speakers)
        return -ENOMEM;
    memcpy(l->scan.speakers, t->scan.speakers, n * sizeof *l->scan.speakers);
    l->scan.n_speakers = n;
    return 0;
}

static int copy_frames(struct launchfile *l, const struct launch_text *t,
                       struct error *why)
{
    unsigned frames = t->scan.background_frames ? *t->scan.background_frames
                                                : DEFAULT_FRAMES;

    l->scan.background_frames = frames;
    if (frames >= 1 && frames <= MOST_FRAMES)
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, "scan.background_frames",
                          "expected 1 to %d, not %u", MOST_FRAMES, frames);
}

static int copy_background(struct launchfile *l, const struct launch_text *t,
                           struct error *why)
{
    static const char *const names[] = {[BACKGROUND_NONE] = "none",
                                        [BACKGROUND_RECORDED] = "recorded",
                                        [BACKGROUND_ADAPTIVE] = "adaptive"};
    const char *name = t->dsp.background;
    double s = t->dsp.background_s ? *t->dsp.background_s : DEFAULT_BACKGROUND_S;
    unsigned mode = l->scan.background ? BACKGROUND_RECORDED : BACKGROUND_NONE;

    for (mode = name ? 0 : mode; name && mode <= BACKGROUND_ADAPTIVE; mode++)
        if (!strcmp(names[mode], name))
            break;
    if (mode > BACKGROUND_ADAPTIVE)
        return yaml_error_say(why, -EINVAL, l->path, "dsp.background",
                              "expected none, recorded or adaptive, not %s", name);
    if ((mode == BACKGROUND_RECORDED) != l->scan.background)
        return yaml_error_say(why, -EINVAL, l->path, "dsp.background",
                              "%s does not go with scan.background: %s, which says "
                              "whether one is recorded",
                              names[mode], l->scan.background ? "true" : "false");
    if (!(s > 0 && s <= MOST_BACKGROUND_S))
        return yaml_error_say(why, -EINVAL, l->path, "dsp.background_s",
                              "expected over 0 and up to %g, not %g", MOST_BACKGROUND_S,
                              s);
    l->dsp.background = (enum background_mode)mode;
    l->dsp.background_s = s;
    return 0;
}

int launchfile_copy_scan(struct launchfile *l, const struct launch_text *t,
                         struct error *why)
{
    l->scan.background = t->scan.background && *t->scan.background;
    int err = copy_mode(l, t, why);
    if (!err)
        err = refuse_of_stepped(l, t, why);
    if (!err)
        err = copy_speakers(l, t, why);
    if (!err)
        err = copy_frames(l, t, why);
    if (!err)
        err = copy_background(l, t, why);
    return err;
}

void launchfile_free_scan(struct launchfile *l)
{
    free(l->scan.speakers);
}
