# SPDX-License-Identifier: MIT
"""A log of the vehicle's bus through three readers: the receiver in C, the same in Python, and
`anlos can decode`, of which lists are put together here.  All must tell of the same lists
and the same objects.

    check_receiver.py LOG ANLOS RECEIVER_LOG RECEIVER_PY [MIN_OBJECTS]"""

import json
import math
import subprocess
import sys

# Signal of the DBC, its name in the receiver, the unit of the receiver in that of the DBC.
CLASSIC = {"X": ("x_m", 1), "Y": ("y_m", 1), "Z": ("z_m", 1), "Vx": ("vx_m_s", 1),
           "Vy": ("vy_m_s", 1), "Existence": ("existence", 0.01), "SigmaX": ("sigma_x_m", 1),
           "SigmaY": ("sigma_y_m", 1), "Correlation": ("correlation_xy", 1),
           "SigmaV": ("sigma_v_m_s", 1), "Length": ("length_m", 1), "Width": ("width_m", 1)}
FD = {"X": ("x_m", 1), "Y": ("y_m", 1), "Z": ("z_m", 1), "Vx": ("vx_m_s", 1),
      "Vy": ("vy_m_s", 1), "Existence": ("existence", 0.01),
      "SigmaV": ("sigma_v_m_s", 1), "Length": ("length_m", 1), "Width": ("width_m", 1),
      "Height": ("height_m", 1), "ClassProbability": ("shape_probability", 0.01),
      "Unseen": ("unseen_s", 1), "Age": ("age_s", 1)}
DEGREE = math.pi / 180
MOTION = {"Course": ("course_rad", DEGREE), "SigmaCourse": ("sigma_course_rad", DEGREE),
          "SigmaVx": ("sigma_vx_m_s", 1), "SigmaVy": ("sigma_vy_m_s", 1),
          "CorrelationV": ("correlation_v", 1)}
NAMES = {"Measurement": "measurement", "Class": "shape", "DynamicProperty": "motion"}
FLAGS = {"BehindNoWall": "behind_no_wall", "InFreeView": "in_free_view"}


def lines_of(*command):
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode not in (0, 1):
        sys.exit(f"{command[0]} ended with {done.returncode}")
    return [json.loads(line) for line in done.stdout.splitlines()]


def same(a, b, tolerance):
    if a is None or b is None:
        return a is b
    return math.isclose(a, b, rel_tol=1e-5, abs_tol=tolerance)


def decoded_lists(log, anlos):
    """What decode says of whole lists: by counter, in their order."""
    lists, now, state = [], None, None
    for line in lines_of(anlos, "can", "decode", log, "--json"):
        name, s = line.get("name"), line.get("signals")
        if s and line["e2e"] not in ("ok", "some lost"):
            continue
        if name == "Status":
            state = s
        elif name == "ListHeader":
            now = {"header": s, "objects": {}, "time": None, "corners": []}
            lists.append(now)
        elif name == "Time":
            now["time"] = s
        elif name == "FieldOfView":
            now["corners"].append(s)
        elif name and name.startswith("Object"):
            now["objects"].setdefault(s["Id"], {}).update(s)
        if name not in (None, "Status", "Diagnosis") and now:
            now["status"] = state
    return [found for found in lists
            if found["time"] and len(found["objects"]) == found["header"]["Number"]]


def fail(what, *values):
    sys.exit("\n  ".join([what, *map(str, values)]))


def check_object(o, s):
    fd = "CovarianceXX" in s
    for signal, (name, unit) in {**(FD if fd else CLASSIC), **MOTION}.items():
        value = s.get(signal)  # without ObjectMotion its values are not available
        value = value if value is None else value * unit
        if not same(o[name], value, 1e-5):
            fail(f"object {o['id']}, {signal}", o, s)
    if fd and not same(o["sigma_x_m"] and o["sigma_x_m"] ** 2, s["CovarianceXX"], 1e-6):
        fail(f"object {o['id']}, CovarianceXX", o, s)
    if any(o[name] != s[signal] for signal, name in NAMES.items()):
        fail(f"object {o['id']}", o, s)
    if fd and any(o[name] != (s[signal] == "Yes") for signal, name in FLAGS.items()):
        fail(f"object {o['id']}", o, s)
    if fd and o["wall_id"] != s["WallId"]:
        fail(f"object {o['id']}, WallId", o, s)


