"""Modal parameters of a known truth: misfit against sdypy-EMA on the same FRFs, in one run.

    python benches/peers/modal.py [SEEDS]

A chain of 22 parts, modal damping 5.5 %, force at its free end, 8 responses, five modes in the band, noise of 1 % of the rms of each FRF; and two modes 1.5 % apart
with 2 % damping. misfit picks its poles by itself; sdypy-EMA is told the true frequencies and takes the poles next to them (its own stabilisation settings).
"""
import json
import os
import subprocess
import sys
import time

import matplotlib

matplotlib.use("Agg")
import numpy as np
from sdypy.EMA import Model

from chain import binary


def chain():
    n, m, k = 22, 0.01, 3.0e7
    spring = k * (1 + 0.1 * np.sin(1.3 * np.arange(n)))
    stiffness = np.zeros((n, n))
    for j in range(n):
        stiffness[j, j] += spring[j]
        if j:
            stiffness[j - 1, j - 1] += spring[j]
            stiffness[j, j - 1] -= spring[j]
            stiffness[j - 1, j] -= spring[j]
    w2, v = np.linalg.eigh(stiffness / m)
    outputs = [1, 4, 7, 10, 13, 16, 19, 21]
    return np.sqrt(w2) / 2 / np.pi, np.full(n, 0.055), v[outputs].T / np.sqrt(m), v[21] / np.sqrt(m)


def close():
    shapes = np.array([[1.0, 0.6, -0.3], [0.8, -0.9, 0.5], [0.5, 0.7, 0.9]])
    return np.array([100.0, 101.5, 160.0]), np.array([0.02, 0.02, 0.01]), shapes, np.array([1.0, 0.9, 0.6])


def receptance(truth, lines):
    f, z, shapes, force = truth
    w, w0 = 2 * np.pi * lines[:, None], 2 * np.pi * f
    return (shapes.T * force) @ (1 / (w0**2 - w**2 + 2j * z * w0 * w)).T


def mac(a, b):
    return abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real)


def score(found, truth, inside):
    """Largest relative errors of frequency and damping, least MAC, missed and spurious modes; each true mode takes the nearest found one."""
    f, z, shapes, _ = truth
    taken, errors = set(), []
    for k in inside:
        near = [j for j in range(len(found)) if j not in taken and abs(found[j][0] / f[k] - 1) < 0.005]
        if not near:
            continue
        j = min(near, key=lambda j: abs(found[j][0] - f[k]))
        taken.add(j)
        errors.append((abs(found[j][0] / f[k] - 1), abs(found[j][1] / z[k] - 1), mac(found[j][2], shapes[k])))
    worst = [max(e[0] for e in errors), max(e[1] for e in errors), min(e[2] for e in errors)] if errors else [np.nan] * 3
    return worst + [len(inside) - len(errors), len(found) - len(taken)]


def misfit(process, lines, h, sigma):
    process.stdin.write(json.dumps({"frequency": lines.tolist(), "outputs": len(h), "inputs": 1, "re": h.real.tolist(), "im": h.imag.tolist(), "sigma": sigma.tolist()}) + "\n")
    process.stdin.flush()
    answer = json.loads(process.stdout.readline())
    return [(m["frequency"], m["damping"], np.array([complex(*s) for s in m["shape"]])) for m in answer["modes"]], answer["seconds"]


def ema(lines, h, known):
    clock = time.perf_counter()
    model = Model(frf=h, freq=lines, lower=lines[0], upper=lines[-1] * 1.001, pol_order_high=60, frf_type="receptance")
    model.get_poles(show_progress=False)
    model.select_closest_poles(list(known))
    constants = model.get_constants(whose_poles="own", FRF_ind="all")
    a = np.asarray(constants[1] if isinstance(constants, tuple) else model.A)
    order = np.argsort(model.nat_freq)
    return [(float(model.nat_freq[j]), float(model.nat_xi[j]), a[:, j]) for j in order], time.perf_counter() - clock


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    program = os.environ.get("MISFIT_MODAL") or binary("modal")
    process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    whole = chain()
    high = 0.5 * (whole[0][4] + whole[0][5])
    cases = [("22 parts, 5 modes", whole, np.linspace(high / 800, high, 800)), ("1.5 % apart", close(), 60 + 0.25 * np.arange(600))]
    print(f"{'case':20s} {'':10s} {'frequency':>10s} {'damping':>9s} {'1 - MAC':>9s} {'missed':>7s} {'spurious':>9s} {'median s':>9s}   (worst of {seeds} seeds)")
    for name, truth, lines in cases:
        inside = [k for k in range(len(truth[0])) if lines[0] < truth[0][k] < lines[-1]]
        clean, rows = receptance(truth, lines), {"misfit": [], "sdypy-EMA": []}
        times = {"misfit": [], "sdypy-EMA": []}
        for seed in range(seeds):
            rng = np.random.default_rng(seed)
            sigma = 0.01 / np.sqrt(2) * np.sqrt((abs(clean) ** 2).mean(axis=1, keepdims=True)) * np.ones_like(clean.real)
            h = clean + sigma * (rng.normal(size=clean.shape) + 1j * rng.normal(size=clean.shape))
            found, seconds = misfit(process, lines, h, sigma)
            rows["misfit"].append(score(found, truth, inside))
            times["misfit"].append(seconds)
            try:
                found, seconds = ema(lines, h, truth[0][inside])
                rows["sdypy-EMA"].append(score(found, truth, inside))
                times["sdypy-EMA"].append(seconds)
            except Exception as error:
                print(f"sdypy-EMA, seed {seed}: {error!r}")
        for side, all_rows in rows.items():
            r = np.array(all_rows, float)
            if len(r):
                print(f"{name:20s} {side:10s} {100 * np.nanmax(r[:, 0]):9.4f}% {100 * np.nanmax(r[:, 1]):8.3f}% {1 - np.nanmin(r[:, 2]):9.1e} {int(r[:, 3].sum()):7d} {int(r[:, 4].sum()):9d} {np.median(times[side]):9.3f}")
    process.stdin.close()


if __name__ == "__main__":
    main()
