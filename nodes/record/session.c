/* SPDX-License-Identifier: MIT */
#include "nodes/record/session.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "dsp/error.h"
#include "msgs/bag/manifest.h"
#include "nodes/record/pairs.h"
#include "nodes/record/revision.h"
#include "nodes/rt/uri.h"

#define LEFT_OUT_SIZE 300 /* of a reason */

static size_t folder_length(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash ? (size_t)(slash - path) + 1 : 0;
}

/* The path as it is written in the launch file; without folders if it leaves the launch
 * file's. */
static const char *name_within(const char *path, const char *launch)
{
    size_t n = folder_length(launch);

    if (!strncmp(path, "./", 2) && !n)
        path += 2;
    if (!strncmp(path, launch, n) && path[n] != '/' && !strstr(path + n, ".."))
        return path + n;
    return path + folder_length(path);
}

static int add_launch_file(struct session *s, const char *path, const char *launch,
                           char name[PATH_MAX], struct error *why)
{
    if (snprintf(name, PATH_MAX, "%s%s", MANIFEST_LAUNCH_FOLDER,
                 name_within(path, launch)) >= PATH_MAX)
        return error_say(why, -ENAMETOOLONG, "%.500s: path too long", path);
    return attachments_add_file(&s->attachments, name, path, why);
}

/* One of the inputs; path is freed.  A folder (of WAV files) is no input but the sound
 * itself. */
static int add_input(struct session *s, char *path, const char *launch,
                     struct error *left_out)
{
    char name[PATH_MAX];
    struct error reason = {""};
    int err = path ? 0 : -ENOMEM;

    if (path && *path)
        err = add_launch_file(s, path, launch, name, &reason);
    free(path);
    if (!err || err == -ENOMEM || err == -EISDIR)
        return err == -ENOMEM ? err : 0;
    text_add(left_out->text, sizeof left_out->text, "; ", "%.*s", LEFT_OUT_SIZE,
             reason.text);
    return 0;
}

int session_add_launch(struct session *s, const struct launchfile *l,
                       struct error *left_out, struct error *why)
{
    static const char *const options[] = {"survey", "calibrated", "rig"};
    const char *uri = l->array.uri;
    char name[PATH_MAX];
    int err = add_launch_file(s, l->path, l->path, name, why);

    if (err)
        return err;
    s->launch = strdup(name);
    if (!s->launch)
        return error_say(why, -ENOMEM, "out of memory");
    if (uri_has_scheme(uri, "sim"))
        err = add_input(s, uri_path(uri), l->path, left_out);
    for (size_t i = 0; !err && i < sizeof options / sizeof *options; i++)
        err = add_input(s, uri_option(uri, options[i]), l->path, left_out);
    return err ? error_say(why, err, "out of memory") : 0;
}

static void put_start(struct pairs *p, int64_t ns)
{
    char date[32], text[64];
    time_t s = (time_t)(ns / 1000000000);
    struct tm utc;

    strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%S", gmtime_r(&s, &utc));
    snprintf(text, sizeof text, "%s.%09dZ", date, (int)(ns % 1000000000));
    pairs_text(p, MANIFEST_STARTED, text);
    pairs_stamp(p, MANIFEST_START_NS, ns);
}

int session_write(const struct session *s, unsigned part, int64_t now_ns,
                  struct bag_writer *w, struct error *why)
{
    struct pairs p = {0};
    char host[HOST_NAME_MAX + 1] = "";

    gethostname(host, sizeof host - 1);
    pairs_text(&p, MANIFEST_VERSION, ANLOS_VERSION);
    pairs_text(&p, MANIFEST_REVISION, ANLOS_REVISION);
    pairs_text(&p, MANIFEST_HOST, host);
    put_start(&p, s->start_ns);
    if (s->launch)
        pairs_text(&p, MANIFEST_LAUNCH, s->launch);
    pairs_text(&p, MANIFEST_TOPICS, s->topics);
    pairs_text(&p, MANIFEST_EXCLUDE, s->exclude ? s->exclude : "");
    pairs_count(&p, MANIFEST_PART, part);
    int err = pairs_write(&p, MANIFEST_SESSION, w, why);
    pairs_clear(&p);
    return err ? err : attachments_write(&s->attachments, w, now_ns, why);
}

void session_clear(struct session *s)
{
    attachments_clear(&s->attachments);
    free(s->launch);
    *s = (struct session){0};
}
