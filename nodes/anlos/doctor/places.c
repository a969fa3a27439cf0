/* SPDX-License-Identifier: MIT */
#include <alsa/asoundlib.h>
#include <arpa/inet.h>
#include <cairo.h>
#include <cyaml/cyaml.h>
#include <errno.h>
#include <fftw3.h>
#include <jansson.h>
#include <limits.h>
#include <lz4.h>
#include <protobuf-c/protobuf-c.h>
#include <sndfile.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>
#include <zstd.h>

#include "dsp/error.h"
#include "msgs/endpoint.h"
#include "msgs/topics.h"
#include "nodes/anlos/doctor/doctor.h"
#include "nodes/launcher/devices.h"
#include "nodes/launcher/program.h"
#include "nodes/rt/launchfile_hosts.h"
#include "nodes/rt/rundir.h"

static void look_at_versions(struct findings *f)
{
    finding_add(f, FINDING_OK, "libraries",
                "anlos %s; %s, protobuf-c %s, zstd %s, lz4 %s, cyaml %s, jansson %s, %s, "
                "cairo %s, alsa %s",
                ANLOS_VERSION, fftwf_version, protobuf_c_version(), ZSTD_versionString(),
                LZ4_versionString(), cyaml_version_str, jansson_version_str(),
                sf_version_string(), cairo_version_string(), snd_asoundlib_version());
}

/* The launcher starts them from the folder where this program is. */
static void look_at_programs(struct findings *f)
{
    char folder[4000], path[4096], missing[512] = "";
    size_t n = 0, n_missing = 0;

    if (program_folder(folder, sizeof folder)) {
        finding_add(f, FINDING_WRONG, "programs", "the folder of this one is not known");
        return;
    }
    for (const char *const *node = topics_nodes(); *node; node++) {
        if (!strcmp(*node, "launcher"))
            continue;
        n++;
        snprintf(path, sizeof path, "%s/anlos-%s", folder, *node);
        if (!access(path, X_OK))
            continue;
        n_missing++;
        text_add(missing, sizeof missing, ", ", "anlos-%s", *node);
    }
    if (!n_missing) {
        finding_add(f, FINDING_OK, "programs", "all %zu of the nodes are in %s", n,
                    folder);
        return;
    }
    finding_add(f, FINDING_WRONG, "programs", "%s: missing: %s", folder, missing);
    finding_todo(f,
                 "build all of it: 'cmake --build' of the folder that this was built in");
}

void doctor_libraries(const void *ctx, struct findings *f)
{
    (void)ctx;
    look_at_versions(f);
    look_at_programs(f);
}

/* Takes the address for a moment.  0 or a negative errno. */
static int try_address(const char *address, unsigned port)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    int on = 1, fd;

    if (inet_pton(AF_INET, address, &to.sin_addr) != 1)
        return -EADDRNOTAVAIL;
    fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return -errno;
    int err = setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) ||
                      bind(fd, (struct sockaddr *)&to, sizeof to)
                  ? -errno
                  : 0;
    close(fd);
    return err;
}

void doctor_view(const void *ctx, struct findings *f)
{
    struct launchfile *l = doctor_load(ctx);

    if (l && doctor_runs(ctx, l, "view")) {
        int err = try_address(l->view.address, l->view.port);
        if (err == -EADDRINUSE) {
            finding_add(f, FINDING_NOTE, "view",
                        "%s:%u is in use, by a view that runs or "
                        "another program",
                        l->view.address, l->view.port);
            finding_todo(f, "'ss -ltnp' tells by whom; view.port chooses another");
        } else if (err) {
            finding_add(f, FINDING_WRONG, "view", "%s:%u: %s", l->view.address,
                        l->view.port, strerror(-err));
            finding_todo(f, "set view.address and view.port right in the launch file");
        } else {
            finding_add(f, FINDING_OK, "view", "the page will be at http://%s:%u",
                        l->view.address, l->view.port);
        }
    }
    launchfile_destroy(l);
}

#define DISK_WRONG_MB 50
#define DISK_NOTE_MB  1000

struct launchfile *doctor_load(const struct doctor *d)
{
    struct launchfile *l = NULL;

