/* SPDX-License-Identifier: MIT */
/* Simulated drives through the steps of the nodes dsp and wall, at simulated time: what
 * the array says of its range where nothing is wrong, and where noise comes and goes. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "hal/survey/firing.h"
#include "msgs/convert.h"
#include "nodes/anlos/doctor/drive_pipe.h"
#include "nodes/array/acquisition.h"
#include "nodes/can/watch.h"
#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/node.h"
#include "nodes/wall/finding.h"
#include "recon/frontend/frontend.h"

#define SCENES    SOURCE_DIR "/launch/scenes/"
#define DRIVE_S   12.0
#define KNOCKED_S 15.1

struct drive {
    struct launchfile *launch;
    struct drive_world world;
    struct survey survey;
    struct frontend *frontend;
    struct finding *walls;
    const char *why;
    struct self_test_faults faults;
    struct self_test_levels levels;
    struct interference_levels interference;
    struct tone_found tone;
    bool subtracted; /* of the newest ping's traces: a background, */
    bool silent;     /* and some samples in the gate are 0 */
    bool heard;      /* and some behind the slot are not */
    bool blanked;
    double until_s; /* the delay of the last */
    int64_t ego_ns;
    char note[512];
};

static void start(struct drive *d, const char *scene)
{
    struct firing firing;
    const struct drive_world_config world = {.scene = scene, .firing = &firing};
    struct pipeline_config cfg;
    struct error why = {""};

    *d = (struct drive){.launch = NULL};
    bool fast = strstr(scene, "-car") || strstr(scene, "-cyclist");
    int err = launchfile_load(&d->launch,
                              fast ? SOURCE_DIR "/launch/drive-car.yaml"
                                   : SOURCE_DIR "/launch/drive.yaml",
                              NULL, &why);
    if (!err)
        err = firing_from_uri(&firing, d->launch->array.uri, &why);
    if (!err)
        err = drive_world_create(&d->world, &world, &why);
    if (!err)
        err = survey_from_message(&d->survey, d->world.survey, &why);
    if (err)
        fail_msg("%s: %s", scene, why.text);
    launchfile_pipeline(&cfg, d->launch);
    cfg.walls.map.from = WALL_FROM_ECHOES;
    cfg.frontend.hears_walls = cfg.frontend.judges_array = true;
    if (finding_create(&d->walls, NULL, &cfg.walls) ||
        finding_survey(d->walls, d->world.survey, &why) ||
        frontend_create(&d->frontend, &cfg.frontend) ||
        frontend_survey(d->frontend, &d->survey, &why) ||
        drive_world_shoot(&d->world, PASS_SCENE, &why))
        fail_msg("%s: %s", scene, why.text);
    assert_non_null(frontend_self_test(d->frontend, &d->why));
    d->ego_ns = d->world.begin_ns;
}

static void stop(struct drive *d)
{
    frontend_destroy(d->frontend);
    finding_destroy(d->walls);
    survey_clear(&d->survey);
    drive_world_clear(&d->world);
    launchfile_destroy(d->launch);
}

/* A ping; the time since the start. */
static double go_on(struct drive *d)
{
    Anlos__EgoMotion ego;
    Anlos__Ping message;
    struct ping ping;
    struct frontend_output out;
    struct self_test *judge = frontend_self_test(d->frontend, &d->why);
    struct walls walls;
    struct error why;
    int64_t stamp_ns;

    assert_int_equal(drive_world_ping(&d->world, PASS_SCENE, &message, &stamp_ns), 0);
    for (; d->ego_ns <= stamp_ns + 50000000; d->ego_ns += DRIVE_EGO_NS) {
        drive_world_ego(&d->world, d->ego_ns, &ego);
        finding_ego(d->walls, &ego, d->ego_ns);
    }
    message.survey_id =
        frontend_survey_id(d->frontend); /* as the array names it by then */
    ping_from_message(&ping, &message, stamp_ns);
    frontend_ping(d->frontend, &ping, &out);
    wall_finder_returns(finding_finder(d->walls), &out.returns, stamp_ns);
    if (d->world.n % 5 == 0) { /* ten a second, nearly */
        assert_int_equal(walls_from_message(&walls, finding_walls(d->walls), &why), 0);
        self_test_walls(judge, &walls);
    }
    assert_true(frontend_judge(d->frontend, &ping, &d->faults, d->note, sizeof d->note));
    self_test_levels(judge, &d->levels);
    frontend_interference(d->frontend, &d->interference);
    frontend_tones(d->frontend, &d->tone);
    const struct traces *t = &out.traces;
    d->subtracted = t->background_subtracted;
    d->blanked = t->blanked;
    d->until_s = t->format.t0_s + (double)(t->format.n_samples - 1) / t->format.rate_hz;
    d->silent = d->heard = false;
    for (size_t i = 0; i < d->survey.n_microphones * t->format.n_samples; i++) {
        double delay_s = t->format.t0_s +
                         (double)(i % t->format.n_samples) / t->format.rate_hz;
        d->silent |= delay_s < 2.0 * d->survey.gate_m[1] / d->survey.sound_speed_m_s &&
                     t->samples[i] == 0.0f;
        d->heard |= delay_s > (double)d->survey.slot_samples / d->survey.sample_rate_hz &&
                    t->samples[i] != 0.0f;
    }
    return 1e-9 * (double)(stamp_ns - d->world.begin_ns);
}

