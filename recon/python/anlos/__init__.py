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
import dataclasses
import enum
import os

import cffi
import numpy

from . import _interface
from .bag import Bag, Message, Record
from .live import Publisher, Subscription, publish, subscribe

__all__ = ["Bag", "Error", "Image", "Message", "News", "Object", "Objects", "Pipeline",
           "Publisher", "Record", "Subscription", "Survey", "Wall",
           "methods", "options", "publish", "subscribe", "version"]

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
        (normal, distance_m, near_m, far_m).  mount: (origin, x_axis, y_axis).  responses: for
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
            near_far = tuple(wall[2:]) or (0.0, 0.0)
            self._set("add_wall", _doubles(_vector(wall[0], 3)), wall[1], *near_far)
        if mount is not None:
            self._set("mount", *(_doubles(_vector(v, 3)) for v in mount))

    def _set(self, what, *arguments):
        _call(getattr(_lib, "anlos_survey_" + what), self._p, *arguments)

    @classmethod
    def load(cls, path: str) -> "Survey":
        """Of a survey.yaml, as `anlos sim` and recordings have it."""
        import yaml

        with open(path, encoding="utf-8") as f:
            y = yaml.safe_load(f)
        known = {"sound_speed_m_s", "sample_rate_hz", "chirp", "slot_samples",
                 "latency_samples", "speakers_m", "microphones_m", "stage", "gate_m", "volume",
                 "wall", "mount"}
        if not isinstance(y, dict):
            raise ValueError(f"{path}: not a survey")
        if set(y) - known:
            raise ValueError(f"{path}: keys that are not taken here: "
                             + ", ".join(sorted(set(y) - known)))
        c, wall, mount = y.get("chirp", {}), y.get("wall"), y.get("mount")
        volume = y.get("volume")
        return cls(
            y["speakers_m"], y["microphones_m"],
            stage=(y["stage"]["axis"], y["stage"]["positions_m"]) if "stage" in y else None,
            chirp=(c.get("start_hz", 2000.0), c.get("stop_hz", 20000.0),
                   c.get("duration_s", 0.0625)),
            sine=c.get("phase") == "sine", sample_rate_hz=y.get("sample_rate_hz", 48000.0),
            slot_samples=y.get("slot_samples"), latency_samples=y.get("latency_samples", 0.0),
            sound_speed_m_s=y.get("sound_speed_m_s"), gate_m=y.get("gate_m"),
            volume_m=[volume[k] for k in ("x_m", "y_m", "z_m")] if volume else None,
            walls=[(wall["normal"], wall["distance_m"])] if wall else (),
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


def _samples(a, dimensions):
    """As they lie: of another type, shape or order they are refused, not converted."""
    if not isinstance(a, numpy.ndarray) or a.dtype != numpy.float32:
        raise TypeError("samples: expected a NumPy array of float32, not "
                        + (str(a.dtype) if isinstance(a, numpy.ndarray) else type(a).__name__))
    if a.ndim != dimensions:
        raise ValueError(f"samples: expected {dimensions} dimensions, not {a.ndim}")
    if not a.flags.c_contiguous:
        raise ValueError("samples: expected rows one after the other (C order); "
                         "numpy.ascontiguousarray copies them so")
    return a


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
Objects = dataclasses.make_dataclass(
    "Objects", [(f, object) for f in ("objects", "capture_ns", "scan", "frame", "counter",
                                      "preview", "mirrored", "in_vehicle_frame", "tracked",
                                      "ego_unknown")], frozen=True, eq=False)


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


class Pipeline:
    """All stages in one: pings to images, hidden objects and tracks."""

    def __init__(self, survey: Survey, array: str = "scan", **config):
        """config: fields of struct anlos_config; background "none", "recorded" or
        "adaptive", walls "survey", "given" or "heard", options {"name": value}."""
        kept = []  # what the configuration points to
        cfg = _ffi.new("struct anlos_config *")
        _lib.anlos_config_fill(cfg, _ffi.sizeof(cfg[0]),
                                        _choice("array", array))
        fields = dict(_ffi.typeof(cfg[0]).fields)
        for name, value in config.items():
            if name not in fields or name in ("size", "array", "n_options"):
                raise TypeError(f"{name}: no such field of struct anlos_config")
            if name == "options":
                kept.append([_ffi.new("char[]", f"{k}={v}".encode()) for k, v in
                             value.items()])
                kept.append(_ffi.new("const char *[]", kept[-1]))
                cfg.options, cfg.n_options = kept[-1], len(value)
            elif name in _ENUMS:
                setattr(cfg, name, _choice(name, value))
            elif isinstance(value, str):
                kept.append(_ffi.new("char[]", value.encode()))
                setattr(cfg, name, kept[-1])
            else:
                setattr(cfg, name, value)
        out = _ffi.new("struct anlos_pipeline **")
        _call(_lib.anlos_pipeline_create, out, cfg, survey._p)
        self._p = _ffi.gc(out[0], _lib.anlos_pipeline_destroy)

    def survey(self, survey: Survey) -> None:
        """Another one from now on: what was heard is forgotten."""
        _call(_lib.anlos_pipeline_survey, self._p, survey._p)

    def ping(self, samples: numpy.ndarray, *, clipped=None, **fields) -> News:
        """samples: float32 [microphone][sample], C order, not copied.  fields: those of
        struct anlos_ping: position, speaker, background, capture_ns, frame, ...  Returns
        News."""
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
        held = _ffi.from_buffer("float[]", a)
        ping.samples = held
        if clipped is not None:
            counts = numpy.ascontiguousarray(clipped, dtype=numpy.uint32)
            if counts.size != a.shape[0]:
                raise ValueError(f"clipped: expected {a.shape[0]} counts, not {counts.size}")
            held_counts = _ffi.from_buffer("uint32_t[]", counts)
            ping.clipped = held_counts
        return News(_call(_lib.anlos_pipeline_ping, self._p, ping))

    def finish(self) -> News:
        """A scan has ended: one that lacks pings gets its image."""
        return News(_call(_lib.anlos_pipeline_finish, self._p))

    def ego(self, speed_m_s: float, yaw_rate_rad_s: float, capture_ns: int) -> None:
        _call(_lib.anlos_pipeline_ego, self._p, speed_m_s, yaw_rate_rad_s, capture_ns)

    def air(self, temperature_c: float) -> None:
        _call(_lib.anlos_pipeline_air, self._p, temperature_c)

    def give_walls(self, walls: list[dict], capture_ns: int) -> News:
        """walls: of each a dict with the fields of struct anlos_wall.  Returns News."""
        array = _ffi.new("struct anlos_wall[]", len(walls))
        for w, values in zip(array, walls):
            w.size = _ffi.sizeof(w)
            for name, value in values.items():
                setattr(w, name, list(value) if numpy.ndim(value) else value)
        return News(_call(_lib.anlos_pipeline_walls, self._p, array, len(walls), capture_ns))

    def image(self) -> Image:
        """The newest, copied."""
        s = self._filled("image")
        facts = _values(s)
        for name in ("size", "intensity", "n", "newest_n", "coarse_n", "n_beyond"):
            del facts[name]
        for name, n in (("newest", s.newest_n), ("coarse", s.coarse_n),
                        ("beyond", (4, s.n_beyond, 1))):
            there = getattr(s, name) != _ffi.NULL
            facts[name] = _copied(getattr(s, name), n) if there else None
        if facts["beyond"] is not None:
            facts["beyond"] = facts["beyond"][0]
        return Image(_copied(s.intensity, s.n), facts.pop("origin_m"), facts.pop("step_m"),
                     facts)

    def objects(self) -> Objects:
        """The newest list of detections, or of tracks of a static array."""
        found = self._filled("list")
        facts = {k: v for k, v in _values(found).items() if k not in ("size", "n")}
        return Objects([Object._of(self._filled("object", i)) for i in range(found.n)],
                       **facts)

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

    def _filled(self, what, *which):
        s = _ffi.new(f"struct anlos_{what} *")
        s.size = _ffi.sizeof(s[0])
        _call(getattr(_lib, "anlos_pipeline_" + what), self._p, *which, s)
        return s[0]


def _choice(name, value):
    if value not in _ENUMS[name]:
        raise ValueError(f"{name}: expected one of {', '.join(_ENUMS[name])}, not {value!r}")
    return getattr(_lib, "ANLOS_" + _ENUMS[name][value])


if _lib.anlos_version_number() >> 24 != _interface.ABI:
    raise ImportError(f"libanlos {version()} does not go with this module")
