#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""The Python module: the same bytes as the command line, and clear words for what is wrong.

    check_python.py ANLOS SCENE.yaml     with ANLOS_LIBRARY, PYTHONPATH

SCENE.yaml is launch/scenes/point.yaml: one point, whose place is in truth.json."""
import json
import os
import subprocess
import sys
import tempfile
import unittest

import numpy
from scipy.io import wavfile

import anlos

PROGRAM, SCENE = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])


def run(*words):
    subprocess.run([PROGRAM, *words], check=True, stdout=subprocess.DEVNULL)


def wav(path):
    """float32 [sample][channel]; the chunk with the peaks is not of interest."""
    return wavfile.read(path)[1]


class Recorded(unittest.TestCase):
    """What a recording gives by way of the module and of the program."""

    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="anlos-python-")
        at = cls.scratch.name
        run("sim", SCENE, "--out", at)
        run("bag", "import", at + "/scene", "--survey", at + "/survey.yaml", "--background",
            at + "/background", "-o", at + "/scan.mcap")
        run("recon", "--bag", at + "/scan.mcap", "--out", at + "/image", "--method", "fast",
            "--threads", "2")
        cls.survey = anlos.Survey.load(at + "/survey.yaml")
        cls.pipeline = anlos.Pipeline(cls.survey, method="fast", background="recorded",
                                      threads=2)
        for folder in ("background", "scene"):
            for position in range(cls.survey.positions):
                sound = wav(f"{at}/{folder}/pos{position:02d}.wav")
                for speaker, ping in zip(range(4), cls.survey.slots(sound)):
                    cls.news = cls.pipeline.ping(ping, position=position, speaker=speaker,
                                                 background=folder == "background")

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def test_the_image_has_the_bytes_of_the_command_line(self):
        with open(self.scratch.name + "/image/volume.nrrd", "rb") as f:
            data = f.read().split(b"\n\n", 1)[1]
        self.assertEqual(self.pipeline.image().intensity.tobytes(), data)

    def test_the_object_is_where_it_is(self):
        with open(self.scratch.name + "/truth.json", encoding="utf-8") as f:
            truth = json.load(f)["objects"]
        self.assertEqual(len(truth), 1)
        found = self.pipeline.objects()
        self.assertEqual(len(found.objects), 1)
        self.assertTrue(found.in_vehicle_frame and found.mirrored)
        o = found.objects[0]
        x, y, z = truth[0]["position_m"]  # the array's frame; it looks ahead, 0.3 m up
        off = o.position_m - numpy.array([z, x, 0.3 + y])
        self.assertLess(numpy.linalg.norm(off), 0.005)
        self.assertGreater(o.existence, 0.9)

    def test_the_last_ping_brings_image_and_objects(self):
        self.assertEqual(self.news, anlos.News.IMAGE | anlos.News.OBJECTS)
        self.assertEqual(self.pipeline.health()["pings"], 48)

    def test_axes_begin_and_end_as_the_survey_says(self):
        z = self.pipeline.image().axis(2)
        self.assertAlmostEqual(z[0], 0.9)
        self.assertAlmostEqual(z[-1], 1.5)

    def test_the_wall_is_the_surveys(self):
        wall, = self.pipeline.walls()
        numpy.testing.assert_array_equal(wall.normal, [0, 0, 1])
        self.assertEqual(wall.distance_m, 0.8)


class Wrong(unittest.TestCase):
    """What cannot be is refused, and said."""

    def setUp(self):
        place = [[0, 0.1 * i, 0] for i in range(4)]
        self.survey = anlos.Survey(place, place, chirp=(2000, 20000, 0.03))
        self.pipeline = anlos.Pipeline(self.survey)
        self.sound = numpy.zeros((4, self.survey.ping_samples), numpy.float32)

    def refused(self, error, text, call, *arguments, **more):
        with self.assertRaisesRegex(error, text):
            call(*arguments, **more)

    def test_arrays_of_another_type_shape_or_order(self):
        ping = self.pipeline.ping
        self.refused(TypeError, "float32, not float64", ping, self.sound.astype(float))
        self.refused(TypeError, "float32, not list", ping, [[0.0]])
        self.refused(ValueError, "2 dimensions, not 1", ping, self.sound[0])
        self.refused(ValueError, "C order", ping, numpy.asfortranarray(self.sound))
        self.refused(anlos.Error, "microphone", ping, self.sound[:3])
        self.refused(anlos.Error, "sample", ping, numpy.ascontiguousarray(self.sound[:, :100]))
        self.assertEqual(self.pipeline.health()["pings"], 0)

    def test_pings_that_are_not_of_the_survey(self):
        self.refused(anlos.Error, "speaker", self.pipeline.ping, self.sound, speaker=4)
        self.refused(anlos.Error, "survey", self.pipeline.ping, self.sound, survey=1)

    def test_names_that_are_not_known(self):
        self.refused(TypeError, "colour", self.pipeline.ping, self.sound, colour=1)
        self.refused(TypeError, "colour", anlos.Pipeline, self.survey, colour=1)
        self.refused(ValueError, "scan, static", anlos.Pipeline, self.survey, "moving")
        self.refused(anlos.Error, "method", anlos.Pipeline, self.survey, method="guess")

    def test_surveys_that_cannot_be(self):
        with self.assertRaises(anlos.Error) as caught:
            anlos.Survey([[0, 0, float("nan")]], [[0, 0, 0]]).check()
        self.assertIn("speaker", str(caught.exception))
        self.refused(ValueError, "expected 3", anlos.Survey, [[0, 0, 0]], [[0, 0, 0]],
                     walls=[([0, 1], 1.0)])

    def test_nothing_before_a_ping(self):
        for ask in (self.pipeline.image, self.pipeline.objects):
            with self.assertRaises(anlos.Error) as caught:
                ask()
            self.assertEqual(caught.exception.what, "not ready")
            self.assertTrue(str(caught.exception))
        self.assertEqual(self.pipeline.note(), "")

    def test_a_folder_of_no_survey(self):
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as f:
            f.write("speakers_m: []\ncolour: red\n")
            f.flush()
            self.refused(ValueError, "colour", anlos.Survey.load, f.name)


class Told(unittest.TestCase):
    """What the library says of itself."""

    def test_methods_and_options(self):
        self.assertIn("fast", anlos.methods())
        self.assertIn("iterative", anlos.options()["l1"][1])

    def test_the_emission_is_the_chirp(self):
        survey = anlos.Survey([[0, 0, 0]], [[0, 0.1, 0]], chirp=(2000, 20000, 0.0625))
        x = survey.emission()
        self.assertEqual(x.size, 3000)
        t = numpy.arange(3000) / 48000  # Lindell 2019, Eq. 5
        want = numpy.cos(2 * numpy.pi * (2000 * t + 18000 / (2 * 0.0625) * t * t))
        numpy.testing.assert_allclose(x, want, atol=1e-3)


unittest.main(argv=[sys.argv[0], "-v"])
