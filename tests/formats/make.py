"""Writes loop.csv, one record of a loop, and loop.mat, the same as MATLAB's save -v7.3 lays it out: what no test can write for itself.

python make.py; needs numpy and h5py. The other formats are written by tests/behaviour/formats.rs from loop.csv."""
import h5py
import numpy as np

HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Nov 30 2026 HDF5 schema 1.00 ."

k = np.arange(769)
t = k / 128
p = 2 * np.pi * t
noise = ((k * 7919) % 101 - 50) / 50
x = np.round(2 * np.sin(p) + 0.002 * noise, 4)
force = np.round(40 * np.sin(p) + 8 * np.cos(p) + 2 * np.sin(3 * p) + 0.05 * noise, 3)

rows = [f"{a:.7f},{b:.4f},{c:.3f}" for a, b, c in zip(t, x, force)]
with open("loop.csv", "w") as out:
    out.write("\n".join(["t,x,F", *rows]) + "\n")

# The doubles that the text is read as.
t, x, force = np.array([[float(v) for v in row.split(",")] for row in rows]).T

with h5py.File("loop.mat", "w", userblock_size=512) as f:
    run = f.create_group("run")
    run.attrs["MATLAB_class"] = np.bytes_("struct")
    for name, values in (("t", t), ("x", x), ("F", force)):
        d = run.create_dataset(name, data=values[None, :], track_times=False)
        d.attrs["MATLAB_class"] = np.bytes_("double")

with open("loop.mat", "r+b") as raw:
    raw.write(HEADER.ljust(116, b" ") + bytes(8) + b"\x00\x02IM")
