/* SPDX-License-Identifier: MIT */
#include "nodes/record/recorder.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/survey/file.h"
#include "msgs/bag/manifest.h"
#include "msgs/bag/topic_message.h"
#include "msgs/convert.h"
#include "msgs/survey.pb-c.h"
#include "nodes/record/parts.h"
#include "nodes/record/session.h"

/* The geometry of a recording as files and in short (msgs/bag/manifest.h), from a
 * message of topic "survey". */

/* -- what belongs to a survey -----------------------------------------------------------
 */

struct survey_attachments { /* starts as {0} */
    uint64_t id;            /* of the survey; 0: none yet */
    struct attachments files;
    struct pairs geometry;
};

#define PLACE_SIZE 512

/* Is it another survey than the one before? */
static bool survey_attachments_is_news(const struct survey_attachments *s,
                                       const Anlos__Survey *m)
{
    return m->id != s->id;
}

static void put_geometry(struct pairs *p, uint64_t id, const struct survey *s)
{
    char text[128];

    snprintf(text, sizeof text, "%016" PRIx64, id);
    pairs_text(p, MANIFEST_SURVEY_ID, text);
    const ProtobufCEnumValue *source =
        protobuf_c_enum_descriptor_get_value(&anlos__source__descriptor, (int)s->source);
    pairs_text(p, MANIFEST_SOURCE, source ? source->name : "");
    pairs_number(p, MANIFEST_TEMPERATURE, s->temperature_c);
    pairs_number(p, MANIFEST_SOUND_SPEED, s->sound_speed_m_s);
    pairs_number(p, MANIFEST_RATE, s->sample_rate_hz);
    pairs_count(p, MANIFEST_SPEAKERS, s->n_speakers);
    pairs_count(p, MANIFEST_MICROPHONES, s->n_microphones);
    pairs_count(p, MANIFEST_POSITIONS, s->n_positions);
    snprintf(text, sizeof text, "%.9g, %.9g, %.9g", s->stage_axis[0], s->stage_axis[1],
             s->stage_axis[2]);
    pairs_text(p, MANIFEST_STAGE_AXIS, text);
    pairs_number(p, MANIFEST_STAGE_FIRST, s->stage_positions_m[0]);
    pairs_number(p, MANIFEST_STAGE_LAST, s->stage_positions_m[s->n_positions - 1]);
}

/* A folder of files and no more. */
static void remove_folder(const char *folder)
{
    char path[PATH_MAX];
    DIR *d = opendir(folder);

    for (const struct dirent *e; d && (e = readdir(d));) {
        snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        unlink(path); /* refuses "." and ".." */
    }
    if (d)
        closedir(d);
    rmdir(folder);
}

/* Files are what survey_save makes: it knows how a survey is written down. */
static int take_files(struct attachments *c, const struct survey *s, const char *folder,
                      struct error *why)
{
    char path[PLACE_SIZE + 32], curves[PLACE_SIZE + 32];

    snprintf(path, sizeof path, "%s/%s", folder, MANIFEST_SURVEY);
    snprintf(curves, sizeof curves, "%s/%s", folder, MANIFEST_CALIBRATION);
    int err = survey_save(s, path, MANIFEST_CALIBRATION, why);
    if (!err)
        err = attachments_add_folder(c, "", folder, why);
    if (!err && s->n_responses)
        err = attachments_add_folder(c, MANIFEST_CALIBRATION "/", curves, why);
    if (s->n_responses)
        remove_folder(curves);
    return err;
}

static int save(struct attachments *c, const struct survey *s, struct error *why)
{
    const char *place = getenv("TMPDIR");
    char folder[PLACE_SIZE];

    if (snprintf(folder, sizeof folder, "%s/anlos-survey-XXXXXX",
                 place && *place ? place : "/tmp") >= (int)sizeof folder)
        return error_say(why, -ENAMETOOLONG, "$TMPDIR: path too long");
    if (!mkdtemp(folder))
        return error_say(why, -errno, "%s: %s", folder, strerror(errno));
    int err = take_files(c, s, folder, why);
    remove_folder(folder);
    return err;
}

