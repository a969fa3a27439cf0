/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/text_file.h"
#include "nodes/rt/json_whole.h"
#include "nodes/rt/names.h"
#include "recon/detection/objects.h"

/* -- a file -------------------------------------------------------------------------- */

int export_file_open(struct export_file *e, const char *folder, const char *name,
                     struct error *why)
{
    int n = snprintf(e->path, sizeof e->path, "%s/%s", folder, name);
    int m = snprintf(e->temporary, sizeof e->temporary, "%s/.%s.XXXXXX", folder, name);
    if (n >= (int)sizeof e->path || m >= (int)sizeof e->temporary)
        return error_say(why, -ENAMETOOLONG, "%s: path too long", folder);

    int fd = mkstemp(e->temporary);
    if (fd < 0)
        return error_say(why, -errno, "%s: cannot be written: %s", e->path,
                         strerror(errno));
    /* mkstemp makes a private file; what is exported is for everybody whom umask allows.
     */
    mode_t mask = umask(0);
    umask(mask);
    e->f = fchmod(fd, 0666 & ~mask) ? NULL : fdopen(fd, "wb");
    if (!e->f) {
        int err = -errno;
        close(fd);
        unlink(e->temporary);
        return error_say(why, err, "%s: cannot be written: %s", e->path, strerror(-err));
    }
    return 0;
}

int export_file_abandon(struct export_file *e, int err, struct error *why)
{
    if (e->f)
        fclose(e->f);
    e->f = NULL;
    unlink(e->temporary);
    return error_say(why, err, "%s: cannot be written: %s", e->path, strerror(-err));
}

int export_file_commit(struct export_file *e, struct error *why)
{
    errno = 0;
    int failed = fflush(e->f) || ferror(e->f);
    int err = failed ? (errno ? -errno : -EIO) : 0;
    if (fclose(e->f) && !err)
        err = errno ? -errno : -EIO;
    e->f = NULL;
    if (!err && rename(e->temporary, e->path))
        err = -errno;
    return err ? export_file_abandon(e, err, why) : 0;
}

/* -- a folder, and files that appear in it together ---------------------------------- */

#define UNFINISHED ".unfinished."

/* mkdir -p; *existing: length of the leading part that was there before. */
static int make_folders(const char *folder, size_t *existing)
{
    char path[PATH_MAX];
    struct stat st;
    size_t length = strlen(folder);

    if (!length)
        return -ENOENT;
    if (length >= sizeof path)
        return -ENAMETOOLONG;
    memcpy(path, folder, length + 1);
    *existing = 0;
    for (size_t i = 1; i <= length; i++) {
        if (path[i] != '/' && path[i] != '\0')
            continue;
        path[i] = '\0';
        if (!mkdir(path, 0777))
            ; /* made */
        else if (errno == EEXIST && !stat(path, &st) && S_ISDIR(st.st_mode))
            *existing = i;
        else
            return errno == EEXIST ? -ENOTDIR : -errno;
        path[i] = folder[i];
    }
    return 0;
}

/* Removes what make_folders made, as far as it is empty. */
static void remove_folders(const char *folder, size_t existing)
{
    char path[PATH_MAX];
    size_t length = strlen(folder);
    memcpy(path, folder, length + 1);
    while (length > existing) {
        path[length] = '\0';
        rmdir(path);
        while (length > existing && path[--length] != '/')
            ;
    }
}

static int try_to_write(const char *folder)
{
    char probe[PATH_MAX];
    if (snprintf(probe, sizeof probe, "%s/.probe.XXXXXX", folder) >= (int)sizeof probe)
        return -ENAMETOOLONG;
    int fd = mkstemp(probe);
    if (fd < 0)
        return -errno;
    close(fd);
    unlink(probe);
    return 0;
}

static int open_folder(const char *folder, size_t *existing, struct error *why)
{
    *existing = strlen(folder);
    int err = make_folders(folder, existing);
    if (!err)
        err = try_to_write(folder);
    if (err)
        return error_say(why, err, "%s: cannot be written: %s", folder, strerror(-err));
    return 0;
}

int export_folder(const char *folder, struct error *why)
{
    size_t existing;
    return open_folder(folder, &existing, why);
}

int export_vacant(const char *folder, const char *const *names, size_t n,
                  struct error *why)
{
    for (size_t i = 0; i < n; i++) {
        char path[PATH_MAX];
        struct stat st;
        if (snprintf(path, sizeof path, "%s/%s", folder, names[i]) < (int)sizeof path &&
            !lstat(path, &st))
            return error_say(why, -EEXIST,
                             "%s exists already; remove it or name another folder", path);
    }
    return 0;
}

