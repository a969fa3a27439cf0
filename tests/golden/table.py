# SPDX-License-Identifier: MIT
"""Golden vectors as text: comments, then named tables of numbers (read by golden.c).

Numbers are rounded to so many decimals after scaling that another machine's last bits do
not show: making them again gives the same bytes.
"""

import numpy as np


def text(value, decimals):
    if isinstance(value, str):
        return value
    rounded = f"{value:.{decimals}f}"
    return rounded.rstrip("0").rstrip(".") if "." in rounded else rounded


def plain_zero(entry):
    return "0" if entry in ("-0", "") else entry


def save(folder, name, about, tables):
    """tables: {name: (array of one or two dimensions or rows of strings, decimals)}"""
    lines = [f"# {line}" for line in about.strip().splitlines()]
    for key, (values, decimals) in tables.items():
        rows = values if isinstance(values, list) else np.atleast_2d(values)
        lines.append(f"{key} {len(rows)} {len(rows[0])}")
        for row in rows:
            lines.append(" ".join(plain_zero(text(v, decimals)) for v in row))
    with open(f"{folder}/{name}.txt", "w", encoding="ascii") as out:
        out.write("\n".join(lines) + "\n")
