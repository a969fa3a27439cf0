/* SPDX-License-Identifier: MIT */
#include "tests/nodes/launch_load.h"

#include "hal/survey/rig_file.h"
#include "msgs/topics.h"
#include "nodes/rt/launchfile.h"
#include "tests/nodes/near.h"

static void what_is_left_out_has_its_default(void **state)
{
    struct launchfile *l = launch_load(*state, "nodes: [can]\n");

    assert_int_equal(l->n_nodes, 1);
    assert_string_equal(l->nodes[0], "can");
    assert_string_equal(l->stage.uri, "sim:");
    assert_false(l->scan.background);
    assert_int_equal(l->scan.window, 32);
    assert_true(l->processes.alive_s == 3.0);
    assert_int_equal(l->scan.retries, 3);
    assert_int_equal(l->dsp.window, WINDOW_HANN);
    assert_int_equal(l->dsp.compression, COMPRESSION_MATCHED_FILTER);
    assert_string_equal(l->recon.method, "fast");
    assert_true(l->recon.preview);
    assert_true(l->track.threshold_db == 12.0);
    assert_string_equal(l->report.folder, "out");
    assert_string_equal(l->can.uri, "log:out/can.candump");
    assert_int_equal(l->can.base_id, 0x400);
    assert_int_equal(l->can.sensor, 0);
    assert_false(l->can.fd || l->can.motion || l->can.field_of_view);
    assert_int_equal(l->can.bitrate, 500000);
    assert_true(l->can.load == 0.5);
    assert_int_equal(l->can.diagnosis.request, 0);
    launchfile_destroy(l);
}

static void options_of_the_method_are_taken(void **state)
{
    struct launchfile *l =
        launch_load(*state, "nodes: [recon]\n"
                            "recon:\n"
                            "  method: iterative\n"
                            "  options: {l1: 0.02, base: paper, lightcone: never, "
                            "tv_isotropic: yes}\n");

    assert_true(l->recon.options.l1 == 0.02);
    assert_string_equal(l->recon.options.base, "paper");
    assert_int_equal(l->recon.options.lightcone, 0);
    assert_true(l->recon.options.tv_isotropic);
    assert_true(imager_option_is_given(&l->recon.options, "l1"));
    assert_false(imager_option_is_given(&l->recon.options, "tv"));
    launchfile_destroy(l);
}

/* The schema has a key for each option, and the text is looked at. */
static void every_option_has_its_key(void **state)
{
    for (const struct imager_option *i = imager_option_table; i->name; i++) {
        char text[128], rest[512], range[256];
        imager_option_range(i, range, sizeof range);
        snprintf(text, sizeof text, "nodes: [recon]\nrecon:\n  options:\n    %s: what\n",
                 i->name);
        snprintf(rest, sizeof rest, ":4: recon.options.%s: %s=what: expected %s%s",
                 i->name, i->name,
                 i->kind == IMAGER_OPTION_COUNT  ? "a whole number, "
                 : i->kind == IMAGER_OPTION_REAL ? ""
                                                 : "one of ",
                 range);
        assert_refused(*state, text, rest);
    }
}

static void options_that_the_method_does_not_use_are_refused(void **state)
{
    assert_refused(*state, "nodes: [recon]\nrecon:\n  options: {l1: 0.1}\n",
                   ":3: recon.options.l1: l1: method 'fast' does not use it; it is for "
                   "iterative, sparse");
}

static void everything_can_be_set(void **state)
{
    struct launchfile *l = launch_load(
        *state, "nodes: [array, scan]\n"
                "array: {uri: 'wav:/rec'}\n"
                "stage: {uri: 'none:'}\n"
                "scan: {background: true, window: 5, retries: 0, timeout_s: 0.5}\n"
                "dsp: {window: hamming, compression: deramp}\n"
                "recon: {method: backprojection, threads: 3, preview: false}\n"
                "track: {threshold_db: 20, min_existence: 0.25}\n"
                "can: {uri: 'socketcan:can0', base_id: 0x500, sensor: 2, fd: true, "
                "motion: true, field_of_view: true, "
                "bitrate: 250000, data_bitrate: 4000000, load: 0.25}\n"
                "report: {folder: /there}\n");

    assert_int_equal(l->n_nodes, 2);
    assert_true(launchfile_has_node(l, "scan"));
    assert_false(launchfile_has_node(l, "dsp"));
    assert_string_equal(l->array.uri, "wav:/rec");
    assert_string_equal(l->stage.uri, "none:");
    assert_true(l->scan.background);
    assert_int_equal(l->scan.window, 5);
    assert_int_equal(l->scan.retries, 0);
    assert_true(l->scan.timeout_s == 0.5);
    assert_int_equal(l->dsp.window, WINDOW_HAMMING);
    assert_int_equal(l->dsp.compression, COMPRESSION_DERAMP);
    assert_string_equal(l->recon.method, "backprojection");
    assert_int_equal(l->recon.threads, 3);
    assert_false(l->recon.preview);
    assert_true(l->track.threshold_db == 20.0 && l->track.min_existence == 0.25);
    assert_string_equal(l->can.uri, "socketcan:can0");
    assert_int_equal(l->can.base_id, 0x500);
    assert_int_equal(l->can.sensor, 2);
    assert_true(l->can.fd && l->can.motion && l->can.field_of_view);
    assert_int_equal(l->can.bitrate, 250000);
    assert_int_equal(l->can.data_bitrate, 4000000);
    assert_true(l->can.load == 0.25);
    assert_string_equal(l->report.folder, "/there");
    launchfile_destroy(l);
}

static void inputs_are_relative_to_the_file_and_logs_to_the_report(void **state)
{
    struct scratch *s = *state;
    char expected[200];
    struct launchfile *l = launch_load(s, "nodes: [can]\n"
                                          "array: {uri: 'sim:scenes/a.yaml?pace=fast'}\n"
                                          "report: {folder: results}\n");

    snprintf(expected, sizeof expected, "sim:%s/scenes/a.yaml?pace=fast", s->folder);
    assert_string_equal(l->array.uri, expected);
    assert_string_equal(l->report.folder, "results");
    assert_string_equal(l->can.uri, "log:results/can.candump");
    launchfile_destroy(l);
}

