"""How well can a chain of rigid parts follow the loops of this folder, and what does it find? A measure for study 06, read by no study.

A plane chain with rotational general forces between neighbouring parts (spring, Prony branches, film in the middle group, elastic slip where
--friction says), large rotations, quasi-static, fitted to the sixteen loops with ten parameters from truth.json's chain_equivalent.

    python chain_fit.py [--friction ends|middle|none]
"""
import argparse
import json
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from generate import FREQUENCIES, INTERFERENCES
from rig import interface, measure
from rig.parameters import Rig
from rig.quasistatic import GAMMA

HERE = Path(__file__).parent
RIG, POINTS, CYCLES = Rig(), 100, 3
CASES = [(1e3 * i, f) for i in INTERFERENCES for f in FREQUENCIES]
I, F = np.array(CASES).T
N = RIG.count
CHORD = np.diff(RIG.curve(np.arange(N + 1) * RIG.part_length)[0], axis=1)
REST, LENGTH = np.arctan2(*CHORD), np.hypot(*CHORD)
BEFORE = np.clip(RIG.drive - np.arange(N), 0.0, 1.0)
END = np.isin(np.arange(1, N), [1, 2, 3, N - 3, N - 2, N - 1])
NAMES = ("k_end", "k_mid", "film f", "film v0", "film d", "friction f", "friction d", "a", "b", "friction exponent")


class Chain:
    """All loops at once: batch of chains, one row each."""

    def __init__(self, p, friction):
        k_end, k_mid, f, self.v0, self.d, limit, self.slip = np.exp(p[:7])
        a, b, c = p[7:]
        di = (I - 1e3 * RIG.design_interference)[:, None]
        k = np.where(END, k_end, k_mid)
        self.k, self.h = k * np.exp(a * di), RIG.loss * k * np.exp(b * di)
        self.film = np.where(END, 0.0, f) * np.exp(b * di)
        where = {"ends": END, "middle": ~END, "none": np.zeros(N - 1, bool)}[friction]
        self.limit = np.where(where, limit, 0.0) * np.exp(c * di)
        self.g, self.tau = RIG.prony()
        self.u = np.zeros((len(I), N + 1))                      # rotations, force of the shelf
        self.anchor, self.z = np.zeros((len(I), N - 1)), np.zeros((len(I), N - 1))
        self.creep = np.zeros((len(self.tau), len(I), N - 1))

    def solve(self, force, step, u, creep, z):
        """Equilibrium; step None: infinitely slow."""
        j = np.arange(N)
        for iteration in range(40):
            turn = np.diff(u[:, :N], axis=1)
            moment, slope, anchor = interface.friction(turn, self.anchor, self.limit, self.slip)
            moment, slope, new_creep, new_z = moment + self.k * turn, slope + self.k, creep, z
            if step is not None:
                ratio = step[:, None] / self.tau[:, None, None]
                new_creep = (creep + ratio * turn) / (1 + ratio)
                m, t, asinh = interface.film(turn, z, step[:, None], self.film, self.d, self.v0)
                moment = moment + m + self.h * np.tensordot(self.g, turn - new_creep, 1)
                slope, new_z = slope + t + self.h * np.tensordot(self.g, 1 / (1 + ratio), 1), self.d * asinh - turn
            cos, sin = LENGTH * np.cos(REST + u[:, :N]), LENGTH * np.sin(REST + u[:, :N])
            side = u[:, N:] - force * BEFORE
            r = np.concatenate([side * cos, sin.sum(1)[:, None]], axis=1)
            r[:, :N - 1] -= moment
            r[:, 1:N] += moment
            if iteration and np.abs(r).max() < 1e-8:
                return u, anchor, new_creep, new_z
            t = np.zeros((len(I), N + 1, N + 1))
            t[:, j, j] = -side * sin
            t[:, j[1:], j[1:]] += slope
            t[:, j[:-1], j[:-1]] += slope
            t[:, j[1:], j[:-1]] -= slope
            t[:, j[:-1], j[1:]] -= slope
            t[:, N, :N] = t[:, :N, N] = cos
            u = u - np.linalg.solve(t, r[:, :, None])[:, :, 0]
        raise RuntimeError("the chain finds no equilibrium")

    def loops(self):
        low, high, dt = measure.FORCE_LOW, measure.FORCE_HIGH, 1.0 / (F * POINTS)
        for force in np.linspace(0.0, low, 6)[1:]:
            self.u, self.anchor, _, _ = self.solve(force, None, self.u, self.creep, self.z)
        turn = np.diff(self.u[:, :N], axis=1)
        self.z, self.creep = -turn, np.repeat(turn[None], len(self.tau), axis=0)
        out = np.zeros((len(I), POINTS, 2))
        rest = (1 - GAMMA) / GAMMA
        for n in range(CYCLES * POINTS):
            a = REST + self.u[:, :N]
            out[:, n % POINTS, 0] = (BEFORE * LENGTH * (np.sin(a) - np.sin(REST))).sum(1)
            out[:, n % POINTS, 1] = (LENGTH * (np.cos(a) - np.cos(REST))).sum(1)
            at = [0.5 * (low + high) - 0.5 * (high - low) * np.cos(2 * np.pi * (n + s) / POINTS) for s in (GAMMA, 1.0)]
            u, self.anchor, creep, z = self.solve(at[0], GAMMA * dt, self.u, self.creep, self.z)
            self.u, self.anchor, self.creep, self.z = self.solve(
                at[1], GAMMA * dt, u + rest * (u - self.u), self.creep + rest * (creep - self.creep), self.z + rest * (z - self.z))
        return 1e3 * out


