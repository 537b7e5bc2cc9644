"""Universal files: misfit against pyuff, equality of every value and throughput, in one run.

    python benches/peers/uff.py [FOLDER ...]

Every .uff and .unv file of the folders is read by both; every number pyuff gives is held against misfit's to the precision stored. Then a file of
ASCII sets 58, one of binary 58b in double and one in single precision are written and read by both in turn; the table gives each side's best of the rounds.
Files that pyuff cannot read, and sets it leaves undecoded, are named.
"""
import glob
import json
import os
import struct
import subprocess
import sys
import tempfile
import time

import numpy as np
import pyuff

from chain import binary

ROUNDS = 5
KEYS = {
    58: ["func_type", "rsp_node", "rsp_dir", "ref_node", "ref_dir", "ord_data_type", "num_pts", "abscissa_spacing", "ordinate_spec_data_type", "orddenom_spec_data_type"],
    15: ["node_nums", "x", "y", "z"],
    2411: ["node_nums", "x", "y", "z"],
    82: ["trace_num", "n_nodes", "color", "nodes"],
    164: ["length", "force", "temp", "temp_offset"],
    55: ["node_nums"],
    2414: ["node_nums"],
}


def number(values):
    v = np.array(values["re"], float)
    return v + 1j * np.array(values["im"]) if "im" in values else v


def same(a, b):
    a, b = np.atleast_1d(np.asarray(a)), np.atleast_1d(np.asarray(b))
    numbers = a.dtype.kind not in "US" and b.dtype.kind not in "US"
    return a.shape == b.shape and np.array_equal(a, b, equal_nan=numbers)


def compare(file, program):
    """Differences between the two readings of a file, and how many numbers agree."""
    ours = subprocess.run([program, "dump", file], capture_output=True, text=True)
    try:
        theirs = pyuff.UFF(file)
        kinds = theirs.get_set_types()
    except Exception as error:
        return [f"pyuff: {error}"], 0
    if ours.returncode:
        return [f"misfit: {ours.stderr.strip()}"], 0
    ours, wrong, count = json.loads(ours.stdout), [], 0
    if [int(k) for k in kinds] != [s["type"] for s in ours]:
        return [f"sets {[int(k) for k in kinds]} against {[s['type'] for s in ours]}"], 0
    for i, s in enumerate(ours):
        if s["type"] not in KEYS and s["type"] not in (151, 2412):
            continue
        try:
            peer = theirs.read_sets(i)
        except Exception as error:
            wrong.append(f"set {i + 1} ({s['type']}): pyuff cannot read it: {error}")
            continue
        mine = s["content"]
        pairs = [(k, mine.get(k), peer.get(k)) for k in KEYS.get(s["type"], []) if k in peer]
        if s["type"] == 58:
            pairs.append(("data", number(mine["data"]), peer["data"]))
            # numpy's arange accumulates rounding, and may end one step late.
            x = np.asarray(peer["x"])[: len(mine["x"])]
            near = np.allclose(mine["x"], x, rtol=1e-12, atol=1e-12 * (np.abs(x).max() if len(x) else 1))
            pairs.append(("x", near, True))
        if s["type"] == 55:
            columns = [c for c in ("r1", "r2", "r3", "r4", "r5", "r6") if c in peer]
            pairs += [(c, [number(v)[j] for v in mine["values"]], peer[c]) for j, c in enumerate(columns)]
        if s["type"] == 2414 and "x" in peer:
            pairs += [(c, [number(v)[j] for v in mine["values"]], peer[c]) for j, c in enumerate("xyz")]
        if s["type"] == 151:
            pairs += [("model_name", mine["model_name"], peer["model_name"].strip())]
        if s["type"] == 2412:
            sorted_rows = lambda rows: sorted(tuple(int(n) for n in r) for r in rows)
            theirs_nodes = [r for kind in peer.values() if isinstance(kind, dict) for r in np.asarray(kind["nodes_nums"])]
            theirs_nodes += [r for kind in peer.values() if isinstance(kind, list) for e in kind for r in [e.get("nodes_nums", [])]]
            pairs += [("nodes", sorted_rows(mine["nodes"]) == sorted_rows(theirs_nodes), True)]
        for key, a, b in pairs:
            count += np.size(b)
            if not same(a, b):
                wrong.append(f"set {i + 1} ({s['type']}): {key} differs: {str(a)[:60]} against {str(b)[:60]}")
        for text in mine.get("findings", []):
            print(f"      set {i + 1}: {text}")
    return wrong, count


