"""Is the rig right, and is it converged below its noise? Prints; writes nothing."""
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares, root

from . import measure
from .linear import Linear
from .quasistatic import QuasiStatic


def compliance(rig, per_part=2):
    """Displacement of P under a small force there: the blade without leaves against Castigliano's integral over the unloaded arcs."""
    bare = replace(rig, friction=0.0, shelf=1e12, leaf_ei=1e-9, leaf_ga=1e-3)
    load = 1e-3
    rest = QuasiStatic(bare, rig.design_interference, per_part)
    rest.load(load, 1)
    found = rest.q[rest.mesh.dof("P", "x")] / load
    # Pin takes x and y, shelf takes x: M = (1 - yP/yT) y up to P, linear to zero at the tip; shear and normal parts likewise.
    bounds = np.unique(np.concatenate([np.cumsum((0,) + rig.parts), [rig.drive, rig.zone, rig.count - rig.zone]]))
    node, weight = np.polynomial.legendre.leggauss(12)
    (_, tip), _ = [a[..., 0] for a in rig.curve([rig.length])]
    (_, drive), _ = [a[..., 0] for a in rig.curve([rig.drive * rig.part_length])]
    total = 0.0
    for a, b in zip(bounds[:-1], bounds[1:]):
        s = rig.part_length * (0.5 * (a + b) + 0.5 * (b - a) * node)
        (_, y), turn = rig.curve(s)
        before = s < rig.drive * rig.part_length
        moment = np.where(before, (1 - drive / tip) * y, drive / tip * (tip - y))
        across = np.where(before, 1 - drive / tip, -drive / tip)
        inside = rig.zone <= 0.5 * (a + b) <= rig.count - rig.zone
        ei = rig.ei_middle if inside else rig.ei_end
        part = moment**2 / ei + (across * np.cos(turn)) ** 2 / rig.ga + (across * np.sin(turn)) ** 2 / rig.ea
        total += 0.5 * (b - a) * rig.part_length * (weight * part).sum()
    print(f"compliance at P, {per_part} elements a part: rig {1e6 * found:.4f} um/N, Castigliano {1e6 * total:.4f} um/N, difference {found / total - 1:+.1e}")


def straight(rig, per_part):
    """First two free bending modes of a straight uniform blade against Euler-Bernoulli (shear and rotary inertia made small)."""
    ei = 0.5
    bare = replace(rig, radius=(1e4,) * 3, ei_middle=ei, ei_end=ei, ga=1e8, ea=1e8, line_inertia=1e-12, leaf_ei=1e-9, leaf_mass=1e-9, leaf_ea=1e-3,
                   leaf_ga=1e-3, leaf_inertia=1e-18, loss=0.0, film_force=0.0, friction=0.0)
    found = [m[0] for m in Linear(free=bare, interference=rig.design_interference, per_part=per_part).modes(2)]
    for f, root in zip(found, (4.730040745, 7.853204624)):
        exact = root**2 / (2 * np.pi * rig.length**2) * np.sqrt(ei / rig.line_mass)
        print(f"straight free beam, {per_part} elements a part: {f:.3f} Hz, closed form {exact:.3f} Hz, difference {f / exact - 1:+.1e}")


def chain(rig):
    """Slow deflections without friction and film against rigid parts on rotational springs, large rotations: what a chain can reach at best.

    Two stiffnesses (end zones, middle) are fitted; printed are their ratios to EI / part length and the largest remaining difference.
    """
    n, l = rig.count, rig.part_length
    d = np.diff(rig.curve(np.arange(n + 1) * l)[0], axis=1)
    rest, length = np.arctan2(*d), np.hypot(*d)                 # angle to y
    before = np.clip(rig.drive - np.arange(n), 0.0, 1.0)        # share of each part between pin and P

    def deflect(k, force):
        def balance(u):
            moment, a = k * np.diff(u[:n]), rest + u[:n]
            g = (u[n] - force * before) * length * np.cos(a)
            g[:-1] -= moment
            g[1:] += moment
            return np.append(g, (length * np.sin(a)).sum())
        a = rest + root(balance, np.zeros(n + 1), tol=1e-12).x[:n]
        return (before * length * (np.sin(a) - np.sin(rest))).sum(), (length * (np.cos(a) - np.cos(rest))).sum()

    loads = np.linspace(measure.FORCE_LOW, measure.FORCE_HIGH, 6)
    state = QuasiStatic(replace(rig, friction=0.0, film_force=1e-12), rig.design_interference, measure.LOOP_ELEMENTS)
    found = []
    for force in loads:
        state.load(force, 6)
        found.append([state.q[state.mesh.dof("P", "x")], state.q[state.mesh.dof("tip", "y")]])
    nominal = np.array([rig.ei_end + rig.leaf_ei, rig.ei_middle + rig.leaf_ei]) / l
    low = int(rig.zone - 0.5)
    where = np.r_[[0] * low, [1] * (n - 1 - 2 * low), [0] * low]

    def difference(p):
        return 1e6 * (np.array([deflect((np.exp(p) * nominal)[where], f) for f in loads]) - found).ravel()
    fit = least_squares(difference, np.zeros(2))
    print(f"chain of {n} rigid parts: stiffness ends {np.exp(fit.x[0]):.4f}, middle {np.exp(fit.x[1]):.4f} of EI / part length, "
          f"D_t and D_l within {np.abs(fit.fun).max():.2f} um (with the nominal stiffness {np.abs(difference([0, 0])).max():.1f} um)")