static void survey_attachments_clear(struct survey_attachments *s)
{
    attachments_clear(&s->files);
    pairs_clear(&s->geometry);
    *s = (struct survey_attachments){0};
}

/* Takes it, in the place of the one before, by way of a folder in $TMPDIR or /tmp.
 * 0, -EINVAL (does not pass survey_check), -ENOMEM, errno of files; then it has none. */
static int survey_attachments_take(struct survey_attachments *out, const Anlos__Survey *m,
                                   struct error *why)
{
    struct survey s;

    survey_attachments_clear(out);
    out->id = m->id; /* one that is wrong is complained about once */
    int err = survey_from_message(&s, m, why);
    if (err)
        return err;
    err = save(&out->files, &s, why);
    if (err)
        attachments_clear(&out->files);
    else
        put_geometry(&out->geometry, m->id, &s);
    survey_clear(&s);
    return err;
}

/* Nothing while there is no survey.  Errors of the writer. */
static int survey_attachments_write(const struct survey_attachments *s, int64_t now_ns,
                                    struct bag_writer *w, struct error *why)
{
    int err = attachments_write(&s->files, w, now_ns, why);

    return err || !s->geometry.map.size
               ? err
               : pairs_write(&s->geometry, MANIFEST_GEOMETRY, w, why);
}

/* What a recording has of each topic. */

/* -- what came, and what was lost -------------------------------------------------------
 */

/* 0, -ENOMEM. */
static int balance_init(struct balance *t, const struct topic *const *topics, size_t n,
                        int64_t now_ns)
{
    *t = (struct balance){
        .list = calloc(n ? n : 1, sizeof *t->list), .n = n, .from_ns = now_ns};
    if (!t->list)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        t->list[i].topic = topics[i];
    return 0;
}

static struct balance_topic *balance_find(struct balance *t, const struct topic *topic)
{
    for (size_t i = 0; i < t->n; i++)
        if (t->list[i].topic == topic)
            return &t->list[i];
    return NULL;
}

/* A message was taken.  Topics that are not in the list are ignored, here and below. */
static void balance_take(struct balance *t, const struct topic *topic, size_t bytes)
{
    struct balance_topic *of = balance_find(t, topic);

    if (!of)
        return;
    of->messages++;
    of->bytes += bytes;
}

/* So many are lost in all by now. */
static void balance_lost(struct balance *t, const struct topic *topic, uint64_t total)
{
    struct balance_topic *of = balance_find(t, topic);

    if (of)
        of->lost = total;
}

/* Over all topics. */
static struct balance_topic balance_sum(const struct balance *t)
{
    struct balance_topic sum = {0};

    for (size_t i = 0; i < t->n; i++) {
        sum.messages += t->list[i].messages;
        sum.bytes += t->list[i].bytes;
        sum.lost += t->list[i].lost;
    }
    return sum;
}

/* Tells what is lost and not told, if anything is.  Errors of the writer. */
static int balance_tell(struct balance *t, int64_t now_ns, struct bag_writer *w,
                        struct error *why)
{
    struct pairs p = {0};
    bool news = false;
    int err = 0;

    pairs_stamp(&p, MANIFEST_FROM_NS, t->from_ns);
    pairs_stamp(&p, MANIFEST_TO_NS, now_ns);
    for (size_t i = 0; i < t->n; i++) {
        struct balance_topic *of = &t->list[i];
        if (of->lost == of->told)
            continue;
        pairs_count(&p, of->topic->name, of->lost - of->told);
        of->told = of->lost;
        news = true;
    }
    if (news)
        err = pairs_write(&p, MANIFEST_LOSS, w, why);
    pairs_clear(&p);
    t->from_ns = now_ns;
    return err;
}

/* The losses of a file at its end; the next one starts at 0. */
static int balance_end_file(struct balance *t, int64_t now_ns, struct bag_writer *w,
                            struct error *why)
{
    struct pairs p = {0};
    int err = balance_tell(t, now_ns, w, why);

    for (size_t i = 0; i < t->n; i++) {
        struct balance_topic *of = &t->list[i];
        pairs_count(&p, of->topic->name, of->told - of->earlier);
        of->earlier = of->told;
    }
    if (!err)
        err = pairs_write(&p, MANIFEST_LOST, w, why);
    pairs_clear(&p);
    return err;
}

