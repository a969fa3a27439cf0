#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# launch/setup against a package system that is made up, so that nothing is installed.
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"

bin=$work/bin
state=$work/state

fake() {
    { printf '#!/bin/bash\nstate=%q\n' "$state" && cat; } >"$bin/$1"
    chmod +x "$bin/$1"
}

# Nothing of the real system is in reach but what only reads and prints.
prepare() {
    local tool
    rm -rf "$bin" "$state"
    mkdir -p "$bin" "$state"
    for tool in bash env cat sed grep tail mktemp rm dirname touch; do
        ln -s "$(command -v $tool)" "$bin/$tool"
    done
    : >"$state/installed" # names
    : >"$state/removed"   # names of which only the configuration is left
    : >"$state/calls"     # of apt-get
    : >"$state/naps"
    touch "$state/lists" # absent: apt-get knows no package
    echo 0 >"$state/uid"
    fake id <<'TEXT'
cat "$state/uid"
TEXT
    fake sleep <<'TEXT'
echo "$*" >>"$state/naps"
TEXT
    fake dpkg-query <<'TEXT'
[ "$1 $2" = "-W -f" ] || exit 2
shift 3
code=0
for name; do
    if grep -qx "$name" "$state/installed"; then
        echo "installed $name"
    elif grep -qx "$name" "$state/removed"; then
        echo "config-files $name"
    else
        echo "dpkg-query: no packages found matching $name" >&2
        code=1
    fi
done
exit $code
TEXT
    # Fails as often as the files busy (update) and broken (install) have lines.
    fake apt-get <<'TEXT'
fail_once() {
    [ -s "$state/$1" ] || return 1
    sed -i 1d "$state/$1"
}
names=()
action=
simulate=no
lean=no
while [ $# -gt 0 ]; do
    case $1 in
    -s) simulate=yes ;;
    -o) shift ;;
    --no-install-recommends) lean=yes ;;
    -*) ;;
    install | update) action=$1 ;;
    *) names+=("$1") ;;
    esac
    shift
done
if [ $simulate = yes ]; then
    [ -e "$state/lists" ]
    exit
fi
echo "$action ${names[*]} ($(id -u), $DEBIAN_FRONTEND)" >>"$state/calls"
if [ $action = update ]; then
    if fail_once busy; then
        echo "E: Could not get lock /var/lib/apt/lists/lock."
        exit 100
    fi
    if [ -e "$state/offline" ]; then
        echo "E: Could not resolve 'deb.debian.org'"
        exit 100
    fi
    touch "$state/lists"
elif [ $lean = no ]; then
    echo "would install what is only recommended"
    exit 100
elif fail_once broken; then
    echo "E: Failed to fetch it: 404"
    exit 100
else
    [ -e "$state/lists" ] || exit 100
    printf '%s\n' "${names[@]}" >>"$state/installed"
fi
TEXT
}

add_sudo() {
    fake sudo <<'TEXT'
if [ "$1" != -n ]; then
    echo "would ask for a password"
    exit 1
fi
shift
echo 0 >"$state/uid"
"$@"
code=$?
echo 1000 >"$state/uid"
exit $code
TEXT
    echo 1000 >"$state/uid"
}

setup() {
    run env -i PATH="$bin" "$bin/bash" "$root/launch/setup" "$@"
}

list() {
    env -i PATH="$bin" "$bin/bash" "$root/launch/setup" --list "$@"
}

install_all_but() {
    list --tests | sed 's/ - .*//' | grep -vxE "$1" >"$state/installed"
}

expect_calls() {
    local calls
    calls=$(cat "$state/calls")
    [ "$calls" = "$1" ] || complain "apt-get was called as '$calls', not as '$1'"
}

test_nothing_is_done_or_said_when_all_is_there() {
    install_all_but none
    setup --tests
    expect_code 0
    [ -z "$output" ] || complain "not silent"
    expect_calls ""
}

