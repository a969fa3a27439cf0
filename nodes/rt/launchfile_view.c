#include "nodes/rt/launchfile_view.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/place.h"

int launchfile_copy_view(struct launchfile *l, const struct launch_text *t,
                         struct error *why)
{
    unsigned port = t->view.port ? *t->view.port : 8765;

    if (port > 65535)
        return yaml_error_say(why, -EINVAL, l->path, "view.port",
                              "expected 0 (any) to 65535, not %u", port);
    l->view.port = port;
    l->view.address = strdup(t->view.address ? t->view.address : "127.0.0.1");
    l->view.bag = t->view.bag ? launchfile_beside(l, t->view.bag) : NULL;
    return l->view.address && (l->view.bag || !t->view.bag) ? 0 : -ENOMEM;
}

void launchfile_free_view(struct launchfile *l)
{
    free(l->view.address);
    free(l->view.bag);
}
