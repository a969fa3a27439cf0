#include "nodes/anlos/bag/record_job.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "nodes/anlos/bag/record_show.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/topic/watch.h"
#include "nodes/record/choice.h"
#include "nodes/record/session.h"
#include "nodes/record/tap.h"
#include "nodes/rt/rundir.h"

#define LOOK_MS        100 /* between looks at Ctrl-C and the clock */
#define SHOW_PERIOD_NS 1000000000LL

struct job {
    const struct record_options *options;
    const struct clock_source *clock;
    char run_dir[RUNDIR_SIZE];
    struct choice choice;
    struct session session;
    struct bus *bus;
    struct recorder *recorder;
    struct tap tap;
    struct record_show show;
    int64_t start_ns;
};

static int open_session(struct job *j, struct complaint *why)
{
    const struct record_options *o = j->options;
    struct complaint left_out = {""};
    struct launchfile *launch = NULL;

    j->session.topics = o->topics;
    j->session.exclude = o->exclude;
    j->session.start_ns = j->start_ns;
    int err = o->launch ? launchfile_load(&launch, o->launch, NULL, why) : 0;
    if (!err && launch)
        err = session_add_launch(&j->session, launch, &left_out, why);
    launchfile_destroy(launch);
    if (left_out.text[0])
        fprintf(stderr, "anlos bag record: not attached: %s\n", left_out.text);
    return err;
}

static int open_bus(struct job *j, struct complaint *why)
{
    const struct bus_config cfg = {.run_dir = j->run_dir, .listen_only = true};
    int err = rundir_open(j->run_dir, j->options->run_dir, why);

    if (err)
        return err;
    if (!topic_watch_alive(j->run_dir))
        fprintf(stderr, "anlos bag record: nothing is running in %s yet; waiting\n",
                j->run_dir);
    return bus_create(&j->bus, &cfg, why);
}

static int open_recorder(struct job *j, struct complaint *why)
{
    const struct record_options *o = j->options;
    const struct recorder_config cfg = {
        .path = o->out,
        .topics = j->choice.topics,
        .n_topics = j->choice.n,
        .split_bytes = (uint64_t)(1e6 * o->split_mb),
        .split_ns = (int64_t)(1e9 * o->split_s),
        .quota_bytes = (uint64_t)(1e6 * o->quota_mb),
        .flush_ns = (int64_t)(1e6 * o->flush_ms),
        .compression = o->compression,
        .session = &j->session,
        .say = record_show_text,
        .context = &j->show,
    };
    int err = recorder_create(&j->recorder, &cfg, j->start_ns, why);

    if (err)
        return err;
    err = tap_open(&j->tap, j->bus, j->recorder, &cfg, j->clock);
    return err ? complain(why, err, "cannot subscribe: %s", strerror(-err)) : 0;
}

static double elapsed_s(const struct job *j)
{
    return 1e-9 * (double)(clock_now_ns(j->clock) - j->start_ns);
}

static int record(struct job *j, struct complaint *why)
{
    int64_t show_ns = 0;
    int err = 0;

    while (!err && !interrupt_requested()) {
        double left_s = j->options->duration_s - elapsed_s(j);
        if (left_s <= 0.0)
            break;
        err = tap_step(&j->tap, (int)fmin(LOOK_MS, 1e3 * left_s + 1.0), why);
        int64_t now = clock_now_ns(j->clock);
        if (err || now < show_ns)
            continue;
        show_ns = now + SHOW_PERIOD_NS;
        record_show_progress(&j->show, j->recorder, elapsed_s(j),
                             bus_waiting_bytes(j->bus));
    }
    return err ? err : tap_drain(&j->tap, why);
}

/* What was recorded before an error is shown too. */
static int end(struct job *j, int err, struct complaint *why)
{
    struct recorder_totals t;
    double seconds = elapsed_s(j);
    int ended = recorder_end(j->recorder, clock_now_ns(j->clock), err ? NULL : why);

    recorder_sum(j->recorder, &t);
    bool shown = record_show_end(&j->show, j->recorder, seconds);
    uint64_t refused = bus_refused(j->bus);
    if (refused)
        fprintf(stderr,
                "anlos bag record: %llu messages were refused (wrong magic, version or "
                "length)\n",
                (unsigned long long)refused);
    if (err || ended)
        return err ? err : ended;
    if (!shown)
        return complain(why, -EIO, "standard output cannot be written");
    return t.lost || t.unwritten ? 1 : 0;
}

int record_run(const struct record_options *o, bool *began, struct complaint *why)
{
    struct job j = {.options = o,
                    .clock = clock_system(),
                    .show.terminal = isatty(STDOUT_FILENO) != 0};

    interrupt_catch();
    j.start_ns = clock_now_ns(j.clock);
    int err = choice_make(&j.choice, o->topics, o->exclude, why);
    if (!err)
        err = open_session(&j, why);
    if (!err)
        err = open_bus(&j, why);
    if (!err)
        err = open_recorder(&j, why);
    if (!err)
        err = record(&j, why);
    *began = j.recorder != NULL;
    if (*began)
        err = end(&j, err, why);
    tap_close(&j.tap);
    recorder_destroy(j.recorder);
    bus_destroy(j.bus);
    session_clear(&j.session);
    choice_clear(&j.choice);
    return err;
}
