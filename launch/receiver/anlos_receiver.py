#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The vehicle's side of the CAN frames of anlos, as anlos_receiver.h has it in C.

    anlos_receiver.py LOG|-|INTERFACE:CHANNEL [--first-id ID] [--any-source] [--scan] [--json]

Reads a log of candump (-L), standard input, or a bus of python3-can such as
socketcan:can0, and prints each whole object list on a line.  README.md beside this file
is the guide.  Only a bus needs python3-can; all else is the standard library's.

  --first-id ID  identifier of the sensor's Status, hexadecimal (default 400)
  --any-source   replayed and simulated sound is trusted as live sound is
  --scan         of an array on a stage, whose lists come when it has one: they do not
                 time out and are trusted whatever their age
  --json         an object a line; the last one has the counts.  null: not available

Exit code 0; 1 when no list came; 2 bad arguments or input; 130 stopped by Ctrl-C.

As a module: Receiver().frame(id, data, now_ms), .tick(now_ms), .get(now_ms).
"""

import argparse
import json
import math
import re
import struct
import sys
import time

STATES = ("Init", "Calibrating", "Active", "Degraded", "Fault", "Blocked", "Standby", None)
SHUTDOWN = "Shutdown"  # it was stopped in order
SOURCES = ("Live", "Replay", "Simulation", None)
FAULTS = ("ImageStale", "EgoMotionMissing", "TemperatureUnknown", "ChannelsDead",
          "ElementErrors", "WallLost", "ClockJump", "InputE2eWrong", "ArrayAway",
          "NodeLost", "Clipped", "ListsDropped", "RangeReduced", "ElementsCovered",
          "ElementsMoved", "Interference")
MEASUREMENTS = ("New", "Measured", "Predicted", "Deleted")
CLASSES = ("Unknown", "Point", "Plate", "Extended", "Multipath")
MOTIONS = ("Unknown", "Standing", "Moving")

STATUS, DIAGNOSIS, HEADER, TIME, OBJECT_STATE, DYNAMICS, QUALITY, MOTION, FD, VIEW = range(10)
LIST_KINDS = (HEADER, TIME, OBJECT_STATE, DYNAMICS, QUALITY, FD)
OPTIONAL_KINDS = (MOTION, VIEW)  # no list waits for them
INTERFACE_VERSION = 2
MAX_OBJECTS = 32
MAX_AREAS, MAX_CORNERS = 15, 8
MAX_DELTA = 3  # AUTOSAR's MaxDeltaCounter: two frames in a row may get lost

OK, ERROR, OTHER = "ok", "error", "other"
FOREIGN, WRONG, NEW_STATUS, NEW_DIAGNOSIS, NEW_LIST, DROPPED, TIMEOUT = (
    "foreign", "wrong", "status", "diagnosis", "list", "dropped", "timeout")


def crc8(crc, data):
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D) & 0xFF if crc & 0x80 else crc << 1
    return crc


def crc16(crc, data):
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021) & 0xFFFF if crc & 0x8000 else crc << 1
    return crc


def good_p11(data_id, data):
    """AUTOSAR E2E profile 11, nibble: the CRC begins with 0 and is not inverted."""
    return (len(data) == 8 and data[0] == crc8(0, bytes([data_id & 0xFF, 0]) + data[1:])
            and data[1] >> 4 == data_id >> 8 & 0xF and data[1] & 0xF < 15)


def good_p05(data_id, data):
    """AUTOSAR E2E profile 5."""
    return len(data) == 64 and struct.unpack_from("<H", data)[0] == crc16(
        0xFFFF, data[2:] + struct.pack("<H", data_id))


class Channel:
    """A kind of frames: its counter and AUTOSAR's E2E state machine."""

    # state: window, least that are good, most that are wrong
    LIMITS = {"INIT": (2, 2, 0), "VALID": (6, 1, 1), "INVALID": (6, 6, 0)}

    def __init__(self, fd):
        self.fd, self.counters = fd, 256 if fd else 15
        self.state, self.newest, self.counter = "NODATA", [], None

    def restart(self):
        if self.state != "INVALID":
            self.__init__(self.fd)

    def _within(self, state):
        window, least, most = self.LIMITS[state]
        newest = self.newest[:window]
        return newest.count(OK) >= least and newest.count(ERROR) <= most

    def _step(self, check):
        self.newest = [check] + self.newest[:5]
        if self.state == "NODATA":
            self.state = "NODATA" if check == ERROR else "INIT"
        elif self.state == "INIT":
            if ERROR in self.newest[:2]:
                self.state = "INVALID"
            elif self._within("INIT"):
                self.state = "VALID"
            if self.state != "INIT":
                del self.newest[2:]
        elif self.state == "VALID":
            self.state = "VALID" if self._within("VALID") else "INVALID"
        elif self._within("INVALID"):
            self.state = "VALID"

    def take(self, frame_id, data, counts):
        check, delta = ERROR, 0
        if not (good_p05 if self.fd else good_p11)(frame_id, data):
            counts["frames_damaged"] += 1
        else:
            counter = data[2] if self.fd else data[1] & 0xF
            # The first one is good whatever its counter.
            delta = 1 if self.counter is None else (counter - self.counter) % self.counters
            self.counter = counter
            if delta == 0:
                check = OTHER
                counts["frames_repeated"] += 1
            elif delta > MAX_DELTA:
                check = OTHER
                counts["frames_out_of_sequence"] += 1
            else:
                check = OK
                counts["frames_good"] += 1
                counts["frames_lost"] += delta - 1
        self._step(check)
        return check, delta


