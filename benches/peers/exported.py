"""The scripts of `misfit export --to exudyn` run as written: natural frequencies at rest and static deflection against misfit's engines.

Writes studies of the paper's chain (22 parts; springs and dampers; a unilateral shelf with device, mass, friction and structural damping), of a
chain of bodies and of one connector into a temporary folder, exports each and runs what comes out.
    python benches/peers/exported.py target/release/misfit
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

GEOMETRY = """schema = 1
dataset = "data"
[[arc]]
radius = "150 mm"
angle = "12 deg"
[[arc]]
radius = "60 mm"
angle = "35 deg"
[[arc]]
radius = "120 mm"
angle = "18 deg"
[[part]]
name = "b"
count = 22
section = { width = "20 mm", thickness = "9 mm", density = "3200 kg/m3" }
[[joint]]
part = "b1"
free = ["psi"]
at = "start"
[[point]]
name = "P"
part = "b11"
at = ["AT_X", "AT_Y"]
[[connector]]
name = "GF"
chain = "b"
"""
CLOSED = '[[joint]]\npart = "b22"\nfree = ["y", "psi"]\nat = "end"\n'
OPEN = """[[joint]]
part = "b22"
free = ["x", "y", "psi"]
at = "end"
[[connector]]
name = "shelf"
from = "ground"
to = "b22"
[[connector]]
name = "device"
from = "ground"
to = "P"
"""
# Table 4 of the paper.
GROUPS = [("1-3", 3.6e6, 1490), ("4-18", 4.2e6, 1960), ("19-21", 3.0e6, 1490)]


# Shapes and strengths, which a study leaves free unless it says otherwise; what else there is are settings.
FITTED = {"k", "c", "k3", "f", "d", "tau", "h", "m", "g", "v0"}


def effect(name, at, free=False, **values):
    """Nothing but what is `free` is fitted: the values stand as they are."""
    def written(k, v):
        return f'{k} = {{ start = {json.dumps(v)}, fixed = true }}\n' if k in FITTED and not free else f"{k} = {json.dumps(v)}\n"

    return f'[[effect]]\neffect = "{name}"\nat = "{at}"\n' + "".join(written(k, v) for k, v in values.items())


def springs():
    out = ""
    for group, ky, psi in GROUPS:
        for axis, k in (("x", "30e6 N/mm"), ("y", f"{ky} N/mm"), ("z", "90e6 N/mm"), ("theta", "1e6 N mm/deg"), ("phi", "2500 N mm/deg"), ("psi", f"{psi} N mm/deg")):
            out += effect("linear_stiffness", f"GF{group}.{axis}", free=(group, axis) == ("4-18", "psi"), k=k)
    return out


MODAL = """schema = 1
[[test]]
id = "modal"
kind = "modal"
conditions = { load = "LOAD" }
rows = [{ mode = 1, frequency = "FIRST", family = "xy bending" }]
"""


def load(via=""):
    return f'[[load]]\nat = "P.x"\ncondition = "load"\n{via}'


# The origin of part 11, where b11.x is in src/core/engine/space_peers.rs.
from chain22 import LENGTH, N, curve  # noqa: E402

x, y, _ = curve(10.5 * LENGTH / N)[0]
GEOMETRY = GEOMETRY.replace("AT_X", f"{1e3 * x} mm").replace("AT_Y", f"{1e3 * y} mm")
DAMPED = springs() + "".join(effect("viscous", f"GF{g}.psi", c=f"{2e-5 * psi} N mm s/deg") for g, _, psi in GROUPS)
RICH = (
    DAMPED
    + effect("contact", "shelf.x", k="20000 N/mm", g="-0.5 mm", side=1, n=1)
    + effect("linear_stiffness", "device.x", k="400 N/mm")
    + effect("added_mass", "device.x", m="105 g")
    + effect("structural_damping", "GF1-21.psi", h="80 N mm/deg", f_low="20 Hz", f_high="20 kHz")
    + effect("elastic_slip", "GF1-3.psi", f="300 N mm", d="0.005 rad")
    + effect("film", "GF4-18.psi", f="20 N mm", v0="0.01 rad/s", d="0.001 rad")
)
BODIES = """schema = 1
dataset = "data"
[[body]]
name = "m"
count = 8
mass = "0.1 kg"
free = ["x"]
[[connector]]
name = "base"
from = "ground"
to = "m1"
[[connector]]
name = "c"
chain = "m"
[[load]]
at = "m8.x"
force = "10 N"
"""
CHAIN = (
    BODIES
    + effect("linear_stiffness", "base.x", free=True, k="310 N/mm")
    + effect("linear_stiffness", "c1-7.x", k="220 N/mm")
    + effect("viscous", "c1-7.x", c="0.005 N s/mm")
    + effect("cubic_stiffness", "c3.x", k3="1e6 N/mm3")
    + effect("elastic_slip", "c5.x", f="4 N", d="0.05 mm")
    + effect("maxwell", "c2.x", k="50 N/mm", tau="1 ms")
)
ONE = """schema = 1
dataset = "data"
[[body]]
name = "end"
free = ["x"]
mass = "2 kg"
[[connector]]
name = "c1"
from = "ground"
to = "end"
[[load]]
at = "end.x"
force = "100 N"
""" + effect("linear_stiffness", "c1.x", free=True, k="25 N/mm") + effect("viscous", "c1.x", c="0.02 N s/mm")

STUDIES = [
    ("paper's chain, 138.3 N", GEOMETRY + CLOSED + load() + springs(), "138.3 N", "158 Hz"),
    ("paper's chain with dampers, -138.3 N", GEOMETRY + CLOSED + load() + DAMPED, "-138.3 N", "158 Hz"),
    ("shelf, device, friction, film, structural damping", GEOMETRY + OPEN + load('via = ["138.3 N"]\n') + RICH, "80 N", "280 Hz"),
    ("bodies in a line", CHAIN, "0 N", "40 Hz"),
    ("one connector", ONE, "0 N", "18 Hz"),
]


def main():
    misfit = sys.argv[1] if len(sys.argv) > 1 else "target/release/misfit"
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, study, force, first) in enumerate(STUDIES):
            here = Path(folder) / str(number)
            (here / "data").mkdir(parents=True)
            tests = MODAL.replace("LOAD", force).replace("FIRST", first)
            if "[[body]]" in study:
                tests = tests.replace(', family = "xy bending"', "")
            (here / "study.toml").write_text(study)
            (here / "data" / "dataset.toml").write_text(tests)
            run = subprocess.run([misfit, "export", here, "--to", "adams,exudyn", "--out", here / "run"], capture_output=True, text=True)
            if run.returncode:
                raise SystemExit(run.stderr)
            script = subprocess.run([sys.executable, here / "run" / "mechanism.py", "--json"], capture_output=True, text=True)
            if script.returncode:
                raise SystemExit(script.stdout + script.stderr)
            out = json.loads(script.stdout[script.stdout.index("{"):])
            parts = [f"{what} {100 * out[key]:.2g} %" for what, key in (("frequencies", "largest_difference_of_frequencies"), ("deflection", "largest_difference_of_deflection")) if out.get(key) is not None]
            print(f"{name}: largest difference of the {', of the '.join(parts)}; first mode {out['frequencies'][0]:.3f} Hz {run.stderr.strip()}")
            worst = max([worst] + [out[k] for k in out if k.startswith("largest") and out[k] is not None])
    print(f"largest of all: {100 * worst:.2g} %")
    if worst > 1e-3:
        raise SystemExit("more than 0.1 %")


if __name__ == "__main__":
    main()
