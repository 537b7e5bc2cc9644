

def matrices(omega):
    """Mass, stiffness and damping at rest, coordinates that are held projected out. Exudyn differentiates stiff connectors numerically:
    right at rest, noise under load."""
    mbs, _ = build(False, omega)
    M, K, D = mbs.ComputeLinearizedSystem(projectIntoConstraintNullspace=True)[:3]
    return np.array(M), np.array(K), np.array(D)


def roots(omega):
    """Circular frequencies |s| of damped modes [rad/s], ascending."""
    M, K, D = matrices(omega)
    if np.linalg.eigvalsh(M).min() <= 1e-12 * np.abs(M).max():
        # Degrees of freedom without mass: of the springs alone.
        s = np.linalg.eigvals(np.linalg.solve(K, M))
        return np.sort(np.sqrt(1 / s.real[s.real > 1e-12 * np.abs(s).max()]))
    n = len(M)
    # Both in their own measure, so that digits are kept.
    scale = math.sqrt(np.abs(K).max() / np.abs(M).max())
    A = np.block([[np.zeros((n, n)), scale * np.eye(n)], [-np.linalg.solve(M, K) / scale, -np.linalg.solve(M, D)]])
    s = np.linalg.eigvals(A)
    return np.sort(np.abs(s[s.imag > 1e-9 * np.abs(s)]))


def frequencies(count):
    """Damped natural frequencies at rest [Hz]; laws that depend on frequency are taken at each mode's own."""
    found = roots(1e-3)[:count]
    if BRANCHES:
        for k in range(len(found)):
            for _ in range(8):
                before, found[k] = found[k], roots(found[k])[k]
                if abs(found[k] / before - 1) < 1e-8:
                    break
    return [float(w / (2 * math.pi)) for w in found]


def deflection():
    """Equilibrium under the declared loads, their path followed."""
    mbs, sensors = build(True)
    s = exu.SimulationSettings()
    stages = max((len(load[-1]) for load in LOADS), default=1)
    s.staticSolver.useLoadFactor = False
    s.staticSolver.loadStepDuration = stages
    s.staticSolver.numberOfLoadSteps = stages * STEPS
    s.staticSolver.newton.relativeTolerance = 1e-8
    s.staticSolver.newton.absoluteTolerance = 1e-6
    s.staticSolver.verboseMode = 0
    s.solutionSettings.writeSolutionToFile = False
    mbs.SolveStatic(s)
    return displacements(mbs, sensors)


def main():
    out = {"test": TEST}
    if EXPECTED["frequencies"]:
        out["frequencies"] = frequencies(len(EXPECTED["frequencies"]))
        pairs = list(zip(out["frequencies"], EXPECTED["frequencies"]))
        out["largest_difference_of_frequencies"] = max((abs(a / b - 1) for a, b in pairs if b > 0), default=None)
    if LOADS:
        out["deflection"] = deflection()
        known = {k: v for k, v in EXPECTED["deflection"].items() if k in out["deflection"]}
        size = max((abs(v) for v in known.values()), default=0.0)
        if size:
            out["largest_difference_of_deflection"] = max(abs(out["deflection"][k] - v) for k, v in known.items()) / size
    if "--json" in sys.argv:
        json.dump(out, sys.stdout, indent=1)
        print()
        return
    for k, (f, e) in enumerate(zip(out.get("frequencies", []), EXPECTED["frequencies"])):
        print(f"mode {k + 1}: {f:.4f} Hz, misfit {e:.4f} Hz")
    for dof in WATCHED:
        if dof in out.get("deflection", {}):
            print(f"{dof}: {1e3 * out['deflection'][dof]:.5f} mm or mrad under the loads, misfit {1e3 * EXPECTED['deflection'].get(dof, math.nan):.5f}")
    for what in ("frequencies", "deflection"):
        if out.get(f"largest_difference_of_{what}") is not None:
            print(f"largest difference of the {what}: {100 * out[f'largest_difference_of_{what}']:.2g} %")


if __name__ == "__main__":
    main()
