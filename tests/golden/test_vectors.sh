#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The golden vectors are what their generator makes, byte by byte, and stay small.
set -euo pipefail
here=$(CDPATH='' cd -- "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python=/usr/bin/python3 # Debian installs numpy for its own interpreter
[ -x $python ] || python=python3
code=0
"$python" "$here/generate" "$work/vectors" || code=$?
[ "$code" = 0 ] || exit "$code"
diff -rq "$here/vectors" "$work/vectors"

largest=$(wc -c "$work"/vectors/* | sed '$d' | sort -n | awk 'END { print $1 }')
all=$(cat "$work"/vectors/* | wc -c)
if [ "$largest" -gt 100000 ] || [ "$all" -gt 500000 ]; then
    printf 'vectors are too large: %s, together %s bytes\n' "$largest" "$all"
    exit 1
fi
