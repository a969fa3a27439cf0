# SPDX-License-Identifier: MIT
# shellcheck shell=bash
# For the tests that run scripts of node.  It was seen to hang for good once, on a busy machine,
# with nothing said, where it takes two seconds; why is not known.  Who hangs is tried again,
# twice, and that is said.

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
