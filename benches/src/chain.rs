//! A chain of bodies with six degrees of freedom each, joined by six-component connectors whose damping depends on frequency.
//!
//! Bodies lie along an arc of 45 mm radius, 5 mm apart, that climbs 0.7 mm a body, so that every axis couples with every other.
//! Body b has the dofs 6 b .. 6 b + 5: displacement u (m) and rotation r (rad) in fixed axes. Connector c joins body c - 1 (the
//! ground for c = 0) to body c at the point half-way, in the local frame t (along the chain), n (in the arc's plane), e = t x n.

use std::f64::consts::TAU;

use misfit::engine::blocktri::{BlockTriError, Element, FrfSystem};
use num_complex::Complex;
use serde_json::{Value, json};

pub type C64 = Complex<f64>;
type V3 = [f64; 3];

pub const DOFS: usize = 6;
const RADIUS: f64 = 0.045;
const STEP: f64 = 0.005;
const CLIMB: f64 = 0.0007;
/// kg, kg m^2
const MASS: f64 = 0.009;
const INERTIA: V3 = [0.6e-6, 0.9e-6, 1.1e-6];

/// z(w) = k (1 + i eta + beta i w tau / (1 + i w tau)): spring, constant loss factor, Maxwell branch.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    pub k: f64,
    pub eta: f64,
    pub beta: f64,
    pub tau: f64,
}

impl Law {
    pub fn stiffness(&self, w: f64) -> C64 {
        let s = C64::new(0.0, w * self.tau);
        self.k * (C64::new(1.0, self.eta) + self.beta * s / (1.0 + s))
    }
}

/// Axial, two shears, torsion, two bendings.
pub const LAWS: [Law; DOFS] = [
    Law { k: 3.0e8, eta: 0.03, beta: 0.10, tau: 4e-4 },
    Law { k: 6.0e6, eta: 0.04, beta: 0.15, tau: 3e-4 },
    Law { k: 4.0e6, eta: 0.05, beta: 0.12, tau: 2e-4 },
    Law { k: 300.0, eta: 0.05, beta: 0.20, tau: 5e-4 },
    Law { k: 900.0, eta: 0.06, beta: 0.18, tau: 6e-4 },
    Law { k: 600.0, eta: 0.05, beta: 0.22, tau: 3e-4 },
];

#[derive(Debug, Clone)]
pub struct Chain {
    pub bodies: usize,
    pub mass: Vec<(usize, usize, f64)>,
    /// Six per connector, axis by axis.
    pub rows: Vec<Vec<(usize, f64)>>,
}

impl Chain {
    pub fn new(bodies: usize) -> Self {
        let mass = (0..bodies)
            .flat_map(|b| (0..DOFS).map(move |d| (DOFS * b + d, DOFS * b + d, if d < 3 { MASS } else { INERTIA[d - 3] })))
            .collect();
        Self { bodies, mass, rows: (0..bodies).flat_map(connector).collect() }
    }

    pub fn n(&self) -> usize {
        DOFS * self.bodies
    }

    /// Elements with `group(axis)` as their coefficient.
    pub fn elements(&self, group: impl Fn(usize) -> usize) -> Vec<Element> {
        self.rows.iter().enumerate().map(|(at, row)| Element { group: group(at % DOFS), row: row.clone() }).collect()
    }

    /// One group per axis, shared by all connectors.
    pub fn system(&self) -> Result<FrfSystem, BlockTriError> {
        FrfSystem::new(self.n(), &[], &self.mass, &self.elements(|axis| axis))
    }

    /// Load across the chain at its free end.
    pub fn input(&self) -> usize {
        DOFS * (self.bodies - 1) + 1
    }

    /// Three displacements and a rotation, spread over the chain.
    pub fn outputs(&self) -> [usize; 4] {
        let body = |part: usize| DOFS * (self.bodies * part / 4).min(self.bodies - 1);
        [body(1) + 1, body(2), body(3) + 5, self.input()]
    }

    /// What a peer needs to build the same system.
    pub fn to_json(&self, omega: &[f64], laws: &[Law]) -> Value {
        json!({
            "n": self.n(), "mass": self.mass, "rows": self.rows, "omega": omega, "input": self.input(), "outputs": self.outputs(),
            "laws": laws.iter().map(|l| json!({"k": l.k, "eta": l.eta, "beta": l.beta, "tau": l.tau})).collect::<Vec<_>>(),
        })
    }
}

/// Lines from 20 Hz to 3 kHz, evenly spaced, in rad/s.
pub fn lines(count: usize) -> Vec<f64> {
    (0..count).map(|i| TAU * (20.0 + 2980.0 * i as f64 / (count - 1).max(1) as f64)).collect()
}

/// z_g(w) of [`LAWS`] for all groups.
pub fn coefficients(w: f64, z: &mut [C64]) {
    z.iter_mut().zip(&LAWS).for_each(|(z, law)| *z = law.stiffness(w));
}

fn point(at: f64) -> V3 {
    let angle = at * STEP / RADIUS;
    [RADIUS * angle.sin(), RADIUS * (1.0 - angle.cos()), CLIMB * at]
}

/// The six rows b of connector `c`: relative displacement and rotation at the point between bodies c - 1 and c, in the local frame.
fn connector(c: usize) -> Vec<Vec<(usize, f64)>> {
    let at = c as f64 - 0.5;
    let angle = at * STEP / RADIUS;
    let climb = CLIMB.atan2(STEP);
    let t = [angle.cos() * climb.cos(), angle.sin() * climb.cos(), climb.sin()];
    let n = [-angle.sin(), angle.cos(), 0.0];
    let frame = [t, n, cross(t, n)];
    let mut rows = Vec::new();
    for (axis, e) in (0..DOFS).map(|d| (d, frame[d % 3])) {
        let mut row = Vec::new();
        for (body, sign) in [(Some(c), 1.0), (c.checked_sub(1), -1.0)] {
            let Some(b) = body else { continue };
            // Displacement of the attachment point: u + r x arm, so e.(r x arm) = r.(arm x e).
            let arm = sub(point(at), point(b as f64));
            let (linear, angular) = if axis < 3 { (e, cross(arm, e)) } else { ([0.0; 3], e) };
            row.extend(linear.iter().chain(&angular).enumerate().filter(|(_, v)| **v != 0.0).map(|(d, v)| (DOFS * b + d, sign * v)));
        }
        rows.push(row);
    }
    rows
}

fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
