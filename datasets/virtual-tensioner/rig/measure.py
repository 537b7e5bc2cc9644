"""Measurements on the rig: noise and sampling, CSV files, dataset.toml."""
import numpy as np

from .linear import Linear, OutOfPlane
from .quasistatic import QuasiStatic

FORCE_LOW, FORCE_HIGH = 21.6, 138.3                 # N, cyclic tests
SETTLE, KEPT, SAMPLES = 20, 4, 200                  # cycles before the record, cycles in it, samples a cycle
LOOP_NOISE = 0.010                                  # mm, white, on D_t and D_l
FRF_NOISE, FRF_FLOOR, AVERAGES = 0.01, 0.001, 20    # of |H|, of the rms of |H| over the band
LINES = np.arange(5.0, 2500.0 + 1e-9, 5.0)          # Hz
MODAL_NOISE = (0.002, 0.03)                         # of the frequency, of the damping ratio
LOOP_ELEMENTS, FRF_ELEMENTS = 4, 8                  # a part of the chain; check.py shows what they cost
FAMILY = {"plane": "xy bending", "torsion": "torsion", "yz bending": "yz bending"}


def loaded(rig, load, interference, per_part=FRF_ELEMENTS, area=None):
    """The rig at rest under `load` at P, reached from zero by load alone."""
    rest = QuasiStatic(rig, interference, per_part, area)
    rest.load(load)
    return Linear(rest)


def write_csv(path, header, rows, formats):
    with open(path, "w", newline="\n") as out:
        out.write(header + "\n")
        for row in rows:
            out.write(",".join(f % v for f, v in zip(formats, row)) + "\n")


def mm(i):
    return f"{1e3 * i:g}"


def mm2(area):
    return f"{1e6 * area:g}"


def state(interference, area):
    """Conditions of a test that say the state of the rig."""
    return f'i = "{mm(interference)} mm"' + ("" if area is None else f', A = "{mm2(area)} mm2"')


def work(force, x):
    """W_D of a closed cycle, J: the integral of F dx."""
    return abs(np.trapezoid(np.append(force, force[0]), np.append(x, x[0])))


def elastic(force, x):
    """W_s of a closed cycle read as slope, J: dF^2 / (2 k_s), k_s the slope of the branch-mean force over the middle 60 % of travel."""
    bottom, top = np.argmin(x), np.argmax(x)
    up, down = np.roll(np.arange(len(x)), -bottom), np.roll(np.arange(len(x)), -top)
    rise, fall = up[: (top - bottom) % len(x) + 1], down[: (bottom - top) % len(x) + 1][::-1]
    grid = x.min() + np.ptp(x) * np.linspace(0.2, 0.8, 121)
    mean = 0.5 * (np.interp(grid, x[rise], force[rise]) + np.interp(grid, x[fall], force[fall]))
    return np.ptp(force)**2 / 2 / np.polyfit(grid, mean, 1)[0]


def energies(rig, interference, frequency, low=FORCE_LOW, high=FORCE_HIGH, area=None, per_part=FRF_ELEMENTS, steps=2 * SAMPLES, settle=SETTLE):
    """W_D and W_s of a clean cycle at P, J; `steps` steps in the cycle, every one of them a sample."""
    (force, across, _), _ = QuasiStatic(rig, interference, per_part, area).cycles(low, high, frequency, settle, fine=steps, samples=steps)
    return work(force, across), elastic(force, across)


def loop(folder, rig, interference, frequency, rng, area=None):
    name = f"loop-i{mm(interference)}-{'' if area is None else f'A{mm2(area)}-'}{frequency:g}Hz"
    bench = QuasiStatic(rig, interference, LOOP_ELEMENTS, area)
    (force, across, along), drift = bench.cycles(FORCE_LOW, FORCE_HIGH, frequency, SETTLE, samples=SAMPLES)
    print(f"{name}: W_D {1e3 * work(force, across):.2f} mJ, range D_t {1e3 * np.ptp(across):.3f} mm, D_l {1e3 * np.ptp(along):.3f} mm, "
          f"cycle {SETTLE + 1} differs from {SETTLE} by {drift.max():.0e} of the range", flush=True)
    t = (np.arange(KEPT * SAMPLES) / SAMPLES + SETTLE) / frequency
    noisy = [1e3 * np.tile(y, KEPT) + LOOP_NOISE * rng.standard_normal(len(t)) for y in (across, along)]
    write_csv(folder / f"{name}.csv", "t,F,D_t,D_l", zip(t, np.tile(force, KEPT), *noisy), ("%.10g", "%.3f", "%.4f", "%.4f"))
    return f'''
[[test]]
id = "{name}"
kind = "cycle"
file = "{name}.csv"
control = "force"
conditions = {{ frequency = "{frequency:g} Hz", {state(interference, area)} }}
channels = [
 {{ role="time", column="t", unit="s" }},
 {{ role="force", at="P.x", column="F", unit="N" }},
 {{ role="displacement", at="P.x", column="D_t", unit="mm" }},
 {{ role="displacement", at="tip.y", column="D_l", unit="mm" }}]'''


