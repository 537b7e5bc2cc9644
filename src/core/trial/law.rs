//! The truth of a trial: hidden laws in forms and code of their own.
//!
//! Nothing here comes from `effect` or `engine`: linear laws stand in closed form in the frequency domain, hysteresis as Masing's rule over
//! its turning points or as an ordinary differential equation by Heun's method at small fixed steps, elastic laws as the geometry or the
//! exponential they are an expansion of. Every law is a pure shape of size about one at the largest tested motion.

use num_complex::Complex64;

use super::draw::Draw;

/// Motion across a connector.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    /// Displacement [m].
    pub x: f64,
    /// Velocity [m/s].
    pub v: f64,
    /// Acceleration [m/s2].
    pub a: f64,
}

/// What the tests show at the place: the sizes that shapes are drawn from.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Largest displacement amplitude [m].
    pub x: f64,
    /// Lowest and highest drive [rad/s].
    pub w: (f64, f64),
}

/// A law of size one; `x` and `v` in its fields are lengths and velocities [SI].
#[derive(Clone, Debug)]
pub enum Law {
    /// `v / v1`.
    Dashpot { v1: f64 },
    /// Spring across the direction of motion, at its free length `h` in the middle: hardens as x^3 for x << h.
    Transverse { h: f64, x1: f64 },
    /// `exp(x/h) - 1 - x/h`: as x^2 for x << h.
    Exponential { h: f64, x1: f64 },
    /// Another spring from `x0` on.
    Second { x0: f64, x1: f64 },
    /// A sphere of Hertz that touches beyond a gap, on the side of the sign.
    Sphere { gap: f64, side: f64, x1: f64 },
    /// `v |v|`.
    Drag { v1: f64 },
    /// `|v|^n`.
    Fluid { n: f64, v1: f64 },
    /// Spring and damper in series.
    Relaxing { tau: f64, x1: f64 },
    /// Loss that is equal at all frequencies, with the rise of the stiffness that causality asks for: `i + (2/pi) ln(w/w1)`.
    Hysteretic { w1: f64, x1: f64 },
    /// `(i w/w1)^alpha`.
    Fractional { alpha: f64, w1: f64, x1: f64 },
    /// Sign of the velocity.
    Dry,
    /// A slider behind a spring, by Masing's rule.
    Slider { d: f64 },
    /// Uniformly distributed sliders: backbone `2u - u^2`, `u = x/d`, by Masing's rule.
    Sliders { d: f64 },
    /// `dz/dt = (v - (|v| z |z|^(n-1) + v |z|^n)/2)/d`.
    Yielding { d: f64, n: f64 },
    /// Bristles with a level that falls with velocity.
    Bristles { d: f64, vs: f64, b: f64 },
    /// Dry friction that falls with velocity.
    Falling { vs: f64, b: f64 },
    /// `ln(v/v0 + sqrt(1 + (v/v0)^2))`.
    Thinning { v0: f64, v1: f64 },
    /// `a / a1`.
    Inertia { a1: f64 },
    /// Outside the library: a damper whose coefficient grows as x^2 (a metering pin).
    Metered { x1: f64, v1: f64 },
    /// Outside: a force periodic in the displacement.
    Cogging { period: f64 },
    /// Outside: friction in the middle of the travel alone (a worn guide).
    Worn { x0: f64 },
    /// Outside: a flag: loss only beyond a yield displacement, nothing left at rest.
    Flag { x0: f64, width: f64 },
}

/// What a law remembers.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    z: f64,
    last: Option<(f64, f64)>,
    direction: f64,
    turns: Vec<(f64, f64)>,
}

