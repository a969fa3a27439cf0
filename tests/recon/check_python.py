#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""The Python module: the same bytes as the command line, and clear words for what is wrong.

    check_python.py ANLOS SCENE.yaml     with ANLOS_LIBRARY, PYTHONPATH

SCENE.yaml is launch/scenes/point.yaml: one point, whose place is in truth.json."""
import csv
import json
import os
import struct
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

    def test_a_list_says_which_floor_it_can_tell_of(self):
        area, = self.pipeline.objects().areas
        z = self.pipeline.image().axis(2)
        self.assertEqual(area.wall, 1)
        self.assertEqual(area.corners_m.shape[1], 2)
        self.assertAlmostEqual(area.corners_m[:, 0].max(), 2 * 0.8 - z[0])  # ahead

    def test_the_wall_is_the_surveys(self):
        wall, = self.pipeline.walls()
        numpy.testing.assert_array_equal(wall.normal, [0, 0, 1])
        self.assertEqual(wall.distance_m, 0.8)


class Simulated(unittest.TestCase):
    """A scene of the simulator, with curves of its microphones, from its file to its objects."""

    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="anlos-python-")
        at = cls.scratch.name + "/corner"
        cls.recording = anlos.simulate(os.path.dirname(SCENE) + "/corner.yaml", at, threads=2,
                                       program=PROGRAM)
        cls.pipeline = anlos.Pipeline(cls.recording.survey, method="fast",
                                      background="recorded", threads=2)
        cls.pings = 0
        for ping in cls.recording.pings():
            cls.pipeline.ping(**ping)
            cls.pings += 1

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def test_the_image_has_the_bytes_of_the_command_line(self):
        self.assertEqual(self.pings, 2 * 32 * 16)
        at = self.recording.folder
        self.assertTrue(os.path.isdir(at + "/calibration"))
        run("bag", "import", at + "/scene", "--survey", at + "/survey.yaml", "--background",
            at + "/background", "-o", at + "/scan.mcap")
        run("recon", "--bag", at + "/scan.mcap", "--out", at + "/image", "--method", "fast",
            "--threads", "2")
        with open(at + "/image/volume.nrrd", "rb") as f:
            data = f.read().split(b"\n\n", 1)[1]
        self.assertEqual(self.pipeline.image().intensity.tobytes(), data)

    def test_the_objects_are_where_the_scene_has_them(self):
        found = [o.position_m for o in self.pipeline.objects().objects]
        self.assertEqual(len(found), 3)
        for o in self.recording.objects:
            off = min(numpy.linalg.norm(p - o["vehicle_m"]) for p in found)
            self.assertLess(off, 0.02, o["name"])

    def test_what_cannot_be_simulated_says_why(self):
        at = self.recording.folder
        for error, text, scene, folder in (
                (ValueError, "nowhere.yaml", at + "/nowhere.yaml", at + "/new"),
                (ValueError, "exists already", SCENE, at)):
            with self.assertRaisesRegex(error, text):
                anlos.simulate(scene, folder, program=PROGRAM)

    def test_keys_of_a_survey_that_are_not_taken_are_refused(self):
        with open(self.recording.folder + "/survey.yaml", encoding="utf-8") as f:
            whole = f.read()
        axis = "  axis: [1, 0, 0]\n"
        self.assertIn(axis, whole)
        for more, text in (("  continuous: true\n", "stage.continuous"),
                           ("pings: p.csv\n", "pings"), ("", None)):
            name = self.scratch.name + "/survey.yaml"
            with open(name, "w", encoding="utf-8") as f:
                f.write(whole.replace(axis, axis + more) if more.startswith(" ") else whole + more)
            with self.assertRaisesRegex(ValueError if text else OSError, text or "sim00.txt"):
                anlos.Survey.load(name)
        os.mkdir(self.scratch.name + "/calibration")
        with open(self.scratch.name + "/calibration/sim00.txt", "w", encoding="utf-8") as f:
            f.write('"SERNO: sim00"\n20 0.5\nrain\n')
        with self.assertRaisesRegex(ValueError, "sim00.txt:3: expected a frequency"):
            anlos.Survey.load(name)

    def test_chirps_that_alternate_and_walls_with_gates_are_taken(self):
        """As their survey of the C library says it, by the same id."""
        name = self.scratch.name + "/plain.yaml"
        with open(name, "w", encoding="utf-8") as f:
            f.write("sound_speed_m_s: 343\nsample_rate_hz: 48000\nslot_samples: 1500\n"
                    "together: 2\nspeakers_m: [[0, 0, 0], [0, 0.1, 0]]\n"
                    "microphones_m: [[0, 0.2, 0]]\n"
                    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03, alternates: true}\n"
                    "walls:\n  - {normal: [0, 0, 1], distance_m: 1, gate_m: [1, 3]}\n"
                    "  - {normal: [1, 0, 0], distance_m: 2, gate_m: [3, 5]}\n")
        same = {"chirp": (2000, 20000, 0.03), "slot_samples": 1500, "sound_speed_m_s": 343}
        places = [[0, 0, 0], [0, 0.1, 0]], [[0, 0.2, 0]]
        walls = [([0, 0, 1], 1, 1, 3), ([1, 0, 0], 2, 3, 5)]
        loaded = anlos.Survey.load(name)
        self.assertEqual(loaded.id, anlos.Survey(*places, alternates=True, together=2,
                                                 walls=walls, **same).id)
        for other in ({"together": 2, "walls": walls}, {"alternates": True, "walls": walls},
                      {"alternates": True, "together": 2, "walls": walls[:1]}):
            self.assertNotEqual(loaded.id, anlos.Survey(*places, **other, **same).id)


    def test_walls_end_where_the_file_says_it(self):
        name = self.scratch.name + "/ends.yaml"
        text = ("sound_speed_m_s: 343\nsample_rate_hz: 48000\nslot_samples: 1500\n"
                "speakers_m: [[0, 0, 0]]\nmicrophones_m: [[0, 0.2, 0]]\n"
                "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03}\n")
        one = "wall: {normal: [0, 0, 1], distance_m: 1, ends_m: [[-0.5, 1], [2, 1]]}\n"
        two = ("walls:\n  - {normal: [0, 0, 1], distance_m: 1, gate_m: [1, 3]}\n"
               "  - {normal: [0, 0, 1], distance_m: 1, gate_m: [1, 3], "
               "ends_m: [[2, 1], [-0.5, 1]]}\n")
        same = {"chirp": (2000, 20000, 0.03), "slot_samples": 1500, "sound_speed_m_s": 343}
        places, z, ends = ([[0, 0, 0]], [[0, 0.2, 0]]), [0, 0, 1], [[-0.5, 1], [2, 1]]
        for said, walls in ((one, [(z, 1, 0, 0, ends)]),
                            (two, [(z, 1, 1, 3), (z, 1, 1, 3, ends)])):
            with open(name, "w", encoding="utf-8") as f:
                f.write(text + said)
            loaded = anlos.Survey.load(name)
            self.assertEqual(loaded.id, anlos.Survey(*places, walls=walls, **same).id)
            endless = [w[:4] for w in walls]
            self.assertNotEqual(loaded.id, anlos.Survey(*places, walls=endless, **same).id)
        wall, = anlos.Pipeline(anlos.Survey.load(name), method="fast").walls()[1:]
        numpy.testing.assert_allclose(numpy.abs(wall.ends_m), [2, 0.5])


class Stages(unittest.TestCase):
    """One after the other they give what the pipeline gives."""

    def assert_same(self, one, other):
        """Fields of two dataclasses, to the bit."""
        def flat(record):
            values = dict(vars(record))
            facts = values.pop("facts", {})
            return {**values, **facts}

        one, other = flat(one), flat(other)
        self.assertEqual(one.keys(), other.keys())
        for name, value in one.items():
            numpy.testing.assert_array_equal(value, other[name], name)

    @staticmethod
    def heard(survey, speaker, microphones, point):
        """One ping: at each microphone a chirp, late by the way by the point."""
        chirp = survey.emission()
        ping = numpy.zeros((len(microphones), survey.ping_samples), numpy.float32)
        for heard, at in zip(ping, microphones):
            way = sum(numpy.linalg.norm(numpy.subtract(point, end)) for end in (speaker, at))
            first = round(way / 343.0 * 48000)
            heard[first:first + len(chirp)] += 0.05 * chirp
        return ping

    def test_an_image_is_stopped(self):
        answer = []

        def stop():
            if answer == ["raise"]:
                raise KeyboardInterrupt
            return bool(answer)

        column = [0.08 * i for i in range(4)]
        survey = anlos.Survey([[0, 0, 0]], [[0.04, y, 0] for y in column],
                              stage=([1, 0, 0], [0, 0.04]), sound_speed_m_s=343,
                              chirp=(2000, 20000, 0.03125),
                              volume_m=[(0.02, 0.24, 0.02), (0, 0.22, 0.02), (0.9, 1.5, 0.01)])
        ping = self.heard(survey, (0, 0, 0), [(0.04, m, 0) for m in column], (0.13, 0.11, 1.2))
        imager = anlos.Imager(survey, method="backprojection", stop=stop)
        imager.add(anlos.Compressor(survey).ping(ping, position=0, speaker=0))
        whole = imager.image()
        answer.append(True)
        with self.assertRaisesRegex(anlos.Error, "stopped") as caught:
            imager.image()
        self.assertEqual(caught.exception.code, -9)
        with self.assertRaisesRegex(anlos.Error, "stopped"):
            anlos.Imager(survey, method="backprojection", stop=stop)
        answer[:] = ["raise"]
        with self.assertRaises(KeyboardInterrupt):
            imager.image()
        answer.clear()
        self.assert_same(imager.image(), whole)

    def test_a_scan(self):
        stage, column = [0.04 * i for i in range(6)], [0.08 * i for i in range(4)]
        survey = anlos.Survey([[0, y, 0] for y in column], [[0.04, y, 0] for y in column],
                              stage=([1, 0, 0], stage), sound_speed_m_s=343,
                              chirp=(2000, 20000, 0.03125), walls=[([0, 0, 1], 0.8)],
                              volume_m=[(0.02, 0.24, 0.02), (0, 0.22, 0.02), (0.9, 1.5, 0.01)])
        pipeline, compressor = anlos.Pipeline(survey), anlos.Compressor(survey)
        imager, detector = anlos.Imager(survey), anlos.Detector(survey)
        for ask in (imager.image, detector.objects):
            with self.assertRaisesRegex(anlos.Error, "."):
                ask()
        last = False
        for i, x, j, y in ((i, x, j, y) for i, x in enumerate(stage) for j, y in enumerate(column)):
            self.assertFalse(last)
            ping = self.heard(survey, (x, y, 0), [(x + 0.04, m, 0) for m in column],
                              (0.13, 0.11, 1.2))
            pipeline.ping(ping, position=i, speaker=j)
            traces = compressor.ping(ping, position=i, speaker=j)
            self.assertEqual(traces.samples.shape[0], 4)
            self.assertFalse(traces.masked.any())
            last = imager.add(traces)
        self.assertTrue(last)
        image = imager.image()
        self.assert_same(image, pipeline.image())
        for walls in (None, pipeline.walls(), [vars(w) for w in pipeline.walls()]):
            detector.image(image, walls)
            found, of_pipeline = detector.objects(), pipeline.objects()
            self.assertEqual(len(found.objects), 1)
            self.assert_same(found.objects[0], of_pipeline.objects[0])
        off = found.objects[0].position_m - (0.13, 0.11, 0.4)  # the wall at 0.8 mirrors 1.2
        self.assertLess(numpy.linalg.norm(off), 0.01)
        with self.assertRaisesRegex(TypeError, "complex64, not float32"):
            imager.add(anlos.Traces(traces.samples.real.copy(), traces.masked, traces.facts))
        with self.assertRaisesRegex(ValueError, "masked: expected 4, not 3"):
            imager.add(anlos.Traces(traces.samples, traces.masked[:3], traces.facts))
        with self.assertRaisesRegex(TypeError, "colour: no such field of struct anlos_traces"):
            imager.add(anlos.Traces(traces.samples, traces.masked,
                                    {**traces.facts, "colour": 1}))
        with self.assertRaisesRegex(ValueError, "intensity: expected rows"):
            detector.image(anlos.Image(image.intensity.T, image.origin_m, image.step_m,
                                       image.facts))
        with self.assertRaisesRegex(ValueError, "beyond: expected 4 numbers a place, not 3"):
            detector.image(anlos.Image(image.intensity, image.origin_m, image.step_m,
                                       {**image.facts, "beyond": numpy.zeros((2, 3), "f4")}))
        with self.assertRaisesRegex(ValueError, "movers: expected 7 numbers a mover, not 6"):
            detector.image(anlos.Image(image.intensity, image.origin_m, image.step_m,
                                       {**image.facts, "movers": numpy.zeros((2, 6), "f4")}))
        with self.assertRaisesRegex(ValueError, "ambiguous: expected 7 numbers a mover, not 6"):
            detector.image(anlos.Image(image.intensity, image.origin_m, image.step_m,
                                       {**image.facts, "ambiguous": numpy.zeros((2, 6), "f4")}))
        with self.assertRaisesRegex(ValueError, "courses: expected 8 numbers a course, not 7"):
            detector.image(anlos.Image(image.intensity, image.origin_m, image.step_m,
                                       {**image.facts, "courses": numpy.zeros((2, 7), "f4")}))

    def row(self):
        """It looks ahead, from half a metre above the ground."""
        speakers = [[0.12 * i, 0, 0] for i in range(4)]
        microphones = [[x + 0.06, 0.03, 0] for x, _, _ in speakers]
        return speakers, microphones, anlos.Survey(
            speakers, microphones, sound_speed_m_s=343, chirp=(2000, 20000, 0.03125),
            volume_m=[(-0.4, 1, 0.02), (0, 0, 1), (0.9, 1.6, 0.01)],
            mount=([0, 0, 0.5], [0, 1, 0], [0, 0, 1]))

    def test_a_static_array(self):
        speakers, microphones, survey = self.row()
        how = {"background": "none", "false_alarm_rate": 0, "lost_s": 100}
        pipeline = anlos.Pipeline(survey, array="static", **how)
        compressor = anlos.Compressor(survey, array="static", **how)
        array, tracker = anlos.StaticArray(survey, **how), anlos.Tracker(survey, **how)
        wall = {"id": 1, "normal": [0, 0, 1], "distance_m": 0.8, "existence": 1}
        second = 1_000_000_000
        pipeline.give_walls([wall], second)
        for stage in (array, tracker):
            stage.walls([wall], second)
        for stage in (pipeline, compressor, array, tracker):
            stage.ego(0, 0, second)
        found = 0
        for k in range(48):
            at = (0.2, 0, 1.5 - 0.3 * k / 32)  # comes nearer
            ping = self.heard(survey, speakers[k % 4], microphones, at)
            now = {"speaker": k % 4, "capture_ns": second + k * second // 32}
            news = pipeline.ping(ping, **now)
            due = array.add(compressor.ping(ping, **now))
            self.assertEqual(bool(news & anlos.News.IMAGE), due)
            if due:
                image = array.image()
                self.assert_same(image, pipeline.image())
                tracker.image(image)
                mine, whole = tracker.objects(), pipeline.objects()
                self.assertEqual(len(mine.objects), len(whole.objects))
                for one, other in zip(mine.objects, whole.objects):
                    self.assert_same(one, other)
                    found += 1
        self.assertGreater(found, 0)
        with self.assertRaises(anlos.Error) as caught:
            tracker.image(image)
        self.assertEqual(caught.exception.what, "too old")

    def test_a_wall_is_found_where_it_is(self):
        speakers, microphones, survey = self.row()
        finder = anlos.WallFinder(survey, walls="heard", background="none")
        lists = 0
        for k in range(100):  # 3 s
            x, y, _ = speakers[k % 4]
            ping = numpy.zeros((4, survey.ping_samples), numpy.float32)
            chirp = survey.emission()
            for heard, at in zip(ping, microphones):  # from the image source behind the wall
                first = round(numpy.linalg.norm(numpy.subtract(at, (x, y, 2.2))) / 343 * 48000)
                heard[first:first + len(chirp)] += 0.05 * chirp
            lists += finder.ping(ping, speaker=k % 4,
                                 capture_ns=10**9 + k * 10**9 // 32)
        self.assertGreater(lists, 1)
        wall, = finder.walls()
        self.assertLess(abs(wall.distance_m - 1.1), 0.005)
        given = anlos.WallFinder(survey, walls="given")
        self.assertTrue(given.given([{"id": 9, "normal": [1, 0, 0], "distance_m": 2.0,
                                      "existence": 1.0}], 10**9))
        self.assertEqual([w.id for w in given.walls()], [9])


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


class Bags(unittest.TestCase):
    """What a bag holds, against the recording it was made of and what the program reads."""

    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="anlos-python-")
        at = cls.at = cls.scratch.name
        run("sim", SCENE, "--out", at)
        for how in ("zstd", "lz4", "none"):
            run("bag", "import", at + "/scene", "--survey", at + "/survey.yaml", "--background",
                at + "/background", "-o", f"{at}/{how}.mcap", "--compression", how)
        run("bag", "filter", at + "/zstd.mcap", "-o", at + "/shuffled.mcap", "--shuffle")
        run("recon", "--bag", at + "/zstd.mcap", "--out", at + "/image", "--record")
        cls.lists = anlos.Bag(at + "/image/lists.mcap")

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def test_pings_are_the_sound_of_the_recording_however_it_is_packed(self):
        survey = anlos.Survey.load(self.at + "/survey.yaml")
        for how in ("zstd", "lz4", "none", "shuffled"):
            bag = anlos.Bag(f"{self.at}/{how}.mcap")
            self.assertEqual(bag.topics["ping"], 48)  # the background first
            pings = list(bag.messages("ping"))
            for i, ping in enumerate(pings):
                folder = "background" if i < 24 else "scene"
                self.assertEqual(ping.pass_, folder.upper())
                sound = wav(f"{self.at}/{folder}/pos{ping.position:02d}.wav")
                expected = list(survey.slots(sound))[ping.speaker]
                self.assertEqual(ping.samples.dtype, numpy.float32)
                numpy.testing.assert_array_equal(ping.samples[:, :expected.shape[1]], expected)
            times = [p.publish_ns for p in bag.messages()]
            self.assertEqual(times, sorted(times))
            self.assertEqual(len(times), sum(bag.topics.values()))

    def test_places_are_arrays(self):
        survey = next(self.lists.messages("survey"))
        self.assertEqual(survey.microphones_m.shape, (4, 3))
        self.assertEqual(survey.stage_positions_m.shape, (len(survey.stage_positions_m),))
        self.assertIsNone(survey.capture_ns)

    def test_a_table_has_what_the_program_exports(self):
        run("bag", "export", self.at + "/image/lists.mcap", "--format", "csv", "-o",
            self.at + "/lists.csv")
        with open(self.at + "/lists.csv", encoding="utf-8") as f:
            rows = list(csv.DictReader(f))
        table = self.lists.table("detections", "detections")
        self.assertEqual(len(table), len(rows))
        self.assertGreater(len(rows), 0)
        for row, line in zip(table, rows):
            for a, axis in enumerate("xyz"):
                self.assertAlmostEqual(row["position_m"][a], float(line[axis + "_m"]), places=5)
            self.assertAlmostEqual(row["existence"], float(line["existence"]), places=5)
            self.assertEqual(row["covariance_m2"].shape, (6,))
        whole = self.lists.table("detections")
        self.assertEqual(len(whole), self.lists.topics["detections"])
        self.assertTrue(whole["in_vehicle_frame"].all())

    def test_what_is_not_there_is_named_with_what_is(self):
        with self.assertRaisesRegex(KeyError, "no topic pong; it has survey"):
            self.lists.messages("pong")
        with self.assertRaisesRegex(AttributeError, "Survey has no colour; it has "):
            print(next(self.lists.messages("survey")).colour)

    def test_what_is_no_bag_or_damaged_is_refused(self):
        with open(self.at + "/none.mcap", "rb") as f:
            good = bytearray(f.read())
        bad = self.at + "/bad.mcap"

        def refused(data, text, ask=anlos.Bag):
            with open(bad, "wb") as f:
                f.write(data)
            with self.assertRaisesRegex(ValueError, text):
                ask(bad)

        refused(b"", "no bag")
        refused(b"x" * 1000, "no bag")
        refused(good[:-40], "was not ended; anlos bag recover")
        flipped = bytearray(good)
        flipped[len(good) // 2] ^= 1
        refused(flipped, "a chunk is damaged; see anlos bag check",
                lambda path: list(anlos.Bag(path).messages()))


def foreign_bag(chunked, channels=True, statistics=True, indexed=False):
    """A bag (MCAP) of another program: two messages in JSON, the later one first."""
    def record(code, layout, *values, rest=b""):
        body = struct.pack("<" + layout, *values) + rest
        return struct.pack("<BQ", code, len(body)) + body

    def text(t):
        return struct.pack("<I", len(t)) + t

    magic = b"\x89MCAP0\r\n"
    schema = record(3, "H", 1, rest=text(b"Thing") + text(b"jsonschema") + text(b"{}"))
    channel = record(4, "HH", 1, 1, rest=text(b"thing") + text(b"json") + text(b""))
    data = (schema + channel + record(5, "HIQQ", 1, 0, 20, 20, rest=b'{"n":2}')
            + record(5, "HIQQ", 1, 1, 10, 10, rest=b'{"n":1}'))
    index = b""
    begin = magic + record(1, "II", 0, 0)
    if chunked:
        data = record(6, "QQQI", 10, 20, len(data), 0,
                      rest=text(b"") + struct.pack("<Q", len(data)) + data)
        of_chunk = struct.pack("<HQ", 1, 0) if indexed else b""
        index = record(8, "QQQQ", 10, 20, len(begin), len(data),
                       rest=text(of_chunk) + struct.pack("<Q", 0) + text(b"")
                       + struct.pack("<QQ", len(data), len(data)))
    if channels:
        index += schema + channel
    if statistics:
        index += record(11, "QHIIIIQQ", 2, 1, 1, 0, 0, int(chunked), 10, 20,
                        rest=struct.pack("<IHQ", 10, 1, 2))
    begin += data + record(15, "I", 0)
    return begin + index + record(2, "QQI", len(begin) if index else 0, 0, 0) + magic


class ForeignBags(unittest.TestCase):
    """Messages are there in the order of their times, or it is said why not."""

    def ask(self, data):
        with tempfile.NamedTemporaryFile(suffix=".mcap") as f:
            f.write(data)
            f.flush()
            bag = anlos.Bag(f.name)
            return bag, list(bag.messages())

    def test_another_encoding_is_left_as_it_is(self):
        for indexed in (False, True):
            bag, messages = self.ask(foreign_bag(chunked=True, indexed=indexed))
            self.assertEqual(bag.topics, {"thing": 2})
            self.assertEqual([m.content for m in messages], [b'{"n":1}', b'{"n":2}'])
        with self.assertRaisesRegex(AttributeError, "bytes are in content"):
            print(messages[0].n)

    def test_what_the_summary_does_not_lead_to_is_not_left_out_in_silence(self):
        for data, text in ((foreign_bag(chunked=False), "has no index"),
                           (foreign_bag(chunked=False, statistics=False), "has no index"),
                           (foreign_bag(chunked=True, channels=False), "lacks channels"),
                           (foreign_bag(chunked=True, channels=False, statistics=False),
                            "lacks channels"),
                           (foreign_bag(chunked=True, channels=False, statistics=False,
                                        indexed=True), "lacks channels"),
                           (foreign_bag(chunked=False, channels=False, statistics=False),
                            "has no summary")):
            with self.assertRaisesRegex(ValueError, text + ".*anlos bag recover makes one"):
                self.ask(data)


class Live(unittest.TestCase):
    """Two ends of a bus in a folder of its own."""

    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="anlos-python-")
        self.addCleanup(scratch.cleanup)
        self.bus = {"run_dir": scratch.name, "wait": True, "program": PROGRAM}

    def both(self, topic, **how):
        """A subscription and a publisher that have found each other."""
        live = anlos.subscribe(topic, timeout_s=0.2, **self.bus)
        self.addCleanup(live.close)
        out = anlos.publish(topic, **self.bus, **how)
        self.addCleanup(out.close)
        last, heard = -1, -2
        while heard < last or heard < 0:
            if heard < 0:
                out.send()
                last += 1
            try:
                heard = next(live).sequence
            except TimeoutError:
                pass
        self.sent, live.timeout_s = last + 1, 60
        return live, out

    def test_what_is_sent_comes_as_a_message_of_a_bag(self):
        live, ego = self.both("ego")
        sent = [ego.send(speed_m_s=0.1 + i, yaw_rate_rad_s=numpy.float64(-0.5), valid=True)
                for i in range(10)]
        for i, m in zip(range(10), live):
            self.assertIsInstance(m, anlos.Message)
            self.assertEqual((m.topic, m.node, m.sequence), ("ego", "vehicle", self.sent + i))
            self.assertEqual((m.speed_m_s, m.yaw_rate_rad_s), (0.1 + i, -0.5))
            self.assertIs(m.valid, True)
            self.assertEqual(m.publish_ns, sent[i])
        self.assertEqual(live.lost, 0)

    def test_arrays_go_and_come_to_the_bit(self):
        live, ping = self.both("ping", force=True)
        samples = numpy.random.default_rng(1).normal(size=(4, 900)).astype(numpy.float32)
        ping.send(samples=samples, survey_id=2**64 - 1, temperature_c=float("nan"),
                  clipped=[1, 2])
        m = next(live)
        numpy.testing.assert_array_equal(m.samples, samples)
        self.assertEqual(m.survey_id, 2**64 - 1)
        self.assertTrue(numpy.isnan(m.temperature_c))
        numpy.testing.assert_array_equal(m.clipped, [1, 2])
        ping.send(m)  # what came, once more
        again = next(live)
        self.assertEqual(again.content.SerializeToString(), m.content.SerializeToString())

    def test_places_are_arrays_both_ways(self):
        live, walls = self.both("wall/given")
        walls.send(walls=[{"normal": numpy.array([0.0, 0.6, 0.8]), "distance_m": 1.25,
                           "origin": "GIVEN"}])
        wall, = next(live).walls
        numpy.testing.assert_array_equal(wall.normal, [0.0, 0.6, 0.8])
        self.assertEqual((wall.distance_m, wall.origin), (1.25, "GIVEN"))

    def test_a_wrong_message_is_named_and_the_next_one_goes(self):
        live, ego = self.both("ego")
        with self.assertRaisesRegex(ValueError, "did you mean speed_m_s"):
            ego.send(speed_ms=1.0)
        with self.assertRaisesRegex(ValueError, "valid: expected true or false"):
            ego.send(valid="yes")
        with self.assertRaisesRegex(ValueError, "a recording is for"):
            ego.send(valid=True, capture_ns=1)
        with self.assertRaisesRegex(ValueError, "infinity"):
            ego.send(speed_m_s=float("inf"))
        ego.send(speed_m_s=2.0)
        self.assertEqual(next(live).speed_m_s, 2.0)

    def test_what_cannot_be_is_said(self):
        with self.assertRaisesRegex(ValueError, "no such topic; did you mean ego"):
            anlos.subscribe("egos", **self.bus)
        with self.assertRaisesRegex(ValueError, "only the process array says that"):
            anlos.publish("ping", **self.bus).send()
        self.bus["wait"] = False
        with self.assertRaisesRegex(RuntimeError, "nothing is running"):
            anlos.subscribe("ego", **self.bus)
        with self.assertRaisesRegex(RuntimeError, "nothing is running"):
            anlos.publish("ego", **self.bus).send()
        with self.assertRaises(FileNotFoundError):
            anlos.subscribe("ego", program="/nowhere/anlos")

    def test_silence_is_a_timeout_and_a_closed_one_ends(self):
        live, ego = self.both("ego")
        live.timeout_s = 0.05
        with self.assertRaises(TimeoutError):
            next(live)
        live.timeout_s = 60
        ego.send()
        self.assertEqual(next(live).speed_m_s, 0.0)
        live.close()
        self.assertEqual(list(live), [])

    def test_a_pipe_of_messages_is_a_bag(self):
        path = self.bus["run_dir"] + "/ego.mcap"
        with open(path, "wb") as f:
            echo = subprocess.Popen([PROGRAM, "topic", "echo", "ego", "--mcap", "--count", "3",
                                     "--wait", "--run-dir", self.bus["run_dir"]], stdout=f,
                                    stderr=subprocess.DEVNULL)
        self.addCleanup(echo.wait)
        self.addCleanup(echo.kill)
        with anlos.publish("ego", **self.bus) as ego:
            while echo.poll() is None:
                ego.send(speed_m_s=4.0)
        run("bag", "check", path)
        run("bag", "recover", path, "-o", path + ".whole")
        self.assertEqual([m.speed_m_s for m in anlos.Bag(path + ".whole").messages()], [4.0] * 3)


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