/* Calls visit for each entry of a folder; stops at the first that fails. */
static int each_entry(const char *folder,
                      int (*visit)(const char *folder, const char *name, void *ctx),
                      void *ctx)
{
    DIR *d = opendir(folder);
    if (!d)
        return -errno;
    int err = 0;
    for (struct dirent *e = readdir(d); e && !err; e = readdir(d))
        if (strcmp(e->d_name, ".") && strcmp(e->d_name, ".."))
            err = visit(folder, e->d_name, ctx);
    closedir(d);
    return err;
}

static int remove_entry(const char *folder, const char *name, void *ctx)
{
    char path[PATH_MAX];
    (void)ctx;
    if (snprintf(path, sizeof path, "%s/%s", folder, name) >= (int)sizeof path)
        return -ENAMETOOLONG;
    if (!unlink(path))
        return 0;
    if (errno != EISDIR && errno != EPERM)
        return -errno;
    each_entry(path, remove_entry, NULL);
    return rmdir(path) ? -errno : 0;
}

/* A descriptor that holds the lock of a folder, or -1: somebody else has it, or the file
 * system has no locks.  links: O_NOFOLLOW or 0. */
static int lock_folder(const char *folder, int links, int operation)
{
    int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC | links);
    if (fd >= 0 && flock(fd, operation)) {
        close(fd);
        return -1;
    }
    return fd;
}

static void unlock_folder(int fd)
{
    if (fd >= 0)
        close(fd);
}

/* What has the name of a stage, but no process that holds its lock. */
static int remove_leftover(const char *folder, const char *name, void *ctx)
{
    char path[PATH_MAX];
    (void)ctx;
    if (strncmp(name, UNFINISHED, strlen(UNFINISHED)) ||
        snprintf(path, sizeof path, "%s/%s", folder, name) >= (int)sizeof path)
        return 0;
    int lock = lock_folder(path, O_NOFOLLOW, LOCK_EX | LOCK_NB);
    if (lock < 0)
        return 0;
    each_entry(path, remove_entry, NULL);
    rmdir(path); /* if it cannot be removed, it does no harm */
    unlock_folder(lock);
    return 0;
}

/* Makes the stage's own folder.  The lock of the one around it keeps another process from
 * taking it for a leftover before it has a lock of its own. */
static int make_stage(struct export_stage *stage)
{
    int err = 0, around = lock_folder(stage->folder, 0, LOCK_EX);
    if (around >= 0)
        each_entry(stage->folder, remove_leftover, NULL);
    if (!mkdtemp(stage->path))
        err = -errno;
    else if (chmod(stage->path, 0755)) {
        err = -errno;
        rmdir(stage->path);
    } else {
        stage->lock = lock_folder(stage->path, O_NOFOLLOW, LOCK_EX | LOCK_NB);
    }
    unlock_folder(around);
    return err;
}

int export_stage_begin(struct export_stage *stage, const char *folder, struct error *why)
{
    memset(stage, 0, sizeof *stage);
    stage->lock = -1;
    if (strlen(folder) >= sizeof stage->folder)
        return error_say(why, -ENAMETOOLONG, "%s: path too long", folder);
    strcpy(stage->folder, folder);
    int err = open_folder(folder, &stage->existing, why);
    if (err)
        return err;
    snprintf(stage->path, sizeof stage->path, "%s/" UNFINISHED "XXXXXX", folder);
    err = make_stage(stage);
    if (err) {
        remove_folders(folder, stage->existing);
        return error_say(why, err, "%s: cannot be written: %s", folder, strerror(-err));
    }
    return 0;
}

static int move_entry(const char *from_folder, const char *to_folder, const char *name)
{
    char from[PATH_MAX], to[PATH_MAX];
    if (snprintf(from, sizeof from, "%s/%s", from_folder, name) >= (int)sizeof from ||
        snprintf(to, sizeof to, "%s/%s", to_folder, name) >= (int)sizeof to)
        return -ENAMETOOLONG;
    return rename(from, to) ? -errno : 0;
}

static int is_content(const struct dirent *e)
{
    return strcmp(e->d_name, ".") && strcmp(e->d_name, "..");
}

/* Moves all out of the stage, or nothing. */
static int move_all(const struct export_stage *stage)
{
    struct dirent **list;
    int n = scandir(stage->path, &list, is_content, NULL), moved = 0;
    int err = n < 0 ? -errno : 0;
    while (!err && moved < n) {
        err = move_entry(stage->path, stage->folder, list[moved]->d_name);
        moved += !err;
    }
    while (err && moved-- > 0)
        move_entry(stage->folder, stage->path, list[moved]->d_name);
    for (int i = 0; i < n; i++)
        free(list[i]);
    if (n >= 0)
        free(list);
    return err;
}

