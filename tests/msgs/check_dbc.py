# SPDX-License-Identifier: MIT
"""check_dbc.py DBC PRINTER READER FRAMES: does canmatrix, which is not ours, read our DBC, do
the frames that PRINTER prints decode to the values that it says it put in, does READER read
what canmatrix encodes for the sensor, and does what was on a bus before still mean the same?
Can readers take it that go line by line?
The end-to-end protection is worked out here once more.

check_dbc.py --record DBC PRINTER >FRAMES: some frames, each with the raw values that canmatrix
found in it by that DBC.  frames.txt may only grow: it is of the DBC of commit d0fa7e7, and for
each frame that came later, of the first DBC that had it."""
import decimal
import math
import re
import struct
import subprocess
import sys

try:
    import canmatrix
    import canmatrix.formats
except ImportError as error:
    print(f"skipped: {error} (Debian package python3-canmatrix)")
    sys.exit(77)

MESSAGES = {  # identifier: name, bytes, sender, cycle time
    0x400: ("Status", 8, "Anlos", 100), 0x401: ("Diagnosis", 8, "Anlos", 1000),
    0x402: ("ListHeader", 8, "Anlos", 0), 0x403: ("Time", 8, "Anlos", 0),
    0x404: ("ObjectState", 8, "Anlos", 0), 0x405: ("ObjectDynamics", 8, "Anlos", 0),
    0x406: ("ObjectQuality", 8, "Anlos", 0), 0x407: ("ObjectMotion", 8, "Anlos", 0),
    0x408: ("ObjectFD", 64, "Anlos", 0),
    0x409: ("FieldOfView", 8, "Anlos", 0),
    0x40B: ("WallEndsIn", 8, "Vehicle", 100),
    0x40C: ("EgoMotion", 8, "Vehicle", 20), 0x40D: ("Ambient", 8, "Vehicle", 1000),
    0x40E: ("WallIn", 8, "Vehicle", 100), 0x40F: ("SaveRequest", 8, "Vehicle", 1000),
}
CYCLIC, EVENT, BOTH = "Cyclic", "Event", "CyclicAndEvent"
SEND_TYPES = {"Status": BOTH, "Diagnosis": CYCLIC, "EgoMotion": CYCLIC, "Ambient": CYCLIC,
              "WallIn": CYCLIC, "WallEndsIn": CYCLIC, "SaveRequest": BOTH}  # the others: with each list
ROUNDED_UP = {"SigmaX", "SigmaY", "SigmaV", "SigmaAzimuth", "SigmaDistance", "SigmaCourse",
              "SigmaVx", "SigmaVy"}
failures = []


def check(holds, text):
    if not holds:
        failures.append(text)


def crc(data, width, polynomial, start):
    value, top = start, 1 << (width - 1)
    for byte in data:
        value ^= byte << (width - 8)
        for _ in range(8):
            value = (value << 1) ^ (polynomial if value & top else 0)
            value &= (1 << width) - 1
    return value


def header(identifier, data, counter):
    """The bytes of E2E protection that belong in front of data."""
    if len(data) > 8:
        low_first = identifier.to_bytes(2, "little")
        head = bytes([counter % 256])
        value = crc(head + data[3:] + low_first, 16, 0x1021, 0xFFFF)
        return value.to_bytes(2, "little") + head
    head = bytes([(identifier >> 8) << 4 | counter % 15])
    return bytes([crc(bytes([identifier & 0xFF, 0]) + head + data[2:], 8, 0x1D, 0)]) + head


def check_range(frame, signal):
    name = f"{frame.name}.{signal.name}"
    span = 2**signal.size
    low = -span // 2 if signal.is_signed else 0
    ends = [(end - signal.offset) / signal.factor for end in (signal.min, signal.max)]
    check(all(end == round(end) for end in ends), f"{name}: range between steps")
    check(low <= ends[0] < ends[1] < low + span, f"{name}: range does not fit")
    for raw, text in signal.values.items():
        inside = ends[0] <= raw <= ends[1]
        check(inside != (text == "NotAvailable"), f"{name}: value {text}")


