import os, sys, json, time
os.environ.setdefault("OMP_NUM_THREADS", "1")
import numpy as np
from scipy.optimize import least_squares
import core

FRIC = ["coulomb", "elastic_slip", "iwan", "bouc_wen", "lugre", "stribeck", "wedge_friction"]
DAMP = ["quadratic_damping", "maxwell", "structural_damping", "asymmetric_damping", "digressive_damping"]
STIF = ["cubic_stiffness", "two_sided_stop", "one_sided_contact", "backlash", "hertz", "saturating_stiffness", "quadratic_stiffness", "bilinear_stiffness"]
NST = {0: 0, 1: 1, 3: 1, 4: 1, 9: 1, 11: 1}
SMOOTH = {"cubic_stiffness", "quadratic_damping", "maxwell", "structural_damping", "elastic_slip", "iwan", "bouc_wen", "saturating_stiffness", "quadratic_stiffness", "lugre"}
lu = lambda r, a, b: float(np.exp(r.uniform(np.log(a), np.log(b))))

def shape(law, r):
    u = {}
    if law == "elastic_slip": u["d"] = lu(r, .08, .4)
    if law == "iwan": u["d"] = lu(r, .1, .4)
    if law == "bouc_wen": u.update(d=lu(r, .08, .4), n=float(r.uniform(1, 2)), beta=float(r.uniform(.4, .8)))
    if law == "lugre": u.update(d=lu(r, .02, .1), fs=float(r.uniform(1.2, 1.8)), vs=lu(r, .3, 1.5))
    if law == "stribeck": u.update(d=.004, fs=float(r.uniform(1.4, 2.)), vs=lu(r, .3, 1.5))
    if law == "two_sided_stop": u["g"] = float(r.uniform(.4, .8))
    if law == "one_sided_contact": u.update(g=float(r.uniform(.2, .7)), side=float(r.choice([-1, 1])))
    if law == "hertz": u.update(g=float(r.uniform(0, .3)), side=float(r.choice([-1, 1])))
    if law == "bilinear_stiffness": u["side"] = float(r.choice([-1, 1]))
    if law == "asymmetric_damping": u["side"] = float(r.choice([-1, 1]))
    if law == "preload": u["side"] = float(r.choice([-1, 1]))
    if law == "maxwell": u["tau"] = lu(r, .5, 2)
    if law == "saturating_stiffness": u["qs"] = float(r.uniform(.2, .5))
    if law == "digressive_damping": u["vd"] = lu(r, .2, .8)
    return u

def build(law, u, s, k, q, vr, w):
    """elements [(type, P)], small-signal stiffness(w), play, physical parameters"""
    F = s*k*q; P = [0.]*6
    def el(t, *p): return [(t, list(p)+[0.]*(6-len(p)))]
    if law == "coulomb": d = .004*q; return el(1, F/d, F), None, 0, {"f": F}
    if law == "elastic_slip": d = u["d"]*q; return el(1, F/d, F), lambda W: F/d, 0, {"f": F, "d": d}
    if law == "iwan": kt = F/(u["d"]*q); return el(2, kt, F, 24), lambda W: kt, 0, {"f": F, "k": kt}
    if law == "bouc_wen": d = u["d"]*q; return el(3, F, d, u["n"], u["beta"], 1-u["beta"]), lambda W: F/d, 0, {"f": F, "d": d, "n": u["n"], "beta": u["beta"]}
    if law in ("lugre", "stribeck"):
        d = u["d"]*q; s1 = .05*F/vr if law == "lugre" else 0.
        return el(4, F/d, s1, F, F*u["fs"], u["vs"]*vr), lambda W: F/d+1j*W*s1, 0, {"f": F, "d": d, "fs": F*u["fs"], "vs": u["vs"]*vr}
    if law == "wedge_friction": return el(11, s*k, .004*q), None, 0, {"mu_k": s*k}
    if law == "cubic_stiffness": return el(5, s*k/q**2), lambda W: 0, 0, {"k3": s*k/q**2}
    if law == "two_sided_stop": return el(6, s*k, u["g"]*q), None, 0, {"k": s*k, "gap": u["g"]*q}
    if law == "one_sided_contact": return el(7, s*k, u["g"]*q, 1., u["side"]), None, 0, {"k": s*k, "gap": u["g"]*q, "side": u["side"]}
    if law == "hertz": kh = s*k/np.sqrt(q); return el(7, kh, u["g"]*q, 1.5, u["side"]), None, 0, {"k": kh, "gap": u["g"]*q, "side": u["side"]}
    if law == "bilinear_stiffness": return el(7, s*k, 0., 1., u["side"]), None, 0, {"k": s*k, "side": u["side"]}
    if law == "backlash": return [], None, s*q, {"gap": s*q}
    if law == "quadratic_damping": return el(8, F/vr**2), lambda W: 0, 0, {"c": F/vr**2}
    if law == "maxwell": k1 = s*k; c1 = k1*u["tau"]/w; return el(9, k1, c1), lambda W: k1*1j*W*c1/(k1+1j*W*c1), 0, {"k": k1, "c": c1}
    if law == "structural_damping": return [], lambda W: 1j*s*k, 0, {"h": s*k}
    if law == "preload": return el(10, F*u["side"]), None, 0, {"f": F*u["side"]}
    if law == "saturating_stiffness": return el(12, s*k, u["qs"]*q), lambda W: s*k, 0, {"k": s*k, "qs": u["qs"]*q}
    if law == "quadratic_stiffness": return el(13, s*k/q), lambda W: 0, 0, {"k2": s*k/q}
    if law == "asymmetric_damping": return el(14, F/vr, u["side"]), None, 0, {"c": F/vr, "side": u["side"]}
    if law == "digressive_damping": vd = u["vd"]*vr; return el(15, F, vd), None, 0, {"f": F, "vd": vd}
    raise KeyError(law)

