"""The chain of multibody.py in its plane by absolute angles: rigid links, no stretch, one multiplier for the shelf, numpy alone.

Prints deflections and in-plane frequencies about the loaded equilibrium. Exudyn's own eigenvalues differentiate stiff connectors
numerically: right at rest, they are noise under load.
"""
import math

import numpy as np
from scipy.linalg import eigh

from chain22 import LOADED, N, DENSITY, WIDTH, THICKNESS, LENGTH, curve, stiffness

step = LENGTH / N
ends = [curve(k * step)[0][:2] for k in range(N + 1)]
centre = [curve((k + 0.5) * step)[0][:2] for k in range(N)]
chord = [ends[k + 1] - ends[k] for k in range(N)]
half = [centre[k] - ends[k] for k in range(N)]
mass = DENSITY * WIDTH * THICKNESS * step
inertia = mass * (THICKNESS**2 + step**2) / 12
P = LOADED - 1
K = np.zeros((N, N))
for k in range(N - 1):
    s = stiffness(k + 1)[5]
    K[k : k + 2, k : k + 2] += s * np.array([[1, -1], [-1, 1]])


def rot(t, v):
    return np.array([math.cos(t) * v[0] - math.sin(t) * v[1], math.sin(t) * v[0] + math.cos(t) * v[1]])


def along(t, vectors, last, derivative):
    """x of a point on link `last` by angles: its first or second derivative with respect to each angle."""
    out = np.zeros(N)
    for k in range(last + 1):
        v = vectors[k] if k == last else chord[k]
        out[k] = rot(t[k] + math.pi / 2, v)[0] if derivative == 1 else -rot(t[k], v)[0]
    return out


def solve(force, steps=20):
    t, shelf = np.zeros(N), 0.0
    for s in range(1, steps + 1):
        f = force * s / steps
        for _ in range(30):
            load, tip = along(t, half, P, 1), along(t, chord, N - 1, 1)
            H = K - np.diag(f * along(t, half, P, 2) + shelf * along(t, chord, N - 1, 2))
            gap = sum(rot(t[k], chord[k])[0] - chord[k][0] for k in range(N))
            A = np.block([[H, -tip[:, None]], [-tip[None, :], np.zeros((1, 1))]])
            d = np.linalg.solve(A, -np.append(K @ t - f * load - shelf * tip, -gap))
            t, shelf = t + d[:N], shelf + d[N]
            if np.abs(d[:N]).max() < 1e-13:
                break
    M = np.zeros((N, N))
    for k in range(N):
        B = np.zeros((2, N))
        for j in range(k):
            B[:, j] = rot(t[j] + math.pi / 2, chord[j])
        B[:, k] = rot(t[k] + math.pi / 2, half[k])
        M += mass * B.T @ B
        M[k, k] += inertia
    q, _ = np.linalg.qr(np.column_stack([tip, np.eye(N)[:, 1:]]))
    Z = q[:, 1:]
    w = eigh(Z.T @ H @ Z, Z.T @ M @ Z, eigvals_only=True)
    p = sum(rot(t[k], chord[k]) for k in range(P)) + rot(t[P], half[P]) - centre[P]
    y = sum(rot(t[k], chord[k])[1] - chord[k][1] for k in range(N))
    return [float(v) for v in (*p, y)], [float(v) for v in np.sign(w[:4]) * np.sqrt(np.abs(w[:4])) / (2 * math.pi)]


for force in (0.0, 80.0, 138.3, -138.3):
    print(force, *solve(force))