static void the_command_line_wins(void **state)
{
    const struct launchfile_options options = {.out = "/else", .realtime = true};
    struct launchfile *l = launch_load_with(*state,
                                            "nodes: [can]\n"
                                            "array: {uri: 'sim:/a.yaml'}\n"
                                            "stage: {uri: 'sim:?pace=fast'}\n"
                                            "report: {folder: results}\n",
                                            &options);

    assert_string_equal(l->report.folder, "/else");
    assert_string_equal(l->can.uri, "log:/else/can.candump");
    assert_string_equal(l->array.uri, "sim:/a.yaml?pace=real");
    assert_string_equal(l->stage.uri, "sim:?pace=real");
    launchfile_destroy(l);
}

static void real_hardware_does_not_hear_of_paces(void **state)
{
    const struct launchfile_options options = {.realtime = true};
    struct launchfile *l = launch_load_with(*state,
                                            "nodes: [can]\n"
                                            "array: {uri: 'wav:/rec'}\n"
                                            "stage: {uri: 'none:'}\n",
                                            &options);

    assert_string_equal(l->array.uri, "wav:/rec");
    assert_string_equal(l->stage.uri, "none:");
    launchfile_destroy(l);
}

static void a_file_that_is_not_there_is_said(void **state)
{
    struct error why = {""};
    struct launchfile *l = NULL;

    (void)state;
    assert_int_equal(launchfile_load(&l, "/no/such.yaml", NULL, &why), -ENOENT);
    assert_contains(why.text, "/no/such.yaml");
}

static void a_recorder_has_its_section(void **state)
{
    struct launchfile *l =
        launch_load(*state, "nodes: [record, can]\n"
                            "record: {path: a/b.mcap, topics: 'ping,scan/*', "
                            "exclude: scan/status, split_mb: 100, split_s: 60, "
                            "quota_mb: 2000, compression: lz4, flush_ms: 50}\n");

    assert_string_equal(l->record.path, "a/b.mcap");
    assert_string_equal(l->record.topics, "ping,scan/*");
    assert_string_equal(l->record.exclude, "scan/status");
    assert_int_equal(l->record.split_mb, 100);
    assert_int_equal(l->record.split_s, 60);
    assert_int_equal(l->record.quota_mb, 2000);
    assert_int_equal(l->record.compression, BAG_LZ4);
    assert_int_equal(l->record.flush_ms, 50);
    launchfile_destroy(l);
    l = launch_load(*state, "nodes: [record]\nrecord: {path: b.mcap}\n");
    assert_string_equal(l->record.topics, "*");
    assert_string_equal(l->record.exclude, "");
    assert_int_equal(l->record.split_mb, 0);
    assert_int_equal(l->record.quota_mb, 0);
    assert_int_equal(l->record.compression, BAG_NONE);
    assert_int_equal(l->record.flush_ms, 1000);
    launchfile_destroy(l);
    assert_refused(
        *state, "nodes: [record]\nrecord: {flush_ms: 10}\n",
        ":2: record.path: expected the name of a bag, e.g. out/demo.mcap, or a "
        "snapshot's folder");
    assert_refused(*state, "nodes: [can]\nrecord: {flush_ms: 0}\n",
                   ":2: record.flush_ms: expected 1 to 3600000, not 0");
    assert_refused(*state, "nodes: [can]\nrecord: {compression: zip}\n",
                   ":2: record.compression: expected none, lz4 or zstd, not zip");
    assert_refused(*state, "nodes: [can]\nrecord: {shuffle: true}\n",
                   ":2: record.shuffle: shuffled sound is for a compression: set "
                   "record.compression to zstd or lz4");
    l = launch_load(*state, "nodes: [can]\nrecord: {shuffle: true, compression: lz4}\n");
    assert_true(l->record.shuffle);
    launchfile_destroy(l);
    assert_refused(*state, "nodes: [can]\nrecord: {quota_mb: 10, split_mb: 6}\n",
                   ":2: record.split_mb: expected no more than half of quota_mb");
    launchfile_destroy(
        launch_load(*state, "nodes: [can]\nrecord: {quota_mb: 10, split_mb: 5}\n"));
}

static void a_snapshot_has_bounds_and_needs_a_folder_and_no_bag(void **state)
{
    struct launchfile *l = launch_load(
        *state,
        "nodes: [record]\nrecord: {snapshot: {folder: here, before_s: 12, after_s: "
        "0, max_mb: 100, faults: false}}\n");

    assert_string_equal(l->record.path, "");
    assert_string_equal(l->record.snapshot.folder, "here");
    assert_int_equal(l->record.snapshot.before_s, 12);
    assert_int_equal(l->record.snapshot.after_s, 0);
    assert_int_equal(l->record.snapshot.max_mb, 100);
    assert_false(l->record.snapshot.faults);
    launchfile_destroy(l);
    l = launch_load(*state,
                    "nodes: [record]\nrecord: {path: a, snapshot: {folder: b}}\n");
    assert_int_equal(l->record.snapshot.before_s, 30);
    assert_int_equal(l->record.snapshot.after_s, 5);
    assert_int_equal(l->record.snapshot.max_mb, 512);
    assert_true(l->record.snapshot.faults);
    launchfile_destroy(l);
    assert_refused(*state, "nodes: [can]\nrecord: {snapshot: {before_s: 5}}\n",
                   ":2: record.snapshot.folder: expected where bags of the last seconds "
                   "go, e.g. out/snapshots");
    assert_refused(*state, "nodes: [can]\nrecord: {snapshot: {folder: a, max_mb: 8}}\n",
                   ":2: record.snapshot.max_mb: expected 16 to 65536, not 8");
    assert_refused(*state, "nodes: [can]\nrecord: {snapshot: {folder: a, before_s: 0}}\n",
                   ":2: record.snapshot.before_s: expected 1 to 3600, not 0");
}

static void a_recording_on_the_command_line_adds_the_recorder_before_all(void **state)
{
    const struct launchfile_options options = {.record = "my.mcap"};
    struct launchfile *l = launch_load_with(*state, "nodes: [can, report]\n", &options);

    assert_int_equal(l->n_nodes, 3);
    assert_string_equal(l->nodes[0], "record");
    assert_string_equal(l->nodes[2], "report");
    assert_string_equal(l->record.path, "my.mcap");
    launchfile_destroy(l);
    l = launch_load_with(*state, "nodes: [can, record]\nrecord: {path: a.mcap}\n",
                         &options);
    assert_int_equal(l->n_nodes, 2);
    assert_string_equal(l->record.path, "my.mcap");
    launchfile_destroy(l);
}