def nstates(t, P): return int(P[2]) if t == 2 else NST.get(t, 0)

def pack(els):
    """els: (type, a, b, P)"""
    T = np.array([e[0] for e in els]); A = np.array([e[1] for e in els]); B = np.array([e[2] for e in els])
    P = np.array([e[3] for e in els], float)
    off = np.concatenate([[0], np.cumsum([nstates(e[0], e[3]) for e in els])]).astype(np.int64)
    return T.astype(np.int64), A.astype(np.int64), B.astype(np.int64), P, off

def ar(r, n, rho):
    e = r.standard_normal(n)
    if rho == 0: return e
    y = np.empty(n); y[0] = e[0]
    for i in range(1, n): y[i] = rho*y[i-1]+np.sqrt(1-rho**2)*e[i]
    return y

def nice(x, n=2): return float(f"{x:.{n}g}")

def rms(x): return np.sqrt(np.mean(np.abs(x)**2))

class Sensors:
    def __init__(s, r, per_test): s.r, s.per_test, s.g = r, per_test, {}
    def gain(s, key):
        if s.per_test or key not in s.g: s.g[key] = 1+float(np.clip(s.r.normal(0, .004), -.01, .01))
        return s.g[key]

def write(dirn, title, tests, study, split):
    os.makedirs(dirn+"/data", exist_ok=True)
    o = ["schema = 1", f'title = "{title}"', ""]
    for t in tests:
        o.append("[[test]]")
        for key in ("id", "kind", "file", "control", "conditions", "discard_cycles", "excite", "respond", "quantity", "excitation", "noise"):
            if key in t:
                val = t[key]
                if key == "conditions": val = "{ "+", ".join(f'{a} = "{b}"' for a, b in val.items())+" }"; o.append(f"{key} = {val}")
                elif isinstance(val, int): o.append(f"{key} = {val}")
                else: o.append(f'{key} = "{val}"')
        o.append("channels = [")
        for c in t["channels"]:
            o.append(" { "+", ".join(f"{a} = {'true' if b is True else b if isinstance(b, int) else chr(34)+b+chr(34)}" for a, b in c.items())+" },")
        o.append("]\n")
        cols = t["cols"]; H = ",".join(cols); D = np.column_stack(list(cols.values()))
        np.savetxt(f"{dirn}/data/{t['file']}", D, fmt=["%.9g" if n in ("t", "f") else "%.6g" for n in cols], delimiter=",", header=H, comments="")
    open(dirn+"/data/dataset.toml", "w").write("\n".join(o))
    sp = ", ".join(f"{a} = [{', '.join(chr(34)+x+chr(34) for x in b)}]" for a, b in split.items() if b)
    open(dirn+"/study.toml", "w").write(f'schema = 1\ntitle = "{title}"\ndataset = "data"\n'+(f"split = {{ {sp} }}\n" if sp else "")+study)

def eff(name, at, p, val, unit, off):
    return f'\n[[effect]]\neffect = "{name}"\nat = {at}\n{p} = {{ start = "{nice(val*off, 3):g} {unit}", min = "0 {unit}" }}\n'

def start(r): return 1+float(r.choice([-1, 1]))*float(r.uniform(.1, .4))

def stress(r): return float(np.exp(r.uniform(np.log(.03), np.log(.40))))

