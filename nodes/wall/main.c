/* nodes/wall/main.c: "survey", "ping" or "wall/given", "ego" -> the walls -> "wall" */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/rt/early.h"
#include "nodes/rt/node.h"
#include "nodes/wall/keeper.h"
#include "nodes/wall/listener.h"

#define PERIOD_NS 100000000LL  /* from list to list */
#define QUIET_NS  1000000000LL /* without pings */

struct run {
    struct node *node;
    enum wall_from from;
    struct keeper keeper;
    struct listener *listener; /* with from: echoes, once the survey is known */
    struct survey survey;
    uint64_t survey_id;
    bool has_survey;
    int64_t published_ns; /* stamp of the newest list */
    int64_t heard_ns;     /* when the newest ping came in */
    size_t unusable;      /* pings, said in the log already */
    struct early early;
};

static size_t counts(void *ctx, struct device_count *out)
{
    const struct run *r = ctx;

    return early_count(&r->early, out);
}

static void tell_state(struct run *r, const Anlos__WallList *list)
{
    if (list->text[0])
        node_state(r->node, ANLOS__HEALTH__STATE__DEGRADED, "%s", list->text);
    else
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "%zu wall%s", list->n_walls,
                   list->n_walls == 1 ? "" : "s");
}

static int take_survey(struct run *r, const Anlos__Survey *m)
{
    const struct launchfile *l = node_launch(r->node);
    const struct listener_config cfg = {.vertical = l->wall.vertical,
                                        .vertical_rad = l->wall.vertical_deg *
                                                        3.14159265358979 / 180.0,
                                        .reach_m = l->wall.reach_m,
                                        .every_s = l->wall.every_s};
    struct complaint why = {""};
    struct survey fresh;

    if (r->has_survey && r->survey_id == m->id)
        return 0;
    int err = survey_from_message(&fresh, m, &why);
    if (!err) {
        listener_destroy(r->listener);
        r->listener = NULL;
        survey_clear(&r->survey);
        r->survey = fresh;
        r->survey_id = m->id;
        r->has_survey = true;
        keeper_survey(&r->keeper, &r->survey);
        if (r->from == WALL_FROM_ECHOES)
            err = listener_create(&r->listener, &cfg, &r->survey, &why);
    }
    if (err) {
        node_state(r->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else {
        tell_state(r, keeper_list(&r->keeper));
        early_tell(&r->early, r->node);
    }
    return err;
}

/* The list of an instant, at most ten a second. */
static void publish(struct run *r, int64_t stamp_ns)
{
    if (!r->has_survey ||
        (stamp_ns >= r->published_ns && stamp_ns - r->published_ns < PERIOD_NS))
        return;
    const Anlos__WallList *list = keeper_list(&r->keeper);
    r->published_ns = stamp_ns;
    node_publish(r->node, topic_wall(), stamp_ns, &list->base);
    tell_state(r, list);
}

static void take_ping(struct run *r, const struct node_message *in)
{
    const Anlos__Ping *ping = (const Anlos__Ping *)in->content;
    struct wall_estimates heard;
    bool blind = false;

    if (!r->listener) {
        r->early.n++;
        return;
    }
    r->heard_ns = node_now_ns(r->node);
    keeper_advance(&r->keeper, in->capture_ns);
    if (listener_ping(r->listener, ping, in->capture_ns, keeper_path(&r->keeper), &heard,
                      &blind) &&
        !blind)
        keeper_estimates(&r->keeper, &heard);
    if (listener_unusable(r->listener) != r->unusable) {
        r->unusable = listener_unusable(r->listener);
        node_log(r->node, LOG_LEVEL_WARNING, "%zu pings could not be used", r->unusable);
    }
    publish(r, in->capture_ns);
}

static void take_given(struct run *r, const struct node_message *in)
{
    struct complaint why = {""};

    if (r->has_survey && keeper_given(&r->keeper, (const Anlos__WallList *)in->content,
                                      in->capture_ns, &why))
        node_log(r->node, LOG_LEVEL_WARNING, "%s", why.text);
}

/* What is not heard itself is told for the present; so is what was heard, when no pings
 * come any more. */
static void tick(struct run *r)
{
    int64_t now_ns = node_now_ns(r->node);

    if (r->from == WALL_FROM_ECHOES && now_ns - r->heard_ns < QUIET_NS)
        return;
    keeper_advance(&r->keeper, now_ns);
    publish(r, now_ns);
}

static int subscribe(struct run *r)
{
    int err = node_subscribe(r->node, topic_survey());

    if (!err)
        err = node_subscribe(r->node, topic_ego());
    if (!err && r->from == WALL_FROM_ECHOES)
        err = node_subscribe(r->node, topic_ping());
    if (!err && r->from == WALL_FROM_TOPIC)
        err = node_subscribe(r->node, topic_wall_given());
    return err;
}

static int run(struct run *r)
{
    struct node_message in;
    int err = subscribe(r);

    node_device(r->node, counts, r);
    node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
    while (!err) {
        err = node_next(r->node, &in, 100);
        if (err == -ETIMEDOUT)
            err = 0;
        else if (!err && in.topic == topic_survey())
            err = take_survey(r, (const Anlos__Survey *)in.content);
        else if (!err && in.topic == topic_ego())
            keeper_ego(&r->keeper, (const Anlos__EgoMotion *)in.content, in.capture_ns);
        else if (!err && in.topic == topic_ping())
            take_ping(r, &in);
        else if (!err)
            take_given(r, &in);
        if (!err)
            tick(r);
    }
    node_device(r->node, NULL, NULL);
    return err;
}

int main(int argc, char **argv)
{
    struct run r = {.early = {.count = "pings before the survey"}};
    int err = node_create(&r.node, "wall", "Tells where the walls are that mirror sound.",
                          argc, argv);

    if (err)
        return err - 1;
    r.from = node_launch(r.node)->wall.from;
    keeper_init(&r.keeper, node_launch(r.node));
    err = run(&r);
    listener_destroy(r.listener);
    survey_clear(&r.survey);
    return node_finish(r.node, err);
}