def raw(data, start, length):
    return int.from_bytes(data, "little") >> start & (1 << length) - 1


def signed(data, start, length):
    value = raw(data, start, length)
    return value - (1 << length) if value >> length - 1 else value


def number(value, low, high, step=1.0, offset=0.0):
    """None: not available, or without a meaning in this version of the layout."""
    return value * step + offset if low <= value <= high else None


def floats(data, start, low, high):
    value = struct.unpack_from("<f", data, start // 8)[0]
    return value if low <= value <= high else None  # neither holds for NaN


DEGREE = math.pi / 180

# The signals of objects: name, start, length (below 0: two's complement), lowest and highest
# raw value, step; at the ends where clamped is set it may be that or more.
OBJECT_SIGNALS = {
    OBJECT_STATE: (("x_m", 30, -13, -4095, 4095, 0.02, True),
                   ("y_m", 43, -12, -2047, 2047, 0.02, True),
                   ("z_m", 55, -9, -255, 255, 0.05, True)),
    DYNAMICS: (("vx_m_s", 28, -11, -1023, 1023, 0.05, True),
               ("vy_m_s", 39, -11, -1023, 1023, 0.05, True),
               ("existence", 50, 7, 0, 100, 0.01, False)),
    QUALITY: (("sigma_x_m", 28, 7, 0, 126, 0.02, True),
              ("sigma_y_m", 35, 7, 0, 126, 0.02, True),
              ("correlation_xy", 42, -6, -25, 25, 0.04, False),
              ("sigma_v_m_s", 48, 5, 0, 30, 0.1, True),
              ("length_m", 53, 6, 0, 62, 0.1, True),
              ("width_m", 59, 5, 0, 30, 0.1, True)),
    MOTION: (("course_rad", 28, -9, -180, 180, DEGREE, False),
             ("sigma_course_rad", 37, 6, 0, 62, DEGREE, True),
             ("sigma_vx_m_s", 43, 7, 0, 126, 0.05, True),
             ("sigma_vy_m_s", 50, 7, 0, 126, 0.05, True),
             ("correlation_v", 57, -6, -25, 25, 0.04, False)),
    FD: (("shape_probability", 55, 7, 0, 100, 0.01, False),
         ("existence", 62, 14, 0, 10000, 0.0001, False),
         ("sigma_v_m_s", 76, 12, 0, 4094, 0.01, True),
         ("length_m", 88, 12, 0, 4094, 0.01, True),
         ("width_m", 100, 12, 0, 4094, 0.01, True),
         ("height_m", 112, 12, 0, 4094, 0.01, True),
         ("unseen_s", 124, 12, 0, 4094, 0.01, True),
         ("age_s", 136, 16, 0, 65534, 0.1, True)),
}
VALUES = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "existence", "sigma_x_m", "sigma_y_m",
          "correlation_xy", "sigma_v_m_s", "length_m", "width_m", "course_rad",
          "sigma_course_rad", "sigma_vx_m_s", "sigma_vy_m_s", "correlation_v", "height_m",
          "sigma_z_m", "correlation_xz", "correlation_yz", "shape_probability", "unseen_s",
          "age_s")


