#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The example of libanlos finds what is in a simulated scene, as `anlos recon` does.
#   test_wav_to_objects.sh ANLOS EXAMPLE...
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/../launch/check.sh"

anlos=${1:?the program anlos}
shift
examples=("$@")
two=$work/two

# Two points before the array that the example has.
make_scene() {
    sed 's/^objects:/&\n  - {name: near, kind: point, position_m: [0.08, 0.16, 0.2], scattering_length_m: 0.05}/' \
        "$root/launch/scenes/point.yaml" >"$work/two.yaml"
    "$anlos" sim "$work/two.yaml" --out "$two" >/dev/null
}

# Of lines "x y z" on stdin: is each of those in FILE within CM of one of them?
expect_near() {
    awk -v limit="$2" -v wanted="$1" '
        BEGIN { n = m = 0 }
        { x[n] = $1; y[n] = $2; z[n] = $3; n++ }
        END {
            while ((getline line <wanted) > 0) {
                split(line, w, " ")
                least = 1e9
                for (i = 0; i < n; i++) {
                    d = 100 * sqrt((x[i] - w[1])^2 + (y[i] - w[2])^2 + (z[i] - w[3])^2)
                    if (d < least) least = d
                }
                if (least > limit) { printf "%s: the next is %g cm away\n", line, least; bad = 1 }
                m++
            }
            if (m != 2 || n != 2) { printf "%d objects and %d wanted, expected 2\n", n, m; bad = 1 }
            exit bad
        }'
}

test_its_objects_are_those_of_the_scene_and_of_recon() {
    make_scene
    awk '/vehicle_m/ { for (i = 0; i < 3; i++) { getline; printf "%g ", $1 } print "" }' \
        "$two/truth.json" >"$work/truth"
    "$anlos" recon --survey "$two/survey.yaml" --wav "$two/scene" --method fast \
        --out "$work/out" 2>/dev/null |
        awk '$1 ~ /^[0-9]+$/ && $2 ~ /^-?[0-9.]+$/ { print $2, $3, $4 }' >"$work/recon"
    for example in "${examples[@]}"; do
        run "$example" "$two/scene"
        expect_code 0
        printf '%s\n' "$output" >"$work/objects"
        for wanted in truth recon; do
            code=0
            output=$(expect_near "$work/$wanted" 1 <"$work/objects") || code=$?
            expect_code 0
        done
    done
}

test_a_folder_without_files_is_named() {
    run "${examples[0]}" "$work/nowhere"
    expect_code 1
    expect_text "$work/nowhere/pos00.wav"
}

run_tests