# ------------------------------------------------------------------ a connector without mass under a prescribed displacement
def massless(r, dirn, title, laws, opt):
    k = lu(r, 5e3, 3e5); A = lu(r, .2e-3, 4e-3)
    fm = lu(r, 1, 5)                               # Hz, middle of the frequencies
    nl = int(r.integers(6, 10))
    fr = fm*np.exp(np.linspace(np.log(.15), np.log(5), nl)); am = np.array([1, .35, .7, .2, 1.15, .5, .85, .3, 1.0])[:nl]
    fr = [nice(x, 2) for x in r.permutation(fr)]; am = [float(f"{nice(a*A*1e3, 2):g}")*1e-3 for a in am]
    c = k*lu(r, .01, .08)/(2*np.pi*fm)
    q = max(am); vr = float(np.exp(np.mean(np.log([a*2*np.pi*f for a, f in zip(am, fr)])))); w = 2*np.pi*fm
    shapes = [shape(l, r) for l in laws]
    spc = int(r.choice([64, 100, 128, 200])); ncy = int(r.integers(4, 8)); disc = 2
    with_rec = opt["record"] and "structural_damping" not in laws
    def elements(ss, km=1., cm=1.):
        els = []; play = 0.; hh = 0.; phys = []
        for l, u, s in zip(laws, shapes, ss):
            if s == 0: continue
            e, small, g, ph = build(l, u, s, k, q, vr, w); play += g; phys.append(ph)
            if l == "structural_damping": hh += s*k
            els += [(t, -1, 0, P) for t, P in e]
        return [(0, -1, 0, [k*km, c*cm, play, 0, 0, 0])]+els, hh, phys
    def loop(ss, f, a, km=1., n=spc, cyc=3):
        els, hh, _ = elements(ss, km); T, _, _, P, off = pack(els)
        nsub = int(np.ceil(6000/n)); h = 1/f/n/nsub; th = np.arange(2*n*cyc*nsub+3)*h/2
        x = a*np.sin(2*np.pi*f*th); v = a*2*np.pi*f*np.cos(2*np.pi*f*th); F = np.zeros(n*cyc)
        core.path(T, P, off, x, v, n*cyc, nsub, h, F)
        t = np.arange(n*cyc)/f/n
        return t, a*np.sin(2*np.pi*f*t), a*2*np.pi*f*np.cos(2*np.pi*f*t), F+hh*a*np.cos(2*np.pi*f*t)
    def miss(ss):
        R, Y, I = [], [], []
        for f, a in zip(fr, am):
            t, x, v, F = loop(ss, f, a, cyc=disc+1); sl = slice(disc*spc, None); F = F[sl]; sc = rms(F-F.mean())
            R.append(np.column_stack([x[sl], v[sl]])/sc); Y.append(F/sc)
        S = np.linalg.norm(np.vstack(R), axis=0); co = np.linalg.lstsq(np.vstack(R)/S, np.concatenate(Y), rcond=None)[0]/S
        return max(rms(y-x@np.maximum(co, 0)) for x, y in zip(R, Y))
    for attempt in range(8):
        ss, good = strengths(r, laws, miss)
        if good: break
        shapes = [shape(l, r) for l in laws]
    els, hh, phys = elements(ss)
    p = opt["noise"]; tests = []; sen = Sensors(r, opt["gain_per_test"])
    for i, (f, a) in enumerate(zip(fr, am)):
        km = 1+(.005*r.standard_normal() if opt["scatter"] else 0); cyc = disc+ncy
        t, x, v, F = loop(ss, f, a, km, cyc=cyc)
        F = F*sen.gain("F")+p*rms(F-F.mean())*ar(r, len(F), opt["rho"]); x = x*sen.gain("x")+.4*p*a*.7*ar(r, len(x), opt["rho"])
        id = f"loop-{f:g}Hz-{a*1e3:g}mm"
        tests.append(dict(id=id, kind="cycle", file=id+".csv", control="displacement", conditions={"frequency": f"{f:g} Hz"}, discard_cycles=disc,
            channels=[dict(role="time", column="t", unit="s"), dict(role="displacement", at="c1.x", column="x", unit="mm"), dict(role="force", at="c1.x", column="F", unit="N")],
            cols=dict(t=t, x=x*1e3, F=F)))
    ids = [t["id"] for t in tests]
    # select: another amplitude and another frequency; held out: a large loop in the middle of the frequencies
    order = np.argsort([abs(np.log(f/fm))-1.0*a/q for f, a in zip(fr, am)]); held = [ids[order[0]]]
    rest = [i for i in range(nl) if ids[i] not in held]
    sel = [ids[i] for i in r.choice([i for i in rest if am[i] < .95*q], size=2, replace=False)]
    if with_rec:
        N = 2000; ftop = 4*fm; Ts = 1/(ftop*16); kindr = r.choice(["sweep", "random"]); Tt = N*Ts
        nsub = 60; h = Ts/nsub; th = np.arange(2*N*nsub+3)*h/2; f0 = .2*fm
        if kindr == "sweep":
            b = np.log(ftop/f0)/Tt; ph = 2*np.pi*f0*(np.exp(b*th)-1)/b; W = 2*np.pi*f0*np.exp(b*th)
            env = 1-np.exp(-th/(.02*Tt)); de = np.exp(-th/(.02*Tt))/(.02*Tt)
            x = .8*A*env*np.sin(ph); v = .8*A*(env*W*np.cos(ph)+de*np.sin(ph))
        else:
            ff = np.linspace(f0, ftop*.6, 24)*(1+.05*r.uniform(-1, 1, 24)); pp = r.uniform(0, 2*np.pi, 24); aa = 1/(1+(ff/fm)**1.5)
            x = sum(a_*np.sin(2*np.pi*f_*th+p_) for a_, f_, p_ in zip(aa, ff, pp)); v = sum(a_*2*np.pi*f_*np.cos(2*np.pi*f_*th+p_) for a_, f_, p_ in zip(aa, ff, pp))
            env = 1-np.exp(-(th/(.01*Tt))**2); de = np.exp(-(th/(.01*Tt))**2)*2*th/(.01*Tt)**2
            v = v*env+x*de; x = x*env; sc = A/np.abs(x).max(); x *= sc; v *= sc
        km = 1+(.005*r.standard_normal() if opt["scatter"] else 0)
        els2, _, _ = elements(ss, km); T, _, _, P, off = pack(els2); F = np.zeros(N); core.path(T, P, off, x, v, N, nsub, h, F)
        xs = x[::2*nsub][:N]; F = F*sen.gain("F")+p*rms(F-F.mean())*ar(r, N, opt["rho"]); xs = xs*sen.gain("x")+3e-4*A*r.standard_normal(N)
        tests.append(dict(id="record", kind="transient", file="record.csv", control="displacement", noise=f"{nice(p*100, 2):g} %",
            channels=[dict(role="time", column="t", unit="s"), dict(role="displacement", at="c1.x", column="x", unit="mm", sigma=f"{nice(3e-4*A*1e3, 2):g} mm"),
                dict(role="force", at="c1.x", column="F", unit="N")], cols=dict(t=np.arange(N)*Ts, x=xs*1e3, F=F)))
        if r.uniform() < .5: held.append("record")
    study = '\n[[body]]\nname = "ground"\nfixed = true\n\n[[body]]\nname = "end"\nfree = ["x"]\n\n[[connector]]\nname = "c1"\nfrom = "ground"\nto = "end"\n'
    study += eff("linear_stiffness", '"c1.x"', "k", k*1e-3, "N/mm", start(r))+eff("viscous", '"c1.x"', "c", c*1e-3, "N s/mm", start(r))
    write(dirn, title, tests, study, dict(select=sel, held_out=held))
    return dict(truth=[dict(law=l, at="c1.x", strength=s, shape=u, parameters=ph) for l, s, u, ph in zip(laws, ss, shapes, phys)], model="massless connector",
        miss=miss(ss) if laws else 0, k=k, c=c, record=bool(with_rec))

