"""What is known of the rig: geometry for the model's builder, and the truth, which no study reads."""
import json

import numpy as np

from .measure import AVERAGES, FRF_FLOOR, FRF_NOISE, LOOP_NOISE, MODAL_NOISE, write_csv

UNITS = {
    "radius": "m", "part_length": "m", "zone": "part lengths", "zone_start": "part lengths", "drive": "part lengths", "transfer": "part lengths",
    "ei_middle": "N m2", "ei_end": "N m2", "ea": "N", "ga": "N", "line_mass": "kg/m", "line_inertia": "kg m", "leaf_ei": "N m2",
    "leaf_ea": "N", "leaf_ga": "N", "leaf_mass": "kg/m", "leaf_inertia": "kg m", "offset": "m", "seat_stiffness": "N/m2", "tie": "N/m",
    "loss": "-", "band": "Hz", "film_force": "N", "film_speed": "m/s", "film_slip": "m", "pad": "part lengths", "friction": "-", "clamp": "N",
    "clamp_rate": "N/m", "ends": "-", "slip": "m", "patch": "part lengths", "design_interference": "m", "stiffness_exponent": "1/m",
    "damping_exponent": "1/m", "shelf": "N/m", "device_stiffness": "N/m", "device_mass": "kg", "device_damping": "N s/m", "gj": "N m2",
    "ei_yz": "N m2", "polar_inertia": "kg m",
    "housing_stiffness": "N/m3", "shear_strength": "Pa", "contact_stiffness": "N/m3"}


def geometry(folder, rig):
    """arcs.csv, points.csv, parts.csv: what a user of the rig may know."""
    write_csv(folder / "arcs.csv", "arc,R_mm,q_deg,parts", zip((1, 2, 3), [1e3 * r for r in rig.radius], np.degrees(rig.angles()), rig.parts),
              ("%d", "%g", "%.6f", "%d"))
    names = {"pin": 0.0, "Q1": rig.transfer[0], "P": rig.drive, "Q2": rig.transfer[1], "tip": rig.count}
    rows = []
    for name, parts in names.items():
        s = parts * rig.part_length
        (x, y), _ = [a[..., 0] for a in rig.curve([s])]
        part = max(1, int(np.ceil(parts)))
        rows.append((name, part, 1e3 * s, 1e3 * x, 1e3 * y))
    write_csv(folder / "points.csv", "point,part,s_mm,x_mm,y_mm", rows, ("%s", "%d", "%.4f", "%.5f", "%.5f"))
    s = (np.arange(rig.count) + 0.5) * rig.part_length
    (x, y), turn = rig.curve(s)
    leaf = np.array([sum(clip(rig, k, a, b) for a, b in leaves(rig)) for k in range(rig.count)])
    mass = rig.part_length * (rig.line_mass + rig.leaf_mass * leaf)
    # about z through the part's centre, straight part: translation along the part and the section's own inertia
    inertia = mass * rig.part_length**2 / 12 + rig.part_length * rig.line_inertia
    rows = zip(range(1, rig.count + 1), 1e3 * s, 1e3 * x, 1e3 * y, np.degrees(turn), 1e3 * mass, 1e9 * inertia)
    write_csv(folder / "parts.csv", "part,s_mm,x_mm,y_mm,tangent_from_y_deg,mass_g,Izz_g_mm2", rows,
              ("%d", "%.3f", "%.5f", "%.5f", "%.5f", "%.5f", "%.5f"))


def leaves(rig):
    n, a, z = rig.count, rig.zone_start, rig.zone
    return [(a, z), (z, n - z), (n - z, n - a)]


def clip(rig, k, a, b):
    return max(0.0, min(k + 1, b) - max(k, a))


def friction(rig):
    """Law of the housings' friction in the interference, and the elastic slip element of the end connectors that it makes of a chain."""
    i0, e, low = rig.design_interference, rig.offset, int(rig.zone - 0.5)
    law = {"equation": "F_c = mu (N_0 + N_1 i), each housing, times its share",
           "F_c": {mm: rig.slip_force(float(mm) / 1e3) for mm in ("0.1", "0.3", "0.5", "0.6")}, "unit": "N", "i_unit": "mm"}
    hidden = {"grows_with": "i", "f": e * rig.slip_force(i0) * 1e3, "f_unit": "N mm", "d": rig.slip / e / low, "d_unit": "rad",
              "exponent_of_growth_between_0.1_and_0.6_mm": float(np.log(rig.slip_force(0.6e-3) / rig.slip_force(0.1e-3)) / 0.5), "exponent_unit": "1/mm"}
    return law, hidden


