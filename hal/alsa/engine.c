#include "hal/alsa/engine.h"

#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "hal/alsa/duplex.h"
#include "hal/realtime.h"

enum {
    PATIENCE_MS = 200,  /* with a card that is away */
    FIRST_TRY_MS = 500, /* doubled after each try, */
    LAST_TRY_MS = 8000, /* up to this */
    MAX_BRIEF = 3,      /* runs shorter than a buffer, in a row */
    DRIFT_SHARE = 1000, /* of an estimate's error that each period corrects */
};

#define NS_PER_S 1e9

struct alsa_engine {
    char *device;
    const struct rig *rig;
    const struct clock_source *clock;
    struct alsa_duplex duplex;
    bool is_open; /* the duplex */
    bool running; /* shots may be placed */
    struct alsa_shot shot;
    struct alsa_report report;
    int64_t origin_ns; /* of frame 0 of this start */
    unsigned n_brief;
    int stop_fd, news_fd; /* eventfd */
    bool has_thread;
    pthread_t thread;
};

static void tell(struct alsa_engine *e)
{
    uint64_t one = 1;
    if (write(e->news_fd, &one, sizeof one) < 0)
        return; /* full: the reader has news enough */
}

static void fill(void *ctx, const struct alsa_stream *s,
                 const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                 size_t n)
{
    struct alsa_engine *e = ctx;
    if (e->running)
        alsa_shot_place(&e->shot, frame);
    alsa_shot_fill(&e->shot, s, areas, offset, frame, n);
}

static void take(void *ctx, const struct alsa_stream *s,
                 const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                 size_t n)
{
    alsa_shot_take(&((struct alsa_engine *)ctx)->shot, s, areas, offset, frame, n);
}

/* A thread reads frames late, never early: the earliest origin is the best one, but for a
 * slow drift between the card's clock and ours. */
static void observe_time(struct alsa_engine *e)
{
    double heard_s = (double)e->duplex.heard / e->rig->survey.sample_rate_hz;
    int64_t origin_ns = clock_now_ns(e->clock) - (int64_t)(heard_s * NS_PER_S);
    if (origin_ns < e->origin_ns)
        e->origin_ns = origin_ns;
    else
        e->origin_ns += (origin_ns - e->origin_ns) / DRIFT_SHARE;
}

/* Until something is wrong; *heard: the frames that are good. */
static int run_stream(struct alsa_engine *e, uint64_t *heard)
{
    const struct alsa_duplex_ends ends = {.fill = fill, .take = take, .ctx = e};
    size_t n_void;
    *heard = 0;
    e->running = false;
    int err = alsa_duplex_start(&e->duplex, &ends);
    e->origin_ns = clock_now_ns(e->clock);
    e->running = true;
    while (!err) {
        err = alsa_duplex_cycle(&e->duplex, &ends, e->stop_fd);
        if (err)
            break;
        *heard = e->duplex.heard;
        observe_time(e);
        if (alsa_shot_heard(&e->shot, *heard, e->origin_ns, &n_void))
            tell(e);
        alsa_report_count(&e->report, ALSA_SLOTS_INVALID, n_void);
    }
    return err;
}

static void count_break(struct alsa_engine *e, int err)
{
    bool overrun = false, underrun = false;
    if (err == -EPIPE)
        alsa_duplex_broken(&e->duplex, &overrun, &underrun);
    alsa_report_count(&e->report, ALSA_OVERRUNS, overrun);
    alsa_report_count(&e->report, ALSA_UNDERRUNS, underrun);
    alsa_report_count(&e->report, ALSA_STALLS, err == -ETIMEDOUT);
}

static const char *what_broke(int err)
{
    return err == -EPIPE      ? "frames were lost"
           : err == -ESTRPIPE ? "it was suspended"
                              : "it stood still";
}

/* true: another start of the same device may do. */
static bool settle_break(struct alsa_engine *e, int err, uint64_t heard)
{
    /* What was not played cannot have been heard. */
    uint64_t good = heard < e->duplex.played ? heard : e->duplex.played;
    size_t n_void = alsa_shot_break(&e->shot, good, e->origin_ns);
    bool passing = err == -EPIPE || err == -ESTRPIPE || err == -ETIMEDOUT;
    count_break(e, err);
    alsa_report_count(&e->report, ALSA_SLOTS_INVALID, n_void);
    e->n_brief = heard < e->duplex.playback.buffer ? e->n_brief + 1 : 0;
    if (!passing || e->n_brief >= MAX_BRIEF)
        return false;
    uint64_t restarts = alsa_report_count(&e->report, ALSA_RESTARTS, 1);
    if (!(restarts & (restarts - 1))) /* the 1st, 2nd, 4th: few lines for many */
        alsa_report_notice(&e->report, "%s: %s; started anew, %llu times so far",
                           e->device, what_broke(err), (unsigned long long)restarts);
    tell(e);
    return true;
}

/* true: stop.  Tells that the card is away, and waits before the next try. */
static bool wait_for_card(struct alsa_engine *e, int err, const char *text, int ms)
{
    struct pollfd stop = {.fd = e->stop_fd, .events = POLLIN};
    alsa_report_set(&e->report, err, "%s; tries again in %g s", text, 1e-3 * ms);
    tell(e);
    return poll(&stop, 1, ms) > 0;
}

