"""Six-parameter fit of the 132-dof chain to an FRF with 1 % noise: misfit against SciPy least_squares on the dense model.

    python benches/peers/fit.py

The data come from the numpy model at the truth, 300 lines x 4 outputs, complex noise of 1 % of |H| in each part. Both sides start from
the same point and must reach the same cost. SciPy: trf, x_scale='jac', two-point Jacobian, default tolerances, batched
np.linalg.solve with (given threadpoolctl) one BLAS thread: at this size two gain nothing (frf.py shows it) and lose much when the
machine is busy. misfit's time is the median of five fits from scratch, ordering included.
"""
import json
import pathlib
import subprocess
import tempfile
import time

import numpy as np
from scipy.optimize import least_squares

from chain import Chain, binary, blas_threads, stiffness

LINES, SIGMA, ROUNDS = 300, 0.01, 3


def main():
    program = binary("frf_fit")
    print(f"{'round':>5s} {'SciPy s':>9s} {'evaluations':>12s} {'misfit s':>10s} {'evaluations':>12s} {'ratio':>8s} {'cost SciPy':>12s} {'misfit':>12s}")
    ratios = []
    with tempfile.TemporaryDirectory() as folder:
        command = [program, folder, "22", str(LINES), str(SIGMA)]
        product = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert product.stdout.readline().strip() == "ready"
        system = json.loads(pathlib.Path(f"{folder}/system.json").read_text())
        chain = Chain(f"{folder}/system.json", lambda axis: [0, 1, 1, 2, 2, 2][axis])

        def model(p):
            z = [stiffness(chain.omega, p[g], p[3 + g], law["beta"], law["tau"]) for g, law in enumerate(chain.laws)]
            return chain.frf_dense(np.stack(z, axis=1))

        exact = model(system["truth"])
        for seed in range(ROUNDS):
            noise = np.random.default_rng(seed).standard_normal((*exact.shape, 2))
            measured = exact + SIGMA * np.abs(exact) * (noise[..., 0] + 1j * noise[..., 1])
            measured.tofile(f"{folder}/measured.bin")
            calls = 0

            def residual(p):
                nonlocal calls
                calls += 1
                r = (model(p) - measured) / (SIGMA * np.abs(measured))
                return np.concatenate([r.real.ravel(), r.imag.ravel()])

            with blas_threads(1):
                clock = time.perf_counter()
                peer = least_squares(residual, system["start"], method="trf", x_scale="jac", jac="2-point")
                peer_s = time.perf_counter() - clock
            product.stdin.write("fit\n" * 5)
            product.stdin.flush()
            own = sorted((json.loads(product.stdout.readline()) for _ in range(5)), key=lambda run: run["wall_s"])[2]
            ratios.append(peer_s / own["wall_s"])
            print(f"{seed:5d} {peer_s:9.3f} {calls:12d} {own['wall_s']:10.5f} {own['evaluations']:12d} {ratios[-1]:7.0f}x {peer.cost:12.4f} {own['cost']:12.4f}")
            assert own["cost"] < peer.cost * (1 + 1e-6), "misfit stopped at a higher cost"
            scatter = np.sqrt(np.diag(np.linalg.inv(peer.jac.T @ peer.jac)))
            distance = np.abs(np.array(own["p"]) - peer.x) / scatter
            # A peer that stopped early is no fault of ours; a different minimum at the same cost would be.
            assert own["cost"] < peer.cost * (1 - 1e-6) or distance.max() < 0.05, f"other parameters: {distance} standard errors"
            print(f"      parameters misfit {np.array2string(np.array(own['p']), precision=5)}, off the truth by at most "
                  f"{np.max(np.abs(np.array(own['p']) - system['truth']) / scatter):.1f} standard errors")
    print(f"\nmedian ratio {np.median(ratios):.0f}x")


if __name__ == "__main__":
    main()
