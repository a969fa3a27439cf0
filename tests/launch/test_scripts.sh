#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# What the scripts have in common: --help, wrong options, any working directory.
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"

scripts=(launch/setup launch/build launch/demo launch/package/manuals launch/arm64/sysroot
    launch/arm64/packages launch/batch/slurm.sh tests/run tests/format
    tests/hw/kernel tests/hw/guest tests/fuzz/run tests/golden/generate tests/bench/coverage
    tests/bench/browser tests/bench/replay_same .ci/run)

test_every_script_explains_itself() {
    local script
    for script in "${scripts[@]}"; do
        run "$root/$script" --help
        expect_code 0
        expect_text "$script"
        expect_no_text "unknown option"
    done
}

test_a_wrong_option_is_refused_before_anything_is_done() {
    local script
    for script in "${scripts[@]}"; do
        run "$root/$script" --no-such-option
        expect_code 2
        expect_no_text "building"
        expect_no_text "missing"
    done
}

test_an_option_without_its_value_is_refused() {
    run "$root/launch/demo" --out
    expect_code 2
    expect_text "--out"
    run "$root/tests/run" -R
    expect_code 2
    expect_text "-R"
    run "$root/tests/run" --compiler
    expect_code 2
    expect_text "--compiler"
    run "$root/tests/run" --compiler tcc
    expect_code 2
    expect_text "tcc"
    run "$root/tests/run" --library
    expect_code 2
    expect_text "--library: is of --arm64"
    run "$root/tests/run" --hardware --sanitize
    expect_code 2
    expect_text "--sanitize"
    run "$root/tests/hw/guest" --memory 5x -- true
    expect_code 2
    expect_text "--memory"
    run "$root/tests/hw/guest" --out
    expect_code 2
    expect_text "--out"
    run "$root/tests/hw/guest" --timeout 5 --
    expect_code 2
    expect_text "a program is missing"
}

test_scripts_find_their_tree_from_any_folder() {
    cd "$work"
    ln -sfn "$root/launch" launch
    run env CDPATH="$root" "$root/launch/setup" --list
    expect_code 0
    expect_text "cmake - "
    run env CDPATH="$root:$work" "$root/launch/build" "$work/nowhere" -P missing.cmake
    expect_code 1
    expect_text "the build failed"
    expect_text "$work/nowhere/build.log"
    cd "$root"
}

run_tests