static void where_nothing_is_wrong_nothing_is_said(void **state)
{
    static const char *const scenes[] = {
        "drive-person",     "drive-person-moving",  "drive-person-present",
        "drive-cyclist",    "drive-cyclist-moving", "drive-car",
        "drive-car-moving", "drive-clutter",        "drive-clutter-moving",
        "drive-nothing",    "drive-nothing-moving",
    };
    struct drive d;

    (void)state;
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
        char path[512];
        double t_s = 0.0;
        snprintf(path, sizeof path, SCENES "%s.yaml", scenes[i]);
        start(&d, path);
        while (t_s < DRIVE_S) {
            t_s = go_on(&d);
            if (d.levels.limited || d.note[0] || d.interference.present || d.tone.kind)
                fail_msg("%s at %.2f s: %.2f m, noise %.1f dB, echo %.1f; %s", scenes[i],
                         t_s, d.levels.range_m, d.levels.noise_db, d.levels.echo_db,
                         d.note);
        }
        assert_true(d.levels.range_m == d.levels.gate_m);
        stop(&d);
    }
}

/* In a scene of launch/scenes with its line of a key in other words. */
static void start_in(struct drive *d, const char *of, const char *text)
{
    char line[512], path[] = "/tmp/anlos-self-test-XXXXXX";
    FILE *from = fopen(of, "r");
    int fd = mkstemp(path);
    FILE *to = fd < 0 ? NULL : fdopen(fd, "w");
    assert_true(from && to);
    while (fgets(line, sizeof line, from))
        if (strncmp(line, text, strcspn(text, ":") + 1))
            fputs(line, to);
    fputs(text, to);
    fclose(from);
    assert_int_equal(fclose(to), 0);
    start(d, path);
    unlink(path);
}

/* The direct sound of the next speaker is there, until a background is subtracted. */
static void behind_the_slot_nothing_is_heard_in_the_first_round(void **state)
{
    struct drive d;

    (void)state;
    start(&d, SCENES "drive-nothing.yaml");
    for (size_t k = 0; k < 2 * d.survey.n_speakers; k++) {
        go_on(&d);
        bool first = k < d.survey.n_speakers;
        if (d.silent || d.heard == first || d.subtracted == first)
            fail_msg("ping %zu: silent %d, heard %d, subtracted %d", k, d.silent, d.heard,
                     d.subtracted);
    }
    stop(&d);
}

static void listen_with(struct drive *d, enum background_mode background,
                        enum compression compression)
{
    struct pipeline_config cfg;
    struct error why = {""};

    frontend_destroy(d->frontend);
    launchfile_pipeline(&cfg, d->launch);
    cfg.frontend.judges_array = true;
    cfg.frontend.hears_walls = compression == COMPRESSION_MATCHED_FILTER;
    cfg.frontend.background = background;
    cfg.frontend.compression = compression;
    if (frontend_create(&d->frontend, &cfg.frontend) ||
        frontend_survey(d->frontend, &d->survey, &why))
        fail_msg("%s", why.text);
}

