# SPDX-License-Identifier: MIT
"""The image that f-k migration is to show: the sum of plane waves over all frequencies
and directions, voxel by voxel (Stolt 1978); of those directions that recon/coherent/fk uses, and
of all that propagate."""

import numpy as np

import table

C = 343.0
GAIN_POWER = 0.5  # plane waves are weighted by kz to this power
BINS = 36  # of the band: the sum repeats itself after 0.34 m of depth
VOXELS = (7, 7, 9)
STEP_M = (0.02, 0.02, 0.006)

# lines in x, y; pitch x, y; point; band; period of the sum over wavenumbers in m; sine of
# the steepest waves in it (at 2.5 m those of all angles would want 20 m); signs that
# alternate from midpoint to midpoint
CASES = {
    "far_2.5_m": (8, 10, 0.04, 0.03, (0.02, -0.03, 2.5), (2e3, 2e4), 2.5, 0.5, False),
    "near_0.3_m": (8, 10, 0.04, 0.03, (0.02, -0.03, 0.3), (2e3, 2e4), 1.2, 0.98, False),
    "off_centre_19_degrees": (
        *(8, 10, 0.04, 0.03, (0.3, -0.2, 1.0), (2e3, 2e4)),
        *(2.0, 0.98, False),
    ),
    "aliased_12_cm": (8, 8, 0.12, 0.1, (0.05, 0.02, 0.9), (2e3, 2e4), 2.4, 0.98, False),
    "single_line": (12, 1, 0.04, 0.04, (0.03, 0.0, 0.8), (2e3, 2e4), 1.6, 0.98, False),
    "evanescent": (8, 10, 0.04, 0.03, (0.0, 0.0, 0.8), (2e3, 3.4e3), 2.0, 0.98, True),
}


def lines(n, pitch_m):
    return pitch_m * (np.arange(n) - (n - 1) / 2)


def spectrum(x_m, y_m, point, signs, k):
    """Over midpoints, of what fades as 1 / r."""
    r = np.sqrt((x_m[:, None] - point[0]) ** 2 + (y_m - point[1]) ** 2 + point[2] ** 2)
    return signs * np.exp(-1j * k * r) / r


def waves(k_lateral, at_m, sign):
    return np.exp(sign * 1j * np.outer(k_lateral, at_m))


def voxels_of(point):
    return [p + s * (np.arange(n) - n // 2) for p, s, n in zip(point, STEP_M, VOXELS)]


def sine(across_m, depth_m):
    return across_m / np.hypot(across_m, depth_m)


def steepest_used(case):
    """recon/coherent/fk leaves out what is steeper than any line from a midpoint to a voxel, and
    than 30 degrees unless voxels beside the midpoints need it, or those in the middle of
    the depth see more of a line of midpoints."""
    nx, ny, px, py, point = case[:5]
    voxels = voxels_of(point)
    reach, beyond = [], []
    for line, at in ((lines(nx, px), voxels[0]), (lines(ny, py), voxels[1])):
        outside = max(line[0] - at[0], at[-1] - line[-1])
        half = (line[-1] - line[0]) / 2
        reach.append(max(at[-1] - line[0], line[-1] - at[0]))
        beyond.append(outside + half if outside > half else 0.0)
    middle = (voxels[2][0] + voxels[2][-1]) / 2
    needed = max(sine(np.hypot(*beyond), voxels[2][0]), sine(max(reach), middle), 0.5)
    return min(needed, sine(np.hypot(*reach), voxels[2][0]), 0.9)


def image(case, steepest, alternating):
    nx, ny, px, py, point, band_hz, period_m = case[:7]
    x_m, y_m = lines(nx, px), lines(ny, py)
    signs = (-1.0) ** (np.arange(nx)[:, None] + np.arange(ny)) if alternating else 1.0
    voxels = voxels_of(point)
    out = np.zeros(VOXELS, complex)
    for q in range(1, BINS):
        f = band_hz[0] + (band_hz[1] - band_hz[0]) * q / BINS
        k = 4 * np.pi * f / C
        dk = 2 * np.pi / period_m
        lateral = dk * np.arange(-int(steepest * k / dk), int(steepest * k / dk) + 1)
        square = lateral[:, None] ** 2 + lateral**2
        kz = np.sqrt(np.maximum(k * k - square, 0.0))
        used = square < (steepest * k) ** 2
        # dkx dky dkz = dkx dky k / kz dk
        gain = np.where(used, k * np.maximum(kz, 1.0) ** (GAIN_POWER - 1), 0.0)
        hann = 0.5 - 0.5 * np.cos(2 * np.pi * q / BINS)
        heard = waves(lateral, x_m, -1) @ spectrum(x_m, y_m, point, signs, k)
        plane = hann * gain * (heard @ waves(lateral, y_m, -1).T)
        plane = plane * np.exp(1j * kz * voxels[2][0])
        down = np.exp(1j * kz * STEP_M[2])
        to_x, to_y = waves(lateral, voxels[0], 1).T, waves(lateral, voxels[1], 1)
        for z in range(VOXELS[2]):
            out[:, :, z] += to_x @ plane @ to_y
            plane = plane * down
    return np.abs(out)


def save(folder):
    for name, case in CASES.items():
        nx, ny, px, py, point, band_hz, _, steepest, alternating = case
        tables = {}
        for key, sines in (("image", steepest_used(case)), ("image_of_all", steepest)):
            shown = image(case, sines, alternating)
            scale = (image(case, sines, False) if alternating else shown).max()
            rows = (shown / scale).transpose(2, 1, 0).reshape(VOXELS[2], -1)
            tables[key] = (rows, 6)
        numbers = [nx, ny, px, py, *point, *band_hz, C, *STEP_M, alternating]
        about = """
Amplitude of the image of a point from co-located traces on lines of midpoints around 0,
by a direct sum of plane waves, over the largest value that it has without alternating
signs.
setup: lines x, y, pitch x, y in m, point in m, band in Hz, c in m/s, voxel steps in m,
whether signs alternate from midpoint to midpoint
image, image_of_all: [z][y x], x fastest, the point in the middle; of the waves that
recon/coherent/fk uses, of all that propagate"""
        tables["setup"] = (np.array(numbers, dtype=float), 6)
        table.save(folder, f"fk_{name}", about, tables)
