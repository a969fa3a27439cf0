/* SPDX-License-Identifier: MIT */
/* nodes/anlos/keys.c -- `anlos keys`: with which the hosts of a system know each other.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "msgs/keys.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"

static const char help[] =
    "anlos keys -- make and show the keys with which hosts know each other\n"
    "\n"
    "usage: anlos keys new [--host HOST] [--out DIR]\n"
    "       anlos keys show [--out DIR]\n"
    "\n"
    "  new             makes this host's secret key, DIR/secret.key, which only you can\n"
    "                  read and which stays here, and prints the public line of it\n"
    "  show            prints that line again, and which hosts are permitted\n"
    "\n"
    "  --host HOST     its name in the launch file, default the name of this machine\n"
    "  --out DIR       folder of the keys, default $XDG_CONFIG_HOME/anlos/keys, else\n"
    "                  ~/.config/anlos/keys; as keys: of the host in the launch file\n"
    "  --help          this text\n"
    "\n"
    "What goes from host to host is encrypted, and only between hosts that have each\n"
    "other's line in the file DIR/peers.  That file may be the same on all: print a "
    "line\n"
    "on each, and put all of them there.  A line that is removed or changed counts "
    "within\n"
    "two seconds: what it let in is disconnected.  For a new key remove secret.key, "
    "make\n"
    "one, and change the line everywhere.\n"
    "\n"
    "examples\n"
    "  anlos keys new --host vehicle\n"
    "  anlos keys show | ssh computer 'cat >> .config/anlos/keys/peers'\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments, a secret that others can read, or\n"
    "nothing there\n";

static const struct usage_option options[] = {
    {"host", USAGE_VALUE('n')},
    {"out", USAGE_VALUE('o')},
    {.name = NULL},
};

static int fail(int err, const struct error *why)
{
    fprintf(stderr, "anlos keys: %s\n", why->text);
    return err == -EINVAL || err == -EACCES || err == -ENOENT || err == -EEXIST
               ? EXIT_BAD_INPUT
               : EXIT_FAILED;
}

/* The line alone is on standard output, to be sent on as it is. */
static int make(const char *folder, const char *host)
{
    struct error why = {""};
    char public[KEYS_TEXT_SIZE], here[HOST_NAME_MAX + 1] = "";

    if (!host && gethostname(here, sizeof here - 1))
        return usage_error("keys", "which host is this? --host HOST");
    int err = keys_create(folder, host ? host : here, public, &why);
    if (err)
        return fail(err, &why);
    printf("%s %s\n", host ? host : here, public);
    fprintf(stderr,
            "made %s/secret.key; the line above belongs into the file peers of the other "
            "hosts,\nand theirs into %s/peers\n",
            folder, folder);
    return usage_flush("keys");
}

static int show(const char *folder)
{
    struct error why = {""};
    struct keys keys;
    int err = keys_read(&keys, folder, &why);

    keys_forget(&keys);
    if (err)
        return fail(err, &why);
    printf("%s %s\n", keys.host, keys.public);
    fprintf(stderr, "%s/peers permits %zu key%s%s\n", folder, keys.peers.n,
            keys.peers.n == 1 ? "" : "s", keys.peers.n ? ":" : "");
    for (size_t i = 0; i < keys.peers.n; i++)
        fprintf(stderr, "  %s%s\n", keys.peers.list[i].host,
                strcmp(keys.peers.list[i].key, keys.public) ? "" : ", this host");
    return usage_flush("keys");
}

int command_keys(int argc, char **argv)
{
    struct usage u = {.command = "keys", .help = help, .options = options};
    const char *folder = NULL, *host = NULL;
    char usual[HOSTS_KEYS_SIZE];
    int code;

    while ((code = usage_next(&u, argc, argv)) > 0)
        *(code == 'n' ? &host : &folder) = optarg;
    if (code < 0)
        return ~code;
    const char *verb = optind < argc ? argv[optind] : "";
    bool makes = !strcmp(verb, "new");
    if (argc - optind != 1 || (!makes && strcmp(verb, "show") != 0))
        return usage_error("keys", "%s%sexpected new or show", verb, *verb ? ": " : "");
    if (!makes && host)
        return usage_error("keys", "--host: is for new");
    if (!folder && keys_default_folder(usual))
        return usage_error("keys",
                           "neither HOME nor XDG_CONFIG_HOME says where they are: "
                           "--out DIR");
    folder = folder ? folder : usual;
    return makes ? make(folder, host) : show(folder);
}
