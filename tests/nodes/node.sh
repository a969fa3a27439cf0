# SPDX-License-Identifier: MIT
# shellcheck shell=bash
# For the tests that run scripts of node.  One run of node in some hundred was seen to hang
# for good on a busy machine, with nothing said, and has nothing to do with what is tested:
# who hangs is tried again, twice, and that is said.

run_node() { # SCRIPT [ARGUMENT]...
    local code
    for _ in 1 2 3; do
        code=0
        timeout -k 5 90 node "$@" || code=$?
        [ $code = 124 ] || [ $code = 137 ] || return $code
        echo "node hung for 90 s: $*" >&2
    done
    return $code
}
