"""Contact of a leaf spring with the blade, node to node (small sliding): kinematics and laws of the tangential force.

The place of the leaf's node in the frame of the blade's node, rho = R(t_blade)' (r_leaf - r_blade) - rho_unloaded, has the slip u = rho_1
along the blade and the gap w = rho_2 across it. Across acts a stiff spring (the leaf is held in its seat, it does not lift). Along acts one of

    tie       F = k u
    friction  elastic slip: F = F_c s, s = clamp(s0 + du/d, -1, 1)
    film      F = f a with d a' + v0 sinh(a) = u'      (Eyring film in series with the contact stiffness f/d)
"""
import numpy as np


def kinematics(q, angle):
    """rho (2, n), gradient (n, 2, 6), second derivatives (n, 2, 6, 6). q: blade x, y, t, leaf x, y, t; angle of the tangent, unloaded."""
    n = len(angle)
    dx, dy = q[:, 3] - q[:, 0], q[:, 4] - q[:, 1]
    p = angle + q[:, 2]
    c, s = np.cos(p), np.sin(p)
    rho = np.stack([c * dx + s * dy, -s * dx + c * dy])
    b = np.zeros((n, 2, 6))
    b[:, 0, 0], b[:, 0, 1], b[:, 0, 2], b[:, 0, 3], b[:, 0, 4] = -c, -s, rho[1], c, s
    b[:, 1, 0], b[:, 1, 1], b[:, 1, 2], b[:, 1, 3], b[:, 1, 4] = s, -c, -rho[0], -s, c
    second = np.zeros((n, 2, 6, 6))
    for m in (0, 1, 3, 4):
        second[:, 0, m, 2] = second[:, 0, 2, m] = b[:, 1, m]
        second[:, 1, m, 2] = second[:, 1, 2, m] = -b[:, 0, m]
    second[:, 0, 2, 2] = -rho[0]
    second[:, 1, 2, 2] = -rho[1]
    return rho, b, second


def friction(u, anchor, limit, d):
    """Force, tangent and the new anchor (slip at which the spring is free) of the elastic slip element."""
    s = (u - anchor) / d
    sticks = np.abs(s) <= 1.0
    s = np.clip(s, -1.0, 1.0)
    return limit * s, np.where(sticks, limit / d, 0.0), u - d * s


def film(u, z, step, scale, d, v0):
    """Force, tangent and a of an implicit step of length `step`: d a - u + step v0 sinh(a) = z."""
    r = z + u
    # The smaller of the two limits lies beyond the answer, and from there Newton goes down to it without overshoot.
    a = np.sign(r) * np.minimum(np.abs(r) / d, np.arcsinh(np.abs(r) / (step * v0)))
    for _ in range(50):
        change = (d * a + step * v0 * np.sinh(a) - r) / (d + step * v0 * np.cosh(a))
        a = a - change
        if np.all(np.abs(change) <= 1e-13 * (1.0 + np.abs(a))):
            break
    return scale * a, scale / (d + step * v0 * np.cosh(a)), a
