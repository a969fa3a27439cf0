/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/check.c -- `anlos bag check` and `anlos bag recover`: what is wrong in
 * a bag, and what of it is whole. */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "msgs/bag/check.h"
#include "msgs/bag/recover.h"
#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/stop.h"

static const char check_help[] =
    "anlos bag check -- is a bag what it says it is?\n"
    "\n"
    "usage: anlos bag check FILE...\n"
    "\n"
    "Reads all of each file: every checksum, every record, the indexes and statistics\n"
    "against what is really there.  Prints a line for each fault: file, byte, what is\n"
    "wrong.\n"
    "\n"
    "  --help          this text\n"
    "\n"
    "exit codes: 0 no fault; 1 faults were found; 2 bad arguments, or no bag; 130 "
    "stopped\n"
    "by Ctrl-C\n";

static const struct usage_option check_options[] = {
    {.name = NULL},
};

static void print_fault(void *context, uint64_t offset, const char *what)
{
    printf("%s: byte %" PRIu64 ": %s\n", (const char *)context, offset, what);
}

static int check_file(char *path)
{
    const struct bag_check_watch watch = {
        .fault = print_fault, .stop = interrupt_requested, .context = path};
    struct error why = {""};
    uint64_t n_faults;
    int err = bag_check(&n_faults, path, &watch, &why);

    if (err)
        return verb_end("check", err, &why);
    if (n_faults)
        printf("%s: %" PRIu64 " fault%s\n", path, n_faults, n_faults == 1 ? "" : "s");
    else
        printf("%s: no fault\n", path);
    return n_faults ? EXIT_FAILED : EXIT_WORKED;
}

int bag_check_command(int argc, char **argv)
{
    struct usage usage = {
        .command = "bag check", .help = check_help, .options = check_options};
    int code = usage_next(&usage, argc, argv), worst = EXIT_WORKED;

    if (code)
        return ~code;
    if (optind == argc)
        return usage_error("bag check", "FILE is missing");
    interrupt_catch();
    for (; optind < argc && worst != EXIT_INTERRUPTED; optind++) {
        code = check_file(argv[optind]);
        worst = code > worst ? code : worst;
    }
    if (optind < argc)
        fprintf(stderr, "anlos bag check: not checked: %s%s\n", argv[optind],
                optind + 1 < argc ? " and what follows" : "");
    code = usage_flush("bag check");
    return code ? code : worst;
}

static const char recover_help[] =
    "anlos bag recover -- save what is whole in a bag that was cut or damaged\n"
    "\n"
    "usage: anlos bag recover FILE -o OUT\n"
    "\n"
    "Writes every whole message, attachment and metadata before and after each damage "
    "into\n"
    "a new bag, and says which bytes were lost.  FILE stays as it is.\n"
    "\n"
    "  -o, --out OUT   the new bag; must not be there\n"
    "  --help          this text\n"
    "\n"
    "exit codes: 0 nothing was lost; 1 something was, or failed; 2 bad arguments or "
    "files,\n"
    "or nothing in FILE is whole; 130 stopped by Ctrl-C (no OUT after either)\n";

static const struct usage_option recover_options[] = {
    {"out", USAGE_VALUE('o'), .letter = 'o'},
    {.name = NULL},
};

static void print_damage(void *context, uint64_t begin, uint64_t end, const char *what)
{
    printf("%s: bytes %" PRIu64 " to %" PRIu64 ": %s\n", (const char *)context, begin,
           end, what);
}

static void print_result(const struct bag_recovery *r, const char *from, const char *to)
{
    printf("%s: %" PRIu64 " messages, %" PRIu64 " attachments, %" PRIu64 " metadata\n",
           to, r->n_messages, r->n_attachments, r->n_metadata);
    if (!bag_recovery_is_loss(r)) {
        printf("%s: nothing was lost\n", from);
        return;
    }
    if (r->n_damages)
        printf("%s: %" PRIu64 " damaged place%s, %" PRIu64 " bytes\n", from, r->n_damages,
               r->n_damages == 1 ? "" : "s", r->lost_bytes);
    if (!r->ended)
        printf("%s: its end is missing, as after a crash of what wrote it: what had not "
               "come to the disk is lost\n",
               from);
    uint64_t known = bag_recovery_known(r);
    const char *least = r->expected_messages ? "" : "at least ";
    if (known > r->n_messages)
        printf("%s: %s%" PRIu64 " of %s%" PRIu64 " messages were lost\n", from, least,
               known - r->n_messages, least, known);
    if (!r->expected_messages)
        printf("%s: how many messages it had is not known: its statistics are gone\n",
               from);
    if (r->n_unchecked)
        printf("%s: %" PRIu64 " of the messages saved have no valid checksum\n", from,
               r->n_unchecked);
    if (r->n_nameless)
        printf("%s: %" PRIu64 " messages were left out: the definition of their channel "
               "is lost\n",
               from, r->n_nameless);
    if (r->n_misplaced)
        printf("%s: %" PRIu64
               " records in chunks were left out: they are of no kind that "
               "belongs there\n",
               from, r->n_misplaced);
    if (r->n_redefined)
        printf("%s: an id stands for different channels or schemas, %" PRIu64 " times: "
               "each is kept under an id of its own, and a message counts as of what "
               "stands before it last\n",
               from, r->n_redefined);
}

static int recover(char *from, const char *to)
{
    const struct bag_recover_watch watch = {
        .damaged = print_damage, .stop = interrupt_requested, .context = from};
    struct verb_output out;
    struct bag_recovery found;
    struct error why = {""};

    interrupt_catch();
    int err = verb_output_begin(&out, to, &why);
    if (!err) {
        err = bag_recover(&found, from, out.temporary, &watch, &why);
        if (!err && bag_recovery_is_loss(&found) && !found.n_messages &&
            !found.n_attachments && !found.n_metadata)
            err = error_say(&why, -EBADMSG,
                            "%s: nothing in it is whole: it is no bag, or all is lost",
                            from);
        err = verb_output_end(&out, err, &why);
    }
    if (err)
        return verb_end("recover", err, &why);
    print_result(&found, from, to);
    int code = usage_flush("bag recover");
    return code ? code : bag_recovery_is_loss(&found) ? EXIT_FAILED : EXIT_WORKED;
}

int bag_recover_command(int argc, char **argv)
{
    struct usage usage = {
        .command = "bag recover", .help = recover_help, .options = recover_options};
    const char *out = NULL;
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        out = optarg;
    if (code)
        return ~code;
    code = verb_one_operand("bag recover", "FILE", argc, argv);
    if (code)
        return code;
    if (!out)
        return usage_error("bag recover", "-o OUT is missing");
    return recover(argv[optind], out);
}