def friction_of_area(rig, cases):
    """The same of a rig whose housings know the contact area; `cases` (name, i, A), m and m2."""
    e, low, mu = rig.offset, int(rig.zone - 0.5), rig.friction
    f_0, f_ia, f_a = mu * rig.clamp, mu * rig.housing_stiffness / 1e9, rig.shear_strength / 1e6
    law = {"equation": "F_c = mu (N_0 + K A i) + tau_0 A = f_0 + f_ia A i + f_a A, each housing, times its share; d = F_c / (k_t A)",
           "mu": mu, "N_0": rig.clamp, "N_0_unit": "N", "K": rig.housing_stiffness / 1e9, "K_unit": "N/mm3",
           "tau_0": rig.shear_strength / 1e6, "tau_0_unit": "N/mm2", "k_t": rig.contact_stiffness / 1e9, "k_t_unit": "N/mm3",
           "f_0": f_0, "f_0_unit": "N", "f_ia": f_ia, "f_ia_unit": "N/mm3", "f_a": f_a, "f_a_unit": "N/mm2",
           "cases": [], "cases_note": "operating states; shares of F_c: mu N_0, mu K A i, tau_0 A"}
    for name, i, area in cases:
        limit, slip = rig.housing(i, area)
        a, ia = 1e6 * area, 1e9 * area * i
        law["cases"].append({k: float(f"{v:.6g}") if isinstance(v, float) else v for k, v in {
            "case": name, "i_mm": 1e3 * i, "A_mm2": a, "F_c_N": limit, "d_um": 1e6 * slip,
            "share_N_0": f_0 / limit, "share_K_A_i": f_ia * ia / limit, "share_tau_0_A": f_a * a / limit}.items()})
    hidden = {"grows_with": ["i", "A"], "equation": "f = offset F_c(i, A), d = F_c / (k_t A) / offset / connectors of an end",
              "f": {}, "f_unit": "N mm", "d": {}, "d_unit": "rad"}
    for name, i, area in cases:
        limit, slip = rig.housing(i, area)
        hidden["f"][name], hidden["d"][name] = float(f"{1e3 * e * limit:.6g}"), float(f"{slip / e / low:.6g}")
    return law, hidden


def truth(path, rig, seed, cases=None):
    """truth.json: every parameter of the rig with its unit, the laws, and what a chain of parts should find; `cases` of a rig that knows the area."""
    out = {"note": "What generate.py put into the data. No study reads it; it is for the reader and for tests that compare.", "seed": seed}
    out["rig"] = {k: {"value": v, "unit": UNITS[k]} if k in UNITS else v for k, v in rig.as_dict().items()}
    i0, l, e = rig.design_interference, rig.part_length, rig.offset
    g, tau = rig.prony()
    law, hidden = friction(rig) if cases is None else friction_of_area(rig, cases)
    out["laws"] = {
        "bending_stiffness": {"equation": "EI = EI(i0) exp(a (i - i0))", "a": rig.stiffness_exponent / 1e3, "unit": "1/mm", "i0": i0 * 1e3, "i0_unit": "mm"},
        "damping": {"equation": "loss modulus and film force ~ exp(b (i - i0))", "b": rig.damping_exponent / 1e3, "unit": "1/mm", "i0": i0 * 1e3, "i0_unit": "mm"},
        "friction": law,
    }
    out["prony"] = {"loss_modulus_over_EI": rig.loss, "modulus_of_each_branch_over_loss_modulus": list(g), "relaxation_times": list(tau), "unit": "s",
                    "equation": "M = EI k + sum_j m_j, m_j' = g_j h k' - m_j / tau_j, h = loss EI"}
    low, high = int(rig.zone - 0.5), rig.count - 1 - int(rig.zone - 0.5)
    ends = [f"GF1-{low}.psi", f"GF{high + 1}-{rig.count - 1}.psi"]
    half = (rig.count / 2 - rig.zone)
    to_deg = np.pi / 180 * 1e3
    out["chain_equivalent"] = {
        "note": "Where a chain with one general force between neighbouring parts carries the rig's effects; coefficients of this table are by "
                "geometry alone (moment = offset * force, slip shared equally by the connectors), so approximate.",
        "k_psi_init": {"unit": "N mm/deg", "relaxed": True, ends[0]: (rig.ei_end + rig.leaf_ei) / l * to_deg,
                       f"GF{low + 1}-{high}.psi": (rig.ei_middle + rig.leaf_ei) / l * to_deg, ends[1]: (rig.ei_end + rig.leaf_ei) / l * to_deg},
        "k_y": {"unit": "N/mm", "value": rig.ea / l / 1e3}, "k_x": {"unit": "N/mm", "value": rig.ga / l / 1e3},
        "structural_damping": {"at": f"GF1-{rig.count - 1}.psi", "loss_factor_of_the_blade": rig.loss, "f_low": rig.band[0], "f_high": rig.band[1], "unit": "Hz"},
        "film": {"at": f"GF{low + 1}-{high}.psi", "f": e * rig.film_force * 1e3, "f_unit": "N mm", "v0": rig.film_speed / e / half,
                 "v0_unit": "rad/s", "d": rig.film_slip / e / half, "d_unit": "rad"},
        "hidden": {"effect": "elastic_slip", "at": [p for p, share in zip(ends, rig.ends) if share > 0], **hidden},
        "device": {"at": "P.x", "k": rig.device_stiffness / 1e3, "k_unit": "N/mm", "m": rig.device_mass, "m_unit": "kg", "c": rig.device_damping, "c_unit": "N s/m"},
    }
    out["noise"] = {"loops": {"sigma": LOOP_NOISE, "unit": "mm"}, "frf": {"relative": FRF_NOISE, "floor_of_rms": FRF_FLOOR, "averages": AVERAGES},
                    "modal": {"frequency": MODAL_NOISE[0], "damping": MODAL_NOISE[1]}}
    path.write_text(json.dumps(out, indent=1) + "\n")