def elements(rig, area=None):
    """FRFs and loops at the design interference against meshes that are finer, in units of the noise of one sample."""
    i0 = rig.design_interference
    places = [("P", "x"), ("Q1", "x"), ("Q2", "x")]
    fine = measure.loaded(rig, 80.0, i0, 16, area).accelerance(measure.LINES, places)
    for per_part in (4, measure.FRF_ELEMENTS):
        h = measure.loaded(rig, 80.0, i0, per_part, area).accelerance(measure.LINES, places)
        for (name, _), a, b in zip(places, h, fine):
            sigma = np.hypot(measure.FRF_NOISE * np.abs(b), measure.FRF_FLOOR * np.sqrt(np.mean(np.abs(b) ** 2)))
            e = np.abs(a - b) / np.sqrt(2.0)            # sigma is that of one part, real or imaginary
            print(f"FRF 80 N, {name}: {per_part} elements a part against 16: rms {np.sqrt(np.mean((e / sigma) ** 2)):.3f} sigma, most {np.max(e / sigma):.3f} sigma")
    for frequency in (0.01, 5.0):
        loops = [QuasiStatic(rig, i0, n, area).cycles(measure.FORCE_LOW, measure.FORCE_HIGH, frequency, 4)[0] for n in (2, measure.LOOP_ELEMENTS, 12)]
        for n, loop in zip((2, measure.LOOP_ELEMENTS), loops):
            for k, name in ((1, "D_t"), (2, "D_l")):
                e = 1e3 * np.abs(loop[k] - loops[2][k])
                print(f"loop {frequency:g} Hz, {name}: {n} elements a part against 12: rms {1e3 * np.sqrt(np.mean(e**2)):.2f} um = "
                      f"{np.sqrt(np.mean(e**2)) / measure.LOOP_NOISE:.3f} sigma, most {e.max() / measure.LOOP_NOISE:.3f} sigma")


def steps(rig):
    """Loops with 200 and 400 steps a cycle against 1600."""
    for i, frequency in ((0.1e-3, 0.01), (0.6e-3, 0.33), (0.6e-3, 5.0)):
        run = {n: QuasiStatic(rig, i).cycles(measure.FORCE_LOW, measure.FORCE_HIGH, frequency, 4, fine=n)[0] for n in (200, 400, 1600)}
        for n in (200, 400):
            for k, name in ((1, "D_t"), (2, "D_l")):
                e = 1e3 * np.abs(run[n][k] - run[1600][k])
                print(f"loop i {1e3 * i:g} mm {frequency:g} Hz, {name}: {n} steps a cycle against 1600: rms {np.sqrt(np.mean(e**2)) / measure.LOOP_NOISE:.4f} "
                      f"sigma, most {e.max() / measure.LOOP_NOISE:.4f} sigma")
        area = {n: abs(np.trapezoid(np.append(l[0], l[0][0]), np.append(l[1], l[1][0]))) for n, l in run.items()}
        print(f"   W_D {1e3 * area[200]:.3f}, {1e3 * area[400]:.3f}, {1e3 * area[1600]:.3f} mJ")


def energies(rig):
    """W_D, and W_s by both readings, beside the paper's Table 3."""
    paper = {0.01: (1.04, 249.07), 0.33: (16.43, 248.95), 1.0: (38.77, 248.57), 5.0: (73.77, 248.39)}
    for frequency, (wd, ws) in paper.items():
        (force, x, _), _ = QuasiStatic(rig, rig.design_interference).cycles(measure.FORCE_LOW, measure.FORCE_HIGH, frequency, 4)
        print(f"{frequency:5g} Hz: W_D {1e3 * measure.work(force, x):6.2f} mJ (paper {wd}), W_s slope {1e3 * measure.elastic(force, x):.2f}, "
              f"product {0.5e3 * np.ptp(force) * np.ptp(x):.2f} mJ (paper {ws})")


def cases(rig, states, cycles):
    """Tolerance cases: state and friction of each, energies of the first, the third and the last on other meshes, with other steps, after more cycles.

    `states` (name, conditions, i, A); `cycles` by name: frequency, least and greatest force.
    """
    for name, _, i, area in states:
        limit, slip = rig.housing(i, area)
        parts = rig.friction * rig.clamp, rig.friction * rig.housing_stiffness * area * i, rig.shear_strength * area
        print(f"case {name}: {measure.state(i, area)}, F_c {limit:.2f} N, d {1e6 * slip:.2f} um; of F_c: mu N_0 {parts[0] / limit:.0%}, "
              f"mu K A i {parts[1] / limit:.0%}, tau_0 A {parts[2] / limit:.0%}")
    settings = [(4, 200, 20), (4, 400, 20), (8, 200, 20), (8, 400, 20), (8, 800, 20), (12, 400, 20), (8, 400, 40)]
    for cycle, (frequency, low, high) in cycles.items():
        for name, _, i, area in (states[0], states[2], states[-1]):
            for per_part, steps, settle in settings:
                wd, ws = (1e3 * w for w in measure.energies(rig, i, frequency, low, high, area, per_part, steps, settle))
                print(f"{cycle} case {name}, {per_part} elements a part, {steps} steps, after {settle} cycles: W_D {wd:.4f} mJ, W_s {ws:.4f} mJ", flush=True)
    elements(rig, 20e-6)


def run(rig):
    for per_part in (2, 4, 8):
        compliance(rig, per_part)
        straight(rig, per_part)
    chain(rig)
    energies(rig)
    elements(rig)
    steps(rig)
