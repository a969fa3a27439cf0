/* SPDX-License-Identifier: MIT */
#include <dirent.h>
#include <errno.h>
#include <grp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "dsp/error.h"
#include "hal/alsa/devices.h"
#include "hal/array.h"
#include "hal/can/errors.h"
#include "hal/can/socket.h"
#include "hal/canbus.h"
#include "hal/device.h"
#include "hal/stage.h"
#include "hal/stage/gpio.h"
#include "hal/stage/gpiod.h"
#include "hal/stage/zaber.h"
#include "hal/survey/firing.h"
#include "hal/survey/rig_file.h"
#include "nodes/anlos/doctor/doctor.h"

#define ARPHRD_CAN_TEXT "280" /* of /sys/class/net/NAME/type */

#define NAMES_SIZE 600

static void look_at_cards(struct findings *f)
{
    struct alsa_device *devices = NULL;
    char found[NAMES_SIZE] = "";
    size_t n = 0;

    alsa_devices_list(&devices, &n);
    for (size_t i = 0; i < n; i++)
        if (devices[i].is_card)
            text_add(found, sizeof found, ", ", "%.120s", devices[i].name);
    free(devices);
    finding_add(f, FINDING_OK, "array", "sound cards: %s", found[0] ? found : "none");
}

static bool is_can(const char *interface)
{
    char path[320], type[16];

    snprintf(path, sizeof path, "/sys/class/net/%.255s/type", interface);
    return !doctor_read_word(path, type, sizeof type) && !strcmp(type, ARPHRD_CAN_TEXT);
}

static bool is_gpio(const char *name)
{
    return !strncmp(name, "gpiochip", 8);
}

static bool is_serial(const char *name)
{
    return !strncmp(name, "ttyUSB", 6) || !strncmp(name, "ttyACM", 6);
}

static void look_into(struct findings *f, const char *folder,
                      bool (*wanted)(const char *), const char *area, const char *what)
{
    char found[NAMES_SIZE] = "";
    DIR *d = opendir(folder);

    for (struct dirent *e = d ? readdir(d) : NULL; e; e = readdir(d))
        if (wanted(e->d_name))
            text_add(found, sizeof found, ", ", "%.60s", e->d_name);
    if (d)
        closedir(d);
    finding_add(f, FINDING_OK, area, "%s: %s", what, found[0] ? found : "none");
}

void doctor_present(const void *ctx, struct findings *f)
{
    const struct doctor *d = ctx;

    if (d->launch)
        return;
    look_at_cards(f);
    look_into(f, "/dev", is_gpio, "stage", "GPIO chips");
    look_into(f, "/dev", is_serial, "stage", "serial ports on USB");
    look_into(f, "/sys/class/net", is_can, "can", "CAN interfaces");
}

static void look_at_channels(struct findings *f, const struct rig *r,
                             const struct alsa_probe *p, const char *card)
{
    const struct survey *s = &r->survey;
    size_t out = rig_output_channels(r), in = rig_input_channels(r);
    unsigned rate_hz = (unsigned)s->sample_rate_hz;
    size_t before = f->n;

    if (!p->has_playback || !p->has_capture)
        finding_add(f, FINDING_WRONG, "array", "%s cannot %s", card,
                    p->has_playback ? "record" : "play");
    if (p->has_playback && p->playback.channels_max < out)
        finding_add(f, FINDING_WRONG, "array",
                    "%s plays %u channels, the rig asks for %zu", card,
                    p->playback.channels_max, out);
    if (p->has_capture && p->capture.channels_max < in)
        finding_add(f, FINDING_WRONG, "array",
                    "%s records %u channels, the rig asks for %zu", card,
                    p->capture.channels_max, in);
    if (p->has_capture &&
        (rate_hz < p->capture.rate_min_hz || rate_hz > p->capture.rate_max_hz))
        finding_add(f, FINDING_WRONG, "array", "%s has no rate of %u Hz", card, rate_hz);
    if (p->has_playback && p->has_capture && !p->one_clock)
        finding_add(f, FINDING_WRONG, "array", "%s: no common clock: %s", card,
                    p->clock_reason);
    if (f->n > before)
        finding_todo(f,
                     "'anlos array probe %s' shows what it can do; change the rig, or "
                     "take another card",
                     card);
    else
        finding_add(f, FINDING_OK, "array",
                    "%s: %zu speakers, %zu microphones, %u Hz, one clock", card,
                    s->n_speakers, s->n_microphones, rate_hz);
}