impl Law {
    /// A law that the library knows under the name of `effect`, with shapes drawn.
    pub fn of(effect: &str, s: Sizes, draw: &mut Draw) -> Option<Law> {
        let (x1, v1) = (s.x, s.x * s.w.1);
        let w1 = (s.w.0 * s.w.1).sqrt();
        Some(match effect {
            "viscous" => Law::Dashpot { v1 },
            // Still what the name says, within 2 %, at three times x1, as far as a proposed next test reaches.
            "cubic_stiffness" => Law::Transverse { h: 24.0 * x1, x1 },
            "quadratic_stiffness" => Law::Exponential { h: 60.0 * x1, x1 },
            "bilinear_stiffness" => Law::Second { x0: draw.between(-0.4, 0.4) * x1, x1 },
            "contact" => Law::Sphere { gap: draw.between(0.1, 0.6) * x1, side: draw.sign(), x1 },
            "quadratic_damping" => Law::Drag { v1 },
            "power_damping" => Law::Fluid { n: if draw.chance(0.5) { draw.between(0.3, 0.7) } else { draw.between(1.4, 1.8) }, v1 },
            "maxwell" => Law::Relaxing { tau: draw.log(1.0 / s.w.1, 1.0 / s.w.0), x1 },
            "structural_damping" => Law::Hysteretic { w1, x1 },
            "springpot" => Law::Fractional { alpha: draw.between(0.2, 0.8), w1, x1 },
            "coulomb" => Law::Dry,
            "elastic_slip" => Law::Slider { d: draw.log(0.05, 0.5) * x1 },
            "iwan" => Law::Sliders { d: draw.between(0.4, 1.2) * x1 },
            "bouc_wen" => Law::Yielding { d: draw.log(0.05, 0.4) * x1, n: draw.between(1.2, 3.0) },
            "lugre" => Law::Bristles { d: draw.log(0.03, 0.1) * x1, vs: draw.log(0.05, 0.2) * v1, b: draw.between(0.4, 1.0) },
            "stribeck" => Law::Falling { vs: draw.log(0.05, 0.3) * v1, b: draw.between(0.4, 1.0) },
            "film" => Law::Thinning { v0: draw.log(0.003, 0.2) * v1, v1 },
            "added_mass" => Law::Inertia { a1: v1 * s.w.1 },
            _ => return None,
        })
    }

    /// A law the library does not have, and what to call it.
    pub fn outside(s: Sizes, draw: &mut Draw) -> (&'static str, Law) {
        match draw.below(4) {
            0 => ("metered damper", Law::Metered { x1: s.x, v1: s.x * s.w.1 }),
            1 => ("cogging", Law::Cogging { period: draw.between(0.25, 0.6) * s.x }),
            2 => ("worn guide", Law::Worn { x0: draw.between(0.2, 0.5) * s.x }),
            _ => ("flag", Law::Flag { x0: draw.between(0.2, 0.4) * s.x, width: draw.between(0.1, 0.2) * s.x }),
        }
    }

    /// Dynamic stiffness where the law is linear [1/m].
    pub fn linear(&self, w: f64) -> Option<Complex64> {
        let i = Complex64::i();
        Some(match *self {
            Law::Dashpot { v1 } => i * w / v1,
            Law::Relaxing { tau, x1 } => i * w * tau / (1.0 + i * w * tau) / x1,
            Law::Hysteretic { w1, x1 } => (i + std::f64::consts::FRAC_2_PI * (w / w1).ln()) / x1,
            Law::Fractional { alpha, w1, x1 } => Complex64::from_polar((w / w1).powf(alpha), alpha * std::f64::consts::FRAC_PI_2) / x1,
            Law::Inertia { a1 } => Complex64::new(-w * w / a1, 0.0),
            _ => return None,
        })
    }

    /// Dynamic stiffness of small motion about rest, friction stuck [1/m]; none where there is no such limit.
    pub fn small(&self, w: f64) -> Option<Complex64> {
        let real = match *self {
            Law::Slider { d } | Law::Yielding { d, .. } | Law::Bristles { d, .. } => 1.0 / d,
            Law::Sliders { d } => 2.0 / d,
            Law::Transverse { .. } | Law::Exponential { .. } | Law::Sphere { .. } | Law::Drag { .. } => 0.0,
            Law::Second { x0, x1 } => {
                if x0 < 0.0 {
                    1.0 / x1
                } else {
                    0.0
                }
            }
            Law::Fluid { n, .. } if n > 1.0 => 0.0,
            _ => return self.linear(w),
        };
        Some(Complex64::new(real, 0.0))
    }