def choose(names, value):
    return names[value] if value < len(names) else names[0]


def object_take(o, kind, data):
    for name, start, length, low, high, step, clamped in OBJECT_SIGNALS[kind]:
        value = signed(data, start, -length) if length < 0 else raw(data, start, length)
        o[name] = number(value, low, high, step)
        if clamped and (value == high or value == low < 0):
            o["at_limit"].append(name)
    if kind == OBJECT_STATE:
        o["measurement"] = MEASUREMENTS[raw(data, 28, 2)]
    elif kind == DYNAMICS:
        o["shape"] = choose(CLASSES, raw(data, 57, 4))
        o["motion"] = choose(MOTIONS, raw(data, 61, 3))
    elif kind == FD:
        object_take_fd(o, data)


def object_take_fd(o, data):
    o.update(measurement=MEASUREMENTS[raw(data, 44, 2)], behind_no_wall=raw(data, 46, 1) == 1,
             in_free_view=raw(data, 47, 1) == 1, shape=choose(CLASSES, raw(data, 48, 4)),
             motion=choose(MOTIONS, raw(data, 52, 3)), wall_id=raw(data, 152, 8), fd=True)
    for i, name in enumerate(("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s")):
        o[name] = floats(data, 160 + 32 * i, -1000.0, 1000.0)
        if o[name] is not None and abs(o[name]) == 1000.0:
            o["at_limit"].append(name)
    variances = {a: floats(data, start, 0.0, 1e6)
                 for a, start in (("x", 320), ("y", 416), ("z", 480))}
    for axis, variance in variances.items():
        o[f"sigma_{axis}_m"] = (None if variance is None
                                else math.sqrt(variance) if variance > 1e-12 else 0.0)
        if variance == 1e6:
            o["at_limit"].append(f"sigma_{axis}_m")
    for a, b, start in (("x", "y", 352), ("x", "z", 384), ("y", "z", 448)):
        both = (o[f"sigma_{a}_m"] or 0.0) * (o[f"sigma_{b}_m"] or 0.0)
        covariance = floats(data, start, -1e6, 1e6)
        o[f"correlation_{a}{b}"] = (max(-1.0, min(1.0, covariance / both))
                                    if covariance is not None and both > 0.0 else None)


