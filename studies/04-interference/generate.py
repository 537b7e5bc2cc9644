"""Synthetic measurements of one connector whose stiffness and damping depend on the design interference i.

Closed form, nothing is integrated and nothing is shared with the product's engines:

    F = k_init exp(a (i - i0)) x + c_init exp(b (i - i0)) v,   i and i0 in mm, i0 = 0.3 mm

The end is driven (displacement control, 1 mm); the amplitude grows over the first cycle as a raised cosine and v is the exact
derivative. Noise: white, on the force, 1 % of its rms in the steady cycles; the displacement is recorded to its resolution.

    python generate.py
"""
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 20264
I0 = 0.3                    # mm
K_INIT, A = 40.0, 0.276     # N/mm, 1/mm
C_INIT, B = 0.19, 0.561     # N s/mm, 1/mm: at 10 Hz the damping force is 30 % of the elastic one
AMPLITUDE = 1.0             # mm
SAMPLES = 128               # per cycle
CYCLES, DISCARD = 11, 1
INTERFERENCES = (0.1, 0.3, 0.5, 0.6)    # mm
FREQUENCIES = (1.0, 3.0, 10.0)          # Hz


def motion(t, f):
    """Displacement in mm and velocity in mm/s."""
    w = 2.0 * np.pi * f
    s = np.clip(f * t, 0.0, 1.0)
    g = 0.5 * (1.0 - np.cos(np.pi * s))
    dg = np.where(f * t < 1.0, 0.5 * np.pi * f * np.sin(np.pi * s), 0.0)
    return AMPLITUDE * g * np.sin(w * t), AMPLITUDE * (dg * np.sin(w * t) + g * w * np.cos(w * t))


def main():
    data = HERE / "data"
    data.mkdir(exist_ok=True)
    toml = ["# Written by generate.py. One connector under displacement control at four interferences and three frequencies.", "schema = 1"]
    seeds = iter(np.random.SeedSequence(SEED).spawn(len(INTERFERENCES) * len(FREQUENCIES)))
    for i in INTERFERENCES:
        k, c = K_INIT * np.exp(A * (i - I0)), C_INIT * np.exp(B * (i - I0))
        for f in FREQUENCIES:
            name = f"loop-i{i:g}-{f:g}Hz"
            t = np.arange(CYCLES * SAMPLES) / (f * SAMPLES)
            x, v = motion(t, f)
            force = k * x + c * v
            rng = np.random.default_rng(next(seeds))
            force += 0.01 * np.sqrt(np.mean(force[DISCARD * SAMPLES:] ** 2)) * rng.standard_normal(t.size)
            with open(data / f"{name}.csv", "w", newline="\n") as out:
                out.write("t,x,F\n")
                for row in zip(t, x, force):
                    out.write(f"{row[0]:.9g},{row[1]:.5f},{row[2]:.3f}\n")
            toml.append(f'''
[[test]]
id = "{name}"
kind = "cycle"
file = "{name}.csv"
control = "displacement"
conditions = {{ frequency = "{f:g} Hz", i = "{i:g} mm" }}
discard_cycles = {DISCARD}
channels = [
 {{ role="time", column="t", unit="s" }},
 {{ role="displacement", at="c1.x", column="x", unit="mm" }},
 {{ role="force", at="c1.x", column="F", unit="N" }}]''')
    (data / "dataset.toml").write_text("\n".join(toml) + "\n")
    (HERE / "truth.toml").write_text(f'''# What generate.py put into the data. Not read by the program: for the reader, and for the test that compares.
seed = {SEED}
i0 = "{I0:g} mm"
k_init = "{K_INIT:g} N/mm"
k_exponent = "{A:g} 1/mm"
c_init = "{C_INIT:g} N s/mm"
c_exponent = "{B:g} 1/mm"
''')


if __name__ == "__main__":
    main()