    /// Force at the end of a step of `dt`.
    pub fn force(&self, m: Motion, dt: f64, memory: &mut Memory) -> f64 {
        match *self {
            Law::Dashpot { v1 } => m.v / v1,
            Law::Transverse { h, x1 } => across(m.x, h) / across(x1, h),
            Law::Exponential { h, x1 } => ((m.x / h).exp_m1() - m.x / h) / ((x1 / h).exp_m1() - x1 / h),
            Law::Second { x0, x1 } => ((if m.x > x0 { m.x - x0 } else { 0.0 }) - (if x0 < 0.0 { -x0 } else { 0.0 })) / x1,
            Law::Sphere { gap, side, x1 } => {
                let depth = side * m.x - gap;
                if depth > 0.0 { side * depth * depth.sqrt() / ((x1 - gap) * (x1 - gap).sqrt()) } else { 0.0 }
            }
            Law::Drag { v1 } => (m.v / v1) * (m.v / v1).abs(),
            Law::Fluid { n, v1 } => (m.v / v1).abs().powf(n) * m.v.signum(),
            Law::Dry => sign(m.v),
            Law::Thinning { v0, v1 } => {
                let logarithm = |v: f64| sign(v) * ((v / v0).abs() + (1.0 + (v / v0).powi(2)).sqrt()).ln();
                logarithm(m.v) / logarithm(v1)
            }
            Law::Falling { vs, b } => sign(m.v) * (1.0 + b * (-(m.v / vs).powi(2)).exp()),
            Law::Inertia { a1 } => m.a / a1,
            Law::Relaxing { tau, x1 } => memory.heun(m, dt, |z, v| v - z / tau) / x1,
            Law::Yielding { d, n } => {
                memory.heun(m, dt, |z, v| (v - 0.5 * (v.abs() * z * z.abs().powf(n - 1.0) + v * z.abs().powf(n))) / d)
            }
            Law::Bristles { d, vs, b } => memory.heun(m, dt, |z, v| (v - v.abs() * z / (1.0 + b * (-(v / vs).powi(2)).exp())) / d),
            Law::Slider { d } => memory.masing(m.x, |u| (u / d).min(1.0)),
            Law::Sliders { d } => memory.masing(m.x, |u| if u < d { (2.0 - u / d) * u / d } else { 1.0 }),
            Law::Metered { x1, v1 } => (m.x / x1).powi(2) * m.v / v1,
            Law::Cogging { period } => (std::f64::consts::TAU * m.x / period).sin(),
            Law::Worn { x0 } => {
                if m.x.abs() < x0 {
                    sign(m.v)
                } else {
                    0.0
                }
            }
            Law::Flag { x0, width } => {
                // A slider that is carried along only beyond x0.
                let loaded = (m.x.abs() - x0).max(0.0);
                let friction = (loaded / width).min(1.0) * sign(m.v * m.x);
                (0.5 * friction + (loaded / width).min(1.0)) * sign(m.x)
            }
            // Closed forms only.
            Law::Hysteretic { .. } | Law::Fractional { .. } => f64::NAN,
        }
    }
}

impl Memory {
    /// One step of Heun's method on `dz/dt = rate(z, v)`; the velocity goes linearly over the step.
    fn heun(&mut self, m: Motion, dt: f64, rate: impl Fn(f64, f64) -> f64) -> f64 {
        let before = self.last.map_or(m.v, |l| l.1);
        let first = rate(self.z, before);
        let second = rate(self.z + dt * first, m.v);
        self.z += 0.5 * dt * (first + second);
        self.last = Some((m.x, m.v));
        self.z
    }

    /// Masing's rule: branches are the backbone at twice its size from the last turning point; what closes a loop wipes it out.
    fn masing(&mut self, x: f64, backbone: impl Fn(f64) -> f64) -> f64 {
        let (x0, f0) = self.last.unwrap_or((0.0, 0.0));
        let direction = sign(x - x0);
        if direction != 0.0 {
            if self.direction != 0.0 && direction != self.direction {
                self.turns.push((x0, f0));
            }
            self.direction = direction;
        }
        loop {
            match self.turns.as_slice() {
                [.., before, _] if self.direction * (x - before.0) >= 0.0 => self.turns.truncate(self.turns.len() - 2),
                [first] if x.abs() > first.0.abs() && x * first.0 < 0.0 => self.turns.clear(),
                _ => break,
            }
        }
        let force = match self.turns.last() {
            None => sign(x) * backbone(x.abs()),
            Some((xt, ft)) => ft + self.direction * 2.0 * backbone(0.5 * (x - xt).abs()),
        };
        self.last = Some((x, force));
        force
    }
}

/// Force of a spring of unit stiffness and free length `h` across the motion.
fn across(x: f64, h: f64) -> f64 {
    x * (1.0 - h / (h * h + x * x).sqrt())
}

fn sign(v: f64) -> f64 {
    if v > 0.0 {
        1.0
    } else if v < 0.0 {
        -1.0
    } else {
        0.0
    }
}
