"""Hidden effects of one connector from its loops: misfit's ladder against pySINDy with the same terms, on the same files, in one run.

    python benches/peers/sindy.py [CASES] [SEED]

The cases are those of `misfit trial --kinds one --models connector`. pySINDy gets every law of the library that a column can stand for:
functions of displacement, velocity and acceleration as they are, laws with a shape or a memory at three shapes each (the memory run through
the recorded displacement), and a constant for the offsets. Displacements carry no noise, so velocities by FFT are exact. Sequentially
thresholded least squares with normalised columns at forty thresholds; of these models the one of the least Bayesian information criterion
on fit and select tests together is taken, and beside it stands in how many cases any of the forty would have been right, which only who knows
the truth could pick. Right is who names the hidden effect and no other beside what the study already holds. Cases whose effect has no column
are left out for both.
"""
import collections
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib
import warnings

import numpy as np
import pysindy

from chain import ROOT, binary

CYCLES_SKIPPED = 2


def loops(folder):
    """Displacement, velocity, acceleration and force of whole cycles, by test."""
    found = {}
    for test in tomllib.loads((folder / "data/dataset.toml").read_text())["test"]:
        with open(folder / "data" / test["file"]) as file:
            rows = np.array([[float(v) for v in row] for row in list(csv.reader(file))[1:]])
        t, x, force = rows.T
        frequency = float(test["conditions"]["frequency"].split()[0])
        per_cycle = round(1 / frequency / (t[1] - t[0]))
        n = len(t) // per_cycle * per_cycle
        x, force = x[:n], force[:n]
        w = 2j * np.pi * np.fft.rfftfreq(n, t[1] - t[0])
        spectrum = np.fft.rfft(x)
        found[test["id"]] = dict(x=x, v=np.fft.irfft(w * spectrum, n), a=np.fft.irfft(w**2 * spectrum, n), w=w, s=spectrum, f=force, dt=t[1] - t[0], skip=CYCLES_SKIPPED * per_cycle)
    return found


def march(rate, loop):
    """A state driven by the recorded motion, midpoint in ten parts of every step."""
    z, out, parts = 0.0, np.empty(len(loop["x"])), 10
    for k, v in enumerate(loop["v"]):
        out[k] = z
        h = loop["dt"] / parts
        for _ in range(parts):
            middle = z + 0.5 * h * rate(z, v)
            z += h * rate(middle, v)
    return out


def slider(x, d):
    z, out = 0.0, np.empty(len(x))
    for k in range(len(x)):
        z = min(1.0, max(-1.0, z + (x[k] - x[k - 1]) / d)) if k else 0.0
        out[k] = z
    return out


def columns(loop, size, speed, band):
    """Every term by the name of its effect, one list of columns each. `size`, `speed`, `band`: largest displacement and velocity, angular frequencies."""
    x, v, a = loop["x"], loop["v"], loop["a"]
    spectral = lambda z: np.fft.irfft(z * loop["s"], len(x))
    w = loop["w"].imag
    middle = np.sqrt(band[0] * band[1])
    sign = np.sign(v)
    sphere = lambda side, gap: side * np.maximum(side * x - gap, 0.0) ** 1.5
    bristle = lambda d, vs: march(lambda z, u: (u - abs(u) * z / (1 + 0.7 * np.exp(-((u / vs) ** 2)))) / d, loop)
    yields = lambda d: march(lambda z, u: (u - 0.5 * (abs(u) * z * abs(z) + u * z * z)) / d, loop)
    return {
        "linear_stiffness": [x],
        "viscous": [v],
        "added_mass": [a],
        "coulomb": [sign],
        "cubic_stiffness": [x**3],
        "quadratic_stiffness": [x**2],
        "bilinear_stiffness": [np.maximum(x - p * size, 0.0) for p in (-0.25, 0.0, 0.25)],
        "contact": [sphere(side, p * size) for side in (-1, 1) for p in (0.15, 0.35, 0.55)],
        "backlash": [x - np.clip(x, -p * size, p * size) for p in (0.1, 0.25, 0.5)],
        "quadratic_damping": [v * abs(v)],
        "power_damping": [sign * abs(v) ** n for n in (0.4, 0.6, 1.5, 1.7)],
        "film": [np.arcsinh(v / (p * speed)) for p in (0.005, 0.03, 0.15)],
        "stribeck": [sign * np.exp(-((v / (p * speed)) ** 2)) for p in (0.07, 0.15, 0.25)],
        "maxwell": [spectral(1j * w / (1j * w + r)) for r in (band[0], middle, band[1])],
        "structural_damping": [spectral(1j * np.sign(w))],
        "springpot": [spectral((1j * w / middle) ** p) for p in (0.3, 0.5, 0.7)],
        "elastic_slip": [slider(x, p * size) for p in (0.06, 0.15, 0.4)],
        "iwan": [np.mean([slider(x, p * size * q) for q in np.linspace(0.05, 1.0, 12)], axis=0) for p in (0.5, 0.8, 1.1)],
        "bouc_wen": [yields(p * size) for p in (0.06, 0.13, 0.3)],
        "lugre": [bristle(p * size, q * speed) for p in (0.04, 0.08) for q in (0.08, 0.16)],
    }


