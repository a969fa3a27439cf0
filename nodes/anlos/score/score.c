/* SPDX-License-Identifier: MIT */
/* nodes/anlos/score/score.c -- `anlos score`: the tracks of recorded drives, as they were
 * recorded, against who was there. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/score/drive_bag.h"
#include "nodes/anlos/score/drive_report.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"

static const char help[] =
    "anlos score -- how far recorded tracks are from who was there\n"
    "\n"
    "usage: anlos score --bag FILE,... (--truth FILE,... | --scenes FILE) [--out DIR]\n"
    "\n"
    "Takes the tracks of recorded drives as the vehicle was told them, when it was "
    "told.\n"
    "Prints a line for each bag: GOSPA and OSPA, errors of place and velocity, how "
    "often\n"
    "what was there was seen, how long from the first echo to a track, false tracks.\n"
    "\n"
    "  --bag FILE,...   recorded drives\n"
    "  --truth FILE,... who was there: lines of time_s,id,kind,x_m,y_m, which is the "
    "first\n"
    "                   line; Unix time, vehicle frame; one for each bag, or for all\n"
    "  --scenes FILE    of a recorded simulation: its scene says it\n"
    "  --out DIR        default: out/score\n"
    "  --help           this text\n"
    "\n"
    "files written\n"
    "  drives.csv           a line for each bag, as soon as it is done\n"
    "  drive.json           all figures of each\n"
    "  existence.svg, .png  how often what was stated so surely was true\n"
    "  NAME.csv, .svg, .png     GOSPA and OSPA over time; NAME is the bag's, NAME-2 a\n"
    "                           second one's of that name\n"
    "\n"
    "example\n"
    "  anlos score --bag out/drive.mcap --truth truth.csv\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or input; 130 stopped by Ctrl-C, "
    "what\n"
    "was done until then is written\n";

struct score {
    char *bags, *truths; /* names with commas; NULL: none was given */
    const char *scene_path, *out;
    struct room *scene;
    struct truth_file *truth;
    struct drive_tally all;
    json_t *json;
    FILE *csv;
};

static const struct usage_option options[] = {
    {"bag", USAGE_VALUE('b')},
    {"truth", USAGE_VALUE('t')},
    {"scenes", USAGE_TEXT(struct score, scene_path)},
    {"out", USAGE_TEXT(struct score, out)},
    {.name = NULL},
};

static size_t count(const char *names)
{
    size_t n = 1;

    for (const char *p = names; (p = strchr(p, ',')); p++)
        n++;
    return n;
}

static int load_scene(struct score *s, struct error *why)
{
    if (!s->scene_path)
        return 0;
    int err = room_load(&s->scene, s->scene_path, why);
    if (!err && !room_is_drive(s->scene))
        err = error_say(why, -ENOTSUP, "%s: not a drive: the key \"drive\" is missing",
                        s->scene_path);
    return err;
}

/* That of the next bag, or still that of all. */
static int next_truth(struct score *s, struct error *why)
{
    const char *path = s->truths ? strsep(&s->truths, ",") : NULL;

    if (!path)
        return 0;
    truth_file_destroy(s->truth);
    s->truth = NULL;
    return truth_file_load(&s->truth, path, why);
}

/* A second bag of a name, from another folder, is NAME-2, and takes nothing away. */
static void name_bag(const struct score *s, const char *bag, char *out, size_t size)
{
    char name[256];

    drive_name(bag, name, sizeof name);
    snprintf(out, size, "%s", name);
    for (unsigned i = 2; json_object_get(s->json, out); i++)
        snprintf(out, size, "%s-%u", name, i);
}

/* With the first bag that is judged: nothing looks like a result where none was. */
static int begin_table(struct score *s, struct error *why)
{
    int err = s->csv ? 0 : drive_csv_open(&s->csv, s->out, why);

    if (!err && !s->all.n)
        drive_print_head();
    return err;
}

static int score_bag(struct score *s, const char *bag, struct error *why)
{
    struct drive_outcome out;
    struct drive_tally one;
    char name[272];

    drive_bag(bag, s->scene, s->truth, &out);
    int err = out.err ? error_say(why, out.err, "%s", out.why.text) : 0;
    bool judged = out.result.n_lists && (!err || err == -EINTR);
    int failed = judged ? begin_table(s, err ? NULL : why) : 0;
    err = err ? err : failed;
    if (judged && !failed) {
        name_bag(s, bag, name, sizeof name);
        drive_tally_init(&one);
        drive_tally_add(&one, &out.result);
        drive_tally_add(&s->all, &out.result);
        drive_print(name, &one);
        json_object_set_new(s->json, name, drive_json(&one));
        drive_csv_line(s->csv, name, 0, &out.result);
        failed = drive_write(s->out, name, &out.moments, err ? NULL : why);
        err = err ? err : failed;
    }
    free(out.moments.at);
    return err;
}

static int score_bags(struct score *s, struct error *why)
{
    char *rest = s->bags, *bag;
    int err = 0;

    while (!err && (bag = strsep(&rest, ","))) {
        err = next_truth(s, why);
        if (!err)
            err = score_bag(s, bag, why);
    }
    if (!s->all.n)
        return err;
    if (s->all.n > 1) {
        drive_print("all", &s->all);
        json_object_set_new(s->json, "all", drive_json(&s->all));
    }
    drive_print_existence(&s->all.all);
    int failed = drive_write_existence(s->out, &s->all.all, err ? NULL : why);
    err = err ? err : failed;
    failed = drive_json_write(s->json, s->out, err ? NULL : why);
    return err ? err : failed;
}

static int run(struct score *s, struct error *why)
{
    s->json = json_object();
    drive_tally_init(&s->all);
    int err = s->json ? load_scene(s, why) : error_say(why, -ENOMEM, "out of memory");
    if (!err)
        err = export_folder(s->out, why);
    if (!err)
        err = score_bags(s, why);
    if (s->csv)
        fclose(s->csv);
    truth_file_destroy(s->truth);
    room_destroy(s->scene);
    json_decref(s->json);
    return err;
}

int command_score(int argc, char **argv)
{
    struct score s = {.out = "out/score"};
    struct usage usage = {
        .command = "score", .help = help, .options = options, .into = &s};
    struct error why = {""};
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        *(code == 'b' ? &s.bags : &s.truths) = optarg;
    if (code)
        return ~code;
    if (optind < argc)
        return usage_error("score", "%s: unexpected argument", argv[optind]);
    if (!s.bags || !*s.bags)
        return usage_error("score", "--bag: expected files");
    if (!*s.out)
        return usage_error("score", "--out: expected a folder");
    if (!s.truths == !s.scene_path)
        return usage_error("score", "--bag: expected who was there: --truth FILE, or "
                                    "--scenes FILE of a simulated drive");
    if (s.truths && count(s.truths) > 1 && count(s.truths) != count(s.bags))
        return usage_error("score",
                           "--truth: expected one file, or one for each of %zu "
                           "bags",
                           count(s.bags));
    interrupt_catch();
    return usage_outcome("score", run(&s, &why), &why);
}
