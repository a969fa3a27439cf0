#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Which folder includes headers of which: the table "Repository layout" of README.md.  What
# links is not enough, for a header alone links everywhere.
set -euo pipefail
cd "$(CDPATH='' cd -- "$(dirname "$0")/.." && pwd)"
wrong=0

# check FOLDER PATTERN: every include with quotes begins with what the pattern matches.
check() {
    local found
    found=$(grep -rnE --include='*.[ch]' '^[[:space:]]*#[[:space:]]*include[[:space:]]*"' "$1" ||
        true)
    if [ -z "$found" ]; then
        echo "$1: no includes are found"
        wrong=1
    elif grep -vE "\"($2)/" <<<"$found"; then
        echo "$1: expected headers of $2 alone"
        wrong=1
    fi
}

check msgs 'msgs|recon|dsp'
check hal 'hal|recon|dsp|msgs/can'
check dsp 'dsp'
check recon 'recon|dsp'
check nodes 'nodes|recon|dsp|hal|msgs|foxglove' # the last: made from msgs/foxglove
if grep -rnE --include='*.[ch]' 'include <nanomsg/' hal dsp recon nodes; then
    echo "only msgs knows nanomsg"
    wrong=1
fi
exit $wrong
