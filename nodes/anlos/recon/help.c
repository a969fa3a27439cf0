#include "nodes/anlos/recon/help.h"

#include <errno.h>
#include <string.h>

#include "recon/imager_options.h"

#define COLUMN 23

static const char head[] =
    "anlos recon -- turn a recording into an image of what is hidden\n"
    "\n"
    "usage: anlos recon --survey FILE --wav DIR [--background DIR] --out DIR [options]\n"
    "       anlos recon --traces FILE.mat --volume ... --out DIR [options]\n"
    "       anlos recon --bag FILE.mcap --out DIR [options]\n"
    "       anlos recon --confocal FILE.mat --out DIR [--method lct|fk|backprojection]\n"
    "\n"
    "Reads one multichannel WAV for each stage position (in name order; slot j of a "
    "file\n"
    "is the emission of speaker j), compresses the chirps, images the scene behind the\n"
    "wall and lists the objects in it.  One process; no nodes need to run.\n"
    "\n"
    "  --survey FILE        geometry and timing of the recording (survey.yaml); with\n"
    "                       'pings: FILE.csv' any array and motion, ping by ping\n"
    "  --wav DIR            the recording\n"
    "  --background DIR     the same room without the hidden objects, subtracted with\n"
    "                       its phase; without it the room's own echoes stay in the\n"
    "                       image\n"
    "  --traces FILE.mat    in place of a recording: compressed traces (MATLAB v5,\n"
    "                       v7.3): traces [ping][sample] complex or real, tx_m and rx_m\n"
    "                       [ping][3], fs_hz, t0_s (of sample 0), fc_hz (carrier, or "
    "0),\n"
    "                       c_m_s; --survey may name volume, wall, mount and gate_m\n"
    "  --band-hz LOW,HIGH   of them: where the echoes are; by default what the file\n"
    "                       says (band_hz), or what stands out of the spectrum and is\n"
    "                       not as loud at all times, as noise is\n"
    "  --volume X,Y,Z       what to image, in place of the survey's: minimum, maximum\n"
    "                       and step of each axis in m, nine numbers with commas\n"
    "  --bag FILE.mcap      in place of a recording: a recorded scan (anlos bag record,\n"
    "                       import), by the same steps and to the same objects and CAN\n"
    "                       frames as when the nodes hear it; settings are those of the\n"
    "                       launch file in the bag and of the options below\n"
    "  --launch FILE        of a bag: these settings in place of those in the bag\n"
    "  --confocal FILE.mat  in place of sound: an optical confocal scan (MATLAB v5,\n"
    "                       v7.3): rect_data [place][place][time bin] photon counts,\n"
    "                       width (half the side, m), bin_s (4e-12 when missing);\n"
    "                       methods lct (default), fk, backprojection\n"
    "  --gate-m NEAR,FAR    of it, from the wall, m; by default from where the direct\n"
    "                       light has died away to the end\n"
    "  --out DIR            where the results go; made when missing\n"
    "  --method NAME        fast: moveout and f-k migration, for arrays on a regular\n"
    "                       grid (default); backprojection: any geometry, slower\n"
    "                       (default with pings and --traces); to compare: confocal,\n"
    "                       lct, paper, incoherent, iterative, sparse (README.md says\n"
    "                       what each is); auto: looks at the recording, chooses\n"
    "                       method, pairs, band, depth and steps, and says why (not\n"
    "                       of a bag, nor in a launch file)\n"
    "  --budget-ms N        auto: the time it may take, files not counted; it leaves "
    "out\n"
    "                       pairs and takes coarser steps to keep it\n"
    "  --error-cm X         auto: an error of positions that is good enough; the\n"
    "                       cheapest way that keeps it is taken\n"
    "  --set NAME=VALUE     an option of the method, see below; again for another one\n"
    "  --psf FILE           iterative: the point spread function as `anlos psf` "
    "measured\n"
    "                       it (psf.json); by default from the geometry\n"
    "  --threads N          1..256, default: one for each processor\n"
    "  --window NAME        of the spectrum: hann (default), hamming, rectangular\n"
    "                       (finer, with sidelobes in depth)\n"
    "  --compression NAME   matched_filter (default), deramp (the paper's)\n"
    "  --help               this text\n"
    "\n"
    "options of methods, with their defaults\n";

static const char tail[] =
    "iterative takes those of its base too.  With --confocal lct, snr_db is 3.\n"
    "\n"
    "files written, all or none\n"
    "  volume.nrrd          intensity, float32, x fastest, in metres (3D Slicer,\n"
    "                       ParaView)\n"
    "  projection_xy.png    the volume's maxima seen from the front; _xz from above,\n"
    "                       _yz from the side; crosses are the objects, as imaged\n"
    "  detections.json      the objects where they really are, with covariance\n"
    "  report.json          method and options, time and memory of each stage, pings,\n"
    "                       channels, warnings; of auto the plan: what was seen, what\n"
    "                       each way would take and how exact it would be, and why not\n"
    "  can.candump          of a bag: the frames of the lists of objects\n"
    "\n"
    "examples\n"
    "  anlos sim launch/scenes/corner.yaml --out /tmp/corner\n"
    "  anlos recon --survey /tmp/corner/survey.yaml --wav /tmp/corner/scene \\\n"
    "      --background /tmp/corner/background --out /tmp/corner/image\n"
    "  the same with --method iterative --set l1=0.02 --set tv=0.005\n"
    "  the same with --method auto --error-cm 0.5\n"
    "\n"
    "exit codes: 0 done; 1 failed (no memory, full disk); 2 bad arguments or input;\n"
    "130 stopped by Ctrl-C, nothing written\n";

void recon_help_settings(FILE *to)
{
    struct imager_options defaults;
    imager_options_default(&defaults);
    for (const struct imager_option *i = imager_option_table; i->name; i++) {
        char value[32], range[128];
        imager_option_value(i, &defaults, value, sizeof value);
        imager_option_range(i, range, sizeof range);
        if (i->kind == IMAGER_OPTION_METHOD)
            strcpy(range, "a method"); /* the list stands above */
        int used = fprintf(to, "  %s=%s", i->name, value);
        fprintf(to, "%*s%s\n%*s", used < COLUMN ? COLUMN - used : 1, "", i->help, COLUMN,
                "");
        for (const char *m = i->methods; *m; m += strlen(m) + 1)
            fprintf(to, "%s%s", m == i->methods ? "" : ", ", m);
        fprintf(to, "; %s\n", range);
    }
}

int recon_help_print(FILE *to)
{
    fputs(head, to);
    recon_help_settings(to);
    fputs(tail, to);
    return ferror(to) ? -EIO : 0;
}
