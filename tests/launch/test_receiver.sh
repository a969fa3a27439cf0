#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The receiver for the vehicle's side as an integrator takes it: by strict compilers, as its
# page shows, in Python with and without python3-can, and on what simulated drives send.
#   test_receiver.sh ANLOS RECEIVER_LOG PYTHON3
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"

anlos=${1:?the program anlos}
receiver_log=${2:?the receiver in C on a log}
python=${3:?python3 of Debian}
receiver=$root/launch/receiver
strict=(-std=c99 -pedantic -pedantic-errors -Wall -Wextra -Wconversion -Wsign-conversion -Werror
    -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wcast-qual -Wundef -Wdouble-promotion
    -Wfloat-conversion -I "$receiver")
compilers=()
for compiler in gcc clang; do
    if command -v $compiler >/dev/null; then compilers+=("$compiler"); fi
done

# The example of the page, as it stands there.
example() {
    # shellcheck disable=SC2016 # marks of the page, no commands
    sed -n '/^```c$/,/^```$/{/^```/!p}' "$receiver/README.md" >"$work/example.c"
    [ -s "$work/example.c" ] || complain "the page has no example"
}

test_strict_compilers_take_it() {
    local compiler
    for compiler in "${compilers[@]}"; do
        run $compiler "${strict[@]}" -O2 -c "$receiver/anlos_receiver.c" -o "$work/$compiler.o"
        expect_code 0
        [ -z "$output" ] || complain "$compiler warns"
    done
}

test_it_needs_nothing_but_memory_to_be_copied_and_cleared() {
    run gcc "${strict[@]}" -O0 -ffreestanding -c "$receiver/anlos_receiver.c" -o "$work/bare.o"
    expect_code 0
    run nm -u "$work/bare.o"
    output=$(awk '$1 == "U" && $2 !~ /^(memcpy|memset|_GLOBAL_OFFSET_TABLE_|__stack_chk_fail)$/' \
        <<<"$output")
    [ -z "$output" ] || complain "asks for more"
    run size -A "$work/bare.o"
    output=$(awk '$1 ~ /^\.(data|bss)$/ && $2 > 0' <<<"$output")
    [ -z "$output" ] || complain "has globals"
}

test_the_header_is_good_for_cxx() {
    if ! command -v g++ >/dev/null; then return; fi
    printf '#include "anlos_receiver.h"\n' >"$work/header.cpp"
    run g++ -std=c++11 -Wall -Wextra -Werror -I "$receiver" -c "$work/header.cpp" -o "$work/x.o"
    expect_code 0
}

# One frame of the example's page goes in, then it ends.
test_the_example_of_the_page_compiles_and_runs() {
    local compiler
    example
    cat >"$work/main.c" <<'C'
#include <stdint.h>
int receive(uint32_t *id, uint8_t *data, uint8_t *length, uint32_t *now_ms);
void brake_for(float x_m, float y_m, float sigma_x_m, uint32_t age_ms);
void sensor_task(void);
static int calls;
int receive(uint32_t *id, uint8_t *data, uint8_t *length, uint32_t *now_ms)
{
    *id = 0x400;
    *length = data[0] = 0;
    *now_ms = (uint32_t)calls;
    return 1 - calls++;
}
void brake_for(float x_m, float y_m, float sigma_x_m, uint32_t age_ms)
{
    (void)x_m, (void)y_m, (void)sigma_x_m, (void)age_ms;
    calls = 100;
}
int main(void)
{
    sensor_task();
    return calls == 3 ? 0 : 1;
}
C
    for compiler in "${compilers[@]}"; do
        run $compiler "${strict[@]}" "$work/example.c" "$work/main.c" \
            "$receiver/anlos_receiver.c" -o "$work/example"
        expect_code 0
        run "$work/example"
        expect_code 0
    done
}

# Frames of a log a millisecond apart, so that how busy the machine was makes no difference.
pace() {
    awk '{ printf "(%d.%06d)", 1000 + int(NR / 1000), NR % 1000 * 1000; $1 = ""; print }' "$1"
}