/* What is said is read when the stage has gone, by somebody who never named it. */
static void name_folder(const struct export_stage *stage, struct error *why)
{
    size_t from = strlen(stage->path), to = strlen(stage->folder); /* which is shorter */

    for (char *at = why->text; (at = strstr(at, stage->path)); at += to) {
        memcpy(at, stage->folder, to);
        memmove(at + to, at + from, strlen(at + from) + 1);
    }
}

int export_stage_end(struct export_stage *stage, int err, struct error *why)
{
    if (!err) {
        err = move_all(stage);
        if (!err && rmdir(stage->path))
            err = -errno;
        if (err)
            error_say(why, err, "%s: cannot be written: %s", stage->folder,
                      strerror(-err));
    }
    if (err) {
        if (why)
            name_folder(stage, why);
        each_entry(stage->path, remove_entry, NULL);
        rmdir(stage->path);
    }
    unlock_folder(stage->lock);
    stage->lock = -1;
    if (err)
        remove_folders(stage->folder, stage->existing);
    return err;
}

/* -- NRRD ---------------------------------------------------------------------------- */

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ && sizeof(float) == 4,
               "the voxels are written as they lie in memory");

int export_nrrd(const char *folder, const char *name, const struct grid *grid,
                const float *intensity, struct error *why)
{
    struct export_file e;
    char step[3][DECIMAL_SIZE], origin[3][DECIMAL_SIZE];
    int err = export_file_open(&e, folder, name, why);
    if (err)
        return err;

    for (int a = 0; a < 3; a++) {
        decimal_print(grid->step_m[a], step[a]);
        decimal_print(grid->origin_m[a], origin[a]);
    }
    errno = 0;
    int written = fprintf(e.f,
                          "NRRD0005\n"
                          "# anlos " ANLOS_VERSION
                          ": intensity of the hidden scene as mirrored at the wall\n"
                          "# x along the stage, y up along the array, z forward, in m\n"
                          "content: intensity\n"
                          "type: float\n"
                          "dimension: 3\n"
                          "space dimension: 3\n"
                          "sizes: %zu %zu %zu\n"
                          "space directions: (%s,0,0) (0,%s,0) (0,0,%s)\n"
                          "kinds: domain domain domain\n"
                          "labels: \"x\" \"y\" \"z\"\n"
                          "endian: little\n"
                          "encoding: raw\n"
                          "space units: \"m\" \"m\" \"m\"\n"
                          "space origin: (%s,%s,%s)\n\n",
                          grid->n[0], grid->n[1], grid->n[2], step[0], step[1], step[2],
                          origin[0], origin[1], origin[2]);
    if (written < 0 ||
        fwrite(intensity, sizeof *intensity, grid_size(grid), e.f) != grid_size(grid))
        return export_file_abandon(&e, errno ? -errno : -EIO, why);
    return export_file_commit(&e, why);
}

/* -- JSON ---------------------------------------------------------------------------- */

