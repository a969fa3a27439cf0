#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# What the guides have to copy works: commands and options exist, launch files and scenes
# that are whole load.
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"

anlos=${1:?the program anlos}
mapfile -t pages < <(find "$root" \( -path "$root/build*" -o -path "$root/.git*" \) -prune -o \
    -name '*.md' -print | sort)
commands=$("$anlos" --help | sed -n 's/^  \([a-z-]*\)  .*/\1/p' | paste -sd '|')
declare -A helps

# Sets output to the help of a command and its verb, or of the command alone.
help_of() {
    local key="$*"
    if [ -z "${helps[$key]:-}" ]; then
        helps[$key]=$("$anlos" "$@" --help 2>/dev/null || "$anlos" "$1" --help)
    fi
    output=${helps[$key]}
}

# The lines of code blocks and what stands in backquotes, from "anlos" on.
command_lines() {
    sed -e ':join' -e '/\\$/ { N; s/\\\n//; b join }' "$1" |
        awk '/^```/ { code = !code; next }
            code { print; next }
            { n = split($0, part, "`"); for (i = 2; i <= n; i += 2) print part[i] }' |
        grep -oE "(^|[ /(])anlos ($commands)( [^|<>#&;]*)?" | sed 's/^.*anlos //'
}

test_every_option_is_one() {
    local page line option n=0
    local -a words
    for page in "${pages[@]}"; do
        while IFS= read -r line; do
            read -ra words <<<"$line"
            case ${words[0]}:${words[1]:-} in
            bag:[a-z]* | bench:[a-z]*) help_of "${words[0]}" "${words[1]}" ;;
            *) help_of "${words[0]}" ;;
            esac
            for option in "${words[@]}"; do
                option=${option%%=*} option=${option%%[],.)]*}
                [[ $option == --?* ]] || continue
                n=$((n + 1))
                grep -qE -- "(^|[^a-z-])$option([^a-z-]|$)" <<<"$output" ||
                    complain "${page#"$root"/}: anlos $line: $option is no option"
            done
        done < <(command_lines "$page")
    done
    output=
    [ $n -gt 100 ] || complain "only $n options were found"
}

# Each block of YAML into $work/PAGE-N.yaml, beside the scenes that it names.
write_blocks() {
    local page
    for page in "${pages[@]}"; do
        awk -v to="$work/$(basename "$page" .md)" '
            /^```/ { if (file) close(file); file = ""; if (/^```yaml/) file = to "-" ++n ".yaml"; next }
            file { print > file }' "$page"
    done
}

test_examples_that_are_whole_load() {
    local file n=0
    write_blocks
    for file in "$work"/*-*.yaml; do
        output=$(cat "$file")
        if grep -q '^nodes:' "$file"; then # it is read first
            run "$anlos" launch "$file" --rate nonsense
            expect_text "--rate nonsense: expected"
        elif grep -qE '^array: (paper|bumper)' "$file"; then
            run "$anlos" sim "$file" --out "$file/no-folder"
            [[ $output == *"a drive has no end"* ]] || expect_text "cannot be written"
        else
            continue
        fi
        n=$((n + 1))
    done
    [ $n -ge 4 ] || complain "only $n examples were found"
}

run_tests
