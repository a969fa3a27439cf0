/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/calibrate/calibrate.h"

#include <errno.h>
#include <libgen.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "dsp/error.h"
#include "hal/stage.h"
#include "hal/survey/calibration.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/stop.h"
#include "nodes/rt/uri.h"

/* -- a channel's faults in words --------------------------------------------------------
 */

const char *state_print(unsigned faults, char out[STATE_SIZE])
{
    static const struct {
        unsigned fault;
        const char *name;
    } names[] = {{CALIBRATION_DEAD, "dead"},
                 {CALIBRATION_INVERTED, "inverted"},
                 {CALIBRATION_CLIPPED, "clipped"},
                 {CALIBRATION_NOISY, "noisy"}};
    out[0] = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (faults & names[i].fault)
            text_add(out, STATE_SIZE, ", ", "%s", names[i].name);
    return out[0] ? out : strcpy(out, "good");
}

/* -- the command line, and the file that the subcommands renew --------------------------
 */

#define COMMAND "calibrate"

static const char help[] =
    "anlos calibrate -- measure an array, and write it down for every process\n"
    "\n"
    "usage: anlos calibrate WHAT --array URI --out FILE.yaml [options]\n"
    "\n"
    "Each WHAT renews its part of one calibration file and keeps the rest.  Arrays read\n"
    "the file: `calibrated: FILE` in a rig, or \"sim:...?calibrated=FILE\", "
    "\"wav:...\".\n"
    "\n"
    "what, in the order that suits\n"
    "  sound-speed  from --temperature-c and --humidity; or from a flat reflector at\n"
    "               --range-m, with the direct paths for comparison\n"
    "  time-zero    when the array really emits: direct paths from every speaker to "
    "every\n"
    "               microphone; or one pair's, with --pair and --distance-m\n"
    "  channels     which speakers and microphones are swapped, inverted, dead, "
    "clipped,\n"
    "               noisy\n"
    "  gains        facing a flat target at --range-m, or the survey's wall: the gains "
    "of\n"
    "               all channels\n"
    "  array        where the elements really stand, before a wall or a large flat "
    "board:\n"
    "               from straight paths and the wall's echo, heard from both ends of "
    "the\n"
    "               stage; with --array again for the same array before a wall that is\n"
    "               turned another way, which tells what one wall leaves open\n"
    "  background   records all positions without the object into --folder\n"
    "  show FILE    what the file says; with --array whether it fits\n"
    "\n"
    "  --array URI           sim:SCENE.yaml, wav:FOLDER, or a sound card; measured as it "
    "is,\n"
    "                        without what a calibration file corrects\n"
    "  --out FILE.yaml       the calibration file\n"
    "  --takes N             emissions of each speaker to average; default 4\n"
    "  --position N          stage position to measure at, default 0\n"
    "  --temperature-c T     of the air, -40 to 60\n"
    "  --humidity P          relative, in percent; default 50\n"
    "  --range-m R           the reflector is the plane z = R in the array frame\n"
    "  --fit-speed           time-zero: take the speed of sound from the distances too\n"
    "  --pair S,M            time-zero: only speaker S and microphone M, from 0\n"
    "  --distance-m D        between the two, in place of the survey's\n"
    "  --placed-mm P         array: how well the survey's places were measured; default "
    "10\n"
    "  --folder DIR          background: where the recording goes; made when missing\n"
    "  --stage URI           background, array: what carries it along its positions\n"
    "  --help                this text\n"
    "\n"
    "examples\n"
    "  anlos calibrate sound-speed --array sim:room.yaml --out lab.yaml \\\n"
    "      --temperature-c 21.5 --humidity 45\n"
    "  anlos calibrate time-zero --array sim:room.yaml --out lab.yaml\n"
    "\n"
    "exit codes: 0 measured and good; 1 measured and bad, or failed; 2 bad arguments or\n"
    "files; 130 stopped by Ctrl-C\n";

