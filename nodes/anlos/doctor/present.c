#include "nodes/anlos/doctor/doctor.h"

#include <dirent.h>
#include <stdlib.h>
#include <string.h>

#include "hal/alsa/devices.h"

#define ARPHRD_CAN_TEXT "280" /* of /sys/class/net/NAME/type */

struct names {
    size_t n;
    char text[600];
};

static void add_name(struct names *l, const char *format, const char *name)
{
    size_t used = strlen(l->text);

    used +=
        (size_t)snprintf(l->text + used, sizeof l->text - used, "%s", l->n++ ? ", " : "");
    if (used < sizeof l->text)
        snprintf(l->text + used, sizeof l->text - used, format, name);
}

static void say(struct findings *f, const char *area, const char *what,
                const struct names *l)
{
    if (l->n)
        finding_add(f, FINDING_OK, area, "%s: %s", what, l->text);
    else
        finding_add(f, FINDING_OK, area, "%s: none", what);
}

static void look_at_cards(struct findings *f)
{
    struct alsa_device *devices = NULL;
    struct names found = {0};
    size_t n = 0;

    alsa_devices_list(&devices, &n);
    for (size_t i = 0; i < n; i++)
        if (devices[i].is_card)
            add_name(&found, "%.120s", devices[i].name);
    free(devices);
    say(f, "array", "sound cards", &found);
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
    struct names found = {0};
    DIR *d = opendir(folder);

    for (struct dirent *e = d ? readdir(d) : NULL; e; e = readdir(d))
        if (wanted(e->d_name))
            add_name(&found, "%.60s", e->d_name);
    if (d)
        closedir(d);
    say(f, area, what, &found);
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
