"""Laws of the hidden effects, each with an integration of its own.

A law gives the force F that holds `to` at the relative displacement x = q_to - q_from (N and m along x and y, N m and rad about z).
Exudyn asks for F at the end of a step of length h; the law keeps the state of the last accepted step and takes x to change linearly
within the step. `dynamic` is the complex stiffness dF/dx of a small motion e^{i w t} about the place x0, friction stuck.
"""
import math


class Law:
    """Parameters by name in SI units; laws without states need only `value` and `slope`."""

    def __init__(self, name, strength, **shape):
        self.name, self.shape = name, shape
        self.strength = strength
        self.reset(1.0)

    def reset(self, h):
        """State of the unloaded chain; h: step [s]."""
        self.h, self.x, self.state = h, 0.0, 0.0

    def advanced(self, x):
        """State at the end of the step that ends at x."""
        return 0.0

    def accept(self, x):
        """Takes the step that ended at x as done."""
        self.state = self.advanced(x)
        self.x = x

    def force(self, x, v):
        return self.value(x, v)

    def value(self, x, v):
        return 0.0

    def static(self, x):
        """Force after a long time at x: what relaxes has relaxed."""
        return self.value(x, 0.0)

    def dynamic(self, w, x0):
        return complex(self.slope(x0))

    def parameters(self):
        """Everything in SI units, as it stands in truth.json."""
        return {self.STRENGTH: self.strength, **self.shape}


class Cubic(Law):
    """F = k3 x^3."""
    STRENGTH = "k3"

    def value(self, x, v):
        return self.strength * x**3

    def slope(self, x):
        return 3 * self.strength * x * x


class Bilinear(Law):
    """F = k (max(x - x0, 0) - max(-x0, 0))."""
    STRENGTH = "k"

    def value(self, x, v):
        x0 = self.shape["x0"]
        return self.strength * (max(x - x0, 0.0) - max(-x0, 0.0))

    def slope(self, x):
        return self.strength if x > self.shape["x0"] else 0.0


class Gap(Law):
    """A stop behind a gap on one side: F = k max(x - g, 0) for side 1, mirrored for side -1."""
    STRENGTH = "k"

    def value(self, x, v):
        side = self.shape["side"]
        return side * self.strength * max(side * x - self.shape["g"], 0.0)

    def slope(self, x):
        return self.strength if self.shape["side"] * x > self.shape["g"] else 0.0


class Mass(Law):
    """F = m a along one axis. It is a mass of the model; here it has no force."""
    STRENGTH = "m"

    def slope(self, x):
        return 0.0


class SmoothCoulomb(Law):
    """F = f tanh(v/w)."""
    STRENGTH = "f"

    def value(self, x, v):
        return self.strength * math.tanh(v / self.shape["w"])

    def dynamic(self, w, x0):
        return 1j * w * self.strength / self.shape["w"]


class ElasticSlip(Law):
    """An elasto-plastic element: F = f u, du/dt = v/d, |u| <= 1; the return mapping is exact for a step of one direction."""
    STRENGTH = "f"

    def advanced(self, x):
        return min(max(self.state + (x - self.x) / self.shape["d"], -1.0), 1.0)

    def force(self, x, v):
        return self.strength * self.advanced(x)

    static = lambda self, x: self.force(x, 0.0)

    def dynamic(self, w, x0):
        return complex(self.strength / self.shape["d"])


class Maxwell(Law):
    """F = k s, ds/dt = v - s/tau; the exponential is exact for a constant v."""
    STRENGTH = "k"

    def advanced(self, x):
        tau = self.shape["tau"]
        decay = math.exp(-self.h / tau)
        return self.state * decay + (x - self.x) / self.h * tau * (1.0 - decay)

    def force(self, x, v):
        return self.strength * self.advanced(x)

    def static(self, x):
        return 0.0

    def dynamic(self, w, x0):
        st = 1j * w * self.shape["tau"]
        return self.strength * st / (1.0 + st)


class Film(Law):
    """F = f u, d du/dt = v - v0 sinh(u): a shear-thinning film behind an elastic contact.

    With y = tanh(u/2) it is the Riccati equation 2 d y' = v - 2 v0 y - v y^2, whose solution for a constant v is
    (y - y1)/(y - y2) = const exp(-t sqrt(v^2 + v0^2)/d) between the roots y1 = tanh(asinh(v/v0)/2) and y2 = -1/y1.
    """
    STRENGTH = "f"

    def advanced(self, x):
        v0, d = self.shape["v0"], self.shape["d"]
        v = (x - self.x) / self.h
        y = math.tanh(self.state / 2)
        decay = math.exp(-self.h * math.hypot(v, v0) / d)
        if abs(v) < 1e-9 * v0:
            y *= decay
        else:
            one = math.tanh(math.asinh(v / v0) / 2)
            two = -1.0 / one
            c = (y - one) / (y - two) * decay
            y = (one - c * two) / (1.0 - c)
        return 2 * math.atanh(min(max(y, -1 + 1e-15), 1 - 1e-15))

    def force(self, x, v):
        return self.strength * self.advanced(x)

    def static(self, x):
        return 0.0

    def dynamic(self, w, x0):
        iw = 1j * w
        return self.strength * iw / (iw * self.shape["d"] + self.shape["v0"])


LAWS = {
    "cubic_stiffness": Cubic, "bilinear_stiffness": Bilinear, "contact": Gap, "added_mass": Mass, "smooth_coulomb": SmoothCoulomb,
    "elastic_slip": ElasticSlip, "maxwell": Maxwell, "film": Film,
}
