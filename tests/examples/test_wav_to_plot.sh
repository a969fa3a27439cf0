#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The example in Python: a recording becomes a picture, and the objects in it are told.
#   test_wav_to_plot.sh ANLOS PYTHON
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/../launch/check.sh"
export ANLOS_PROGRAM=$1 MPLBACKEND=Agg MPLCONFIGDIR=$work
python=$2

if ! "$python" -c 'import cffi, google.protobuf, matplotlib, numpy, yaml' 2>/dev/null; then
    echo "skipped: Python has no matplotlib, or lacks what the module needs: launch/setup --tests"
    exit 77
fi
"$ANLOS_PROGRAM" sim "$root/launch/scenes/point.yaml" --out "$work/point" >/dev/null

test_the_point_is_told_where_it_is_and_stands_out_in_the_picture() {
    run "$python" "$root/tests/examples/wav_to_plot.py" "$work/point" "$work/plot.png"
    expect_code 0
    # truth.json, seen from the vehicle: 0.4 0.13 0.41; it is imaged at 1.2 m, of 0.9 to 1.5,
    # and at 0.13 m, of 0.02 to 0.24.
    run "$python" -c '
import sys
import matplotlib.image, numpy
said = [float(x) for x in sys.argv[2].split()]
assert numpy.allclose(said[:3], [0.4, 0.13, 0.41], atol=0.005) and said[3] > 0.9, said
picture = matplotlib.image.imread(sys.argv[1])[..., :3]
brightest = numpy.all(abs(picture - [0.993, 0.906, 0.144]) < 0.02, axis=2)  # of viridis
brightest[:, int(0.75 * picture.shape[1]):] = False  # the colour bar
y, x = numpy.argwhere(brightest).mean(0) / brightest.shape
assert abs(y - 0.5) < 0.05 and 0.35 < x < 0.5, (x, y)' "$work/plot.png" "$output"
    expect_code 0
}

run_tests
