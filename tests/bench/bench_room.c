/* SPDX-License-Identifier: MIT */
/* What a ping of a simulated drive costs, against the slot that it has to fit into.
 *   bench_room SCENE.yaml [pings] */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "hal/room/room.h"

static double cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void measure(struct room *r, struct room_stream *s, uint64_t n)
{
    const struct survey *survey = room_survey(r);
    double sum_s = 0, worst_s = 0;
    const float *samples;
    for (uint64_t k = 0; k < n; k++) {
        double begun_s = cpu_s();
        if (room_stream_ping(s, k, &samples))
            return;
        double took_s = cpu_s() - begun_s;
        sum_s += took_s;
        worst_s = took_s > worst_s ? took_s : worst_s;
    }
    printf("%llu pings of %zu microphones: %.2f ms each, %.2f at most; a slot has %.1f\n",
           (unsigned long long)n, survey->n_microphones, 1e3 * sum_s / (double)n,
           1e3 * worst_s, 1e3 * (double)survey->slot_samples / survey->sample_rate_hz);
}

int main(int argc, char **argv)
{
    struct error why = {.text = ""};
    struct room *r;
    struct room_stream *s = NULL;
    if (argc < 2 || room_load(&r, argv[1], &why)) {
        fprintf(stderr, "%s\n", argc < 2 ? "expected a scene file" : why.text);
        return 2;
    }
    size_t n = room_survey(r)->n_speakers;
    uint32_t *speakers = calloc(n, sizeof *speakers);
    for (size_t i = 0; speakers && i < n; i++)
        speakers[i] = (uint32_t)i;
    struct room_stream_config cfg = {
        .pass = PASS_SCENE, .speakers = speakers, .n_speakers = n};
    if (speakers && !room_stream_create(&s, r, &cfg))
        measure(r, s, argc > 2 ? strtoull(argv[2], NULL, 10) : 800);
    room_stream_destroy(s);
    free(speakers);
    room_destroy(r);
    return s ? 0 : 1;
}