def main():
    options = argparse.ArgumentParser()
    options.add_argument("--friction", choices=("ends", "middle", "none"), default="ends")
    friction = options.parse_args().friction
    measured = []
    for i, f in CASES:
        table = np.loadtxt(HERE / f"loop-i{i:g}-{f:g}Hz.csv", delimiter=",", skiprows=1)[:, 2:]
        measured.append(table.reshape(measure.KEPT, measure.SAMPLES, 2).mean(0)[:: measure.SAMPLES // POINTS])
    measured, sigma = np.array(measured), measure.LOOP_NOISE / np.sqrt(measure.KEPT)
    truth = json.loads((HERE / "truth.json").read_text())["chain_equivalent"]
    k, film, hidden = truth["k_psi_init"], truth["film"], truth["hidden"]
    deg = 180 / np.pi / 1e3
    true = np.array([k["GF1-3.psi"] * deg, k["GF4-18.psi"] * deg, film["f"] / 1e3, film["v0"], film["d"], hidden["f"] / 1e3, hidden["d"]])
    start = np.append(np.log(true), [RIG.stiffness_exponent / 1e3, RIG.damping_exponent / 1e3, hidden["exponent_of_growth_between_0.1_and_0.6_mm"]])
    free = [n for n in range(10) if friction != "none" or n not in (5, 6, 9)]

    def residual(x):
        p = start.copy()
        p[free] = x
        return ((Chain(p, friction).loops() - measured) / sigma).ravel()
    fit = least_squares(residual, start[free], max_nfev=12, diff_step=1e-4)
    deviation = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
    for n, x, s in zip(free, fit.x, deviation):
        what = f"{np.exp(x - start[n]):.4f} of the geometric estimate" if n < 7 else f"{x:.4f} 1/mm, put in {start[n]:.4f}"
        print(f"{NAMES[n]:18s} {what} (std {s:.4f})")
    r = fit.fun.reshape(measured.shape)
    worst = (np.abs(r).max(1) * sigma / np.ptp(measured, axis=1)).max(0)
    print(f"friction {friction}: residual {np.sqrt(np.mean(r**2)):.3f} sigma of the mean cycle; largest difference over range: "
          f"D_t {100 * worst[0]:.2f} %, D_l {100 * worst[1]:.2f} %")


if __name__ == "__main__":
    main()
