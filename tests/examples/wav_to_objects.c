/* SPDX-License-Identifier: MIT */
/* A folder of WAV files to a table of hidden objects.  posNN.wav: a file for each stage
 * position, a channel for each microphone, a slot for each speaker, as `anlos sim` writes
 * them.  The array is that of launch/scenes/point.yaml. */
#include <anlos/anlos.h>
#include <sndfile.h>
#include <stdio.h>

enum { POSITIONS = 6, SPEAKERS = 4, MICS = 4, SLOT = 1500, PING = 3000, FRAMES = 7500 };
static const double speakers[] = {0, 0, 0, 0, .08, 0, 0, .16, 0, 0, .24, 0};
static const double mics[] = {.04, 0, 0, .04, .08, 0, .04, .16, 0, .04, .24, 0};
static const double stage[] = {0, .04, .08, .12, .16, .2}, origin[] = {0, 0, .3};
static const double x[] = {1, 0, 0}, y[] = {0, 1, 0}, z[] = {0, 0, 1};
static const double image[][3] = {{.02, .24, .02}, {0, .22, .02}, {.9, 1.5, .01}};
static float file[FRAMES][MICS], samples[MICS][PING];

int main(int argc, char **argv)
{
    struct anlos_ping ping = {.size = sizeof ping, .n_microphones = MICS};
    struct anlos_object o = {.size = sizeof o};
    struct anlos_error why = {0, "expected a folder"};
    struct anlos_config cfg;
    struct anlos_pipeline *p = NULL;
    struct anlos_survey *s = NULL;
    SF_INFO info = {.format = 0};

    anlos_config_init(&cfg);
    int err = argc != 2 || anlos_survey_create(&s, &why) ||
              anlos_survey_speakers(s, speakers, SPEAKERS, &why) ||
              anlos_survey_microphones(s, mics, MICS, &why) ||
              anlos_survey_stage(s, x, stage, POSITIONS, &why) ||
              anlos_survey_chirp(s, 2000, 20000, .03125, false, &why) ||
              anlos_survey_sampling(s, 48000, SLOT, 0, &why) ||
              anlos_survey_sound_speed(s, 343, &why) ||
              anlos_survey_volume(s, image[0], image[1], image[2], &why) ||
              anlos_survey_add_wall(s, z, .8, 0, 0, &why) ||
              anlos_survey_mount(s, origin, y, z, &why) || /* it looks ahead */
              anlos_pipeline_create(&p, &cfg, s, &why);
    ping.n_samples = PING;
    ping.samples = samples[0];
    for (; !err && ping.position < POSITIONS; ping.position++) {
        snprintf(why.text, sizeof why.text, "%s/pos%02u.wav", argv[1], ping.position);
        SNDFILE *f = sf_open(why.text, SFM_READ, &info);
        err = !f || info.channels != MICS || sf_readf_float(f, file[0], FRAMES) <= 0;
        for (ping.speaker = 0; !err && ping.speaker < SPEAKERS; ping.speaker++) {
            for (size_t i = 0; i < PING * MICS; i++)
                samples[i % MICS][i / MICS] =
                    file[ping.speaker * SLOT + i / MICS][i % MICS];
            err = anlos_pipeline_ping(p, &ping, &why) < 0; /* over 0: there is news */
        }
        sf_close(f);
    }
    for (size_t i = 0; !err && !anlos_pipeline_object(p, i, &o, &why); i++)
        printf("%.3f %.3f %.3f m\n", o.position_m[0], o.position_m[1], o.position_m[2]);
    if (err)
        fprintf(stderr, "wav_to_objects: %s\n", why.text);
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
    return err;
}
