/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/bag/bag.h"

#include <errno.h>
#include <fcntl.h>
#include <fnmatch.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/patterns.h"

#define CHUNK_SIZE (4u << 20)

int verb_end(const char *verb, int err, const struct error *why)
{
    if (!err)
        return EXIT_WORKED;
    if (err == -EPIPE)
        return EXIT_UNREAD;
    fprintf(stderr, "anlos bag %s: %s\n", verb,
            why->text[0] ? why->text : strerror(-err));
    return err == -EFBIG ? EXIT_BAD_INPUT : usage_exit_code(err);
}

int verb_output_begin(struct verb_output *o, const char *path, struct error *why)
{
    int n = snprintf(o->path, sizeof o->path, "%s", path);
    int m =
        snprintf(o->temporary, sizeof o->temporary, "%s.%ld.part", path, (long)getpid());

    if (n >= (int)sizeof o->path || m >= (int)sizeof o->temporary)
        return error_say(why, -ENAMETOOLONG, "%s: path too long", path);
    if (!access(path, F_OK))
        return error_say(why, -EEXIST,
                         "%s exists already; remove it or name another file", path);
    unlink(o->temporary); /* of a dead process that had this one's number */
    return 0;
}

int verb_output_end(struct verb_output *o, int err, struct error *why)
{
    if (!err && renameat2(AT_FDCWD, o->temporary, AT_FDCWD, o->path, RENAME_NOREPLACE)) {
        /* Some file systems cannot look and rename at once. */
        bool replaces = errno != EINVAL && errno != ENOSYS;
        if (replaces || rename(o->temporary, o->path))
            err = error_say(why, -errno, "%s: %s", o->path, strerror(errno));
    }
    if (err)
        unlink(o->temporary);
    if (err == -EINTR && why) {
        const struct error stopped = *why;
        error_say(why, err, "%.900s; there is no %s", stopped.text, o->path);
    }
    return err;
}

int verb_writer_create(struct bag_writer **out, const struct verb_output *o,
                       const char *profile, enum bag_compression compression,
                       struct error *why)
{
    const struct bag_writer_config cfg = {.profile = profile,
                                          .library = "anlos " ANLOS_VERSION,
                                          .chunk_size = CHUNK_SIZE,
                                          .compression = compression};

    int err = bag_writer_create(out, o->temporary, &cfg, why);
    return err ? error_say(why, err, "%s cannot be written: %s", o->path, strerror(-err))
               : 0;
}

int verb_write_file(const char *path,
                    int (*write)(FILE *f, void *context, struct error *why),
                    void *context, struct error *why)
{
    struct verb_output o;
    bool to_stdout = !strcmp(path, "-");
    int err = to_stdout ? 0 : verb_output_begin(&o, path, why);

    if (err)
        return err;
    FILE *f = to_stdout ? stdout : fopen(o.temporary, "wxe");
    if (!f)
        return error_say(why, -errno, "%s cannot be written: %s", path, strerror(errno));
    err = write(f, context, why);
    errno = 0;
    bool failed = fflush(f) || ferror(f);
    if (!to_stdout)
        failed = fclose(f) || failed;
    if (failed && !err) {
        int reason = errno ? errno : EIO;
        err = error_say(why, -reason, "%s cannot be written: %s",
                        to_stdout ? "standard output" : path, strerror(reason));
    }
    return to_stdout ? err : verb_output_end(&o, err, why);
}

int verb_one_operand(const char *command, const char *what, int argc, char **argv)
{
    if (optind == argc)
        return usage_error(command, "%s is missing", what);
    if (argc - optind > 1)
        return usage_error(command, "%s: unexpected", argv[optind + 1]);
    return 0;
}

static const enum bag_compression compressions[] = {BAG_ZSTD, BAG_LZ4, BAG_NONE};

const char *verb_compression_name(size_t i)
{
    if (i == sizeof compressions / sizeof *compressions)
        return NULL;
    return compressions[i] == BAG_NONE ? "none" : bag_compression_name(compressions[i]);
}

enum bag_compression verb_compression(const char *name)
{
    return compressions[choice_index(verb_compression_name, name)];
}