static void balance_clear(struct balance *t)
{
    free(t->list);
    *t = (struct balance){0};
}

/* -- the recorder -----------------------------------------------------------------------
 */

#define CHUNK_SIZE      (4u << 20)
#define SURVEY_WAIT_NS  2000000000LL /* twice the survey's period */
#define PARTS_PER_QUOTA 8            /* where no size of a part is said */

struct recorder {
    struct recorder_config cfg;
    struct parts parts;
    struct balance balance;
    struct survey_attachments survey;
    struct bus_message last_survey; /* payload NULL: none has come */
    bool repeated;                  /* the part begins with it once more */
    char path[PATH_MAX];
    struct bag_writer *writer;
    struct bag_topics *topics;
    uint64_t part_attachments; /* bytes of the part that are no messages: attachments */
    int64_t part_ns;           /* when the part began */
    bool over;                 /* it should end */
    int64_t over_ns;           /* since when */
    int64_t flush_due_ns;      /* INT64_MAX: nothing to be flushed */
    uint64_t n_written;        /* messages in complete files */
    bool failed, ended;
};

static void say(const struct recorder *r, enum log_level level, const char *text)
{
    if (r->cfg.say)
        r->cfg.say(r->cfg.context, level, text);
}

static int open_part(struct recorder *r, int64_t now_ns, struct error *why)
{
    const struct bag_writer_config cfg = {.profile = "anlos",
                                          .library = "anlos " ANLOS_VERSION,
                                          .chunk_size = CHUNK_SIZE,
                                          .compression = r->cfg.compression};
    int err = bag_writer_create(&r->writer, parts_begin(&r->parts, r->path), &cfg, why);

    if (!err && bag_topics_create(&r->topics, r->writer))
        err = error_say(why, -ENOMEM, "out of memory");
    if (!err && r->cfg.shuffle)
        bag_topics_shuffle(r->topics);
    if (!err)
        err = session_write(r->cfg.session, r->parts.n, now_ns, r->writer, why);
    if (!err)
        err = survey_attachments_write(&r->survey, now_ns, r->writer, why);
    r->repeated = false;
    r->part_attachments = r->writer ? bag_writer_size(r->writer) : 0;
    r->part_ns = now_ns;
    r->over = false;
    r->flush_due_ns = INT64_MAX;
    return err;
}

static uint64_t file_size(const char *path, uint64_t otherwise)
{
    struct stat st;

    return stat(path, &st) ? otherwise : (uint64_t)st.st_size;
}

/* Also of a file that could not be written on. */
static int close_part(struct recorder *r, int64_t now_ns, struct error *why)
{
    if (!r->writer)
        return 0;
    int err = r->failed ? 0 : balance_end_file(&r->balance, now_ns, r->writer, why);
    uint64_t bytes = bag_writer_size(r->writer);
    struct bag_writer *w = r->writer;
    bag_topics_destroy(r->topics);
    r->topics = NULL;
    r->writer = NULL;
    int flushed = bag_writer_flush(w, r->failed || err ? NULL : why);
    err = r->failed || err ? err : flushed;
    uint64_t n = bag_writer_messages(w);
    r->n_written += n && r->repeated ? n - 1 : n;
    int closed = bag_writer_close(w, r->failed || err ? NULL : why);
    if (!r->failed && !err)
        err = closed;
    if (parts_end(&r->parts, file_size(r->path, bytes)) && !err)
        err = error_say(why, -ENOMEM, "out of memory");
    return err;
}

static int keep_quota(struct recorder *r, struct error *why)
{
    unsigned before = r->parts.n_removed;
    uint64_t open = r->writer ? bag_writer_size(r->writer) : 0;
    char text[200];

    if (!r->cfg.quota_bytes)
        return 0;
    int err = parts_keep_quota(&r->parts, r->cfg.quota_bytes, open, why);
    if (r->parts.n_removed > before) {
        snprintf(
            text, sizeof text,
            "the quota is reached: of this recording the oldest files go, %u so far, "
            "%.1f MB",
            r->parts.n_removed, 1e-6 * (double)r->parts.removed_bytes);
        say(r, LOG_LEVEL_WARNING, text);
    }
    return err;
}