def header(kind, ordinate, points, binary_bytes=None):
    first = f"{58:6d}" + (f"b{1:6d}{2:6d}{11:12d}{binary_bytes:12d}{0:6d}{0:6d}{0:12d}{0:12d}" if binary_bytes else "")
    axis = lambda k, label, unit: f"{k:10d}{0:5d}{0:5d}{0:5d} {label:<20s} {unit:<20s}\n"
    return (
        f"    -1\n{first}\n" + "NONE\n" * 5 + f"{kind:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10s}{1:10d}{3:4d} {'NONE':<10s}{1:10d}{3:4d}\n"
        + f"{ordinate:10d}{points:10d}{1:10d}{0:13.5e}{0.5:13.5e}{0:13.5e}\n"
        + axis(18, "Frequency", "Hz") + axis(12, "Acceleration", "m/s2") + axis(13, "Force", "N") + axis(0, "NONE", "NONE")
    )


def write(folder, form):
    rng, name = np.random.default_rng(1), f"{folder}/{form}.uff"
    with open(name, "wb") as f:
        for _ in range(40):
            h = rng.normal(size=20_000)
            if form == "ascii":
                f.write(header(4, 5, 10_000).encode())
                rows = h[: len(h) // 6 * 6].reshape(-1, 6)
                f.write("".join("".join(f"{v:13.5e}" for v in r) + "\n" for r in rows).encode())
                f.write(("".join(f"{v:13.5e}" for v in h[len(h) // 6 * 6 :]) + "\n").encode())
            else:
                double = form == "58b double"
                f.write(header(4, 6 if double else 5, 10_000, (8 if double else 4) * len(h)).encode())
                f.write(struct.pack(f"<{len(h)}{'d' if double else 'f'}", *h))
            f.write(b"    -1\n")
    return name


def main():
    program, folders = os.environ.get("MISFIT_UFF") or binary("uff"), sys.argv[1:] or ["../shared/data/uff"]
    failed = False
    for file in sorted(f for d in folders for e in ("uff", "unv", "UFF", "UNV") for f in glob.glob(f"{d}/**/*.{e}", recursive=True)):
        wrong, count = compare(file, program)
        print(f"{os.path.basename(file):44s} {count:9d} numbers " + ("equal" if not wrong else ""))
        for line in wrong:
            print(f"      {line}")
        failed |= bool(wrong)
    print(f"\n{'file':12s} {'MB':>7s} {'pyuff, s':>9s} {'MB/s':>7s} {'misfit, s':>10s} {'MB/s':>8s} {'ratio':>7s}   (best of {ROUNDS} rounds in turn)")
    with tempfile.TemporaryDirectory() as folder:
        for form in ("ascii", "58b double", "58b single"):
            file = write(folder, form)
            wrong, _ = compare(file, program)
            failed |= bool(wrong)
            product = subprocess.Popen([program, "time", file], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            ours, theirs = [], []
            for _ in range(ROUNDS):
                clock = time.perf_counter()
                pyuff.UFF(file).read_sets()
                theirs.append(time.perf_counter() - clock)
                product.stdin.write("\n")
                product.stdin.flush()
                ours.append(float(product.stdout.readline()))
            product.stdin.close()
            size = os.path.getsize(file) / 1e6
            a, b = min(theirs), min(ours)
            print(f"{form:12s} {size:7.1f} {a:9.3f} {size / a:7.1f} {b:10.4f} {size / b:8.0f} {a / b:6.1f}x" + ("" if not wrong else f"   DIFFERS {wrong[:2]}"))
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
