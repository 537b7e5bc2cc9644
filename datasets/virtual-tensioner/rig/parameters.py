"""What the rig is made of. SI throughout. `Rig()` is the tensioner, `variant()` the other one, `tolerances()` that of the tolerance cases."""
from dataclasses import asdict, dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Rig:
    # Geometry: arcs of the blade's centre line from the pin to the tip; equal parts of the reduced model, whole numbers on each arc.
    radius: tuple = (90e-3, 150e-3, 90e-3)      # m
    parts: tuple = (6, 10, 6)
    part_length: float = 4.9e-3                 # m
    zone: float = 3.5                           # F-G and H-L end this many part lengths from the pin and from the tip
    zone_start: float = 0.5                     # and begin this many from them
    drive: float = 11.5                         # P, in part lengths from the pin; so are the transfer points
    transfer: tuple = (5.5, 16.5)
    # Blade
    ei_middle: float = 0.74                     # N m2, relaxed, at the design interference
    ei_end: float = 0.20                        # N m2, F-G and H-L and what lies outside them
    ea: float = 2e6                             # N
    ga: float = 5e5                             # N
    line_mass: float = 0.52                     # kg/m
    line_inertia: float = 0.52 * 3e-6           # kg m
    # Leaf springs: one along G-H, one in each end zone
    leaf_ei: float = 0.02                       # N m2
    leaf_ea: float = 1.5e6                      # N
    leaf_ga: float = 5e5                        # N
    leaf_mass: float = 0.05                     # kg/m
    leaf_inertia: float = 0.05 * 3e-8           # kg m
    offset: float = 3.5e-3                      # m, centre line of a leaf from that of the blade, on the concave side
    seat_stiffness: float = 2e9                 # N/m per m, across
    tie: float = 2e7                            # N/m, holds an end leaf at G (H) and the middle leaf at its middle
    # Structural damping of the blade's bending: Prony branches, loss modulus = loss * EI between the band's ends
    loss: float = 0.19
    band: tuple = (100.0, 20e3)                 # Hz
    branches: int = 24
    # Film under the two ends of the middle leaf
    film_force: float = 19.0                    # N per end, at the design interference
    film_speed: float = 0.6e-3                  # m/s
    film_slip: float = 0.025e-3                  # m
    pad: float = 2.0                            # part lengths
    # Friction between the end leaves and their housings
    friction: float = 0.08
    clamp: float = 70.0                        # N, normal force of a housing without interference
    clamp_rate: float = 0.35e6                  # N/m, its growth with the interference (paper's eq. 5: E_p A / h_r)
    ends: tuple = (1.0, 1.0)                    # share of it at the pin end F-G, at the tip end H-L
    slip: float = 0.008e-3                      # m, elastic slip of the contact
    patch: float = 1.5                          # part lengths, from F (L) inwards
    # Laws in the interference (paper's eqs. 7-8): EI ~ exp(a (i - i0)); loss modulus and film force ~ exp(b (i - i0))
    design_interference: float = 0.3e-3         # m
    stiffness_exponent: float = 320.0           # 1/m
    damping_exponent: float = 660.0             # 1/m
    # Supports and the device that loads P (in the modal tests; loops are under force control)
    shelf: float = 2e7                          # N/m
    device_stiffness: float = 400e3             # N/m
    device_mass: float = 0.105                  # kg
    device_damping: float = 22.0                # N s/m
    # Out of the plane, linear: torsion and bending in yz
    gj: float = 0.45                            # N m2
    ei_yz: float = 22.0                         # N m2
    polar_inertia: float = 1.6e-5              # kg m
    # Housing friction that depends on the contact area too; None: the area is not a condition of this rig
    housing_stiffness: float = None             # N/m3, K: normal force per area and interference (paper's eq. 5: E_p / h_r, times a share)
    shear_strength: float = None                # Pa, tau_0 of the boundary film
    contact_stiffness: float = None             # N/m3, k_t: tangential stiffness per area

    @property
    def count(self):
        return sum(self.parts)

    @property
    def length(self):
        return self.count * self.part_length

    def stiffness_factor(self, i):
        return np.exp(self.stiffness_exponent * (i - self.design_interference))

    def damping_factor(self, i):
        return np.exp(self.damping_exponent * (i - self.design_interference))

    def housing(self, i, area=None):
        """Friction of one housing at the interference i and the contact area: limit F_c in N and elastic slip d in m.

        Without an area: F_c = mu (N_0 + N_1 i), d constant. With one: F_c = mu (N_0 + K A i) + tau_0 A, d = F_c / (k_t A).
        """
        if (area is None) != (self.housing_stiffness is None):
            raise ValueError("the contact area is a condition of this rig" if area is None else "this rig does not know the contact area")
        if area is None:
            return self.friction * (self.clamp + self.clamp_rate * i), self.slip
        limit = self.friction * (self.clamp + self.housing_stiffness * area * i) + self.shear_strength * area
        return limit, limit / (self.contact_stiffness * area)

    def slip_force(self, i, area=None):
        """Limit of the friction of one housing, N."""
        return self.housing(i, area)[0]

    def prony(self):
        """Modulus of each branch per unit of loss modulus, and the relaxation times: a geometric sequence from half a decade below the band to half a decade
        above it, the moduli equal but for the outermost two, which make up at the ends of the band for what is cut off beyond them.
        """
        low, high = self.band
        rate = np.geomspace(low / np.sqrt(10.0), high * np.sqrt(10.0), self.branches)
        modulus = np.full(self.branches, 2.0 / np.pi * np.log(rate[1] / rate[0]))
        turned = low / rate
        at_end = turned / (1.0 + turned**2)
        modulus[[0, -1]] = (1.0 - modulus[1:-1] @ at_end[1:-1]) / (at_end[0] + at_end[-1])
        return modulus, 1.0 / (2.0 * np.pi * rate)

    def angles(self):
        """Angles q1, q2, q3 of the arcs, rad."""
        return [n * self.part_length / r for n, r in zip(self.parts, self.radius)]

    def curve(self, s):
        """Points (2, n) at the arc lengths s and the angle of the tangent to y: the arcs meet with a common tangent; pin at 0, tip on x = 0."""
        bounds = np.concatenate([[0.0], np.cumsum([n * self.part_length for n in self.parts])])
        fine = np.unique(np.concatenate([np.linspace(0.0, self.length, 5), bounds]))

        def integrate(s, start):
            # exact on each arc: the tangent turns by s / R
            x = np.zeros((2, len(s)))
            turn = np.full(len(s), start)
            at, angle = np.zeros(2), start
            for a, b, r in zip(bounds[:-1], bounds[1:], self.radius):
                inside = (s >= a - 1e-15)
                ds = np.clip(s[inside], a, b) - a
                t = angle + ds / r
                # tangent (sin t, cos t) along (x, y): t < 0 at the pin, so that the blade bulges towards -x
                x[:, inside] = at[:, None] + r * np.stack([np.cos(angle) - np.cos(t), np.sin(t) - np.sin(angle)])
                turn[inside] = t
                t = angle + (b - a) / r
                at = at + r * np.array([np.cos(angle) - np.cos(t), np.sin(t) - np.sin(angle)])
                angle = t
            return x, turn

        x, _ = integrate(fine, 0.0)
        # Turn the whole so that the tip lies on the shelf, x = 0.
        start = -np.arctan2(x[0, -1], x[1, -1])
        return integrate(np.asarray(s, float), start)

    def as_dict(self):
        return {k: v for k, v in asdict(self).items() if v is not None}


def variant():
    """Another blade: 30 parts on other arcs, other stiffness and laws, friction in the housing at the tip only."""
    base = Rig()
    return replace(
        base, radius=(110e-3, 200e-3, 130e-3), parts=(8, 12, 10), part_length=4.6e-3, zone=4.5, drive=15.5, transfer=(7.5, 22.5),
        ei_middle=1.50, ei_end=0.30, line_mass=0.62, line_inertia=0.62 * 3e-6, loss=0.12, film_force=20.0, film_speed=0.9e-3,
        clamp=90.0, clamp_rate=0.4e6, ends=(0.0, 1.0), stiffness_exponent=240.0, damping_exponent=800.0, device_stiffness=350e3,
        device_mass=0.12)


def tolerances():
    """The tensioner of the tolerance cases: longer housings that carry more of the dissipation, and whose friction depends on the contact area."""
    return replace(
        Rig(), zone=5.5, ei_middle=1.10, offset=4.5e-3, loss=0.08, film_force=4.0, clamp=35.0, clamp_rate=None, slip=None,
        housing_stiffness=12.5e9, shear_strength=0.46e6, contact_stiffness=115e9)
