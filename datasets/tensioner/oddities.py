"""What the paper's printed numbers say of each other: recomputed from the files of this folder, nothing copied. Prints.

    python oddities.py
"""
import csv
import tomllib
from itertools import product
from pathlib import Path

import numpy as np
from scipy.integrate import quad
from scipy.optimize import least_squares, minimize

HERE = Path(__file__).parent


def rows(name):
    with open(HERE / name, newline="") as f:
        return list(csv.DictReader(f))


def number(text):
    return float(str(text).split()[0])


TESTS = {t["id"]: t for t in tomllib.loads((HERE / "dataset.toml").read_text())["test"]}
CASES = tomllib.loads((HERE / "table-6.toml").read_text())["test"][0]["rows"]
TEXT = {r["quantity"]: float(r["value"]) for r in rows("text.csv")}
ASSUMED = {r["quantity"]: float(r["value"]) for r in rows("assumptions.csv")}
STEEL = {r["parameter"]: {k: float(v) for k, v in r.items() if k not in ("parameter", "unit")} for r in rows("table-1.csv")}
T4 = {(r["group"], r["axis"]): (float(r["k"]), float(r["c"])) for r in rows("table-4.csv")}
T5 = [{k: float(v) for k, v in r.items()} for r in rows("table-5.csv")]
MODES = {k: np.array([[number(r["frequency"]), number(r["damping"])] for r in TESTS[f"modal-{k}"]["rows"]]) for k in ("free", "preload", "mean", "maximum")}
F, WD, WS, D = np.array([[number(r[k]) for k in ("frequency", "W_D", "W_s", "D")] for r in TESTS["table-3"]["rows"]]).T
DF = TEXT["dF"]
PER_RAD = 180.0 / np.pi


def title(text):
    print(f"\n{text}")


def copies():
    """Table 5 stands twice: its csv and the conditions of table-6.toml."""
    for case, row in zip(T5, CASES):
        for key, value in row["conditions"].items():
            unit = value.split()[1]
            assert case[f"{key}_{unit}"] == number(value), (row["case"], key)
    print("table-5.csv and the conditions of table-6.toml agree")


def table_1():
    title("Table 1: the share of steel that makes the equivalent material a weighted mean")
    for name, v in STEEL.items():
        pa, steel, mean = v["PA 66"], v["Steel 48Si7"], v["Equivalent material"]
        print(f"  {name}: {(mean - pa) / (steel - pa):.3f}")


def table_2():
    title("Table 2: modal damping against frequency (exponent of a power law; a viscous connector gives +1, a constant loss factor 0)")
    for name, m in MODES.items():
        print(f"  {name}: {m[:, 1].min():.2f} to {m[:, 1].max():.2f} %, exponent {np.polyfit(np.log(m[:, 0]), np.log(m[:, 1]), 1)[0]:+.3f}")
    title("Table 2: signed shifts of modes 1-4 from mean load, %")
    for name in ("preload", "maximum"):
        print(f"  {name}: " + " ".join(f"{100 * (a / b - 1):+.2f}" for a, b in zip(MODES[name][:4, 0], MODES["mean"][:4, 0])))
    title("Table 2: fifth mode at the three loads, Hz, and the middle one over the mean of its neighbours")
    a, b, c = (MODES[k][4, 0] for k in ("preload", "mean", "maximum"))
    print(f"  {a} {b} {c}: {100 * (b / (0.5 * (a + c)) - 1):+.1f} %; modes 1-4 at most "
          f"{max(abs(100 * (MODES['mean'][j, 0] / (0.5 * (MODES['preload'][j, 0] + MODES['maximum'][j, 0])) - 1)) for j in range(4)):.2f} %")


