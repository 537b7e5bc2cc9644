"""The tests of a case, what Exudyn answers to them, and how strongly a hidden effect shows."""
import math

import numpy as np

from chain import Rig

# id, mean [N], amplitude [N], frequency [Hz], split.
LOOPS = [
    ("loop-15N-1Hz", 70.0, 15.0, 1.0, "fit"),
    ("loop-50N-1Hz", 70.0, 50.0, 1.0, "fit"),
    ("loop-50N-0.2Hz", 70.0, 50.0, 0.2, "fit"),
    ("loop-30N-5Hz", 70.0, 30.0, 5.0, "select"),
    ("loop-50N-5Hz", 70.0, 50.0, 5.0, "held_out"),
    ("loop-30N-0.5Hz", 75.0, 30.0, 0.5, "held_out"),
]
# id, load [N], part that responds, split.
FRFS = [
    ("frf-25N-P", 25.0, "P", "fit"),
    ("frf-110N-P", 110.0, "P", "fit"),
    ("frf-70N-Q1", 70.0, "Q1", "fit"),
    ("frf-25N-Q2", 25.0, "Q2", "select"),
    ("frf-70N-P", 70.0, "P", "held_out"),
    ("frf-110N-Q2", 110.0, "Q2", "held_out"),
]
# Lines of the frequency responses [Hz].
LINES = np.round(np.geomspace(30.0, 1500.0, 120), 2)
# Samples per cycle, and cycles that are written.
POINTS, WRITTEN = 100, 3
# Noise: of a channel's half range in the loop, and of |H| for either part of a response.
LOOP_NOISE, FRF_NOISE = 0.005, 0.01
# Cycles integrated before a loop is looked at, and how often that is doubled until it has settled.
CYCLES, DOUBLED = 6, 3


def force(mean, amplitude, frequency):
    """Load [N] over time [s]: half a cosine up to the least load in the first cycle, then the cycles, beginning at the least load."""
    low = mean - amplitude

    def load(t):
        if t < 1 / frequency:
            return low * (1 - math.cos(math.pi * frequency * t)) / 2
        return mean - amplitude * math.cos(2 * math.pi * frequency * t)

    return load


def loop(machine, hidden, test, steps, sigma=None):
    """One settled cycle: P.x, Q1.x, tip.y [m] at POINTS points."""
    g, fixed, base = machine
    _, mean, amplitude, frequency, _ = test
    cycles = CYCLES
    for _ in range(DOUBLED + 1):
        _, x = Rig(g, fixed, base, hidden, force(mean, amplitude, frequency)).cycles(frequency, cycles, steps, POINTS)
        last, before = x[:, -POINTS - 1:-1], x[:, -2 * POINTS - 1:-POINTS - 1]
        if sigma is None or np.max(np.abs(last - before) / sigma[:, None]) < 0.1:
            return last
        cycles *= 2
    return last


def answers(machine, hidden, steps, sigmas=None):
    """Everything the tests read, without noise, by test."""
    g, fixed, base = machine
    out = {}
    for k, test in enumerate(LOOPS):
        out[test[0]] = loop(machine, hidden, test, steps, None if sigmas is None else sigmas[test[0]])
    for name, load, respond, _ in FRFS:
        rig = Rig(g, fixed, base, hidden, lambda t, load=load: load * min(t, 1.0))
        H = -((2 * np.pi * LINES) ** 2) * rig.receptance(LINES, fixed["P"], fixed[respond])
        out[name] = np.array([H.real, H.imag])
    return out


def deviations(answer):
    """Standard deviations by test: one a channel of a loop, one a line of a response."""
    loops = {t[0]: LOOP_NOISE * np.ptp(answer[t[0]], axis=1) / 2 for t in LOOPS}
    frfs = {t[0]: FRF_NOISE * np.hypot(*answer[t[0]]) for t in FRFS}
    return {**loops, **frfs}


def whitened(difference, sigmas):
    """All tests in one vector, in standard deviations; a loop's points count as often as they are written."""
    rows = []
    for t in LOOPS:
        rows.append((difference[t[0]] / sigmas[t[0]][:, None]).ravel() * math.sqrt(WRITTEN))
    for t in FRFS:
        rows.append((difference[t[0]] / sigmas[t[0]][None, :]).ravel())
    return rows


def less(a, b):
    return {k: a[k] - b[k] for k in a}


def free_directions(machine, answer, sigmas, steps):
    """Orthonormal directions that the base's free parameters move the tests in."""
    g, fixed, base = machine
    columns = []
    for p in base:
        moved = answers((g, fixed, {**base, p: base[p] * 1.02}), [], steps)
        columns.append(np.concatenate(whitened(less(moved, answer), sigmas)))
    return np.linalg.qr(np.array(columns).T)[0]


def visibility(machine, hidden, answer, sigmas, directions, steps):
    """What an effect adds beyond a refitted base, in standard deviations: rms in the test that shows most, length over all tests, test."""
    rows = whitened(less(answers(machine, hidden, steps), answer), sigmas)
    all_ = np.concatenate(rows)
    left = all_ - directions @ (directions.T @ all_)
    ends = np.cumsum([len(r) for r in rows])
    rms = [math.sqrt(np.mean(part**2)) for part in np.split(left, ends[:-1])]
    most = int(np.argmax(rms))
    return rms[most], float(np.linalg.norm(left)), [t[0] for t in LOOPS + FRFS][most]
