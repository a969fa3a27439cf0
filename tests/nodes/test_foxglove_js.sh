#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Foxglove's own JavaScript client against our server, and our schemas and places as its
# library decodes them:
#   test_foxglove_js.sh RIG ANLOS FOLDER
# FOLDER keeps the libraries from run to run.  Exit code 77: there is no node, or they
# cannot be had.
set -euo pipefail
here=$(CDPATH='' cd -- "$(dirname "$0")" && pwd)
rig=$1 anlos=$2 library=$3/foxglove-js
command -v node >/dev/null && command -v npm >/dev/null || exit 77

if [ ! -d "$library/node_modules/@foxglove/schemas" ]; then
    mkdir -p "$library"
    timeout 60 npm install --prefix "$library" --no-audit --no-fund --silent \
        --fetch-retries=0 --fetch-timeout=10000 \
        @foxglove/ws-protocol@0.8.0 @foxglove/schemas@2.1.0 ws@8.18.0 \
        @mcap/core@2.2.2 @mcap/support@1.1.0 || exit 77
fi
cp "$here/check_foxglove.mjs" "$library" # node looks for libraries beside the script

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
check() {
    timeout 300 node "$library/check_foxglove.mjs" "$@"
}

check serve "$rig" "$here/../../launch/foxglove-layout.json"

# The scene's point is at (0.13, 0.11, 0.4) in the array frame.
cat >launch.yaml <<YAML
nodes: [stage, array, scan, dsp, recon, track, report]
array: {uri: "sim:$here/point.yaml"}
stage: {uri: "sim:?speed=1&acceleration=5&settle=0.05"}
scan: {background: false}
YAML
"$anlos" launch launch.yaml --realtime --run-dir run --out out --record scan.mcap \
    >launch.log 2>&1 || {
    cat launch.log
    exit 1
}
"$anlos" bag export scan.mcap --format foxglove -o shown.mcap
check bag shown.mcap 0.4 0.13 0.41
"$anlos" bag check shown.mcap
