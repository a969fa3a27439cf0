"""check_dbc.py DBC PROGRAM: does canmatrix, which is not ours, read our DBC, and do the
frames that PROGRAM prints decode to the values that it says it put in?"""
import math
import re
import subprocess
import sys

try:
    import canmatrix
    import canmatrix.formats
except ImportError as error:
    print(f"skipped: {error} (Debian package python3-canmatrix)")
    sys.exit(77)

MESSAGES = {
    0x400: "Status", 0x402: "ListHeader", 0x403: "Time",
    0x404: "ObjectState", 0x405: "ObjectDynamics", 0x406: "ObjectQuality",
}
ROUNDED_UP = {"SigmaX", "SigmaY"}
failures = []


def check(holds, text):
    if not holds:
        failures.append(text)


def check_layout(db):
    check({f.arbitration_id.id: f.name for f in db.frames} == MESSAGES, "messages")
    for frame in db.frames:
        used = set()
        check(frame.size == 8 and not frame.is_fd, f"{frame.name}: not 8 bytes")
        check(frame.comment, f"{frame.name}: no comment")
        for signal in frame.signals:
            name = f"{frame.name}.{signal.name}"
            bits = set(range(signal.start_bit, signal.start_bit + signal.size))
            check(signal.is_little_endian, f"{name}: not Intel")
            check(max(bits) < 64, f"{name}: beyond 8 bytes")
            check(not bits & used, f"{name}: overlaps")
            used |= bits
            check(signal.comment, f"{name}: no comment")
            span = 2**signal.size
            low = -span // 2 if signal.is_signed else 0
            ends = [(end - signal.offset) / signal.factor
                    for end in (signal.min, signal.max)]
            check(all(end == round(end) for end in ends), f"{name}: range between steps")
            check(low <= ends[0] < ends[1] < low + span, f"{name}: range does not fit")
            for raw, text in signal.values.items():
                inside = ends[0] <= raw <= ends[1]
                check(inside != (text == "NotAvailable"), f"{name}: value {text}")
        check(set(range(16)) <= used, f"{frame.name}: E2E bits")
    status = db.frame_by_name("Status")
    check(status.cycle_time == 100, "Status: cycle time")


def missing_value(signal):
    for raw, text in signal.values.items():
        if text == "NotAvailable":
            return raw
    return None


def check_signal(frame, name, decoded, expected):
    signal = frame.signal_by_name(name)
    where = f"{frame.name}.{name}"
    if math.isnan(expected):
        check(decoded.raw_value == missing_value(signal), f"{where}: not NotAvailable")
        return
    value, step = float(decoded.phys_value), float(signal.factor)
    error = value - expected
    low, high = (0, step) if name in ROUNDED_UP else (-step / 2, step / 2)
    slack = 1e-6 * max(1, abs(expected))
    check(low - slack <= error <= high + slack,
          f"{where}: {value}, expected {expected}")


def check_frames(db, lines):
    seen = {}
    for frame_line, said in zip(lines[::2], lines[1::2]):
        match = re.fullmatch(r"\(\d+\.\d{6}\) (\w+) ([0-9A-F]{3})#([0-9A-F]{16})",
                             frame_line)
        if not match:
            failures.append(f"not a line of candump -L: {frame_line}")
            continue
        number, data = int(match[2], 16), bytes.fromhex(match[3])
        decoded = db.decode(canmatrix.ArbitrationId(number, extended=False), data)
        words = said.split()
        frame = db.frame_by_name(words[1])
        check(frame.arbitration_id.id == number, f"{words[1]}: identifier {number:x}")
        values = dict(word.split("=") for word in words[2:])
        values.update(E2eCrc=0, E2eCounter=0, E2eDataIdNibble=0)
        check(set(values) == {s.name for s in frame.signals}, f"{words[1]}: signals")
        for name, value in values.items():
            check_signal(frame, name, decoded[name], float(value))
        seen[words[1]] = seen.get(words[1], 0) + 1
    check(set(seen) == set(MESSAGES.values()), f"messages printed: {seen}")
    return sum(seen.values())


def main():
    dbc, program = sys.argv[1:]
    db = canmatrix.formats.loadp_flat(dbc)
    check_layout(db)
    output = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    count = check_frames(db, output.splitlines())
    for failure in failures:
        print(failure)
    print(f"{count} frames decoded, {len(failures)} failures")
    return 1 if failures else 0


sys.exit(main())
