#include "nodes/anlos/replay/replay.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "msgs/convert.h"
#include "msgs/topics.h"
#include "nodes/anlos/bag/stream.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/replay/report.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"

static const char topics[] = "survey,ping,scan/status,ego,ambient,wall,wall/given";

/* The nodes begin when they know the survey. */
static int begin(struct replay *r, const Anlos__Survey *survey, struct error *why)
{
    struct chain_config cfg = r->settings.chain;
    char reason[256];

    struct scan_imager_config *scan = &cfg.pipeline.scan;
    if (!scan->method) {
        scan->method = survey->n_pings_m ? "backprojection" : "fast";
        r->settings.chain.pipeline.scan.method = scan->method;
        if (imager_options_check(scan->options, scan->method, reason, sizeof reason))
            return error_say(why, -EINVAL, "--set %s", reason);
    }
    cfg.can = r->can;
    int err = chain_create(&r->chain, &cfg, r->stages);
    r->begun = true;
    return err ? error_say(why, err, "%zu threads: %s", scan->threads, strerror(-err))
               : 0;
}

/* Nothing that comes out of a recording may look live. */
static int take_survey(struct replay *r, Anlos__Survey *survey, struct error *why)
{
    int err = 0;

    survey->source = ANLOS__SOURCE__REPLAY;
    survey_complete_id(survey);
    if (!r->begun)
        err = begin(r, survey, why);
    if (!err)
        err = chain_survey(&r->chain, survey, why);
    if (err || (r->survey.n_positions && r->survey_id == survey->id))
        return err;
    survey_clear(&r->survey);
    r->survey_id = survey->id;
    err = survey_from_message(&r->survey, survey, why);
    return err ? err : processing_plan(&r->processing, &r->survey, why);
}

static int take(struct replay *r, const struct stream_message *m,
                ProtobufCMessage *content, struct error *why)
{
    const struct envelope *e = &m->envelope;

    if (m->topic == topic_survey())
        return take_survey(r, (Anlos__Survey *)content, why);
    if (!r->begun)
        return 0;
    if (m->topic == topic_ping()) {
        Anlos__Ping *ping = (Anlos__Ping *)content;
        if (!ping->survey_id) /* another program recorded it */
            ping->survey_id = r->survey_id;
        return chain_ping(&r->chain, ping, e->capture_ns, e->publish_ns, why);
    }
    if (m->topic == topic_scan_status())
        return chain_status(&r->chain, (Anlos__ScanStatus *)content, e->epoch_ns, why);
    if (m->topic == topic_ego())
        chain_ego(&r->chain, (Anlos__EgoMotion *)content, e->capture_ns, e->publish_ns);
    else if (m->topic == topic_ambient())
        chain_ambient(&r->chain, (Anlos__Ambient *)content);
    else if (m->topic == topic_wall_given())
        chain_given(&r->chain, (Anlos__WallList *)content, e->capture_ns, e->publish_ns);
    else
        chain_walls(&r->chain, (Anlos__WallList *)content, e->capture_ns);
    return 0;
}

static int take_next(struct replay *r, struct stream *s, struct error *why)
{
    struct stream_message m;
    struct stopwatch now = stopwatch_now(false);
    int err = stream_next(s, &m, why);
    ProtobufCMessage *content = err ? NULL : stream_unpack(&m);

    stopwatch_lap(&r->stages[RECON_READ], &now, false);
    if (err)
        return err;
    if (!content)
        return error_say(why, -EBADMSG, "%s: a message of \"%.*s\" is none",
                         r->options->bag, (int)m.channel->topic.size,
                         (const char *)m.channel->topic.data);
    err = take(r, &m, content, why);
    protobuf_c_message_free_unpacked(content, NULL);
    return err;
}

/* The first survey comes before all else, as play has it: a bag that was cut begins with
 * pings. */
static int read_bag(struct replay *r, struct stream *s, struct error *why)
{
    stream_select(s, topic_survey()->name);
    int err = take_next(r, s, why);

    if (err && err != -ENODATA)
        return err;
    stream_select(s, topics);
    stream_rewind(s);
    do
        err = take_next(r, s, why);
    while (!err);
    if (err != -ENODATA)
        return err;
    return r->begun ? chain_end(&r->chain, why) : 0;
}

