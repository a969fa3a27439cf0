#include "nodes/anlos/bench/drive_bags.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/bench/drive_bag.h"
#include "nodes/anlos/bench/drive_report.h"
#include "nodes/anlos/bench/names.h"
#include "nodes/rt/export.h"

struct bags {
    const struct bench_options *o;
    struct room *scene;
    struct truth_file *truth;
    struct drive_tally all;
    json_t *json;
    FILE *csv;
};

static int load_truth(struct bags *b, struct complaint *why)
{
    const struct bench_options *o = b->o;

    if (!o->truth == !o->scenes)
        return complain(
            why, -EINVAL,
            "--bag: expected who was there: --truth FILE, or --scenes FILE of "
            "a simulated drive");
    if (o->truth)
        return truth_file_load(&b->truth, o->truth, why);
    int err = room_load(&b->scene, o->scenes, why);
    if (!err && !room_is_drive(b->scene))
        err = complain(why, -ENOTSUP, "%s: not a drive: the key \"drive\" is missing",
                       o->scenes);
    return err;
}

static int score(struct bags *b, const char *bag, struct complaint *why)
{
    struct drive_outcome out;
    struct drive_tally one;
    char name[256];

    drive_bag(bag, b->scene, b->truth, &out);
    int err = out.err ? complain(why, out.err, "%s", out.why.text) : 0;
    if (out.result.n_lists && (!err || err == -EINTR)) {
        drive_name(bag, name, sizeof name);
        drive_tally_init(&one);
        drive_tally_add(&one, &out.result);
        drive_tally_add(&b->all, &out.result);
        drive_print(name, &one);
        json_object_set_new(b->json, name, drive_json(&one));
        drive_csv_line(b->csv, name, 0, &out.result);
        int failed = drive_write(b->o->out, name, &out.moments, err ? NULL : why);
        err = err ? err : failed;
    }
    free(out.moments.at);
    return err;
}

static int run(struct bags *b, const char *names, struct complaint *why)
{
    int err = 0;

    drive_print_head();
    for (const char *s = names; !err && *s; s += strlen(s) + 1)
        err = score(b, s, why);
    if (b->all.n > 1) {
        drive_print("all", &b->all);
        json_object_set_new(b->json, "all", drive_json(&b->all));
    }
    int failed = drive_json_write(b->json, b->o->out, err ? NULL : why);
    return err ? err : failed;
}

int drive_bags(const struct bench_options *o, struct complaint *why)
{
    struct bags b = {.o = o, .json = json_object()};
    char *names = bench_names_split(o->bags);
    int err = b.json && names ? load_truth(&b, why)
                              : complain(why, -ENOMEM, "out of memory");

    drive_tally_init(&b.all);
    if (!err)
        err = export_folder(o->out, why);
    if (!err)
        err = drive_csv_open(&b.csv, o->out, why);
    if (!err)
        err = run(&b, names, why);
    if (b.csv)
        fclose(b.csv);
    truth_file_destroy(b.truth);
    room_destroy(b.scene);
    json_decref(b.json);
    free(names);
    return err;
}
