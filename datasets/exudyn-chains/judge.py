"""Runs `misfit ladder` over the cases of make.py and holds what it says against truth.json.

python judge.py DIR [--misfit PATH] [--max-seconds 300] [--threads N] [--case case-00 ...] [--reuse] [--places]
"""
import argparse
import glob
import json
import os
import re
import statistics
import subprocess
import time

# Laws that are one law where a linear spring stands beside them.
SAME = [{"contact", "bilinear_stiffness"}]
# Places of a body against the ground that are places of a connector.
ALIAS = {"P.x": "device.x", "tip.y": "shelf.y"}


def places(at):
    """`GF1-3.psi,GF20.psi` as a set of single places."""
    out = set()
    for one in at.split(","):
        one = ALIAS.get(one.strip(), one.strip())
        run = re.fullmatch(r"([A-Za-z]+)(\d+)-(\d+)\.(\w+)", one)
        out |= {f"{run[1]}{k}.{run[4]}" for k in range(int(run[2]), int(run[3]) + 1)} if run else {one}
    return frozenset(out)


def same_law(a, b):
    return a == b or any(a in s and b in s for s in SAME)


def is_truth(effect, at, truth):
    return same_law(effect, truth["effect"]) and places(at) == places(truth["at"])


def said(entry):
    """An entry of `missing` as (effect, place), itself first, then what it is tied with."""
    ties = [t.split(" at ", 1) for t in entry["tied_with"] if " at " in t]
    return [(entry["effect"], entry["at"])] + [tuple(t) for t in ties]


def matched(entry, truths, ties=True):
    """Index of the truth that an entry names, or None."""
    names = said(entry) if ties else said(entry)[:1]
    for k, t in enumerate(truths):
        if any(is_truth(e, at, t) for e, at in names):
            return k
    return None


def named(folder):
    """A copy of the study beside it that names places in [search], as an engineer would: the two groups in bending, shelf, device.

    It is the same list for every case, whatever is hidden; one bending joint is not in it.
    """
    with open(os.path.join(folder, "study.toml")) as f:
        text = f.read()
    groups = re.findall(r'effect = "viscous"\nat = (.+)', text)
    found = [",".join(re.findall(r'"([^"]+)"', g)) for g in groups]
    copy = os.path.join(folder, "named")
    os.makedirs(copy, exist_ok=True)
    text = text.replace('dataset = "data"', 'dataset = "../data"')
    listed = ", ".join(f'"{p}"' for p in found)
    with open(os.path.join(copy, "study.toml"), "w") as f:
        f.write(text.replace("[split]", f"[search]\nplaces = [{listed}]\n\n[split]", 1))
    return copy


def run(folder, options):
    """The result of a new or of the last ladder, and its wall time [s]; None where the program gave none."""
    folder = named(folder) if options.places else folder
    before = set(glob.glob(os.path.join(folder, "runs", "*-ladder")))
    start = time.time()
    if not (options.reuse and before):
        command = [options.misfit, "ladder", folder, "--max-seconds", str(options.max_seconds), "--threads", str(options.threads), "--out",
                   os.path.join(folder, "runs", time.strftime("%Y%m%d-%H%M%S-ladder"))]
        with open(os.path.join(folder, "ladder.log"), "w") as log:
            subprocess.run(command, stdout=log, stderr=subprocess.STDOUT, check=False)
    wall = time.time() - start
    files = sorted(glob.glob(os.path.join(folder, "runs", "*-ladder", "result.json")))
    if not files:
        return None, wall
    with open(files[-1]) as f:
        result = json.load(f)
    return result, result["wall_s"] if options.reuse else wall


def judged(case, result, wall):
    """One row of the table."""
    truths = case["effects"]
    if result is None:
        return {"case": case["case"], "truth": truths, "ok": False, "tied": False, "false": 0, "instruments": 0, "all": False, "ratio": None,
                "before": None, "s": wall, "text": "no result", "verdict": "-", "interrupted": True, "missed": truths, "result": None}
    missing, held = result["missing"], result["held_out"]
    named = {matched(m, truths) for m in missing} - {None}
    over = lambda x: None if x is None or not held["floor"] else x / held["floor"]
    text = "; ".join(f"{m['effect']} at {m['at']}" + (f" (tied: {', '.join(m['tied_with'])})" if m["tied_with"] else "") for m in missing)
    none = not truths and not missing and result["verdict"] == "nothing_missing"
    return {
        "case": case["case"], "truth": truths, "verdict": result["verdict"], "interrupted": result["interrupted"], "s": wall,
        "ok": none or bool(missing and matched(missing[0], truths, ties=False) is not None),
        "tied": none or bool(missing and matched(missing[0], truths) is not None),
        "all": none or bool(truths) and len(named) == len(truths),
        "false": sum(matched(m, truths) is None for m in missing), "instruments": len(result["instruments"]),
        "before": over(held["before"]), "ratio": over(held["after"]), "text": text or "-", "result": result,
        "missed": [t for k, t in enumerate(truths) if k not in named],
    }


