"""Equilibrium and slow loops under a force at P: no inertia, internal states marched by a two-stage L-stable Runge-Kutta method.

Alexander's SDIRK of order 2 (SIAM J. Numer. Anal. 14, 1977), gamma = 1 - 1/sqrt 2, on the Prony branches and the film; equilibrium holds at
every stage (Newton, exact tangent); the elastic slip element follows the path stage by stage.
"""
import numpy as np
from scipy.linalg.lapack import dgbsv

from . import beam, interface
from .mesh import Mesh, Properties, contact_state

GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
TOLERANCE = 3e-7     # N: ten times the rounding of the axial forces (EA / L times the last digit of a position)


class Rest(Exception):
    """Newton did not reach equilibrium."""


class QuasiStatic:
    """One rig at one interference (and contact area of the housings, where the rig knows it). `step=None` everywhere means infinitely slow: film and Prony branches relaxed, friction by the path."""

    def __init__(self, rig, interference, per_part=2, area=None):
        self.rig, self.mesh = rig, Mesh(rig, per_part)
        self.p = Properties(self.mesh, interference, area)
        self.g, self.tau = rig.prony()
        self.q = np.zeros(self.mesh.n)
        self.before = self.q.copy()
        self.anchor = np.zeros(len(self.mesh.contact))
        self.z = np.zeros(len(self.mesh.contact))
        self.creep = np.zeros((len(self.tau), len(self.mesh.length)))    # viscous curvature of each branch
        self.iterations = self.solves = 0

    def laws(self, q, step, creep, z):
        """Element states at q: everything the residual and the tangent need."""
        m, p, rig = self.mesh, self.p, self.rig
        strain, b, second = beam.kinematics(m.gather(q, 0), m.length, m.angle)
        moduli = np.stack([p.ea, p.shear, p.ei])
        moment, new_creep = p.ei * strain[2], None
        if step is not None:
            ratio = (step / self.tau)[:, None]
            new_creep = (creep + ratio * strain[2]) / (1.0 + ratio)
            moment = moment + p.loss * (self.g @ (strain[2] - new_creep))
            moduli[2] = moduli[2] + p.loss * (self.g @ (1.0 / (1.0 + ratio)))
        resultants = np.stack([p.ea * strain[0], p.shear * strain[1], moment])
        u, w, cb, csecond = contact_state(m, q)
        along, stiff, anchor = interface.friction(u, self.anchor, p.limit, p.slip)
        along, stiff = along + m.tie * u, stiff + m.tie
        new_z = z
        if step is not None:
            on = p.film > 0.0
            force, tangent, a = interface.film(u[on], z[on], step, p.film[on], rig.film_slip, rig.film_speed)
            along[on] += force
            stiff[on] += tangent
            new_z = z.copy()
            new_z[on] = rig.film_slip * a - u[on]
        traction = np.stack([along, p.seat * w])
        ctangent = np.stack([stiff, p.seat])
        one = np.ones(len(u))
        f = m.scatter([beam.forces(b, resultants, m.length), np.einsum("nia,in->na", cb, traction)])
        # unilateral shelf
        tip = m.dof("tip", "x")
        closed = q[tip] >= 0.0
        f[tip] += rig.shelf * max(q[tip], 0.0)
        blocks = [(b, second, resultants, moduli, m.length), (cb, csecond, traction, ctangent, one)]
        return f, blocks, closed, anchor, new_creep, new_z

    def matrix(self, blocks, closed):
        k = self.mesh.band([beam.tangent(*blocks[0]), beam.tangent(*blocks[1])])
        if closed:
            k[2 * self.mesh.half, self.mesh.dof("tip", "x")] += self.rig.shelf
        return k

    def solve(self, force, step, creep, z, guess):
        """Equilibrium under `force` at P along x, from the guess."""
        q, drive = guess, self.mesh.dof("P", "x")
        for iteration in range(40):
            f, blocks, closed, anchor, new_creep, new_z = self.laws(q, step, creep, z)
            f[drive] -= force
            if np.abs(f).max() < TOLERANCE and iteration > 0:
                self.iterations, self.solves = self.iterations + iteration, self.solves + 1
                self.before, self.q = self.q, q
                return anchor, new_creep, new_z
            _, _, change, info = dgbsv(self.mesh.half, self.mesh.half, self.matrix(blocks, closed), f)
            if info:
                raise Rest(f"singular stiffness at {force:.2f} N")
            # steps of half a millimetre or 0.1 rad at most
            q = q - change * min(1.0, 1.0 / max(1e-9, np.abs(change).max() / 0.05))
        raise Rest(f"no equilibrium at {force:.2f} N: residual {np.abs(f).max():.1e} N")

    def load(self, force, increments=20):
        """From rest to `force`, infinitely slow: the declared loading path of the modal tests."""
        for f in np.linspace(0.0, force, increments + 1)[1:]:
            self.anchor, _, _ = self.solve(f, None, None, self.z, self.q)
        u, _, _, _ = contact_state(self.mesh, self.q)
        # film and branches relaxed
        self.z = -u
        strain, _, _ = beam.kinematics(self.mesh.gather(self.q, 0), self.mesh.length, self.mesh.angle)
        self.creep = np.tile(strain[2], (len(self.tau), 1))

    def advance(self, force, t, dt):
        """One step from t to t + dt under force(t)."""
        guess = self.q + GAMMA * (self.q - self.before)
        last = self.q
        creep0, z0 = self.creep, self.z
        self.anchor, creep1, z1 = self.solve(force(t + GAMMA * dt), GAMMA * dt, creep0, z0, guess)
        rest = (1.0 - GAMMA) / GAMMA
        creep, z = creep0 + rest * (creep1 - creep0), z0 + rest * (z1 - z0)
        guess = self.q + rest * (self.q - last)
        self.anchor, self.creep, self.z = self.solve(force(t + dt), GAMMA * dt, creep, z, guess)
        self.before = last

    def cycles(self, low, high, frequency, settle=20, coarse=24, fine=200, samples=200):
        """Force between low and high, starting at low (loaded slowly). The cycle after `settle` at `samples` phases: F, D_t, D_l (N, m).

        The last three cycles take `fine` steps, those before `coarse` ones. Returns also the change from the cycle before, relative to the range.
        """
        def force(t):
            return 0.5 * (low + high) - 0.5 * (high - low) * np.cos(2 * np.pi * frequency * t)
        self.load(low, 6)
        at = [self.mesh.dof("P", "x"), self.mesh.dof("tip", "y")]
        last = out = None
        for cycle in range(settle + 1):
            steps = coarse if cycle < settle - 2 else fine
            dt = 1.0 / (frequency * steps)
            last, out = out, np.zeros((3, steps))
            for n in range(steps):
                t = n * dt
                out[:, n] = force(t), *self.q[at]
                self.advance(force, t, dt)
        drift = np.abs(out - last).max(1)[1:] / np.ptp(out, axis=1)[1:]
        return out[:, :: fine // samples], drift
