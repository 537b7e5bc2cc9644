"""Small motion about a loaded state: FRFs and damped modes in the plane, friction stuck, film and Prony branches at their complex stiffness.

Laplace variable s. Blade bending: EI + h sum g_j s tau_j / (1 + s tau_j); film: f s / (s d + v0); friction: F_c / d; device at P: k + s c, mass m.
"""
import numpy as np
from scipy.linalg import eigh
from scipy.linalg.lapack import zgbsv

from . import beam
from .mesh import contact_state
from .quasistatic import QuasiStatic


class Linear:
    """About the state of `rest` (a QuasiStatic that was loaded), or, with free=True, the unloaded blade with its leaves held by nothing."""

    def __init__(self, rest=None, free=None, interference=None, per_part=2):
        if free is not None:
            rest = QuasiStatic(free, interference, per_part)
            rest.mesh.number(pinned=False)
            rest.q = np.zeros(rest.mesh.n)
        self.rest, self.rig, self.mesh, self.p = rest, rest.rig, rest.mesh, rest.p
        self.bound = free is None
        m = self.mesh
        self.strain, self.b, self.second = beam.kinematics(m.gather(rest.q, 0), m.length, m.angle)
        self.u, self.w, self.cb, self.csecond = contact_state(m, rest.q)
        self.m = self.p.mass(m, device=self.bound)
        self.g, self.tau = rest.g, rest.tau

    def stiffness(self, s):
        """Band of the complex stiffness at s."""
        m, p, rig = self.mesh, self.p, self.rig
        st = s * self.tau
        ei = p.ei + p.loss * (self.g * st / (1.0 + st)).sum()
        shear = beam.corrected_shear(p.ga, ei, m.length)
        moduli = np.stack([p.ea + 0j, shear, ei])
        resultants = np.stack([p.ea * self.strain[0], p.shear * self.strain[1], p.ei * self.strain[2]])
        stiff = m.tie + p.limit / p.slip + p.film * s / (s * rig.film_slip + rig.film_speed)
        along = p.limit * np.clip((self.u - self.rest.anchor) / p.slip, -1, 1) + m.tie * self.u
        traction, ctangent = np.stack([along, p.seat * self.w]), np.stack([stiff, p.seat + 0j])
        k = m.band([beam.tangent(self.b, self.second, resultants, moduli, m.length),
                    beam.tangent(self.cb, self.csecond, traction, ctangent, np.ones(len(self.u)))])
        if self.bound:
            k[2 * m.half, m.dof("tip", "x")] += rig.shelf
            k[2 * m.half, m.dof("P", "x")] += rig.device_stiffness + s * rig.device_damping
        return k

    def solve(self, s, load):
        half = self.mesh.half
        _, _, x, info = zgbsv(half, half, self.stiffness(s) + s * s * self.m, load)
        assert info == 0
        return x

    def accelerance(self, frequency, responses):
        """(responses, lines) in m/s2 per N, force at P along x."""
        at = [self.mesh.dof(name, axis) for name, axis in responses]
        load = np.zeros(self.mesh.n, complex)
        load[self.mesh.dof("P", "x")] = 1.0
        return np.array([s * s * self.solve(s, load)[at] for s in 2j * np.pi * np.asarray(frequency)]).T

    def times(self, band, x):
        """Band matrix times vector."""
        half, n = self.mesh.half, self.mesh.n
        y = np.zeros(n, complex)
        for d in range(-half, half + 1):        # row 2 half + d holds entry (j + d, j)
            j = np.arange(max(0, -d), min(n, n - d))
            y[j + d] += band[2 * half + d, j] * x[j]
        return y

    def dense(self, band):
        half, n = self.mesh.half, self.mesh.n
        a = np.zeros((n, n), band.dtype)
        for d in range(-half, half + 1):
            j = np.arange(max(0, -d), min(n, n - d))
            a[j + d, j] = band[2 * half + d, j]
        return a

    def modes(self, count, around=800.0):
        """[(frequency Hz, damping ratio, shape)], ascending: s from the nonlinear eigenproblem (K(s) + s^2 M) x = 0.

        Start: undamped modes with the stiffness at `around`; then inverse iteration with the Rayleigh functional s^2 = -x'K(s)x / x'Mx.
        """
        k, m = self.dense(self.stiffness(2j * np.pi * around).real), self.dense(self.m)
        skip = 0 if self.bound else 3
        values, vectors = eigh(k, m, subset_by_index=[0, skip + count - 1])
        found = []
        for value, x in list(zip(values, vectors.T))[skip:]:
            s, x = 1j * np.sqrt(value), x.astype(complex)
            for _ in range(60):
                x = self.solve(s * (1 + 1e-9), self.times(self.m, x))
                x = x / x[np.argmax(np.abs(x))]
                ratio = -(x @ self.times(self.stiffness(s), x)) / (x @ self.times(self.m, x))
                new = np.sqrt(ratio)
                new = new if new.imag > 0 else -new
                done = abs(new - s) < 1e-10 * abs(s)
                s = new
                if done:
                    break
            else:
                raise RuntimeError(f"mode near {np.sqrt(value) / 2 / np.pi:.0f} Hz does not settle")
            found.append((abs(s) / (2 * np.pi), -s.real / abs(s), x))
        return sorted(found, key=lambda f: f[0])


