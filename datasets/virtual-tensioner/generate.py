"""Virtual measurements of the chain tensioner: loops and FRFs (dataset.toml), natural frequencies (modal.toml), geometry, truth.json.

The rig (folder rig/) is the paper's finite-element model in small and shares nothing with the product's engines: geometrically exact
Timoshenko elements for the blade, three leaf springs as separate members in sliding contact (friction in the housings F-G and H-L, a film
under the ends of the middle leaf), a unilateral shelf, a loading device. README.md describes it.

    python generate.py            writes the files, a few minutes on one core
    python generate.py --check    shows convergence, closed forms, energies; writes nothing
"""
import sys
from pathlib import Path

import numpy as np

from rig import check, describe, measure
from rig.linear import Linear
from rig.parameters import Rig

HERE = Path(__file__).parent
SEED = 20263
LOADS = (21.6, 80.0, 138.3)                         # N
INTERFERENCES = (0.1e-3, 0.3e-3, 0.5e-3, 0.6e-3)    # m
FREQUENCIES = (0.01, 0.33, 1.0, 5.0)                # Hz
ASSUMPTIONS = [
    "Virtual measurements: computed by generate.py, with noise; not a real tensioner.",
    "x: across the blade, positive the way the chain presses (into the arc); y: along the shelf from pin to tip; psi about z = x cross y.",
    "Displacements count from the unloaded blade. F at P along x, positive the way the chain presses, keeps its direction.",
    "FRFs: small signal about the state reached by loading from zero to the load, device attached; loops: force control without the device.",
    "Records of loops begin after twenty cycles. Interferences are exact; the design interference is 0.3 mm.",
]


def streams():
    """One stream of random numbers a test: adding a test leaves the others as they are."""
    for child in np.random.SeedSequence(SEED).spawn(64):
        yield np.random.default_rng(child)


def main():
    rig = Rig()
    if "--check" in sys.argv:
        check.run(rig)
        return
    rng, i0, tests, tables = streams(), rig.design_interference, [], []
    for load in LOADS:
        tests += measure.frfs(HERE, rig, load, i0, i0, ("P", "Q1", "Q2"), [next(rng) for _ in range(3)])
    for i in (0.1e-3, 0.6e-3):
        tests += measure.frfs(HERE, rig, 80.0, i, i0, ("P",), [next(rng)])
    for i in INTERFERENCES:
        for f in FREQUENCIES:
            tests.append(measure.loop(HERE, rig, i, f, next(rng)))
    tables.append(measure.modal("free", Linear(free=rig, interference=i0, per_part=measure.FRF_ELEMENTS), None, i0, next(rng)))
    for load in LOADS:
        tables.append(measure.modal(f"{load:g}N", measure.loaded(rig, load, i0), load, i0, next(rng)))
    measure.write_toml(HERE / "dataset.toml", "Virtual tensioner: FRFs at three loads, loops at four interferences", "generate.py", ASSUMPTIONS, tests)
    measure.write_toml(HERE / "modal.toml", "Virtual tensioner: natural frequencies", "generate.py", ASSUMPTIONS[:2], tables)
    describe.geometry(HERE, rig)
    describe.truth(HERE / "truth.json", rig, SEED)


if __name__ == "__main__":
    main()