# The log of a scan, with objects in frames of 8 bytes ($work/classic) or FD ($work/fd), once.
scan() {
    local name=$1 options=""
    if [ -f "$work/$name" ]; then return; fi
    if [ "$name" = fd ]; then options="fd: yes, "; fi
    cat >"$work/$name.yaml" <<YAML
nodes: [stage, array, scan, dsp, recon, track, can, report]
array: {uri: "sim:$root/launch/scenes/corner.yaml"}
stage: {uri: "sim:?pace=fast"}
scan: {background: true}
can: {${options}uri: "log:can.candump"}
report: {folder: out}
YAML
    run "$anlos" launch "$work/$name.yaml" --run-dir "$work/run" --out "$work/out-$name"
    expect_code 0
    pace "$work/out-$name/can.candump" >"$work/$name"
}

# The log of a drive as launch/drive.yaml has it, with motions and views, until 60 objects were sent, or for as long
# as a machine gets that is too busy for its true pace: $work/drive or $work/drive-fd.
drive() {
    local name=$1 options=", motion: yes, field_of_view: yes" pid
    if [ "$name" = drive-fd ]; then options+=", fd: yes"; fi
    cat >"$work/$name.yaml" <<YAML
nodes: [array, scan, dsp, recon, wall, track, can, report]
array: {uri: "sim:$root/launch/scenes/drive-person.yaml"}
scan: {mode: fixed}
dsp: {background: adaptive, background_s: 10}
recon: {frames: {pings: 8, sum: power, every: ping}}
wall: {from: echoes}
can: {uri: "sim:$root/launch/scenes/drive-person.yaml?log=can.candump"$options}
report: {folder: out}
YAML
    "$anlos" launch "$work/$name.yaml" --run-dir "$work/run" --out "$work/out-$name" \
        >"$work/says" 2>&1 &
    pid=$!
    # tail waits for the file and for what is written; it ends with the launcher.
    timeout 100 tail -n +1 --pid=$pid -F "$work/out-$name/can.candump" 2>"$work/tail" |
        grep -m 60 -E ' (404#|408##)' >"$work/objects" || true
    run cat "$work/says"
    kill -TERM $pid 2>/dev/null || true
    wait $pid || true
    pace "$work/out-$name/can.candump" >"$work/$name"
    objects=$(($(wc -l <"$work/objects") - 2)) # the first two may not be believed yet
    if [ "$objects" -lt 0 ]; then objects=0; fi
    echo "$name: $objects objects or more"
}

compare() {
    run "$python" "$here/check_receiver.py" "$work/$1" "$anlos" "$receiver_log" \
        "$receiver/anlos_receiver.py" "$2"
    expect_code 0
    expect_text "the same"
}

test_a_drive_is_the_same_to_c_python_and_decode() {
    local name objects
    for name in drive drive-fd; do
        drive $name
        compare $name "$objects"
    done
}

test_a_scan_is_the_same_to_c_python_and_decode() {
    local name
    for name in classic fd; do
        scan $name
        compare $name 3
    done
}

# A frame goes, and two are turned around: fewer lists, the same of both.
test_a_bus_that_loses_is_the_same_to_c_and_python() {
    scan classic
    awk 'NR != 5 { if (NR == 11) held = $0; else { print; if (held) print held; held = "" } }' \
        "$work/classic" >"$work/lossy"
    run "$receiver_log" "$work/lossy"
    expect_code 0
    tail -n 1 <<<"$output" >"$work/c"
    run "$python" "$receiver/anlos_receiver.py" "$work/lossy" --any-source --json
    expect_code 0
    tail -n 1 <<<"$output" >"$work/python"
    run "$python" -c 'import json, sys
a, b = (json.load(open(name))["counts"] for name in sys.argv[1:])
assert a == b, (a, b)
assert a["frames_lost"] > 0, a' \
        "$work/c" "$work/python"
    expect_code 0
}

