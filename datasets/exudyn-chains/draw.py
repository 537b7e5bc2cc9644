"""Draws machines and hidden effects. All numbers are SI; every range that is drawn from stands here."""
import math

import numpy as np

from chain import Geometry, Rig
from laws import LAWS

# Laws by the kind of place, each equally likely.
EFFECTS = {
    "ends": ["elastic_slip", "film", "maxwell", "cubic_stiffness", "bilinear_stiffness", "contact"],
    "middle": ["elastic_slip", "film", "maxwell", "cubic_stiffness", "bilinear_stiffness", "contact"],
    "single": ["elastic_slip", "maxwell", "bilinear_stiffness", "contact"],
    "shelf": ["elastic_slip", "film", "maxwell", "smooth_coulomb", "contact"],
    "device": ["elastic_slip", "maxwell", "cubic_stiffness", "bilinear_stiffness", "contact", "added_mass", "smooth_coulomb"],
}
# How often a kind of place is drawn.
PLACES = {"ends": 0.25, "middle": 0.25, "single": 0.1, "shelf": 0.2, "device": 0.2}
# Numbers of hidden effects in a block of six cases, in an order drawn by the seed.
BLOCK = [0, 1, 1, 1, 2, 2]
# Least and greatest load [N].
LOAD = (20.0, 120.0)


def machine(rng):
    """Geometry, what the study declares, and the base parameters of the truth."""
    n = int(rng.integers(16, 31))
    arcs = [(rng.uniform(80e-3, 200e-3), -math.radians(rng.uniform(13, 23))) for _ in range(3)]
    scale = rng.uniform(95e-3, 150e-3) / sum(r * abs(a) for r, a in arcs)
    g = Geometry(n, [(round(r * scale, 5), round(a, 6)) for r, a in arcs])
    per_length, thickness = 0.576 * rng.uniform(0.8, 1.2), 9e-3
    mass = per_length * g.step
    end = max(2, round(n * rng.uniform(0.15, 0.3)))
    ends = [*range(1, end + 1), *range(n - end, n)]
    bending = rng.uniform(18e3, 30e3) * g.length**3 / 48
    middle = 1.15 * bending / g.step
    first = (math.pi / g.length) ** 2 * math.sqrt(bending / per_length)
    fixed = {
        "mass": float(f"{mass:.6g}"), "inertia": float(f"{mass * (g.step**2 + thickness**2) / 12:.6g}"), "k_x": 1e8, "k_y": 4e8, "k_shelf": 2e7,
        "ends": ends, "P": n // 2, "Q1": round(0.28 * n), "Q2": round(0.72 * n),
    }
    base = {
        "k_ends": middle * rng.uniform(0.6, 0.9), "k_middle": middle, "c_ends": 0.0, "c_middle": 0.0,
        "c_shelf": rng.uniform(10, 40), "k_device": rng.uniform(2e3, 8e3), "c_device": rng.uniform(5, 25),
    }
    for group in ("ends", "middle"):
        base["c_" + group] = 2 * rng.uniform(0.015, 0.04) * base["k_" + group] / first
    return g, fixed, {k: float(f"{v:.5g}") for k, v in base.items()}


def places(kind, g, fixed, rng):
    """Places of a kind, as the rig takes them."""
    if kind == "ends":
        return [("GF", j) for j in fixed["ends"]]
    if kind == "middle":
        return [("GF", j) for j in range(1, g.n) if j not in fixed["ends"]]
    if kind == "single":
        return [("GF", int(rng.integers(3, g.n - 2)))]
    return [("shelf", "y")] if kind == "shelf" else [("device", "x")]


def name(group):
    """The group as misfit writes it: GF1-3.psi,GF19-21.psi; shelf.y."""
    if group[0][0] != "GF":
        return ".".join(group[0])
    runs = []
    for _, j in group:
        if runs and j == runs[-1][1] + 1:
            runs[-1][1] = j
        else:
            runs.append([j, j])
    return ",".join(f"GF{a}.psi" if a == b else f"GF{a}-{b}.psi" for a, b in runs)


def travel(g, fixed, base, group):
    """Relative displacement at the place that moves most, at the least and at the greatest load."""
    found = []
    for load in LOAD:
        rig = Rig(g, fixed, base, [], lambda t, load=load: load * min(t, 1.0))
        q = rig.equilibrium()
        found.append([rig._across(place, q) for place in group])
    low, high = np.array(found)
    most = int(np.argmax(np.abs(high - low)))
    return float(low[most]), float(high[most])


def effect(g, fixed, base, kind, rng):
    """A law with the strength it begins with, the strengths it may be scaled to, and its places."""
    group = places(kind, g, fixed, rng)
    law = str(rng.choice(EFFECTS[kind]))
    low, high = travel(g, fixed, base, group)
    half, most, middle = abs(high - low) / 2, max(abs(low), abs(high)), (low + high) / 2
    speed = 2 * math.pi * half
    sign = 1.0 if rng.random() < 0.65 else -1.0
    chain = 48 * base["k_middle"] * g.step / g.length**3
    k = {"ends": base["k_ends"], "middle": base["k_middle"], "single": base["k_middle"], "shelf": 3 * chain, "device": chain}[kind]
    at = middle + rng.uniform(-0.4, 0.4) * half
    strength, shape, least, greatest = {
        "elastic_slip": lambda: (0.1 * k * half, {"d": half * rng.uniform(0.08, 0.3)}, 0.02, 8),
        "film": lambda: (0.03 * k * half, {"v0": speed * 10 ** rng.uniform(-2, -1), "d": half * rng.uniform(0.03, 0.15)}, 0.02, 8),
        "maxwell": lambda: (0.15 * k, {"tau": 10 ** rng.uniform(-1.6, -0.5)}, 0.02, 8),
        "smooth_coulomb": lambda: (0.05 * k * half, {"w": speed * 10 ** rng.uniform(-1, -0.3)}, 0.02, 8),
        "cubic_stiffness": lambda: (sign * 0.1 * k / most**2, {}, 0.02, 6 if sign > 0 else 1.5),
        "bilinear_stiffness": lambda: (sign * 0.3 * k, {"x0": at}, 0.02, 6 if sign > 0 else 2),
        "contact": lambda: (0.3 * k, {"g": abs(at), "side": math.copysign(1.0, at)}, 0.02, 8),
        "added_mass": lambda: (0.1 * g.n * fixed["mass"], {}, 0.02, 8),
    }[law]()
    shape = {p: float(f"{v:.5g}") for p, v in shape.items()}
    return LAWS[law](law, strength, **shape), group, (least * abs(strength), greatest * abs(strength))


def kinds(seed, case):
    """How many effects a case hides."""
    order = np.random.default_rng([seed, 10**6 + case // len(BLOCK)]).permutation(BLOCK)
    return int(order[case % len(BLOCK)])


def kind(rng, taken):
    """A kind of place that is not taken."""
    free = [p for p in PLACES if p not in taken]
    weights = np.array([PLACES[p] for p in free])
    return str(rng.choice(free, p=weights / weights.sum()))
