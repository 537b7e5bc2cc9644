"""The chain of benches/src/chain.rs as a peer sees it: group matrices from the rows the Rust side wrote, dense and banded."""
import contextlib
import json
import pathlib
import subprocess

import numpy as np
from scipy.linalg import solve_banded

try:
    from threadpoolctl import threadpool_limits
except ImportError:
    threadpool_limits = None

ROOT = pathlib.Path(__file__).resolve().parents[2]
BATCH = 100  # lines per call of np.linalg.solve: 28 MB of matrices, the fastest of 10, 30, 100, 300, 1000 here


def binary(name):
    """Builds a program of the bench crate and returns its path."""
    command = ["cargo", "build", "--release", "--quiet", "-p", "misfit-benches", "--bin", name, "--message-format=json"]
    out = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    return [m["executable"] for m in map(json.loads, out.splitlines()) if m.get("executable")][-1]


def blas_threads(count):
    """Runs numpy's BLAS on `count` threads inside a `with`; needs threadpoolctl, without it the default number stays."""
    return threadpool_limits(count) if threadpool_limits and count else contextlib.nullcontext()


class Chain:
    """Z(w) = -w^2 M + sum_g z_g(w) A_g, A_g = sum of b b' over the rows of group g."""

    def __init__(self, path, group):
        data = json.loads(pathlib.Path(path).read_text())
        self.n, self.input, self.outputs = data["n"], data["input"], data["outputs"]
        self.omega, self.laws = np.array(data["omega"]), data["laws"]
        groups = max(group(axis) for axis in range(6)) + 1
        self.patterns = np.zeros((groups, self.n, self.n))
        for at, row in enumerate(data["rows"]):
            b = np.zeros(self.n)
            for dof, value in row:
                b[dof] += value
            self.patterns[group(at % 6)] += np.outer(b, b)
        self.mass = np.zeros((self.n, self.n))
        for i, j, value in data["mass"]:
            self.mass[i, j] += value
        filled = np.argwhere((np.abs(self.patterns).sum(0) + np.abs(self.mass)) > 0)
        self.width = int(np.abs(filled[:, 0] - filled[:, 1]).max())
        self.flat = self.patterns.reshape(groups, -1)
        bands = np.stack([self._band(p) for p in [*self.patterns, self.mass]])
        self.band_shape = bands.shape[1:]
        self.bands, self.band_mass = bands[:-1].reshape(groups, -1), bands[-1]

    def _band(self, full):
        band = np.zeros((2 * self.width + 1, self.n))
        for offset in range(-self.width, self.width + 1):
            d = np.diagonal(full, offset)
            first = max(offset, 0)
            band[self.width - offset, first : first + len(d)] = d
        return band

    def dense(self, omega, z):
        """Z for a batch of lines; z is (lines, groups)."""
        matrices = (z @ self.flat).reshape(len(omega), self.n, self.n)
        matrices -= (omega**2)[:, None, None] * self.mass
        return matrices

    def frf_dense(self, z, omega=None):
        """H (lines, outputs) by np.linalg.solve on batches of dense matrices."""
        omega = self.omega if omega is None else omega
        load = np.zeros((self.n, 1), complex)
        load[self.input] = 1
        h = np.empty((len(omega), len(self.outputs)), complex)
        for at in range(0, len(omega), BATCH):
            part = slice(at, at + BATCH)
            h[part] = np.linalg.solve(self.dense(omega[part], z[part]), load)[:, self.outputs, 0]
        return h

    def frf_banded(self, z):
        """The same by scipy.linalg.solve_banded, line by line."""
        load = np.zeros(self.n, complex)
        load[self.input] = 1
        h = np.empty((len(self.omega), len(self.outputs)), complex)
        for at in range(0, len(self.omega), BATCH):
            omega = self.omega[at : at + BATCH]
            bands = (z[at : at + BATCH] @ self.bands).reshape(len(omega), *self.band_shape)
            bands -= (omega**2)[:, None, None] * self.band_mass
            for line, band in enumerate(bands):
                x = solve_banded((self.width, self.width), band, load, overwrite_ab=True, check_finite=False)
                h[at + line] = x[self.outputs]
        return h


def stiffness(omega, k, eta, beta, tau):
    """z(w) = k (1 + i eta + beta i w tau / (1 + i w tau))"""
    s = 1j * omega * tau
    return k * (1 + 1j * eta + beta * s / (1 + s))
