/* A server of Foxglove's protocol with the samples, for clients in other languages:
 * prints its port, then obeys lines on stdin and answers each with a line: send TOPIC the
 * sample of survey, stage/state, volume, detections, wall or log time NS counts clients
 * sent dropped skipped failed refused rejected */
#include <inttypes.h>
#include <stdio.h>

#include "nodes/foxglove/server.h"
#include "nodes/view/hang_up.h"
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
    const char *options[] = {"listening_ports",    "127.0.0.1:0", "num_threads", "12",
                             "request_timeout_ms", "2000",        NULL};
    struct mg_context *ctx;
    struct mg_server_port port;
    struct foxglove_config cfg;
    struct foxglove_server *s;
    struct samples samples;
    int failed = 1;

    mg_init_library(0);
    ctx = mg_start(NULL, NULL, options);
    foxglove_config_default(&cfg, 42);
    if (!ctx || mg_get_server_ports(ctx, 1, &port) != 1 || !samples_open(&samples))
        return 1;
    if (!foxglove_server_create(&s, ctx, &cfg)) {
        printf("%d\n", port.port);
        fflush(stdout);
        obey(s, &samples);
        foxglove_server_stop(s);
        hang_up((unsigned)port.port); /* else mg_stop takes 2 s */
        mg_stop(ctx);
        foxglove_server_destroy(s);
        failed = 0;
    }
    samples_close(&samples);
    mg_exit_library();
    return failed;
}
