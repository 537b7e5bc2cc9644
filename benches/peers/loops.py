"""The friction-damper histories (public, not in this repository): what `misfit new` finds unaided, against numpy on the raw samples.

    python benches/peers/loops.py FOLDER

Frequency and amplitude from the file name and the recorded displacement; area of the mean cycle by the trapezoidal rule over every raw cycle misfit averaged.
"""
import glob
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")


def area(t, x, f, frequency, start, cycles):
    """Mean of the loop integral of F dx over whole cycles, at the sampled points, ends interpolated."""
    total = 0.0
    for c in range(cycles):
        a, b = start + c / frequency, start + (c + 1) / frequency
        inside = (t > a) & (t < b)
        at = np.concatenate([[a], t[inside], [b]])
        xs, fs = np.interp(at, t, x), np.interp(at, t, f)
        # Closed: the last point joined to the first.
        xs, fs = np.append(xs, xs[0]), np.append(fs, fs[0])
        total += np.sum(0.5 * (fs[1:] + fs[:-1]) * np.diff(xs))
    return total / cycles


def main():
    program = os.environ.get("MISFIT") or os.path.join(ROOT, "target", "release", "misfit")
    inch, kip = 0.0254, 4448.2216152605
    print(f"{'file':16s} {'Hz':>9s} {'off':>8s} {'cycles':>7s} {'start-up':>9s} {'control':>13s} {'amplitude, in':>14s} {'off':>8s} {'W_D, J':>18s} {'off':>8s}")
    for file in sorted(glob.glob(f"{sys.argv[1]}/*.csv")):
        with tempfile.TemporaryDirectory() as folder:
            out = subprocess.run([program, "new", f"{folder}/study", "--json", "--from", file], capture_output=True, text=True)
        if out.returncode:
            print(os.path.basename(file), out.stderr)
            continue
        found = json.loads(out.stdout)["found"][0]
        loop, frequency = found["loop"], found["frequency_hz"]
        t, x, f, _ = np.loadtxt(file, delimiter=",", skiprows=1).T
        start = t[0] + found["start_up_cycles"] / frequency
        cycles = loop["cycles_averaged"]
        settled = (t >= start) & (t < start + cycles / frequency)
        peaks = [np.ptp(x[(t >= start + c / frequency) & (t < start + (c + 1) / frequency)]) / 2 for c in range(cycles)]
        amplitude, recorded = loop["displacement_amplitude"] / inch, np.mean(peaks)
        own = area(t, x * inch, f * kip, frequency, start, cycles)
        name = os.path.basename(file)
        nominal = float(name.split("Hz")[0])
        w = loop["W_D"]
        print(f"{name:16s} {frequency:9.5f} {100 * (frequency / nominal - 1):7.3f}% {found['cycles']:7d} {found['start_up_cycles']:9d} {found['control']:>13s} {amplitude:14.4f} "
              f"{100 * (amplitude / recorded - 1):7.3f}% {w['value']:10.4f} +- {w['std']:.4f} {100 * (w['value'] / own - 1):7.3f}%   {settled.sum()} samples")
        for text in found["findings"]:
            print(f"    {text}")


if __name__ == "__main__":
    main()
