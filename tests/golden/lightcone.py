# SPDX-License-Identifier: MIT
"""The light-cone transform and its Wiener inverse in double precision, on the same
lattice and with the same padding as recon/power/lightcone (O'Toole 2018; Lindell 2019,
Eq. 9)."""

import numpy as np

import table

FALLOFF = 2.0
SNR_DB = [-20.0, 0.0, 20.0, 40.0, 60.0]

# nx, ny, pitch x, y; nt, first range, step; nz, first depth, step; squared cells;
# padded lengths in x and y
CASES = {
    "6x5": (6, 5, 0.06, 0.07, 24, 0.5, 0.012, 20, 0.52, 0.013, 24, 12, 12),
    "7x3_odd": (7, 3, 0.05, 0.08, 27, 0.41, 0.011, 27, 0.41, 0.011, 27, 16, 8),
    "1x9_line": (1, 9, 0.02, 0.05, 30, 0.3, 0.01, 30, 0.3, 0.01, 30, 4, 32),
    "5x4_depth_1": (5, 4, 0.06, 0.06, 24, 0.5, 0.012, 1, 0.56, 0.02, 24, 12, 8),
    "9x2_from_0": (9, 2, 0.04, 0.05, 25, 0.0, 0.015, 25, 0.0, 0.015, 25, 32, 4),
}


def edges(first, step, n):
    return np.maximum(first + (np.arange(n + 1) - 0.5) * step, 0.0)


def shares(out_edges, in_edges, out_gain, in_gain):
    """[out][in]: the length of what each interval shares with each other."""
    upper = np.minimum(out_edges[1:, None], in_edges[None, 1:])
    lower = np.maximum(out_edges[:-1, None], in_edges[None, :-1])
    return np.maximum(upper - lower, 0.0) * np.outer(out_gain, in_gain)


class Lattice:
    def __init__(self, case):
        (self.nx, self.ny, self.px, self.py, self.nt, r0, dr, self.nz, z0, dz) = case[:10]
        self.cells, self.pad_x, self.pad_y = case[10:]
        bins, planes = edges(r0, dr, self.nt), edges(z0, dz, self.nz)
        near, far = min(bins[0], planes[0]), max(bins[-1], planes[-1])
        self.cell = (far**2 - near**2) / self.cells
        squares = near**2 + np.arange(self.cells + 1) * self.cell
        gain = (2 * np.maximum(r0 + np.arange(self.nt) * dr, dr / 2)) ** FALLOFF
        one = np.ones
        c, t, z = self.cells, self.nt, self.nz
        per_bin, per_plane = one(c) / (self.cell * dr), one(z) / (self.cell * dz)
        self.volume_to_cells = shares(np.sqrt(squares), planes, one(c), one(z))
        self.cells_to_bins = shares(bins**2, squares, 1 / gain, per_bin)
        self.bins_to_cells = shares(np.sqrt(squares), bins, one(c), gain)
        self.cells_to_volume = shares(planes**2, squares, per_plane, one(c))
        self.kernel = np.fft.fftn(self.make_kernel())

    def samples(self, n, distance, pitch):
        """Of a voxel's face, along one axis: no farther apart than a cell, up to 32."""
        if n == 1:
            return np.zeros(1)
        count = int(min(np.ceil(2 * (distance + 0.5) * pitch**2 / self.cell) + 1, 32))
        return (np.arange(count) + 0.5) / count - 0.5

    def make_kernel(self):
        """delta(x^2 + y^2 + u - v): [2 cells][pad_y][pad_x]."""
        out = np.zeros((2 * self.cells, self.pad_y, self.pad_x))
        for dy in range(self.ny):
            for dx in range(self.nx):
                y = (dy + self.samples(self.ny, dy, self.py)) * self.py
                x = (dx + self.samples(self.nx, dx, self.px)) * self.px
                lag = ((x[None, :] ** 2 + y[:, None] ** 2) / self.cell).ravel()
                weight = self.px * self.py / len(lag)
                column = np.zeros(2 * self.cells)
                below = np.floor(lag).astype(int)
                for at, part in zip(below, lag - below):
                    if at < self.cells:
                        column[at] += weight * (1 - part)
                    if at + 1 < self.cells:
                        column[at + 1] += weight * part
                for sy in {dy, -dy % self.pad_y}:
                    for sx in {dx, -dx % self.pad_x}:
                        out[:, sy, sx] = column
        return out

    def convolve(self, x, spectrum):
        shape = (2 * self.cells, self.pad_y, self.pad_x)
        y = np.fft.ifftn(np.fft.fftn(x, shape) * spectrum).real
        return y[: self.cells, : self.ny, : self.nx]

    def forward(self, rho):
        """[nz][ny][nx] to [ny][nx][nt]"""
        x = np.tensordot(self.volume_to_cells, rho, 1)
        y = np.tensordot(self.cells_to_bins, self.convolve(x, self.kernel), 1)
        return np.moveaxis(y, 0, 2)

    def inverse(self, tau, snr):
        power = np.abs(self.kernel) ** 2
        wiener = self.kernel.conj() / (power + power.mean() / snr)
        x = np.tensordot(self.bins_to_cells, np.moveaxis(tau, 2, 0), 1)
        return np.tensordot(self.cells_to_volume, self.convolve(x, wiener), 1)


def noise(n, seed):
    """Uniform in -0.5..0.5: the low digits of a quadratic sequence (Weyl)."""
    k = np.arange(1, n + 1, dtype=float)
    return np.round((k * k * (np.sqrt(2.0) - 1) + k * seed * 0.1234567) % 1.0 - 0.5, 6)


def save(folder):
    for name, case in CASES.items():
        lattice = Lattice(case)
        rho = (noise(lattice.nz * lattice.ny * lattice.nx, 1.0) > 0.3) * 1.0
        rho = rho.reshape(lattice.nz, lattice.ny, lattice.nx)
        tau = lattice.forward(rho)
        level = np.abs(tau).max()
        heard = tau / level + 0.1 * noise(tau.size, 2.0).reshape(tau.shape)
        heard = np.round(heard, 6)
        images = [lattice.inverse(heard, 10.0 ** (db / 10)).ravel() for db in SNR_DB]
        scale = [np.abs(z).max() for z in images]
        tables = {
            "lattice": (np.array(case, dtype=float), 6),
            "snr_db": (np.array(SNR_DB), 1),
            "scatterers": (rho.reshape(lattice.nz, -1), 0),
            "measured_scale": ([[f"{level:.9e}"]], 0),
            "measured": ((tau / level).reshape(lattice.ny * lattice.nx, -1), 7),
            "heard": (heard.reshape(lattice.ny * lattice.nx, -1), 6),
            "image_scale": ([[f"{s:.9e}" for s in scale]], 0),
            "image": (np.array([z / s for z, s in zip(images, scale)]).T, 7),
        }
        about = f"""
Light-cone transform of scatterers, and the Wiener inverse of what was heard (that and
noise 20 dB down) at several ratios of signal to noise; falloff {FALLOFF:g}, no taper.
lattice: nx, ny, pitch x, y in m; bins, first, step in m; planes, first, step in m; cells
of squared range; padded lengths in x and y.  measured, heard [ny nx][nt]; scatterers
[nz][ny nx]; image [nz ny nx][snr], each column times its scale"""
        table.save(folder, f"lightcone_{name}", about, tables)