/* Tries until the card is there again.  true: stop. */
static bool reopen(struct alsa_engine *e, int err)
{
    struct complaint gone, why;
    alsa_duplex_close(&e->duplex);
    e->is_open = false;
    complain(&gone, err, "%s: %s", e->device,
             err == -ENODEV ? "it is gone" : snd_strerror(err));
    alsa_report_notice(&e->report, "%s", gone.text);
    for (int ms = FIRST_TRY_MS; !e->is_open; ms = ms < LAST_TRY_MS ? 2 * ms : ms) {
        if (wait_for_card(e, err, gone.text, ms))
            return true;
        err = alsa_duplex_open(&e->duplex, e->device, e->rig, &why);
        e->is_open = !err;
        if (err && err != -ENOENT) /* there, but not as it was */
            gone = why;
    }
    alsa_report_count(&e->report, ALSA_REOPENED, 1);
    alsa_report_set(&e->report, 0, "%s", "");
    alsa_report_notice(&e->report, "%s: it is there again", e->device);
    tell(e);
    return false;
}

static void *run(void *arg)
{
    struct alsa_engine *e = arg;
    uint64_t heard;
    for (;;) {
        int err = run_stream(e, &heard);
        if (err == -ECANCELED)
            return NULL;
        if (settle_break(e, err, heard))
            continue;
        if (reopen(e, err))
            return NULL;
    }
}

static void warn(struct alsa_engine *e)
{
    double rate_hz = e->rig->survey.sample_rate_hz;
    if (!e->duplex.one_clock)
        alsa_report_notice(
            &e->report,
            "%s: playback and capture cannot be linked, or are of two cards: they are "
            "started one after the other, and each start needs its own calibration of "
            "time zero",
            e->device);
    if (2 * e->duplex.playback.buffer < e->rig->buffer_frames)
        alsa_report_notice(&e->report,
                           "%s: its buffer holds %.0f ms, not the %.0f ms of the rig",
                           e->device, 1e3 * (double)e->duplex.playback.buffer / rate_hz,
                           1e3 * (double)e->rig->buffer_frames / rate_hz);
}

static int open_parts(struct alsa_engine *e, const char *device, struct complaint *why)
{
    e->device = strdup(device);
    e->stop_fd = eventfd(0, EFD_CLOEXEC);
    e->news_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (!e->device || e->stop_fd < 0 || e->news_fd < 0 ||
        alsa_shot_create(&e->shot, e->rig))
        return complain(why, -ENOMEM, "out of memory");
    int err = alsa_duplex_open(&e->duplex, device, e->rig, why);
    e->is_open = !err;
    return err;
}

static int start_thread(struct alsa_engine *e, struct complaint *why)
{
    struct complaint missing = {.text = ""};
    /* What nothing paces must not outrun the rest. */
    int err = realtime_start(&e->thread, run, e, e->duplex.on_cards, &missing);
    if (err)
        return complain(why, err, "%s: no thread: %s", e->device, strerror(-err));
    e->has_thread = true;
    if (missing.text[0])
        alsa_report_notice(&e->report, "%s", missing.text);
    return 0;
}

int alsa_engine_create(struct alsa_engine **out, const char *device,
                       const struct rig *rig, const struct clock_source *clock,
                       struct complaint *why)
{
    struct alsa_engine *e = calloc(1, sizeof *e);
    if (!e || alsa_report_create(&e->report)) {
        free(e);
        return complain(why, -ENOMEM, "out of memory");
    }
    e->rig = rig;
    e->clock = clock;
    int err = open_parts(e, device, why);
    if (!err) {
        warn(e);
        err = start_thread(e, why);
    }
    if (err)
        alsa_engine_destroy(e);
    else
        *out = e;
    return err;
}

struct alsa_shot *alsa_engine_shot(struct alsa_engine *e)
{
    return &e->shot;
}

struct alsa_report *alsa_engine_report(struct alsa_engine *e)
{
    return &e->report;
}

int alsa_engine_wait(struct alsa_engine *e, size_t k, struct complaint *why)
{
    struct pollfd news = {.fd = e->news_fd, .events = POLLIN};
    uint64_t n;
    while (alsa_shot_settled(&e->shot) <= k) {
        int ready = poll(&news, 1, PATIENCE_MS);
        if (ready < 0)
            return -errno;
        if (ready && read(e->news_fd, &n, sizeof n) == sizeof n)
            continue;
        if (alsa_report_condition(&e->report, why))
            return -EAGAIN;
    }
    return 0;
}

void alsa_engine_destroy(struct alsa_engine *e)
{
    uint64_t one = 1;
    if (e->has_thread && write(e->stop_fd, &one, sizeof one) == sizeof one)
        pthread_join(e->thread, NULL);
    if (e->is_open)
        alsa_duplex_close(&e->duplex);
    alsa_shot_clear(&e->shot);
    alsa_report_destroy(&e->report);
    close(e->stop_fd);
    close(e->news_fd);
    free(e->device);
    free(e);
}
