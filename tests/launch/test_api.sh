#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The pages of the library's headers: launch/package/api.
set -euo pipefail
# shellcheck source=check.sh
. "$(dirname "$0")/check.sh"
for tool in doxygen man; do
    command -v $tool >/dev/null || {
        echo "skipped: there is no $tool (launch/setup --tests)"
        exit 77
    }
done

test_made_without_a_warning_every_public_function_has_its_place() {
    local functions f
    run "$root/launch/package/api" 1.2.3 "$work/api"
    expect_code 0
    functions=$(cat "$root"/recon/include/anlos/*.h | grep -E '^ANLOS_API ' |
        grep -oE 'anlos_[a-z_]+\(' | tr -d '(' | sort -u)
    [ "$(wc -w <<<"$functions")" -gt 50 ] || complain "there should be more functions"
    for f in $functions; do
        grep -rqF ">$f<" "$work/api/html" || complain "$f is on no page"
    done
}

test_each_function_and_header_has_a_page_of_the_manual() {
    local page
    run "$root/launch/package/api" 1.2.3 "$work/manual" man
    expect_code 0
    for page in $(cat "$root"/recon/include/anlos/*.h | grep -E '^ANLOS_API ' |
        grep -oE 'anlos_[a-z_]+\(' | tr -d '(' | sort -u) anlos_pipeline.h anlos.h; do
        [ -s "$work/manual/man3/$page.3.gz" ] || complain "$page has no page"
    done
    run ls "$work/manual/man3"
    output=$(grep -viE '^anlos[_.]' <<<"$output" || true)
    [ -z "$output" ] || complain "names that are not ours"
    cd "$work/manual"
    run bash -c 'MANPATH=$PWD man --warnings anlos_pipeline_create 2>&1'
    cd "$work"
    expect_code 0
    expect_text "Checks both and plans; keeps neither"
    expect_no_text "warning"
}

test_what_stands_before_a_function_and_behind_a_field_is_there() {
    run sed 's/<[^>]*>//g' "$work/api/html/pipeline_8h.html" \
        "$work/api/html/structanlos__ping.html"
    expect_text "Checks both and plans; keeps neither"
    expect_text "of the same room without the hidden objects"
}

run_tests
