#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Packages of a cross build for arm64: of that machine, and with what they need there.  Only
# the library's, as the whole product is not built in every such run.
# usage: test_arm64_packages.sh BUILD_DIR
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"
build=$(realpath "$1")

test_the_package_is_of_arm64_and_names_the_libraries_that_it_links() {
    local package said
    run "$root/launch/arm64/packages" "$build" "$work/out" --library
    expect_code 0
    package=$(echo "$work"/out/libanlos1_*_arm64.deb)
    run dpkg-deb -f "$package" Architecture Depends
    said=$output
    expect_text "Architecture: arm64"
    dpkg-deb -x "$package" "$work/files"
    run readelf -hd "$work/files/usr/lib/libanlos.so.1"
    expect_text "AArch64"
    expect_text "[libfftw3f.so.3]"
    expect_text "[libc.so.6]"
    output=$said
    expect_text "libc6 (>= 2."
    expect_text "libfftw3-single3 (>= 3."
}

test_a_build_for_another_machine_is_refused() {
    mkdir -p "$work/native"
    echo 'set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE "amd64")' >"$work/native/CPackConfig.cmake"
    run "$root/launch/arm64/packages" "$work/native" "$work/none"
    expect_code 2
    expect_text "no build for arm64"
    run "$root/launch/arm64/packages" "$work/nowhere" "$work/none"
    expect_code 2
    expect_text "no build is there"
}

run_tests