static const struct usage_option options[] = {
    {"array", USAGE_VALUE('a')},
    {"out", USAGE_TEXT(struct calibrate_options, out)},
    {"stage", USAGE_TEXT(struct calibrate_options, stage)},
    {"folder", USAGE_TEXT(struct calibrate_options, folder)},
    {"takes", USAGE_COUNT(struct calibrate_options, takes, 1, 1000),
     .expected = "a whole number from 1 to 1000"},
    {"position", USAGE_COUNT(struct calibrate_options, position, 0, 1000000),
     .expected = "a whole number from 0 to 1000000"},
    {"temperature-c", USAGE_NUMBER(struct calibrate_options, temperature_c, -40, 60)},
    {"humidity", USAGE_NUMBER(struct calibrate_options, humidity_percent, 0, 100)},
    {"range-m", USAGE_NUMBER(struct calibrate_options, range_m, 0.05, 100)},
    {"distance-m", USAGE_NUMBER(struct calibrate_options, distance_m, 0.001, 100)},
    {"pair", USAGE_VALUE('p')},
    {"placed-mm", USAGE_NUMBER(struct calibrate_options, placed_mm, 0.1, 50)},
    {"fit-speed", USAGE_FLAG(struct calibrate_options, fit_speed)},
    {.name = NULL},
};

static int take_pair(struct calibrate_options *o, const char *text)
{
    double pair[2];
    if (usage_numbers(text, 2, pair) || pair[0] < 0 || pair[1] < 0 ||
        pair[0] != floor(pair[0]) || pair[1] != floor(pair[1]) || pair[0] > 1e6 ||
        pair[1] > 1e6)
        return usage_error(COMMAND,
                           "--pair %s: expected the numbers of a speaker and a "
                           "microphone, from 0, as in 0,3",
                           text);
    o->has_pair = true;
    o->pair[0] = (size_t)pair[0];
    o->pair[1] = (size_t)pair[1];
    return 0;
}

static int take_array(struct calibrate_options *o, const char *text)
{
    if (!o->array)
        o->array = text;
    else if (o->n_also < CALIBRATE_MAX_ARRAYS - 1)
        o->also[o->n_also++] = text;
    else
        return usage_error(COMMAND, "--array %s: at most %d of them", text,
                           CALIBRATE_MAX_ARRAYS);
    return 0;
}

static const char *const words[] = {"time-zero", "channels",   "gains", "sound-speed",
                                    "array",     "background", "show"};

/* What only some of them take. */
static int check(const struct calibrate_options *o)
{
    const struct {
        bool given;
        const char *name, *of[3];
    } rules[] = {
        {o->has_pair, "pair", {"time-zero"}},
        {!isnan(o->distance_m), "distance-m", {"time-zero"}},
        {o->fit_speed, "fit-speed", {"time-zero"}},
        {!isnan(o->range_m), "range-m", {"gains", "sound-speed"}},
        {!isnan(o->temperature_c), "temperature-c", {"sound-speed", "background"}},
        {!isnan(o->humidity_percent), "humidity", {"sound-speed", "background"}},
        {o->folder, "folder", {"background"}},
        {o->stage, "stage", {"background", "array"}},
        {!isnan(o->placed_mm), "placed-mm", {"array"}},
    };
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++) {
        bool fits = !rules[i].given;
        for (size_t k = 0; k < 3 && rules[i].of[k]; k++)
            fits |= !strcmp(rules[i].of[k], o->what);
        if (!fits)
            return usage_error(COMMAND, "--%s is not for %s", rules[i].name, o->what);
    }
    if (!o->out || !o->out[0])
        return strcmp(o->what, "show")
                   ? usage_error(COMMAND, "--out FILE.yaml is missing")
                   : usage_error(COMMAND, "show: which file? show FILE.yaml");
    if (o->n_also && strcmp(o->what, "array") != 0)
        return usage_error(COMMAND, "--array %s: %s takes one array", o->also[0],
                           o->what);
    if (!o->array && strcmp(o->what, "show") != 0)
        return usage_error(COMMAND, "--array URI is missing");
    return 0;
}

