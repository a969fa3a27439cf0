# SPDX-License-Identifier: MIT
"""Hearing around corners: libanlos from Python.

    import anlos
    survey = anlos.Survey.load("recording/survey.yaml")
    pipeline = anlos.Pipeline(survey, method="fast", threads=2)
    for ...:
        pipeline.ping(samples, position=i, speaker=j)   # float32 [microphone][sample]
    pipeline.image().intensity, pipeline.objects()

Arrays are NumPy's; samples are used where they lie, without a copy.  Units, frames, threads
and what each value means: the C headers, anlos/*.h, whose names are kept.  What goes wrong is
an anlos.Error with the library's sentence.
"""
from __future__ import annotations

import dataclasses
import enum
import json
import os
import tempfile
from typing import Iterator

import cffi
import numpy

from . import _interface
from .bag import Bag, Message, Record
from .live import Publisher, Subscription, publish, run_program, subscribe

__all__ = ["Area", "Bag", "Compressor", "Detector", "Error", "Image", "Imager", "Message", "News",
           "Object", "Objects", "Pipeline", "Publisher", "Record", "Recording", "StaticArray",
           "Subscription", "Survey", "Tracker", "Traces", "Wall", "WallFinder",
           "methods", "options", "publish", "simulate", "subscribe", "version"]

_ffi = cffi.FFI()
_ffi.cdef(_interface.CDEF)
_lib = _ffi.dlopen(os.environ.get("ANLOS_LIBRARY", f"libanlos.so.{_interface.ABI}"))


class Error(Exception):
    """A call that failed: `code` is ANLOS_INVALID and so on, as text in `what`."""

    def __init__(self, code, text):
        super().__init__(text or _text(_lib.anlos_code_text(code)))
        self.code = code
        self.what = _text(_lib.anlos_code_text(code))


def _text(s):
    return _ffi.string(s).decode() if s else ""


def _call(function, *arguments) -> int:
    why = _ffi.new("struct anlos_error *")
    result = function(*arguments, why)
    if result < 0:
        raise Error(result, _text(why.text))
    return result


def _copied(x, n):
    """float [n[2]][n[1]][n[0]] of the library's."""
    buffer = _ffi.buffer(x, 4 * n[0] * n[1] * n[2])
    return numpy.frombuffer(buffer, numpy.float32).reshape((n[2], n[1], n[0])).copy()


def _vector(values, n=None):
    """double [n], as the library takes it."""
    a = numpy.ascontiguousarray(values, dtype=numpy.float64)
    if n is not None and a.size != n:
        raise ValueError(f"expected {n} numbers, not {a.size}")
    return a


def _doubles(a):
    return _ffi.from_buffer("double[]", a)


def version() -> str:
    """Of the library: "0.1.0"."""
    return _text(_lib.anlos_version())


def methods() -> list[str]:
    """The names of the imaging methods."""
    names = []
    while (name := _lib.anlos_method(len(names))) != _ffi.NULL:
        names.append(_text(name))
    return names


def options() -> dict[str, tuple[str, list[str]]]:
    """{option: (what it is, which methods take it)}."""
    out = {}
    help_, who = _ffi.new("const char **"), _ffi.new("char[256]")
    while (name := _lib.anlos_option(len(out), help_, who, 256)) != _ffi.NULL:
        out[_text(name)] = (_text(help_[0]), _text(who).split(", "))
    return out


_SURVEY_KEYS = {
    "temperature_c": None, "sound_speed_m_s": None, "sample_rate_hz": None, "slot_samples": None,
    "latency_samples": None, "together": None, "speakers_m": None, "microphones_m": None,
    "gate_m": None,
    "chirp": {"start_hz", "stop_hz", "duration_s", "phase", "alternates"},
    "stage": {"axis", "positions_m"}, "calibration": {"folder", "serials"},
    "volume": {"x_m", "y_m", "z_m"}, "wall": {"normal", "distance_m", "ends_m"},
    "walls": {"normal", "distance_m", "gate_m", "ends_m"}, "mount": {"origin_m", "x_axis", "y_axis"}}


