/* SPDX-License-Identifier: MIT */
#include "nodes/rt/arguments.h"

#include <errno.h>
#include <string.h>

/* The value of option `name` at argv[*i], as "--name value" or "--name=value".  What
 * looks like the next option is none. */
static const char *option_value(const char *name, int argc, char **argv, int *i)
{
    size_t n = strlen(name);

    if (strncmp(argv[*i], name, n))
        return NULL;
    if (argv[*i][n] == '=')
        return argv[*i] + n + 1;
    if (argv[*i][n] || *i + 1 >= argc || !strncmp(argv[*i + 1], "--", 2))
        return NULL;
    return argv[++*i];
}

static int error_say_of(const struct arguments *a, const char *arg, struct error *why)
{
    static const char *const with_value[] = {
        "--launch", "--run-dir", "--out",  "--record",    "--snapshot",
        "--bag",    "--rate",    "--host", "--log-level", "--log-format"};
    static const char *const bare[] = {"--realtime", "--no-supervision", "--replay",
                                       "--version", "--help"};
    size_t n = strcspn(arg, "=");
    struct nearest near = nearest_begin(arg, n, 2);

    if (arg[0] != '-')
        return error_say(why, -EINVAL,
                         "%s: unexpected, %s is the launch file; see --help", arg,
                         a->launch);
    for (size_t i = 0; i < sizeof with_value / sizeof *with_value; i++) {
        if (!strcmp(arg, with_value[i]))
            return error_say(why, -EINVAL, "%s: its value is missing; see --help", arg);
        nearest_try(&near, with_value[i]);
    }
    for (size_t i = 0; i < sizeof bare / sizeof *bare; i++) {
        if (strlen(bare[i]) == n && !strncmp(arg, bare[i], n))
            return error_say(why, -EINVAL, "%s: takes no value; see --help", bare[i]);
        nearest_try(&near, bare[i]);
    }
    return error_say(why, -EINVAL, "%.*s: no such option%s%s%s; see --help", (int)n, arg,
                     near.best ? "; did you mean " : "", near.best ? near.best : "",
                     near.best ? "?" : "");
}

static const char *level_name(size_t i)
{
    return log_level_name((enum log_level)i);
}

static const char *format_name(size_t i)
{
    return log_format_name((enum log_format)i);
}

static int wrong_choice(const char *option, choice_names *names, const char *value,
                        struct error *why)
{
    char list[128];

    choice_list(names, list, sizeof list);
    return error_say(why, -EINVAL, "%s: expected %s, not %s", option, list, value);
}

/* --help=OPTION */
static int ask_for_values(struct arguments *a, const char *option, struct error *why)
{
    a->help = true;
    a->values = !strcmp(option, "log-level")    ? level_name
                : !strcmp(option, "log-format") ? format_name
                                                : NULL;
    return a->values ? 0
                     : error_say(why, -EINVAL, "--help=%s: --%s has no list of values",
                                 option, option);
}

static int parse_one(struct arguments *a, int argc, char **argv, int *i,
                     struct error *why)
{
    const char *arg = argv[*i];
    const char *value;

    if (!strcmp(arg, "--help") || !strcmp(arg, "-h"))
        a->help = true;
    else if (!strncmp(arg, "--help=", 7))
        return ask_for_values(a, arg + 7, why);
    else if (!strcmp(arg, "--version"))
        a->version = true;
    else if (!strcmp(arg, "--realtime"))
        a->realtime = true;
    else if (!strcmp(arg, "--no-supervision"))
        a->unsupervised = true;
    else if (!strcmp(arg, "--replay"))
        a->replay = true;
    else if ((value = option_value("--launch", argc, argv, i)))
        a->launch = value;
    else if ((value = option_value("--run-dir", argc, argv, i)))
        a->run_dir = value;
    else if ((value = option_value("--out", argc, argv, i)))
        a->out = value;
    else if ((value = option_value("--record", argc, argv, i)))
        a->record = value;
    else if ((value = option_value("--snapshot", argc, argv, i)))
        a->snapshot = value;
    else if ((value = option_value("--bag", argc, argv, i)))
        a->bag = value;
    else if ((value = option_value("--rate", argc, argv, i)))
        a->rate = value;
    else if ((value = option_value("--host", argc, argv, i)))
        a->host = value;
    else if ((value = option_value("--log-level", argc, argv, i))) {
        if (log_level_parse(&a->log_level, value))
            return wrong_choice("--log-level", level_name, value, why);
    } else if ((value = option_value("--log-format", argc, argv, i))) {
        if (log_format_parse(&a->log_format, value))
            return wrong_choice("--log-format", format_name, value, why);
    } else if (arg[0] != '-' && !a->launch)
        a->launch = arg;
    else
        return error_say_of(a, arg, why);
    return 0;
}

int arguments_parse(struct arguments *out, int argc, char **argv, struct error *why)
{
    *out = (struct arguments){.log_level = LOG_LEVEL_INFO};
    for (int i = 1; i < argc; i++) {
        int err = parse_one(out, argc, argv, &i, why);
        if (err)
            return err;
    }
    if (!out->help && !out->version && !out->launch)
        return error_say(why, -EINVAL, "which launch file? see --help");
    if (out->out && !out->out[0])
        return error_say(why, -EINVAL, "--out: expected the name of a folder");
    if (out->record && !out->record[0])
        return error_say(why, -EINVAL, "--record: expected the name of a bag");
    if (out->snapshot && !out->snapshot[0])
        return error_say(why, -EINVAL, "--snapshot: expected the name of a folder");
    return 0;
}

const char *arguments_help(void)
{
    return "  --run-dir DIR      where the processes of one system meet; default\n"
           "                     $XDG_RUNTIME_DIR/anlos or /tmp/anlos-UID\n"
           "  --out DIR          the folder of results, instead of report.folder\n"
           "  --record BAG       records every topic into it, instead of record.path\n"
           "  --snapshot DIR     keeps the last 30 s in memory, and saves them there as "
           "a\n"
           "                     bag when 'anlos bag save', the page or a new fault "
           "asks\n"
           "                     for it; record.snapshot has the numbers\n"
           "  --host NAME        which one of the launch file's hosts this machine is\n"
           "  --bag FILE         what the node play plays, instead of play.bag\n"
           "  --rate R           of its pace, or max: as fast as it is used\n"
           "  --realtime         simulated hardware runs at the true pace\n"
           "  --no-supervision   nodes that hang are left alone\n"
           "  --replay           hears what 'anlos bag play' plays, and nothing live; so "
           "it\n"
           "                     is with the node play in the launch file\n"
           "  --log-level LEVEL  debug, info (default), warning or error\n"
           "  --log-format FORM  of lines on stderr: text (default) or json\n"
           "  --version          which version this is\n"
           "  --help             this text\n";
}
