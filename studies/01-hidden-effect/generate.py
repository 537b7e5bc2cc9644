"""Synthetic measurements of an 8-body chain with one hidden friction element.

Independent of the product's engines on purpose: it shares no code, no discretisation and no formulation with them.

The chain is ground -base- m1 -c1- m2 ... m7 -c7- m8, motion along x only. Every connector is a spring and a dashpot in
parallel; ONE connector carries in addition an elastic slip element (a spring k_t in series with a Coulomb slider F_c).
`truth.toml`, written here and read by nobody, holds the values.

Loops. Piecewise linear system, integrated event to event: between events the slider either sticks (f' = k_t v_rel) or
slips (f = +-F_c), an eighth-order Runge-Kutta marches the linear equations, a root finder places the two events
(|f| reaches F_c; v_rel changes sign). `--check` marches the same loops a second way, by an implicit midpoint rule with the
slider as a return map at 64 and 128 steps per sample, and prints the differences.
FRFs. Small signal, the slider sticks: the spring k_t adds to its connector. Dense inversion of the dynamic stiffness.

Noise. Responses only: the controlled force is the reference, recorded to its resolution. Displacements: white, 0.5 % of the range.
FRFs: independent normal errors on real and imaginary part of 1 % of |H| and of 0.2 % of the rms of |H| over the band
(which rules in the antiresonances); coherence is the one that gives this error with n averages, sigma = |H| sqrt((1 - coh) / (2 n coh)).

    python generate.py [--check]
"""
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

HERE = Path(__file__).parent
SEED = 20261
N = 8
MASS = 0.1                  # kg, each
K_BASE, C_BASE = 310e3, 35.0    # N/m, N s/m
K, C = 220e3, 5.0           # N/m, N s/m, c1 to c7
HIDDEN = 5                  # the friction sits at c5, between m5 and m6
K_T, F_C = 380e3, 26.0      # N/m, N
SAMPLES = 128               # per cycle
KEPT = 8                    # cycles after the discarded ones
AVERAGES = 20

# id, frequency Hz, amplitude N, cycles over which the amplitude grows, cycles to discard
LOOPS = [
    ("loop-1Hz-30N", 1.0, 30.0, 1, 2),
    ("loop-1Hz-90N", 1.0, 90.0, 1, 2),
    ("loop-5Hz-60N", 5.0, 60.0, 3, 5),
    ("loop-20Hz-70N", 20.0, 70.0, 12, 24),
    ("loop-0.5Hz-70N", 0.5, 70.0, 1, 2),
    ("loop-10Hz-80N", 10.0, 80.0, 6, 12),
    ("loop-2Hz-120N", 2.0, 120.0, 1, 3),
    ("loop-15Hz-50N", 15.0, 50.0, 9, 60),
]
# id, excited body, responding body
FRFS = [("frf-m8-m8", 8, 8), ("frf-m8-m4", 8, 4), ("frf-m1-m6", 1, 6), ("frf-m3-m7", 3, 7)]
FRF_LINES = np.arange(5.0, 600.0 + 1e-9, 0.5)


def matrices():
    """Stiffness and damping (N/m, N s/m) without the friction, and the row that takes the motion of the hidden connector."""
    def assemble(base, chain):
        a = np.zeros((N, N))
        a[0, 0] += base
        for j in range(N - 1):
            a[j, j] += chain
            a[j + 1, j + 1] += chain
            a[j, j + 1] -= chain
            a[j + 1, j] -= chain
        return a
    b = np.zeros(N)
    b[HIDDEN - 1], b[HIDDEN] = -1.0, 1.0        # c_j joins m_j to m_j+1
    return assemble(K_BASE, K), assemble(C_BASE, C), b


KM, CM, B = matrices()


def force(t, f, amplitude, ramp):
    """Force on m8: a sine whose amplitude grows as a raised cosine over `ramp` cycles, then stays."""
    s = np.clip(f * np.asarray(t) / ramp, 0.0, 1.0)
    return amplitude * 0.5 * (1.0 - np.cos(np.pi * s)) * np.sin(2.0 * np.pi * f * t)


