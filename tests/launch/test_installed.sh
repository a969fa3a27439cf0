#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Debian packages of the build: installed, used, removed, purged in a root of their own.
# usage: test_installed.sh BUILD_DIR
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"
build=$(realpath "$1")
system=$work/system

for tool in cpack dpkg dpkg-gensymbols dpkg-shlibdeps help2man lintian man pkg-config /usr/bin/python3; do
    if ! command -v $tool >/dev/null; then
        echo "skipped: there is no $tool"
        exit 77
    fi
done
export SOURCE_DATE_EPOCH=1700000000
cpack --config "$build/CPackConfig.cmake" -B "$work" >"$work/cpack.log" 2>&1 ||
    { cat "$work/cpack.log" && exit 1; }
packages=("$work"/*.deb)
mapfile -t names < <(for p in "${packages[@]}"; do dpkg-deb -f "$p" Package; done)

in_system() {
    dpkg --root="$system" --force-not-root --force-depends --force-script-chrootless \
        --log=/dev/null "$@"
}

files_in_system() {
    (cd "$system" && find . -path ./var/lib/dpkg -prune -o -print | sort)
}

mkdir -p "$system/var/lib/dpkg/info" "$system/var/lib/dpkg/updates" "$system/etc" \
    "$system/var/lib/anlos"
touch "$system/var/lib/dpkg/status"
bare=$(files_in_system)
run in_system -i "${packages[@]}"
installed=$code
said=$output
bin=$system/usr/bin

test_packages_install() {
    output=$said code=$installed
    expect_code 0
    [ -d "$system/etc/anlos" ] || complain "there is no /etc/anlos"
}

# The same compiler and settings, in a folder of another depth.
test_a_rebuild_elsewhere_gives_the_same_packages() {
    local elsewhere=$work/some/where/else settings package
    if grep -q '^CMAKE_C_COMPILER_LAUNCHER:.*=.' "$build/CMakeCache.txt"; then
        echo "not rebuilt: built by way of a launcher, which may name files otherwise"
        return
    fi
    mapfile -t settings < <(grep -E '^(CMAKE_(BUILD_TYPE|C_COMPILER|C_FLAGS)|ANLOS_WERROR):' \
        "$build/CMakeCache.txt" | sed 's/^/-D/')
    run cmake -S "$root" -B "$elsewhere" -DANLOS_TESTS=OFF "${settings[@]}"
    expect_code 0
    run cmake --build "$elsewhere" --parallel 2
    expect_code 0
    run cpack --config "$elsewhere/CPackConfig.cmake" -B "$elsewhere/packages"
    expect_code 0
    [ ${#packages[@]} = 5 ] || complain "expected five packages"
    for package in "${packages[@]}"; do
        run cmp "$package" "$elsewhere/packages/${package##*/}"
        expect_code 0
    done
    rm -rf "$work/some"
}

# Compiled with these headers, which an older library refuses, it depends on one as new.
test_the_symbols_of_the_library_are_those_that_debian_is_told() {
    local version
    mkdir -p "$work/source/debian"
    printf 'Source: anlos\n\nPackage: libanlos1\nArchitecture: any\n' >"$work/source/debian/control"
    version=$(dpkg-deb -f "$work"/libanlos1_*.deb Version)
    # What is gone shows in a later version alone.
    run env -C "$work/source" dpkg-gensymbols -c4 -plibanlos1 -v"$version+next" -O/dev/null \
        -e"$system/usr/lib/libanlos.so.1" -I"$system/var/lib/dpkg/info/libanlos1.symbols"
    expect_code 0
    run grep -c "^ anlos_survey_create_for@Base $version\$" \
        "$system/var/lib/dpkg/info/libanlos1.symbols"
    expect_code 0
}

test_lintian_finds_no_error() {
    run lintian --allow-root --fail-on error "${packages[@]}"
    expect_code 0
    expect_no_text "whatis" # each page says in a line what it is of
}

test_an_installed_system_images_the_scene_that_comes_with_it() {
    run env -u ANLOS_BIN_DIR "$bin/anlos" launch \
        "$system/usr/share/anlos/launch/one-pair.yaml" --run-dir "$work/run" --out "$work/out"
    expect_code 0
    [ -s "$work/out/detections.json" ] || complain "there is no list of objects"
}

