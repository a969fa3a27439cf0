#include "nodes/track/detector.h"

#include <errno.h>
#include <float.h>

#include "nodes/rt/objects.h"
#include "nodes/rt/volume_grid.h"

void detector_init(struct detector *d, const struct detector_config *cfg)
{
    *d = (struct detector){.cfg = *cfg};
}

int detector_survey(struct detector *d, const Anlos__Survey *survey,
                    struct complaint *why)
{
    struct survey fresh;

    if (d->has_survey && d->survey_id == survey->id)
        return 0;
    int err = survey_from_message(&fresh, survey, why);
    if (err)
        return err;
    survey_clear(&d->survey);
    d->survey = fresh;
    d->survey_id = survey->id;
    d->has_survey = true;
    return 0;
}

static bool is_image(const struct grid *grid, const float *intensity)
{
    for (size_t i = 0; i < grid_size(grid); i++)
        if (!(intensity[i] >= 0.0f && intensity[i] <= FLT_MAX))
            return false;
    return true;
}

int detector_volume(struct detector *d, const Anlos__Volume *volume,
                    Anlos__DetectionList **out, struct complaint *why)
{
    struct detect_config cfg;
    struct grid grid;
    const float *intensity = volume_grid(volume, &grid);

    if (!d->has_survey || volume->survey_id != d->survey_id)
        return complain(why, -EAGAIN, "the survey of a volume is not known yet");
    if (!intensity || !is_image(&grid, intensity))
        return complain(why, -EINVAL,
                        "a volume without a grid or with intensities that "
                        "are not numbers");
    detect_config_default(&cfg);
    cfg.threshold_db = d->cfg.threshold_db;
    int err = objects_find(out, &d->survey, &cfg, d->cfg.min_existence, &grid, intensity);
    if (err)
        return complain(why, err, "not enough memory to detect objects");
    (*out)->scan = volume->scan;
    (*out)->preview = volume->preview;
    (*out)->counter = d->counter++;
    return 0;
}

void detector_clear(struct detector *d)
{
    survey_clear(&d->survey);
    d->has_survey = false;
}