def march_events(f, amplitude, ramp, cycles):
    """Displacement (N x samples) at the sample instants, event to event."""
    t_out = np.arange(cycles * SAMPLES + 1) / (f * SAMPLES)
    a_x, a_v, a_f = -KM / MASS, -CM / MASS, -B / MASS
    t_max = 0.5 / 550.0

    def rhs(sticks):
        def fun(t, y):
            x, v = y[:N], y[N:2 * N]
            a = a_x @ x + a_v @ v + a_f * y[-1]
            a[-1] += force(t, f, amplitude, ramp) / MASS
            return np.concatenate([v, a, [K_T * (B @ v) if sticks else 0.0]])
        return fun

    def slips(t, y):
        return abs(y[-1]) - F_C
    slips.terminal, slips.direction = True, 1.0

    t, y, sticks = 0.0, np.zeros(2 * N + 1), True
    out = np.zeros((N, t_out.size))
    done = 1
    while done < t_out.size:
        if sticks:
            event = slips
        else:
            sign = np.sign(y[-1])

            def event(t, y, sign=sign):
                return sign * (B @ y[N:2 * N])
            event.terminal, event.direction = True, -1.0
        r = solve_ivp(rhs(sticks), (t, t_out[-1]), y, method="DOP853", rtol=1e-9, atol=1e-12, max_step=t_max,
                      t_eval=t_out[done:], events=event)
        if len(r.t):
            out[:, done:done + len(r.t)] = r.y[:N]
            done += len(r.t)
        if r.status != 1:
            break
        t, y = r.t_events[0][0], r.y_events[0][0].copy()
        if sticks:
            y[-1] = np.sign(y[-1]) * F_C
        sticks = not sticks
    assert done == t_out.size
    return t_out, out