# As the unit has it, of folders in the system: once, for those who look at what came of it.
demo() {
    local command
    [ ! -d "$work/demo" ] || return 0
    mkdir -p "$work/demo"
    cp -r "$system/usr/share/anlos/launch/demo.yaml" "$system/usr/share/anlos/launch/scenes" \
        "$system/etc/anlos"
    command=$(sed -n 's/^ExecStart=//p' "$system/usr/lib/systemd/system/anlos@.service" |
        sed "s|%i|demo|g; s|/etc/|$system/etc/|; s|/run/|$work/run/|; s|/var/lib/|$work/|")
    mkdir -p "$work/run/anlos" "$work/anlos"
    read -ra command <<<"$command --record $work/demo/demo.mcap"
    run env -u ANLOS_BIN_DIR PATH="$bin:$PATH" "${command[@]}"
    expect_code 0
    rm -r "$system/etc/anlos/demo.yaml" "$system/etc/anlos/scenes"
}

test_the_service_runs_the_demo() {
    demo
    run grep -c '"position_m"' "$work/anlos/demo/detections.json"
    [ "$output" = 3 ] || complain "expected three objects"
    [ -s "$system/usr/lib/udev/rules.d/60-anlos.rules" ] || complain "there is no rule for udev"
}

test_the_receiver_compiles_and_reads_what_the_vehicle_was_told() {
    local receiver=$system/usr/share/anlos/receiver
    run gcc -std=c99 -Wall -Wextra -Werror -c "$receiver/anlos_receiver.c" -o "$work/receiver.o"
    expect_code 0
    demo
    run env PYTHONDONTWRITEBYTECODE=1 /usr/bin/python3 "$receiver/anlos_receiver.py" \
        "$work/anlos/demo/can.candump" --any-source --scan
    expect_code 0
    expect_text "trust full"
}

test_a_bag_that_was_exported_opens() {
    if ! /usr/bin/python3 -c 'import cffi, numpy, google.protobuf, zstandard' 2>/dev/null; then
        complain "there is no python3-cffi, -numpy, -protobuf or -zstandard: launch/setup --tests"
        return
    fi
    demo
    run "$bin/anlos" bag export "$work/demo/demo.mcap" --format foxglove -o "$work/shown.mcap"
    expect_code 0
    run env LD_LIBRARY_PATH="$system/usr/lib" PYTHONDONTWRITEBYTECODE=1 \
        PYTHONPATH="$system/usr/lib/python3/dist-packages" /usr/bin/python3 -c '
import sys, anlos
recorded, shown = (anlos.Bag(path) for path in sys.argv[1:])
print(recorded.topics["ping"], shown.topics["view/objects"], "ping" in shown.topics)
print(list(shown.messages("view/figures"))[-1].objects)' \
        "$work/demo/demo.mcap" "$work/shown.mcap"
    expect_code 0
    [[ $output =~ ^1024\ [1-9][0-9]*\ False$'\n'3$ ]] || complain "other topics or objects"
}

test_what_only_the_launcher_starts_is_not_in_the_path() {
    run ls "$bin"
    [ "$output" = anlos ] || complain "more than anlos is in bin"
}

test_programs_tell_their_version() {
    local program
    for program in "$bin/anlos" "$system"/usr/libexec/anlos/*; do
        run "$program" --version
        expect_code 0
        [[ $output =~ ^"${program##*/} "[0-9]+\.[0-9]+\.[0-9]+$ ]] ||
            complain "${program##*/} does not tell its version"
    done
}

test_no_program_names_the_folder_it_was_built_in() {
    run grep -rlF -e "$root/" -e "$build/" "$system/usr"
    [ -z "$output" ] || complain "the build's folder stands in it"
}

