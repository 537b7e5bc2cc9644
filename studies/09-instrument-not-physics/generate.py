"""Synthetic measurements of one connector whose displacement is read late.

    F(t) = k x(t) + c v(t),   recorded: F(t) and x(t - tau)

Closed form, nothing is integrated and nothing is shared with the product's engines. The force leads the displacement that was recorded,
as it does across a damper: to first order in w tau a damper of k tau more. What gives the delay away is of second and third order. The end
is driven (displacement control); the amplitude grows over the first cycle as a raised cosine. Noise: white, on the force, 0.5 % of its rms
in the steady cycles; the displacement is recorded to its resolution.

    python generate.py
"""
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 20269
K, C = 85.0, 0.09               # N/mm, N s/mm
TAU = 3.0e-3                    # s
SAMPLES, CYCLES, DISCARD = 100, 7, 2
# Hz, mm
TESTS = [(0.5, 0.8), (4.0, 0.5), (9.0, 0.8), (14.0, 0.3), (19.0, 0.5), (12.0, 0.6), (17.0, 0.4), (16.0, 0.5)]


def motion(t, f, amplitude):
    """Displacement in mm and velocity in mm/s; at rest before t = 0."""
    w = 2.0 * np.pi * f
    s = np.clip(f * t, 0.0, 1.0)
    g = 0.5 * (1.0 - np.cos(np.pi * s))
    dg = np.where((f * t < 1.0) & (t > 0.0), 0.5 * np.pi * f * np.sin(np.pi * s), 0.0)
    return amplitude * g * np.sin(w * t), amplitude * (dg * np.sin(w * t) + g * w * np.cos(w * t))


def main():
    data = HERE / "data"
    data.mkdir(exist_ok=True)
    toml = ["# Written by generate.py. One connector under displacement control.", "schema = 1"]
    seeds = iter(np.random.SeedSequence(SEED).spawn(len(TESTS)))
    for f, amplitude in TESTS:
        name = f"loop-{f:g}Hz-{amplitude:g}mm"
        t = np.arange(CYCLES * SAMPLES) / (f * SAMPLES)
        x, v = motion(t, f, amplitude)
        late, _ = motion(t - TAU, f, amplitude)
        load = K * x + C * v
        rng = np.random.default_rng(next(seeds))
        load = load + 0.005 * np.std(load[DISCARD * SAMPLES:]) * rng.standard_normal(t.size)
        with open(data / f"{name}.csv", "w", newline="\n") as out:
            out.write("t,x,F\n")
            for row in zip(t, late, load):
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
# The displacement is late: against it the force is early, a negative delay.
delay = {{ at = "*.force", tau = "{-TAU} s" }}
''')


if __name__ == "__main__":
    main()
