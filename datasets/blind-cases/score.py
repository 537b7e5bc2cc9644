#!/usr/bin/env python3
"""score.py RESULTS [truth.json]: RESULTS holds case-NN.json as printed by `misfit ladder case-NN --json`."""
import json, sys, os, statistics
# The laws hidden here and the names of the program that are the same law. Everything else counts only where the program itself declares the tie (tied_with).
SAME = {
    "coulomb": ["coulomb"],
    "elastic_slip": ["elastic_slip"],
    "iwan": ["iwan"],                                       # hidden: 24 sliders, uniform strengths
    "bouc_wen": ["bouc_wen"],
    "lugre": ["lugre"],
    "stribeck": ["stribeck", "lugre"],                      # hidden: LuGre with bristles of 0.4 % of the travel, which is Stribeck's friction
    "wedge_friction": ["wedge_friction"],
    "quadratic_damping": ["quadratic_damping"],
    "maxwell": ["maxwell"],
    "structural_damping": ["structural_damping"],
    "asymmetric_damping": ["asymmetric_damping"],
    "digressive_damping": ["digressive_damping", "smooth_coulomb"],   # hidden: F tanh(v/vd), to the letter the equation of smooth_coulomb
    "cubic_stiffness": ["cubic_stiffness"],
    "quadratic_stiffness": ["quadratic_stiffness"],
    "saturating_stiffness": ["saturating_stiffness"],       # hidden: tanh in place of x/sqrt(1+x^2)
    "two_sided_stop": ["contact", "hunt_crossley"],         # hunt_crossley is contact with its loss on the way out
    "one_sided_contact": ["contact", "hunt_crossley", "bilinear_stiffness"],   # a linear spring beyond a gap is a bilinear spring beside the base's
    "bilinear_stiffness": ["bilinear_stiffness", "contact", "hunt_crossley"],  # hidden: a spring that acts to one side only, gap 0: the same two laws
    "hertz": ["contact", "hunt_crossley"],                  # exponent 3/2
    "backlash": ["backlash"],
    "preload": ["preload"],
}

def split(s):
    e, _, p = s.partition(" at ")
    return e.strip(), p.strip()

def near(place, truth):                                     # `c1-4.x` or a list is not the place; only the same axis is
    return place == truth

def names(m):
    strict = [(m["effect"], m["at"])]
    ties = [(t["effect"], t["at"]) if isinstance(t, dict) else split(t) for t in m.get("tied_with", [])]
    return strict, [(e, p or m["at"]) for e, p in ties]

def hit(t, cands):
    return any(e in SAME[t["law"]] and near(p, t["at"]) for e, p in cands)

