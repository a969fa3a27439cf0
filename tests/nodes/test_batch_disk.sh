#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# `anlos batch` on a disk of 1 MB that gets full in mid-run.
# usage: test_batch_disk.sh ANLOS
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/../launch/check.sh"
anlos=$(realpath "$1")

mkdir "$work/out"
if ! unshare -m mount -t tmpfs -o size=1m tmpfs "$work/out" 2>/dev/null; then
    echo "skipped: mounting a file system is not permitted here"
    exit 77
fi
"$anlos" sim "$root/tests/nodes/point.yaml" --out "$work/scan" >/dev/null
"$anlos" bag import "$work/scan/scene" -o "$work/0.mcap" >/dev/null
for i in {0..14}; do
    [ "$i" = 0 ] || ln "$work/0.mcap" "$work/$i.mcap"
    echo "$i.mcap"
done >"$work/bags.txt"

# In name spaces of its own: room for less than 15 results, then for all.
cat >"$work/inside" <<'TEXT'
mount -t tmpfs -o size=1m tmpfs out
head -c 1000000 /dev/zero >out/.ballast
code=0
"$1" batch bags.txt --out out -j 1 >lines || code=$?
echo "first code $code"
ls out/*.json | wc -l >whole
cat out/*.json | wc -l >lines_in_them
find out -name '.work*' >left
rm out/.ballast
code=0
"$1" batch bags.txt --out out -j 1 >/dev/null || code=$?
echo "second code $code"
"$1" batch merge out --manifest bags.txt
TEXT

test_what_was_done_is_kept_and_the_same_command_does_the_rest() {
    cd "$work"
    run unshare -m --propagation private bash -e inside "$anlos"
    expect_code 0
    expect_text "first code 1"
    expect_text "cannot be written: No space left on device"
    expect_text " left; the same command goes on with them"
    expect_text "second code 0"
    expect_text ", $(cat whole) before, 0 failed"
    [ "$(cat whole)" -gt 0 ] && [ "$(cat whole)" -lt 15 ] || complain "$(cat whole) were done"
    [ "$(cat whole)" = "$(cat lines_in_them)" ] || complain "not one line in each"
    [ "$(cat whole)" = "$(wc -l <lines)" ] || complain "other lines than results"
    [ ! -s left ] || complain "$(cat left) was left"
}

run_tests