    if (!d->launch || launchfile_load(&l, d->launch, NULL, NULL))
        return NULL;
    if (!d->host || !launchfile_choose_host(l, d->host, NULL))
        return l;
    launchfile_destroy(l);
    return NULL;
}

bool doctor_runs(const struct doctor *d, const struct launchfile *l, const char *node)
{
    if (l->hosts.n && !d->host)
        return false;
    return l->hosts.n ? launchfile_runs_here(l, node) : launchfile_has_node(l, node);
}

/* The folder, or the nearest one above it that is there. */
static void find_existing(char path[PATH_MAX], const char *folder)
{
    snprintf(path, PATH_MAX, "%s", folder);
    while (access(path, F_OK)) {
        char *slash = strrchr(path, '/');
        if (!slash) {
            snprintf(path, PATH_MAX, ".");
            return;
        }
        slash[slash == path] = '\0';
        if (slash == path && access(path, F_OK))
            return;
    }
}

static void look_at_room(struct findings *f, const char *area, const char *what,
                         const char *folder, const char *there)
{
    struct statvfs v;

    if (statvfs(there, &v)) {
        finding_add(f, FINDING_NOTE, area,
                    "%s %s: how much room is left is not known: %s", what, folder,
                    strerror(errno));
        return;
    }
    double mb = 1e-6 * (double)v.f_bavail * (double)v.f_frsize;
    bool no_files = v.f_files && !v.f_favail;
    finding_add(f,
                mb < DISK_WRONG_MB || no_files ? FINDING_WRONG
                : mb < DISK_NOTE_MB            ? FINDING_NOTE
                                               : FINDING_OK,
                area, "%s %s%s: room for %.0f MB%s", what, folder,
                strcmp(folder, there) ? " (will be made)" : "", mb,
                no_files ? ", but for no more files" : "");
    if (mb < DISK_NOTE_MB || no_files)
        finding_todo(f, "free some of it, or choose a folder on another disk");
}

/* Can files be made in the folder, or where it would be, and is there room? */
static void look_at_folder(struct findings *f, const char *area, const char *what,
                           const char *folder)
{
    char there[PATH_MAX];
    struct stat st = {0};

    find_existing(there, folder);
    if (!stat(there, &st) && !S_ISDIR(st.st_mode)) {
        finding_add(f, FINDING_WRONG, area, "%s %s: %s is no folder", what, folder,
                    there);
        finding_todo(f, "remove that file, or choose another folder");
    } else if (access(there, W_OK | X_OK)) {
        finding_add(f, FINDING_WRONG, area, "%s %s: %s: %s", what, folder, there,
                    strerror(errno));
        finding_todo(f,
                     "be user %u, to whom that belongs; or, as root, 'install -d -o %u "
                     "%s'; or choose another folder",
                     (unsigned)st.st_uid, (unsigned)geteuid(), folder);
    } else {
        look_at_room(f, area, what, folder, there);
    }
}

static void look_at_record(const struct doctor *d, const struct launchfile *l,
                           struct findings *f)
{
    char folder[PATH_MAX];

    if (!doctor_runs(d, l, "record"))
        return;
    if (l->record.snapshot.folder)
        look_at_folder(f, "record", "bags of the last seconds go to",
                       l->record.snapshot.folder);
    if (!*l->record.path)
        return;
    snprintf(folder, sizeof folder, "%s", l->record.path);
    char *slash = strrchr(folder, '/');
    if (slash)
        slash[slash == folder] = '\0';
    look_at_folder(f, "record", "bags go to", slash ? folder : ".");
}

static void look_at_bag(const struct doctor *d, const struct launchfile *l,
                        struct findings *f)
{
    if (!doctor_runs(d, l, "play") || !l->play.bag || !*l->play.bag)
        return;
    if (!access(l->play.bag, R_OK)) {
        finding_add(f, FINDING_OK, "play", "%s is there", l->play.bag);
        return;
    }
    finding_add(f, FINDING_WRONG, "play", "%s: %s", l->play.bag, strerror(errno));
    finding_todo(f, "name a bag in play.bag of the launch file, or by --bag");
}