static int take_word(struct calibrate_options *o, const char *word)
{
    if (o->what && !strcmp(o->what, "show") && !o->out) {
        o->out = word;
        return 0;
    }
    if (o->what)
        return usage_error(COMMAND, "%s: unexpected argument", word);
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (!strcmp(words[i], word))
            o->what = words[i];
    if (!o->what)
        return usage_error(COMMAND,
                           "%s: expected time-zero, channels, gains, sound-speed, "
                           "array, background or show",
                           word);
    return 0;
}

/* true: run it.  false: *exit_code says how it ended (help, or an error was printed). */
static bool calibrate_options_parse(struct calibrate_options *o, int argc, char **argv,
                                    int *exit_code)
{
    struct usage usage = {
        .command = COMMAND, .help = help, .options = options, .into = o, .words = true};
    int code = 0;
    *o = (struct calibrate_options){.takes = 4,
                                    .placed_mm = NAN,
                                    .distance_m = NAN,
                                    .range_m = NAN,
                                    .temperature_c = NAN,
                                    .humidity_percent = NAN};
    *exit_code = 0;
    while (!*exit_code && (code = usage_next(&usage, argc, argv)) > 0)
        *exit_code = code == 1     ? take_word(o, optarg)
                     : code == 'a' ? take_array(o, optarg)
                                   : take_pair(o, optarg);
    if (code < 0) {
        *exit_code = ~code;
        return false;
    }
    if (!*exit_code && !o->what)
        *exit_code = usage_error(COMMAND, "what? time-zero, channels, gains, "
                                          "sound-speed, array, background or show");
    if (!*exit_code)
        *exit_code = check(o);
    return !*exit_code;
}

static int read_file(struct session *s)
{
    const char *path = s->options->out;
    if (access(path, F_OK) < 0 && errno == ENOENT)
        return 0;
    int err = calibration_load(&s->calibration, path, &s->why);
    s->existed = !err;
    return err;
}

/* An empty "calibrated=" keeps what the array's own configuration may name out of it:
 * what is measured is the array as it is, and that file may be the one to be made. */
int session_open_array(struct session *s, const char *uri, struct array **out)
{
    char *bare = uri_set_option(uri, "calibrated", "");
    /* A card records the room anew; what is played from files has to stay. */
    if (bare && uri_has_scheme(bare, "alsa")) {
        char *live = uri_set_option(bare, "background", "");
        free(bare);
        bare = live;
    }
    *out = NULL;
    if (!bare)
        return error_say(&s->why, -ENOMEM, "out of memory");
    struct error why = {""};
    int err = array_open(out, bare, clock_system(), &why);
    size_t n = strlen(bare);
    if (err) /* what was put in is nobody's concern */
        error_say(&s->why, err, "%s%s", strncmp(why.text, bare, n) ? "" : uri,
                  strncmp(why.text, bare, n) ? why.text : why.text + n);
    free(bare);
    return err;
}

static int match(struct session *s)
{
    if (s->existed)
        return calibration_fits(s->calibration, s->survey, s->options->out, &s->why);
    if (calibration_create(&s->calibration, s->survey->n_speakers,
                           s->survey->n_microphones) < 0)
        return error_say(&s->why, -ENOMEM, "out of memory");
    return 0;
}

static int place(struct session *s)
{
    const struct calibration *c = s->calibration;
    if (survey_copy(&s->placed, s->survey) < 0)
        return error_say(&s->why, -ENOMEM, "out of memory");
    return s->existed && c->places_m
               ? calibration_apply(c, &s->placed, s->options->out, &s->why)
               : 0;
}

/* Before minutes of measuring. */
static int check_folder(struct session *s)
{
    char *copy = strdup(s->options->out);
    int err = !copy ? -ENOMEM : access(dirname(copy), W_OK | X_OK) ? -errno : 0;

    free(copy);
    return err ? error_say(&s->why, err, "%s cannot be written: %s", s->options->out,
                           strerror(-err))
               : 0;
}

/* Reads the file, if it is there, and opens the array as it is, without what a file would
 * correct.  0, -EINVAL (wrong file, made for another array), other negative errno. */