def march_return_map(f, amplitude, ramp, cycles, sub):
    """The same by the implicit midpoint rule, slider by return map: the second opinion of --check."""
    h = 1.0 / (f * SAMPLES * sub)
    # midpoint: M (v1 - v0)/h + C vm + K xm + B fm = p(tm), xm = x0 + h/2 vm, v1 = 2 vm - v0
    base = 2.0 * MASS / h * np.eye(N) + CM + 0.5 * h * KM
    inv_slip = np.linalg.inv(base)
    inv_stick = np.linalg.inv(base + 0.5 * h * K_T * np.outer(B, B))
    x, v, fs = np.zeros(N), np.zeros(N), 0.0
    out = np.zeros((N, cycles * SAMPLES + 1))
    drive = force((np.arange(cycles * SAMPLES * sub) + 0.5) * h, f, amplitude, ramp)
    for n, p in enumerate(drive):
        r = 2.0 * MASS / h * v - KM @ x
        r[-1] += p
        vm = inv_stick @ (r - B * fs)
        fm = fs + 0.5 * h * K_T * (B @ vm)
        if abs(fm) > F_C:
            fm = np.sign(fm) * F_C
            vm = inv_slip @ (r - B * fm)
        fs = np.clip(fs + h * K_T * (B @ vm), -F_C, F_C)
        x, v = x + h * vm, 2.0 * vm - v
        if (n + 1) % sub == 0:
            out[:, (n + 1) // sub] = x
    return out


def frf(excite, respond):
    """Accelerance at FRF_LINES, (m/s2)/N, slider stuck."""
    k = KM + K_T * np.outer(B, B)
    h = np.empty(FRF_LINES.size, complex)
    for n, w in enumerate(2.0 * np.pi * FRF_LINES):
        d = k + 1j * w * CM - w * w * MASS * np.eye(N)
        h[n] = -w * w * np.linalg.inv(d)[respond - 1, excite - 1]
    return h


def number(x, digits):
    return f"{x:.{digits}g}"


def main():
    check = "--check" in sys.argv
    data = HERE / "data"
    data.mkdir(exist_ok=True)
    toml = ["# Written by generate.py. 8-body chain: loops under force control at m8, and small-signal FRFs.", 'schema = 1']
    # One stream per test, so that adding a test leaves the others as they are.
    seeds = iter(np.random.SeedSequence(SEED).spawn(len(LOOPS) + len(FRFS)))
    for name, f, amplitude, ramp, discard in LOOPS:
        cycles = discard + KEPT
        t, x = march_events(f, amplitude, ramp, cycles)
        if check:
            scale = np.sqrt(np.mean(x[-1] ** 2))
            for sub in (64, 128):
                e = march_return_map(f, amplitude, ramp, cycles, sub) - x
                print(f"{name}: return map, {sub:3d} steps per sample: rms difference at m8 {np.sqrt(np.mean(e[-1]**2))/scale:.1e}, "
                      f"at c5 {np.sqrt(np.mean((B @ e)**2)/np.mean((B @ x)**2)):.1e}")
        settled = x[-1, discard * SAMPLES:].reshape(-1)[:KEPT * SAMPLES].reshape(KEPT, SAMPLES)
        drift = np.abs(settled - settled[-1]).max() / np.ptp(settled)
        print(f"{name}: {cycles} cycles, kept ones differ by {drift:.1e} of the range before noise")
        rng = np.random.default_rng(next(seeds))
        t, p = t[:-1], force(t[:-1], f, amplitude, ramp)
        channels = []
        for y in (x[-1, :-1], (B @ x)[:-1]):
            y = 1e3 * y
            channels.append(y + 0.005 * np.ptp(y[discard * SAMPLES:]) * rng.standard_normal(y.size))
        with open(data / f"{name}.csv", "w", newline="\n") as out:
            out.write("t,F,x8,d5\n")
            for row in zip(t, p, *channels):
                out.write(f"{row[0]:.10g},{row[1]:.4f},{row[2]:.4f},{row[3]:.5f}\n")
        toml.append(f'''
[[test]]
id = "{name}"
kind = "cycle"
file = "{name}.csv"
control = "force"
conditions = {{ frequency = "{f:g} Hz", amplitude = "{amplitude:g} N" }}
discard_cycles = {discard}
channels = [
 {{ role="time", column="t", unit="s" }},
 {{ role="force", at="m8.x", column="F", unit="N" }},
 {{ role="displacement", at="m8.x", column="x8", unit="mm" }},
 {{ role="displacement", at="c5.x", column="d5", unit="mm" }}]''')
    for name, excite, respond in FRFS:
        rng = np.random.default_rng(next(seeds))
        h = frf(excite, respond)
        sigma = np.hypot(0.01 * np.abs(h), 0.002 * np.sqrt(np.mean(np.abs(h) ** 2)))
        noisy = h + sigma * (rng.standard_normal(h.size) + 1j * rng.standard_normal(h.size))
        # sigma = |H| sqrt((1 - coh)/(2 n coh)), with the measured |H|: a reader finds the sigma that was used.
        coherence = 1.0 / (1.0 + 2.0 * AVERAGES * (sigma / np.abs(noisy)) ** 2)
        with open(data / f"{name}.csv", "w", newline="\n") as out:
            out.write("f,re,im,coh\n")
            for row in zip(FRF_LINES, noisy.real, noisy.imag, coherence):
                out.write(f"{row[0]:g},{row[1]:.5g},{row[2]:.5g},{row[3]:.6f}\n")
        toml.append(f'''
[[test]]
id = "{name}"
kind = "frf"
file = "{name}.csv"
excite = "m{excite}.x"
respond = "m{respond}.x"
quantity = "accelerance"
channels = [
 {{ role="frequency", column="f", unit="Hz" }},
 {{ role="real", column="re", unit="m/s2/N" }},
 {{ role="imag", column="im", unit="m/s2/N" }},
 {{ role="coherence", column="coh", averages={AVERAGES} }}]''')
    (data / "dataset.toml").write_text("\n".join(toml) + "\n")
    (HERE / "truth.toml").write_text(f'''# What generate.py put into the data. Not read by the program: for the reader, and for the test that compares.
seed = {SEED}
[base]
k = "{K_BASE / 1e3:g} N/mm"
c = "{C_BASE:g} N s/m"
[c1-7]
k = "{K / 1e3:g} N/mm"
c = "{C:g} N s/m"
[hidden]
effect = "elastic_slip"
at = "c{HIDDEN}.x"
k_t = "{K_T / 1e3:g} N/mm"
F_c = "{F_C:g} N"
''')
    # modes of the stuck chain, for orientation
    k = KM + K_T * np.outer(B, B)
    s = np.linalg.eigvals(np.block([[np.zeros((N, N)), np.eye(N)], [-k / MASS, -CM / MASS]]))
    s = np.sort_complex(s[s.imag > 0])
    for v in sorted(s, key=abs):
        print(f"mode {abs(v) / 2 / np.pi:7.2f} Hz, damping {-v.real / abs(v):.2%}")


if __name__ == "__main__":
    main()
