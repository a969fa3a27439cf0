#include "hal/recording/wav_open.h"

#include <errno.h>
#include <stdbool.h>
#include <string.h>

#include "hal/recording/riff.h"

static bool is_linear(unsigned format)
{
    return format == RIFF_PCM || format == RIFF_FLOAT || format == RIFF_EXTENSIBLE;
}

/* What a file with the extensible format names in its own way. */
static bool has_linear_samples(const SF_INFO *info)
{
    switch (info->format & SF_FORMAT_SUBMASK) {
    case SF_FORMAT_PCM_S8:
    case SF_FORMAT_PCM_U8:
    case SF_FORMAT_PCM_16:
    case SF_FORMAT_PCM_24:
    case SF_FORMAT_PCM_32:
    case SF_FORMAT_FLOAT:
    case SF_FORMAT_DOUBLE:
        return true;
    default:
        return false;
    }
}

int wav_complain(struct complaint *why, int err, const char *path)
{
    if (err == -ESPIPE)
        return complain(why, -EINVAL, "%s: is no file; expected a WAV file", path);
    return complain(why, err, "%s: %s", path,
                    err == -EINVAL ? "no WAV file" : strerror(-err));
}

int wav_open(SNDFILE **out, SF_INFO *info, const char *path, struct complaint *why)
{
    unsigned format;

    *out = NULL;
    *info = (SF_INFO){.format = 0};
    int err = riff_format(path, &format);
    if (err)
        return wav_complain(why, err, path);
    if (!is_linear(format))
        return complain(why, -EINVAL,
                        "%s: a WAV file of format %u; expected PCM or float samples",
                        path, format);
    *out = sf_open(path, SFM_READ, info);
    if (!*out)
        return complain(why, -EINVAL, "%s: no WAV file: %s", path, sf_strerror(NULL));
    if (has_linear_samples(info))
        return 0;
    sf_close(*out);
    *out = NULL;
    return complain(why, -EINVAL, "%s: expected a WAV file of PCM or float samples",
                    path);
}
