"""Writes v73.mat for the tests: HDF5 as MATLAB's save -v7.3 lays it out. python v73.py; needs h5py."""
import h5py
import numpy as np

HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Sun Nov 22 2026 HDF5 schema 1.00 ."


def put(group, name, array, of, **how):
    d = group.create_dataset(name, data=array.T, track_times=False, **how)
    d.attrs["MATLAB_class"] = np.bytes_(of)
    return d


with h5py.File("v73.mat", "w", userblock_size=512) as f:
    put(f, "t", np.array([[0.0], [0.1], [0.2], [0.3]]), "double")
    put(f, "M", np.array([[1, 5], [2, 6], [3, 7], [4, 8]], dtype=np.float32), "single", chunks=(1, 4), compression="gzip", shuffle=True)
    run = f.create_group("run")
    run.attrs["MATLAB_class"] = np.bytes_("struct")
    put(run, "force", np.array([[1, -2, 3, -4]], dtype=np.int16), "int16")
    deep = run.create_group("deep")
    deep.attrs["MATLAB_class"] = np.bytes_("struct")
    put(deep, "x", np.arange(4)[:, None] + 0.5, "double")
    put(f, "label", np.frombuffer("a name".encode("utf-16le"), np.uint16)[None, :], "char").attrs["MATLAB_int_decode"] = np.int32(2)
    put(f, "z", np.array([[(1.0, 2.0)], [(3.0, -4.0)]], dtype=[("real", "f8"), ("imag", "f8")]), "double")
    put(f, "none", np.array([[0], [0]], dtype=np.uint64), "double").attrs["MATLAB_empty"] = np.uint8(1)
    refs = f.create_group("#refs#")
    inner = put(refs, "a", np.array([[1.0]]), "double")
    cell = f.create_dataset("c", (1, 1), dtype=h5py.ref_dtype, track_times=False)
    cell[0, 0] = inner.ref
    cell.attrs["MATLAB_class"] = np.bytes_("cell")

with open("v73.mat", "r+b") as raw:
    raw.write(HEADER.ljust(116, b" ") + bytes(8) + b"\x00\x02IM")
