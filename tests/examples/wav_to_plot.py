#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""A folder of `anlos sim` or of a recording to a picture of what is hidden.

    wav_to_plot.py FOLDER OUT.png"""
import sys

import matplotlib.pyplot as plt
import numpy
from scipy.io import wavfile

import anlos

folder, out = sys.argv[1:]
survey = anlos.Survey.load(folder + "/survey.yaml")
pipeline = anlos.Pipeline(survey, method="fast", background="recorded", threads=2)
for kind in ("background", "scene"):
    for position in range(survey.positions):
        rate, sound = wavfile.read(f"{folder}/{kind}/pos{position:02d}.wav")
        for speaker, ping in zip(range(survey.speakers), survey.slots(sound)):
            pipeline.ping(ping, position=position, speaker=speaker,
                          background=kind == "background")
image = pipeline.image()
plt.pcolormesh(image.axis(0), image.axis(2), 20 * numpy.log10(image.intensity.max(1)))
plt.colorbar(label="dB")
plt.xlabel("x, m")
plt.ylabel("depth, m")
plt.savefig(out)
for o in pipeline.objects().objects:
    print(o.position_m, o.existence)