/* By 0.6 m; it ends at 4 m. */
static void only_with_an_adaptive_background_it_listens_beyond_the_gate(void **state)
{
    static const struct {
        enum background_mode background;
        enum compression compression;
        double far_m;
    } with[] = {{BACKGROUND_ADAPTIVE, COMPRESSION_MATCHED_FILTER, 4.6},
                {BACKGROUND_ADAPTIVE, COMPRESSION_DERAMP, 4.0},
                {BACKGROUND_NONE, COMPRESSION_MATCHED_FILTER, 4.0}};
    struct drive d;

    (void)state;
    for (size_t k = 0; k < sizeof with / sizeof *with; k++) {
        start(&d, SCENES "drive-nothing.yaml");
        listen_with(&d, with[k].background, with[k].compression);
        go_on(&d);
        double far_m = 0.5 * d.survey.sound_speed_m_s * d.until_s;
        if (!(far_m <= with[k].far_m && far_m > with[k].far_m - 0.01))
            fail_msg("%zu: %.3f m", k, far_m);
        stop(&d);
    }
}

/* Beside the direct sound of the next speaker it would be too quiet to do harm, but that
 * is no echo of this one. */
static void a_slam_is_looked_for_before_the_next_emission(void **state)
{
    struct drive d;
    double t_s = 0.0;

    (void)state;
    start_in(&d, SCENES "drive-nothing.yaml",
             "noise: {snr_db: 0, at_m: 4, slams: [{during_s: [1, 1], peak: 0.0013, "
             "decay_s: 0.02}]}\n");
    while (t_s < 1.5) {
        t_s = go_on(&d);
        bool slammed = t_s > 0.98 && t_s < 1.02; /* where it begins, and the next */
        if (d.blanked != slammed)
            fail_msg("%.3f s: blanked %d", t_s, d.blanked);
    }
    stop(&d);
}

/* What the health of the node dsp would say, and a list of each image, to the watchdog
 * of the node can. */
static void tell(const struct drive *d, struct watch *w, int64_t now_ns)
{
    Anlos__Health health = ANLOS__HEALTH__INIT;
    Anlos__Sensing sensing = ANLOS__SENSING__INIT;
    Anlos__Fault all[5], *faults[5];
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    const struct {
        const char *name;
        size_t count;
    } named[] = {{NODE_FAULT_RANGE_REDUCED, d->levels.limited},
                 {NODE_FAULT_MICROPHONES_COVERED, d->faults.covered_microphones},
                 {NODE_FAULT_SPEAKERS_COVERED, d->faults.covered_speakers},
                 {NODE_FAULT_MICROPHONES_MOVED, d->faults.moved_microphones},
                 {NODE_FAULT_SPEAKERS_MOVED, d->faults.moved_speakers}};

    for (size_t i = 0; i < 5; i++) {
        anlos__fault__init(&all[i]);
        all[i].name = (char *)(uintptr_t)named[i].name;
        all[i].count = (uint32_t)named[i].count;
        faults[i] = &all[i];
    }
    sensing.range_m = d->levels.range_m;
    health.node = (char *)(uintptr_t) "dsp";
    health.state = ANLOS__HEALTH__STATE__READY;
    health.sensing = &sensing;
    health.faults = faults;
    health.n_faults = 5;
    list.mirrored = list.in_vehicle_frame = true;
    watch_health(w, &health, now_ns);
    watch_list(w, &list, now_ns, now_ns);
    watch_step(w, now_ns);
}

/* From 3 s to 6 s something is wrong: 2 s later the state is so and has the one bit,
 * until it goes, and 3 s after that the sensor is active again. */
static void check_episode(const char *text, enum can_state state, enum can_fault fault,
                          double most_m)
{
    const struct watch_config cfg = {.fixed = true};
    Anlos__ScanStatus scan = ANLOS__SCAN_STATUS__INIT;
    struct watch w;
    struct drive d;
    double t_s = 0.0;

    start_in(&d, SCENES "drive-person.yaml", text);
    watch_init(&w, &cfg);
    watch_survey(&w, 20.0);
    scan.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    watch_scan(&w, &scan);
    while (t_s < 9.5) {
        t_s = go_on(&d);
        tell(&d, &w, d.world.begin_ns + llround(1e9 * t_s));
        bool well = (t_s > 2.0 && t_s < 2.9) || t_s > 9.0, wrong = t_s > 5.0 && t_s < 6.0;
        if (well && (watch_state(&w) != CAN_ACTIVE || watch_faults(&w) ||
                     !(watch_range_m(&w) >= 4.0)))
            fail_msg("%.2f s: state %d, faults %x, %.1f m", t_s, watch_state(&w),
                     watch_faults(&w), watch_range_m(&w));
        if (wrong && (watch_state(&w) != state || watch_faults(&w) != 1u << fault ||
                      !(watch_range_m(&w) <= most_m)))
            fail_msg("%.2f s: state %d, faults %x, %.1f m", t_s, watch_state(&w),
                     watch_faults(&w), watch_range_m(&w));
    }
    stop(&d);
}