static bool is_match(const char *pattern, struct bytes topic)
{
    char name[256];

    snprintf(name, sizeof name, "%.*s", (int)(topic.size < 256 ? topic.size : 256),
             (const char *)topic.data);
    return !fnmatch(pattern, name, 0);
}

int verb_add_patterns(const char *command, const char *text, char room[VERB_PATTERNS],
                      const char **list)
{
    size_t used = *list ? strlen(room) : 0;
    int n = snprintf(room + used, VERB_PATTERNS - used, "%s%s", used ? "," : "", text);

    *list = room;
    if ((size_t)n < VERB_PATTERNS - used)
        return 0;
    return usage_error(command, "%s: the names of topics are too long", text);
}

bool verb_matches(const char *patterns, struct bytes topic)
{
    char pattern[PATTERN_SIZE];

    if (!patterns)
        return true;
    while ((patterns = patterns_next(patterns, pattern)))
        if (is_match(pattern, topic))
            return true;
    return false;
}

bool verb_finds_stray(const char *patterns, struct bag_catalog *const *bags,
                      size_t n_bags, char out[PATTERN_SIZE])
{
    while (patterns && (patterns = patterns_next(patterns, out))) {
        bool found = false;
        for (size_t b = 0; b < n_bags; b++)
            for (size_t i = 0; i < bags[b]->n_channels && !found; i++)
                found = is_match(out, bags[b]->channels[i].record.channel.topic);
        if (!found)
            return true;
    }
    return false;
}

struct verb {
    const char *name;
    const char *what;
    int (*run)(int argc, char **argv);
};

static const struct verb verbs[] = {
    {"record", "what goes over the bus of a running system", bag_record},
    {"save", "the last seconds, of a recorder that keeps them", bag_save},
    {"play", "a recording onto the bus, as if it happened now", bag_play},
    {"info", "what is in a bag: topics, times, sizes, attachments", bag_info},
    {"check", "every checksum, every index against the content", bag_check_command},
    {"recover", "save what is whole in a bag that was cut or damaged",
     bag_recover_command},
    {"merge", "several bags into one", bag_merge},
    {"filter", "some topics, or some of the time", bag_filter},
    {"export", "as WAV, CSV, JSON, NRRD or PNG", bag_export},
    {"import", "make a bag of WAV files or of a MATLAB file", bag_import},
};

#define N_VERBS (sizeof verbs / sizeof *verbs)

static int print_help(void)
{
    printf("anlos bag -- recordings: look at them, check them, cut them, convert them\n\n"
           "usage: anlos bag VERB [arguments]\n\n");
    for (size_t i = 0; i < N_VERBS; i++)
        printf("  %-9s %s\n", verbs[i].name, verbs[i].what);
    printf("\n`anlos bag VERB --help` explains a verb.  Bags are MCAP files, which\n"
           "Foxglove, Lichtblick, PlotJuggler and Rerun open too.\n\n"
           "exit codes: 0 done; 1 failed, or something was lost or is wrong; 2 bad\n"
           "arguments or input; 130 stopped by Ctrl-C\n");
    return usage_flush("bag");
}

int command_bag(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "";

    if (!strcmp(name, "--help") || !strcmp(name, "-h"))
        return print_help();
    for (size_t i = 0; i < N_VERBS; i++)
        if (!strcmp(name, verbs[i].name))
            return verbs[i].run(argc - 1, argv + 1);
    if (name[0] == '-')
        return usage_error("bag", "%s: no such option; a verb comes first", name);
    const char *names[N_VERBS + 1] = {NULL};
    for (size_t i = 0; i < N_VERBS; i++)
        names[i] = verbs[i].name;
    const char *near = usage_nearest(name, names);
    if (near)
        return usage_error("bag", "%s: no such verb; did you mean %s?", name, near);
    return usage_error(
        "bag",
        *name ? "%s: no such verb; expected record, save, play, info, check, recover, "
                "merge, filter, export or import"
              : "%srecord, save, play, info, check, recover, merge, filter, export or "
                "import is missing",
        name);
}