def _unknown(y, known):
    """Names of keys: of the file's, "stage.continuous"."""
    for key, value in y.items():
        if key not in known:
            yield str(key)
        elif known[key]:
            for part in value if isinstance(value, list) else [value]:
                yield from (f"{key}.{k}" for k in part if k not in known[key])


def _curve(path):
    """A microphone's: lines of a frequency in Hz and a gain in dB, after any heading."""
    points = []
    with open(path, encoding="utf-8", errors="replace") as f:
        for number, line in enumerate(f, 1):
            try:
                hz, db = map(float, line.split())
            except ValueError:
                if points and line.strip():
                    raise ValueError(f"{path}:{number}: expected a frequency in Hz and dB") from None
            else:
                points.append((hz, db))
    return tuple(zip(*points)) or ((), ())


class Survey:
    """Where speakers, microphones, stage and wall are, and what is emitted when."""

    def __init__(self, speakers=None, microphones=None, *, stage=None, pings=None,
                 chirp=(2000.0, 20000.0, 0.0625), sine=False, replica=None,
                 sample_rate_hz=48000.0, slot_samples=None, latency_samples=0.0,
                 alternates=False, together=1, sound_speed_m_s=None, air=None, gate_m=None,
                 volume_m=None, walls=(), mount=None, responses=None):
        """speakers, microphones: [n][3] m; stage: (axis, positions); or pings: [n][2][3].
        replica: (samples, start_hz, stop_hz) in place of a chirp.  air: (temperature_c,
        humidity).  volume_m: [[min, max, step] of x, y, z].  walls: (normal, distance_m) or
        (normal, distance_m, near_m, far_m[, ends: [[x, z], [x, z]]]).  mount: (origin, x_axis, y_axis).  responses: for
        each microphone (frequencies_hz, gains_db)."""
        out = _ffi.new("struct anlos_survey **")
        _call(_lib.anlos_survey_create_for, _interface.VERSION_NUMBER, out)
        self._p = _ffi.gc(out[0], _lib.anlos_survey_destroy)
        if pings is not None:
            a = _vector(pings)
            self._set("pings", _doubles(a), a.size // 6)
        for name, places in (("speakers", speakers), ("microphones", microphones)):
            if places is not None:
                a = _vector(places)
                self._set(name, _doubles(a), a.size // 3)
        if stage is not None:
            axis, at = _vector(stage[0], 3), _vector(stage[1])
            self._set("stage", _doubles(axis), _doubles(at), at.size)
        for i, (frequency_hz, gain_db) in enumerate(responses or ()):
            f, g = _vector(frequency_hz), _vector(gain_db)
            if f.size != g.size:
                raise ValueError(f"microphone {i}: {f.size} frequencies, {g.size} gains")
            self._set("response", i, _doubles(f), _doubles(g), f.size)
        if replica is None:
            self._set("chirp", *chirp, sine)
        else:
            x = _samples(replica[0], 1)
            self._set("replica", _ffi.from_buffer("float[]", x), x.size, *replica[1:])
        if slot_samples is None:
            slot_samples = round(sample_rate_hz * chirp[2]) if replica is None else x.size
        self._set("sampling", sample_rate_hz, slot_samples, latency_samples)
        self.slot_samples = slot_samples
        self.positions = (len(pings) if pings is not None
                          else len(stage[1]) if stage is not None else 1)
        self.speakers = 1 if pings is not None else len(speakers or ())
        self._set("firing", alternates, together)
        if sound_speed_m_s is not None:
            self._set("sound_speed", sound_speed_m_s)
        if air is not None:
            self._set("air", *air)
        if gate_m is not None:
            self._set("gate", *gate_m)
        if volume_m is not None:
            self._set("volume", *(_doubles(_vector(axis, 3)) for axis in volume_m))
        for wall in walls:
            near_far = tuple(wall[2:4]) or (0.0, 0.0)
            self._set("add_wall", _doubles(_vector(wall[0], 3)), wall[1], *near_far)
            if len(wall) > 4 and wall[4] is not None:
                (x, z), (x2, z2) = wall[4]
                self._set("end_wall", _doubles(_vector((x, 0, z), 3)),
                          _doubles(_vector((x2, 0, z2), 3)))
        if mount is not None:
            self._set("mount", *(_doubles(_vector(v, 3)) for v in mount))

    def _set(self, what, *arguments):
        _call(getattr(_lib, "anlos_survey_" + what), self._p, *arguments)

    @classmethod
    def load(cls, path: str | os.PathLike) -> Survey:
        """Of a survey.yaml, as `anlos sim` and recordings have it, with the curves of its
        microphones.  Keys that are not taken here are refused: pings, replica, and a stage that
        does not stop."""
        import yaml

        with open(path, encoding="utf-8") as f:
            y = yaml.safe_load(f)
        if not isinstance(y, dict):
            raise ValueError(f"{path}: not a survey")
        unknown = sorted(_unknown(y, _SURVEY_KEYS))
        if unknown:
            raise ValueError(f"{path}: keys that are not taken here: " + ", ".join(unknown))
        c, mount = y.get("chirp", {}), y.get("mount")
        volume, stage = y.get("volume"), y.get("stage")
        walls = [(w["normal"], w["distance_m"], *w["gate_m"], w.get("ends_m"))
                 for w in y.get("walls", ())]
        if "wall" in y and not walls:
            w = y["wall"]
            walls = [(w["normal"], w["distance_m"], 0.0, 0.0, w.get("ends_m"))]
        air = None
        if "temperature_c" in y and "sound_speed_m_s" not in y:
            air = y["temperature_c"], 0.0
        curves = y.get("calibration")
        if curves:
            folder = os.path.join(os.path.dirname(path), curves["folder"])
            curves = [_curve(os.path.join(folder, f"{name}.txt")) for name in curves["serials"]]
        return cls(
            y["speakers_m"], y["microphones_m"],
            stage=(stage["axis"], stage["positions_m"]) if stage else None,
            chirp=(c.get("start_hz", 2000.0), c.get("stop_hz", 20000.0),
                   c.get("duration_s", 0.0625)),
            sine=c.get("phase") == "sine", sample_rate_hz=y.get("sample_rate_hz", 48000.0),
            slot_samples=y.get("slot_samples"), latency_samples=y.get("latency_samples", 0.0),
            alternates=c.get("alternates", False), together=y.get("together", 1),
            sound_speed_m_s=y.get("sound_speed_m_s"), air=air, gate_m=y.get("gate_m"),
            volume_m=[volume[k] for k in ("x_m", "y_m", "z_m")] if volume else None,
            walls=walls, responses=curves,
            mount=[mount[k] for k in ("origin_m", "x_axis", "y_axis")] if mount else None)

    def check(self) -> None:
        """Raises what is implausible or does not fit together."""
        _call(_lib.anlos_survey_check, self._p)

    @property
    def id(self) -> int:
        return _lib.anlos_survey_id(self._p)

    @property
    def ping_samples(self) -> int:
        """So many samples of each microphone a ping should have."""
        return _lib.anlos_survey_ping_samples(self._p)

    def slots(self, sound: numpy.ndarray):
        """Of a recording in one piece, float32 [sample][microphone], the pings: from each
        slot on as many samples as a ping should have, at its end filled up with silence."""
        n = self.ping_samples
        if n == 0:
            self.check()
        for first in range(0, len(_samples(sound, 2)) - self.slot_samples + 1,
                           self.slot_samples):
            piece = sound[first:first + n].T
            ping = numpy.zeros((piece.shape[0], n), numpy.float32)
            ping[:, :piece.shape[1]] = piece
            yield ping

    def emission(self, down: bool = False) -> numpy.ndarray:
        """What is emitted, amplitude 1."""
        n = _lib.anlos_survey_emission(self._p, down, _ffi.NULL, 0)
        out = numpy.empty(n, numpy.float32)
        _lib.anlos_survey_emission(self._p, down, _ffi.from_buffer("float[]", out), n)
        return out


def _array(a, dtype, dimensions, name):
    """As it lies: of another type, shape or order it is refused, not converted."""
    if not isinstance(a, numpy.ndarray) or a.dtype != dtype:
        raise TypeError(f"{name}: expected a NumPy array of {numpy.dtype(dtype)}, not "
                        + (str(a.dtype) if isinstance(a, numpy.ndarray) else type(a).__name__))
    if a.ndim != dimensions:
        raise ValueError(f"{name}: expected {dimensions} dimensions, not {a.ndim}")
    if not a.flags.c_contiguous:
        raise ValueError(f"{name}: expected rows one after the other (C order); "
                         "numpy.ascontiguousarray copies them so")
    return a


def _samples(a, dimensions):
    return _array(a, numpy.float32, dimensions, "samples")


class News(enum.IntFlag):
    """What a call has brought."""
    NOTHING = 0
    IMAGE = _lib.ANLOS_NEW_IMAGE
    OBJECTS = _lib.ANLOS_NEW_OBJECTS
    WALLS = _lib.ANLOS_NEW_WALLS
    NOTE = _lib.ANLOS_NEW_NOTE


def _values(struct):
    """{field: value}: text as str, arrays as NumPy's."""
    out = {}
    for name, field in _ffi.typeof(struct).fields:
        value = getattr(struct, name)
        if field.type.kind == "array":
            value = numpy.array(list(value))
        elif field.type.kind == "pointer" and field.type.item.cname == "char":
            value = _text(value)
        out[name] = value
    return out


def _record(name, struct):
    """A dataclass with the fields of a C struct."""
    fields = [f for f, _ in _ffi.typeof("struct " + struct).fields
              if f != "size"]
    return dataclasses.make_dataclass(
        name, [(f, object) for f in fields], frozen=True, eq=False,
        namespace={"__doc__": f"struct {struct} of the C headers.",
                   "_of": classmethod(lambda cls, s: cls(**{
                       k: v for k, v in _values(s).items() if k in fields}))})


Object = _record("Object", "anlos_object")
Wall = _record("Wall", "anlos_wall")


@dataclasses.dataclass(frozen=True, eq=False)
class Area:
    """A convex part of the floor that a list can tell of: corners_m [n][2]; wall: the id of
    that by way of which it is seen, 0: directly."""
    wall: int
    corners_m: numpy.ndarray

    @classmethod
    def _of(cls, s):
        return cls(s.wall, numpy.array([list(c) for c in s.corners_m[0:s.n_corners]]))


Objects = dataclasses.make_dataclass(
    "Objects", [(f, object) for f in ("objects", "capture_ns", "scan", "frame", "counter",
                                      "preview", "mirrored", "in_vehicle_frame", "tracked",
                                      "ego_unknown", "areas")], frozen=True, eq=False)


@dataclasses.dataclass(frozen=True, eq=False)
class Image:
    """intensity [z][y][x], of voxels at origin_m + index * step_m; facts: the other fields of
    struct anlos_image."""
    intensity: numpy.ndarray
    origin_m: numpy.ndarray
    step_m: numpy.ndarray
    facts: dict

    def axis(self, a: int) -> numpy.ndarray:
        """Places of the voxels along axis 0 (x), 1 (y) or 2 (z), m."""
        n = self.intensity.shape[2 - a]
        return self.origin_m[a] + self.step_m[a] * numpy.arange(n)


_ENUMS = {
    "array": {"scan": "SCAN", "static": "STATIC_ARRAY"},
    "background": {"none": "BACKGROUND_NONE", "recorded": "BACKGROUND_RECORDED",
                   "adaptive": "BACKGROUND_ADAPTIVE"},
    "walls": {"survey": "WALLS_SURVEY", "given": "WALLS_GIVEN", "heard": "WALLS_HEARD"},
}


class _Stage:
    """A handle of the library, made of a configuration and a survey."""

    def __init__(self, noun, survey, array, config):
        self._raised = []  # by `stop`, which C has called
        cfg, self._held = _configuration(array, config, self._raised)
        out = _ffi.new(f"struct anlos_{noun} **")
        self._noun = noun
        self._checked(getattr(_lib, f"anlos_{noun}_create"), out, cfg, survey._p)
        self._p = _ffi.gc(out[0], getattr(_lib, f"anlos_{noun}_destroy"))

    def _checked(self, function, *arguments):
        try:
            return _call(function, *arguments)
        except Error:
            if self._raised:
                raise self._raised.pop() from None
            raise

    def _call(self, what, *arguments):
        return self._checked(getattr(_lib, f"anlos_{self._noun}_{what}"), self._p, *arguments)

    def _filled(self, what, *which):
        s = _ffi.new(f"struct anlos_{what} *")
        s.size = _ffi.sizeof(s[0])
        self._call(what, *which, s)
        return s[0]

    def _image(self):
        s = self._filled("image")
        facts = _values(s)
        for name in ("size", "intensity", "n", "newest_n", "coarse_n", "n_beyond", "n_movers",
                     "n_ambiguous", "n_courses"):
            del facts[name]
        for name, n in (("newest", s.newest_n), ("coarse", s.coarse_n),
                        ("beyond", (4, s.n_beyond, 1)), ("movers", (7, s.n_movers, 1)),
                        ("ambiguous", (7, s.n_ambiguous, 1)),
                        ("courses", (8, s.n_courses, 1))):
            there = getattr(s, name) != _ffi.NULL
            facts[name] = _copied(getattr(s, name), n) if there else None
        for name in _ROWS:
            if facts[name] is not None:
                facts[name] = facts[name][0]
        return Image(_copied(s.intensity, s.n), facts.pop("origin_m"), facts.pop("step_m"),
                     facts)

    def _objects(self):
        found = self._filled("list")
        facts = {k: v for k, v in _values(found).items() if k not in ("size", "n", "n_areas")}
        return Objects([Object._of(self._filled("object", i)) for i in range(found.n)],
                       areas=[Area._of(self._filled("area", i)) for i in range(found.n_areas)],
                       **facts)


def _configuration(array, config, raised):
    """struct anlos_config *, and what has to live as long as what it is for."""
    cfg = _ffi.new("struct anlos_config *")
    held = [cfg]
    _lib.anlos_config_fill(cfg, _ffi.sizeof(cfg[0]), _choice("array", array))
    fields = dict(_ffi.typeof(cfg[0]).fields)
    for name, value in config.items():
        if name not in fields or name in ("size", "array", "n_options", "stop_ctx"):
            raise TypeError(f"{name}: no such field of struct anlos_config")
        if name == "options":
            held.append([_ffi.new("char[]", f"{k}={v}".encode()) for k, v in value.items()])
            held.append(_ffi.new("const char *[]", held[-1]))
            cfg.options, cfg.n_options = held[-1], len(value)
        elif name == "stop":
            held.append(_ffi.callback("bool(void *)", lambda _, stop=value: bool(stop()),
                                      error=True, onerror=lambda _, e, __: raised.append(e)))
            cfg.stop = held[-1]
        elif name in _ENUMS:
            setattr(cfg, name, _choice(name, value))
        elif isinstance(value, str):
            held.append(_ffi.new("char[]", value.encode()))
            setattr(cfg, name, held[-1])
        else:
            setattr(cfg, name, value)
    return cfg, held


def _ping(samples, clipped, fields):
    """struct anlos_ping * of samples where they lie, and what has to live as long."""
    a = _samples(samples, 2)
    ping = _ffi.new("struct anlos_ping *")
    ping.size = _ffi.sizeof(ping[0])
    known = dict(_ffi.typeof(ping[0]).fields)
    for name, value in fields.items():
        if name not in known or name in ("size", "samples", "n_samples", "n_microphones"):
            raise TypeError(f"{name}: no such field of struct anlos_ping")
        setattr(ping, name, value)
    if "temperature_c" in fields:
        ping.has_temperature = True
    ping.n_microphones, ping.n_samples = a.shape
    held = [_ffi.from_buffer("float[]", a)]
    ping.samples = held[0]
    if clipped is not None:
        counts = numpy.ascontiguousarray(clipped, dtype=numpy.uint32)
        if counts.size != a.shape[0]:
            raise ValueError(f"clipped: expected {a.shape[0]} counts, not {counts.size}")
        held.append(_ffi.from_buffer("uint32_t[]", counts))
        ping.clipped = held[-1]
    return ping, held


def _wall_array(walls):
    """struct anlos_wall [] of dicts with its fields, or of Walls."""
    array = _ffi.new("struct anlos_wall[]", len(walls))
    for w, values in zip(array, walls):
        w.size = _ffi.sizeof(w)
        values = vars(values) if isinstance(values, Wall) else values
        for name, value in values.items():
            setattr(w, name, list(value) if numpy.ndim(value) else value)
    return array


def _filled_in(struct, facts):
    """A struct of the library with these fields, and the texts that it points to."""
    s, held = _ffi.new(f"struct anlos_{struct} *"), []
    s.size = _ffi.sizeof(s[0])
    known = dict(_ffi.typeof(s[0]).fields)
    for name, value in facts.items():
        if name not in known:
            raise TypeError(f"{name}: no such field of struct anlos_{struct}")
        if isinstance(value, str):
            held.append(_ffi.new("char[]", value.encode()))
            value = held[-1]
        setattr(s, name, list(value) if numpy.ndim(value) else value)
    return s, held


class Pipeline(_Stage):
    """All stages in one: pings to images, hidden objects and tracks."""

    def __init__(self, survey: Survey, array: str = "scan", **config):
        """config: fields of struct anlos_config; background "none", "recorded" or
        "adaptive", walls "survey", "given" or "heard", options {"name": value}."""
        super().__init__("pipeline", survey, array, config)

    def survey(self, survey: Survey) -> None:
        """Another one from now on: what was heard is forgotten."""
        self._call("survey", survey._p)

    def ping(self, samples: numpy.ndarray, *, clipped=None, **fields) -> News:
        """samples: float32 [microphone][sample], C order, not copied.  fields: those of
        struct anlos_ping: position, speaker, background, capture_ns, frame, ...  Returns
        News."""
        ping, _held = _ping(samples, clipped, fields)
        return News(self._call("ping", ping))

    def finish(self) -> News:
        """A scan has ended: one that lacks pings gets its image."""
        return News(self._call("finish"))

    def ego(self, speed_m_s: float, yaw_rate_rad_s: float, capture_ns: int) -> None:
        self._call("ego", speed_m_s, yaw_rate_rad_s, capture_ns)

    def air(self, temperature_c: float) -> None:
        self._call("air", temperature_c)

    def give_walls(self, walls: list[dict | Wall], capture_ns: int) -> News:
        """walls: of each a dict with the fields of struct anlos_wall, or a Wall."""
        return News(self._call("walls", _wall_array(walls), len(walls), capture_ns))

    def image(self) -> Image:
        """The newest, copied."""
        return self._image()

    def objects(self) -> Objects:
        """The newest list of detections, or of tracks of a static array."""
        return self._objects()

    def walls(self) -> list[Wall]:
        """Those that images and tracks go by, in the array's frame, the surest first."""
        return [Wall._of(self._filled("wall", i))
                for i in range(_lib.anlos_pipeline_n_walls(self._p))]

    def note(self) -> str:
        """The newest thing that a person should know, or ""."""
        return _text(_lib.anlos_pipeline_note(self._p))

    def health(self) -> dict[str, int | float]:
        """Counts since it was created."""
        values = _values(self._filled("health"))
        del values["size"]
        return values


@dataclasses.dataclass(frozen=True, eq=False)
class Traces:
    """Of one ping: samples complex64 [microphone][sample], masked bool [microphone]; sample n
    belongs to the delay facts["t0_s"] + n / facts["rate_hz"]; facts: the other fields of
    struct anlos_traces."""
    samples: numpy.ndarray
    masked: numpy.ndarray
    facts: dict


class Compressor(_Stage):
    """Pings to traces: pulse compression, and what stands subtracted."""

    def __init__(self, survey: Survey, array: str = "scan", **config):
        """config: as of Pipeline; window, compression and background count."""
        super().__init__("compressor", survey, array, config)

    def ping(self, samples: numpy.ndarray, *, clipped=None, **fields) -> Traces | None:
        """As of Pipeline.  None: it was of the background, which is kept."""
        ping, _held = _ping(samples, clipped, fields)
        out = _ffi.new("struct anlos_traces *")
        out.size = _ffi.sizeof(out[0])
        if not self._call("ping", ping, out):
            return None
        s = out[0]
        n = (s.n_microphones, s.n_samples)
        y = numpy.frombuffer(_ffi.buffer(s.samples, 8 * n[0] * n[1]), numpy.complex64)
        masked = numpy.zeros(n[0], bool)
        if s.masked != _ffi.NULL:
            masked[:] = list(s.masked[0:n[0]])
        facts = {k: v for k, v in _values(s).items()
                 if k not in ("size", "n_microphones", "n_samples", "samples", "masked")}
        return Traces(y.reshape(n).copy(), masked, facts)

    def ego(self, speed_m_s: float, yaw_rate_rad_s: float, capture_ns: int) -> None:
        self._call("ego", speed_m_s, yaw_rate_rad_s, capture_ns)


class _OnVehicle(_Stage):
    def ego(self, speed_m_s: float, yaw_rate_rad_s: float, capture_ns: int) -> None:
        self._call("ego", speed_m_s, yaw_rate_rad_s, capture_ns)

    def walls(self, walls: list[dict | Wall], capture_ns: int) -> None:
        """At a time, in the array's frame."""
        self._call("walls", _wall_array(walls), len(walls), capture_ns)


class _TakesTraces(_Stage):
    def add(self, traces: Traces) -> bool:
        """True: the image is due, as every ping of a scan, or of a round, is in."""
        s, _held = _filled_in("traces", traces.facts)
        y = _array(traces.samples, numpy.complex64, 2, "samples")
        masked = _array(traces.masked, numpy.bool_, 1, "masked")
        if masked.size != y.shape[0]:
            raise ValueError(f"masked: expected {y.shape[0]}, not {masked.size}")
        s.n_microphones, s.n_samples = y.shape
        lie = _ffi.from_buffer("char[]", y), _ffi.from_buffer("bool[]", masked)
        s.samples, s.masked = _ffi.cast("float *", lie[0]), lie[1]
        return bool(self._call("add", s))

    def image(self) -> Image:
        """Of what is in, copied."""
        return self._image()


class Imager(_TakesTraces):
    """A scan's traces to an image, by any of methods()."""

    def __init__(self, survey: Survey, **config):
        """config: as of Pipeline; method, options, threads count, and the window and
        compression that the traces were made with."""
        super().__init__("imager", survey, "scan", config)


class StaticArray(_OnVehicle, _TakesTraces):
    """A static array's newest traces to an image for every round of pings."""

    def __init__(self, survey: Survey, **config):
        super().__init__("static_array", survey, "static", config)


_ROWS = {"beyond": ("place", 4), "movers": ("mover", 7), "ambiguous": ("mover", 7),
         "courses": ("course", 8)}


def _image_struct(image):
    """struct anlos_image, of arrays where they lie, and what has to live as long."""
    arrays = {name: image.facts.get(name) for name in ("newest", "coarse", *_ROWS)}
    s, held = _filled_in("image", {k: v for k, v in image.facts.items() if k not in arrays})
    s.origin_m, s.step_m = list(image.origin_m), list(image.step_m)
    for name, x in (("intensity", image.intensity), *arrays.items()):
        if x is None:
            continue
        x = _array(x, numpy.float32, 2 if name in _ROWS else 3, name)
        if name in _ROWS:
            what, n = _ROWS[name]
            if x.shape[1] != n:
                raise ValueError(f"{name}: expected {n} numbers a {what}, not {x.shape[1]}")
            setattr(s, "n_" + name, len(x))
        else:
            setattr(s, "n" if name == "intensity" else name + "_n", x.shape[::-1])
        held.append(_ffi.from_buffer("float[]", x))
        setattr(s, name, held[-1])
    return s, held


class Detector(_Stage):
    """An image to the hidden objects in it; each list stands for itself."""

    def __init__(self, survey: Survey, array: str = "scan", **config):
        """config: as of Pipeline; threshold_db, min_existence, false_alarm_rate count."""
        super().__init__("detector", survey, array, config)

    def image(self, image: Image, walls: list[dict | Wall] | None = None) -> None:
        """walls: in the array's frame; None: the survey's."""
        s, _held = _image_struct(image)
        self._call("image", s, _ffi.NULL if walls is None else _wall_array(walls),
                   0 if walls is None else len(walls))

    def objects(self) -> Objects:
        """Of the newest image."""
        return self._objects()


class Tracker(_OnVehicle):
    """A static array's images, one after the other, to objects that stay."""

    def __init__(self, survey: Survey, **config):
        super().__init__("tracker", survey, "static", config)

    def image(self, image: Image) -> None:
        """At its stamp, which is newer than the last one's."""
        s, _held = _image_struct(image)
        self._call("image", s)

    def objects(self) -> Objects:
        """At the stamp of the newest image."""
        return self._objects()


class WallFinder(_Stage):
    """The walls that mirror sound, heard in the pings themselves, or given."""

    def __init__(self, survey: Survey, array: str = "static", **config):
        """config: as of Pipeline; walls, reach_m, lost_s count."""
        super().__init__("wall_finder", survey, array, config)

    def ping(self, samples: numpy.ndarray, *, clipped=None, **fields) -> bool:
        """As of Pipeline.  True: there is a new list of walls."""
        ping, _held = _ping(samples, clipped, fields)
        return bool(self._call("ping", ping))

    def ego(self, speed_m_s: float, yaw_rate_rad_s: float, capture_ns: int) -> bool:
        return bool(self._call("ego", speed_m_s, yaw_rate_rad_s, capture_ns))

    def given(self, walls: list[dict | Wall], capture_ns: int) -> bool:
        """All that the vehicle knows, in its frame; with walls="given"."""
        return bool(self._call("given", _wall_array(walls), len(walls), capture_ns))

    def walls(self) -> list[Wall]:
        """The newest list, in the array's frame, the surest first."""
        return [Wall._of(self._filled("wall", i)) for i in
                range(_lib.anlos_wall_finder_n_walls(self._p, _ffi.NULL))]


class Recording:
    """A folder that `anlos sim` has written, or one of recordings laid out likewise: survey,
    objects (what truth.json says of each, where it is there), and the pings."""

    def __init__(self, folder: str | os.PathLike, *, program: str | os.PathLike | None = None):
        """program: anlos, if not on the PATH or in ANLOS_PROGRAM; it reads the WAV files."""
        self.folder, self._program = os.fspath(folder), program
        self.survey = Survey.load(os.path.join(self.folder, "survey.yaml"))
        self.objects: list[dict] = []
        truth = os.path.join(self.folder, "truth.json")
        if os.path.exists(truth):
            with open(truth, encoding="utf-8") as f:
                self.objects = json.load(f)["objects"]

    def pings(self) -> Iterator[dict]:
        """Those of the background, if there are any, then those of the scene: what
        Pipeline.ping takes, `pipeline.ping(**ping)`."""
        at, background = self.folder, os.path.join(self.folder, "background")
        with tempfile.TemporaryDirectory(prefix="anlos-") as scratch:
            path = os.path.join(scratch, "recording.mcap")
            more = ["--background", background] if os.path.isdir(background) else []
            run_program(self._program, "bag", "import", os.path.join(at, "scene"), "--survey",
                        os.path.join(at, "survey.yaml"), *more, "-o", path, "--compression",
                        "none")
            for m in Bag(path).messages("ping"):
                ping = {name: getattr(m, name) for name in (
                    "samples", "position", "speaker", "frame", "down", "scan", "capture_ns")}
                ping["background"] = getattr(m, "pass") == "BACKGROUND"
                if len(m.clipped):
                    ping["clipped"] = m.clipped
                if numpy.isfinite(m.temperature_c):
                    ping["temperature_c"] = m.temperature_c
                yield ping


def simulate(scene: str | os.PathLike, folder: str | os.PathLike, *, threads: int | None = None,
             program: str | os.PathLike | None = None) -> Recording:
    """What an array hears in a scene of the simulator (launch/scenes), written into a folder by
    `anlos sim`.  A scene that cannot be is a ValueError with the program's sentence."""
    more = [] if threads is None else ["--threads", str(threads)]
    run_program(program, "sim", os.fspath(scene), "--out", os.fspath(folder), *more)
    return Recording(folder, program=program)


def _choice(name, value):
    if value not in _ENUMS[name]:
        raise ValueError(f"{name}: expected one of {', '.join(_ENUMS[name])}, not {value!r}")
    return getattr(_lib, "ANLOS_" + _ENUMS[name][value])


if _lib.anlos_version_number() >> 24 != _interface.ABI:
    raise ImportError(f"libanlos {version()} does not go with this module")