def table_3():
    title("Table 3: D = W_D / W_s recomputed, and W_s against 0.01 Hz")
    for f, wd, ws, d in zip(F, WD, WS, D):
        print(f"  {f:5g} Hz: {wd / ws:.4f} (printed {d}), W_s {100 * (ws / WS[0] - 1):+.2f} %")
    slopes = np.diff(np.log(WD)) / np.diff(np.log(F))
    print("  exponent of W_D in the frequency between rows: " + " ".join(f"{s:.2f}" for s in slopes))
    for law, scale in (("viscous", F), ("Coulomb", np.ones(4))):
        r = WD / scale
        print(f"  best possible factor, {law}: {np.sqrt(r.max() / r.min()):.2f}")
    k = DF**2 / (2 * WS.mean())
    a = DF / (2 * k)
    print(f"  stiffness dF^2 / (2 W_s) = {k:.2f} N/mm, travel {2 * a:.3f} mm")

    def maxwell(p):
        x = np.exp(p).reshape(2, 2)
        wt = 2 * np.pi * F[:, None] * x[:, 1]
        return np.pi * a**2 * (x[:, 0] * wt / (1 + wt**2)).sum(1), (x[:, 0] * wt**2 / (1 + wt**2)).sum(1)
    # four numbers, four parameters: among the fits that reproduce W_D, the range of their stiffening from the first to the last row
    fits = []
    for start in product((0.0, 1.5), (-3.0, -1.5), (0.0, 1.5), (-0.5, 1.5)):
        r = least_squares(lambda p: np.log(maxwell(p)[0] / WD), start)
        if np.exp(np.abs(r.fun).max()) < 1.05:
            stored = maxwell(r.x)[1]
            # k is the stiffness at 0.01 Hz: W_s falls where the stiffness rises
            fits.append((np.exp(np.abs(r.fun).max()) - 1, (stored[-1] - stored[0]) / k))
    for worst, rise in sorted({(round(w, 3), round(s, 3)) for w, s in fits}):
        print(f"  two Maxwell branches: W_D within {100 * worst:.1f} %, stiffness at 5 Hz {100 * rise:+.1f} % over 0.01 Hz")

    def film(p):
        f0, v0, fc = np.exp(p)
        w = 2 * np.pi * F
        loop = [quad(lambda t: np.arcsinh(a * om / v0 * np.cos(t)) * a * np.cos(t), -np.pi / 2, np.pi / 2)[0] * 2 for om in w]
        return f0 * np.array(loop) + 4 * fc * a
    best = minimize(lambda p: np.abs(np.log(film(p) / WD)).max(), least_squares(lambda p: np.log(film(p) / WD), [1.0, 0.0, -3.0]).x,
                    method="Nelder-Mead", options={"maxiter": 2000, "xatol": 1e-6, "fatol": 1e-9})
    f0, v0, fc = np.exp(best.x)
    print(f"  film {f0:.2f} N asinh(v / {v0:.2f} mm/s) + Coulomb {fc:.3f} N, sinusoidal travel: W_D within {100 * np.expm1(best.fun):.1f} %")
    print(f"  that film without a contact stiffness: c/k = {f0 / v0 / k:.3f} s at small amplitude, damping ratio of a 290 Hz mode {np.pi * 290 * f0 / v0 / k:.0f}")
    eta = 2 * MODES["mean"][:4, 1].mean() / 100
    print(f"  loss factor of Table 2, {eta:.3f}, at 0.01 Hz: W_D = {2 * np.pi * eta * 0.5 * k * a**2:.0f} mJ where {WD[0]} is printed")


def table_4():
    title("Table 4: c/k, and the damping ratio it gives a mode at 290 Hz that bends (twists, shears) that connector alone")
    for (group, axis), (k, c) in T4.items():
        print(f"  {group}.{axis}: c/k = {c / k:.2e} s, damping ratio {np.pi * 290 * c / k:.2e}")
    l, area = ASSUMED["part_length"], ASSUMED["width"] * ASSUMED["thickness"]
    line = ASSUMED["density"] * area * 1e-6                     # kg/m
    # static stiffness at mid-span, one rotational spring between neighbouring rigid parts, pin and roller
    s = np.arange(1, 22) * l
    k = np.array([T4[g, "psi"][0] for g in ["GF1-3"] * 3 + ["GF4-18"] * 15 + ["GF19-21"] * 3]) * PER_RAD
    length, at = 22 * l, ASSUMED["P"] * l
    moment = np.where(s < at, s * (1 - at / length), at * (1 - s / length))
    print(f"  straight chain of {length:.1f} mm on pin and roller: {1 / (moment**2 / k).sum():.1f} N/mm at P; Table 3 says {DF**2 / 2 / WS.mean():.1f}")
    ei = T4["GF4-18", "psi"][0] * PER_RAD * l                    # N mm2
    free = 4.73004**2 / (2 * np.pi * (length / 1e3) ** 2) * np.sqrt(ei * 1e-6 / line)
    print(f"  uniform free beam of that stiffness and {line:.3f} kg/m: {free:.0f} Hz in xy, Table 2 says {MODES['free'][0, 0]}")
    ratio = np.sqrt(T4["GF4-18", "theta"][0] / T4["GF4-18", "psi"][0])
    print(f"  first free frequency in yz over that in xy: {ratio:.1f} by k_theta / k_psi, {MODES['free'][3, 0] / MODES['free'][0, 0]:.1f} by Table 2")