test_check_names_what_is_missing_and_what_for_but_installs_nothing() {
    install_all_but 'libcyaml-dev|cmake'
    setup --check
    expect_code 1
    expect_text "libcyaml-dev - configuration files"
    expect_text "cmake - "
    expect_no_text "libjansson-dev"
    expect_calls ""
}

test_check_is_content_when_all_is_there() {
    install_all_but none
    setup --check
    expect_code 0
}

test_only_what_is_missing_is_installed() {
    install_all_but 'libcyaml-dev|cmake'
    setup
    expect_code 0
    expect_text "libcyaml-dev - configuration files"
    expect_calls "install cmake libcyaml-dev (0, noninteractive)"
}

test_packages_of_the_tests_come_only_on_request() {
    install_all_but 'clang'
    setup
    expect_code 0
    expect_calls ""
    setup --tests
    expect_code 0
    expect_calls "install clang (0, noninteractive)"
}

test_packages_of_the_hardware_tests_come_only_on_request() {
    install_all_but 'none'
    setup --tests
    expect_code 0
    expect_calls ""
    setup --hardware --check
    expect_code 1
    expect_text "flex - "
}

test_a_package_of_which_only_the_configuration_is_left_is_missing() {
    install_all_but 'cmake'
    echo cmake >"$state/removed"
    setup --check
    expect_code 1
    expect_text "cmake - "
}

test_a_name_that_another_one_contains_is_not_mistaken_for_it() {
    install_all_but 'clang'
    grep -qx clang-format-14 "$state/installed" || complain "nothing is tested here"
    setup --tests --check
    expect_code 1
    expect_text "clang - "
}

test_empty_package_lists_are_read_first() {
    install_all_but 'cmake'
    rm "$state/lists"
    setup
    expect_code 0
    expect_calls "update  (0, noninteractive)
install cmake (0, noninteractive)"
}

test_old_package_lists_are_read_again_after_a_failure() {
    install_all_but 'cmake'
    echo once >"$state/broken"
    setup
    expect_code 0
    expect_calls "install cmake (0, noninteractive)
update  (0, noninteractive)
install cmake (0, noninteractive)"
}

test_a_busy_lock_is_waited_for() {
    install_all_but 'cmake'
    rm "$state/lists"
    printf 'once\ntwice\n' >"$state/busy"
    setup
    expect_code 0
    [ "$(grep -c . "$state/naps")" = 2 ] || complain "did not wait twice"
}

test_an_installation_that_fails_again_says_what_apt_said() {
    install_all_but 'cmake'
    printf 'once\ntwice\n' >"$state/broken"
    setup
    expect_code 1
    expect_text "Failed to fetch it: 404"
    expect_text "could not install: cmake"
}

test_lists_that_cannot_be_read_are_an_error() {
    install_all_but 'cmake'
    rm "$state/lists"
    printf '%s\n' 1 2 3 4 5 >"$state/busy"
    setup
    expect_code 1
    expect_text "apt-get update failed"
    expect_text "Could not get lock"
}

test_lists_out_of_reach_are_not_asked_for_again_and_again() {
    install_all_but 'cmake'
    rm "$state/lists"
    touch "$state/offline"
    setup
    expect_code 1
    expect_text "Could not resolve"
    expect_calls "update  (0, noninteractive)"
}

test_without_root_and_sudo_it_says_what_to_do_as_root() {
    install_all_but 'cmake|make'
    echo 1000 >"$state/uid"
    setup
    expect_code 1
    expect_text "apt-get install --no-install-recommends cmake make"
    expect_calls ""
}

test_without_root_sudo_is_used() {
    install_all_but 'cmake'
    add_sudo
    setup
    expect_code 0
    expect_calls "install cmake (0, noninteractive)"
}

test_another_system_gets_a_clear_answer() {
    rm "$bin/dpkg-query"
    setup
    expect_code 1
    expect_text "not a Debian system"
}

run_tests