static int session_open(struct session *s, const struct calibrate_options *o)
{
    *s = (struct session){.options = o};
    int err = read_file(s);
    if (!err && strcmp(o->what, "show") != 0)
        err = check_folder(s);
    if (err || !o->array)
        return err;
    err = session_open_array(s, o->array, &s->array);
    if (err)
        return err;
    s->survey = array_survey(s->array);
    err = match(s);
    return err ? err : place(s);
}

int session_save(struct session *s)
{
    struct calibration *c = s->calibration;
    time_t now = (time_t)(clock_now_ns(clock_system()) / 1000000000);
    struct tm utc;
    gmtime_r(&now, &utc);
    strftime(c->made, sizeof c->made, "%Y-%m-%dT%H:%M:%SZ", &utc);
    calibration_name(c, s->survey, s->options->array);
    /* Nothing is written that no array would take. */
    struct survey set;
    if (survey_copy(&set, s->survey) < 0)
        return error_say(&s->why, -ENOMEM, "out of memory");
    int err = calibration_apply(c, &set, s->options->out, &s->why);
    survey_clear(&set);
    return err ? err : calibration_save(c, s->options->out, &s->why);
}

static void session_close(struct session *s)
{
    array_close(s->array);
    survey_clear(&s->placed);
    calibration_destroy(s->calibration);
}

double session_round(double x)
{
    return round(1e3 * x) / 1e3;
}

double session_speed_m_s(const struct session *s)
{
    double known = s->calibration->sound_speed_m_s;
    return isnan(known) ? s->survey->sound_speed_m_s : known;
}

int session_check(struct session *s)
{
    if (s->survey->pings_m)
        return error_say(&s->why, -EINVAL,
                         "%s: its pings have places of their own; expected an array of "
                         "speakers and microphones",
                         s->options->array);
    if (s->options->position >= s->survey->n_positions)
        return error_say(&s->why, -EINVAL, "--position %zu: there are 0 to %zu",
                         s->options->position, s->survey->n_positions - 1);
    return 0;
}

void session_print_retaken(size_t pings)
{
    if (pings)
        printf("  retaken       %zu pings that came invalid\n", pings);
}

/* -- the stage --------------------------------------------------------------------------
 */

#define LOOK_NS 10000000 /* between looks at a stage that moves */

struct carrier {
    struct stage *stage;
    const struct survey *survey;
};

int carrier_open(struct carrier **out, const char *uri, const struct survey *survey,
                 struct error *why)
{
    struct carrier *c = calloc(1, sizeof *c);
    if (!c)
        return error_say(why, -ENOMEM, "out of memory");
    c->survey = survey;
    int err = stage_open(&c->stage, uri, clock_system(), why);
    if (err)
        free(c);
    else
        *out = c;
    return err;
}

static int wait_until_it_stands(struct carrier *c, struct error *why)
{
    const struct clock_source *clock = clock_system();
    struct stage_status status;
    for (;;) {
        if (interrupt_requested()) {
            stage_stop(c->stage);
            return error_say(why, -EINTR, "interrupted");
        }
        stage_status(c->stage, &status);
        if (status.motion == STAGE_FAULT)
            return error_say(why, -EIO, "the stage has a fault: %s", status.text);
        if (status.motion == STAGE_IDLE)
            return 0;
        clock->sleep_until_ns(clock->state, clock_now_ns(clock) + LOOK_NS);
    }
}

int carrier_move(struct carrier *c, size_t position, struct error *why)
{
    double target_m = c->survey->stage_positions_m[position];
    int err = stage_move(c->stage, target_m);
    if (err)
        return error_say(why, err, "the stage does not go to %g m: %s", target_m,
                         strerror(-err));
    return wait_until_it_stands(c, why);
}

void carrier_close(struct carrier *c)
{
    if (!c)
        return;
    stage_close(c->stage);
    free(c);
}

/* -- the subcommand show, and the command -----------------------------------------------
 */

static void print_value(const char *name, double x, const char *unit, const char *how)
{
    if (isnan(x))
        printf("  %-14s not measured: anlos calibrate %s\n", name, how);
    else
        printf("  %-14s %.3f %s\n", name, x, unit);
}