def check_start(frame, signal):
    """What a receiver has before the first frame: nothing that anybody measured."""
    name, start = f"{frame.name}.{signal.name}", signal.attributes.get("GenSigStartValue")
    if signal.is_float:
        check(start is None, f"{name}: a start value, of a float")
        return
    check(start is not None, f"{name}: no start value")
    raw = int(start or 0)
    value = raw * signal.factor + signal.offset
    check(signal.initial_value == value, f"{name}: start {signal.initial_value}, not {value}")
    missing = missing_value(signal)
    if missing is None:
        check(signal.min <= value <= signal.max, f"{name}: start {value} out of range")
    else:
        check(raw == missing, f"{name}: start {raw}, not NotAvailable")


def check_frame_layout(db, frame):
    name, size, sender, cycle = MESSAGES[frame.arbitration_id.id]
    fd = size > 8
    used = set()
    check((frame.name, frame.size, frame.is_fd) == (name, size, fd), f"{name}: frame")
    check(frame.transmitters == [sender], f"{name}: sender")
    check(frame.cycle_time == cycle, f"{name}: cycle time")
    check(frame.comment, f"{name}: no comment")
    send_type = frame.attribute("GenMsgSendType", db)
    check(send_type == SEND_TYPES.get(name, EVENT), f"{name}: sent {send_type}")
    check((cycle > 0) == (send_type != EVENT), f"{name}: a cycle of {cycle}, sent {send_type}")
    check(frame.attributes["E2EDataId"] == str(frame.arbitration_id.id), f"{name}: data ID")
    check(frame.attributes["E2EProfile"] == ("P05" if fd else "P11_Nibble"),
          f"{name}: E2E profile")
    for signal in frame.signals:
        bits = set(range(signal.start_bit, signal.start_bit + signal.size))
        where = f"{name}.{signal.name}"
        check(signal.is_little_endian, f"{where}: not Intel")
        check(max(bits) < 8 * size, f"{where}: beyond the frame")
        check(not bits & used, f"{where}: overlaps")
        check(signal.comment, f"{where}: no comment")
        check(signal.receivers == [{"Anlos": "Vehicle", "Vehicle": "Anlos"}[sender]],
              f"{where}: receiver")
        check_start(frame, signal)
        if not signal.is_float:
            check_range(frame, signal)
        used |= bits
    check(set(range(24 if fd else 16)) <= used, f"{name}: E2E bits")
    if fd:
        check(used == set(range(8 * size)), f"{name}: bits to spare")


def check_layout(db):
    check({f.arbitration_id.id for f in db.frames} == set(MESSAGES), "messages")
    for frame in db.frames:
        check_frame_layout(db, frame)


def missing_value(signal):
    for raw, text in signal.values.items():
        if text == "NotAvailable":
            return raw
    return None


def check_float(where, signal, value, expected):
    if math.isnan(expected):
        check(math.isnan(value), f"{where}: {value}, not NaN")
        return
    clamped = min(max(expected, float(signal.min)), float(signal.max))
    narrow = struct.unpack("<f", struct.pack("<f", clamped))[0]
    check(value == narrow, f"{where}: {value}, expected {narrow}")


# Each statement on its line, texts without quotes, values by whole numbers: what readers
# that go line by line (cabana, SavvyCAN) take.
NUMBER, TEXT = r"-?[0-9.]+", r'"[^"]*"'
PLAIN = {
    "BO_": r"BO_ \d+ \w+: \d+ \w+",
    "SG_": rf" SG_ \w+ : \d+\|\d+@1[+-] \({NUMBER},{NUMBER}\) \[{NUMBER}\|{NUMBER}\] {TEXT} \w+",
    "CM_": rf"CM_ (BU_ \w+ |BO_ \d+ |SG_ \d+ \w+ )?{TEXT};",
    "VAL_": rf"VAL_ \d+ \w+( -?\d+ {TEXT})+ ?;",
    "BA_": rf"BA_ {TEXT} (BO_ \d+ |SG_ \d+ \w+ )?({NUMBER}|{TEXT});",
}


