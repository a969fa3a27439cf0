/* nodes/anlos/node/node.c -- `anlos node`: who runs, and how. */
#include "nodes/anlos/node/node.h"

#include <errno.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/rundir.h"

static const char help[] =
    "anlos node -- look at the processes of a running system\n"
    "\n"
    "usage: anlos node list [--json] [--run-dir DIR]\n"
    "       anlos node info NODE [--json] [--run-dir DIR]\n"
    "\n"
    "  list            every node: whether its process is alive, its state, process "
    "number,\n"
    "                  time since its start, share of a core, memory, what it says.  A "
    "process\n"
    "                  is alive; silent (it lives, but nothing was heard of it for "
    "seconds);\n"
    "                  elsewhere (on another machine of the system); ended; died (killed "
    "or\n"
    "                  crashed, its sockets are left); or never (no trace in this "
    "folder)\n"
    "  info            one node: each topic with rate against the expected one, bytes a\n"
    "                  second, age of the sound in it (median/p99), queue, messages that "
    "got\n"
    "                  lost before it (gaps) and in its queue (dropped); what its "
    "device\n"
    "                  counts; its endpoints\n"
    "\n"
    "  --json          as JSON\n"
    "  --run-dir DIR   where the system's sockets are, default $XDG_RUNTIME_DIR/anlos, "
    "else\n"
    "                  /tmp/anlos-UID\n"
    "  --help          this text\n"
    "\n"
    "Listens for up to 4 seconds: each node says once a second how it is.  Writes no\n"
    "files.\n"
    "\n"
    "examples\n"
    "  anlos node list\n"
    "  anlos node info recon --json | jq '.topics[] | select(.dropped > 0)'\n"
    "\n"
    "exit codes: 0 done; 1 nothing is running, the node is not alive, or failed; 2 bad\n"
    "arguments; 130 stopped by Ctrl-C\n";

static const struct option options[] = {
    {"json", no_argument, NULL, 'j'},
    {"run-dir", required_argument, NULL, 'r'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static int print_json(const struct census *c, const struct census_node *one)
{
    json_t *o = one ? node_json(one, true) : json_array();

    for (size_t i = 0; !one && i < c->n; i++)
        json_array_append_new(o, node_json(&c->nodes[i], false));
    int failed = !o || json_dumpf(o, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(6));
    putchar('\n');
    json_decref(o);
    return failed;
}

static int print(const struct census *c, const struct census_node *one,
                 const char *run_dir, bool json)
{
    int failed = json && print_json(c, one);

    if (!json && one)
        node_info_print(one, run_dir, stdout);
    else if (!json)
        node_list_print(c, stdout);
    int unwritten = usage_flush("node");
    if (failed || unwritten)
        return unwritten ? unwritten : EXIT_FAILED;
    if (one ? one->life >= CENSUS_ALIVE : census_count_alive(c) > 0)
        return EXIT_WORKED;
    if (one)
        fprintf(stderr, "anlos node: %s does not run in %s\n", one->name, run_dir);
    else
        fprintf(
            stderr,
            "anlos node: nothing is running in %s; start it with 'anlos launch FILE', "
            "or name its folder with --run-dir\n",
            run_dir);
    return EXIT_FAILED;
}

static bool is_node(const char *name)
{
    const char *const *n = topics_nodes();

    while (*n && strcmp(*n, name))
        n++;
    return *n;
}

static int run(const char *node, const char *asked_dir, bool json)
{
    char run_dir[RUNDIR_SIZE];
    struct complaint why = {""};
    struct census *c = NULL;
    struct census_config cfg = {
        .run_dir = run_dir, .node = node, .rates = true, .stop = interrupt_requested};

    if (rundir_name(run_dir, asked_dir, &why) || rundir_check(run_dir, &why)) {
        fprintf(stderr, "anlos node: %s\n", why.text);
        return EXIT_BAD_INPUT;
    }
    interrupt_catch();
    int err = census_take(&c, &cfg, &why);
    if (err == -EINTR)
        return EXIT_INTERRUPTED;
    if (err) {
        fprintf(stderr, "anlos node: %s\n", why.text);
        return EXIT_FAILED;
    }
    int code = print(c, node ? census_find(c, node) : NULL, run_dir, json);
    census_free(c);
    return code;
}

int command_node(int argc, char **argv)
{
    const char *run_dir = NULL;
    bool json = false;
    int code;

    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
        switch (code) {
        case 'h':
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
        case 'j':
            json = true;
            break;
        case 'r':
            run_dir = optarg;
            break;
        default:
            return usage_option_error("node", code, argv, options);
        }
    }
    const char *verb = optind < argc ? argv[optind] : "";
    int n_names = argc - optind - 1;
    if (!strcmp(verb, "list") && n_names == 0)
        return run(NULL, run_dir, json);
    if (strcmp(verb, "info"))
        return usage_error("node", "%s%sexpected list or info NODE", verb,
                           *verb ? ": " : "");
    if (n_names != 1)
        return usage_error("node", "info: expected one node");
    const char *near = usage_nearest(argv[optind + 1], topics_nodes());
    if (!is_node(argv[optind + 1]) && near)
        return usage_error("node", "%s: no such node; did you mean %s?", argv[optind + 1],
                           near);
    if (!is_node(argv[optind + 1]))
        return usage_error("node", "%s: no such node; 'anlos node list' has their names",
                           argv[optind + 1]);
    return run(argv[optind + 1], run_dir, json);
}
