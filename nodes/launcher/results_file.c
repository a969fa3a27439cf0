#include "nodes/launcher/results_file.h"

#include <errno.h>
#include <stdio.h>

int results_file_load(json_t **out, const char *folder, const char *name, char *path,
                      size_t size, struct complaint *why)
{
    json_error_t error;

    if (snprintf(path, size, "%s/%s", folder, name) >= (int)size)
        return complain(why, -EINVAL, "%s: the name is too long", folder);
    *out = json_load_file(path, 0, &error);
    if (*out)
        return 0;
    int err = json_error_code(&error) == json_error_cannot_open_file ? -ENOENT : -EINVAL;
    return complain(why, err, "%s: %s", path, error.text);
}
