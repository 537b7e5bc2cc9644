"""Synthetic measurements of one connector with a friction that grows with the distance from the middle: a wedge that clamps harder the
further it is drawn in. The library has it as wedge_friction; the study leaves that law out of its search.

    F = k x + c v + f |x| / x1 sign(v)

Closed form, nothing is integrated and nothing is shared with the product's engines. The end is driven (displacement control); the
amplitude grows over the first cycle as a raised cosine. Noise: white, on the force, 0.5 % of its rms in the steady cycles; the displacement
is recorded to its resolution.

    python generate.py
"""
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 202610
K, C = 40.0, 0.08               # N/mm, N s/mm
F, X1 = 7.5, 1.0                # N at 1 mm
SAMPLES, CYCLES, DISCARD = 100, 7, 2
# Hz, mm
TESTS = [(0.3, 1.5), (1.0, 0.6), (3.0, 1.2), (7.0, 1.5), (7.0, 0.4), (2.0, 1.0), (5.0, 0.8), (4.0, 1.3)]


def motion(t, f, amplitude):
    """Displacement in mm and velocity in mm/s."""
    w = 2.0 * np.pi * f
    g = 0.5 * (1.0 - np.cos(np.pi * np.clip(f * t, 0.0, 1.0)))
    dg = np.where(f * t < 1.0, 0.5 * np.pi * f * np.sin(np.pi * np.clip(f * t, 0.0, 1.0)), 0.0)
    return amplitude * g * np.sin(w * t), amplitude * (dg * np.sin(w * t) + g * w * np.cos(w * t))


def main():
    data = HERE / "data"
    data.mkdir(exist_ok=True)
    toml = ["# Written by generate.py. One connector under displacement control.", "schema = 1"]
    seeds = iter(np.random.SeedSequence(SEED).spawn(len(TESTS)))
    for f, amplitude in TESTS:
        name = f"loop-{f:g}Hz-{amplitude:g}mm"
        # Half a sample late, so that no sample falls on a reversal.
        t = (np.arange(CYCLES * SAMPLES) + 0.5) / (f * SAMPLES)
        x, v = motion(t, f, amplitude)
        load = K * x + C * v + F * np.abs(x) / X1 * np.sign(v)
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
outside = {{ at = "c1.x", law = "f*abs(x)/x1*sign(v)", f = "{F} N", x1 = "{X1} mm" }}
''')


if __name__ == "__main__":
    main()