def check_areas(found, frames):
    """As the frames come from a sensor that is well: area by area, corner by corner."""
    if not frames:
        if found["areas"] is not None:
            fail("areas of no frame", found)
        return
    corners = [(c["WallId"], c["X"], c["Y"]) for c in frames if c["Corners"]]
    told = [(a["wall_id"], x, y) for a in found["areas"] or () for x, y in a["corners_m"]]
    if found["areas"] is None or len(corners) != len(told) or any(
            a[0] != b[0] or not same(a[1], b[1], 1e-4) or not same(a[2], b[2], 1e-4)
            for a, b in zip(corners, told)):
        fail("other areas", found["areas"], frames)


def check_list(found, decoded):
    header, taken = decoded["header"], decoded["time"]
    seconds = found["capture_s"] + found["capture_fraction"] / 65536
    if (not same(found["latency_s"], header["Latency"] and header["Latency"] / 1000, 1e-6)
            or not same(found["cycle_s"], header["Cycle"] and header["Cycle"] / 1000, 1e-6)
            or found["truncated"] != (header["Truncated"] == "Truncated")
            or found["synchronised"] != (header["TimeSync"] == "Synchronised")
            or abs(seconds - taken["Seconds"] - taken["Fraction"]) > 1e-5):
        fail(f"list {header['Counter']}", found, decoded)
    check_areas(found, decoded["corners"])
    if {o["id"] for o in found["objects"]} != set(decoded["objects"]):
        fail(f"list {header['Counter']}: other objects", found, decoded)
    for o in found["objects"]:
        check_object(o, decoded["objects"][o["id"]])


def without_first_of_each_kind(lists):
    """A kind of frames is believed from its second good one on."""
    heard, believed = {}, []
    for decoded in lists:
        fd = any("CovarianceXX" in s for s in decoded["objects"].values())
        n = len(decoded["objects"])
        for kind, count in (("list", 1), ("fd" if fd else "classic", n)):
            heard[kind] = heard.get(kind, 0) + count
        motions = [s for s in decoded["objects"].values() if "Course" in s]
        heard["view"] = heard.get("view", 0) + len(decoded["corners"])
        if heard["view"] < 2:
            decoded["corners"] = []
        heard["motion"] = heard.get("motion", 0) + len(motions)
        for s in motions if heard["motion"] < 2 else ():
            for signal in MOTION:
                del s[signal]
        if heard["list"] >= 2 and (not n or heard["fd" if fd else "classic"] >= 2):
            believed.append(decoded)
    return believed


def close(a, b):
    """Values of two readers: of floats of 32 and of 64 bits."""
    if isinstance(a, float) or isinstance(b, float):
        return same(a, b, 1e-5)
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(close(a[k], b[k]) for k in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(map(close, a, b))
    return a == b


def flat(line):
    """A line of the Python receiver as the C one's are."""
    line = dict(line)
    status = line.pop("status") or {}
    for name in ("state", "temperature_c", "sound_speed_m_s", "range_m"):
        line[name] = status.get(name)
    return line


def main():
    log, anlos, in_c, in_python = sys.argv[1:5]
    least = int(sys.argv[5]) if len(sys.argv) > 5 else 0
    c = lines_of(in_c, log)
    python = [line for line in lines_of(sys.executable, in_python, log, "--any-source",
                                        "--json") if "timeout" not in line]
    if len(c) != len(python):
        fail(f"{len(c) - 1} lists in C, {len(python) - 1} in Python", c[-1], python[-1])
    if c[-1] != python[-1]:
        fail("other counts", c[-1], python[-1])
    for a, b in zip(c[:-1], map(flat, python[:-1])):
        if not close(a, b):
            fail("C and Python differ", a, b)
    expected = without_first_of_each_kind(decoded_lists(log, anlos))
    if [line["counter"] for line in c[:-1]] != [e["header"]["Counter"] for e in expected]:
        fail("other lists than of decode", [line["counter"] for line in c[:-1]],
             [e["header"]["Counter"] for e in expected])
    for a, b in zip(c[:-1], expected):
        check_list(a, b)
        if a["state"] is not None and a["state"] != b["status"]["State"]:
            fail("another state", a, b)
    n = sum(len(line["objects"]) for line in c[:-1])
    if n < least or len(c) < 3:
        fail(f"only {n} objects in {len(c) - 1} lists")
    courses = sum(o["course_rad"] is not None for line in c[:-1] for o in line["objects"])
    areas = sum(len(line["areas"] or ()) for line in c[:-1])
    print(f"{len(c) - 1} lists with {n} objects, {courses} of them with a course, and {areas} "
          "areas: the same")


main()