/* Nobody is found from 3 m on: the sensor says that it reaches less than that. */
static void noise_25_db_up_degrades_and_says_how_far_it_reaches(void **state)
{
    (void)state;
    check_episode("noise: {snr_db: 0, at_m: 4, rises: [{during_s: [3, 6], by_db: 25}]}\n",
                  CAN_DEGRADED, CAN_FAULT_RANGE_REDUCED, 3.0);
}

static void a_covered_element_blocks_within_two_seconds(void **state)
{
    (void)state;
    check_episode(
        "faults: {microphones: [{channel: 3, gain_db: -25, during_s: [3, 6]}]}\n",
        CAN_BLOCKED, CAN_FAULT_ELEMENTS_COVERED, 4.0);
    check_episode("faults: {speakers: [{channel: 11, gain_db: -25, during_s: [3, 6]}]}\n",
                  CAN_BLOCKED, CAN_FAULT_ELEMENTS_COVERED, 4.0);
}

/* What a scene's faults are to say, from 5 s on, and nothing else before or after. */
struct knock {
    const char *faults, *says;
    size_t microphones, speakers;
};

/* As the node array does it, by what dsp tells of one element. */
static void correct(struct drive *d, bool speaker, size_t i,
                    const struct displacement_of *is)
{
    Anlos__MovedElement m = ANLOS__MOVED_ELEMENT__INIT;
    struct error why = {""};

    m.speaker = speaker;
    m.element = (uint32_t)i + 1;
    m.x_m = is->by_m[0];
    m.y_m = is->by_m[1];
    m.z_m = is->by_m[2];
    if (places_correct(&d->survey, &d->survey, &m, &why) ||
        frontend_survey(d->frontend, &d->survey, &why))
        fail_msg("%s", why.text);
}

/* Who is placed now; how many were. */
static size_t correct_all(struct drive *d)
{
    size_t n = 0;

    for (size_t e = 0; e < d->survey.n_speakers + d->survey.n_microphones; e++) {
        bool speaker = e < d->survey.n_speakers;
        size_t i = speaker ? e : e - d->survey.n_speakers;
        const struct self_test *t = frontend_self_test(d->frontend, &d->why);
        const struct displacement_of is =
            *(speaker ? self_test_moved_speaker(t, i) : self_test_moved_microphone(t, i));
        if (is.moved && is.placed) {
            correct(d, speaker, i, &is);
            n++;
        }
    }
    return n;
}

/* On a line, the way along it is told with its sign, and the way across without. */
static void a_knocked_element_is_named_within_ten_seconds(void **state)
{
    static const struct knock knocks[] = {
        {"faults: {microphones: [{channel: 6, moved_m: [0.02, 0, 0], "
         "during_s: [5, 20]}]}\n",
         "microphone 7 has moved by 2.0 cm", 1, 0},
        {"faults: {microphones: [{channel: 9, moved_m: [0, 0, 0.02], "
         "during_s: [5, 20]}]}\n",
         "microphone 10 has moved by 2.0 cm", 1, 0},
        {"faults: {speakers: [{channel: 15, moved_m: [-0.02, 0, 0], "
         "during_s: [5, 20]}]}\n",
         "speaker 16 has moved by 2.0 cm", 0, 1},
        {"faults: {microphones: [{channel: 2, moved_m: [0.02, 0, 0], "
         "during_s: [5, 20]}, {channel: 12, moved_m: [-0.01, 0, 0], "
         "during_s: [5, 20]}]}\n",
         "microphone 3 has moved by 2.0 cm", 2, 0},
        {"faults: {microphones: [{channel: 2, gain_db: -60, during_s: [5, 20]}]}\n", NULL,
         0, 0},
        {"faults: {microphones: [{channel: 2, gain_db: -20, during_s: [5, 20]}]}\n", NULL,
         0, 0},
    };

    (void)state;
    for (size_t k = 0; k < sizeof knocks / sizeof *knocks; k++) {
        const struct knock *is = &knocks[k];
        struct drive d;
        bool said = false;
        double t_s = 0.0;
        start_in(&d, SCENES "drive-person.yaml", is->faults);
        while (t_s < KNOCKED_S) {
            t_s = go_on(&d);
            said |= is->says && strstr(d.note, is->says);
            if (t_s < 5.0 &&
                (d.note[0] || d.faults.moved_microphones || d.faults.moved_speakers))
                fail_msg("%s: %.2f s: %s", is->faults, t_s, d.note);
            if (d.faults.moved_microphones > is->microphones ||
                d.faults.moved_speakers > is->speakers)
                fail_msg("%s: %.2f s: %s", is->faults, t_s, d.note);
        }
        if (KNOCKED_S > 15.0 &&
            (d.faults.moved_microphones != is->microphones ||
             d.faults.moved_speakers != is->speakers || said != (is->says != NULL)))
            fail_msg("%s: %zu, %zu moved", is->faults, d.faults.moved_microphones,
                     d.faults.moved_speakers);
        stop(&d);
    }
}

