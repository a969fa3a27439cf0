/* SPDX-License-Identifier: MIT */
/* A server of Foxglove's protocol with the samples, for clients in other languages:
 * prints its port, then obeys lines on stdin and answers each with a line: send TOPIC the
 * sample of survey, stage/state, volume, detections, wall or log time NS counts clients
 * sent dropped skipped failed refused rejected */
#include <inttypes.h>
#include <stdio.h>

#include "nodes/foxglove/server.h"
#include "tests/nodes/foxglove_samples.h"

static void send_sample(struct foxglove_server *s, const struct samples *samples,
                        const char *topic)
{
    const struct foxglove_message all[] = {
        samples_survey(samples),     samples_stage(samples), samples_volume(samples),
        samples_detections(samples), samples_log(samples),   samples_walls(samples),
    };

    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (!strcmp(all[i].topic->name, topic))
            foxglove_server_message(s, &all[i]);
}

static void say_counts(struct foxglove_server *s)
{
    struct foxglove_counts n;

    foxglove_server_counts(s, &n);
    printf("%zu %" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu64
           "\n",
           n.clients, n.sent, n.dropped, n.skipped, n.failed, n.refused, n.rejected);
}

static void obey(struct foxglove_server *s, const struct samples *samples)
{
    char line[128], topic[64];
    int64_t t_ns;

    while (fgets(line, sizeof line, stdin)) {
        if (sscanf(line, "send %63s", topic) == 1)
            send_sample(s, samples, topic);
        else if (sscanf(line, "time %" SCNd64, &t_ns) == 1)
            foxglove_server_time(s, t_ns);
        if (!strcmp(line, "counts\n"))
            say_counts(s);
        else
            puts("done");
        fflush(stdout);
    }
}

int main(void)
{
    const struct web_config at = {
        .address = "127.0.0.1", .write_ms = 2000, .silence_s = 10};
    struct web *web;
    struct foxglove_config cfg;
    struct foxglove_server *s;
    struct samples samples;

    foxglove_config_default(&cfg, 42);
    if (!samples_open(&samples) || web_create(&web, &at, NULL) ||
        foxglove_server_create(&s, web, &cfg) || web_start(web, NULL))
        return 1;
    printf("%u\n", web_port(web));
    fflush(stdout);
    obey(s, &samples);
    foxglove_server_stop(s);
    web_destroy(web);
    foxglove_server_destroy(s);
    samples_close(&samples);
    return 0;
}