class OutOfPlane:
    """Linear motion out of the plane about the loaded shape: deflection z and two rotations a node, Euler-Bernoulli in yz, St Venant torsion.

    The leaves ride along with their mass. Pin and shelf leave only motion in the plane free (paper: parts 1 and 22), so both ends are held here;
    free-free without them. The load's geometric stiffness is left out: it is 1e-3 of the bending stiffness in yz.
    """

    def __init__(self, linear):
        self.rig, mesh = linear.rig, linear.mesh
        n = len(mesh.kind[mesh.kind != 2])
        full = np.zeros(mesh.dofs)
        full[mesh.free] = linear.rest.q
        xy = mesh.xy[: n + 1] + full.reshape(-1, 3)[: n + 1, :2]
        d = np.diff(xy, axis=0)
        length = np.hypot(*d.T)
        rig, size = self.rig, 3 * (n + 1)
        self.k, self.m = np.zeros((size, size)), np.zeros((size, size))
        line = np.full(n, rig.line_mass)
        line[[k for k in range(n) if rig.zone_start <= (k + 0.5) / (n / rig.count) <= rig.count - rig.zone_start]] += rig.leaf_mass
        for e in range(n):
            l, (c, s) = length[e], d[e] / length[e]
            a, gj = rig.ei_yz / l**3, rig.gj / l
            # local: z1, twist1, slope1, z2, twist2, slope2 (slope = dz along the element)
            k = np.zeros((6, 6))
            k[np.ix_([0, 2, 3, 5], [0, 2, 3, 5])] = a * np.array(
                [[12, 6 * l, -12, 6 * l], [6 * l, 4 * l * l, -6 * l, 2 * l * l], [-12, -6 * l, 12, -6 * l], [6 * l, 2 * l * l, -6 * l, 4 * l * l]])
            k[np.ix_([1, 4], [1, 4])] = gj * np.array([[1, -1], [-1, 1]])
            m = np.zeros((6, 6))
            m[np.ix_([0, 2, 3, 5], [0, 2, 3, 5])] = line[e] * l / 420 * np.array(
                [[156, 22 * l, 54, -13 * l], [22 * l, 4 * l * l, 13 * l, -3 * l * l], [54, 13 * l, 156, -22 * l], [-13 * l, -3 * l * l, -22 * l, 4 * l * l]])
            m[np.ix_([1, 4], [1, 4])] = rig.polar_inertia * l / 12 * np.array([[5, 1], [1, 5]])
            # global rotations r = (rx, ry): twist = r . tangent, slope = dz/ds = rx ty - ry tx
            t = np.zeros((6, 6))
            for o in (0, 3):
                t[o, o] = 1.0
                t[o + 1, o + 1], t[o + 1, o + 2] = c, s
                t[o + 2, o + 1], t[o + 2, o + 2] = s, -c
            at = slice(3 * e, 3 * e + 6)
            self.k[at, at] += t.T @ k @ t
            self.m[at, at] += t.T @ m @ t
        self.free = np.arange(3, size - 3) if linear.bound else np.arange(size)
        self.skip = 0 if linear.bound else 3
        self.prony, self.law = rig.prony(), linear.p.loss.max() / linear.p.ei[: n].max()
        self.tangents = np.gradient(xy, axis=0) / np.linalg.norm(np.gradient(xy, axis=0), axis=1)[:, None]

    def modes(self, count):
        """[(frequency, damping, family)]: the whole stiffness carries the blade's loss, k (1 + loss sum g_j s tau_j / (1 + s tau_j))."""
        values, vectors = eigh(self.k[np.ix_(self.free, self.free)], self.m[np.ix_(self.free, self.free)],
                               subset_by_index=[0, self.skip + count - 1])
        g, tau = self.prony
        out = []
        for value, x in list(zip(values, vectors.T))[self.skip:]:
            s = 1j * np.sqrt(value)
            for _ in range(50):
                s = 1j * np.sqrt(value * (1.0 + self.law * (g * s * tau / (1.0 + s * tau)).sum()))
            full = np.zeros(len(self.k))
            full[self.free] = x
            z, r = full[0::3], np.stack([full[1::3], full[2::3]], axis=1)
            twist = (r * self.tangents).sum(1)
            # share of the kinetic energy that is twist
            share = self.rig.polar_inertia * (twist**2).sum() / (self.rig.polar_inertia * (twist**2).sum() + self.rig.line_mass * (z**2).sum())
            out.append((abs(s) / (2 * np.pi), -s.real / abs(s), "torsion" if share > 0.5 else "yz bending"))
        return out
