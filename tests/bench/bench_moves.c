/* SPDX-License-Identifier: MIT */
/* How soon the array says that an element of it has moved, and how often it says so of
 * none, in simulated drives at simulated time.
 *
 *     bench_moves SCENE.yaml SECONDS [DRAW]...
 *
 * prints what the self-test says and when, in drive time, for each draw of the scene. */
#include <stdio.h>
#include <stdlib.h>

#include "msgs/convert.h"
#include "nodes/anlos/doctor/drive_pipe.h"
#include "recon/frontend/frontend.h"

struct bench {
    struct drive_world world;
    struct survey survey;
    struct frontend *frontend;
};

static int start(struct bench *b, const char *scene, uint32_t draw, struct error *why)
{
    const struct drive_world_config cfg = {.scene = scene, .draw = draw};
    const struct frontend_config front = {.window = WINDOW_HANN,
                                          .compression = COMPRESSION_MATCHED_FILTER,
                                          .background = BACKGROUND_ADAPTIVE,
                                          .background_s = 10.0,
                                          .judges_array = true};
    int err = drive_world_create(&b->world, &cfg, why);

    if (!err)
        err = survey_from_message(&b->survey, b->world.survey, why);
    if (!err)
        err = frontend_create(&b->frontend, &front);
    if (!err)
        err = frontend_survey(b->frontend, &b->survey, why);
    if (!err)
        err = drive_world_shoot(&b->world, PASS_SCENE, why);
    return err;
}

static void stop(struct bench *b)
{
    frontend_destroy(b->frontend);
    survey_clear(&b->survey);
    drive_world_clear(&b->world);
}

static int go(struct bench *b, double until_s)
{
    Anlos__Ping message;
    struct ping ping;
    struct frontend_output out;
    struct self_test_faults faults;
    int64_t stamp_ns;
    double t_s = 0.0;

    while (t_s < until_s) {
        char note[512] = "";
        int err = drive_world_ping(&b->world, PASS_SCENE, &message, &stamp_ns);
        if (err)
            return err;
        ping_from_message(&ping, &message, stamp_ns);
        frontend_ping(b->frontend, &ping, &out);
        frontend_judge(b->frontend, &ping, &faults, note, sizeof note);
        t_s = 1e-9 * (double)(stamp_ns - b->world.begin_ns);
        if (note[0])
            printf("  %7.2f s: %s\n", t_s, note);
    }
    return 0;
}

int main(int argc, char **argv)
{
    if (argc < 3) {
        fprintf(stderr, "bench_moves SCENE.yaml SECONDS [DRAW]...\n");
        return 2;
    }
    for (int i = 3; i < argc || i == 3; i++) {
        struct bench b = {.frontend = NULL};
        struct error why = {""};
        uint32_t draw = i < argc ? (uint32_t)strtoul(argv[i], NULL, 10) : 0;
        int err = start(&b, argv[1], draw, &why);
        printf("draw %u, %s s\n", draw, argv[2]);
        if (!err)
            err = go(&b, strtod(argv[2], NULL));
        stop(&b);
        if (err) {
            fprintf(stderr, "%s: %s\n", argv[1], why.text);
            return 1;
        }
    }
    return 0;
}
