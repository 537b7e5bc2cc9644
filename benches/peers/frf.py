"""FRF of the 132-dof chain, 1000 lines x 4 outputs: misfit against numpy dense and scipy solve_banded, in turn, in one run.

    python benches/peers/frf.py

Every side assembles Z(w) from constant group matrices and solves; the answers are compared before anything is timed. A round
times all sides one after the other, numpy with its default number of BLAS threads and (with threadpoolctl) with one. The table gives
each side's best round, so that what else runs on the machine does not enter the ratios, and the median of the ratios inside the
rounds beside it. misfit runs on one thread and on two. The last table is the cost against the number of bodies.
"""
import os
import contextlib
import statistics
import subprocess
import tempfile
import time

import numpy as np

from chain import Chain, binary, blas_threads, stiffness, threadpool_limits

ROUNDS = 5


class Product:
    """The Rust program, kept running: it times a sweep whenever it is asked."""

    def __init__(self, program, folder, bodies, lines):
        command = [program, folder, str(bodies), str(lines)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline().strip() == "ready"

    def seconds(self, threads):
        self.process.stdin.write(f"{threads}\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())


def timed(work):
    clock = time.perf_counter()
    work()
    return time.perf_counter() - clock


def main():
    program = binary("frf_chain")
    with tempfile.TemporaryDirectory() as folder:
        product = Product(program, folder, 22, 1000)
        chain = Chain(f"{folder}/system.json", lambda axis: axis)
        h = np.fromfile(f"{folder}/h.bin", complex).reshape(len(chain.omega), -1)
        z = np.stack([stiffness(chain.omega, **law) for law in chain.laws], axis=1)
        size = np.abs(h).max(axis=0)
        for name, other in [("numpy dense", chain.frf_dense(z)), ("scipy solve_banded", chain.frf_banded(z))]:
            error = (np.abs(h - other) / np.abs(other)).max()
            print(f"largest relative difference of misfit to {name}: {error:.1e}")
            assert error < 1e-8, "the answers differ"
        print(f"{chain.n} dofs, {len(chain.omega)} lines, {len(chain.outputs)} outputs (|H| up to {size.max():.1e}), half bandwidth {chain.width}")
        print(f"{os.cpu_count()} processors, OPENBLAS_NUM_THREADS {os.environ.get('OPENBLAS_NUM_THREADS', 'unset (all)')}\n")
        matrices = [chain.dense(chain.omega[at : at + 100], z[at : at + 100]) for at in range(0, 1000, 100)]
        load = np.zeros((chain.n, 1), complex)
        load[chain.input] = 1
        peers = {
            "numpy dense, assembly and solve": lambda: chain.frf_dense(z),
            "numpy dense, solve alone": lambda: [np.linalg.solve(m, load) for m in matrices],
            "scipy solve_banded, assembly and solve": lambda: chain.frf_banded(z),
        }
        rounds = []
        for _ in range(ROUNDS):
            times = {}
            for threads in (None, 1) if threadpool_limits else (None,):
                with blas_threads(threads):
                    times |= {name + (" (1 BLAS thread)" if threads else ""): timed(work) for name, work in peers.items()}
            times["misfit, 1 thread"], times["misfit, 2 threads"] = product.seconds(1), product.seconds(2)
            rounds.append(times)
        print(f"{'best of ' + str(ROUNDS) + ' rounds':56s} {'ms':>9s} {'over misfit, 2 threads':>24s} {'1 thread':>10s} {'median, 2 threads':>18s}")
        best = {name: min(r[name] for r in rounds) for name in rounds[0]}
        for name, seconds in best.items():
            two, one = seconds / best["misfit, 2 threads"], seconds / best["misfit, 1 thread"]
            middle = statistics.median(r[name] / r["misfit, 2 threads"] for r in rounds)
            print(f"{name:56s} {1e3 * seconds:9.3f} {two:23.1f}x {one:9.1f}x {middle:17.1f}x")

        print(f"\n{'bodies':>8s} {'FRF, ms per 100 lines':>22s} {'over linear':>12s} {'march step, ms':>15s} {'over linear':>12s}   (1 thread)")
        sizes = (22, 220, 2200)
        with contextlib.ExitStack() as stack:
            folders = [stack.enter_context(tempfile.TemporaryDirectory()) for _ in sizes]
            scaled = [Product(program, folder, bodies, 100) for folder, bodies in zip(folders, sizes)]
            # The least of several medians, the sizes in turn: what else runs on the machine must pass neither for a cost nor for a saving.
            times = [[[1e3 * product.seconds(work) for work in ("1", "march")] for product in scaled] for _ in range(6 * ROUNDS)]
        least = [[min(r[k][w] for r in times) for w in (0, 1)] for k in range(len(sizes))]
        for bodies, ms in zip(sizes, least):
            over = [m * sizes[0] / (f * bodies) for m, f in zip(ms, least[0])]
            print(f"{bodies:8d} {ms[0]:22.3f} {over[0]:11.2f}x {ms[1]:15.3f} {over[1]:11.2f}x")


if __name__ == "__main__":
    main()
