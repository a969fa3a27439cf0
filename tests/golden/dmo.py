# SPDX-License-Identifier: MIT
"""Dip moveout: its phase to 17 digits, and its convolution over midpoints as an integral
over wavenumbers (Lindell 2019, Eq. 14)."""

from decimal import Decimal, getcontext

import numpy as np

import table

PITCH_M = 0.0125
LINES = 12
HALVES_M = [0.1, 0.5]


def exact_phase(kh, w):
    """W/2 (A - 1 - ln((A + 1) / 2)) as printed, with digits enough to cancel."""
    if w == 0:
        return abs(kh)
    a = (1 + (2 * kh / w) ** 2).sqrt()
    return w / 2 * (a - 1 - ((a + 1) / 2).ln())


def save_phase(folder):
    getcontext().prec = 60
    rows = []
    for w in ("-55", "0.001", "3.7", "1200", "90000"):
        for exponent in range(-12, 13):
            ratio = Decimal(10) ** (Decimal(exponent) / 2)
            kh = float(ratio * abs(Decimal(w)) / 2)
            phase = exact_phase(Decimal(kh), Decimal(float(w)))
            rows.append([repr(kh), repr(float(w)), f"{phase:.17e}"])
    for kh in ("1e-06", "0.5", "28.0", "1000000.0"):
        rows.append([kh, "0", f"{exact_phase(Decimal(float(kh)), Decimal(0)):.17e}"])
    about = """
Phase of dip moveout, W/2 (A - 1 - ln((A + 1) / 2)), A = sqrt(1 + (2 k h / W)^2), in 60
digits, for 2 k h / W from 1e-6 to 1e6 and W = 0.
phase: k h in rad, W in rad, phase in rad"""
    table.save(folder, "dmo_phase_ratio_1e-6_to_1e6", about, {"phase": (rows, 0)})


def phase(kh, w):
    """In double, with nothing subtracted that is nearly equal."""
    x = (2 * kh / w) ** 2
    s = x / (1 + np.sqrt(1 + x))
    return w / 2 * (s - np.log1p(s / 2))


def kernel(w, half_m):
    """p / pi times the integral over 0..pi / p of cos(k d p) exp(-i phi), d = 0.."""
    panels, points = 600, 6
    at, weight = np.polynomial.legendre.leggauss(points)
    k_max = np.pi / PITCH_M
    edge = np.linspace(0.0, k_max, panels + 1)[:-1, None]
    k = (edge + (at + 1) / 2 * k_max / panels).ravel()
    weight = np.tile(weight / 2 / panels, panels)
    if w == 0.0:
        shift = np.cos(k * half_m)
    else:
        shift = np.exp(-1j * phase(k * half_m, w))
    distance = np.arange(LINES)[:, None] * PITCH_M
    return (np.cos(k * distance) * shift * weight).sum(axis=1)


def save_kernel(folder):
    rows = []
    for half_m in HALVES_M:
        steepest = 2 * np.pi / PITCH_M * half_m
        for w in [0.0] + [steepest / 10.0**e for e in range(-6, 7, 2)] + [-40.0, 700.0]:
            w = float(f"{w:.9g}")
            z = kernel(w, half_m)
            rows.append([half_m, w, *np.column_stack([z.real, z.imag]).ravel()])
    about = f"""
Dip moveout of one bin as a convolution over midpoints {PITCH_M} m apart, for 2 k h / W
from 1e-6 to 1e6 at the largest k, W = 0, and two in between.
kernel: half-offset in m, W in rad, re im at distances of 0..{LINES - 1} midpoints"""
    table.save(
        folder,
        f"dmo_kernel_pitch_{PITCH_M}_lines_{LINES}",
        about,
        {"kernel": (np.array(rows), 9)},
    )


def save(folder):
    save_phase(folder)
    save_kernel(folder)
