#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# A drive exported as a trace of ASAM OSI, as viewers read it: by the MCAP library in
# JavaScript and OSI's published types:
#   test_osi_js.sh RIG ANLOS FOLDER
# RIG FILE SCENE writes a bag of tracks and the scene of its drive.
# FOLDER keeps the libraries from run to run.  Exit code 77: there is no node, or they
# cannot be had.
set -euo pipefail
here=$(CDPATH='' cd -- "$(dirname "$0")" && pwd)
# shellcheck source=tests/nodes/node.sh
. "$here/node.sh"
rig=$1 anlos=$2 library=$3/osi-js
command -v node >/dev/null && command -v npm >/dev/null || exit 77

if [ ! -d "$library/node_modules/@mcap/support" ]; then
    mkdir -p "$library"
    timeout 60 npm install --prefix "$library" --no-audit --no-fund --silent \
        --fetch-retries=0 --fetch-timeout=10000 \
        @lichtblick/asam-osi-types@3.7.0 @mcap/core@2.2.2 @mcap/support@1.1.0 ||
        exit 77
fi
cp "$here/check_osi.mjs" "$library" # node looks for libraries beside the script

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

"$rig" drive.mcap scene.yaml
"$anlos" bag export drive.mcap --format osi -o trace.mcap --scenes scene.yaml
"$anlos" bag check trace.mcap
run_node "$library/check_osi.mjs" trace.mcap