static void mistakes_are_named_with_file_and_line(void **state)
{
    struct error why = {""};
    struct launchfile *l = NULL;
    struct scratch *s = *state;
    const char *texts[] = {
        "nodes: [can]\nscan: {windw: 3}\n",
        "nodes:\n  - radar\n",
        "nodes: [can]\ndsp: {window: blackman}\n",
        "nodes: [can]\nscan: {window: many}\n",
        "nodes: [can]\nreport: {folder: a}\nwhat: 1\n",
    };
    const char *words[] = {"2: ", "2: ", "2: ", "2: ", "3: "};

    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        char start[600];
        const char *path = scratch_write(s, "a.yaml", texts[i]);
        snprintf(start, sizeof start, "%s:%s", path, words[i]);
        assert_int_equal(launchfile_load(&l, path, NULL, &why), -EINVAL);
        assert_contains(why.text, start);
    }
}

static void values_out_of_range_are_named_with_their_limits(void **state)
{
    assert_refused(*state, "nodes: [can]\nscan:\n  window: 0\n",
                   ":3: scan.window: expected 1 to 4096, not 0");
    assert_refused(*state, "nodes: [can]\nscan: {timeout_s: -1}\n",
                   ":2: scan.timeout_s: expected 0.1 to 600, not -1");
    assert_refused(*state, "nodes: [can]\ntrack: {min_existence: 2}\n",
                   ":2: track.min_existence: expected 0 to 1, not 2");
    assert_refused(*state, "nodes: [can]\nprocesses: {alive_s: 1.5}\n",
                   ":2: processes.alive_s: expected 0 (never) or 2 to 3600, not 1.5: "
                   "health comes once a second");
    assert_refused(*state, "nodes: [can]\ncan: {base_id: 0x7f8}\n",
                   ":2: can.base_id: expected 0x100 to 0x7f0, not 0x7f8");
    assert_refused(*state, "nodes: [can]\ncan: {base_id: 255}\n",
                   ":2: can.base_id: expected 0x100 to 0x7f0, not 0xff: below, "
                   "frames of 8 bytes cannot have their end-to-end protection");
}

/* Asks for what cannot be, and takes what the refusal says can; what is beyond cannot. */
static void the_limits_that_a_refusal_names_may_be_had(void **state)
{
    static const struct {
        const char *text; /* %g: where the number goes */
        const char *after;
        bool whole;
    } keys[] = {
        {"nodes: [can]\nscan: {window: %g}\n", "scan.window: expected ", true},
        {"nodes: [can]\nscan: {timeout_s: %g}\n", "scan.timeout_s: expected ", false},
        {"nodes: [can]\ncan: {bitrate: %g}\n", "can.bitrate: expected ", true},
        {"nodes: [can]\ncan: {load: %g}\n", "can.load: expected ", false},
        {"nodes: [can]\ncan: {base_id: %g}\n", "can.base_id: expected ", true},
        {"nodes: [can]\ncan: {uri: 'socketcan:a', diagnosis: {request: %g, response: "
         "0x7e8}}\n",
         "can.diagnosis.request: expected ", true},
        {"nodes: [can]\ntrack: {detection_probability: %g}\n",
         "track.detection_probability: expected ", false},
        {"nodes: [can]\ntrack: {clutter: %g}\n", "track.clutter: expected ", false},
        {"nodes: [can]\ntrack: {coast_s: %g}\n", "track.coast_s: expected ", false},
        {"nodes: [can]\nwall: {every_s: %g}\n", "wall.every_s: expected ", false},
        {"nodes: [can]\nwall: {lost_s: %g}\n", "wall.lost_s: expected ", false},
        {"nodes: [can]\nrecord: {snapshot: {folder: a, max_mb: %g}}\n",
         "record.snapshot.max_mb: expected ", true},
    };

    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        struct error why = {""};
        struct launchfile *l = NULL;
        char text[300], *end;

        const char *at = strstr(keys[i].text, "%g");
        snprintf(text, sizeof text, "%.*s4000000000%s", (int)(at - keys[i].text),
                 keys[i].text, at + 2);
        const char *path = scratch_write(*state, "a.yaml", text);
        assert_int_equal(launchfile_load(&l, path, NULL, &why), -EINVAL);
        const char *limits = strstr(why.text, keys[i].after);
        assert_non_null(limits);
        double low = strtod(limits + strlen(keys[i].after), &end);
        assert_int_equal(strncmp(end, " to ", 4), 0);
        double high = strtod(end + 4, NULL);
        const double values[4] = {low, high, keys[i].whole ? low - 1.0 : 0.999 * low,
                                  keys[i].whole ? high + 1.0 : 1.001 * high};
        for (int k = 0; k < 4; k++) {
            char number[40];
            snprintf(number, sizeof number, keys[i].whole ? "%.0f" : "%.9g", values[k]);
            snprintf(text, sizeof text, "%.*s%s%s", (int)(at - keys[i].text),
                     keys[i].text, number, at + 2);
            int err =
                launchfile_load(&l, scratch_write(*state, "a.yaml", text), NULL, &why);
            if (err != (k < 2 ? 0 : -EINVAL))
                fail_msg("%s%s: %s", keys[i].after, number, err ? why.text : "taken");
            if (!err)
                launchfile_destroy(l);
        }
    }
}