def reasons(row):
    """For every effect that was missed: what became of it as a candidate, rung by rung."""
    for t in row["missed"]:
        print(f"    missed {t['effect']} at {t['at']} ({t['visibility']:.1f} sigma in {t['seen_in']}):")
        for k, rung in enumerate(row["result"]["rungs"] if row["result"] else []):
            e = rung["effort"]
            added = rung["added"] and f"{rung['added']['effect']} at {rung['added']['at']}"
            print(f"      rung {k} ({added or 'base'}): {e['trials']} shapes scored in {e['score_s']:.0f} s, {e['refits']} refits in {e['refits_s']:.0f} s")
            there = [(n, c) for n, c in enumerate(rung["candidates"]) if is_truth(c["effect"], c["at"], t)]
            for n, c in there:
                print(f"        candidate {n + 1} of {len(rung['candidates'])}, {c['effect']}: error after {c['error_after']}, {c['remark']}")
            if not there:
                print(f"        not among the {len(rung['candidates'])} candidates")


def number(x):
    return "-" if x is None else f"{x:.2f}"


def table(rows):
    head = ("case", "truth", "found", "first", "false", "instr.", "held-out/floor before", "after", "s", "verdict")
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for r in rows:
        truth = "; ".join(f"{t['effect']} at {t['at']}" for t in r["truth"]) or "nothing"
        first = "right" if r["ok"] else "tied" if r["tied"] else "wrong"
        cells = (r["case"], truth, r["text"], first, str(r["false"]), str(r["instruments"]), number(r["before"]), number(r["ratio"]), f"{r['s']:.0f}",
                 r["verdict"] + (", interrupted" if r["interrupted"] else ""))
        print("| " + " | ".join(cells) + " |")


def summary(rows):
    hiding = [r for r in rows if r["truth"]]
    two = [r for r in rows if len(r["truth"]) == 2]
    ratios = [r["ratio"] for r in rows if r["ratio"] is not None]
    print(f"\nFirst named is hidden: {sum(r['ok'] for r in hiding)} of {len(hiding)}, counting declared ties {sum(r['tied'] for r in hiding)}.")
    print(f"Both of two: {sum(r['all'] for r in two)} of {len(two)}. Nothing hidden and nothing named: "
          f"{sum(r['ok'] for r in rows if not r['truth'])} of {sum(not r['truth'] for r in rows)}.")
    print(f"Effects named that are not there: {sum(r['false'] for r in rows)}; instruments: {sum(r['instruments'] for r in rows)}.")
    if ratios:
        print(f"Held-out error over floor: median {statistics.median(ratios):.2f}, largest {max(ratios):.2f}.")
    print(f"Seconds: median {statistics.median(r['s'] for r in rows):.0f}, largest {max(r['s'] for r in rows):.0f}.")


def main():
    a = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    a.add_argument("folder")
    a.add_argument("--misfit", default="misfit")
    a.add_argument("--max-seconds", type=int, default=300)
    a.add_argument("--threads", type=int, default=1)
    a.add_argument("--case", nargs="*")
    a.add_argument("--reuse", action="store_true", help="judge the last run of a case where there is one")
    a.add_argument("--places", action="store_true", help="runs a copy of each study that names the groups, the shelf and the device under [search]")
    options = a.parse_args()
    with open(os.path.join(options.folder, "truth.json")) as f:
        cases = [c for c in json.load(f)["cases"] if not options.case or c["case"] in options.case]
    rows = []
    for case in cases:
        rows.append(judged(case, *run(os.path.join(options.folder, case["case"]), options)))
        print(f"{case['case']}: {rows[-1]['text']}, {rows[-1]['s']:.0f} s", flush=True)
        reasons(rows[-1])
    print()
    table(rows)
    summary(rows)


if __name__ == "__main__":
    main()
