#include "nodes/anlos/calibrate/calibrate.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

static const struct subcommand {
    const char *name;
    int (*run)(struct session *s, bool *good);
} subcommands[] = {
    {"time-zero", calibrate_time_zero},   {"channels", calibrate_channels},
    {"gains", calibrate_gains},           {"sound-speed", calibrate_sound_speed},
    {"background", calibrate_background}, {"show", calibrate_show},
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
