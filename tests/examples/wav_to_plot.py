#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""A folder of `anlos sim` or of a recording to a picture of what is hidden.

    wav_to_plot.py FOLDER OUT.png"""
import sys

import matplotlib.pyplot as plt
import numpy

import anlos

folder, out = sys.argv[1:]
recording = anlos.Recording(folder)
pipeline = anlos.Pipeline(recording.survey, method="fast", background="recorded", threads=2)
for ping in recording.pings():
    pipeline.ping(**ping)
image = pipeline.image()
level_db = 20 * numpy.log10(numpy.maximum(image.intensity.max(1) / image.intensity.max(), 1e-3))
plt.pcolormesh(image.axis(0), image.axis(2), level_db, vmin=-30)
plt.colorbar(label="dB")
plt.xlabel("x, m")
plt.ylabel("depth, m")
plt.savefig(out)
for o in pipeline.objects().objects:
    print(*o.position_m, o.existence)
