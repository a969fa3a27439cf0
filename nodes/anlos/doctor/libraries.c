#include "nodes/anlos/doctor/doctor.h"

#include <alsa/asoundlib.h>
#include <cairo.h>
#include <cyaml/cyaml.h>
#include <fftw3.h>
#include <lz4.h>
#include <protobuf-c/protobuf-c.h>
#include <sndfile.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zstd.h>

#include "msgs/topics.h"
#include "nodes/launcher/program.h"

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
        size_t used = strlen(missing);
        snprintf(missing + used, sizeof missing - used, "%sanlos-%s",
                 n_missing++ ? ", " : "", *node);
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
