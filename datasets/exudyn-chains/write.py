"""Writes a case: study.toml with the base alone, data/dataset.toml and its files with noise."""
import math
import os

import numpy as np

import draw
from measure import FRF_NOISE, FRFS, LINES, LOOPS, POINTS, WRITTEN

# Channels of a loop: column, place.
CHANNELS = [("D_P", "P.x"), ("D_Q1", "Q1.x"), ("D_tip", "tip.y")]

# Units of the laws' parameters along x and y, and about z.
UNITS = {
    "k": ("N/m", "N m/rad"), "k3": ("N/m3", "N m/rad3"), "f": ("N", "N m"), "m": ("kg", "kg m2"), "d": ("m", "rad"), "x0": ("m", "rad"),
    "g": ("m", "rad"), "v0": ("m/s", "rad/s"), "w": ("m/s", "rad/s"), "tau": ("s", "s"), "side": (None, None),
}

ASSUMPTIONS = """assumptions = [
  "Three degrees of freedom a part: the tests are in the plane.",
  "Arcs, masses and places of the parts are exact, and so are their stiffness along and across the blade and that of the shelf across.",
  "The springs of a group are alike; the device is attached at P in every test.",
]
"""


def case(folder, machine, off, truth, sigmas, noise, rng):
    """`off`: factor on every base parameter of the study; `noise`: factor on all noise, which `sigmas` already have."""
    g, fixed, base = machine
    data = os.path.join(folder, "data")
    os.makedirs(data, exist_ok=True)
    tests = ["schema = 1", 'title = "Chain of rigid parts, loops and frequency responses"']
    for test in LOOPS:
        tests.append(write_loop(data, test, truth[test[0]], sigmas[test[0]], rng))
    for test in FRFS:
        tests.append(write_frf(data, test, truth[test[0]], sigmas[test[0]], noise, rng))
    put(os.path.join(data, "dataset.toml"), "\n".join(tests))
    put(os.path.join(folder, "study.toml"), study(g, fixed, {p: v * off[p] for p, v in base.items()}))


def put(file, text):
    with open(file, "w") as f:
        f.write(text)


def told(folder, case, machine, hidden):
    """The study with the base at the truth and the hidden effects in it: what the program has to agree with."""
    g, fixed, base = machine
    os.makedirs(folder, exist_ok=True)
    lines = study(g, fixed, base, os.path.abspath(os.path.join(case, "data"))).splitlines()
    for law, group, _ in hidden:
        lines += ["", "[[effect]]", f'effect = "{law.name}"', f"at = {quoted(draw.name(group).split(','))}"]
        for key, value in law.parameters().items():
            unit = UNITS[key][group[0][0] == "GF"]
            lines.append(f"{key} = {value:g}" if unit is None else f'{key} = {{ start = "{value:.8g} {unit}" }}')
        lines += ["n = 1"] if law.name == "contact" else []
    put(os.path.join(folder, "study.toml"), "\n".join(lines) + "\n")


def write_loop(data, test, answer, sigma, rng):
    name, mean, amplitude, frequency, _ = test
    k = np.arange(WRITTEN * POINTS + 1)
    t = k / (POINTS * frequency)
    force = mean - amplitude * np.cos(2 * np.pi * k / POINTS)
    x = np.array([c[k % POINTS] + s * rng.standard_normal(len(k)) for c, s in zip(answer, sigma)])
    np.savetxt(os.path.join(data, name + ".csv"), np.column_stack([t, force, *(x * 1e3)]), delimiter=",", comments="",
               header="t,F," + ",".join(c for c, _ in CHANNELS), fmt=["%.5f", "%.6f", "%.7f", "%.7f", "%.7f"])
    lines = [f' {{ role="displacement", at="{at}", column="{c}", unit="mm", sigma="{s * 1e3:.5g} mm" }},' for (c, at), s in zip(CHANNELS, sigma)]
    return "\n".join([
        "", "[[test]]", f'id = "{name}"', 'kind = "cycle"', f'file = "{name}.csv"', 'control = "force"',
        f'conditions = {{ frequency = "{frequency} Hz" }}', "channels = [", ' { role="time", column="t", unit="s" },',
        ' { role="force", at="P.x", column="F", unit="N" },', *lines, "]",
    ])