static void look_at_card(struct findings *f, const char *uri)
{
    static const char *const keys[] = {"rig", "background", "calibrated", FIRING_KEYS,
                                       NULL};
    struct error why = {""};
    struct alsa_probe probe;
    struct device d;
    struct rig r;
    int err = device_parse(&d, device_arg(uri, "alsa"), keys, &why);

    if (err) {
        finding_add(f, FINDING_WRONG, "array", "%s: %s", uri, why.text);
        return;
    }
    const char *rig = device_option(&d, "rig");
    err = rig ? rig_load_calibrated(&r, rig, device_option(&d, "calibrated"), &why)
              : error_say(&why, -EINVAL, "%s names no rig, alsa:DEVICE?rig=FILE", uri);
    if (err) {
        finding_add(f, FINDING_WRONG, "array", "%s", why.text);
        finding_todo(f, "launch/lab-rig.yaml is a rig that works");
        device_clear(&d);
        return;
    }
    err = alsa_probe(&probe, d.path, &why);
    if (err == -EBUSY) {
        finding_add(f, FINDING_NOTE, "array",
                    "%s is in use, by a running system or "
                    "another program: its channels cannot be "
                    "looked at",
                    d.path);
        finding_todo(f, "'fuser -v /dev/snd/*' tells by whom");
    } else if (err) {
        finding_add(f, FINDING_WRONG, "array", "%s", why.text);
        finding_todo(f, err == -EACCES ? "join the group audio, log in anew"
                                       : "'anlos array list' has the names of the cards");
    } else {
        look_at_channels(f, &r, &probe, d.path);
    }
    rig_clear(&r);
    device_clear(&d);
}

static void look_at_recording(struct findings *f, const char *uri)
{
    struct array *array = NULL;
    struct error why = {""};

    if (array_open(&array, uri, clock_system(), &why)) {
        finding_add(f, FINDING_WRONG, "array", "%s", why.text);
        finding_todo(f, "its path is relative to the launch file; 'anlos sim --help' "
                        "tells how a recording is made");
    } else {
        const struct survey *s = array_survey(array);
        finding_add(f, FINDING_OK, "array",
                    "%s: %zu speakers, %zu microphones, %zu stage "
                    "positions",
                    uri, s->n_speakers, s->n_microphones, s->n_positions);
    }
    array_close(array);
}

void doctor_array(const void *ctx, struct findings *f)
{
    struct launchfile *l = doctor_load(ctx);

    if (l && doctor_runs(ctx, l, "array")) {
        if (device_arg(l->array.uri, "alsa"))
            look_at_card(f, l->array.uri);
        else
            look_at_recording(f, l->array.uri);
    }
    launchfile_destroy(l);
}

/* A device file that the stage will open for reading and writing. */
static void look_at_file(struct findings *f, const char *path)
{
    struct stat st;

    if (stat(path, &st)) {
        finding_add(f, FINDING_WRONG, "stage", "%s: %s", path, strerror(errno));
        finding_todo(f, "is it plugged in and switched on? 'dmesg' tells its name");
    } else if (!S_ISCHR(st.st_mode)) {
        finding_add(f, FINDING_WRONG, "stage", "%s is no device", path);
    } else if (access(path, R_OK | W_OK)) {
        int err = errno;
        const struct group *g = getgrgid(st.st_gid);
        finding_add(f, FINDING_WRONG, "stage", "%s: %s", path, strerror(err));
        finding_todo(f, "'usermod -aG %s USER', log in anew",
                     g ? g->gr_name : "of that file");
    } else {
        finding_add(f, FINDING_OK, "stage", "%s is there, and permitted", path);
    }
}