static void a_tester_has_identifiers_of_its_own(void **state)
{
    struct launchfile *l = launch_load(
        *state, "nodes: [can]\n"
                "can: {uri: 'socketcan:can0', diagnosis: {request: 0x7e0, response: "
                "0x7e8, functional: 0x18db33f1}}\n");
    assert_int_equal(l->can.diagnosis.request, 0x7e0);
    assert_int_equal(l->can.diagnosis.response, 0x7e8);
    assert_int_equal(l->can.diagnosis.functional, 0x18db33f1);
    launchfile_destroy(l);

    static const struct {
        const char *can, *why;
    } wrong[] = {
        {"diagnosis: {request: 0x7e0}",
         ":2: can.diagnosis: expected request and response, the identifiers by which a "
         "tester asks and is answered"},
        {"diagnosis: {functional: 0x7df}",
         ":2: can.diagnosis: expected request and response, the identifiers by which a "
         "tester asks and is answered"},
        {"diagnosis: {request: 0x40c, response: 0x7e8}",
         ":2: can.diagnosis.request: 0x40c is one of the sensor's own frames, 0x400 to "
         "0x40f"},
        {"sensor: 1, diagnosis: {request: 0x7e0, response: 0x410}",
         ":2: can.diagnosis.response: 0x410 is one of the sensor's own frames, 0x410 to "
         "0x41f"},
        {"diagnosis: {request: 0x7e0, response: 0x7e8, functional: 0x400}",
         ":2: can.diagnosis.functional: 0x400 is one of the sensor's own frames, 0x400 "
         "to "
         "0x40f"},
        {"diagnosis: {request: 0x7e0, response: 0x7e0}",
         ":2: can.diagnosis: expected a different identifier for each"},
        {"diagnosis: {request: 0x7e0, response: 0x7e8, functional: 0x7e0}",
         ":2: can.diagnosis: expected a different identifier for each"},
        {"diagnosis: {request: 0, response: 0x7e8}",
         ":2: can.diagnosis.request: expected 0x1 to 0x1fffffff, not 0x0"},
        {"diagnosis: {request: 0x20000000, response: 0x7e8}",
         ":2: can.diagnosis.request: expected 0x1 to 0x1fffffff, not 0x20000000"},
    };
    char text[300];
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        snprintf(text, sizeof text, "nodes: [can]\ncan: {uri: 'socketcan:can0', %s}\n",
                 wrong[i].can);
        assert_refused(*state, text, wrong[i].why);
    }
    assert_refused(
        *state,
        "nodes: [can]\ncan: {uri: 'log:/x.candump', diagnosis: {request: 0x7e0, "
        "response: 0x7e8}}\n",
        ":2: can.diagnosis: is of a CAN interface, socketcan:can0, say; "
        "log:/x.candump carries no ISO-TP");
}

static void names_that_do_not_exist_are_refused_with_those_that_do(void **state)
{
    assert_refused(*state, "nodes:\n  - can\n  - radar\n",
                   ":3: nodes[1]: radar is no node; expected stage, array, scan, dsp, "
                   "recon, track, can, report, record, play, view or wall");
    assert_refused(*state, "nodes: [can, launcher]\n",
                   ":1: nodes[1]: launcher is no node; expected stage, array, scan, dsp, "
                   "recon, track, can, report, record, play, view or wall");
    assert_refused(*state, "nodes: [can]\ndsp: {window: blackman}\n",
                   ":2: dsp.window: expected hann, hamming or rectangular, not blackman");
    assert_refused(*state, "nodes: [can]\ndsp: {compression: mp3}\n",
                   ":2: dsp.compression: expected matched_filter or deramp, not mp3");
}

static void nodes_that_hang_may_be_left_alone(void **state)
{
    struct launchfile *l = NULL;
    struct error why = {""};
    const char *path =
        scratch_write(*state, "a.yaml", "nodes: [can]\nprocesses: {alive_s: 0}\n");

    assert_int_equal(launchfile_load(&l, path, NULL, &why), 0);
    assert_true(l->processes.alive_s == 0.0);
    launchfile_destroy(l);
}

static void a_node_twice_is_refused(void **state)
{
    assert_refused(*state, "nodes: [can, scan, can]\n",
                   ":1: nodes: expected each node once, but can is there twice");
}

static void an_array_node_needs_a_device(void **state)
{
    struct error why = {""};
    struct launchfile *l = NULL;

    assert_int_equal(launchfile_load(&l,
                                     scratch_write(*state, "a.yaml", "nodes: [array]\n"),
                                     NULL, &why),
                     -EINVAL);
    assert_contains(why.text, "array.uri: expected a device");
}

static void an_unknown_method_is_refused(void **state)
{
    assert_refused(*state, "nodes: [can]\nrecon: {method: magic}\n",
                   ":2: recon.method: magic is not one of the methods, e.g. fast or "
                   "backprojection");
    assert_refused(*state, "nodes: [can]\nrecon: {method: fats}\n",
                   ":2: recon.method: fats is not one of the methods, e.g. fast or "
                   "backprojection; did you mean fast?");
}

static void the_demo_can_be_loaded(void **state)
{
    struct error why = {""};
    struct launchfile *l = NULL;

    (void)state;
    if (launchfile_load(&l, SOURCE_DIR "/launch/demo.yaml", NULL, &why))
        fail_msg("%s", why.text);
    assert_int_equal(l->n_nodes, 8);
    for (unsigned i = 0; i < l->n_nodes; i++)
        assert_true(topic_is_published_by(topic_health(), l->nodes[i]));
    launchfile_destroy(l);
}

static void the_drive_can_be_loaded(void **state)
{
    struct error why = {""};
    struct launchfile *l = NULL;

    (void)state;
    if (launchfile_load(&l, SOURCE_DIR "/launch/drive.yaml", NULL, &why))
        fail_msg("%s", why.text);
    assert_true(l->scan.fixed && !launchfile_has_node(l, "stage"));
    for (unsigned i = 0; i < l->n_nodes; i++)
        assert_true(topic_is_published_by(topic_health(), l->nodes[i]));
    launchfile_destroy(l);
}

static void what_is_played_is_said_in_the_file_or_on_the_command_line(void **state)
{
    struct scratch *s = *state;
    struct launchfile_options options = {.bag = NULL};
    struct error why = {""};
    struct launchfile *l = NULL;
    char bag[600];

    const char *path = scratch_write(s, "a.yaml",
                                     "nodes: [play, dsp]\n"
                                     "play: {bag: a.mcap, rate: max, loop: true, "
                                     "end_s: 2.5, exclude: 'stage/*'}\n");
    if (launchfile_load(&l, path, &options, &why))
        fail_msg("%s", why.text);
    snprintf(bag, sizeof bag, "%s/a.mcap", s->folder);
    assert_string_equal(l->play.bag, bag);
    assert_true(l->play.rate == 0.0);
    assert_true(l->play.loop);
    assert_true(l->play.start_s == 0.0 && l->play.end_s == 2.5);
    assert_string_equal(l->play.exclude, "stage/*");
    assert_null(l->play.topics);
    launchfile_destroy(l);
    options.bag = "b.mcap";
    options.rate = "0.5";
    assert_int_equal(launchfile_load(&l, path, &options, &why), 0);
    assert_string_equal(l->play.bag, "b.mcap");
    assert_true(l->play.rate == 0.5);
    launchfile_destroy(l);
}

