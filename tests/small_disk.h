/* SPDX-License-Identifier: MIT */
/* tests/small_disk.h -- a file system of 1 MB, for the calling process alone. */
#ifndef ANLOS_TESTS_SMALL_DISK_H
#define ANLOS_TESTS_SMALL_DISK_H

#include <errno.h>
#include <sched.h>
#include <stddef.h>
#include <sys/mount.h>

/* 0; -EPERM: that is not allowed here. */
static inline int small_disk_mount(const char *folder)
{
    if (unshare(CLONE_NEWNS) || mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) ||
        mount("tmpfs", folder, "tmpfs", 0, "size=1m"))
        return -errno;
    return 0;
}

#endif