struct corrected {
    const char *scene, *faults;
    bool speaker;
    size_t element;
    double by_m[3];
};

/* Up and down nothing is heard of it, and nothing changes by it: but for that it stands
 * where it does to a millimetre. */
static void a_knocked_element_is_corrected_within_thirty_seconds(void **state)
{
    static const struct corrected cases[] = {
        {"drive-person",
         "faults: {microphones: [{channel: 12, moved_m: [-0.01, 0.005, 0.016], "
         "during_s: [7, 20]}]}\n",
         false,
         12,
         {-0.01, 0.005, 0.016}},
        {"drive-person",
         "faults: {speakers: [{channel: 4, moved_m: [0.01, 0.01, -0.0141], "
         "during_s: [7, 20]}]}\n",
         true,
         4,
         {0.01, 0.01, -0.0141}},
        {"drive-person-moving",
         "faults: {microphones: [{channel: 1, moved_m: [0.02, 0, 0], "
         "during_s: [7, 20]}]}\n",
         false,
         1,
         {0.02, 0, 0}},
        /* Knocked while it was parked. */
        {"drive-person",
         "faults: {microphones: [{channel: 12, moved_m: [-0.01, 0.005, 0.016], "
         "during_s: [0, 20]}]}\n",
         false,
         12,
         {-0.01, 0.005, 0.016}},
        {"drive-person",
         "faults: {speakers: [{channel: 4, moved_m: [0.01, 0.01, -0.0141], "
         "during_s: [0, 20]}]}\n",
         true,
         4,
         {0.01, 0.01, -0.0141}},
    };

    (void)state;
    for (size_t k = 0; k < sizeof cases / sizeof *cases && KNOCKED_S > 15.0; k++) {
        const struct corrected *is = &cases[k];
        char scene[512];
        struct drive d;
        size_t n = 0;
        double t_s = 0.0;
        snprintf(scene, sizeof scene, SCENES "%s.yaml", is->scene);
        start_in(&d, scene, is->faults);
        double was_m[3], now_m[3];
        memcpy(was_m,
               (is->speaker ? d.survey.speakers_m : d.survey.microphones_m)[is->element],
               sizeof was_m);
        while (t_s < KNOCKED_S) {
            t_s = go_on(&d);
            n += correct_all(&d);
        }
        memcpy(now_m,
               (is->speaker ? d.survey.speakers_m : d.survey.microphones_m)[is->element],
               sizeof now_m);
        if (n != 1)
            fail_msg("%s: corrected %zu times", is->faults, n);
        assert_int_equal(d.faults.moved_microphones + d.faults.moved_speakers, 0);
        for (int a = 0; a < 3; a += 2)
            if (fabs(now_m[a] - was_m[a] - is->by_m[a]) > 1e-3)
                fail_msg("%s: %d: %.2f mm", is->faults, a, 1e3 * (now_m[a] - was_m[a]));
        stop(&d);
    }
}

/* From when it sounds until 16 longer slots of ours after, one in 0.2 s.  What it hits
 * has holes then, and no background counts as subtracted, as it does again when it is
 * gone. */
