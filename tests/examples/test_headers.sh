#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The public headers: each compiles by itself, as C99 and as C++11, and the libraries show
# what is declared there and nothing else.
#   test_headers.sh LIBANLOS_SO LIBANLOS_A
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/../launch/check.sh"

shared=${1:?libanlos.so}
archive=${2:?libanlos.a}
include=$root/recon/include
strict=(-Wall -Wextra -Werror -pedantic-errors -Wshadow -Wconversion -Wundef -fsyntax-only
    -I "$include")

# COMPILER LANGUAGE OPTION...: a source that is one header, twice.
expect_compiles() {
    local compiler=$1 language=$2 header=$3
    shift 3
    command -v "$compiler" >/dev/null || return 0
    printf '#include <anlos/%s>\n' "$header" "$header" >"$work/one.$language"
    printf 'int one(void);\nint one(void)\n{\n    return 1;\n}\n' >>"$work/one.$language"
    run "$compiler" -x "$language" "$@" "${strict[@]}" "$work/one.$language"
    expect_code 0
}

test_each_is_c99_by_itself() {
    local header
    for header in "$include"/anlos/*.h; do
        expect_compiles gcc c "${header##*/}" -std=c99 -Wstrict-prototypes \
            -Wmissing-prototypes
    done
}

test_all_are_c99_and_c_plus_plus() {
    expect_compiles clang c anlos.h -std=c99 -Wstrict-prototypes -Wmissing-prototypes
    expect_compiles g++ c++ anlos.h -std=c++11
    expect_compiles clang++ c++ anlos.h -std=c++11
}

test_a_program_in_c_plus_plus_links() {
    command -v g++ >/dev/null || return 0
    cat >"$work/program.cc" <<'TEXT'
#include <anlos/anlos.h>
#include <cstring>
static_assert(sizeof(anlos_error) == 1024, "an error never grows");
int main()
{
    anlos_error why = anlos_error();
    anlos_survey *survey = nullptr;
    anlos_config cfg;
    anlos_pipeline *pipeline = nullptr;
    anlos_config_init(&cfg);
    if (std::strcmp(anlos_version(), ANLOS_VERSION) || anlos_survey_create(&survey, &why))
        return 1;
    int code = anlos_pipeline_create(&pipeline, &cfg, survey, &why); // no speakers
    anlos_survey_destroy(survey);
    return code == ANLOS_INVALID && !pipeline && why.text[0] ? 0 : 2;
}
TEXT
    if [[ $(nm -D "$shared") == *__asan_* ]]; then # its runtime is not in this program
        return
    fi
    run g++ -std=c++11 -Wall -Wextra -Werror -I "$include" "$work/program.cc" "$shared" \
        -Wl,-rpath,"$(dirname "$shared")" -o "$work/program"
    expect_code 0
    run "$work/program"
    expect_code 0
}

declared() {
    cat "$include"/anlos/*.h | tr '\n' ' ' | grep -oE 'ANLOS_API [^;(]*\(' |
        grep -oE 'anlos_[a-z0-9_]+' | sort -u
}

# LIBRARY NM_OPTION: what it shows.
expect_declared() {
    declared >"$work/declared"
    [ "$(wc -l <"$work/declared")" -gt 20 ] || complain "no functions are declared"
    nm "$2" --defined-only "$1" | awk 'NF == 3 { print $3 }' | sort -u >"$work/shown"
    run diff "$work/declared" "$work/shown"
    expect_code 0
}

test_the_shared_library_shows_what_they_declare() {
    expect_declared "$shared" -D
}

test_the_archive_shows_what_they_declare() {
    if [ -e "$archive" ]; then
        expect_declared "$archive" -g
    fi
}

test_the_library_is_named_by_its_interface() {
    local abi
    abi=$(sed -n 's/^#define ANLOS_ABI *//p' "$include/anlos/version.h")
    run objdump -p "$shared"
    expect_text "libanlos.so.$abi"
}

run_tests
