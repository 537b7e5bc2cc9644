"""The chain of 22 rigid parts that multibody.py, plane_chain.py and src/core/engine/space_peers.rs share."""
import math

import numpy as np

N = 22
ARCS = [(0.15, math.radians(12)), (0.06, math.radians(35)), (0.12, math.radians(18))]
WIDTH, THICKNESS, DENSITY = 0.020, 0.009, 3200.0
DEGREE = math.pi / 180
LENGTH = sum(r * q for r, q in ARCS)
LOADED = 11  # part, counted from 1


def curve(s):
    """Point and heading at the distance s; the curve starts at the origin along y and turns left."""
    x, y, heading = 0.0, 0.0, math.pi / 2
    for k, (radius, angle) in enumerate(ARCS):
        length = radius * angle
        step = s if (s <= length or k + 1 == len(ARCS)) else length
        turned = heading + step / radius
        x, y, heading = x + radius * (math.sin(turned) - math.sin(heading)), y - radius * (math.cos(turned) - math.cos(heading)), turned
        if step == s:
            break
        s -= length
    return np.array([x, y, 0.0]), heading


def axes(heading):
    """Columns: x to the right of the curve, y along it, z."""
    s, c = math.sin(heading), math.cos(heading)
    return np.array([[s, c, 0.0], [-c, s, 0.0], [0.0, 0.0, 1.0]])


def stiffness(k):
    """Table 4 of the paper, SI: connector k from 1 to 21."""
    outer = k <= 3 or k >= 19
    ky = 3.6e9 if k <= 3 else (4.2e9 if k <= 18 else 3.0e9)
    psi = 1.490 if outer else 1.960
    return [3e10, ky, 9e10, 1000 / DEGREE, 2.5 / DEGREE, psi / DEGREE]
