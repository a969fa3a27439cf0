/* SPDX-License-Identifier: MIT */
#include "hal/stage/gpio.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

static bool has_label(const char *path, const char *label)
{
    struct gpiochip_info info = {.label = ""};
    int fd = open(path, O_RDONLY | O_CLOEXEC);

    if (fd < 0)
        return false;
    bool found = !ioctl(fd, GPIO_GET_CHIPINFO_IOCTL, &info) &&
                 !strncmp(info.label, label, sizeof info.label);
    close(fd);
    return found;
}

static bool find_label(char out[GPIO_CHIP_PATH_SIZE], const char *label)
{
    DIR *dev = opendir("/dev");
    bool found = false;

    if (!dev)
        return false;
    for (struct dirent *e = readdir(dev); e && !found; e = readdir(dev)) {
        if (strncmp(e->d_name, "gpiochip", 8))
            continue;
        snprintf(out, GPIO_CHIP_PATH_SIZE, "/dev/%.100s", e->d_name);
        found = has_label(out, label);
    }
    closedir(dev);
    return found;
}

int gpio_chip_path(char out[GPIO_CHIP_PATH_SIZE], const char *chip, struct error *why)
{
    bool is_path = chip[0] == '/';
    int n = snprintf(out, GPIO_CHIP_PATH_SIZE, "%s%s", is_path ? "" : "/dev/", chip);

    if (!*chip)
        return error_say(why, -EINVAL,
                         "no chip is named; expected gpiod:/dev/gpiochip0?step=...");
    if (n < GPIO_CHIP_PATH_SIZE && !access(out, F_OK))
        return 0;
    if (!is_path && find_label(out, chip))
        return 0;
    return error_say(why, -ENOENT,
                     "there is no GPIO chip %s; 'gpiodetect' (package gpiod) lists those "
                     "that are there",
                     chip);
}

int gpio_chip_offset(const char *line)
{
    char *end;
    long offset = strtol(line, &end, 10);

    return *line >= '0' && *line <= '9' && !*end && offset < 1 << 16 ? (int)offset : -1;
}