def check_plain(dbc):
    with open(dbc, encoding="utf-8") as file:
        lines = [line.rstrip("\n") for line in file if line.strip() and line[0] != "\t"]
    seen = set()
    for line in lines:
        word = line.split()[0]
        seen.add(word)
        check(word not in PLAIN or re.fullmatch(PLAIN[word], line), f"not plain: {line[:60]}")
    check(seen >= set(PLAIN), f"statements: {sorted(seen)}")


def frames_of(printer):
    """identifier, data, what went into it; of lines of candump -L."""
    lines = subprocess.run([printer], check=True, capture_output=True, text=True).stdout
    for frame, said in zip(*[iter(lines.splitlines())] * 2):
        number, data = re.fullmatch(r".* ([0-9A-F]{3})#(?:#1)?([0-9A-F]+)", frame).groups()
        yield number, data, said


def raw_values(db, number, data):
    decoded = db.decode(canmatrix.ArbitrationId(int(number, 16), extended=False),
                        bytes.fromhex(data))
    return {name: repr(value.raw_value) for name, value in decoded.items() if name}


def record(dbc, printer):
    db, seen = canmatrix.formats.loadp_flat(dbc), {}
    for number, data, _ in frames_of(printer):
        name = db.frame_by_id(canmatrix.ArbitrationId(int(number, 16), extended=False)).name
        seen[name] = seen.get(name, 0) + 1
        if seen[name] <= 10:
            print(number, data, name, *(f"{s}={v}" for s, v in
                                        raw_values(db, number, data).items()))


def check_recorded(db, path):
    """Old frames: each signal that there was has its bits still, where it was."""
    with open(path, encoding="ascii") as file:
        lines = file.read().splitlines()
    for line in lines:
        number, data, name, *values = line.split()
        check(db.frame_by_name(name).arbitration_id.id == int(number, 16), f"{name} has moved")
        now = raw_values(db, number, data)
        for signal, value in (word.split("=") for word in values):
            check(now.get(signal) == value,
                  f"recorded {name}.{signal}: {now.get(signal)}, was {value}")
    check(len(lines) >= 87, f"only {len(lines)} recorded frames")
    return len(lines)


def check_signal(frame, name, decoded, expected):
    signal = frame.signal_by_name(name)
    where = f"{frame.name}.{name}"
    if signal.is_float:
        check_float(where, signal, float(decoded.phys_value), expected)
        return
    if math.isnan(expected):
        check(decoded.raw_value == missing_value(signal), f"{where}: not NotAvailable")
        return
    expected = min(max(expected, float(signal.min)), float(signal.max))
    value, step = float(decoded.phys_value), float(signal.factor)
    low, high = (0, step) if name in ROUNDED_UP else (-step / 2, step / 2)
    slack = 1e-6 * max(1, abs(expected))
    check(low - slack <= value - expected <= high + slack,
          f"{where}: {value}, expected {expected}")


def check_frames(db, lines):
    seen = {}
    for frame_line, said in zip(lines[::2], lines[1::2]):
        match = re.fullmatch(r"\(\d+\.\d{6}\) (\w+) ([0-9A-F]{3})#(#1)?((?:[0-9A-F]{2})+)",
                             frame_line)
        if not match:
            failures.append(f"not a line of candump -L: {frame_line}")
            continue
        number, data = int(match[2], 16), bytes.fromhex(match[4])
        decoded = db.decode(canmatrix.ArbitrationId(number, extended=False), data)
        words = said.split()
        frame = db.frame_by_name(words[1])
        check(frame.arbitration_id.id == number, f"{words[1]}: identifier {number:x}")
        check((frame.size, frame.is_fd) == (len(data), bool(match[3])), f"{words[1]}: size")
        expected = header(number, data, seen.get(words[1], 0))
        check(data[:len(expected)] == expected, f"{words[1]}: protection")
        values = dict(word.split("=") for word in words[2:])
        check(set(values) == {s.name for s in frame.signals if s.name[:3] != "E2e"},
              f"{words[1]}: signals")
        for name, value in values.items():
            check_signal(frame, name, decoded[name], float(value))
        seen[words[1]] = seen.get(words[1], 0) + 1
    check(set(seen) == {m[0] for m in MESSAGES.values()}, f"messages printed: {seen}")
    return sum(seen.values())