def table_5():
    title("Table 5 under eq. 6 (i A = constant): i_max A_min and i_min A_max, mm3, with the range that rounding allows")
    bounds = {"i_max A_min": [], "i_min A_max": []}
    for c in T5:
        parts = []
        for name, (i, a) in {"i_max A_min": ("i_max_mm", "A_min_mm2"), "i_min A_max": ("i_min_mm", "A_max_mm2")}.items():
            low, high = (c[i] - 0.005) * (c[a] - 0.05), (c[i] + 0.005) * (c[a] + 0.05)
            bounds[name].append((c[i] * c[a], low, high))
            parts.append(f"{name} {c[i] * c[a]:.2f} ({low:.2f} to {high:.2f})")
        print(f"  case {c['case']:.0f}: " + ", ".join(parts))
    for name, b in bounds.items():
        b = np.array(b)
        print(f"  {name}: {b[:, 0].min():.2f} to {b[:, 0].max():.2f}; common to all cases within rounding: "
              + (f"{b[:, 1].max():.2f} to {b[:, 2].min():.2f}" if b[:, 1].max() <= b[:, 2].min() else "nothing"))
    both = np.array(bounds["i_max A_min"] + bounds["i_min A_max"])
    print(f"  one constant for both: largest lower bound {both[:, 1].max():.2f}, smallest upper bound {both[:, 2].min():.2f}")
    pairs = [(c[i], c[a]) for c in T5 for i, a in (("i_max_mm", "A_min_mm2"), ("i_min_mm", "A_max_mm2"))]
    grid = np.linspace(2.4, 3.4, 1001)
    worst = [max(abs(i - g / a) for i, a in pairs) for g in grid]
    g = grid[int(np.argmin(worst))]
    top, low = max(abs(i - g / a) for i, a in pairs[::2]), max(abs(i - g / a) for i, a in pairs[1::2])
    print(f"  the constant with the smallest error, {g:.2f} mm3: i_max within {top:.3f} mm, i_min within {low:.3f} mm")
    es, ep = STEEL["Young's modulus"]["Steel 48Si7"], STEEL["Young's modulus"]["PA 66"]
    inertia = g * TEXT["leaf_length_L"] ** 3 * ep / (24 * es * TEXT["h_r"] * TEXT["delta_s"])
    thick = (12 * inertia / ASSUMED["leaf_width_b"]) ** (1 / 3)
    ei = T4["GF4-18", "psi"][0] * PER_RAD * ASSUMED["part_length"]
    print(f"  eq. 6 with that constant: I = {inertia:.1f} mm4, a leaf {thick:.1f} mm thick at {ASSUMED['leaf_width_b']:g} mm width; "
          f"E_s I is {es * inertia / ei:.0f} times Table 4's bending stiffness, three leaves {3 * es * inertia / ei:.0f} times")
    print(f"  lowest leaf tolerance: {min(c['leaf_shape_mm'] for c in T5)} mm in the table, {TEXT['leaf_tolerance_lowest_in_text']} mm in the text below it; "
          f"blade {min(c['blade_shape_mm'] for c in T5)} mm in both. The areas' unit is printed as mm.")


def table_6():
    title("Table 6 against Tables 3 and 5")
    w = np.array([number(c["W_D"]) for c in CASES])
    print(f"  case 1 over Table 3 at 5 Hz: {w[0] / WD[-1]:.2f}")
    print(f"  case {w.argmax() + 1}: {w.max()} mJ; the rectangle dF dx = 2 W_s that encloses any loop of Table 3 at 5 Hz: {2 * WS[-1]:.0f} mJ")
    print(f"  span of the energies: {100 * (w.max() / w.min() - 1):.0f} %")
    b = TEXT["exponent_c_psi"]
    for key in ("i_min_mm", "i_max_mm"):
        i = np.array([c[key] for c in T5])
        print(f"  span of eq. 8 over {key[:5]}: {100 * (np.exp(b * np.ptp(i)) - 1):.0f} %; correlation of {key[:5]} with ln W_D {np.corrcoef(i, np.log(w))[0, 1]:+.2f}")
    pairs = [(abs(T5[p]["i_min_mm"] - T5[q]["i_min_mm"]) + abs(T5[p]["i_max_mm"] - T5[q]["i_max_mm"]), p, q) for p in range(9) for q in range(p)]
    for gap, p, q in sorted(pairs)[:3]:
        print(f"  cases {q + 1} and {p + 1}: i differs by {gap:.2f} mm in all (i_min and i_max), W_D by {100 * (max(w[p], w[q]) / min(w[p], w[q]) - 1):.0f} %")


if __name__ == "__main__":
    copies()
    for table in (table_1, table_2, table_3, table_4, table_5, table_6):
        table()
