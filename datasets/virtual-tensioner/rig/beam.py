"""Geometrically exact plane beam element (Reissner 1972, Simo 1985), two nodes, one integration point, vectorised over the elements.

Node: position (x, y) and rotation t from the unloaded shape. With D = r2 - r1, p = chord angle of the unloaded element + (t1 + t2)/2:

    stretch   e = ( cos p Dx + sin p Dy) / L - 1
    shear     g = (-sin p Dx + cos p Dy) / L
    curvature k = (t2 - t1) / L                        (change; the unloaded shape is free of stress)
    energy    L/2 (EA e^2 + GA* g^2 + EI k^2)

1/GA* = 1/GA + L^2 / (12 EI) is the residual bending flexibility (MacNeal, Comput. Struct. 8, 1978): with it the one-point element is exact
at the nodes of a straight beam.
"""
import numpy as np


def corrected_shear(ga, ei, length):
    """GA* of the element, N."""
    return 1.0 / (1.0 / ga + length**2 / (12.0 * ei))


def kinematics(q, length, angle):
    """Strains (3, n), their gradient B (n, 3, 6) and second derivatives of e and g (n, 2, 6, 6); q is (n, 6)."""
    n = len(length)
    dx, dy = q[:, 3] - q[:, 0], q[:, 4] - q[:, 1]
    p = angle + 0.5 * (q[:, 2] + q[:, 5])
    c, s = np.cos(p), np.sin(p)
    e = (c * dx + s * dy) / length - 1.0
    g = (-s * dx + c * dy) / length
    k = (q[:, 5] - q[:, 2]) / length
    b = np.zeros((n, 3, 6))
    cl, sl = c / length, s / length
    b[:, 0, 0], b[:, 0, 1], b[:, 0, 3], b[:, 0, 4] = -cl, -sl, cl, sl
    b[:, 0, 2] = b[:, 0, 5] = 0.5 * g
    b[:, 1, 0], b[:, 1, 1], b[:, 1, 3], b[:, 1, 4] = sl, -cl, -sl, cl
    b[:, 1, 2] = b[:, 1, 5] = -0.5 * (1.0 + e)
    b[:, 2, 2], b[:, 2, 5] = -1.0 / length, 1.0 / length
    second = np.zeros((n, 2, 6, 6))
    # d2e = 1/2 dt (gradient of g along the translations), d2g likewise with -(gradient of e); plus the terms in t t.
    for t in (2, 5):
        for m in (0, 1, 3, 4):
            second[:, 0, m, t] += 0.5 * b[:, 1, m]
            second[:, 0, t, m] += 0.5 * b[:, 1, m]
            second[:, 1, m, t] -= 0.5 * b[:, 0, m]
            second[:, 1, t, m] -= 0.5 * b[:, 0, m]
        for r in (2, 5):
            second[:, 0, t, r] = -0.25 * (1.0 + e)
            second[:, 1, t, r] = -0.25 * g
    return np.stack([e, g, k]), b, second


def forces(b, resultants, length):
    """Nodal forces (n, 6) of the resultants (3, n): N, V, M."""
    return np.einsum("nia,in,n->na", b, resultants, length)


def tangent(b, second, resultants, moduli, length):
    """Stiffness (n, 6, 6): moduli (3, n) may be complex."""
    return np.einsum("nia,in,nib,n->nab", b, moduli, b, length) + np.einsum("niab,in,n->nab", second, resultants[:2], length)


def mass(length, line_mass, line_inertia):
    """Mass (n, 6, 6): mean of the lumped and the consistent matrix along the translations (fourth order), lumped about the rotation."""
    m = np.zeros((len(length), 6, 6))
    for a in (0, 1):
        m[:, a, a] = m[:, a + 3, a + 3] = line_mass * length * (5.0 / 12.0)
        m[:, a, a + 3] = m[:, a + 3, a] = line_mass * length / 12.0
    for t in (2, 5):
        m[:, t, t] = line_inertia * length / 2.0
    return m