CAP = {"wedge_friction": .5, "quadratic_stiffness": .35, "cubic_stiffness": 2., "one_sided_contact": 5., "two_sided_stop": 5., "hertz": 5., "bilinear_stiffness": 3., "backlash": .7, "maxwell": 2., "structural_damping": .6,
       "saturating_stiffness": 3., "preload": 1.}   # beyond these no engineer would still call the base model a base; others .6

def strengths(r, laws, miss):
    """each law's strength so that the base model fitted without it leaves the drawn error; with two laws, each alone, and less than 20 %"""
    ss = [0.]*len(laws); errors = []
    for i in range(len(laws)):
        want = stress(r) if len(laws) == 1 else float(np.exp(r.uniform(np.log(.05), np.log(.25))))
        lo, hi = np.log(1e-3), np.log(CAP.get(laws[i], .6))
        best = None
        for _ in range(9):
            mid = .5*(lo+hi); v = [0.]*len(laws); v[i] = np.exp(mid)
            e = miss(tuple(v))
            if not np.isfinite(e): e = 9.
            if best is None or abs(np.log(e/want)) < best[0]: best = (abs(np.log(e/want)), np.exp(mid), e)
            if best[0] < .05: break
            if e > want: hi = mid
            else: lo = mid
        ss[i] = float(best[1]); errors.append(best[2])
    return tuple(ss), all(.028 < e < .42 for e in errors)

