#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# tests/hw/guest keeps what its help promises, whatever its program does.  Runs on the host.
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/../launch/check.sh"
unset CI

guest=$root/tests/hw/guest

test_its_exit_code_is_the_program_s() {
    run "$guest" -- true
    expect_code 0
    run "$guest" -- bash -c 'exit 5'
    expect_code 5
    run "$guest" -- bash -c 'kill -SEGV $$'
    expect_code 139
    run "$guest" -- no-such-program
    expect_code 127
}

test_it_says_how_a_program_ended_that_said_nothing() {
    run "$guest" -- true
    expect_no_text "tests/hw/guest:"
    run "$guest" -- bash -c 'exit 5'
    expect_text "tests/hw/guest: bash ended with exit code 5 after "
    # shellcheck disable=SC2016  # for the guest to expand
    run "$guest" -- bash -c 'echo "<4>a word" >/dev/kmsg; kill -PIPE $$'
    expect_code 141
    expect_text "tests/hw/guest: bash was ended by signal SIGPIPE after "
    expect_text "the last words of its kernel:"
    expect_text "a word"
}

test_a_program_that_skips_is_skipped_but_fails_in_ci() {
    run "$guest" -- bash -c 'exit 77'
    expect_code 77
    run env CI=true "$guest" -- bash -c 'exit 77'
    expect_code 1
    expect_text "skipped: by bash"
}

test_without_a_kernel_it_is_skipped_and_says_why() {
    mkdir -p "$work/tools"
    ln -sf "$(command -v bash)" "$(command -v dirname)" "$(command -v cat)" \
        "$(command -v mkdir)" "$(command -v sha256sum)" "$(command -v cut)" \
        "$(command -v find)" "$(command -v sort)" "$(command -v tail)" \
        "$(command -v uname)" "$work/tools"
    run env PATH="$work/tools" XDG_CACHE_HOME="$work/cache" "$guest" -- true
    expect_code 77
    expect_text "apt-get is missing: launch/setup --hardware"
    run env CI=true PATH="$work/tools" XDG_CACHE_HOME="$work/cache" "$guest" -- true
    expect_code 1
}

test_arguments_and_folder_arrive_as_they_are() {
    mkdir -p "$work/a folder"
    cd "$work/a folder"
    # shellcheck disable=SC2016  # for the guest to expand
    run "$guest" -- bash -c 'printf "%s|" "$PWD" "$@"' x "it's \$HOME" $'two\nlines' ''
    expect_text "$work/a folder|it's \$HOME|"$'two\nlines||'
    cd "$root"
}

test_all_of_a_long_output_comes_through() {
    run "$guest" -- bash -c 'seq 100000; echo "to stderr" >&2'
    [ "$output" = "$(seq 100000 && echo "to stderr")" ] || {
        output=$(tail -n 3 <<<"$output")
        complain "not what was written"
    }
}

test_files_come_back_in_the_folder_of_results_and_nowhere_else() {
    # shellcheck disable=SC2016  # for the guest to expand
    run "$guest" --out "$work/the results" -- bash -c \
        'echo done >"$GUEST_OUT/file"; touch "$0"/file /file; touch /tmp/file' "$work"
    expect_code 0
    expect_text "Read-only file system"
    [ "$(cat "$work/the results/file")" = "done" ] || complain "there is no result"
    [ ! -e "$work/file" ] || complain "the host's files can be written"
}

test_what_the_program_leaves_running_does_not_keep_the_guest() {
    run "$guest" -- bash -c 'sleep infinity & echo started'
    expect_code 0
    expect_text "started"
}

test_a_guest_that_is_not_done_in_time_is_ended() {
    run "$guest" --timeout 2 -- sleep infinity
    expect_code 99
    expect_text "not done after 2 s"
}

# Sets between: the ns from one `date +%s%N` in the output to the next.
read_clock() {
    local times
    expect_code 0
    mapfile -t times < <(grep -x '[0-9]*' <<<"$output")
    between=$((${times[1]:-0} - ${times[0]:-0}))
}

# Before 300 s of the host's are over.
test_while_all_wait_the_clock_leaps() {
    local between
    run "$guest" --timeout 300 -- bash -c 'date +%s%N; sleep 1000; date +%s%N'
    read_clock
    ((between >= 1000000000000)) || complain "the clock went on by $between ns"
}

# What the host takes a second or more for is no time in the guest.
test_while_one_computes_the_clock_stands() {
    local between
    # shellcheck disable=SC2016  # for perl to expand
    run "$guest" -- bash -c \
        'date +%s%N; perl -e "\$x += \$_ for 1 .. 3e7"; date +%s%N'
    read_clock
    ((between > 0 && between < 2000000)) ||
        complain "the clock went on by $between ns"
}

# In so little memory it cannot even start.
test_a_guest_that_dies_says_its_last_words() {
    run "$guest" --memory 8 -- true
    expect_code 99
    expect_text "the guest died; its last words:"
    expect_text "physical memory"
}

test_a_signal_ends_the_guest_and_leaves_nothing() {
    local process state line=
    mkfifo "$work/said"
    "$guest" -- bash -c 'echo running; exec sleep infinity' >"$work/said" 2>/dev/null &
    process=$!
    read -r -t 120 line <"$work/said" || true
    [ "$line" = running ] || complain "is not running"
    state=$(ps -o args= --ppid $process | sed -n 's/.* uml_dir=\([^ ]*\).*/\1/p')
    run test -n "$state" -a -d "$state"
    expect_code 0
    kill -TERM $process
    code=0
    wait $process || code=$?
    expect_code 143
    run pgrep -f "uml_dir=$state"
    expect_code 1
    [ ! -e "$state" ] || complain "$state was left"
}

run_tests
