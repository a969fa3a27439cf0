#!/usr/bin/env bash
# The units of launch/systemd, judged by systemd itself.
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"

if ! command -v systemd-analyze >/dev/null; then
    echo "skipped: there is no systemd-analyze (launch/setup --tests)"
    exit 77
fi

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

# What the launcher and the unit agree on: the programs and options exist.
test_the_command_of_a_unit_is_one_that_the_launcher_has() {
    local unit
    for unit in "${units[@]}"; do
        output=$(sed -n 's/^ExecStart=//p' "$unit")
        expect_text "anlos launch /etc/anlos/%i.yaml --run-dir /run/anlos/%i --out"
    done
}

run_tests