# A scan that has ended says so; the same without its last words fell silent.
test_a_system_that_was_stopped_does_not_time_out() {
    scan classic
    cat >"$work/stopped.py" <<'PY'
import sys
import anlos_receiver as a

with open(sys.argv[1], encoding="ascii") as log:
    frames = list(a.log_frames(log))
said = [i for i, (_, frame_id, data) in enumerate(frames)
        if frame_id == 0x400 and a.raw(data, 21, 1)]
assert len(said) == 3 and said[0] > 10, said
for n, state, silent in ((len(frames), "Shutdown", False), (said[0], None, True)):
    receiver = a.Receiver(sources=a.SOURCES)
    for time_us, frame_id, data in frames[:n]:
        receiver.frame(frame_id, data, time_us // 1000)
    for ms in range(0, 10000, 50):
        receiver.tick(time_us // 1000 + ms)
    view = receiver.get(time_us // 1000 + 10000)
    assert (view["status"] or {"state": None})["state"] == state, view
    assert view["trust"] == "none" and view["list"] is None, view
    assert (view["counts"]["timeouts"] > 0) == silent, view
PY
    run env PYTHONPATH="$receiver" PYTHONDONTWRITEBYTECODE=1 "$python" "$work/stopped.py" \
        "$work/classic"
    expect_code 0
}

test_a_simulation_is_trusted_only_where_that_is_asked_for() {
    scan classic
    run "$python" "$receiver/anlos_receiver.py" "$work/classic"
    expect_code 0
    expect_text "trust none"
    expect_no_text "trust full"
    run "$python" "$receiver/anlos_receiver.py" "$work/classic" --any-source --scan
    expect_text "trust full"
}

test_python_says_what_is_wrong() {
    scan classic
    run "$python" "$receiver/anlos_receiver.py" --help
    expect_code 0
    expect_text "--first-id"
    run "$python" "$receiver/anlos_receiver.py" "$work/no-such-log"
    expect_code 2
    expect_text "no-such-log"
    run "$python" "$receiver/anlos_receiver.py" "$work/classic" --first-id 401
    expect_code 2
    expect_text "multiple of 0x10"
    run "$python" "$receiver/anlos_receiver.py" "$work/classic" --first-id 500
    expect_code 1
    expect_text "no frame of this sensor"
    run "$python" "$receiver/anlos_receiver.py"
    expect_code 2
}

test_a_log_needs_no_python3_can_and_a_bus_says_that_it_does() {
    scan classic
    mkdir -p "$work/without"
    printf 'raise ImportError("not here")\n' >"$work/without/can.py"
    run env PYTHONPATH="$work/without" "$python" "$receiver/anlos_receiver.py" "$work/classic"
    expect_code 0
    run env PYTHONPATH="$work/without" "$python" "$receiver/anlos_receiver.py" socketcan:can0
    expect_code 1
    expect_text "apt install python3-can"
}

# Its own virtual bus: what a log says comes as frames of a bus.
test_a_bus_of_python3_can_is_heard() {
    if ! "$python" -c 'import can' 2>/dev/null; then
        echo "skipped: there is no python3-can (launch/setup --tests)"
        return
    fi
    scan fd
    cat >"$work/bus.py" <<'PY'
import sys
import can
import anlos_receiver as a

with open(sys.argv[1], encoding="ascii") as log:
    sent = [(i, d) for _, i, d in a.log_frames(log)][:500]
with can.Bus(interface="virtual", channel="bus", fd=True) as vehicle:
    heard = a.bus_frames("virtual:bus")
    assert next(heard)[1] is None  # it is open; nothing has come
    vehicle.send(can.Message(arbitration_id=0x400, is_extended_id=True, data=[1]))
    for frame_id, data in sent:
        vehicle.send(can.Message(arbitration_id=frame_id, is_extended_id=False, data=data,
                                 is_fd=len(data) > 8))
    for frame_id, data in sent:
        assert next(heard)[1:] == (frame_id, data)
    heard.close()
PY
    run env PYTHONPATH="$receiver" PYTHONDONTWRITEBYTECODE=1 "$python" "$work/bus.py" "$work/fd"
    expect_code 0
}

run_tests