def inputs():
    """Message, physical values in steps of the layout; None: not available."""
    for i in range(40):
        yield "EgoMotion", {"Speed": round(-20 + 1.07 * i, 2),
                            "YawRate": round(300 - 15.31 * i, 2),
                            "Standstill": i % 2, "Validity": i // 2 % 2}
        yield "Ambient", {"Temperature": round(-40 + 3.1 * i, 1), "Humidity": 2.5 * i}
        yield "WallIn", {"Azimuth": round(-180 + 9.23 * i, 2), "Distance": round(1.02 * i, 2),
                         "SigmaAzimuth": round(0.3 * i, 1), "SigmaDistance": 0.03 * i,
                         "WallId": i % 16, "Validity": i % 2}
        yield "WallEndsIn", {"From": round(-102.35 + 2.6 * i, 2), "To": round(90 - 3.1 * i, 2),
                             "WallId": i % 16, "Validity": i % 2}
        yield "SaveRequest", {"Number": 1638 * i, "Reason": i % 8, "Request": i % 2}
    yield "EgoMotion", {"Speed": None, "YawRate": None, "Standstill": 1, "Validity": 0}
    yield "Ambient", {"Temperature": None, "Humidity": None}
    yield "WallIn", {"Azimuth": None, "Distance": None, "SigmaAzimuth": None,
                     "SigmaDistance": None, "WallId": 1, "Validity": 1}
    yield "WallEndsIn", {"From": None, "To": None, "WallId": 1, "Validity": 1}
    for ends in (min, max):
        yield "EgoMotion", {"Speed": ends(-327.67, 327.67), "YawRate": ends(-327.67, 327.67),
                            "Standstill": 0, "Validity": 1}


def encode(db, name, values, counter):
    frame = db.frame_by_name(name)
    raw = {}
    for signal, value in values.items():
        s = frame.signal_by_name(signal)
        raw[signal] = (missing_value(s) if value is None
                       else s.phys2raw(decimal.Decimal(str(round(value, 6)))))
    data = bytes(frame.encode(raw))
    head = header(frame.arbitration_id.id, data, counter)
    return f"{frame.arbitration_id.id:x} {(head + data[len(head):]).hex()}"


def check_inputs(db, reader):
    sent, lines, counters = list(inputs()), [], {}
    for name, values in sent:
        lines.append(encode(db, name, values, counters.get(name, 0)))
        counters[name] = counters.get(name, 0) + 1
    output = subprocess.run([reader], input="\n".join(lines) + "\n", check=True,
                            capture_output=True, text=True).stdout.splitlines()
    check(len(output) == len(sent), f"{len(output)} frames read of {len(sent)}")
    for (name, values), line in zip(sent, output):
        verdict, _, text = line.partition("|")
        check(verdict == "ok", f"{name}: {verdict}")
        read = dict(word.split("=") for word in text.split())
        check(set(read) == set(values), f"{name}: {line}")
        for signal, value in values.items():
            is_read = float(read.get(signal, "inf"))
            same = math.isnan(is_read) if value is None else abs(is_read - value) < 1e-5
            check(same, f"{name}.{signal}: {is_read}, encoded {value}")
    return len(output)


def main():
    if sys.argv[1] == "--record":
        record(*sys.argv[2:])
        return 0
    dbc, printer, reader, recorded = sys.argv[1:]
    db = canmatrix.formats.loadp_flat(dbc)
    check_layout(db)
    check_plain(dbc)
    output = subprocess.run([printer], check=True, capture_output=True, text=True).stdout
    decoded = check_frames(db, output.splitlines())
    read = check_inputs(db, reader)
    same = check_recorded(db, recorded)
    for failure in failures[:50]:
        print(failure)
    print(f"{decoded} frames decoded, {read} encoded, {same} of before, "
          f"{len(failures)} failures")
    return 1 if failures else 0


sys.exit(main())
