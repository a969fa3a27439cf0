#include "nodes/rt/arguments.h"

#include <errno.h>
#include <string.h>

/* The value of option `name` at argv[*i], as "--name value" or "--name=value". */
static const char *option_value(const char *name, int argc, char **argv, int *i)
{
    size_t n = strlen(name);

    if (strncmp(argv[*i], name, n))
        return NULL;
    if (argv[*i][n] == '=')
        return argv[*i] + n + 1;
    if (argv[*i][n] || *i + 1 >= argc)
        return NULL;
    return argv[++*i];
}

static int parse_one(struct arguments *a, int argc, char **argv, int *i,
                     struct complaint *why)
{
    const char *arg = argv[*i];
    const char *value;

    if (!strcmp(arg, "--help") || !strcmp(arg, "-h"))
        a->help = true;
    else if (!strcmp(arg, "--realtime"))
        a->realtime = true;
    else if ((value = option_value("--launch", argc, argv, i)))
        a->launch = value;
    else if ((value = option_value("--run-dir", argc, argv, i)))
        a->run_dir = value;
    else if ((value = option_value("--out", argc, argv, i)))
        a->out = value;
    else if ((value = option_value("--log-level", argc, argv, i))) {
        if (log_level_parse(&a->log_level, value))
            return complain(why, -EINVAL,
                            "--log-level: expected debug, info, warning or error, not %s",
                            value);
    } else if (arg[0] != '-' && !a->launch)
        a->launch = arg;
    else
        return complain(why, -EINVAL, "%s: unknown option or missing value; see --help",
                        arg);
    return 0;
}

int arguments_parse(struct arguments *out, int argc, char **argv, struct complaint *why)
{
    *out = (struct arguments){.log_level = LOG_LEVEL_INFO};
    for (int i = 1; i < argc; i++) {
        int err = parse_one(out, argc, argv, &i, why);
        if (err)
            return err;
    }
    if (!out->help && !out->launch)
        return complain(why, -EINVAL, "which launch file? see --help");
    if (out->out && !out->out[0])
        return complain(why, -EINVAL, "--out: expected the name of a folder");
    return 0;
}

const char *arguments_help(void)
{
    return "  --run-dir DIR      where the processes of one system meet; default\n"
           "                     $XDG_RUNTIME_DIR/anlos or /tmp/anlos-UID\n"
           "  --out DIR          the folder of results, instead of report.folder\n"
           "  --realtime         simulated hardware runs at the true pace\n"
           "  --log-level LEVEL  debug, info (default), warning or error\n"
           "  --help             this text\n";
}
