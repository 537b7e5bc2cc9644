"""Implicit steps of the chain of 22 rigid parts with large rotations: misfit's march with one nonlinear effect against Exudyn's generalised-alpha
(spectral radius 0.7, full and modified Newton) without any Python callback, in turn, in one run.

    python benches/peers/march.py [path of march22, where it is built already]

Both march the same 12 ms under the same constant force with the same step; without the nonlinear effect the ends are compared first. Each side's
best of the rounds gives the ratio. Both are timed by processor time: Exudyn's around its solver, misfit's of its whole process, start
included. The load is sudden: misfit's first step begins without the acceleration it causes, an error of first order in the step, which the comparison
of the ends at two step lengths shows to vanish.
"""
import json
import os
import resource
import statistics
import subprocess
import sys
import time

ROUNDS, STEPS = 7, 1000
os.environ.setdefault("OMP_NUM_THREADS", "1")
import exudyn as exu  # noqa: E402

import multibody  # noqa: E402

TAU, DURATION, FORCE = multibody.TAU, multibody.DURATION, 60.0


def peer(modified, steps=STEPS):
    mbs, sensors = multibody.build(FORCE, TAU)
    s = exu.SimulationSettings()
    s.timeIntegration.numberOfSteps = steps
    s.timeIntegration.endTime = DURATION
    s.timeIntegration.generalizedAlpha.spectralRadius = 0.7
    s.timeIntegration.newton.useModifiedNewton = modified
    s.timeIntegration.newton.relativeTolerance = 1e-7
    s.timeIntegration.newton.absoluteTolerance = 1e-4
    s.timeIntegration.verboseMode = 0
    s.solutionSettings.writeSolutionToFile = False
    start = time.process_time()
    mbs.SolveDynamic(s)
    return (time.process_time() - start) * 1e6 / steps, multibody.read(mbs, sensors)


def product(binary, *more, steps=STEPS):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    out = json.loads(subprocess.run([binary, str(steps), *more], capture_output=True, text=True, check=True).stdout)
    return (resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before) * 1e6 / steps, out["end"]


def main():
    if len(sys.argv) > 1:
        program = sys.argv[1]
    else:
        from chain import binary
        program = binary("march22")
    for steps in (STEPS, 8 * STEPS):
        _, theirs = peer(True, steps)
        _, ours = product(program, "linear", steps=steps)
        size = max(abs(x) for x in theirs)
        print(f"{steps} steps, without the nonlinear effect: ends differ by {max(abs(a - b) for a, b in zip(ours, theirs)) / size:.1e} of the largest displacement")
    rounds = [(product(program)[0], product(program, "linear")[0], peer(False)[0], peer(True)[0]) for _ in range(ROUNDS)]
    best = [min(r[k] for r in rounds) for k in range(4)]
    for name, k in (("misfit, one nonlinear effect", 0), ("misfit, linear laws", 1), ("Exudyn, full Newton", 2), ("Exudyn, modified Newton", 3)):
        print(f"{name:30s} {best[k]:8.1f} us a step")
    for name, k in (("full", 2), ("modified", 3)):
        print(f"ratio to {name} Newton: {best[k] / best[0]:.1f} (median of rounds {statistics.median(r[k] / r[0] for r in rounds):.1f})")


if __name__ == "__main__":
    main()
