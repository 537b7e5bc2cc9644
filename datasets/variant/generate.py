"""A new variant on the rig of ../virtual-tensioner: 30 parts on other arcs, other stiffness and laws, friction in one housing only.

    python generate.py            writes dataset.toml, modal.toml, CSV files, geometry and truth.json beside this file
"""
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "virtual-tensioner"))

from generate import ASSUMPTIONS, LOADS  # noqa: E402
from rig import describe, measure  # noqa: E402
from rig.parameters import variant  # noqa: E402

SEED = 20307
LOOPS = [(i, f) for i in (0.1e-3, 0.3e-3, 0.6e-3) for f in (0.05, 0.5, 5.0)]      # m, Hz


def main():
    rig = variant()
    rng = (np.random.default_rng(child) for child in np.random.SeedSequence(SEED).spawn(64))
    i0, tests = rig.design_interference, []
    for load in LOADS:
        tests += measure.frfs(HERE, rig, load, i0, i0, ("P", "Q1", "Q2"), [next(rng) for _ in range(3)])
    for i, f in LOOPS:
        tests.append(measure.loop(HERE, rig, i, f, next(rng)))
    tables = [measure.modal(f"{load:g}N", measure.loaded(rig, load, i0), load, i0, next(rng)) for load in LOADS]
    measure.write_toml(HERE / "dataset.toml", "Variant: FRFs at three loads, loops at three interferences", "generate.py", ASSUMPTIONS, tests)
    measure.write_toml(HERE / "modal.toml", "Variant: natural frequencies", "generate.py", ASSUMPTIONS[:2], tables)
    describe.geometry(HERE, rig)
    describe.truth(HERE / "truth.json", rig, SEED)


if __name__ == "__main__":
    main()
