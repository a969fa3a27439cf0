/* SPDX-License-Identifier: MIT */
#include "nodes/recon/recon.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "msgs/convert.h"
#include "nodes/recon/volume_room.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/processors.h"

struct recon {
    struct scan_imager *imager;
    struct traces_room traces;
    struct volume_view view;
    int64_t taken_ns;
};

int recon_create(struct recon **out, const struct scan_imager_config *asked)
{
    struct scan_imager_config cfg = *asked;
    struct recon *r = calloc(1, sizeof *r);

    if (!r)
        return -ENOMEM;
    cfg.threads = cfg.threads ? cfg.threads : processors_usable();
    int err = scan_imager_create(&r->imager, &cfg);
    if (err)
        free(r);
    else
        *out = r;
    return err;
}

int recon_survey(struct recon *r, const Anlos__Survey *message, struct error *why)
{
    struct survey survey;

    if (recon_is_planned(r) && scan_imager_survey_id(r->imager) == message->id)
        return 0;
    scan_imager_forget(r->imager);
    int err = survey_from_message(&survey, message, why);
    if (err)
        return err;
    err = volume_room_check(&survey, why);
    if (!err)
        err = scan_imager_survey(r->imager, &survey, why);
    survey_clear(&survey);
    return launchfile_name_key(why, err);
}

bool recon_is_planned(const struct recon *r)
{
    return scan_imager_survey_id(r->imager) != 0;
}

void recon_traces(struct recon *r, const Anlos__Traces *message, int64_t capture_ns,
                  int64_t now_ns, Anlos__Receipt *receipt, char *note, size_t size)
{
    struct traces traces;

    note[0] = '\0';
    traces_from_message(&traces, &r->traces, message, capture_ns);
    int err = scan_imager_traces(r->imager, &traces);
    anlos__receipt__init(receipt);
    receipt->scan = message->scan;
    receipt->pass = ANLOS__PASS__SCENE;
    receipt->position = message->position;
    receipt->speaker = message->speaker;
    receipt->usable = !err;
    if (!err)
        r->taken_ns = now_ns;
    if (err == -EINVAL)
        snprintf(note, size, "traces that do not fit the survey cannot be used");
}

size_t recon_pings(const struct recon *r)
{
    return scan_imager_pings(r->imager);
}

size_t recon_pings_expected(const struct recon *r)
{
    return scan_imager_pings_expected(r->imager);
}

bool recon_is_complete(const struct recon *r)
{
    return scan_imager_is_complete(r->imager);
}

int64_t recon_capture_ns(const struct recon *r)
{
    return scan_imager_capture_ns(r->imager);
}

int64_t recon_taken_ns(const struct recon *r)
{
    return r->taken_ns;
}

bool recon_has_new_position(const struct recon *r)
{
    return scan_imager_has_new_position(r->imager);
}

void recon_image(struct recon *r, bool preview, Anlos__Volume *out)
{
    struct volume volume;

    scan_imager_image(r->imager, preview, &volume);
    volume_to_message(&volume, &r->view, out);
}

void recon_reset(struct recon *r)
{
    scan_imager_reset(r->imager);
}

void recon_destroy(struct recon *r)
{
    if (!r)
        return;
    scan_imager_destroy(r->imager);
    free(r);
}