static int next_part(struct recorder *r, int64_t now_ns, struct error *why)
{
    int err = close_part(r, now_ns, why);

    if (!err)
        err = open_part(r, now_ns, why);
    if (!err) {
        char text[PATH_MAX + 32];
        snprintf(text, sizeof text, "goes on in %s", r->path);
        say(r, LOG_LEVEL_INFO, text);
        err = keep_quota(r, why);
    }
    return err;
}

/* The size at which a part ends: half of it at least are messages, or else each would
 * make a file of its own where the attachments are larger than split_bytes. */
static uint64_t part_limit(const struct recorder *r)
{
    return r->cfg.split_bytes > 2 * r->part_attachments ? r->cfg.split_bytes
                                                        : 2 * r->part_attachments;
}

/* A part ends where the next one can begin with a survey: it is of use by itself then.
 * One that has to end earlier is followed by one with the last survey once more. */
static bool ends_before(const struct recorder *r, const struct bus_message *m,
                        int64_t now_ns)
{
    if (!r->over)
        return false;
    return m->topic == topic_survey() || !r->survey.id ||
           now_ns - r->over_ns > SURVEY_WAIT_NS ||
           (r->cfg.split_bytes &&
            bag_writer_size(r->writer) > part_limit(r) + part_limit(r) / 4);
}

static void look_at_size(struct recorder *r, int64_t now_ns)
{
    bool over = (r->cfg.split_bytes && bag_writer_size(r->writer) >= part_limit(r)) ||
                (r->cfg.split_ns && now_ns - r->part_ns >= r->cfg.split_ns);

    if (over && !r->over)
        r->over_ns = now_ns;
    r->over |= over;
}

/* For parts that begin without one; there is no memory: without. */
static void keep_survey(struct recorder *r, const struct bus_message *m)
{
    uint8_t *copy = malloc(m->envelope.payload_size + 1);

    free((void *)r->last_survey.payload);
    if (copy)
        memcpy(copy, m->payload, m->envelope.payload_size);
    r->last_survey =
        (struct bus_message){.topic = m->topic, .envelope = m->envelope, .payload = copy};
}

/* Pings before the first survey of a file are of no use to anyone. */
static int repeat_survey(struct recorder *r, struct error *why)
{
    const struct bus_message *m = &r->last_survey;
    uint64_t before = bag_writer_size(r->writer);

    if (!m->payload)
        return 0;
    int err = bag_topics_put(r->topics, &m->envelope, m->payload, NULL, why);
    r->repeated = !err;
    r->part_attachments += bag_writer_size(r->writer) - before;
    return err;
}

static void tell_unattached(const struct recorder *r, const char *why)
{
    char text[sizeof((struct error *)0)->text + 64];

    snprintf(text, sizeof text, "the survey is not attached: %s", why);
    say(r, LOG_LEVEL_WARNING, text);
}

/* A survey that cannot be kept as a file is a message all the same. */
static int take_survey(struct recorder *r, const struct bus_message *m, int64_t now_ns,
                       struct error *why)
{
    Anlos__Survey *survey = (Anlos__Survey *)bus_message_unpack(m);
    struct error reason = {""};
    int err = 0;

    if (!survey)
        tell_unattached(r, errno == ENOMEM ? "out of memory" : "it is none");
    if (survey && survey_attachments_is_news(&r->survey, survey)) {
        if (survey_attachments_take(&r->survey, survey, &reason))
            tell_unattached(r, reason.text);
        uint64_t before = bag_writer_size(r->writer);
        err = survey_attachments_write(&r->survey, now_ns, r->writer, why);
        r->part_attachments += bag_writer_size(r->writer) - before;
    }
    if (survey)
        anlos__survey__free_unpacked(survey, NULL);
    return err;
}

int recorder_put(struct recorder *r, const struct bus_message *m, int64_t now_ns,
                 struct error *why)
{
    bool is_survey = m->topic == topic_survey();
    bool is_over = ends_before(r, m, now_ns);
    int err = is_over ? next_part(r, now_ns, why) : 0;