def main():
    folder = sys.argv[1]; here = os.path.dirname(os.path.abspath(__file__))
    truth = json.load(open(sys.argv[2] if len(sys.argv) > 2 else os.path.join(here, "truth.json")))["cases"]
    G = {}; walls = []
    def count(g, key, n=1): G.setdefault(g, {}); G[g][key] = G[g].get(key, 0)+n
    for name, c in sorted(truth.items()):
        g = c["group"]; hidden = c["truth"]; path = os.path.join(folder, name+".json")
        txt = "; ".join(f"{t['law']} at {t['at']}" for t in hidden) or "nothing"
        try: j = json.load(open(path))
        except Exception as e: print(f"{name} {g:9} | {txt} | NO RESULT ({type(e).__name__})"); count(g, "no result"); continue
        if "error" in j: print(f"{name} {g:9} | {txt} | ERROR {j['error'].get('message')}"); count(g, "no result"); continue
        miss = j.get("missing", []); verdict = j["verdict"]; wall = j.get("wall_s") or 0; walls.append(wall)
        said = "; ".join(f"{m['effect']} at {m['at']}"+("" if m.get("proven", True) else " (unproven)")+(f" [tied: {', '.join(x[0]+(' at '+x[1] if x[1] != m['at'] else '') for x in names(m)[1])}]" if names(m)[1] else "") for m in miss) or "-"
        inst = "; ".join(f"{m['effect']} at {m['at']}" for m in j.get("instruments", []))
        used = set(); strict = ties = 0
        # first strict matches, then those by a tie; every statement serves one truth
        got = {}
        for how in (0, 1):
            for a, t in enumerate(hidden):
                if a in got: continue
                for b, m in enumerate(miss):
                    s, ti = names(m)
                    if b not in used and hit(t, s if how == 0 else s+ti): got[a] = how; used.add(b); break
        strict = sum(1 for h in got.values() if h == 0); ties = len(got); false = len(miss)-len(used)
        place = sum(1 for t in hidden if any(near(m["at"], t["at"]) for m in miss))
        h = len(hidden)
        if h == 1: mark = "right" if strict and not false else "right, by a tie" if ties and not false else "right, and more" if ties else "place right, law wrong" if place else "wrong" if miss else ("unexplained" if verdict == "unexplained" else "missed")
        elif h == 2: mark = f"{ties} of 2"+(f" ({strict} strictly)" if strict != ties else "")+(f", {false} false" if false else "")
        else: mark = "quiet" if verdict == "nothing_missing" and not miss else "named" if miss else verdict
        ho = j.get("held_out") or {}; pr = j.get("proven")
        print(f"{name} {g:9} {c['model']:19} miss {100*c['miss']:5.1f} % | {txt} | {said} | {verdict}{' proven' if pr else ''}{' INTERRUPTED' if j.get('interrupted') else ''} | {mark}"
              + (f" | instruments: {inst}" if inst else "") + (f" | corrections: {len(j['corrections'])}" if j.get("corrections") else "")
              + (f" | held out {ho.get('before') or 0:.3f} -> {ho.get('after') or 0:.3f}, floor {ho.get('floor') or 0:.3f}" if ho else "") + f" | {wall:.0f} s")
        count(g, "cases"); count(g, "false effects", false); count(g, "instruments named", len(j.get("instruments", [])))
        if h == 1:
            count(g, "single"); count(g, "single strict", int(strict == 1)); count(g, "single ties", int(ties == 1)); count(g, "single alone", int(ties == 1 and not false)); count(g, "single place", place)
            count(g, "single unexplained", int(verdict == "unexplained"))
        elif h == 2:
            count(g, "two"); count(g, "two both", int(ties == 2)); count(g, "two both strict", int(strict == 2)); count(g, "two one", int(ties == 1)); count(g, "two none", int(ties == 0))
        else:
            count(g, "quiet"); count(g, "quiet named", int(bool(miss))); count(g, "quiet unexplained", int(verdict == "unexplained" and not miss))
    print()
    tot = {}
    for g in G.values():
        for k, v in g.items(): tot[k] = tot.get(k, 0)+v
    for g, d in [*G.items(), ("all", tot)]:
        x = lambda k: d.get(k, 0)
        print(f"{g:9}: single effects found with ties {x('single ties')} of {x('single')}, strictly {x('single strict')}, with nothing false beside {x('single alone')}, place right {x('single place')}, verdict unexplained {x('single unexplained')}; "
              f"two: both {x('two both')} of {x('two')} (strictly {x('two both strict')}), one {x('two one')}, none {x('two none')}; "
              f"quiet: {x('quiet')-x('quiet named')-x('quiet unexplained')} of {x('quiet')} right, named {x('quiet named')}, unexplained {x('quiet unexplained')}; "
              f"false effects {x('false effects')} in {x('cases')} cases ({x('false effects')/max(x('cases'), 1):.2f} a case), instruments named {x('instruments named')}"+(f"; no result {x('no result')}" if x('no result') else ""))
    if walls: print(f"wall: median {statistics.median(walls):.0f} s, longest {max(walls):.0f} s, sum {sum(walls):.0f} s")

main()
