# SPDX-License-Identifier: MIT
# shellcheck shell=bash
# For the tests of scripts: run a command, look at what came of it, count what is wrong.
# Sourced; needs bash.
here=$(CDPATH='' cd -- "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck disable=SC2034  # for those who source this
root=$(CDPATH='' cd -- "$here/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
wrong=0
output=
code=0

# Sets output (both streams) and code.
run() {
    code=0
    output=$("$@" 2>&1 </dev/null) || code=$?
}

complain() {
    printf 'FAILED %s: %s\n' "$name" "$*"
    printf '%s\n' "$output" | sed 's/^/    /'
    wrong=$((wrong + 1))
}

expect_code() {
    [ "$code" = "$1" ] || complain "exit code $code instead of $1"
}

expect_text() {
    [[ $output == *"$1"* ]] || complain "does not say '$1'"
}

expect_no_text() {
    [[ $output != *"$1"* ]] || complain "says '$1'"
}

# Runs the functions named test_..., each under its name.
run_tests() {
    local name n=0
    for name in $(declare -F | sed -n 's/^declare -f \(test_.*\)/\1/p'); do
        if declare -F prepare >/dev/null; then prepare; fi
        "$name"
        n=$((n + 1))
    done
    printf '%d tests, %d complaints\n' $n $wrong
    [ $n -gt 0 ] && [ $wrong -eq 0 ]
}
