"""Test data of tensioner-like chains whose truth Exudyn computes: cases DIR/case-00 ... with study.toml and data, DIR/truth.json apart.

python make.py --seed S --cases N --out DIR [--only K] [--validate]
README.md says what is drawn and what the numbers mean; equations stand in laws.py and chain.py, ranges in draw.py, tests in measure.py.
"""
import argparse
import json
import math
import os
import time

import numpy as np

import draw
import write
from laws import LAWS
from measure import LOOPS, answers, deviations, free_directions, less, visibility, whitened

# Steps per cycle: of the search for strengths, and of the truth at first; that is doubled until twice the steps move nothing.
COARSE, FINE, FINEST = 200, 400, 3200
# Greatest change by twice the steps, in standard deviations of the noise.
MOVED = 0.1
# Tests whose noise is stated as a displacement.
LOOP_NAMES = [t[0] for t in LOOPS]
# How often an effect is drawn until it can be scaled to the visibility that is asked for.
DRAWS = 12


def scaled(machine, law, group, limits, target, least, tests):
    """The law with the strength at which it shows by `target` standard deviations, and how it shows.

    A strength at its limit will do where it shows by `least`; None where it does not.
    """
    strength = law.strength
    for _ in range(6):
        trial = LAWS[law.name](law.name, strength, **law.shape)
        try:
            seen = visibility(machine, [(trial, group)], *tests)
        except Exception as e:  # Exudyn found no equilibrium.
            print(f"    {law.name}: {type(e).__name__}, weaker", flush=True)
            strength /= 2
            continue
        if abs(math.log(seen[0] / target)) < 0.1:
            return trial, seen
        size = min(max(abs(strength) * target / seen[0], limits[0]), limits[1])
        if size == abs(strength):
            return (trial, seen) if least < seen[0] < target else None
        strength = float(f"{math.copysign(size, strength):.5g}")
    return None


def hide(machine, count, rng, tests, levels):
    """`count` effects at different kinds of places."""
    hidden, taken = [], []
    while len(hidden) < count:
        target = math.exp(rng.uniform(*np.log(levels)))
        for _ in range(DRAWS):
            kind = draw.kind(rng, taken)
            law, group, limits = draw.effect(*machine, kind, rng)
            found = scaled(machine, law, group, limits, target, levels[0], tests)
            print(f"    {law.name} at {draw.name(group)}: " + (f"{found[1][0]:.1f} sigma in {found[1][2]}" if found else "not visible enough"), flush=True)
            if found:
                break
        else:
            raise RuntimeError("no effect can be made visible")
        hidden.append((found[0], group, found[1]))
        taken.append(kind)
    return hidden


def converged(machine, hidden, sigmas):
    """The truth at steps whose doubling moves it by less than MOVED standard deviations; with the steps and that move."""
    steps, before = FINE, answers(machine, hidden, FINE, sigmas)
    while True:
        steps *= 2
        now = answers(machine, hidden, steps, sigmas)
        moved = max(np.max(np.abs(r)) for r in whitened(less(now, before), sigmas))
        if moved < MOVED or steps >= FINEST:
            return now, steps, float(moved)
        before = now


def case(index, options):
    rng = np.random.default_rng([options.seed, index])
    machine = draw.machine(rng)
    count = 0 if options.validate else draw.kinds(options.seed, index)
    clean = answers(machine, [], COARSE)
    sigmas = {k: v * options.noise for k, v in deviations(clean).items()}
    print(f"case {index:02d}: {machine[0].n} parts, {count} effects", flush=True)
    hidden = []
    if count:
        tests = (clean, sigmas, free_directions(machine, clean, sigmas, COARSE), COARSE)
        hidden = hide(machine, count, rng, tests, options.visibility)
    truth, steps, moved = converged(machine, [h[:2] for h in hidden], sigmas)
    print(f"    {steps} steps a cycle; half as many differ by {moved:.3f} sigma at most", flush=True)
    off = {p: 1.0 if options.validate else float(rng.uniform(0.9, 1.1)) for p in machine[2]}
    name = f"case-{index:02d}"
    # The noise of a response is stated as a part of what is measured.
    noise = {k: v if k in LOOP_NAMES else v * np.hypot(*truth[k]) / np.hypot(*clean[k]) for k, v in sigmas.items()}
    write.case(os.path.join(options.out, name), machine, off, truth, noise, options.noise, rng)
    if options.told:
        write.told(os.path.join(options.out, "told", name), os.path.join(options.out, name), machine, hidden)
    effects = [{"effect": law.name, "at": draw.name(group), "parameters": law.parameters(), "unit": "SI", "visibility": seen[0],
                "length": seen[1], "seen_in": seen[2]} for law, group, seen in hidden]
    return {"case": name, "parts": machine[0].n, "effects": effects, "base": machine[2], "steps": steps, "moved_by_halving": moved}


def keep(options, row):
    """Puts a case into truth.json, beside those of the same seed."""
    file, head = os.path.join(options.out, "truth.json"), {"seed": options.seed, "visibility": list(options.visibility)}
    cases = []
    if os.path.exists(file):
        with open(file) as f:
            before = json.load(f)
        if {k: before[k] for k in head} == head:
            cases = [c for c in before["cases"] if c["case"] != row["case"]]
    with open(file, "w") as f:
        json.dump({**head, "cases": sorted([*cases, row], key=lambda c: c["case"])}, f, indent=1)


def main():
    a = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    a.add_argument("--seed", type=int, required=True)
    a.add_argument("--cases", type=int, required=True)
    a.add_argument("--out", required=True)
    a.add_argument("--only", type=int, help="one case by its number")
    a.add_argument("--validate", action="store_true", help="nothing hidden, base parameters at the truth")
    a.add_argument("--told", action="store_true", help="also DIR/told/case-00 ...: the study with truth and effects in it, to hold the formulations against each other")
    a.add_argument("--noise", type=float, default=1.0, help="factor on all noise")
    a.add_argument("--visibility", type=float, nargs=2, default=(5.0, 30.0), metavar=("LOW", "HIGH"), help="standard deviations, see README.md")
    options = a.parse_args()
    os.makedirs(options.out, exist_ok=True)
    for index in range(options.cases) if options.only is None else [options.only]:
        start = time.time()
        keep(options, case(index, options))
        print(f"    {time.time() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main()