def write_frf(data, test, answer, sigma, noise, rng):
    name, load, respond, _ = test
    H = answer + sigma * rng.standard_normal(answer.shape)
    np.savetxt(os.path.join(data, name + ".csv"), np.column_stack([LINES, *H]), delimiter=",", comments="", header="f,re,im", fmt=["%.2f", "%.7g", "%.7g"])
    return "\n".join([
        "", "[[test]]", f'id = "{name}"', 'kind = "frf"', f'file = "{name}.csv"', 'excite = "P.x"', f'respond = "{respond}.x"',
        'quantity = "accelerance"', f'noise = "{100 * noise * FRF_NOISE:g} %"', f'conditions = {{ load = "{load} N" }}', "channels = [",
        ' { role="frequency", column="f", unit="Hz" },', ' { role="real", column="re", unit="m/s2/N" },',
        ' { role="imag", column="im", unit="m/s2/N" }]',
    ])


def quoted(names):
    return "[" + ", ".join(f'"{n}"' for n in names) + "]"


def effect(name, at, **values):
    """An [[effect]]; a text is fixed, a pair (text, unit) is fitted from there and not negative."""
    places = at.split(",")
    lines = ["", "[[effect]]", f'effect = "{name}"', "at = " + (quoted(places) if len(places) > 1 else f'"{at}"')]
    for key, value in values.items():
        free = isinstance(value, tuple)
        lines.append(f'{key} = {{ start = "{value[0]:.6g} {value[1]}", min = "0 {value[1]}" }}' if free else f'{key} = {{ start = "{value}", fixed = true }}')
    return lines


def geometry(g, fixed):
    lines = []
    for k, (radius, angle) in enumerate(g.arcs):
        lines += ["", "[[arc]]", f'radius = "{radius * 1e3:.6f} mm"', f'angle = "{math.degrees(angle):.10f} deg"']
        lines += [f'heading = "{math.degrees(g.heading):.10f} deg"'] if k == 0 else []
    inertia = quoted([f'{fixed["inertia"]:.9g} kg m2'] * 3)
    lines += ["", "[[part]]", 'name = "b"', f"count = {g.n}", f'mass = "{fixed["mass"]:.9g} kg"', f"inertia = {inertia}", 'free = ["x", "y", "psi"]']
    lines += ["[[joint]]", 'part = "b1"', 'free = ["psi"]', 'at = "start"']
    for point in ("Q1", "P", "Q2"):
        x, y = g.centres[fixed[point]] * 1e3
        lines += ["[[point]]", f'name = "{point}"', f'at = ["{x:.9f} mm", "{y:.9f} mm"]']
    return lines + ["[[point]]", 'name = "tip"', f'part = "b{g.n}"', 'at = "end"']


def study(g, fixed, start, data="data"):
    split = {s: [t[0] for t in LOOPS + FRFS if t[-1] == s] for s in ("select", "held_out")}
    lines = ["schema = 1", f'title = "Chain of {g.n} parts"', f'dataset = "{data}"', ASSUMPTIONS, "[split]"]
    lines += [f"{s} = {quoted(names)}" for s, names in split.items()] + geometry(g, fixed)
    lines += ["", "[[connector]]", 'name = "GF"', 'chain = "b"']
    for name, body in (("shelf", "tip"), ("device", "P")):
        lines += ["[[connector]]", f'name = "{name}"', 'from = "ground"', f'to = "{body}"']
    lines += ["[[load]]", 'at = "P.x"', 'condition = "load"']
    lines += effect("linear_stiffness", f"GF1-{g.n - 1}.x", k=f'{fixed["k_x"]:g} N/m')
    lines += effect("linear_stiffness", f"GF1-{g.n - 1}.y", k=f'{fixed["k_y"]:g} N/m')
    lines += effect("linear_stiffness", "shelf.x", k=f'{fixed["k_shelf"]:g} N/m')
    for group in ("ends", "middle"):
        at = draw.name([("GF", j) for j in range(1, g.n) if (j in fixed["ends"]) == (group == "ends")])
        lines += effect("linear_stiffness", at, k=(start["k_" + group], "N m/rad"))
        lines += effect("viscous", at, c=(start["c_" + group], "N m s/rad"))
    lines += effect("viscous", "shelf.y", c=(start["c_shelf"], "N s/m"))
    lines += effect("linear_stiffness", "device.x", k=(start["k_device"], "N/m"))
    lines += effect("viscous", "device.x", c=(start["c_device"], "N s/m"))
    return "\n".join(lines) + "\n"