test_every_command_and_node_has_a_page() {
    local name man=$system/usr/share/man
    for name in $("$bin/anlos" --help | sed -n '/^commands$/,/^$/s/^  \([a-z-]*\) .*/\1/p'); do
        run zgrep -F "anlos-$name" "$man/man1/anlos-$name.1.gz"
        expect_code 0
    done
    [ -n "${name:-}" ] || complain "found no commands"
    for name in "$system"/usr/libexec/anlos/*; do
        [ -s "$man/man8/${name##*/}.8.gz" ] || complain "$name has no page"
    done
    run bash -c 'man --warnings -l "$@" 2>&1 >/dev/null' man "$man"/man?/*
    [ -z "$output" ] || complain "the pages have faults"
}

completes() { # the words so far, the last of them unfinished
    bash -c '. "$0" && COMP_WORDS=(anlos "$@") COMP_CWORD=$# &&
        _anlos "$BIN" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}" &&
        printf "%s " "${COMPREPLY[@]}"' \
        "$system/usr/share/bash-completion/completions/anlos" "$@"
}

expect_completion() { # what is wanted, then the words
    run env BIN="$bin/anlos" bash -c "$(declare -f completes); system=$system completes"' "$@"' \
        completes "${@:2}"
    [ "${output% }" = "$1" ] || complain "after '${*:2}': expected '$1'"
}

test_the_shell_completes_commands_verbs_options_and_topics() {
    expect_completion "top topic" to
    expect_completion "record recover" bag rec
    expect_completion "recon resolution" help re
    expect_completion "info" help bag in
    expect_completion "list echo pub hz bw delay" topic ""
    expect_completion "detections" topic echo detec
    expect_completion "--record --realtime --replay" launch --re
    expect_completion "warning" launch x.yaml --log-level w
    expect_completion "sound-speed show" calibrate s
    expect_completion "foxglove" bag export x.mcap --format f
    expect_completion "wav csv json nrrd png foxglove osi" bag export --format =
    expect_completion "paper" recon --method = pa
    expect_completion "lz4" bag record --compression l
    expect_completion "hann hamming" psf --window h
    expect_completion "fast,paper" speed-error --methods fast,pa
    expect_completion "survey,ping" bag filter x.mcap --topics survey,pi
    expect_completion "detections" bag play x.mcap --exclude detec
    expect_completion "ego,traces" bag record ego,tr
    expect_completion "" bag record -o tr
    expect_completion "" launch --out ""
    expect_completion "" nonsense ""
}

# PROGRAM: the example, on a scene that the installed simulator records.
expect_it_finds_the_point() {
    [ -d "$work/point" ] || run "$bin/anlos" sim "$system/usr/share/anlos/launch/scenes/point.yaml" \
        --out "$work/point"
    run env LD_LIBRARY_PATH="$system/usr/lib" "$1" "$work/point/scene"
    expect_code 0
    expect_text "0.400 0.130 0.41" # truth.json, seen from the vehicle
}

test_a_program_is_built_by_pkg_config() {
    local flags
    flags=$(PKG_CONFIG_PATH=$system/usr/lib/pkgconfig pkg-config --cflags --libs anlos sndfile)
    # shellcheck disable=SC2086  # words
    run gcc -std=c99 -o "$work/by_pkg_config" "$root/tests/examples/wav_to_objects.c" $flags
    expect_code 0
    expect_it_finds_the_point "$work/by_pkg_config"
}

test_a_program_is_built_by_find_package() {
    mkdir -p "$work/project"
    cp "$root/tests/examples/wav_to_objects.c" "$work/project"
    cat >"$work/project/CMakeLists.txt" <<'TEXT'
cmake_minimum_required(VERSION 3.20)
project(example C)
find_package(anlos 0.1 REQUIRED)
add_executable(example wav_to_objects.c)
target_link_libraries(example anlos::anlos sndfile)
TEXT
    run cmake -S "$work/project" -B "$work/project/build" -DCMAKE_PREFIX_PATH="$system/usr"
    expect_code 0
    run cmake --build "$work/project/build"
    expect_code 0
    expect_it_finds_the_point "$work/project/build/example"
}

test_python_imports_the_module() {
    if ! /usr/bin/python3 -c 'import cffi, numpy' 2>/dev/null; then
        complain "there is no python3-cffi, or no python3-numpy: launch/setup --tests"
        return
    fi
    run env LD_LIBRARY_PATH="$system/usr/lib" \
        PYTHONPATH="$system/usr/lib/python3/dist-packages" \
        /usr/bin/python3 -c 'import anlos; print(anlos.version(), *anlos.methods())'
    expect_code 0
    expect_text "fast backprojection"
}

# Tests run in the order of their names: this one is the last.
test_when_they_are_purged_nothing_is_left() {
    mkdir -p "$system/var/lib/private/anlos/demo"
    run in_system -r "${names[@]}"
    expect_code 0
    run in_system -P "${names[@]}"
    expect_code 0
    rm -rf "$system/var/lib/private"
    output=$(diff <(printf '%s\n' "$bare" | grep -v ./var/lib/anlos) <(files_in_system)) ||
        complain "something is left"
}

run_tests