static void the_replay_can_be_loaded(void **state)
{
    struct error why = {""};
    struct launchfile *l = NULL;

    (void)state;
    if (launchfile_load(&l, SOURCE_DIR "/launch/play.yaml", NULL, &why))
        fail_msg("%s", why.text);
    assert_true(launchfile_has_node(l, "play"));
    assert_string_equal(l->play.bag, SOURCE_DIR "/launch/../out/demo.mcap");
    launchfile_destroy(l);
}

static void what_cannot_be_played_is_refused(void **state)
{
    struct scratch *s = *state;
    const struct launchfile_options options = {.rate = "fast"};
    const struct launchfile_options bag = {.bag = "a.mcap"};
    struct error why = {""};
    struct launchfile *l = NULL;

    assert_refused(s, "nodes: [play]\n",
                   ": play.bag: expected the name of a bag; or say --bag FILE");
    assert_refused(s, "nodes: [play]\nplay: {bag: a, rate: -1}\n",
                   ":2: play.rate: expected max, or 0.001 to 1000000, not -1");
    assert_refused(s, "nodes: [play]\nplay: {bag: a, start_s: 3, end_s: 2}\n",
                   ":2: play.start_s: expected 0 or more, and no more than end_s");
    const char *path = scratch_write(s, "a.yaml", "nodes: [play]\nplay: {bag: a}\n");
    assert_int_equal(launchfile_load(&l, path, &options, &why), -EINVAL);
    assert_string_equal(why.text, "--rate fast: expected max, or 0.001 to 1000000");
    path = scratch_write(s, "a.yaml", "nodes: [dsp]\n");
    assert_int_equal(launchfile_load(&l, path, &bag, &why), -EINVAL);
    assert_contains(why.text, "launch files with the node play");
}

static void what_a_recording_names_is_relative_to_the_file_too(void **state)
{
    struct scratch *s = *state;
    char expected[400];
    struct launchfile *l =
        launch_load(s, "nodes: [array]\narray: {uri: "
                       "'wav:rec?survey=s.yaml&background=bg&calibrated=c.yaml'}\n");

    snprintf(expected, sizeof expected,
             "wav:%s/rec?survey=%s/s.yaml&background=%s/bg&calibrated=%s/c.yaml",
             s->folder, s->folder, s->folder, s->folder);
    assert_string_equal(l->array.uri, expected);
    launchfile_destroy(l);
}

static void a_sound_cards_rig_is_relative_to_the_file_and_its_name_is_not(void **state)
{
    struct scratch *s = *state;
    char expected[400];
    struct launchfile *l = launch_load(
        s, "nodes: [array]\narray: {uri: 'alsa:hw:2,0?rig=r.yaml&background=bg'}\n");

    snprintf(expected, sizeof expected, "alsa:hw:2,0?rig=%s/r.yaml&background=%s/bg",
             s->folder, s->folder);
    assert_string_equal(l->array.uri, expected);
    launchfile_destroy(l);
}

static void a_stage_stands_still_while_a_recording_is_played(void **state)
{
    static const struct {
        const char *text;
        bool moves;
    } cases[] = {
        {"nodes: [array, stage]\narray: {uri: 'sim:a.yaml'}\n", true},
        {"nodes: [array, stage]\narray: {uri: 'alsa:hw:2,0?rig=r.yaml'}\n", true},
        {"nodes: [array, stage]\narray: {uri: 'wav:rec'}\n", false},
        {"nodes: [array]\narray: {uri: 'sim:a.yaml'}\n", false},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct launchfile *l = launch_load(*state, cases[i].text);
        assert_int_equal(launchfile_moves_stage(l), cases[i].moves);
        launchfile_destroy(l);
    }
}

static void an_array_that_stands_keeps_the_pace_of_its_sound(void **state)
{
    static const struct {
        const char *nodes, *uri, *mode;
        bool keeps;
    } cases[] = {
        {"array", "sim:a.yaml", "fixed", true},
        {"array", "alsa:hw:1?rig=r.yaml", "fixed", true},
        {"array", "sim:a.yaml?pace=real", "fixed", true},
        {"array", "sim:a-pace=fast.yaml", "fixed", true}, /* its name */
        {"array", "sim:a.yaml", "stepped", false},
        {"array", "sim:a.yaml?pace=fast", "fixed", false},
        {"array", "sim:a.yaml?seed=3&pace=fast", "fixed", false},
        {"array, play", "sim:a.yaml", "fixed", false},
    };
    char text[256];

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        snprintf(text, sizeof text,
                 "nodes: [%s]\narray: {uri: '%s'}\nscan: {mode: %s}\n%s", cases[i].nodes,
                 cases[i].uri, cases[i].mode,
                 strstr(cases[i].nodes, "play") ? "play: {bag: b.mcap}\n" : "");
        struct launchfile *l = launch_load(*state, text);
        assert_int_equal(launchfile_keeps_pace(l), cases[i].keeps);
        launchfile_destroy(l);
    }
}

static void the_launch_file_of_bags_can_be_loaded(void **state)
{
    struct error why = {""};
    struct launchfile *l = NULL;

    (void)state;
    if (launchfile_load(&l, SOURCE_DIR "/launch/replay.yaml", NULL, &why))
        fail_msg("%s", why.text);
    assert_false(launchfile_moves_stage(l));
    launchfile_destroy(l);
}

static void the_hardware_to_start_from_can_be_loaded(void **state)
{
    static const struct {
        const char *launch, *rig;
        size_t n_speakers, n_positions;
    } files[] = {{"lab-scan", "lab-rig", 16, 32}, {"vehicle", "vehicle-rig", 8, 16}};

    (void)state;
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        struct error why = {""};
        struct launchfile *l = NULL;
        struct rig rig;
        char path[512];
        snprintf(path, sizeof path, SOURCE_DIR "/launch/%s.yaml", files[i].launch);
        if (launchfile_load(&l, path, NULL, &why))
            fail_msg("%s", why.text);
        snprintf(path, sizeof path, "?rig=" SOURCE_DIR "/launch/%s.yaml", files[i].rig);
        assert_non_null(strstr(l->array.uri, path));
        assert_true(launchfile_moves_stage(l));
        if (rig_load(&rig, path + strlen("?rig="), &why))
            fail_msg("%s", why.text);
        assert_int_equal(rig.survey.n_speakers, files[i].n_speakers);
        assert_int_equal(rig.survey.n_positions, files[i].n_positions);
        rig_clear(&rig);
        launchfile_destroy(l);
    }
}

