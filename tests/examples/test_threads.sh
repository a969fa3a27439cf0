#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The library's tests under ThreadSanitizer: pools inside of one pipeline, and pipelines that
# threads plan, feed and destroy beside each other.  Compiled here, without optimisation.
#   test_threads.sh COMPILER FOLDER
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/../launch/check.sh"

compiler=${1:?a C compiler}
objects=${2:?a folder for what is compiled}
flags=(-std=c11 -D_GNU_SOURCE -fsanitize=thread -fPIE -O1 -g1 -I "$root"
    -I "$root/recon/include")

echo 'int main(void) { return 0; }' >"$work/none.c"
if ! "$compiler" -fsanitize=thread "$work/none.c" -o "$work/none" 2>/dev/null ||
    ! "$work/none" 2>/dev/null; then
    echo "skipped: $compiler has no ThreadSanitizer that runs here"
    exit 77
fi
cd "$root"
mkdir -p "$objects"
rm -f "$objects"/*.o

test_the_library_has_no_races() {
    ls dsp/*.c recon/*.c recon/*/*.c >"$work/sources"
    code=0
    # shellcheck disable=SC2016 # of the inner shell
    output=$(xargs -a "$work/sources" -P 2 -I{} sh -c 'file=$1 out=$2; shift 2
        exec "$@" -c "$file" -o "$out/$(echo "$file" | tr / _).o"' \
        - {} "$objects" "$compiler" "${flags[@]}" 2>&1) || code=$?
    expect_code 0
    for test in library library_stages; do
        run "$compiler" "${flags[@]}" "tests/recon/test_$test.c" "$objects"/*.o \
            -lcmocka -lfftw3f -lm -lpthread -o "$work/$test"
        expect_code 0
        run "$work/$test"
        expect_code 0
        expect_no_text "WARNING: ThreadSanitizer"
    done
}

run_tests