static void another_array_is_taken_out_as_long_as_it_is_heard(void **state)
{
    struct drive d;
    double t_s = 0.0;

    (void)state;
    start_in(&d, SCENES "drive-nothing.yaml",
             "interferers: [{position_m: [4.5, 0, 1.4], turn_deg: 90, start_s: 0.0071, "
             "clock_ppm: 20, slot_samples: 1440, during_s: [1.5, 3]}]\n");
    while (t_s < 7.0) {
        uint64_t hits = d.interference.pings;
        t_s = go_on(&d);
        bool present = d.interference.present, hit = d.interference.pings > hits;
        bool wrong = (t_s < 1.5 || t_s > 6.5) && present;
        wrong |= t_s > 2.5 && t_s < 3.0 && !present;
        wrong |= t_s > 0.5 && d.subtracted == present;
        wrong |= d.silent != (present && hit);
        if (wrong)
            fail_msg("%.2f s: present %d, hit %d, subtracted %d, silent %d", t_s, present,
                     hit, d.subtracted, d.silent);
    }
    stop(&d);
}

/* Of the same design, with slots as long as ours, at one delay for seconds: in the gate.
 */
static void an_array_with_slots_like_ours_is_known_within_four_seconds(void **state)
{
    struct drive d;
    double t_s = 0.0, known_s = 0.0;

    (void)state;
    start_in(&d, SCENES "drive-nothing.yaml",
             "interferers: [{position_m: [4.5, 0, 1.4], turn_deg: 90, start_s: 0.003, "
             "clock_ppm: 20, stagger: no}]\n");
    while (t_s < 7.0) {
        t_s = go_on(&d);
        known_s = known_s > 0.0 || !d.interference.present ? known_s : t_s;
        if (t_s > 4.0 && !d.interference.present)
            fail_msg("%.2f s: not present; since %.2f s", t_s, known_s);
    }
    stop(&d);
}

/* Named within 1.2 s, gone 2 s after; while it is there a background is subtracted as
 * without, but for a round after each change; once it is named no element is taken for
 * silent, though it drowns the direct sound, and a person would be found. */
static void a_comb_of_the_mains_is_named_as_long_as_it_is_heard(void **state)
{
    struct drive d;
    double t_s = 0.0;

    (void)state;
    start_in(&d, SCENES "drive-nothing.yaml",
             "noise: {tones: [{frequency_hz: 50, rms: 0.1, comb: [40, 400], wander: "
             "2e-4, spread_db: 6, during_s: [1.5, 7]}]}\n");
    while (t_s < 10.0) {
        t_s = go_on(&d);
        bool comb = d.tone.kind == TONE_COMB && fabs(d.tone.frequency_hz - 50.0) < 0.05;
        bool wrong = (t_s < 1.5 || t_s > 9.0) && d.tone.kind != TONE_NONE;
        wrong |= t_s > 2.7 && t_s < 7.0 && !comb;
        wrong |= t_s > 3.3 && t_s < 7.0 && !d.subtracted;
        wrong |= t_s > 6.0 && t_s < 7.0 && d.levels.range_m < 3.0;
        bool judged = d.faults.deaf || d.faults.mute;
        wrong |= judged && (t_s < 1.5 || t_s > 2.7);
        if (wrong)
            fail_msg("%.2f s: kind %d, %g Hz, subtracted %d, deaf %zu, mute %zu, %.2f m",
                     t_s, d.tone.kind, d.tone.frequency_hz, d.subtracted, d.faults.deaf,
                     d.faults.mute, d.levels.range_m);
    }
    stop(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(where_nothing_is_wrong_nothing_is_said),
        cmocka_unit_test(behind_the_slot_nothing_is_heard_in_the_first_round),
        cmocka_unit_test(only_with_an_adaptive_background_it_listens_beyond_the_gate),
        cmocka_unit_test(a_slam_is_looked_for_before_the_next_emission),
        cmocka_unit_test(a_comb_of_the_mains_is_named_as_long_as_it_is_heard),
        cmocka_unit_test(another_array_is_taken_out_as_long_as_it_is_heard),
        cmocka_unit_test(an_array_with_slots_like_ours_is_known_within_four_seconds),
        cmocka_unit_test(noise_25_db_up_degrades_and_says_how_far_it_reaches),
        cmocka_unit_test(a_covered_element_blocks_within_two_seconds),
        cmocka_unit_test(a_knocked_element_is_named_within_ten_seconds),
        cmocka_unit_test(a_knocked_element_is_corrected_within_thirty_seconds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
