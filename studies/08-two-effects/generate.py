"""Synthetic measurements of one connector with two effects that a spring and a damper do not know.

    F = k x + c v + f z + k_m s
    dz/dt = (v - (|v| z |z|^(n-1) + v |z|^n) / 2) / d      yielding after Bouc and Wen: saturates at z = 1
    ds/dt = v - s / tau                                    a spring and a damper in series

Both states are integrated by SciPy's LSODA at 1e-9 under the exact motion; nothing is shared with the product's engines. The end is
driven (displacement control); the amplitude grows over the first cycle as a raised cosine. Noise: white, on the force, 0.5 % of its rms in
the steady cycles; the displacement is recorded to its resolution.

    python generate.py
"""
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

HERE = Path(__file__).parent
SEED = 20268
K, C = 52.0, 0.06               # N/mm, N s/mm
F, D, N = 9.0, 0.11, 1.7        # N, mm, -
KM, TAU = 11.0, 0.055           # N/mm, s
SAMPLES, CYCLES, DISCARD = 100, 7, 3
# Hz, mm, split
TESTS = [(0.2, 1.2, "fit"), (1.0, 0.4, "fit"), (3.0, 1.2, "fit"), (8.0, 0.7, "fit"), (8.0, 0.2, "fit"),
         (2.0, 0.9, "select"), (5.0, 0.5, "select"), (4.0, 1.0, "held_out")]


def motion(t, f, amplitude):
    """Displacement in mm and velocity in mm/s."""
    w = 2.0 * np.pi * f
    g = 0.5 * (1.0 - np.cos(np.pi * np.clip(f * t, 0.0, 1.0)))
    dg = np.where(f * t < 1.0, 0.5 * np.pi * f * np.sin(np.pi * np.clip(f * t, 0.0, 1.0)), 0.0)
    return amplitude * g * np.sin(w * t), amplitude * (dg * np.sin(w * t) + g * w * np.cos(w * t))


def force(t, f, amplitude):
    def rate(time, y):
        v = float(motion(np.asarray(time), f, amplitude)[1])
        z, s = y
        return [(v - 0.5 * (abs(v) * z * abs(z) ** (N - 1.0) + v * abs(z) ** N)) / D, v - s / TAU]

    y = solve_ivp(rate, (t[0], t[-1]), [0.0, 0.0], method="LSODA", t_eval=t, rtol=1e-9, atol=1e-12, max_step=0.02 / f).y
    x, v = motion(t, f, amplitude)
    return x, K * x + C * v + F * y[0] + KM * y[1]


def main():
    data = HERE / "data"
    data.mkdir(exist_ok=True)
    toml = ["# Written by generate.py. One connector under displacement control.", "schema = 1"]
    seeds = iter(np.random.SeedSequence(SEED).spawn(len(TESTS)))
    for f, amplitude, _ in TESTS:
        name = f"loop-{f:g}Hz-{amplitude:g}mm"
        t = np.arange(CYCLES * SAMPLES) / (f * SAMPLES)
        x, load = force(t, f, amplitude)
        rng = np.random.default_rng(next(seeds))
        load = load + 0.005 * np.std(load[DISCARD * SAMPLES:]) * rng.standard_normal(t.size)
        with open(data / f"{name}.csv", "w", newline="\n") as out:
            out.write("t,x,F\n")
            for row in zip(t, x, load):
                out.write(f"{row[0]:.8g},{row[1]:.5f},{row[2]:.4f}\n")
        toml.append(f'''
[[test]]
id = "{name}"
kind = "cycle"
file = "{name}.csv"
control = "displacement"
conditions = {{ frequency = "{f:g} Hz" }}
discard_cycles = {DISCARD}
channels = [
 {{ role="time", column="t", unit="s" }},
 {{ role="displacement", at="c1.x", column="x", unit="mm" }},
 {{ role="force", at="c1.x", column="F", unit="N" }}]''')
    (data / "dataset.toml").write_text("\n".join(toml) + "\n")
    (HERE / "truth.toml").write_text(f'''# Written by generate.py; for the test and the reader, not read by the program.
linear_stiffness = {{ k = "{K} N/mm" }}
viscous = {{ c = "{C} N s/mm" }}
bouc_wen = {{ at = "c1.x", f = "{F} N", d = "{D} mm", n = {N} }}
maxwell = {{ at = "c1.x", k = "{KM} N/mm", tau = "{TAU} s" }}
''')


if __name__ == "__main__":
    main()
