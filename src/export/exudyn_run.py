

def matrices(unit=None):
    """Mass, stiffness and damping at rest, coordinates that are held projected out. Exudyn differentiates stiff connectors numerically:
    right at rest, noise under load."""
    mbs, _ = build(False, True, unit)
    M, K, D = mbs.ComputeLinearizedSystem(projectIntoConstraintNullspace=True)[:3]
    return np.array(M), np.array(K), np.array(D)


def undamped(M, K):
    """Circular frequencies [rad/s], ascending, and shapes."""
    M, K = (M + M.T) / 2, (K + K.T) / 2
    if np.linalg.eigvalsh(M).min() > 1e-12 * np.abs(M).max():
        L = np.linalg.inv(np.linalg.cholesky(M))
        squares, shapes = np.linalg.eigh(L @ K @ L.T)
        return np.sqrt(np.maximum(squares, 0.0)), L.T @ shapes
    # Degrees of freedom without mass.
    inverse, shapes = np.linalg.eig(np.linalg.solve(K, M))
    keep = inverse.real > 1e-12 * np.abs(inverse).max()
    w, shapes = np.sqrt(1 / inverse.real[keep]), shapes.real[:, keep]
    return np.sort(w), shapes[:, np.argsort(w)]


def frequencies(count):
    """|s| / 2 pi of the lowest damped modes at rest [Hz]: (s^2 M + s D + K + sum_g k_g(s) K_g) shape = 0 with k_g(s) = sum_j k_j s tau_j / (1 + s tau_j)
    of the branches of each group, solved by inverse iteration from the undamped modes with the storage stiffness."""
    M, K, D = matrices()
    own = []
    for group in groups():
        size = sum(k for k, _ in group)
        own.append((group, (matrices((group, size))[1] - K) / size))
    law = lambda group, s: sum(k * s * tau / (1 + s * tau) for k, tau in group)
    slope = lambda group, s: sum(k * tau / (1 + s * tau) ** 2 for k, tau in group)
    storage = lambda w: K + sum((law(g, 1j * w).real * Kg for g, Kg in own), np.zeros_like(K))
    found = []
    for mode in range(min(count, len(M))):
        w = undamped(M, K)[0][mode]
        for _ in range(6 if own else 1):
            all_w, shapes = undamped(M, storage(w))
            w = all_w[mode]
        s, x = 1j * w, shapes[:, mode].astype(complex)
        for _ in range(40 if w > 0 else 0):
            Z = s * s * M + s * D + K + sum((law(g, s) * Kg for g, Kg in own), 0 * K)
            dZ = 2 * s * M + D + sum((slope(g, s) * Kg for g, Kg in own), 0 * K)
            try:
                x = np.linalg.solve(Z, dZ @ x)
            except np.linalg.LinAlgError:  # exactly at an eigenvalue
                break
            x /= np.linalg.norm(x)
            step = (x @ Z @ x) / (x @ dZ @ x)
            s -= step
            if abs(step) < 1e-12 * abs(s):
                break
        found.append(float(abs(s) / (2 * math.pi)))
    return sorted(found)


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