static void look_at_gpio(struct findings *f, const char *uri)
{
    struct error why = {""};
    struct stage_gpiod_options o;
    struct device d;
    char path[GPIO_CHIP_PATH_SIZE];
    int err = device_parse(&d, device_arg(uri, "gpiod"), stage_gpiod_option_keys, &why);

    if (err) {
        finding_add(f, FINDING_WRONG, "stage", "%s", why.text);
        return;
    }
    err = stage_gpiod_options_read(&o, &d, &why);
    if (!err)
        err = gpio_chip_path(path, d.path, &why);
    if (err)
        finding_add(f, FINDING_WRONG, "stage", "%s", why.text);
    else
        look_at_file(f, path);
    device_clear(&d);
}

static void look_at_zaber(struct findings *f, const char *uri)
{
    struct error why = {""};
    struct stage_zaber_options o;
    struct device d;
    int err = device_parse(&d, device_arg(uri, "zaber"), stage_zaber_option_keys, &why);

    if (err) {
        finding_add(f, FINDING_WRONG, "stage", "%s", why.text);
        return;
    }
    if (stage_zaber_options_read(&o, &d, &why))
        finding_add(f, FINDING_WRONG, "stage", "%s", why.text);
    else
        look_at_file(f, d.path);
    device_clear(&d);
}

static void look_at_simulated(struct findings *f, const char *uri)
{
    struct stage *stage = NULL;
    struct error why = {""};

    if (stage_open(&stage, uri, clock_system(), &why))
        finding_add(f, FINDING_WRONG, "stage", "%s", why.text);
    else
        finding_add(f, FINDING_OK, "stage", "%s needs no hardware", uri);
    stage_close(stage);
}

void doctor_stage(const void *ctx, struct findings *f)
{
    struct launchfile *l = doctor_load(ctx);

    if (l && doctor_runs(ctx, l, "stage")) {
        if (device_arg(l->stage.uri, "gpiod"))
            look_at_gpio(f, l->stage.uri);
        else if (device_arg(l->stage.uri, "zaber"))
            look_at_zaber(f, l->stage.uri);
        else
            look_at_simulated(f, l->stage.uri);
    }
    launchfile_destroy(l);
}

static void look_at_interface(struct findings *f, const char *interface, bool fd_frames)
{
    struct error why = {""};
    struct can_link link;
    char text[256];
    int fd, err = can_socket_open(&fd, interface, 0, &why);

    if (!err) {
        err = can_socket_link(fd, interface, &link);
        error_say(&why, err, "%s: %s", interface, strerror(-err));
        close(fd);
    }
    if (err) {
        finding_add(f, FINDING_WRONG, "can", "%s", why.text);
        finding_todo(f, "'ip -details link show type can' lists those that are there");
    } else if (!link.up) {
        finding_add(f, FINDING_WRONG, "can", "%s is down", interface);
        finding_todo(f, "'ip link set %s up type can bitrate 500000 restart-ms 100'",
                     interface);
    } else if (!link.carrier) {
        canbus_advice(text, sizeof text, CANBUS_OFF, interface);
        finding_add(f, FINDING_WRONG, "can", "%s", text);
    } else if (fd_frames && !link.can_fd) {
        finding_add(f, FINDING_WRONG, "can", "%s takes no CAN FD frames: no objects",
                    interface);
        finding_todo(f,
                     "without can.fd, or 'ip link set %s type can bitrate 500000 "
                     "dbitrate 2000000 fd on' while it is down",
                     interface);
    } else {
        finding_add(f, FINDING_OK, "can", "%s is up, %s", interface,
                    link.can_fd ? "takes FD frames" : "classic frames only");
    }
}

void doctor_can(const void *ctx, struct findings *f)
{
    struct launchfile *l = doctor_load(ctx);

    if (l && doctor_runs(ctx, l, "can")) {
        const char *interface = device_arg(l->can.uri, "socketcan");
        char name[64];
        struct error why = {""};
        if (interface) {
            snprintf(name, sizeof name, "%.*s", (int)strcspn(interface, "?"), interface);
            look_at_interface(f, name, l->can.fd);
        } else if (canbus_check(l->can.uri, &why)) {
            finding_add(f, FINDING_WRONG, "can", "%s", why.text);
        } else {
            finding_add(f, FINDING_OK, "can", "frames go into %s, to no vehicle",
                        l->can.uri);
        }
    }
    launchfile_destroy(l);
}
