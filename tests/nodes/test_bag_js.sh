#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Our bags and those of the format's own JavaScript library, each read by the other:
#   test_bag_js.sh ANLOS FOLDER
# FOLDER keeps the library from run to run.  Exit code 77: there is no node, or the
# library cannot be had.
set -euo pipefail
here=$(CDPATH='' cd -- "$(dirname "$0")" && pwd)
# shellcheck source=tests/nodes/node.sh
. "$here/node.sh"
anlos=$1 library=$2/mcap-js
command -v node >/dev/null && command -v npm >/dev/null || exit 77

if [ ! -d "$library/node_modules/@mcap/support" ]; then
    mkdir -p "$library"
    timeout 60 npm install --prefix "$library" --no-audit --no-fund --silent \
        --fetch-retries=0 --fetch-timeout=10000 \
        @mcap/core@2.2.2 @mcap/support@1.1.0 || exit 77
fi
cp "$here/check_bag.mjs" "$library" # node looks for libraries beside the script

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
check() {
    run_node "$library/check_bag.mjs" "$@"
}

"$anlos" sim "$here/point.yaml" --out recording >/dev/null
for compression in none lz4 zstd; do
    "$anlos" bag import recording -o $compression.mcap --compression $compression
    "$anlos" bag export $compression.mcap --format json -o $compression.json
    check read $compression.mcap $compression.json

    # What of a cut bag the library can read, `recover` saves too, and the library reads it.
    head -c $(($(wc -c <$compression.mcap) * 2 / 3)) $compression.mcap >cut.mcap
    code=0
    "$anlos" bag recover cut.mcap -o saved.mcap || code=$?
    [ $code = 1 ]
    [ "$(check count saved.mcap)" -ge "$(check count cut.mcap)" ]
    [ "$(check count saved.mcap)" -gt 10 ]
    "$anlos" bag export saved.mcap --format json -o saved.json
    check read saved.mcap saved.json
    head -n "$(wc -l <saved.json)" $compression.json | cmp - saved.json
    rm cut.mcap saved.mcap saved.json
done

check write other.mcap
"$anlos" bag check other.mcap
"$anlos" bag info --json other.mcap | grep -q '"messages": 10,'
"$anlos" bag merge other.mcap -o copy.mcap
[ "$(check count copy.mcap)" = 10 ]
"$anlos" bag check copy.mcap