static void a_scan_is_stepped_and_what_it_subtracts_was_recorded(void **state)
{
    struct launchfile *l = launch_load(*state, "nodes: [dsp]\n");

    assert_false(l->scan.fixed);
    assert_int_equal(l->scan.n_speakers, 0);
    assert_int_equal(l->dsp.background, BACKGROUND_NONE);
    launchfile_destroy(l);
    l = launch_load(*state, "nodes: [dsp]\nscan: {mode: stepped, background: true}\n");
    assert_false(l->scan.fixed);
    assert_int_equal(l->dsp.background, BACKGROUND_RECORDED);
    launchfile_destroy(l);
}

static void a_fixed_array_has_its_speakers_and_backgrounds(void **state)
{
    static const uint32_t speakers[] = {0, 15, 5};
    struct launchfile *l =
        launch_load(*state, "nodes: [scan, dsp]\n"
                            "scan: {mode: fixed, speakers: [0, 15, 5]}\n"
                            "dsp: {background: adaptive, background_s: 2.5}\n");

    assert_true(l->scan.fixed);
    assert_int_equal(l->scan.n_speakers, 3);
    assert_memory_equal(l->scan.speakers, speakers, sizeof speakers);
    assert_int_equal(l->scan.background_frames, 8);
    assert_int_equal(l->dsp.background, BACKGROUND_ADAPTIVE);
    assert_true(l->dsp.background_s == 2.5);
    launchfile_destroy(l);
    l = launch_load(*state,
                    "nodes: [scan, dsp]\n"
                    "scan: {mode: fixed, background: true, background_frames: 20}\n");
    assert_int_equal(l->scan.background_frames, 20);
    assert_int_equal(l->dsp.background, BACKGROUND_RECORDED);
    launchfile_destroy(l);
}

static void what_does_not_fit_a_scan_is_named(void **state)
{
    static const struct {
        const char *text, *says;
    } cases[] = {
        {"scan: {mode: quick}",
         ":2: scan.mode: expected stepped, continuous or fixed, not quick"},
        {"scan: {speakers: [1]}", ":2: scan.speakers: is of an array that stands; "
                                  "expected it with scan.mode: fixed"},
        {"dsp: {background: adaptive}", ":2: dsp.background: is of an array that "
                                        "stands; expected it with scan.mode: fixed"},
        {"scan: {mode: fixed, speakers: [1, 2, 1]}",
         ":2: scan.speakers: expected each speaker once, but 1 is there twice"},
        {"scan: {mode: fixed, background_frames: 0}",
         ":2: scan.background_frames: expected 1 to 1000, not 0"},
        {"scan: {mode: fixed}\ndsp: {background: soft}",
         ":3: dsp.background: expected none, recorded or adaptive, not soft"},
        {"scan: {mode: fixed}\ndsp: {background: recorded}",
         ":3: dsp.background: recorded does not go with scan.background: false, which "
         "says whether one is recorded"},
        {"scan: {mode: fixed, background: true}\ndsp: {background: adaptive}",
         ":3: dsp.background: adaptive does not go with scan.background: true, which "
         "says whether one is recorded"},
        {"scan: {mode: fixed}\ndsp: {background_s: 0}",
         ":3: dsp.background_s: expected over 0 and up to 3600, not 0"},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[300];
        snprintf(text, sizeof text, "nodes: [scan, dsp]\n%s\n", cases[i].text);
        assert_refused(*state, text, cases[i].says);
    }
}

static void launch_files_of_the_papers_arrangements_can_be_loaded(void **state)
{
    static const char *const names[] = {"full-array", "one-pair"};
    struct error why = {""};

    (void)state;
    for (size_t i = 0; i < 2; i++) {
        char path[300];
        struct launchfile *l = NULL;
        snprintf(path, sizeof path, "%s/launch/%s.yaml", SOURCE_DIR, names[i]);
        if (launchfile_load(&l, path, NULL, &why))
            fail_msg("%s", why.text);
        assert_int_equal(l->scan.fixed, i == 0);
        launchfile_destroy(l);
    }
}

static void who_simulates_another_scene_has_another_folder_of_results(void **state)
{
    static const char *const names[] = {"demo", "drive", "drive-car", "full-array",
                                        "one-pair"};
    struct error why = {""};

    (void)state;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        char path[300], folder[64];
        struct launchfile *l = NULL;
        snprintf(path, sizeof path, "%s/launch/%s.yaml", SOURCE_DIR, names[i]);
        snprintf(folder, sizeof folder, "out/%s", names[i]);
        if (launchfile_load(&l, path, NULL, &why))
            fail_msg("%s", why.text);
        assert_string_equal(l->report.folder, folder);
        launchfile_destroy(l);
    }
}

static void a_fixed_array_is_tracked_unless_told(void **state)
{
    struct launchfile *l = launch_load(*state, "nodes: [track]\n");

    assert_int_equal(l->track.mode, OBJECT_TRACKER_AUTO);
    assert_int_equal(l->track.confirm_hits, 2);
    assert_int_equal(l->track.confirm_of, 3);
    launchfile_destroy(l);
}

static void everything_of_tracks_can_be_said(void **state)
{
    struct launchfile *l = launch_load(
        *state,
        "nodes: [track]\n"
        "track: {mode: lists, threshold_db: 15, confirm_hits: 3, confirm_of: 5,\n"
        "        confirm_existence: 0.5, detection_probability: 0.7, clutter: 2,\n"
        "        sidelobe_db: 10, look_s: 0.1, acceleration_psd: 1, join_m: 1,\n"
        "        coast_s: 2, min_existence: 0.2}\n");

    assert_int_equal(l->track.mode, OBJECT_TRACKER_LISTS);
    assert_int_equal(l->track.confirm_hits, 3);
    assert_int_equal(l->track.confirm_of, 5);
    assert_true(l->track.threshold_db == 15.0 && l->track.min_existence == 0.2);
    assert_true(l->track.confirm_existence == 0.5 && l->track.clutter == 2.0);
    assert_true(l->track.detection_probability == 0.7 && l->track.sidelobe_db == 10.0);
    assert_true(l->track.look_s == 0.1 && l->track.acceleration_psd == 1.0);
    assert_true(l->track.join_m == 1.0 && l->track.coast_s == 2.0);
    launchfile_destroy(l);
}

