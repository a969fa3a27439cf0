/* SPDX-License-Identifier: MIT */
/* How fast the recorder writes, beside the disk by itself: the same pings, as one file
 * written in chunks of the same size and synced as often.  Takes turns, for a disk's pace
 * changes by the minute; prints the best and the median of each.
 *
 *   bench_record [FOLDER [MB [ROUNDS]]] */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "hal/clock.h"
#include "nodes/record/recorder.h"
#include "nodes/record/tap.h"

#define PING_BYTES  380000
#define CHUNK_BYTES (4 << 20)
#define SOUND_BYTES ((size_t)64 << 20) /* no ping is like another within a chunk */
#define FLUSH_NS    1000000000LL
#define MAX_ROUNDS  32

struct bench {
    char bag[4096], raw[4096];
    size_t bytes;
    uint8_t *sound; /* [SOUND_BYTES] */
    struct choice choice;
    struct session session;
};

static double now_s(void)
{
    return 1e-9 * (double)clock_now_ns(clock_system());
}

static double cpu_s(void)
{
    struct rusage u;

    getrusage(RUSAGE_SELF, &u);
    return (double)(u.ru_utime.tv_sec + u.ru_stime.tv_sec) +
           1e-6 * (double)(u.ru_utime.tv_usec + u.ru_stime.tv_usec);
}

static int fail(const char *what, int err)
{
    fprintf(stderr, "bench_record: %s: %s\n", what, strerror(err));
    return 1;
}

static int write_raw(const struct bench *b)
{
    int fd = open(b->raw, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    double due = now_s() + 1e-9 * FLUSH_NS;

    if (fd < 0)
        return fail(b->raw, errno);
    for (size_t done = 0; done < b->bytes; done += CHUNK_BYTES) {
        if (write(fd, b->sound + done % SOUND_BYTES, CHUNK_BYTES) != CHUNK_BYTES)
            return fail(b->raw, errno);
        if (now_s() < due)
            continue;
        if (fdatasync(fd))
            return fail(b->raw, errno);
        due = now_s() + 1e-9 * FLUSH_NS;
    }
    return fsync(fd) || close(fd) || unlink(b->raw) ? fail(b->raw, errno) : 0;
}

/* Noise, 24 bits of it in each float, as microphones have it. */
static void make_sound(uint8_t *out)
{
    uint32_t state = 1;

    for (size_t i = 0; i < SOUND_BYTES; i += 4) {
        state = state * 1664525u + 1013904223u;
        float x = (float)((int32_t)state >> 8) * 1e-9f;
        memcpy(out + i, &x, sizeof x);
    }
}

static int write_bag(const struct bench *b, enum bag_compression compression,
                     double *file_bytes)
{
    const struct recorder_config cfg = {.path = b->bag,
                                        .topics = b->choice.topics,
                                        .n_topics = b->choice.n,
                                        .flush_ns = FLUSH_NS,
                                        .compression = compression,
                                        .session = &b->session};
    const struct clock_source *clock = clock_system();
    struct bus_message m = {.topic = topic_ping(), .payload = b->sound};
    struct recorder_totals totals;
    struct error why = {""};
    struct recorder *r;
    int64_t due_ns;

    snprintf(m.envelope.topic, sizeof m.envelope.topic, "ping");
    snprintf(m.envelope.node, sizeof m.envelope.node, "array");
    m.envelope.payload_size = PING_BYTES;
    if (recorder_create(&r, &cfg, clock_now_ns(clock), &why))
        return fail(why.text, 0);
    for (size_t done = 0; done < b->bytes; done += PING_BYTES) {
        m.payload = b->sound +
                    m.envelope.sequence * PING_BYTES % (SOUND_BYTES - PING_BYTES);
        m.envelope.sequence++;
        m.envelope.publish_ns = m.envelope.capture_ns = clock_now_ns(clock);
        if (recorder_put(r, &m, m.envelope.publish_ns, &why) ||
            recorder_tick(r, clock_now_ns(clock), &due_ns, &why))
            return fail(why.text, 0);
    }
    if (recorder_end(r, clock_now_ns(clock), &why))
        return fail(why.text, 0);
    recorder_sum(r, &totals);
    *file_bytes = (double)totals.file_bytes;
    recorder_destroy(r);
    return unlink(b->bag) ? fail(b->bag, errno) : 0;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return x < y ? -1 : x > y;
}

struct way {
    const char *name;
    int compression; /* -1: the disk by itself */
    double mb_s[MAX_ROUNDS], cpu_ns_byte, ratio;
};

static int run_round(const struct bench *b, struct way *w, size_t round)
{
    double size = 1e-6 * (double)b->bytes, file_bytes = (double)b->bytes;
    double cpu = cpu_s(), start = now_s();
    int code = w->compression < 0
                   ? write_raw(b)
                   : write_bag(b, (enum bag_compression)w->compression, &file_bytes);

    w->mb_s[round] = size / (now_s() - start);
    cpu = 1e9 * (cpu_s() - cpu) / (double)b->bytes;
    w->cpu_ns_byte = round ? fmin(w->cpu_ns_byte, cpu) : cpu;
    w->ratio = file_bytes / (double)b->bytes;
    return code;
}

static void print(struct way *ways, size_t n, size_t rounds)
{
    printf("%-12s %10s %12s %14s %12s %10s\n", "", "best MB/s", "median MB/s",
           "of the disk's", "CPU ns/byte", "file size");
    for (size_t k = 0; k < n; k++)
        qsort(ways[k].mb_s, rounds, sizeof(double), compare);
    for (size_t k = 0; k < n; k++)
        printf("%-12s %10.0f %12.0f %13.2f %12.2f %9.0f %%\n", ways[k].name,
               ways[k].mb_s[rounds - 1], ways[k].mb_s[rounds / 2],
               ways[k].mb_s[rounds / 2] / ways[0].mb_s[rounds / 2], ways[k].cpu_ns_byte,
               100.0 * ways[k].ratio);
}

int main(int argc, char **argv)
{
    struct way ways[] = {{.name = "disk", .compression = -1},
                         {.name = "none", .compression = BAG_NONE},
                         {.name = "lz4", .compression = BAG_LZ4},
                         {.name = "zstd", .compression = BAG_ZSTD}};
    const size_t n = sizeof ways / sizeof *ways;
    const char *folder = argc > 1 ? argv[1] : "/tmp";
    size_t rounds = argc > 3 ? (size_t)atol(argv[3]) : 5;
    struct bench b = {.bytes = (size_t)(argc > 2 ? atol(argv[2]) : 1000) * 1000000,
                      .sound = malloc(SOUND_BYTES),
                      .session.topics = "*"};

    if (!b.sound || choice_make(&b.choice, "*", NULL, NULL))
        return fail("memory", ENOMEM);
    snprintf(b.bag, sizeof b.bag, "%s/bench_record.mcap", folder);
    snprintf(b.raw, sizeof b.raw, "%s/bench_record.raw", folder);
    rounds = rounds < 1 ? 1 : rounds > MAX_ROUNDS ? MAX_ROUNDS : rounds;
    make_sound(b.sound);
    int code = 0;
    for (size_t i = 0; !code && i < rounds; i++)
        for (size_t k = 0; !code && k < n; k++)
            code = run_round(&b, &ways[k], i);
    if (!code)
        print(ways, n, rounds);
    choice_clear(&b.choice);
    free(b.sound);
    return code;
}
