# SPDX-License-Identifier: MIT
"""Normal moveout and log-stretch there and back: what becomes of a trace of band-limited
echoes, from their closed form (Lindell 2019, Eq. 11 and 13)."""

import numpy as np

import table

C = 343.0
BAND_HZ = (2000.0, 20000.0)
CARRIER_HZ = 11000.0
RATE_HZ = 36000.0
N = 260
HALVES_M = [0.0, 0.12, 0.5]


def echo(t, delay_s):
    """The analytic echo of a Hann-windowed band, brought down by the carrier."""
    u = (BAND_HZ[1] - BAND_HZ[0]) * (t - delay_s)
    one = np.abs(np.abs(u) - 1) < 1e-7
    pulse = np.where(one, 0.5, np.sinc(u) / np.where(one, 1.0, 1 - u * u))
    middle_hz = (BAND_HZ[0] + BAND_HZ[1]) / 2
    turns = middle_hz * (t - delay_s) - CARRIER_HZ * t
    return pulse * np.exp(2j * np.pi * turns)


def trace(t, delays_s, gains):
    return sum(g * echo(t, d) for d, g in zip(delays_s, gains))


def echoes(t0_s):
    """Delays spread over the gate, levels over two decades, any sign."""
    k = np.arange(14)
    delays_s = t0_s + (20 + 16.13 * k + 3 * np.sin(7 * k)) / RATE_HZ
    gains = 10.0 ** (-1 - np.cos(5 * k + 1)) * np.where(k % 3, 1.0, -1.0)
    return delays_s, gains


def expected(t0_s, rate_hz, n, half_m, delays_s, gains, power):
    """At zero-offset times; what a pair heard before the direct sound has none."""
    t0 = t0_s + np.arange(n) / rate_hz
    t = np.hypot(t0, 2 * half_m / C)
    z = trace(t, delays_s, gains)
    if power:
        return np.abs(z) ** 2 * (C * t) ** 2
    return C * t0 / 2 * z * np.exp(2j * np.pi * CARRIER_HZ * (t - t0))


def columns(*arrays):
    parts = []
    for z in arrays:
        parts += [z.real, z.imag] if np.iscomplexobj(z) else [z]
    return np.column_stack(parts)


def save_gate(folder, name, t0_s):
    delays_s, gains = echoes(t0_s)
    recorded = trace(t0_s + np.arange(N) / RATE_HZ, delays_s, gains)
    tables = {
        "t0_rate_carrier_low_high_c": (
            np.array([t0_s, RATE_HZ, CARRIER_HZ, *BAND_HZ, C]),
            12,
        ),
        "half_offsets": (np.array(HALVES_M), 6),
        "trace": (columns(recorded), 9),
        "co_located": (
            columns(
                *(expected(t0_s, RATE_HZ, N, h, delays_s, gains, False) for h in HALVES_M)
            ),
            9,
        ),
        "co_located_power": (
            columns(
                *(expected(t0_s, RATE_HZ, N, h, delays_s, gains, True) for h in HALVES_M)
            ),
            9,
        ),
    }
    about = """
A trace of 14 echoes over a gate, and what a co-located pair would have heard of it, for
each half-offset: complex traces times c t0 / 2, powers times (c t)^2, at the input's own
times.
trace: re im; co_located: re im of each half-offset; co_located_power: each half-offset"""
    table.save(folder, name, about, tables)


def save(folder):
    save_gate(folder, "moveout_gate_from_bin_0", 0.0)
    save_gate(folder, "moveout_gate_from_bin_1", 1.0 / RATE_HZ)
    save_gate(folder, "moveout_gate_from_8_ms", 0.008)