static void what_makes_no_sense_of_tracks_is_refused(void **state)
{
    static const char *const bad[][2] = {
        {"confirm_hits: 6", ":2: track.confirm_hits: expected 1 to 3, not 6"},
        {"mode: maybe", ":2: track.mode: expected auto, lists or tracks, not maybe"},
        {"coast_s: 0", ":2: track.coast_s: expected 0.01 to 60, not 0"},
    };

    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct error why = {""};
        struct launchfile *l = NULL;
        char text[128];
        snprintf(text, sizeof text, "nodes: [track]\ntrack: {%s}\n", bad[i][0]);
        const char *path = scratch_write(*state, "a.yaml", text);
        assert_int_equal(launchfile_load(&l, path, NULL, &why), -EINVAL);
        assert_error(why.text, path, bad[i][1]);
    }
}

static void the_page_is_for_this_machine_alone_unless_told(void **state)
{
    struct launchfile *l = launch_load(*state, "nodes: [view]\n");

    assert_string_equal(l->view.address, "127.0.0.1");
    assert_int_equal(l->view.port, 8765);
    assert_false(l->view.save);
    assert_null(l->view.bag);
    launchfile_destroy(l);
}

static void a_bag_is_beside_the_launch_file(void **state)
{
    struct scratch *s = *state;
    char expected[128];
    struct launchfile *l = launch_load(s, "nodes: [view]\nview: {address: 0.0.0.0, port: "
                                          "80, bag: bags/a.mcap, save: true}\n");

    snprintf(expected, sizeof expected, "%s/bags/a.mcap", s->folder);
    assert_string_equal(l->view.bag, expected);
    assert_string_equal(l->view.address, "0.0.0.0");
    assert_int_equal(l->view.port, 80);
    assert_true(l->view.save);
    launchfile_destroy(l);
    l = launch_load(s, "nodes: [view]\nview: {bag: /a.mcap}\n");
    assert_string_equal(l->view.bag, "/a.mcap");
    launchfile_destroy(l);
}

static void there_are_65536_ports(void **state)
{
    struct error why = {""};
    struct launchfile *l = NULL;
    const char *path = scratch_write(*state, "a.yaml",
                                     "nodes: [view]\n"
                                     "view:\n"
                                     "  port: 65536\n");

    assert_int_equal(launchfile_load(&l, path, NULL, &why), -EINVAL);
    assert_error(why.text, path, ":3: view.port: expected 0 (any) to 65535, not 65536");
}

static int parse_wall(const char *wall, struct launchfile **out, struct error *why)
{
    char text[512];
    int n = snprintf(text, sizeof text, "nodes: [wall]\n%s", wall);
    why->text[0] = 0;
    return launchfile_parse(out, "drive.yaml", text, (size_t)n, why);
}

static void walls_come_from_the_survey_unless_it_says_otherwise(void **state)
{
    (void)state;
    struct launchfile *l;
    struct error why;
    if (parse_wall("", &l, &why))
        fail_msg("%s", why.text);
    assert_true(launchfile_has_node(l, "wall"));
    assert_int_equal(l->wall.from, WALL_FROM_SURVEY);
    assert_true(l->wall.vertical);
    assert_near(l->wall.vertical_deg, 2.0, 0.0);
    assert_near(l->wall.reach_m, 5.0, 0.0);
    assert_near(l->wall.every_s, 0.5, 0.0);
    assert_near(l->wall.lost_s, 3.0, 0.0);
    assert_int_equal(l->wall.n_corners, 0);
    launchfile_destroy(l);
}

static void each_key_of_walls_is_taken(void **state)
{
    (void)state;
    struct launchfile *l;
    struct error why;
    if (parse_wall(
            "wall: {from: echoes, prior: none, vertical_deg: 3, reach_m: 7, every_s: 1, "
            "lost_s: 9, free_view_m: [[-1, 0], [1, 0], [0, 2.5]]}\n",
            &l, &why))
        fail_msg("%s", why.text);
    assert_int_equal(l->wall.from, WALL_FROM_ECHOES);
    assert_false(l->wall.vertical);
    assert_near(l->wall.vertical_deg, 3.0, 0.0);
    assert_near(l->wall.reach_m, 7.0, 0.0);
    assert_near(l->wall.every_s, 1.0, 0.0);
    assert_near(l->wall.lost_s, 9.0, 0.0);
    assert_int_equal(l->wall.n_corners, 3);
    assert_near(l->wall.free_view_m[0][0], -1.0, 0.0);
    assert_near(l->wall.free_view_m[2][1], 2.5, 0.0);
    launchfile_destroy(l);
    assert_int_equal(parse_wall("wall: {from: topic}\n", &l, &why), 0);
    assert_int_equal(l->wall.from, WALL_FROM_TOPIC);
    launchfile_destroy(l);
}