# ------------------------------------------------------------------ chains of masses (n = 1: one connector with a mass)
def chain(r, dirn, title, laws, places, opt):
    n = opt["n"]; single = n == 1
    m0 = lu(r, .2, 3.); equal = r.uniform() < .65 or single
    mt = np.full(n, nice(m0, 2)) if equal else np.array([nice(m0*float(r.uniform(.7, 1.4)), 2) for _ in range(n)])
    nominal = mt.copy()
    if opt["mass_off"]:
        if r.uniform() < .5: mt = mt*(1+float(r.choice([-1, 1]))*float(r.uniform(.01, .02)))
        else: j = int(r.integers(n)); mt = mt.copy(); mt[j] *= 1+float(r.choice([-1, 1]))*float(r.uniform(.01, .02))
    kc = m0*(2*np.pi*lu(r, 25, 70))**2; own = (n <= 4 and r.uniform() < .5) and not single
    kb = kc*float(r.uniform(.6, 1.6))
    ks = np.array([kb]+[kc*(float(r.uniform(.6, 1.5)) if own else 1.) for _ in range(n-1)])
    def KM(kk, extra=None):
        K = np.zeros((n, n), complex if extra is not None else float)
        for j in range(n):
            K[j, j] += kk[j]
            if j: K[j-1, j-1] += kk[j]; K[j, j-1] -= kk[j]; K[j-1, j] -= kk[j]
        return K
    lam = np.linalg.eigvals(KM(ks)/mt[:, None]).real; wn = np.sqrt(np.sort(lam)); w1 = wn[0]; f1 = w1/2/np.pi
    zeta = lu(r, .012, .03); cs = ks*2*zeta/w1*np.array([float(r.uniform(.7, 1.5))]+[1.]*(n-1))
    groups = [[0]]+([[j] for j in range(1, n)] if own else ([list(range(1, n))] if n > 1 else []))
    names = ["c1" if single else "base"]+[f"c{j}" for j in range(1, n)]
    drive = n-1 if (n < 4 or r.uniform() < .8) else int(r.integers(2, n-1))
    place = [names.index(x) if x is not None else None for x in places]
    Fmax = nice(float(min(ks))*lu(r, .3e-3, 2e-3), 2)
    # loops
    relf = [.06, .2, .45, .75, .12, .3]; rela = [1., .4, .7, .25, .6, 1.3]; nl = int(r.integers(4, 7))
    perm = r.permutation(nl); lf = [nice(relf[i]*f1, 2) for i in range(nl)]; la = [nice(rela[i]*Fmax, 2) for i in perm]
    def Hlin(kk, cc, W, mm, ssfun=None):
        out = np.zeros((len(W), n), complex)
        for i, w in enumerate(W):
            kk2 = kk+1j*w*cc
            if ssfun:
                for j, fn in ssfun: kk2 = kk2.copy(); kk2[j] += fn(w)
            D = KM(kk2, 1)-w*w*np.diag(mm); e = np.zeros(n); e[drive] = 1
            out[i] = np.linalg.solve(D, e)
        return out
    def stretch(X, j): return X[..., j]-(X[..., j-1] if j else 0)
    HL = Hlin(ks, cs, [2*np.pi*f for f in lf], mt)
    st = np.array([[abs(stretch(HL[i], j))*la[i] for j in range(n)] for i in range(nl)])
    shapes = [shape(l, r) for l in laws]
    qr = [float(st[:, j].max()) for j in place]; vr = [float(.4*(st[:, j]*2*np.pi*np.array(lf)).max()) for j in place]
    wmid = float(np.sqrt(w1*wn[min(1, n-1)]))*.7
    linear = all(l in ("structural_damping", "maxwell", "preload") for l in laws)
    structural = "structural_damping" in laws
    def elements(ss, kk, cc):
        play = np.zeros(n); ex = []; small = []; phys = []
        for l, u, s, j, q, v in zip(laws, shapes, ss, place, qr, vr):
            if s == 0: continue
            e, sm, g, ph = build(l, u, s, ks[j], q, v, wmid); play[j] += g; phys.append(ph)
            ex += [(t, j-1, j, P) for t, P in e]
            if sm: small.append((j, sm))
        return [(0, j-1, j, [kk[j], cc[j], play[j], 0, 0, 0]) for j in range(n)]+ex, small, phys
    def tstep(els):
        kt = np.zeros(n); ct = np.zeros(n); rate = 0; qm = 1.5*max(list(qr)+[st.max()]); vm = 2*qm*wn[min(2, n-1)]
        for t, a, j, P in els:
            kt[j] += {0: P[0], 1: P[0], 2: P[0], 3: P[0]/(P[1] or 1), 4: P[0], 5: 3*P[0]*qm**2, 6: P[0], 7: P[0]*P[2]*qm**max(P[2]-1, 0), 9: P[0], 11: P[0]*qm/(P[1] or 1), 12: P[0], 13: 2*P[0]*qm}.get(t, 0)
            ct[j] += {0: P[1], 4: P[1], 8: 2*P[0]*min(vm, 2.5*np.sqrt(Fmax/max(P[0], 1e-30))), 14: P[0], 15: P[0]/(P[1] or 1)}.get(t, 0)
            if t == 3: rate = max(rate, vm/P[1])
            if t == 4: rate = max(rate, P[0]*vm/P[2])
            if t == 9: rate = max(rate, P[0]/P[1])
        wx = np.sqrt(np.abs(np.linalg.eigvals(KM(kt)/mt[:, None])).max()); rx = np.abs(np.linalg.eigvals(KM(ct)/mt[:, None])).max()
        return min(.25/wx, 1.5/rx if rx else 1, 1.5/rate if rate else 1)
    def loop(ss, f, F, kk, cc, spc, cyc):
        els, small, _ = elements(ss, kk, cc); w = 2*np.pi*f; t = np.arange(spc*cyc)/f/spc
        if structural:                             # linear, settled
            X = Hlin(kk, cc, [w], mt, small)[0]*F
            return t, np.imag(np.exp(1j*w*t)[:, None]*X[None, :])
        T, A, B, P, off = pack(els); nsub = int(np.ceil(1/f/spc/min(tstep(els), 1/f/400))); h = 1/f/spc/nsub
        Q = np.zeros((spc*cyc, n)); core.sine(T, A, B, P, off, mt, drive, F, w, 0., spc*cyc, nsub, h, np.zeros(n), np.zeros(n), np.zeros(off[-1]), Q)
        return t, Q
    def settle_cycles(f): return max(2, int(np.ceil(5.5/(zeta*w1)*f)))
    def frf(ss, F, W, kk, cc, settle=5.):
        """stepped sine with force F at every line, first harmonic of the response"""
        els, small, _ = elements(ss, kk, cc)
        if F is None or linear: return Hlin(kk, cc, W, mt, small)
        T, A, B, P, off = pack(els); h0 = tstep(els); q = np.zeros(n); v = np.zeros(n); z = np.zeros(off[-1]); ph = 0.; out = np.zeros((len(W), n), complex); E = np.zeros((0, n))
        for i, w in enumerate(W):
            per = 2*np.pi/w; ns = int(np.ceil(per/min(h0, per/120))); h = per/ns; c1 = int(np.ceil((settle/(zeta*w1))/per))+2
            core.sine(T, A, B, P, off, mt, drive, F, w, ph, c1, ns, h, q, v, z, E)
            C = core.sine(T, A, B, P, off, mt, drive, F, w, ph, 4, ns, h, q, v, z, E)
            out[i] = C*1j/F                        # sum q e^{-i(wt+ph)}*2/N is the phasor against e^{i}; the force F sin is -iF
        return out
    top = wn[-1] if n <= 4 else wn[min(3, n-1)]*1.15
    Wl = np.exp(np.linspace(np.log(.4*w1), np.log(1.15*top), 60 if single else 120)); Wl = 2*np.pi*np.round(Wl/2/np.pi, 2)
    Wc = np.unique(np.concatenate([wn[i]*np.array([.93, .98, 1., 1.03, 1.08]) for i in range(min(3, n))]))
    smooth = all(l in SMOOTH for l in laws); small_signal = (smooth or linear) and r.uniform() < .45 and not ("preload" in laws and len(laws) > 1)
    Ffrf = [None] if small_signal else ([nice(Fmax*lu(r, .04, .12), 2)] if (linear or r.uniform() < .4) else [nice(Fmax*lu(r, .012, .03), 2), nice(Fmax*lu(r, .06, .15), 2)])
    # sensors: places with displacement in the loops, and responses of the frequency responses
    others = [j for j in range(n) if j != drive]
    body = [drive]+([int(x) for x in r.choice(others, size=min(len(others), int(r.integers(1, 3))), replace=False)] if others else [])
    rel = [int(x) for x in r.choice(np.arange(1, n), size=int(r.integers(0, 3)) if n > 2 else 0, replace=False)] if n > 2 else []
    resp = [drive]+([int(r.choice(others))] if others else [])
    chans = [("b", j) for j in body]+[("r", j) for j in rel]
    def get(Q, ch): return Q[:, ch[1]] if ch[0] == "b" else Q[:, ch[1]]-Q[:, ch[1]-1]
    def miss(ss):
        D = []
        for f, a in zip(lf, la):
            sc = settle_cycles(f); t, Q = loop(ss, f, a, ks, cs, 64, sc+1); w = 2*np.pi*f; sl = slice(sc*64, None)
            D.append((w, a, t[sl], np.column_stack([get(Q, c) for c in chans])[sl]))
        Hs = [frf(ss, F, Wc, ks, cs, 3.)[:, resp] for F in Ffrf]
        if not all(np.isfinite(d[3]).all() for d in D): return np.inf
        def parts(lp):
            kk = np.zeros(n); cc = np.zeros(n); ng = len(groups)
            for gi, g in enumerate(groups): kk[g] = ks[g[0]]*np.exp(lp[gi]); cc[g] = cs[g[0]]*np.exp(lp[ng+gi])
            R = []; HL = Hlin(kk, cc, [d[0] for d in D], mt); HF = Hlin(kk, cc, Wc, mt)[:, resp]
            for i, (w, a, t, Y) in enumerate(D):
                X = np.imag(np.exp(1j*w*t)[:, None]*HL[i][None, :]*a); X = np.column_stack([get(X, c) for c in chans])
                R.append(((X-Y)/rms(Y-Y.mean(0))).ravel()/np.sqrt(Y.size))
            for H in Hs:
                for c in range(H.shape[1]): e = (HF-H)[:, c]/rms(H[:, c]); e = e*1.; R.append(np.concatenate([e.real, e.imag])/np.sqrt(len(e)))
            return R
        f = lambda lp: np.concatenate(parts(lp))
        so = least_squares(f, np.zeros(2*len(groups)), bounds=(-3, 3), max_nfev=25)
        return max(np.linalg.norm(x) for x in parts(so.x))
    for attempt in range(8):
        ss, good = strengths(r, laws, miss)
        if good: break
        shapes = [shape(l, r) for l in laws]; place = [int(r.integers(n)) for _ in laws]
        qr = [float(st[:, j].max()) for j in place]; vr = [float(.4*(st[:, j]*2*np.pi*np.array(lf)).max()) for j in place]
    els, small, phys = elements(ss, ks, cs); p = opt["noise"]; sen = Sensors(r, opt["gain_per_test"]); tests = []
    bn = ["mass"] if single else [f"m{j+1}" for j in range(n)]
    def vary():
        kk = ks.copy()
        if opt["scatter"]:
            for g in groups: kk[g] *= 1+.005*r.standard_normal()
        return kk
    at = lambda ch: f"{bn[ch[1]]}.x" if ch[0] == "b" else f"{names[ch[1]]}.x"
    for f, a in zip(lf, la):
        spc = int(r.choice([64, 100])); sc = settle_cycles(f); cyc = sc+int(r.integers(4, 7)); t, Q = loop(ss, f, a, vary(), cs, spc, cyc)
        cols = {"t": t}; ch = [dict(role="time", column="t", unit="s")]; F = a*np.sin(2*np.pi*f*t)
        cols["F"] = F*sen.gain("F")+.3*p*rms(F)*ar(r, len(F), opt["rho"]); ch.append(dict(role="force", at=f"{bn[drive]}.x", column="F", unit="N"))
        for i, c in enumerate(chans):
            y = get(Q, c); nm = f"x{c[1]+1}" if c[0] == "b" else f"d{c[1]}"
            cols[nm] = (y*sen.gain(c)+p*rms(y[sc*spc:]-y[sc*spc:].mean())*ar(r, len(y), opt["rho"]))*1e3; ch.append(dict(role="displacement", at=at(c), column=nm, unit="mm"))
        id = f"loop-{f:g}Hz-{a:g}N"
        tests.append(dict(id=id, kind="cycle", file=id+".csv", control="force", conditions={"frequency": f"{f:g} Hz"}, discard_cycles=sc, channels=ch, cols=cols))
    loops = [t["id"] for t in tests]; quantity = str(r.choice(["accelerance", "accelerance", "receptance"])); frfs = []
    av = int(r.integers(10, 40)); stated = r.uniform() < .3
    for lev, F in enumerate(Ffrf):
        H = frf(ss, F, Wl, vary(), cs)
        for j in resp:
            h = H[:, j]*(-Wl**2 if quantity == "accelerance" else 1)*sen.gain(("H", j))
            sg = p*.7*np.abs(h)+(0 if stated else .002*np.median(np.abs(h))); h = h+sg*(r.standard_normal(len(h))+1j*r.standard_normal(len(h)))
            sc, un = (1, "m/s2/N") if quantity == "accelerance" else (1e3, "mm/N"); id = f"frf-{bn[drive]}-{bn[j]}"+(f"-{F:g}N" if len(Ffrf) > 1 else "")
            T = dict(id=id, kind="frf", file=id+".csv", excite=f"{bn[drive]}.x", respond=f"{bn[j]}.x", quantity=quantity)
            if F is not None: T["excitation"] = f"{F:g} N"
            T["channels"] = [dict(role="frequency", column="f", unit="Hz"), dict(role="real", column="re", unit=un), dict(role="imag", column="im", unit=un)]
            T["cols"] = dict(f=Wl/2/np.pi, re=h.real*sc, im=h.imag*sc)
            if stated: T["noise"] = f"{nice(p*70, 2):g} %"
            else: T["channels"].append(dict(role="coherence", column="coh", averages=av)); T["cols"]["coh"] = 1/(1+2*av*(sg/np.abs(h))**2)
            tests.append(T); frfs.append(id)
    with_rec = opt["record"] and not structural
    if with_rec:
        fh = (wn[min(2, n-1)])/2/np.pi; kind = str(r.choice(["hammer", "sweep"])); fs = nice(fh*(24 if kind == "hammer" else 14), 2); N = 2200; Ts = 1/fs; kk = vary()
        e2, _, _ = elements(ss, kk, cs); T, A, B, P, off = pack(e2); nsub = int(np.ceil(Ts/min(tstep(e2), Ts/8))); h = Ts/nsub; th = np.arange(2*N*nsub+3)*h/2
        if kind == "hammer":
            tau = .55/fh; t0 = .03*N*Ts; ref = Fmax*lu(r, 1.5, 4)/ (w1*tau) if w1*tau < 1 else Fmax*2
            fo = np.where((th > t0) & (th < t0+tau), np.sin(np.pi*np.clip((th-t0)/tau, 0, 1))**2, 0.)*ref
        else:
            f0, f2 = .4*f1, 1.15*fh; Tt = N*Ts; fo = Fmax*lu(r, .1, .25)*np.sin(2*np.pi*(f0*th+.5*(f2-f0)/Tt*th*th))
        Q = np.zeros((N, n)); V = Q.copy(); AA = Q.copy(); core.record(T, A, B, P, off, mt, drive, fo, N, nsub, h, Q, V, AA)
        role, G, un, sc = [("displacement", Q, "mm", 1e3), ("velocity", V, "mm/s", 1e3), ("acceleration", AA, "m/s2", 1)][int(r.choice([0, 1, 2] if smooth or not laws else [0, 1]))]
        fm = fo[::2*nsub][:N]; cols = {"t": np.arange(N)*Ts, "F": fm*sen.gain("F")+(.0005*np.abs(fm).max())*r.standard_normal(N)}
        ch = [dict(role="time", column="t", unit="s"), dict(role="force", at=f"{bn[drive]}.x", column="F", unit="N", sigma=f"{nice(.0005*np.abs(fm).max(), 2):g} N")]
        for j in resp:
            y = G[:, j]; s0 = p*rms(y-y.mean()); cols[f"y{j+1}"] = (y*sen.gain((role, j))+s0*ar(r, N, opt["rho"]))*sc
            ch.append(dict(role=role, at=f"{bn[j]}.x", column=f"y{j+1}", unit=un, sigma=f"{nice(s0*sc, 2):g} {un}"))
        tests.append(dict(id=kind, kind="transient", file=kind+".csv", control="force", channels=ch, cols=cols))
    # split: held out a loop of large amplitude in the middle of the frequencies and, of several frequency responses, one; select: another loop and another response
    order = sorted(range(nl), key=lambda i: abs(np.log(lf[i]/(.25*f1)))-la[i]/Fmax); held = [loops[order[0]]]; sel = [loops[order[1 if r.uniform() < .5 else 2]]]
    if len(frfs) >= 3: held.append(frfs[-1]); sel.append(frfs[1])
    elif len(frfs) == 2: (held if r.uniform() < .5 else sel).append(frfs[1])
    if with_rec and r.uniform() < .5: held.append(kind)
    o = '\n[[body]]\nname = "ground"\nfixed = true\n'
    if single: o += f'\n[[body]]\nname = "mass"\nmass = "{nominal[0]:g} kg"\nfree = ["x"]\n\n[[connector]]\nname = "c1"\nfrom = "ground"\nto = "mass"\n'
    elif equal: o += f'\n[[body]]\nname = "m"\ncount = {n}\nmass = "{nominal[0]:g} kg"\nfree = ["x"]\n\n[[connector]]\nname = "base"\nfrom = "ground"\nto = "m1"\n\n[[connector]]\nname = "c"\nchain = "m"\n'
    else:
        for j in range(n): o += f'\n[[body]]\nname = "m{j+1}"\nmass = "{nominal[j]:g} kg"\nfree = ["x"]\n'
        for j in range(n): o += f'\n[[connector]]\nname = "{names[j]}"\nfrom = "{"ground" if j == 0 else f"m{j}"}"\nto = "m{j+1}"\n'
    for g in groups:
        a = f'"{names[g[0]]}.x"' if len(g) == 1 else (f'"c1-{n-1}.x"' if equal else "["+", ".join(f'"{names[j]}.x"' for j in g)+"]")
        o += eff("linear_stiffness", a, "k", ks[g[0]]*1e-3, "N/mm", start(r))+eff("viscous", a, "c", cs[g[0]]*1e-3, "N s/mm", start(r))
    write(dirn, title, tests, o, dict(select=sel, held_out=held))
    return dict(truth=[dict(law=l, at=f"{names[j]}.x", strength=s, shape=u, parameters=ph) for l, s, u, ph, j in zip(laws, ss, shapes, phys, place)],
        model=f"{n} bodies", miss=miss(ss) if laws else 0, alone=[miss(tuple(s if i == j else 0 for j, s in enumerate(ss))) for i in range(len(ss))] if len(ss) > 1 else None,
        n=n, drive=drive+1, k=ks.tolist(), c=cs.tolist(), masses=mt.tolist(), nominal=nominal.tolist(), zeta=zeta, small_signal=small_signal, record=kind if with_rec else False, excitation=Ffrf)