json_t *export_real(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

int export_json(const char *folder, const char *name, const json_t *value,
                struct error *why)
{
    struct export_file e;
    if (!json_whole(value))
        return error_say(why, -ENOMEM, "%s/%s: out of memory", folder, name);
    int err = export_file_open(&e, folder, name, why);
    if (err)
        return err;
    errno = 0;
    if (json_dumpf(value, e.f, JSON_INDENT(2) | JSON_REAL_PRECISION(9)) ||
        fputc('\n', e.f) == EOF)
        return export_file_abandon(&e, errno ? -errno : -EIO, why);
    return export_file_commit(&e, why);
}

json_t *export_reals(const double *v, size_t n)
{
    json_t *a = json_array();
    for (size_t i = 0; i < n; i++)
        json_array_append_new(a, export_real(v[i]));
    return a;
}

static json_t *vec3(const Anlos__Vec3 *v)
{
    if (!v)
        return json_null();
    return export_reals((const double[]){v->x, v->y, v->z}, 3);
}

static void add_track(json_t *o, const Anlos__Detection *d)
{
    json_object_set_new(o, "state", json_string(name_of_measurement(d->measurement)));
    json_object_set_new(o, "velocity_m_s",
                        export_reals(d->velocity_m_s, d->n_velocity_m_s));
    json_object_set_new(o, "age_s", export_real(d->age_s));
    json_object_set_new(o, "unseen_s", export_real(d->unseen_s));
}

/* What is not known is no number. */
static json_t *sigmas(const double c[6])
{
    double sigma[3] = {sqrt(c[0]), sqrt(c[3]), sqrt(c[5])};

    for (int a = 0; a < 3; a++)
        sigma[a] = sigma[a] < OBJECTS_KNOWN_M ? sigma[a] : NAN;
    return export_reals(sigma, 3);
}

static json_t *borders(unsigned at_border)
{
    static const char *const names[6] = {"x-", "x+", "y-", "y+", "z-", "z+"};
    json_t *all = json_array();

    for (int i = 0; i < 6; i++)
        if (at_border >> i & 1u)
            json_array_append_new(all, json_string(names[i]));
    return all;
}

json_t *export_multipath(const Anlos__Detection *d)
{
    static const char *const names[] = {[ANLOS__MULTIPATH__OF_A_PAIR] = "pair",
                                        [ANLOS__MULTIPATH__BY_A_FACE] = "face",
                                        [ANLOS__MULTIPATH__IN_A_SHADOW] = "shadow"};
    json_t *of = json_array();

    if (d->multipath <= 0 || d->multipath > ANLOS__MULTIPATH__IN_A_SHADOW) {
        json_decref(of);
        return json_null();
    }
    for (size_t i = 0; i < d->n_multipath_of; i++)
        json_array_append_new(of, json_integer(d->multipath_of[i]));
    return json_pack("{ss, so}", "by", names[d->multipath], "of", of);
}

static json_t *detection(const Anlos__Detection *d, bool tracked)
{
    json_t *o = json_object();
    json_object_set_new(o, "id", json_integer(d->id));
    json_object_set_new(o, "position_m", vec3(d->position_m));
    json_object_set_new(o, "sigma_m",
                        d->n_covariance_m2 == 6 ? sigmas(d->covariance_m2) : json_null());
    json_object_set_new(o, "covariance_m2",
                        export_reals(d->covariance_m2, d->n_covariance_m2));
    json_object_set_new(o, "existence", export_real(d->existence));
    json_object_set_new(o, "multipath", export_multipath(d));
    json_object_set_new(o, "level_db", export_real(d->level_db));
    json_object_set_new(o, "virtual_m", vec3(d->virtual_m));
    json_object_set_new(o, "extent_m", vec3(d->extent_m));
    json_object_set_new(o, "wall", json_integer(d->wall));
    json_object_set_new(o, "behind_no_wall", json_boolean(d->behind_no_wall));
    json_object_set_new(o, "in_free_view", json_boolean(d->in_free_view));
    json_object_set_new(o, "height_assumed", json_boolean(d->height_assumed));
    json_object_set_new(o, "at_border", borders(d->at_border));
    json_object_set_new(o, "class", json_string(name_of_shape(d->shape)));
    if (tracked)
        add_track(o, d);
    return o;
}

/* Corners as pairs, in the frame of the positions: [[x, y], ...]. */
static json_t *views(const Anlos__DetectionList *list)
{
    json_t *all = json_array();

    for (size_t i = 0; i < list->n_views; i++) {
        const Anlos__ViewArea *v = list->views[i];
        json_t *corners = json_array();
        for (size_t k = 0; k + 1 < v->n_corners_m; k += 2)
            json_array_append_new(corners, export_reals(v->corners_m + k, 2));
        json_array_append_new(
            all, json_pack("{si, so}", "wall", v->wall, "corners_m", corners));
    }
    return all;
}

int export_detections(const char *folder, const Anlos__DetectionList *list,
                      struct error *why)
{
    json_t *o = json_object(), *all = json_array();
    json_object_set_new(o, "scan", json_integer(list->scan));
    json_object_set_new(o, "counter", json_integer(list->counter));
    json_object_set_new(o, "preview", json_boolean(list->preview));
    json_object_set_new(o, "source", json_string(name_of_source(list->source)));
    json_object_set_new(o, "frame",
                        json_string(list->in_vehicle_frame ? "vehicle" : "array"));
    json_object_set_new(o, "tracked", json_boolean(list->tracked));
    json_object_set_new(o, "mirrored_at_wall", json_boolean(list->mirrored));
    json_object_set_new(o, "sound_speed_m_s", export_real(list->sound_speed_m_s));
    json_object_set_new(o, "temperature_c", export_real(list->temperature_c));
    for (size_t i = 0; i < list->n_detections; i++)
        json_array_append_new(all, detection(list->detections[i], list->tracked));
    json_object_set_new(o, "detections", all);
    json_object_set_new(o, "views", views(list));
    int err = export_json(folder, "detections.json", o, why);
    json_decref(o);
    return err;
}