class Receiver:
    """One sensor.  Times are milliseconds of any clock that only goes forward."""

    def __init__(self, first_id=0x400, sources=("Live",), status_ms=350, list_ms=600,
                 diagnosis_ms=3500, assembly_ms=200, age_ms=1000):
        if not 0 <= first_id <= 0x7F0 or first_id % 0x10:
            raise ValueError(f"first identifier {first_id:#x}: expected a multiple of 0x10 "
                             "up to 0x7f0")
        self.first_id, self.sources = first_id, tuple(sources)
        self.status_ms, self.list_ms, self.diagnosis_ms = status_ms, list_ms, diagnosis_ms
        self.assembly_ms, self.age_ms = assembly_ms, age_ms
        self.channels = {k: Channel(k == FD) for k in range(10)}
        self.counts = dict.fromkeys((
            "frames_good", "frames_lost", "frames_damaged", "frames_repeated",
            "frames_out_of_sequence", "frames_orphaned", "timeouts", "lists_whole",
            "lists_lost", "lists_torn", "lists_mixed", "lists_repeated", "lists_unproven",
            "lists_refused"), 0)
        self.good_ms = {}  # of STATUS, DIAGNOSIS, HEADER (the newest list)
        self.status, self.diagnosis, self.list = None, {"troubles": {}}, None
        self.next, self.headers, self.header_counter = None, 0, None

    def _drop(self, why):
        self.counts[why] += 1
        self.next = None
        return {DROPPED}

    def _is_stopped(self):
        return self.status is not None and self.status["state"] == SHUTDOWN

    def _last_word(self):
        """That it was stopped stays so until it says something else."""
        return {"state": SHUTDOWN, "source": None, "faults": [], "temperature_c": None,
                "sound_speed_m_s": None, "range_m": None} if self._is_stopped() else None

    def tick(self, now_ms):
        """Time-outs.  The events."""
        events = set()
        if self.next and now_ms - self.next["header_ms"] > self.assembly_ms:
            events |= self._drop("lists_torn")
        for kind, limit_ms in ((STATUS, self.status_ms), (DIAGNOSIS, self.diagnosis_ms),
                               (HEADER, self.list_ms)):
            if kind not in self.good_ms or now_ms - self.good_ms[kind] <= limit_ms:
                continue
            del self.good_ms[kind]
            if not self._is_stopped():  # the silence of what was stopped is none to be told
                self.counts["timeouts"] += 1
                events.add(TIMEOUT)
            for k in LIST_KINDS + OPTIONAL_KINDS if kind == HEADER else (kind,):
                self.channels[k].restart()
            if kind == STATUS:
                self.status = self._last_word()
            elif kind == HEADER:
                if self.next:
                    events |= self._drop("lists_torn")
                self.list, self.header_counter = None, None
        return events

    def frame(self, frame_id, data, now_ms):
        """A data frame with an 11-bit identifier.  The events."""
        kind = frame_id - self.first_id
        if kind not in self.channels:
            return {FOREIGN}
        data = bytes(data)
        events = self.tick(now_ms)
        check, delta = self.channels[kind].take(frame_id, data, self.counts)
        if check == OK:
            return events | self._use(kind, data, delta, now_ms)
        if check == OTHER and kind == TIME and delta:
            self.headers = 0
        return events | {WRONG}

    def _use(self, kind, data, delta, now_ms):
        if kind == STATUS:
            self.good_ms[STATUS] = now_ms
            self._take_status(data)
            return {NEW_STATUS}
        if kind == DIAGNOSIS:
            self.good_ms[DIAGNOSIS] = now_ms
            if self.channels[DIAGNOSIS].state != "VALID":
                return set()
            self._take_diagnosis(data)
            return {NEW_DIAGNOSIS}
        if kind == HEADER:
            return self._take_header(data, delta, now_ms)
        if kind == TIME:
            return self._take_time(data, delta)
        if kind == MOTION:
            self._take_motion(data)
            return set()
        if kind == VIEW:
            self._take_corner(data)
            return set()
        return self._take_object(kind, data)

    def _take_status(self, data):
        faults = raw(data, 24, 16)
        self.status = {
            "state": STATES[raw(data, 16, 3)] if not raw(data, 21, 1) else SHUTDOWN
            if self.channels[STATUS].state == "VALID" else None,  # one alone is no proof
            "source": SOURCES[raw(data, 19, 2)],
            "faults": [name for bit, name in enumerate(FAULTS) if faults >> bit & 1],
            "temperature_c": number(raw(data, 40, 8), 0, 254, 0.5, -40.0),
            "sound_speed_m_s": number(raw(data, 48, 10), 0, 1022, 0.1, 280.0),
            "range_m": number(raw(data, 58, 6), 1, 63, 0.2, -0.2)}

    def _take_diagnosis(self, data):
        self.diagnosis.update(
            cpu=number(raw(data, 16, 7), 0, 100, 0.01),
            signal_to_noise_db=number(raw(data, 23, 7), 0, 126, 1.0, -30.0),
            dropped_pings=raw(data, 30, 10),
            version=[raw(data, 40, 4), raw(data, 44, 5), raw(data, 49, 5)])
        code = raw(data, 54, 5)
        if 1 <= code <= len(FAULTS):
            self.diagnosis["troubles"][FAULTS[code - 1]] = {
                "present": raw(data, 59, 1) == 1, "count": raw(data, 60, 4)}

    def _take_header(self, data, delta, now_ms):
        events = self._drop("lists_torn") if self.next else set()
        self.headers += delta
        n, counter = raw(data, 16, 6), raw(data, 24, 12)
        if self.header_counter is not None:
            delta = (counter - self.header_counter) % 4096
            self.counts["lists_lost"] += delta - 1 if 0 < delta < 2048 else 0
        self.header_counter = counter
        if n > MAX_OBJECTS or raw(data, 61, 3) != INTERFACE_VERSION:
            return events | self._drop("lists_refused")
        self.next = {
            "number": n, "counter": counter, "header_ms": now_ms,
            "synchronised": raw(data, 22, 2) == 1, "truncated": raw(data, 60, 1) == 1,
            "latency_s": number(raw(data, 36, 12), 0, 4094, 0.001),
            "cycle_s": number(raw(data, 48, 12), 0, 4094, 0.01),
            "capture": None, "objects": {}, "parts": {}, "motions": [],
            "corners": {}, "viewed": False, "areas": None}
        return events

    def _take_time(self, data, delta):
        """Time says not of which list it is: it is the newest header's when no more of its
        kind got lost than headers came and got lost."""
        headers, self.headers = self.headers, 0
        if not self.next:
            self.counts["frames_orphaned"] += 1
            return set()
        if delta > headers:
            return self._drop("lists_mixed")
        self.next["capture"] = (raw(data, 16, 32), raw(data, 48, 16))
        return self._finish()

    def _take_object(self, kind, data):
        if not self.next:
            self.counts["frames_orphaned"] += 1
            return set()
        fd, parts = kind == FD, self.next["parts"]
        object_id = raw(data, 24 if fd else 16, 8)
        counter = raw(data, 32, 12) if fd else raw(data, 24, 4)
        if (counter != self.next["counter"] & (0xFFF if fd else 0xF)
                or object_id not in parts and len(parts) >= self.next["number"]
                or kind in parts.get(object_id, ())
                or any((FD in kinds) != fd for kinds in parts.values())):
            return self._drop("lists_mixed")
        parts.setdefault(object_id, set()).add(kind)
        o = self.next["objects"].setdefault(object_id, dict(
            dict.fromkeys(VALUES), id=object_id, measurement="New", shape="Unknown",
            motion="Unknown", wall_id=0, behind_no_wall=False, in_free_view=False, fd=False,
            at_limit=[]))
        object_take(o, kind, data)
        return self._finish()

    def _take_motion(self, data):
        """Whatever it says, it spoils no list."""
        new = self.next
        if (not new or len(new["motions"]) >= new["number"]
                or raw(data, 24, 4) != new["counter"] & 0xF):
            self.counts["frames_orphaned"] += 1
        else:
            new["motions"].append(data)

    def _take_corner(self, data):
        """Nor does a corner.  One that cannot be spoils its area."""
        new = self.next
        if not new or raw(data, 16, 4) != new["counter"] & 0xF:
            self.counts["frames_orphaned"] += 1
            return
        new["viewed"] = True
        wall, area, corner, n = (raw(data, at, 4) for at in (20, 24, 28, 32))
        if n == 0 or area >= MAX_AREAS:
            return
        at = [number(signed(data, start, 14), -8191, 8191, 0.02) for start in (36, 50)]
        said, corners = new["corners"].setdefault(area, ((wall, n), {}))
        if said != (wall, n) or corner >= n or n > MAX_CORNERS or None in at:
            new["corners"][area] = (None, {})
        else:
            corners[corner] = at

    @staticmethod
    def _areas(corners):
        """Those of which all corners came."""
        return [{"wall_id": said[0], "corners_m": [found[k] for k in range(said[1])]}
                for _, (said, found) in sorted(corners.items())
                if said and said[1] >= 3 and len(found) == said[1]]

    def _finish(self):
        new = self.next
        whole = ({FD}, {OBJECT_STATE, DYNAMICS, QUALITY})
        if (not new["capture"] or len(new["parts"]) != new["number"]
                or any(kinds not in whole for kinds in new["parts"].values())):
            return set()
        kinds = {HEADER, TIME}.union(*new["parts"].values())
        if any(self.channels[k].state != "VALID" for k in kinds):
            return self._drop("lists_unproven")
        if self.list:
            delta = (new["counter"] - self.list["counter"]) % 4096
            if delta == 0 or delta >= 2048 and new["capture"] <= self.list["capture"]:
                return self._drop("lists_repeated")
        if self.channels[MOTION].state == "VALID":
            for object_id, data in {raw(d, 16, 8): d for d in new["motions"]}.items():
                if object_id in new["objects"]:
                    object_take(new["objects"][object_id], MOTION, data)
        if new["viewed"] and self.channels[VIEW].state == "VALID":
            new["areas"] = self._areas(new["corners"])
        self.list, self.next = new, None
        self.good_ms[HEADER] = new["header_ms"]
        self.counts["lists_whole"] += 1
        return {NEW_LIST}

    def _list_link(self):
        states = [self.channels[k].state for k in LIST_KINDS]
        if "INVALID" in states:
            return "INVALID"
        return "INIT" if states[:2] == ["VALID", "INIT"] else states[0]

    def get(self, now_ms):
        """What to know now; "list" is None when none is new enough."""
        self.tick(now_ms)
        links = {"status": self.channels[STATUS].state, "list": self._list_link(),
                 "diagnosis": self.channels[DIAGNOSIS].state}
        status = self.status if links["status"] == "VALID" else self._last_word()
        new = self.list
        age_ms = None
        if new and new["latency_s"] is not None:
            age_ms = round(new["latency_s"] * 1000) + now_ms - new["header_ms"]
        trust = "none"
        if (status and new and links["list"] == "VALID" and status["source"] in self.sources
                and (age_ms is None or age_ms <= self.age_ms)):
            if status["state"] == "Active":
                trust = "objects" if new["truncated"] or age_ms is None else "full"
            elif status["state"] == "Degraded":
                trust = "objects"
        return {"trust": trust, "links": links, "status": status, "list": new,
                "age_ms": age_ms, "diagnosis": self.diagnosis, "counts": self.counts}