    if (!err && is_survey)
        err = take_survey(r, m, now_ns, why);
    if (!err && is_survey)
        keep_survey(r, m);
    else if (!err && is_over)
        err = repeat_survey(r, why);
    if (!err)
        err = bag_topics_put(r->topics, &m->envelope, m->payload, NULL, why);
    balance_take(&r->balance, m->topic, m->envelope.payload_size);
    r->failed = err != 0;
    if (err)
        return err;
    if (r->flush_due_ns == INT64_MAX)
        r->flush_due_ns = now_ns + r->cfg.flush_ns;
    look_at_size(r, now_ns);
    return 0;
}

int recorder_pairs(struct recorder *r, const char *name, const struct pairs *p,
                   struct error *why)
{
    int err = pairs_write(p, name, r->writer, why);

    r->failed = err != 0;
    return err;
}

void recorder_lost(struct recorder *r, const struct topic *t, uint64_t total)
{
    balance_lost(&r->balance, t, total);
}

int recorder_tick(struct recorder *r, int64_t now_ns, int64_t *due_ns, struct error *why)
{
    int err = 0;

    if (now_ns >= r->flush_due_ns) {
        err = balance_tell(&r->balance, now_ns, r->writer, why);
        if (!err)
            err = bag_writer_flush(r->writer, why);
        r->flush_due_ns = INT64_MAX;
        r->failed = err != 0;
        if (!err)
            err = keep_quota(r, why);
    }
    *due_ns = r->flush_due_ns;
    return err;
}

const char *recorder_path(const struct recorder *r)
{
    return r->path;
}

const struct balance *recorder_balance(const struct recorder *r)
{
    return &r->balance;
}

void recorder_sum(const struct recorder *r, struct recorder_totals *out)
{
    struct balance_topic sum = balance_sum(&r->balance);

    *out = (struct recorder_totals){
        .messages = sum.messages,
        .lost = sum.lost,
        .unwritten = r->ended ? sum.messages - r->n_written : 0,
        .file_bytes = parts_bytes(&r->parts) +
                      (r->writer ? bag_writer_size(r->writer) : 0),
        .n_files = r->parts.n_closed + (r->writer != NULL),
        .n_removed = r->parts.n_removed,
    };
}

/* With a quota there have to be parts that can go, of a size that leaves room. */
static int settle_sizes(struct recorder_config *c, struct error *why)
{
    if (!c->quota_bytes)
        return 0;
    if (!c->split_bytes)
        c->split_bytes = c->quota_bytes / PARTS_PER_QUOTA;
    if (c->split_bytes > c->quota_bytes / 2)
        return error_say(why, -EINVAL,
                         "files of %.6g MB do not fit a quota of %.6g MB twice",
                         1e-6 * (double)c->split_bytes, 1e-6 * (double)c->quota_bytes);
    return 0;
}

int recorder_create(struct recorder **out, const struct recorder_config *cfg,
                    int64_t now_ns, struct error *why)
{
    struct recorder *r = calloc(1, sizeof *r);

    if (!r)
        return error_say(why, -ENOMEM, "out of memory");
    r->cfg = *cfg;
    int err = settle_sizes(&r->cfg, why);
    bool split = r->cfg.split_bytes || r->cfg.split_ns;
    if (!err)
        err = cfg->free_name ? parts_init_free(&r->parts, cfg->path, split, why)
                             : parts_init(&r->parts, cfg->path, split, why);
    if (!err && balance_init(&r->balance, cfg->topics, cfg->n_topics, now_ns))
        err = error_say(why, -ENOMEM, "out of memory");
    if (!err)
        err = open_part(r, now_ns, why);
    if (err) {
        r->failed = true;
        recorder_destroy(r);
        return err;
    }
    *out = r;
    return 0;
}

int recorder_end(struct recorder *r, int64_t now_ns, struct error *why)
{
    int err = close_part(r, now_ns, why);

    if (!err && !r->failed)
        err = keep_quota(r, why);
    r->ended = true;
    return err;
}

void recorder_destroy(struct recorder *r)
{
    if (!r)
        return;
    if (!r->ended)
        recorder_end(r, r->part_ns, NULL);
    survey_attachments_clear(&r->survey);
    free((void *)r->last_survey.payload);
    balance_clear(&r->balance);
    parts_clear(&r->parts);
    free(r);
}
