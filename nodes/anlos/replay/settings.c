#include "nodes/anlos/replay/settings.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "msgs/bag/catalog.h"
#include "msgs/bag/manifest.h"
#include "nodes/can/config.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "recon/imaging/imager.h"

static bool is_text(struct bytes b, const char *text)
{
    return b.size == strlen(text) && !memcmp(b.data, text, b.size);
}

static void copy_text(char *out, size_t size, struct bytes b)
{
    snprintf(out, size, "%.*s", (int)(b.size < size ? b.size : size - 1),
             b.size ? (const char *)b.data : "");
}

/* What the recorder says of itself. */
static int read_session(struct settings *s, const struct bag_catalog *bag,
                        struct error *why)
{
    struct bytes_buffer into = {0};
    struct bag_record r;
    struct bytes key, value;
    int err = 0;

    for (size_t i = 0; !err && i < bag->n_metadata; i++) {
        const struct bag_record *index = &bag->metadata[i].record;
        if (!is_text(index->metadata_index.name, MANIFEST_SESSION))
            continue;
        err = bag_catalog_read(bag, index, &into, &r, why);
        while (!err && bag_map_next(&r.metadata.metadata, &key, &value)) {
            if (is_text(key, MANIFEST_LAUNCH))
                copy_text(s->name, sizeof s->name, value);
            if (is_text(key, MANIFEST_REVISION))
                copy_text(s->revision, sizeof s->revision, value);
        }
    }
    bytes_free(&into);
    return err;
}

static int read_launch(struct settings *s, const struct bag_catalog *bag,
                       struct error *why)
{
    struct bytes_buffer into = {0};
    struct bag_record r;
    char name[512];
    int err = 0;

    for (size_t i = 0; !err && !s->launch && i < bag->n_attachments; i++) {
        const struct bag_record *index = &bag->attachments[i].record;
        if (!s->name[0] || !is_text(index->attachment_index.name, s->name))
            continue;
        snprintf(name, sizeof name, "%s in the bag", s->name);
        err = bag_catalog_read(bag, index, &into, &r, why);
        if (!err)
            err = launchfile_parse(&s->launch, name, r.attachment.data.data,
                                   r.attachment.data.size, why);
    }
    bytes_free(&into);
    return err;
}

/* What the command line says wins.  Another method does not take the options of the
 * launch file's. */
static int take_imaging(struct settings *s, const struct recon_options *o,
                        struct error *why)
{
    struct scan_imager_config *c = &s->chain.pipeline.scan;
    char reason[256];

    if (s->chain.pipeline.is_static && (o->method || o->imaging->given))
        return error_say(why, -EINVAL,
                         "--%s is for scans; the frames of a fixed array have one way",
                         o->method ? "method" : "set");
    if (o->method)
        c->method = o->method;
    s->imaging = c->options && !o->method ? *c->options : *o->imaging;
    imager_options_overlay(&s->imaging, o->imaging);
    c->options = &s->imaging;
    if (c->method && imager_options_check(c->options, c->method, reason, sizeof reason))
        return error_say(why, -EINVAL, "--set %s", reason);
    return 0;
}

static void take_options(struct pipeline_config *c, const struct recon_options *o)
{
    if (o->has_window)
        c->frontend.window = o->window;
    if (o->has_compression)
        c->frontend.compression = o->compression;
    c->scan.threads = c->array.threads = o->threads;
}

int settings_load(struct settings *s, const struct recon_options *o, struct error *why)
{
    struct bag_catalog *bag = NULL;

    *s = (struct settings){.launch = NULL};
    int err = bag_catalog_open(&bag, o->bag, why);
    if (!err)
        err = read_session(s, bag, why);
    if (!err && o->launch) {
        snprintf(s->name, sizeof s->name, "%s", o->launch);
        err = launchfile_load(&s->launch, o->launch, NULL, why);
    } else if (!err) {
        err = read_launch(s, bag, why);
    }
    bag_catalog_close(bag);
    if (err)
        return err;
    if (!s->launch)
        s->name[0] = '\0';
    launchfile_pipeline(&s->chain.pipeline, s->launch);
    can_config_sender(&s->chain.sender, s->launch);
    take_options(&s->chain.pipeline, o);
    return take_imaging(s, o, why);
}

void settings_clear(struct settings *s)
{
    launchfile_destroy(s->launch);
    s->launch = NULL;
}
