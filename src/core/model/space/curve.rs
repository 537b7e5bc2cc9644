//! Arcs that follow each other without a kink, and the parts along them.

use super::super::ModelError;
use super::body::Part;
use super::joint::Frame;
use super::rotation::{V3, sub};

/// Angle below which an arc is straight [rad]: its sagitta is a part in 10^11 of its length.
const STRAIGHT: f64 = 1e-10;

/// A circular arc, or a straight piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arc {
    /// Radius [m] and angle [rad]; a positive angle turns left, from x towards y.
    Turn {
        /// Radius of the curve of the parts' centres [m].
        radius: f64,
        /// Angle it extends over [rad].
        angle: f64,
    },
    /// Length of a straight piece [m].
    Straight(f64),
}

impl Arc {
    /// Length [m].
    pub fn length(&self) -> f64 {
        match self {
            Arc::Turn { radius, angle } => radius * angle.abs(),
            Arc::Straight(length) => *length,
        }
    }
    /// Point and heading after the distance `s` from `(x, y, heading)`.
    fn follow(&self, (x, y, heading): (f64, f64, f64), s: f64) -> (f64, f64, f64) {
        match self {
            Arc::Turn { radius, angle } => {
                let side = radius * angle.signum();
                let turned = heading + s / side;
                (x + side * (turned.sin() - heading.sin()), y - side * (turned.cos() - heading.cos()), turned)
            }
            Arc::Straight(_) => (x + s * heading.cos(), y + s * heading.sin(), heading),
        }
    }
}

/// Cross-section of the parts along a curve; it gives mass and inertia with the length of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Extent along z [m].
    pub width: f64,
    /// Extent across the curve, in its plane [m].
    pub thickness: f64,
    /// Density [kg/m3].
    pub density: f64,
}

/// A plane curve of arcs that share their tangents where they meet.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Where it begins [m].
    pub start: V3<f64>,
    /// Direction in which it begins [rad], from the x axis towards y.
    pub heading: f64,
    /// The arcs, in order.
    pub arcs: Vec<Arc>,
}

impl Curve {
    /// Length [m].
    pub fn length(&self) -> f64 {
        self.arcs.iter().map(Arc::length).sum()
    }

    /// Point and heading at the distance `s` along it.
    pub fn at(&self, s: f64) -> (V3<f64>, f64) {
        let mut here = (self.start[0], self.start[1], self.heading);
        let mut left = s;
        for (k, arc) in self.arcs.iter().enumerate() {
            let length = arc.length();
            if left <= length || k + 1 == self.arcs.len() {
                here = arc.follow(here, left);
                break;
            }
            here = arc.follow(here, length);
            left -= length;
        }
        ([here.0, here.1, self.start[2]], here.2)
    }

    /// The axes of a connector on the curve: y along it, z as it is, x to the right of it.
    pub fn frame(&self, s: f64) -> Frame {
        let (point, heading) = self.at(s);
        let (sin, cos) = heading.sin_cos();
        Frame { point, axes: [[sin, cos, 0.0], [-cos, sin, 0.0], [0.0, 0.0, 1.0]] }
    }

    /// `n` parts of equal length, and the connectors at the `n - 1` interfaces between them. Without a section the parts have no mass.
    pub fn parts(&self, n: usize, section: Option<&Section>) -> (Vec<Part>, Vec<Frame>) {
        let step = self.length() / n as f64;
        let parts = (0..n).map(|k| {
            let frame = self.frame((k as f64 + 0.5) * step);
            let (mass, inertia) = section.map_or((0.0, [[0.0; 3]; 3]), |s| s.inertia(step, &frame));
            Part { origin: frame.point, centre: [0.0; 3], mass, inertia, dofs: [None; 6] }
        });
        (parts.collect(), (1..n).map(|k| self.frame(k as f64 * step)).collect())
    }

    /// The same arcs with `factor` times their curvature: lengths, start and the direction from start to end are kept. A factor of 0 makes them straight.
    pub fn bent(&self, factor: f64) -> Curve {
        let of = |arc: &Arc| match *arc {
            Arc::Turn { radius, angle } if (factor * angle).abs() > STRAIGHT => {
                Arc::Turn { radius: radius / factor.abs(), angle: factor * angle }
            }
            Arc::Turn { .. } => Arc::Straight(arc.length()),
            Arc::Straight(length) => Arc::Straight(length),
        };
        let mut bent = Curve { arcs: self.arcs.iter().map(of).collect(), ..self.clone() };
        let chord = |curve: &Curve| {
            let d = sub(curve.at(curve.length()).0, curve.start);
            d[1].atan2(d[0])
        };
        bent.heading += chord(self) - chord(&bent);
        bent
    }

