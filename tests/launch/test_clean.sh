#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# A clean Debian 12, which has nothing but apt, gets the packages of the build with what they
# say they need, as the README has it: whatever they forget is missing there, and only there.
# usage: test_clean.sh BUILD_DIR
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"
build=$(realpath "$1")
clean=$work/clean

for tool in cpack dpkg-deb help2man mmdebstrap unshare; do
    if ! command -v $tool >/dev/null; then
        echo "skipped: there is no $tool"
        exit 77
    fi
done
if [ "$(id -u)" != 0 ]; then
    echo "skipped: another root folder needs root"
    exit 77
fi
cpack --config "$build/CPackConfig.cmake" -B "$work" >"$work/cpack.log" 2>&1 ||
    { cat "$work/cpack.log" && exit 1; }
mapfile -t names < <(for p in "$work"/*.deb; do dpkg-deb -f "$p" Package; done)

# COMMAND... as root of the clean system, with its own /proc.
inside() {
    unshare --mount --pid --fork --kill-child --mount-proc --root="$clean" --wd=/root \
        env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 HOME=/root \
        DEBIAN_FRONTEND=noninteractive "$@"
}

files_of_clean() {
    (cd "$clean" && find etc usr opt srv var/lib -path var/lib/dpkg -prune -o -path var/lib/apt \
        -prune -o -print | grep -v __pycache__ | sort)
}

# What cannot be downloaded here is nobody's fault; everything after that is the packages'.
chmod 755 "$work"
if ! mmdebstrap --quiet --mode=root --variant=apt --skip=cleanup/apt/lists \
    --dpkgopt=force-unsafe-io bookworm "$clean" >"$work/log" 2>&1; then
    tail -n 5 "$work/log"
    echo "skipped: no Debian can be had here"
    exit 77
fi
cp /etc/resolv.conf "$clean/etc"
more=(gcc libc6-dev pkgconf libsndfile1-dev) # with which a program that uses it is compiled
if ! inside apt-get install -y --no-install-recommends "${more[@]}" >"$work/log" 2>&1; then
    tail -n 5 "$work/log"
    echo "skipped: no packages of Debian can be had here"
    exit 77
fi
mkdir "$clean/packages"
cp "$work"/*.deb "$clean/packages"
cp "$root/tests/examples/wav_to_objects.c" "$clean/root/program.c"

install_all() {
    # shellcheck disable=SC2016  # the shell inside expands it
    inside sh -c 'apt-get install -y "$@" /packages/*.deb' install "$@"
}
run install_all --simulate
found=$code
said=$output
if [ $found = 0 ] && ! install_all --download-only >"$work/log" 2>&1; then
    tail -n 5 "$work/log"
    echo "skipped: no packages of Debian can be had here"
    exit 77
fi
bare=$(files_of_clean)
if [ $found = 0 ]; then
    run install_all
    installed=$code
    said=$output
fi

test_apt_finds_and_installs_what_the_packages_say_they_need() {
    output=$said code=$found
    expect_code 0
    code=${installed:-1}
    expect_code 0
}

# As the README has it: once, for those who look at what came of it.
demo() {
    [ ! -d "$clean/root/demo" ] || return 0
    run inside anlos launch /usr/share/anlos/launch/demo.yaml --out demo --record demo.mcap
    expect_code 0
}

test_the_demo_finds_its_three_objects() {
    demo
    run inside grep -c '"position_m"' demo/detections.json
    [ "$output" = 3 ] || complain "expected three objects"
}

test_every_program_finds_its_libraries() {
    # shellcheck disable=SC2016
    run inside sh -c 'for p in /usr/bin/anlos /usr/libexec/anlos/*; do
        "$p" --version || exit; done'
    expect_code 0
    expect_text "anlos-track "
}

test_the_python_module_opens_an_exported_bag() {
    demo
    run inside anlos bag export demo.mcap --format foxglove -o shown.mcap
    expect_code 0
    run inside python3 -c '
import anlos
recorded, shown = anlos.Bag("demo.mcap"), anlos.Bag("shown.mcap")
print(recorded.topics["ping"], shown.topics["view/objects"] > 0, "ping" in shown.topics)
print(list(shown.messages("view/figures"))[-1].objects)'
    expect_code 0
    [ "$output" = $'1024 True False\n3' ] || complain "other topics or objects"
}

test_the_receiver_compiles_and_reads_what_the_vehicle_was_told() {
    demo
    run inside gcc -std=c99 -Wall -Wextra -Werror -c /usr/share/anlos/receiver/anlos_receiver.c
    expect_code 0
    run inside python3 /usr/share/anlos/receiver/anlos_receiver.py demo/can.candump \
        --any-source --scan
    expect_code 0
    expect_text "trust full"
}

test_a_program_is_compiled_and_finds_what_is_simulated() {
    # shellcheck disable=SC2016
    run inside sh -c 'gcc -std=c99 program.c -o program $(pkg-config --cflags --libs anlos sndfile) &&
        anlos sim /usr/share/anlos/launch/scenes/point.yaml --out point >/dev/null &&
        ./program point/scene'
    expect_code 0
    expect_text "0.400 0.130 0.41" # truth.json, seen from the vehicle
}

test_a_batch_has_a_line_for_its_bag() {
    demo
    # shellcheck disable=SC2016
    run inside sh -c 'echo demo.mcap >bags.txt && anlos batch bags.txt --out results &&
        anlos batch merge results --manifest bags.txt --out table.csv && cat table.csv'
    expect_code 0
    expect_text $'\ndemo.mcap,'
    expect_text ",done,"
}

# Tests run in the order of their names: this one is the last.
test_when_they_are_purged_nothing_is_left() {
    run inside apt-get purge -y "${names[@]}"
    expect_code 0
    output=$(comm -13 <(printf '%s\n' "$bare") <(files_of_clean) | grep -i anlos) || output=
    [ -z "$output" ] || complain "something is left"
}

run_tests
