//! The inertia of a rigid part.

use num_dual::DualSVec64;

use super::joint::Pose;
use super::rotation::*;
use crate::effect::Num;

/// A rigid part. Its coordinates are the displacement of its origin and its rotation vector, along fixed axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Origin in the reference position [m]: the point whose displacements are coordinates (a pin, the loaded point), by default the
    /// centre of mass.
    pub origin: V3<f64>,
    /// Centre of mass relative to the origin [m].
    pub centre: V3<f64>,
    /// Mass [kg].
    pub mass: f64,
    /// Inertia tensor about the centre of mass, along fixed axes in the reference position [kg m2].
    pub inertia: M3<f64>,
    /// Degree of freedom of x, y, z, theta, phi, psi; `None` where it is held at 0.
    pub dofs: [Option<usize>; 6],
}

/// Inertial forces on the six coordinates with their derivatives; rows: coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inertial {
    /// General force that the acceleration takes, moved to the side of the internal forces.
    pub p: [f64; 6],
    /// Derivatives with respect to the coordinates.
    pub by_q: [[f64; 6]; 6],
    /// To the velocities.
    pub by_v: [[f64; 6]; 6],
    /// To the accelerations: the mass matrix.
    pub by_a: [[f64; 6]; 6],
}

impl Part {
    /// Inertia tensor about the origin.
    pub fn inertia_about_origin(&self) -> M3<f64> {
        let (d, m) = (self.centre, self.mass);
        std::array::from_fn(|i| std::array::from_fn(|j| self.inertia[i][j] + m * (if i == j { dot(d, d) } else { 0.0 } - d[i] * d[j])))
    }

    /// Mass or moment of inertia about the origin that the `k`-th coordinate sees by itself [kg, kg m2].
    pub fn mass_along(&self, k: usize) -> f64 {
        if k < 3 { self.mass } else { self.inertia_about_origin()[k - 3][k - 3] }
    }

    /// Inertial forces of d'Alembert on the six coordinates: with the angular velocity `W = T'w` and acceleration `W' = T'w' + (T')'w`
    /// along the turned axes, centre of mass `d` and inertia `J` about the origin,
    /// `p_u = m (u'' + R (W' x d + W x (W x d)))`, `p_t = T (J W' + W x J W + m d x R'u'')`.
    pub fn inertial<T: Num>(&self, pose: &Pose<T>, u: V3<T>, rate: V3<T>, acceleration: V3<T>) -> [T; 6] {
        let (turn, less_unit, spin) = (pose.turn, &pose.less_unit, &pose.spin);
        let omega = transposed_times(spin, rate);
        let alpha = add(transposed_times(spin, acceleration), times(&slope_of_transposed(turn, rate), rate));
        let j = matrix::<T>(&self.inertia_about_origin());
        let mut moment = add(times(&j, alpha), cross(omega, times(&j, omega)));
        let mut force = u.map(|x| x * self.mass);
        if self.centre != [0.0; 3] {
            let d = vector::<T>(self.centre);
            let forward = |v: V3<T>| add(v, times(less_unit, v));
            let offset = add(cross(alpha, d), cross(omega, cross(omega, d)));
            force = add(force, forward(offset).map(|x| x * self.mass));
            let seen = add(u, transposed_times(less_unit, u));
            moment = add(moment, cross(d, seen).map(|x| x * self.mass));
        }
        let moment = times(spin, moment);
        [force[0], force[1], force[2], moment[0], moment[1], moment[2]]
    }

    /// Inertial forces and their derivatives at coordinates `q`, velocities `v`, accelerations `a`.
    pub fn inertial_tangent(&self, q: &[f64; 6], v: &[f64; 6], a: &[f64; 6]) -> Inertial {
        let mut out = Inertial::default();
        let seed = |value: f64, k: usize| DualSVec64::<9>::from_re(value).derivative(k);
        let at = |x: &[f64; 6], first: usize| -> V3<DualSVec64<9>> { std::array::from_fn(|i| seed(x[3 + i], first + i)) };
        let u: V3<DualSVec64<9>> = std::array::from_fn(|i| DualSVec64::from_re(a[i]));
        let p = self.inertial(&Pose::turned(at(q, 0)), u, at(v, 3), at(a, 6));
        for (i, p) in p.iter().enumerate() {
            out.p[i] = p.re;
            if let Some(d) = &p.eps.0 {
                for j in 0..3 {
                    (out.by_q[i][3 + j], out.by_v[i][3 + j], out.by_a[i][3 + j]) = (d[j], d[3 + j], d[6 + j]);
                }
            }
        }
        // The mass matrix is symmetric, and of displacements alone it is the mass.
        for i in 0..3 {
            out.by_a[i][i] = self.mass;
            for j in 0..3 {
                out.by_a[3 + j][i] = out.by_a[i][3 + j];
            }
        }
        out
    }

    /// Inertial forces alone.
    pub fn inertial_forces(&self, pose: &Pose<f64>, v: &[f64; 6], a: &[f64; 6]) -> [f64; 6] {
        self.inertial(pose, [a[0], a[1], a[2]], [v[3], v[4], v[5]], [a[3], a[4], a[5]])
    }