def sindy(data, select, held_out):
    """Names of the effects in pySINDy's models at every threshold, that of the least information criterion first."""
    size = max(abs(d["x"]).max() for d in data.values())
    speed = max(abs(d["v"]).max() for d in data.values())
    rates = [2 * np.pi / (len(d["x"]) * d["dt"]) * np.argmax(abs(d["s"][1:])) + 2 * np.pi / (len(d["x"]) * d["dt"]) for d in data.values()]
    names, tables = [], {}
    for test, d in data.items():
        terms = columns(d, size, speed, (min(rates), max(rates)))
        names = [name for name, of in terms.items() for _ in of] + ["constant"]
        tables[test] = np.column_stack([c for of in terms.values() for c in of] + [np.ones(len(d["x"]))])[d["skip"] :]
    scale = np.sqrt(np.mean(np.concatenate([d["f"] ** 2 for d in data.values()])))
    forces = {test: d["f"][d["skip"] :, None] / scale for test, d in data.items()}
    unit = np.maximum(np.sqrt(np.mean(np.concatenate(list(tables.values())) ** 2, axis=0)), 1e-300)
    fitted = [t for t in data if t not in select and t not in held_out]
    tried = []
    for threshold in np.geomspace(1e-4, 1.0, 40):
        model = pysindy.SINDy(optimizer=pysindy.STLSQ(threshold=threshold, alpha=1e-6, max_iter=50), feature_library=pysindy.IdentityLibrary())
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model.fit([tables[t] / unit for t in fitted], t=1.0, x_dot=[forces[t] for t in fitted])
        c = model.coefficients()[0]
        squares = np.concatenate([(tables[t] / unit @ c - forces[t][:, 0]) ** 2 for t in data if t not in held_out])
        criterion = len(squares) * np.log(np.mean(squares)) + np.count_nonzero(c) * np.log(len(squares))
        tried.append((criterion, sorted({names[k] for k in np.flatnonzero(c)} - {"constant"})))
    return [set(found) for _, found in sorted(tried)]


def ladder(program, folder):
    run = subprocess.run([program, "ladder", folder, "--json"], capture_output=True, text=True, check=True)
    missing = json.loads(run.stdout)["missing"]
    return sorted(m["effect"] for m in missing), {t.split(" at ")[0] for m in missing[:1] for t in m["tied_with"]}


def main():
    cases, seed = (int(a) for a in (sys.argv[1:] + ["60", "90210"][len(sys.argv) - 1 :])[:2])
    build = ["cargo", "build", "--release", "--quiet", "--bin", "misfit", "--message-format=json"]
    built = subprocess.run(build, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    program = [m["executable"] for m in map(json.loads, built.splitlines()) if m.get("executable")][-1]
    score = collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([binary("trial_cases"), folder, str(seed), str(cases)], check=True)
        for index in range(cases):
            case = pathlib.Path(folder) / str(index)
            hidden = tomllib.loads((case / "truth.toml").read_text())["hidden"][0]["effect"]
            study = tomllib.loads((case / "study.toml").read_text())
            data = loops(case)
            split = study["split"]
            if hidden not in columns(next(iter(data.values())), 1.0, 1.0, (1.0, 1.0)):
                continue
            held = {e["effect"] for e in study["effect"]}
            tried = [found - held for found in sindy(data, split["select"], split["held_out"])]
            peer = tried[0]
            said, ties = ladder(program, case)
            score["cases"] += 1
            score["pySINDy, right set"] += peer == {hidden}
            score["pySINDy, right set at some threshold"] += {hidden} in tried
            score["pySINDy, hidden effect among those named"] += hidden in peer
            score["misfit, right set"] += said == [hidden]
            score["misfit, right set or declared tie"] += len(said) == 1 and hidden in {*said, *ties}
            score["misfit, hidden effect among those named"] += hidden in said
            print(f"{index:4d} {hidden:20s} pySINDy: {' + '.join(sorted(peer)) or '-'}   misfit: {' + '.join(said) or '-'}", flush=True)
    for what, count in score.items():
        print(f"{what}: {count}")


if __name__ == "__main__":
    main()
