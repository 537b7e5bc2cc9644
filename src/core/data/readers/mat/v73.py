"""Writes v73.mat and v73-cells.mat for the tests: HDF5 as MATLAB's save -v7.3 lays it out. python v73.py; needs h5py."""
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



def refer(group, name, targets, shape, of=None):
    """A dataset of references: a cell array with its class, a field of an array of structures without one."""
    d = group.create_dataset(name, shape, dtype=h5py.ref_dtype, track_times=False)
    for at, target in zip(np.ndindex(*shape), targets):
        d[at] = target.ref
    if of:
        d.attrs["MATLAB_class"] = np.bytes_(of)
    return d


# c = {[1; 2], [3; 4]; {[5; 6]}, "ab"}; runs(1:2) with time and force; one.parts = {[3; 4]}; one.s = struct in a cell.
with h5py.File("v73-cells.mat", "w", userblock_size=512) as f:
    refs = f.create_group("#refs#")
    column = lambda name, *v: put(refs, name, np.array(v, dtype=float)[:, None], "double")
    a, b, c = column("a", 1, 2), column("b", 3, 4), column("c", 5, 6)
    text = put(refs, "d", np.frombuffer("ab".encode("utf-16le"), np.uint16)[None, :], "char")
    inner = refer(refs, "e", [c], (1, 1), "cell")
    inside = refs.create_group("g")
    inside.attrs["MATLAB_class"] = np.bytes_("struct")
    put(inside, "x", np.array([[7.0], [8.0]]), "double")
    # Columns first: c{1} and c{2} are the first column of the 2 x 2 cells.
    refer(f, "c", [a, inner, b, text], (2, 2), "cell")
    runs = f.create_group("runs")
    runs.attrs["MATLAB_class"] = np.bytes_("struct")
    refer(runs, "time", [a, a], (2, 1))
    refer(runs, "force", [b, c], (2, 1))
    one = f.create_group("one")
    one.attrs["MATLAB_class"] = np.bytes_("struct")
    refer(one, "parts", [b, inside], (2, 1), "cell")
    # A cell that holds itself, and a reference to nothing.
    loop = refer(f, "loop", [], (1, 1), "cell")
    loop[0, 0] = loop.ref
    refer(f, "void", [], (1, 1), "cell")

for name in ["v73.mat", "v73-cells.mat"]:
    with open(name, "r+b") as raw:
        raw.write(HEADER.ljust(116, b" ") + bytes(8) + b"\x00\x02IM")