def main(seed, out, only=None):
    r = np.random.default_rng(seed); cases = []
    for group in ("connector", "chain"):
        pool = FRIC+DAMP+STIF+(["preload"] if group == "chain" else [])
        singles = [str(x) for x in r.choice(pool, size=8, replace=False)]
        kinds = [[l] for l in singles]
        for _ in range(2): kinds.append([str(r.choice([x for x in FRIC+DAMP if x != "structural_damping"])), str(r.choice(STIF))])
        kinds += [[], []]; order = r.permutation(12); mass = [True]*4+[False]*8; r.shuffle(mass)
        for i, o in enumerate(order):
            n = 1 if group == "connector" else int(r.integers(3, 8))
            names = ["base"]+[f"c{j}" for j in range(1, n)]
            pl = ["c1"]*2 if group == "connector" else [str(r.choice(names)), str(r.choice(names))]
            cases.append(dict(group=group, laws=kinds[o], places=pl[:len(kinds[o])], opt=dict(n=n, mass=bool(mass[i]), noise=lu(r, .003, .02), rho=float(r.choice([0, 0, .7, .92])), scatter=bool(r.uniform() < .5),
                record=bool(r.uniform() < .4), gain_per_test=bool(r.uniform() < .3), mass_off=bool(group == "chain" and r.uniform() < .4)), seed=int(r.integers(2**31))))
    order = r.permutation(24); truth = {"seed": seed, "cases": {}}
    for num, i in enumerate(order, 1):
        if only and num not in only: continue
        c = cases[i]; name = f"case-{num:02d}"; t0 = time.time(); rr = np.random.default_rng(c["seed"])
        title = f"Blind case {num}"
        if c["group"] == "connector" and not c["opt"]["mass"]: d = massless(rr, f"{out}/{name}", title, c["laws"], c["opt"])
        else: d = chain(rr, f"{out}/{name}", title, c["laws"], c["places"], c["opt"])
        d.update(group=c["group"], hidden=len(c["laws"]), options=c["opt"]); truth["cases"][name] = d
        json.dump(truth, open(f"{out}/truth.json", "w"), indent=1); print(name, f"{time.time()-t0:.1f} s", flush=True)

if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], [int(x) for x in sys.argv[3].split(",")] if len(sys.argv) > 3 else None)
