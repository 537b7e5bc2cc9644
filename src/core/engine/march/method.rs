//! Coefficients of the time integration.

/// Coefficients of the method for a spectral radius at infinite frequency.
#[derive(Clone, Copy, Debug)]
pub(super) struct Alpha {
    m: f64,
    f: f64,
    beta: f64,
    gamma: f64,
    /// Quasi-static: nothing has a velocity.
    pub still: bool,
}

/// Derivatives of auxiliary acceleration, velocity and acceleration with respect to the displacement at the end of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rates {
    pub w: f64,
    pub v: f64,
    pub a: f64,
}

impl Alpha {
    pub fn new(radius: f64) -> Self {
        let (m, f) = ((2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0));
        Alpha { m, f, beta: 0.25 * (1.0 - m + f).powi(2), gamma: 0.5 - m + f, still: false }
    }

    pub fn rates(&self, dt: f64) -> Rates {
        if self.still {
            return Rates { w: 0.0, v: 0.0, a: 0.0 };
        }
        let w = 1.0 / (self.beta * dt * dt);
        Rates { w, v: self.gamma * dt * w, a: (1.0 - self.m) / (1.0 - self.f) * w }
    }

    /// Auxiliary acceleration, velocity, acceleration of a displacement at the end of a step from those at its start.
    #[inline]
    pub fn end(&self, dt: f64, q: f64, q0: f64, v0: f64, w0: f64, a0: f64) -> (f64, f64, f64) {
        if self.still {
            return (0.0, 0.0, 0.0);
        }
        let w = (q - q0 - dt * v0) / (self.beta * dt * dt) - (0.5 / self.beta - 1.0) * w0;
        let v = v0 + dt * ((1.0 - self.gamma) * w0 + self.gamma * w);
        (w, v, ((1.0 - self.m) * w + self.m * w0 - self.f * a0) / (1.0 - self.f))
    }

    /// The same of no displacement, entry by entry: from `[q0, v0, w0, a0]` to `[w, v, a]`.
    #[inline(always)]
    pub fn carried(&self, dt: f64, [q0, v0, w0, a0]: [&[f64]; 4], [w, v, a]: [&mut [f64]; 3]) {
        if self.still {
            [w, v, a].into_iter().for_each(|u| u.fill(0.0));
            return;
        }
        let n = w.len();
        let (q0, v0, w0, a0, v, a) = (&q0[..n], &v0[..n], &w0[..n], &a0[..n], &mut v[..n], &mut a[..n]);
        let (by_q, by_w) = (-1.0 / (self.beta * dt * dt), -(0.5 / self.beta - 1.0));
        let (v_old, v_new) = (dt * (1.0 - self.gamma), dt * self.gamma);
        let part = 1.0 / (1.0 - self.f);
        let (a_new, a_w, a_a) = ((1.0 - self.m) * part, self.m * part, -self.f * part);
        for c in 0..n {
            let new = by_q * (q0[c] + dt * v0[c]) + by_w * w0[c];
            w[c] = new;
            v[c] = v0[c] + v_old * w0[c] + v_new * new;
            a[c] = a_new * new + a_w * w0[c] + a_a * a0[c];
        }
    }
}