/* Why there is no image. */
static int error_say_of_nothing(const struct replay *r, struct error *why)
{
    const struct chain *c = &r->chain;
    const char *bag = r->options->bag;

    if (!r->begun)
        return error_say(why, -ENODATA,
                         "%s: no survey; 'anlos bag info' shows what is in", bag);
    if (!c->n_scene_pings)
        return error_say(why, -ENODATA, "%s: no pings of a scene", bag);
    if (c->cfg.pipeline.frontend.background && !c->n_background_pings)
        return error_say(
            why, -ENODATA,
            "%s: %s asks for a background (scan.background), and no pings of "
            "one are there; --launch FILE names other settings",
            bag, r->settings.name);
    return error_say(why, -ENODATA, "%s: of %zu pings none is usable%s%s", bag,
                     c->n_scene_pings, c->n_notes ? ": " : "",
                     c->n_notes ? c->notes[0].text : "");
}

static int process(struct replay *r, struct stream *s, const char *folder,
                   struct error *why)
{
    char uri[PATH_MAX + 32];

    snprintf(uri, sizeof uri, "log:%s/" REPLAY_CAN_FILE, folder);
    int err = canbus_open(&r->can, uri, why);
    if (!err)
        err = read_bag(r, s, why);
    if (!err && !r->chain.detections)
        err = error_say_of_nothing(r, why);
    canbus_close(r->can);
    r->can = NULL;
    return err;
}

static int run_in_stage(struct replay *r, struct stream *s, struct export_stage *stage,
                        const struct stopwatch *began, struct error *why)
{
    int err = process(r, s, stage->path, why);

    r->bad_input = err && err != -ENOMEM && err != -EINTR && err != -EAGAIN &&
                   err != -ENOSPC && err != -EIO;
    if (!err)
        err = replay_write(r, stage->path, began, why);
    if (!err && interrupt_requested())
        err = error_say(why, -EINTR, "interrupted");
    return err ? err : export_stage_commit(stage, why);
}

static bool has_topic(const struct stream *s, const struct topic *t)
{
    return !stream_require(s, t->name, NULL);
}

/* As in a replay by the nodes, node wall tells of the walls where the launch file has it,
 * else the lists of the recording do.  Walls that the launch file asks for are not left
 * out without a word. */
static int choose_walls(struct replay *r, const struct stream *s, struct error *why)
{
    const struct launchfile *l = r->settings.launch;
    const char *bag = r->options->bag, *name = r->settings.name;

    if (!l || l->wall.from == WALL_FROM_SURVEY)
        return 0;
    bool *finds = &r->settings.chain.pipeline.finds_walls;
    if (!*finds && !has_topic(s, topic_wall())) {
        if (l->wall.from == WALL_FROM_TOPIC)
            return error_say(why, -ENODATA,
                             "%s: %s asks for the walls of the recording (wall: {from: "
                             "topic}, and no node wall), and no lists of them are there; "
                             "--launch FILE names other settings",
                             bag, name);
        *finds = true;
    }
    if (*finds && l->wall.from == WALL_FROM_TOPIC && !has_topic(s, topic_wall_given()))
        return error_say(why, -ENODATA,
                         "%s: %s asks for walls that the vehicle gave (wall: {from: "
                         "topic}), and none are there (wall/given); --launch FILE names "
                         "other settings%s",
                         bag, name,
                         has_topic(s, topic_wall())
                             ? ": without the node wall they are those of the recording"
                             : "");
    return 0;
}

static int run(struct replay *r, const struct stopwatch *began, struct error *why)
{
    struct export_stage stage;
    struct stream *s = NULL;

    r->bad_input = true;
    int err = settings_load(&r->settings, r->options, why);
    if (!err)
        err = stream_open(&s, r->options->bag, why);
    if (!err)
        err = choose_walls(r, s, why);
    if (!err)
        err = export_stage_begin(&stage, r->options->out, why);
    if (!err) {
        err = run_in_stage(r, s, &stage, began, why);
        if (err)
            export_stage_abandon(&stage);
    }
    stream_close(s);
    return err;
}

int replay_run(const struct recon_options *options, const struct stopwatch *began)
{
    struct replay r = {.options = options};
    struct error why = {0};

    interrupt_catch();
    int err = run(&r, began, &why);
    if (err)
        fprintf(stderr, "anlos recon: %s\n", why.text);
    else
        replay_print(&r);
    if (r.begun)
        chain_clear(&r.chain);
    survey_clear(&r.survey);
    settings_clear(&r.settings);
    if (!err)
        return EXIT_WORKED;
    return err == -EINTR                   ? EXIT_INTERRUPTED
           : r.bad_input && err != -ENOMEM ? EXIT_BAD_INPUT
                                           : EXIT_FAILED;
}
