#include "nodes/rt/launchfile_play.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/place.h"

int launchfile_play_rate(const char *text, double *out)
{
    char *end;

    *out = 0.0;
    if (!strcmp(text, "max"))
        return 0;
    *out = strtod(text, &end);
    return end == text || *end || !(*out >= 1e-3 && *out <= 1e6) ? -EINVAL : 0;
}

/* A path of the file is relative to its folder, one of the command line to ours. */
static char *bag_path(const struct launchfile *l, const char *in_file,
                      const struct launchfile_options *options)
{
    if (options && options->bag)
        return strdup(options->bag);
    return in_file ? launchfile_beside(l, in_file) : strdup("");
}

static int copy_texts(struct launchfile *l, const struct launch_text_play *t,
                      const struct launchfile_options *options)
{
    const struct {
        char **to;
        const char *from;
    } texts[] = {{&l->play.topics, t->topics},
                 {&l->play.exclude, t->exclude},
                 {&l->play.remap, t->remap}};

    l->play.bag = bag_path(l, t->bag, options);
    if (!l->play.bag)
        return -ENOMEM;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        if (texts[i].from && !(*texts[i].to = strdup(texts[i].from)))
            return -ENOMEM;
    return 0;
}

static int take_rate(struct launchfile *l, const char *asked, const char *in_file,
                     struct error *why)
{
    const char *rate = asked ? asked : in_file ? in_file : "1";

    if (!launchfile_play_rate(rate, &l->play.rate))
        return 0;
    if (asked)
        return error_say(why, -EINVAL, "--rate %s: expected max, or 0.001 to 1000000",
                         rate);
    return yaml_error_say(why, -EINVAL, l->path, "play.rate",
                          "expected max, or 0.001 to 1000000, not %s", rate);
}

int launchfile_copy_play(struct launchfile *l, const struct launch_text *t,
                         const struct launchfile_options *options, struct error *why)
{
    bool plays = launchfile_has_node(l, "play");
    int err = copy_texts(l, &t->play, options);

    if (!err)
        err = take_rate(l, options ? options->rate : NULL, t->play.rate, why);
    if (err)
        return err;
    if (options && (options->bag || options->rate) && !plays)
        return error_say(why, -EINVAL,
                         "%s: --bag and --rate are for launch files with the node play, "
                         "as launch/play.yaml",
                         l->path);
    if (plays && !l->play.bag[0])
        return yaml_error_say(why, -EINVAL, l->path, "play.bag",
                              "expected the name of a bag; or say --bag FILE");
    l->play.loop = t->play.loop && *t->play.loop;
    l->play.start_s = t->play.start_s ? *t->play.start_s : 0.0;
    l->play.end_s = t->play.end_s ? *t->play.end_s : INFINITY;
    if (!(l->play.start_s >= 0.0 && l->play.start_s <= l->play.end_s))
        return yaml_error_say(why, -EINVAL, l->path, "play.start_s",
                              "expected 0 or more, and no more than end_s");
    return 0;
}

void launchfile_free_play(struct launchfile *l)
{
    free(l->play.bag);
    free(l->play.topics);
    free(l->play.exclude);
    free(l->play.remap);
}