def log_frames(lines):
    """(time in us, identifier, data) of the data frames with 11 bits of a candump -L log."""
    form = re.compile(r"\((\d+)\.(\d{6})\) \S+ ([0-9A-Fa-f]{3})#(?:#[0-9A-Fa-f])?"
                      r"((?:[0-9A-Fa-f]{2})*)(?:\s.*)?$")
    for line in lines:
        match = form.match(line.strip())
        if match:
            yield (int(match[1]) * 1000000 + int(match[2]), int(match[3], 16),
                   bytes.fromhex(match[4]))


def bus_frames(name):
    """The same of a bus; None: nothing came for 50 ms.  Times are monotonic."""
    try:
        import can  # only here: a log needs no library
    except ImportError:
        sys.exit("anlos_receiver.py: a bus needs python3-can: apt install python3-can")
    interface, channel = name.split(":", 1)
    with can.Bus(interface=interface, channel=channel, fd=True) as bus:
        while True:
            message = bus.recv(0.05)
            now_us = time.monotonic_ns() // 1000
            if message is None:
                yield now_us, None, None
            elif not (message.is_extended_id or message.is_remote_frame
                      or message.is_error_frame):
                yield now_us, message.arbitration_id, bytes(message.data)


def as_json(view, time_us):
    new = view["list"]
    return {"time_us": time_us, "trust": view["trust"], "links": view["links"],
            "status": view["status"], "counter": new["counter"], "age_ms": view["age_ms"],
            "truncated": new["truncated"], "synchronised": new["synchronised"],
            "capture_s": new["capture"][0], "capture_fraction": new["capture"][1],
            "latency_s": new["latency_s"], "cycle_s": new["cycle_s"],
            "objects": list(new["objects"].values()), "areas": new["areas"]}


