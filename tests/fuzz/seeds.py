"""Small valid files for the fuzzer to begin with: python seeds.py FOLDER [UNIVERSAL FILES]. Needs numpy, scipy, pyarrow."""
import pathlib
import shutil
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat

TEXTS = [
    "t,x,F [N]\r\n0,a,-3e-3\r\n1.5,b,4\r\n2.5,\"b\",4\r\n",
    "t;F [N]\n0;-0,003\n1,5;4\n2,5;4,5\n",
    "# rig\nTest 12, run 3\n\nt;F [N]\ns;kN\n0,0;-0,003\n1,5;4,0\n",
    "t   F [N]\n0   -3e-3\n1.5   4\n",
    "\ufefft,\"F [N]\"\n0,\"1\"\n1.5,4\n",
    "frequency [Hz],re [m/N],im [m/N],coherence\n1,1e-6,-1e-8,0.99\n2,2e-6,-2e-8,1\n",
]


def main():
    folder = pathlib.Path(sys.argv[1])
    at = {kind: folder / kind for kind in ("csv", "parquet", "mat", "uff")}
    for place in at.values():
        place.mkdir(parents=True, exist_ok=True)
    for k, text in enumerate(TEXTS):
        (at["csv"] / f"{k}.csv").write_bytes(text.encode())
    t = np.arange(40) * 0.01
    columns = {"t": t, "F [N]": np.sin(t).astype(np.float32), "n": [f"row {i}" for i in range(40)], "k": list(range(40))}
    for k, how in enumerate([{"compression": c} for c in ("none", "snappy", "gzip", "zstd", "lz4", "brotli")] + [{"use_dictionary": False, "data_page_version": "2.0"}]):
        pq.write_table(pa.table(columns), at["parquet"] / f"{k}.parquet", **how)
    arrays = {"t": t, "F": np.sin(t), "k": np.arange(5, dtype=np.int16), "z": t + 1j * t, "text": "a name", "s": {"t": t, "inner": {"F": t}}, "c": np.array([t, "x"], dtype=object)}
    for k, how in enumerate([{"do_compression": False}, {"do_compression": True}]):
        savemat(at["mat"] / f"{k}.mat", arrays, **how)
    savemat(at["mat"] / "4.mat", {"t": t, "F": np.sin(t)}, format="4")
    for file in sys.argv[2:]:
        if pathlib.Path(file).stat().st_size < 100_000:
            shutil.copy(file, at["uff"])


if __name__ == "__main__":
    main()