static void what_does_not_fit_walls_is_named(void **state)
{
    (void)state;
    const struct {
        const char *text, *says;
    } cases[] = {
        {"wall: {from: radar}\n", "wall.from: expected survey, topic or echoes"},
        {"wall: {prior: flat}\n", "wall.prior: expected vertical or none"},
        {"wall: {reach_m: 0.1}\n", "wall.reach_m: expected 0.3 to 20, not 0.1"},
        {"wall: {vertical_deg: 0}\n", "wall.vertical_deg: expected"},
        {"wall: {every_s: -1}\n", "wall.every_s: expected"},
        {"wall: {lost_s: 1000}\n", "wall.lost_s: expected"},
        {"wall: {free_view_m: [[0, 1], [1, 1]]}\n", "expected at least 3 corners"},
        {"wall: {free_view_m: [[0, 1], [1, 1], [2, 1e9]]}\n", "wall.free_view_m[2]"},
        {"wall: {free_view_m: [[0, 1, 2], [1, 1, 2], [2, 1, 2]]}\n", "drive.yaml:2"},
        {"wall: {distance_m: 1}\n", "distance_m"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct launchfile *l;
        struct error why;
        assert_int_equal(parse_wall(cases[i].text, &l, &why), -EINVAL);
        if (!strstr(why.text, cases[i].says))
            fail_msg("\"%s\" does not say \"%s\"", why.text, cases[i].says);
    }
}

/* recon.frames in a launch file: images of a fixed array. */
static int parse_frames(struct launchfile **l, const char *frames, struct error *why)
{
    char text[256];
    int n =
        snprintf(text, sizeof text, "nodes: [recon]\nscan: {mode: fixed}\n%s\n", frames);
    return launchfile_parse(l, "drive.yaml", text, (size_t)n, why);
}

static void by_default_the_pings_of_a_frame_make_its_image_by_power(void **state)
{
    (void)state;
    struct error why = {""};
    struct launchfile *l;
    assert_int_equal(parse_frames(&l, "", &why), 0);
    assert_int_equal(l->recon.frames.pings, 0);
    assert_int_equal(l->recon.frames.sum, FRAMES_POWER);
    assert_false(l->recon.frames.every_ping);
    launchfile_destroy(l);
}

static void pings_their_sum_and_the_pace_of_frames_can_be_set(void **state)
{
    (void)state;
    struct error why = {""};
    struct launchfile *l;
    assert_int_equal(
        parse_frames(&l, "recon: {frames: {pings: 4, sum: coherent, every: ping}}", &why),
        0);
    assert_int_equal(l->recon.frames.pings, 4);
    assert_int_equal(l->recon.frames.sum, FRAMES_COHERENT);
    assert_true(l->recon.frames.every_ping);
    launchfile_destroy(l);
}

static void what_frames_cannot_be_is_refused_by_name(void **state)
{
    (void)state;
    static const struct {
        const char *frames, *said;
    } wrong[] = {
        {"recon: {frames: {pings: 257}}", "recon.frames.pings: expected 0 to 256"},
        {"recon: {frames: {sum: loud}}", "recon.frames.sum: expected coherent or power"},
        {"recon: {frames: {every: day}}", "recon.frames.every: expected ping or frame"},
        {"recon: {method: fast}", "recon.method: is for scans"},
        {"recon: {options: {snr_db: 10}}", "recon.options: is for scans"},
        {"recon: {preview: true}", "recon.preview: is for scans"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        struct error why = {""};
        struct launchfile *l;
        assert_int_equal(parse_frames(&l, wrong[i].frames, &why), -EINVAL);
        if (!strstr(why.text, wrong[i].said))
            fail_msg("%s", why.text);
    }
}

static void of_a_scan_frames_are_refused(void **state)
{
    (void)state;
    static const char text[] = "nodes: [recon]\nrecon: {frames: {pings: 4}}\n";
    struct error why = {""};
    struct launchfile *l;
    assert_int_equal(launchfile_parse(&l, "a.yaml", text, sizeof text - 1, &why),
                     -EINVAL);
    assert_non_null(strstr(why.text, "recon.frames"));
    assert_non_null(strstr(why.text, "scan.mode: fixed"));
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_is_left_out_has_its_default),
        TEST(everything_can_be_set),
        TEST(options_of_the_method_are_taken),
        TEST(every_option_has_its_key),
        TEST(options_that_the_method_does_not_use_are_refused),
        TEST(inputs_are_relative_to_the_file_and_logs_to_the_report),
        TEST(the_command_line_wins),
        TEST(real_hardware_does_not_hear_of_paces),
        TEST(a_file_that_is_not_there_is_said),
        TEST(a_recorder_has_its_section),
        TEST(a_snapshot_has_bounds_and_needs_a_folder_and_no_bag),
        TEST(a_recording_on_the_command_line_adds_the_recorder_before_all),
        TEST(mistakes_are_named_with_file_and_line),
        TEST(values_out_of_range_are_named_with_their_limits),
        TEST(the_limits_that_a_refusal_names_may_be_had),
        TEST(a_tester_has_identifiers_of_its_own),
        TEST(names_that_do_not_exist_are_refused_with_those_that_do),
        TEST(nodes_that_hang_may_be_left_alone),
        TEST(a_node_twice_is_refused),
        TEST(an_array_node_needs_a_device),
        TEST(an_unknown_method_is_refused),
        TEST(what_is_played_is_said_in_the_file_or_on_the_command_line),
        TEST(an_array_that_stands_keeps_the_pace_of_its_sound),
        TEST(the_launch_file_of_bags_can_be_loaded),
        TEST(what_cannot_be_played_is_refused),
        TEST(what_a_recording_names_is_relative_to_the_file_too),
        TEST(a_sound_cards_rig_is_relative_to_the_file_and_its_name_is_not),
        TEST(a_stage_stands_still_while_a_recording_is_played),
        TEST(the_demo_can_be_loaded),
        TEST(the_drive_can_be_loaded),
        TEST(the_replay_can_be_loaded),
        TEST(the_hardware_to_start_from_can_be_loaded),
        TEST(a_scan_is_stepped_and_what_it_subtracts_was_recorded),
        TEST(a_fixed_array_has_its_speakers_and_backgrounds),
        TEST(what_does_not_fit_a_scan_is_named),
        TEST(launch_files_of_the_papers_arrangements_can_be_loaded),
        TEST(who_simulates_another_scene_has_another_folder_of_results),
        TEST(a_fixed_array_is_tracked_unless_told),
        TEST(everything_of_tracks_can_be_said),
        TEST(what_makes_no_sense_of_tracks_is_refused),
        TEST(the_page_is_for_this_machine_alone_unless_told),
        TEST(a_bag_is_beside_the_launch_file),
        TEST(there_are_65536_ports),
        cmocka_unit_test(walls_come_from_the_survey_unless_it_says_otherwise),
        cmocka_unit_test(each_key_of_walls_is_taken),
        cmocka_unit_test(what_does_not_fit_walls_is_named),
        cmocka_unit_test(by_default_the_pings_of_a_frame_make_its_image_by_power),
        cmocka_unit_test(pings_their_sum_and_the_pace_of_frames_can_be_set),
        cmocka_unit_test(what_frames_cannot_be_is_refused_by_name),
        cmocka_unit_test(of_a_scan_frames_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