static void print_channels(const char *kind, const struct calibration *c,
                           const struct calibration_channel *channels, size_t n)
{
    char state[STATE_SIZE];
    for (size_t i = 0; i < n; i++) {
        printf("  %-10s %3zu", kind, i);
        if (c->has_gains)
            printf("  %+6.2f dB", channels[i].gain_db);
        if (c->has_channels)
            printf("  %s", state_print(channels[i].faults, state));
        printf("\n");
    }
}

static void print(const struct calibration *c, const char *path)
{
    printf("%s\n  %-14s %s\n  %-14s %s\n", path, "array", c->array, "made", c->made);
    printf("  %-14s %zu speakers, %zu microphones, %g Hz, geometry %s\n", "for",
           c->n_speakers, c->n_microphones, c->sample_rate_hz, c->geometry);
    print_value("latency", c->latency_samples, "samples", "time-zero");
    print_value("sound speed", c->sound_speed_m_s, "m/s", "sound-speed");
    if (!isnan(c->temperature_c))
        printf("  %-14s %.2f C, %.0f %% humidity\n", "air", c->temperature_c,
               c->humidity_percent);
    if (c->places_m)
        printf("  %-14s found, to %.2f mm each axis\n", "places",
               c->places_sigma_m * 1e3);
    else
        printf("  %-14s those of the survey: anlos calibrate array\n", "places");
    if (c->background)
        printf("  %-14s %s\n", "background", c->background);
    else
        printf("  %-14s not recorded: anlos calibrate background\n", "background");
    if (!c->has_channels)
        printf("  %-14s not measured: anlos calibrate channels\n", "channels");
    if (!c->has_gains)
        printf("  %-14s not measured: anlos calibrate gains\n", "gains");
    if (!c->has_channels && !c->has_gains)
        return;
    print_channels("speaker", c, c->speakers, c->n_speakers);
    print_channels("microphone", c, c->microphones, c->n_microphones);
}

static int calibrate_show(struct session *s, bool *good)
{
    if (!s->existed)
        return error_say(&s->why, -EINVAL, "%s: no such file", s->options->out);
    print(s->calibration, s->options->out);
    if (s->array)
        printf("good: it fits %s\n", s->options->array);
    *good = true;
    return 0;
}

static const struct subcommand {
    const char *name;
    int (*run)(struct session *s, bool *good);
} subcommands[] = {
    {"time-zero", calibrate_time_zero}, {"channels", calibrate_channels},
    {"gains", calibrate_gains},         {"sound-speed", calibrate_sound_speed},
    {"array", calibrate_array},         {"background", calibrate_background},
    {"show", calibrate_show},
};

static const struct subcommand *find(const char *name)
{
    size_t i = 0;
    while (strcmp(subcommands[i].name, name) != 0)
        i++;
    return &subcommands[i];
}

/* Before anything was measured, errors are of what was asked for. */
static int exit_code_of(int err, bool opened)
{
    if (err == -EINTR)
        return EXIT_INTERRUPTED;
    if (err == -ENOMEM)
        return EXIT_FAILED;
    return !opened || err == -EINVAL ? EXIT_BAD_INPUT : EXIT_FAILED;
}

/* What befell the device: a clock that is not shared, sound that was lost. */
static void show_notices(struct array *array)
{
    struct error notice;

    while (array && array_notice(array, &notice))
        fprintf(stderr, "anlos calibrate: %s\n", notice.text);
}

int command_calibrate(int argc, char **argv)
{
    struct calibrate_options o;
    struct session s;
    bool good = false, opened;
    int exit_code;
    if (!calibrate_options_parse(&o, argc, argv, &exit_code))
        return exit_code;
    interrupt_catch();
    const struct subcommand *c = find(o.what);
    int err = session_open(&s, &o);
    opened = !err;
    if (!err)
        err = c->run(&s, &good);
    show_notices(s.array);
    if (err)
        fprintf(stderr, "anlos calibrate: %s\n", s.why.text);
    session_close(&s);
    if (err)
        return exit_code_of(err, opened);
    return good ? EXIT_WORKED : EXIT_FAILED;
}