static void look_at_keys(const struct launchfile *l, struct findings *f)
{
    const struct host *here = &l->hosts.list[l->hosts.here];
    struct error why = {""};

    if (!hosts_use_keys(&l->hosts)) {
        if (here->address[0])
            finding_add(f, FINDING_NOTE, "keys",
                        "not encrypted: all hosts are on this machine, and its other "
                        "users can listen and command");
    } else if (launchfile_check_keys(l, &why)) {
        finding_add(f, FINDING_WRONG, "keys", "%s", why.text);
        finding_todo(f, "'anlos keys --help' tells how hosts get to know each other");
    } else {
        finding_add(f, FINDING_OK, "keys", "%s: this host's, and those of %zu others",
                    here->keys, l->hosts.n - 1);
    }
}

/* Which of the machines is this, and is it? */
static void look_at_host(const struct doctor *d, struct launchfile *l, struct findings *f)
{
    struct error why = {""};

    if (!l->hosts.n && !d->host)
        return;
    if (l->hosts.n && !d->host) {
        finding_add(f, FINDING_NOTE, "host", "%s is of %zu machines: which is this one?",
                    d->launch, l->hosts.n);
        finding_todo(f,
                     "--host %s, or another of its hosts: then its devices are looked "
                     "at",
                     l->hosts.list[0].name);
    } else if (launchfile_choose_host(l, d->host, &why) ||
               (l->hosts.list[l->hosts.here].address[0] &&
                host_check_address(&l->hosts.list[l->hosts.here], &why))) {
        finding_add(f, FINDING_WRONG, "host", "%s", why.text);
        finding_todo(f, "set hosts right in the launch file, or name another --host");
    } else {
        finding_add(f, FINDING_OK, "host", "this is %s", d->host);
        look_at_keys(l, f);
    }
}

void doctor_launch(const void *ctx, struct findings *f)
{
    const struct doctor *d = ctx;
    struct launchfile *l = NULL;
    struct error why = {""};
    char nodes[256] = "";

    if (!d->launch)
        return;
    if (launchfile_load(&l, d->launch, NULL, &why)) {
        finding_add(f, FINDING_WRONG, "launch", "%s", why.text);
        finding_todo(f, "set that right; launch/demo.yaml is one that works");
        return;
    }
    for (unsigned i = 0; i < l->n_nodes; i++)
        text_add(nodes, sizeof nodes, ", ", "%s", l->nodes[i]);
    if (devices_fit(l, &why))
        finding_add(f, FINDING_WRONG, "launch", "%s", why.text);
    else
        finding_add(f, FINDING_OK, "launch", "%s: %s", d->launch, nodes);
    look_at_host(d, l, f);
    if (doctor_runs(d, l, "report"))
        look_at_folder(f, "results", "results go to", l->report.folder);
    look_at_record(d, l, f);
    look_at_bag(d, l, f);
    launchfile_destroy(l);
}

/* The longest name that a socket in the folder may have. */
static bool has_room_for_sockets(const char *run_dir, struct error *why)
{
    char url[ENDPOINT_URL_SIZE];

    for (const struct topic *t = topics_all(); t->name; t++)
        for (const char *const *n = topics_nodes(); *n; n++)
            if (topic_is_published_by(t, *n) &&
                endpoint_url(url, run_dir, *n, t->name, why))
                return false;
    return true;
}

void doctor_run_dir(const void *ctx, struct findings *f)
{
    const struct doctor *d = ctx;
    char run_dir[RUNDIR_SIZE];
    struct error why = {""};

    if (rundir_name(run_dir, d->run_dir, &why) || !has_room_for_sockets(run_dir, &why)) {
        finding_add(f, FINDING_WRONG, "run-dir", "%s", why.text);
        finding_todo(f, "name a shorter one with --run-dir");
        return;
    }
    if (rundir_check(run_dir, &why)) {
        finding_add(f, FINDING_WRONG, "run-dir", "%s", why.text);
        finding_todo(f, "as it says, or name another one with --run-dir");
        return;
    }
    look_at_folder(f, "run-dir", "processes meet in", run_dir);
}
