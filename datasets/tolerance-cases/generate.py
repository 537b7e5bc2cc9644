"""The nine tolerance cases on the rig of ../virtual-tensioner: friction of the housings by interference and contact area (README.md says why).

    python generate.py            writes dataset.toml, cases.toml, CSV files, geometry and truth.json beside this file: five minutes of one core
    python generate.py --check    prints states, energies and their convergence; writes nothing
"""
import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "virtual-tensioner"))

from generate import ASSUMPTIONS, LOADS  # noqa: E402
from rig import check, describe, measure  # noqa: E402
from rig.parameters import tolerances  # noqa: E402

SEED = 20411
PAIRS = [(0.1e-3, 9e-6), (0.3e-3, 9e-6), (0.5e-3, 12e-6), (0.1e-3, 28e-6), (0.3e-3, 20e-6), (0.5e-3, 28e-6)]      # m, m2
FREQUENCIES = (0.01, 0.33, 5.0)                     # Hz
MIDDLE = (0.3e-3, 20e-6)
FRF_PAIRS = [(0.1e-3, 9e-6), MIDDLE, (0.5e-3, 12e-6)]
CYCLES = {"cases-5Hz": (5.0, measure.FORCE_LOW, measure.FORCE_HIGH), "cases-1Hz": (1.0, 40.0, 110.0)}             # Hz, N, N
BENCH = "Calibrated shims and ground leaves hold the interference i and the contact area A of both housings; both are exact and constant."
CASES = [
    "Virtual: computed by generate.py without noise, rounded to 0.01 mJ; after twenty cycles.",
    "Contact areas and interferences of the cases are those of the paper's Table 5.",
    "A case has one operating state, the same for both housings and constant over the cycle: i = (i_min + i_max) / 2, A = (A_min + A_max) / 2.",
    "W_s is read as 'slope': dF^2 / (2 k_s), k_s the slope of the branch-mean force over the middle 60 % of travel.",
]


def cases():
    """Rows of the paper's table: name, conditions as printed, operating state i and A in m and m2."""
    table = tomllib.loads((HERE.parent / "tensioner" / "table-6.toml").read_text())
    for row in table["test"][0]["rows"]:
        low_a, high_a, low_i, high_i = (float(row["conditions"][k].split()[0]) for k in ("A_min", "A_max", "i_min", "i_max"))
        yield row["case"], row["conditions"], round(0.5 * (low_i + high_i), 6) * 1e-3, round(0.5 * (low_a + high_a), 6) * 1e-6


def energies(rig, name):
    """The cases of one cycle, as a table."""
    frequency, low, high = CYCLES[name]
    rows = []
    for case, conditions, i, area in cases():
        wd, ws = (1e3 * w for w in measure.energies(rig, i, frequency, low, high, area))
        print(f"{name} case {case}: {measure.state(i, area)}, W_D {wd:.3f} mJ, W_s {ws:.3f} mJ", flush=True)
        given = ", ".join(f'{k} = "{v}"' for k, v in conditions.items())
        rows.append(f'  {{ case = "{case}", frequency = "{frequency:g} Hz", W_D = "{wd:.2f} mJ", W_s = "{ws:.2f} mJ", '
                    f'conditions = {{ {given}, {measure.state(i, area)} }} }},')
    return "\n".join([f'''
[[test]]
id = "{name}"
kind = "energy"
description = "Energies per cycle of the nine tolerance cases, {low:g} to {high:g} N at {frequency:g} Hz"
at = "P.x"
control = "force"
force_min = "{low:g} N"
force_max = "{high:g} N"
W_s_reading = "slope"
rows = ['''] + rows + ["]"])


def main():
    rig = tolerances()
    if "--check" in sys.argv:
        check.cases(rig, list(cases()), CYCLES)
        return
    rng = (np.random.default_rng(child) for child in np.random.SeedSequence(SEED).spawn(64))
    tests = []
    for i, area in FRF_PAIRS:
        # Two more streams a load at the middle pair: it was once measured at Q1 and Q2 too, and the noise of the other tests stays as it was.
        spare = 2 if (i, area) == MIDDLE else 0
        for load in LOADS:
            streams = [next(rng) for _ in range(1 + spare)]
            tests += measure.frfs(HERE, rig, load, i, rig.design_interference, ("P",), streams[:1], area)
    for i, area in PAIRS:
        for f in FREQUENCIES:
            tests.append(measure.loop(HERE, rig, i, f, next(rng), area))
    measure.write_toml(HERE / "dataset.toml", "Tolerance cases: loops at six pairs of interference and contact area, FRFs at three", "generate.py",
                       [a.replace(" Interferences are exact; the", " The") for a in ASSUMPTIONS] + [BENCH], tests)
    measure.write_toml(HERE / "cases.toml", "Tolerance cases: energies per cycle", "generate.py; conditions from the paper's Table 5", CASES,
                       [energies(rig, name) for name in CYCLES])
    describe.geometry(HERE, rig)
    describe.truth(HERE / "truth.json", rig, SEED, [(c, i, area) for c, _, i, area in cases()])


if __name__ == "__main__":
    main()