    /// Inertial forces with the mass matrix alone: enough for Newton's method where a step turns a part by little.
    pub fn inertial_by_acceleration(&self, pose: &Pose<f64>, v: &[f64; 6], a: &[f64; 6]) -> Inertial {
        let mut out = Inertial { p: self.inertial_forces(pose, v, a), ..Inertial::default() };
        let (less_unit, spin) = (&pose.less_unit, &pose.spin);
        let turned = product(&product(spin, &self.inertia_about_origin()), &transposed(spin));
        for i in 0..3 {
            out.by_a[i][i] = self.mass;
            out.by_a[3 + i][3..].copy_from_slice(&turned[i]);
        }
        if self.centre != [0.0; 3] {
            // m T d~ R'.
            let r: M3<f64> = std::array::from_fn(|i| std::array::from_fn(|j| less_unit[i][j] + f64::from(i == j)));
            let offset = product(&product(spin, &tilde(self.centre)), &transposed(&r));
            for i in 0..3 {
                for j in 0..3 {
                    out.by_a[3 + i][j] = self.mass * offset[i][j];
                    out.by_a[j][3 + i] = out.by_a[3 + i][j];
                }
            }
        }
        out
    }

    /// The mass matrix at a rotation vector.
    pub fn mass_matrix<T: Num>(&self, turn: V3<T>) -> [[T; 6]; 6] {
        let (pose, zero) = (Pose::turned(turn), [T::from(0.0); 3]);
        let unit = |k: usize| -> V3<T> { std::array::from_fn(|i| T::from(f64::from(i == k))) };
        let columns: [[T; 6]; 6] = std::array::from_fn(|k| {
            if k < 3 { self.inertial(&pose, unit(k), zero, zero) } else { self.inertial(&pose, zero, zero, unit(k - 3)) }
        });
        std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]))
    }
}

#[cfg(test)]
mod tests {
    use num_dual::Dual64;

    use super::*;

    fn part() -> Part {
        Part {
            origin: [0.0; 3],
            centre: [0.02, -0.01, 0.03],
            mass: 1.3,
            inertia: [[2e-3, 1e-4, -2e-4], [1e-4, 3e-3, 3e-4], [-2e-4, 3e-4, 4e-3]],
            dofs: [None; 6],
        }
    }

    /// Lagrange's equations from the kinetic energy are another way to the same forces.
    #[test]
    fn inertial_forces_are_those_of_lagrange() {
        let part = part();
        let energy = |q: [Dual64; 6], v: [Dual64; 6]| {
            let m = part.mass_matrix([q[3], q[4], q[5]]);
            let mut sum = Dual64::from_re(0.0);
            for i in 0..6 {
                for j in 0..6 {
                    sum += m[i][j] * v[i] * v[j] * 0.5;
                }
            }
            sum
        };
        let path = |t: f64| -> [[f64; 6]; 3] {
            let phase = |i: usize| (1.0 + 0.3 * i as f64, 0.2 * i as f64);
            [
                std::array::from_fn(|i| {
                    let (w, p) = phase(i);
                    0.8 * (w * t + p).sin()
                }),
                std::array::from_fn(|i| {
                    let (w, p) = phase(i);
                    0.8 * w * (w * t + p).cos()
                }),
                std::array::from_fn(|i| {
                    let (w, p) = phase(i);
                    -0.8 * w * w * (w * t + p).sin()
                }),
            ]
        };
        let gradient = |t: f64, of_v: bool, k: usize| {
            let [q, v, _] = path(t);
            let dual = |x: [f64; 6], on: bool| std::array::from_fn(|i| Dual64::new(x[i], f64::from(on && i == k)));
            energy(dual(q, !of_v), dual(v, of_v)).eps
        };
        for t in [0.3, 1.1, 2.6] {
            let [q, v, a] = path(t);
            let out = part.inertial_tangent(&q, &v, &a);
            for k in 0..6 {
                let h = 1e-5;
                let rate = (gradient(t + h, true, k) - gradient(t - h, true, k)) / (2.0 * h);
                let lagrange = rate - gradient(t, false, k);
                assert!((out.p[k] - lagrange).abs() < 1e-8 * (1.0 + lagrange.abs()), "{t} {k}: {} {lagrange}", out.p[k]);
            }
        }
    }

    #[test]
    fn their_derivatives_agree_with_differences() {
        let part = part();
        let (q, v, a) = ([0.1, 0.2, 0.3, 0.9, -0.7, 1.2], [1.0, -2.0, 0.5, 3.0, -1.0, 2.0], [4.0, 1.0, -3.0, 20.0, -9.0, 5.0]);
        let out = part.inertial_tangent(&q, &v, &a);
        let short = part.inertial_by_acceleration(&Pose::new(&q), &v, &a);
        let m = part.mass_matrix([q[3], q[4], q[5]]);
        for j in 0..6 {
            assert!((short.p[j] - out.p[j]).abs() < 1e-13 && (0..6).all(|i| (short.by_a[i][j] - out.by_a[i][j]).abs() < 1e-14));
            let moved = |which: usize, h: f64| {
                let mut x = [q, v, a];
                x[which][j] += h;
                part.inertial_tangent(&x[0], &x[1], &x[2]).p
            };
            for (which, exact) in [&out.by_q, &out.by_v, &out.by_a].into_iter().enumerate() {
                let (up, down) = (moved(which, 1e-6), moved(which, -1e-6));
                for i in 0..6 {
                    let numeric = (up[i] - down[i]) / 2e-6;
                    assert!((exact[i][j] - numeric).abs() < 1e-7 * (1.0 + numeric.abs()), "{which} {i} {j}: {} {numeric}", exact[i][j]);
                    assert!((m[i][j] - m[j][i]).abs() < 1e-15 && (m[i][j] - out.by_a[i][j]).abs() < 1e-14);
                }
            }
        }
    }
}