    /// How far the direction of the curve runs [rad]: beyond a full turn arcs of one side meet themselves.
    pub fn swept(&self) -> f64 {
        let turns = self.arcs.iter().map(|a| if let Arc::Turn { angle, .. } = a { *angle } else { 0.0 });
        let (mut here, mut low, mut high) = (0.0f64, 0.0f64, 0.0f64);
        for turn in turns {
            here += turn;
            (low, high) = (low.min(here), high.max(here));
        }
        high - low
    }

    /// Checks the numbers.
    pub fn check(&self) -> Result<(), ModelError> {
        for (k, arc) in self.arcs.iter().enumerate() {
            let good = match arc {
                Arc::Turn { radius, angle } => radius.is_finite() && *radius > 0.0 && angle.is_finite() && *angle != 0.0,
                Arc::Straight(length) => length.is_finite() && *length > 0.0,
            };
            if !good {
                let message = format!("arc {} is {arc:?}", k + 1);
                return Err(ModelError::invalid(format!("arc {}", k + 1), message, "a radius above 0 and an angle that is not 0"));
            }
        }
        if self.arcs.is_empty() {
            return Err(ModelError::invalid("arc", "a curve without arcs", "at least one [[arc]]"));
        }
        Ok(())
    }
}

impl Section {
    /// Mass and inertia tensor about its centre, along fixed axes, of a straight block of this length on a frame's axes.
    pub fn inertia(&self, length: f64, frame: &Frame) -> (f64, [[f64; 3]; 3]) {
        let mass = self.density * self.width * self.thickness * length;
        let square = [self.thickness, length, self.width].map(|a| a * a * mass / 12.0);
        let principal = [square[1] + square[2], square[0] + square[2], square[0] + square[1]];
        let a = &frame.axes;
        let tensor = std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * principal[k] * a[j][k]).sum()));
        (mass, tensor)
    }

    /// How many equal parts a length needs under the modal-basis rule: every mode below twice the highest frequency of interest is to be
    /// one of the chain's. A free beam of bending stiffness `E I`, `I = width thickness^3 / 12`, bends at the frequency `f` with
    /// `(l / pi) sqrt(2 pi f / c)` half waves, `c^2 = E I / (rho A)`; ten parts to each of them keep the chain's frequencies to a few
    /// tenths of a per cent of the beam's.
    pub fn parts_below(&self, length: f64, modulus: f64, highest: f64) -> usize {
        let speed = (modulus * self.thickness * self.thickness / (12.0 * self.density)).sqrt();
        let wave = length * (2.0 * std::f64::consts::TAU * highest / speed).sqrt() / std::f64::consts::PI;
        ((10.0 * wave).ceil() as usize).max(2)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    #[test]
    fn arcs_follow_each_other() {
        let curve = Curve {
            start: [0.0; 3],
            heading: FRAC_PI_2,
            arcs: vec![Arc::Straight(1.0), Arc::Turn { radius: 2.0, angle: -FRAC_PI_2 }, Arc::Turn { radius: 1.0, angle: FRAC_PI_2 }],
        };
        let (p, heading) = curve.at(1.0 + PI);
        assert!((p[0] - 2.0).abs() < 1e-15 && (p[1] - 3.0).abs() < 1e-15 && heading.abs() < 1e-15, "{p:?} {heading}");
        let (p, heading) = curve.at(curve.length());
        assert!((p[0] - 3.0).abs() < 1e-15 && (p[1] - 4.0).abs() < 1e-15 && (heading - FRAC_PI_2).abs() < 1e-15, "{p:?}");
        let (parts, frames) = curve.parts(7, Some(&Section { width: 0.02, thickness: 0.01, density: 3200.0 }));
        assert_eq!((parts.len(), frames.len()), (7, 6));
        let mass: f64 = parts.iter().map(|p| p.mass).sum();
        assert!((mass - 3200.0 * 0.02 * 0.01 * curve.length()).abs() < 1e-12);
        // y along the curve, x to its right.
        let f = curve.frame(0.5);
        assert!((f.axes[0][0] - 1.0).abs() < 1e-15 && (f.axes[1][1] - 1.0).abs() < 1e-15);
    }
}
