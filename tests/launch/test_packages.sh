#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The packages that launch/setup installs are those that the build asks for.
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"

for tool in dpkg-query pkg-config; do
    if ! command -v $tool >/dev/null; then
        echo "skipped: there is no $tool"
        exit 77
    fi
done

# The package that a file belongs to, without its architecture.
owner() {
    dpkg-query -S "$1" | sed 's/[:,].*//'
}

expect_listed() {
    [[ $'\n'$output == *$'\n'"$1 - "* ]] ||
        complain "$1, which has $2, is not among the packages"
}

test_every_library_of_the_build_is_in_the_list() {
    local modules module folder
    modules=$(cat "$root/CMakeLists.txt" "$root"/*/CMakeLists.txt |
        sed -n 's/.*pkg_check_modules(.* IMPORTED_TARGET \([^)]*\)).*/\1/p')
    [ "$(wc -w <<<"$modules")" -ge 8 ] || complain "found too few libraries: $modules"
    run "$root/launch/setup" --list
    for module in $modules; do
        folder=$(pkg-config --variable=pcfiledir "$module")
        expect_listed "$(owner "$folder/$module.pc")" "$module"
    done
}

test_every_program_of_the_build_is_in_the_list() {
    local program programs
    programs=$(cat "$root"/*/CMakeLists.txt |
        sed -n 's/.*find_program([A-Z_]* \([^ ]*\) REQUIRED).*/\1/p')
    [ -n "$programs" ] || complain "found no programs"
    run "$root/launch/setup" --list --tests
    for program in $programs gcc cmake make pkg-config clang clang-format-14; do
        expect_listed "$(owner "$(command -v "$program")")" "$program"
    done
}

run_tests