def frfs(folder, rig, load, interference, design, responses, streams, area=None):
    """FRFs at one load: force at P along x, responses along x."""
    h = loaded(rig, load, interference, area=area).accelerance(LINES, [(r, "x") for r in responses])
    toml = []
    for name, clean, rng in zip(responses, h, streams):
        shim = "" if interference == design and area is None else f"-i{mm(interference)}"
        shim += "" if area is None else f"-A{mm2(area)}"
        test = f"frf-{load:g}N{shim}-{name}"
        sigma = np.hypot(FRF_NOISE * np.abs(clean), FRF_FLOOR * np.sqrt(np.mean(np.abs(clean) ** 2)))
        noisy = clean + sigma * (rng.standard_normal(len(LINES)) + 1j * rng.standard_normal(len(LINES)))
        # The coherence whose sigma = |H| sqrt((1 - g2) / (2 n g2)), with the measured |H|, is the one that was used.
        coherence = 1.0 / (1.0 + 2.0 * AVERAGES * (sigma / np.abs(noisy)) ** 2)
        write_csv(folder / f"{test}.csv", "f,re,im,coh", zip(LINES, noisy.real, noisy.imag, coherence), ("%g", "%.5g", "%.5g", "%.6f"))
        print(f"{test}: largest {np.abs(clean).max():.1f} m/s2/N at {LINES[np.argmax(np.abs(clean))]:g} Hz", flush=True)
        toml.append(f'''
[[test]]
id = "{test}"
kind = "frf"
file = "{test}.csv"
excite = "P.x"
respond = "{name}.x"
quantity = "accelerance"
conditions = {{ load = "{load:g} N", {state(interference, area)} }}
channels = [
 {{ role="frequency", column="f", unit="Hz" }},
 {{ role="real", column="re", unit="m/s2/N" }},
 {{ role="imag", column="im", unit="m/s2/N" }},
 {{ role="coherence", column="coh", averages={AVERAGES} }}]''')
    return toml


def modal(name, linear, load, interference, rng, count=5, highest=3000.0):
    """The lowest modes in and out of the plane, as a table."""
    modes = [(f, z, FAMILY["plane"]) for f, z, _ in linear.modes(count)]
    modes += [(f, z, FAMILY[kind]) for f, z, kind in OutOfPlane(linear).modes(count)]
    modes = [m for m in sorted(modes) if m[0] < highest]
    rows = []
    for n, (f, z, family) in enumerate(modes, 1):
        a, b = rng.standard_normal(2)
        df, dz = MODAL_NOISE[0] * f, MODAL_NOISE[1] * z
        rows.append(f'  {{ mode = {n}, frequency = "{f + a * df:.2f} Hz", sigma_frequency = "{df:.2g} Hz", damping = "{100 * (z + b * dz):.3f} %", '
                    f'sigma_damping = "{100 * dz:.2g} %", family = "{family}" }},')
        print(f"modal-{name}: {f:8.2f} Hz {100 * z:5.2f} %  {family}", flush=True)
    where = f'load = "{load:g} N", ' if load is not None else ""
    return "\n".join([f'''
[[test]]
id = "modal-{name}"
kind = "modal"
conditions = {{ {where}i = "{mm(interference)} mm" }}
rows = ['''] + rows + ["]"])


def write_toml(path, title, source, assumptions, tests):
    lines = "".join(f'  "{a}",\n' for a in assumptions)
    path.write_text(f'# Written by generate.py.\nschema = 1\ntitle = "{title}"\nsource = "{source}"\nassumptions = [\n{lines}]\n'
                    + "\n".join(tests) + "\n")