def as_text(view, time_us):
    def show(o, name, unit):
        more = "+" if name in o["at_limit"] else ""
        return "?" if o[name] is None else f"{o[name]:.2f}{more}{unit}"

    new, status = view["list"], view["status"] or {"state": None}
    age = "?" if view["age_ms"] is None else view["age_ms"]
    head = (f"{time_us / 1e6:.3f} list {new['counter']} {status['state'] or 'no state'} "
            f"trust {view['trust']} age {age} ms")
    return "; ".join([head] + [
        f"{o['id']} {o['measurement']} {o['shape']} x {show(o, 'x_m', ' m')} "
        f"y {show(o, 'y_m', ' m')} z {show(o, 'z_m', ' m')} vx {show(o, 'vx_m_s', ' m/s')} "
        f"vy {show(o, 'vy_m_s', ' m/s')} existence {show(o, 'existence', '')}"
        for o in new["objects"].values()])


def run(frames, receiver, show_json):
    for time_us, frame_id, data in frames:
        now_ms = time_us // 1000
        events = (receiver.tick(now_ms) if frame_id is None
                  else receiver.frame(frame_id, data, now_ms))
        if TIMEOUT in events:
            links = receiver.get(now_ms)["links"]
            print(json.dumps({"time_us": time_us, "timeout": links}) if show_json
                  else f"{time_us / 1e6:.3f} time-out: {links}", flush=True)
        if NEW_LIST in events:
            view = receiver.get(now_ms)
            print(json.dumps(as_json(view, time_us)) if show_json
                  else as_text(view, time_us), flush=True)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter,
        usage=argparse.SUPPRESS, add_help=False)
    parser.add_argument("source", help=argparse.SUPPRESS)
    parser.add_argument("--first-id", type=lambda t: int(t, 16), default=0x400,
                        help=argparse.SUPPRESS)
    parser.add_argument("--any-source", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--scan", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--json", action="store_true", help=argparse.SUPPRESS)
    if "-h" in sys.argv[1:] or "--help" in sys.argv[1:]:
        print(__doc__.strip())
        return 0
    args = parser.parse_args()
    code = 0
    try:
        receiver = Receiver(args.first_id, SOURCES[:3] if args.any_source else ("Live",))
        if args.scan:
            receiver.list_ms = receiver.age_ms = math.inf
        if re.match(r"[a-z_]+:", args.source):
            run(bus_frames(args.source), receiver, args.json)
        elif args.source == "-":
            run(log_frames(sys.stdin), receiver, args.json)
        else:
            with open(args.source, encoding="ascii", errors="replace") as file:
                run(log_frames(file), receiver, args.json)
    except KeyboardInterrupt:
        code = 130
    except (OSError, ValueError) as err:
        print(f"anlos_receiver.py: {err}", file=sys.stderr)
        return 2
    if args.json:
        print(json.dumps({"counts": receiver.counts}))
    else:
        counts = ", ".join(f"{name} {n}" for name, n in receiver.counts.items() if n)
        print(counts or "no frame of this sensor", file=sys.stderr)
    return code or (0 if receiver.counts["lists_whole"] else 1)


if __name__ == "__main__":
    sys.exit(main())
