#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The units of launch/systemd, judged by systemd itself.
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"

if ! command -v systemd-analyze >/dev/null; then
    echo "skipped: there is no systemd-analyze (launch/setup --tests)"
    exit 77
fi

anlos=${1:?the program anlos}
units=("$root"/launch/systemd/*.service)

test_every_unit_is_valid() {
    local unit
    [ -e "${units[0]}" ] || complain "found no units"
    for unit in "${units[@]}"; do
        cp "$unit" "$work/$(basename "${unit/@/@vehicle}")"
    done
    run systemd-analyze verify --man=no "$work"/*.service
    expect_code 0
    expect_no_text "${work##*/}"
}

# 10 is a program that may do anything.
test_a_service_may_do_little() {
    local unit
    for unit in "${units[@]}"; do
        run systemd-analyze security --offline=true --threshold=25 "$unit"
        expect_code 0
    done
}

test_a_unit_runs_the_launcher_in_folders_of_its_own() {
    local unit
    for unit in "${units[@]}"; do
        output=$(sed -n 's/^ExecStart=//p' "$unit")
        expect_text "anlos launch /etc/anlos/%i.yaml --run-dir /run/anlos/%i --out"
    done
}

# The program takes them, and says so.
test_the_options_of_a_unit_are_ones_that_the_launcher_has() {
    local unit words word n
    for unit in "${units[@]}"; do
        read -ra words < <(sed -n 's/^ExecStart=.*anlos launch /launch /p' "$unit")
        run "$anlos" "${words[@]}" --help
        expect_code 0
        n=0
        for word in "${words[@]}"; do
            [[ $word == --* ]] || continue
            grep -qE -- "^  $word( |\$)" <<<"$output" || complain "has no $word"
            n=$((n + 1))
        done
        [ $n -gt 0 ] || complain "found no options of $unit"
    done
}

run_tests
