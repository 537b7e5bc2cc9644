//! What a connector measures between two rigid parts, and how that changes with their coordinates.
//!
//! ```text
//!                 part i                          part i+1
//!            .---------------.             .---------------.
//!            |   o_i         |    a  b     |         o_i+1 |
//!            |    x - - - - -|- - >||< - - |- - - - - x    |       a, b: the same point of the connector, fixed to
//!            |   origin      |     |       |     origin    |             either part; they coincide in the reference
//!            '---------------'   y ^       '---------------'       A, B: the same axes, fixed to either part
//!                                  |--> x  (A)
//! ```
//!
//! The six components are those of `b - a` along the axes `A` of the first part (x, y, z), and the rotation vector of `A'B` along
//! the same axes (theta about x, phi about y, psi about z). Both ends carry an arm from the part's origin to the connector's point, so
//! that a part turning about its origin strains no stiff axis by itself: comparing the origins alone would forbid bending where k_x is
//! stiff. A general force on these components acts with the transposed derivative: equal and opposite forces and moments on the two
//! parts at one point of space, so that they do work on nothing but the six components.

use super::rotation::*;
use crate::effect::Num;

/// Where a connector sits: the point and the axes (columns x, y, z), both in the reference position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The point [m].
    pub point: V3<f64>,
    /// Unit vectors of its axes as columns.
    pub axes: M3<f64>,
}

/// Position and orientation of a part, relative to the reference.
#[derive(Clone, Copy, Debug)]
pub struct Pose<T> {
    /// Displacement of the origin.
    pub u: V3<T>,
    /// Rotation vector.
    pub turn: V3<T>,
    /// `R - 1`.
    pub less_unit: M3<T>,
    /// `T`: spin per rate of the rotation vector.
    pub spin: M3<T>,
}

impl<T: Num> Pose<T> {
    /// The pose of the coordinates `q`: displacement of the origin, then rotation vector, along fixed axes.
    #[inline]
    pub fn new(q: &[T; 6]) -> Self {
        Pose { u: [q[0], q[1], q[2]], ..Pose::turned([q[3], q[4], q[5]]) }
    }

    /// Turned by a rotation vector, its origin in place.
    #[inline]
    pub fn turned(turn: V3<T>) -> Self {
        let (less_unit, spin) = exponential(turn);
        Pose { u: [T::from(0.0); 3], turn, less_unit, spin }
    }
}

/// The six components with their first derivatives with respect to the twelve coordinates of the two parts.
#[derive(Clone, Copy, Debug)]
pub struct Relative<T> {
    /// x, y, z, theta, phi, psi.
    pub g: [T; 6],
    /// Derivatives; columns: coordinates of the first part, then of the second.
    pub b: [[T; 12]; 6],
    axes: M3<T>,
    /// From the first part's origin to the point of the second.
    reach: V3<T>,
    /// From the second part's origin to its point.
    arm: V3<T>,
}

impl<T: Num> Relative<T> {
    /// Evaluates the components of `frame` between parts whose origins lie at `from` and `to` in the reference.
    #[inline]
    pub fn new(frame: &Frame, from: V3<f64>, to: V3<f64>, a: &Pose<T>, b: &Pose<T>) -> Self {
        let (ca, cb) = (vector::<T>(sub(frame.point, from)), vector::<T>(sub(frame.point, to)));
        let axes0 = matrix::<T>(&frame.axes);
        let axes: M3<T> = {
            let turned = product(&a.less_unit, &axes0);
            std::array::from_fn(|i| std::array::from_fn(|j| turned[i][j] + axes0[i][j]))
        };
        // Differences of displacements, not of positions: where stiffness is high, digits are dear.
        let (moved_a, moved_b) = (times(&a.less_unit, ca), times(&b.less_unit, cb));
        let gap = sub(add(b.u, moved_b), add(a.u, moved_a));
        let arm = add(cb, moved_b);
        let reach = add(gap, add(ca, moved_a));
        let d = transposed_times(&axes, gap);
        // A'B - 1 in the connector's axes.
        let twice = transposed_product(&a.less_unit, &b.less_unit);
        let relative: M3<T> = std::array::from_fn(|i| std::array::from_fn(|j| a.less_unit[j][i] + b.less_unit[i][j] + twice[i][j]));
        let e = transposed_product(&axes0, &product(&relative, &axes0));
        let turn = logarithm(&e);
        let by_spin = {
            let inverse = inverse_tangent(turn);
            let back = transposed(&axes);
            product(&inverse, &back)
        };
        let mut rows = [[T::from(0.0); 12]; 6];
        let back = transposed(&axes);
        let arm_b = product(&product(&back, &tilde(arm)), &b.spin);
        let arm_a = product(&product(&back, &tilde(reach)), &a.spin);
        let (turn_a, turn_b) = (product(&by_spin, &a.spin), product(&by_spin, &b.spin));
        for i in 0..3 {
            for j in 0..3 {
                rows[i][j] = -back[i][j];
                rows[i][3 + j] = arm_a[i][j];
                rows[i][6 + j] = back[i][j];
                rows[i][9 + j] = -arm_b[i][j];
                rows[3 + i][3 + j] = -turn_a[i][j];
                rows[3 + i][9 + j] = turn_b[i][j];
            }
        }
        Relative { g: [d[0], d[1], d[2], turn[0], turn[1], turn[2]], b: rows, axes, reach, arm }
    }

    /// `sum_c F_c d2 g_c / dq dq`: how the general forces on the coordinates change because the directions of held forces `f` do. With
    /// it, the tangent of forces that have a potential is symmetric.
    pub fn geometric(&self, f: &[T; 6], a: &Pose<T>, b: &Pose<T>) -> [[T; 12]; 12] {
        let turn = [self.g[3], self.g[4], self.g[5]];
        let (force, moment) = ([f[0], f[1], f[2]], [f[3], f[4], f[5]]);
        let n = times(&self.axes, force);
        let inverse = inverse_tangent(turn);
        let m = times(&self.axes, transposed_times(&inverse, moment));
        let p = {
            let inner = product(&slope_of_inverse_transposed(turn, moment), &inverse);
            product(&product(&self.axes, &inner), &transposed(&self.axes))
        };
        let (n_, m_) = (tilde(n), tilde(m));
        let (n_arm, arm_n) = (product(&n_, &tilde(self.arm)), product(&tilde(self.arm), &n_));
        let reach_n = product(&tilde(self.reach), &n_);
        // Spatial variations: columns (displacement, spin) of the first, then of the second part.
        let by_spin: [[M3<T>; 2]; 2] = {
            let sum = |terms: &dyn Fn(usize, usize) -> T| -> M3<T> { std::array::from_fn(|i| std::array::from_fn(|j| terms(i, j))) };
            [
                [sum(&|i, j| reach_n[i][j] + m_[i][j] + p[i][j]), sum(&|i, j| -n_arm[i][j] - p[i][j])],
                [sum(&|i, j| -arm_n[i][j] - m_[i][j] - p[i][j]), sum(&|i, j| n_arm[i][j] + p[i][j])],
            ]
        };
        let on_a = {
            let c = cross(self.reach, n);
            std::array::from_fn(|i| -c[i] - m[i])
        };
        let on_b = add(cross(self.arm, n), m);
        let own = [slope_of_transposed(a.turn, on_a), slope_of_transposed(b.turn, on_b)];
        let spins = [&a.spin, &b.spin];
        let n_spin = product(&n_, &a.spin);
        let mut k = [[T::from(0.0); 12]; 12];
        for x in 0..2 {
            for y in 0..2 {
                let block = product(&transposed_product(spins[x], &by_spin[x][y]), spins[y]);
                for i in 0..3 {
                    for j in 0..3 {
                        let v = if x == y { block[i][j] + own[x][i][j] } else { block[i][j] };
                        k[6 * x + 3 + i][6 * y + 3 + j] = v;
                    }
                }
            }
        }
        for i in 0..3 {
            for j in 0..3 {
                // Forces follow the first part's axes; its moment follows the point of the second.
                k[i][3 + j] = n_spin[i][j];
                k[3 + j][i] = n_spin[i][j];
                k[6 + i][3 + j] = -n_spin[i][j];
                k[3 + j][6 + i] = -n_spin[i][j];
            }
        }
        k
    }
}

#[cfg(test)]
mod tests {
    use num_dual::{Dual2_64, Dual64};

    use super::*;

    const FROM: V3<f64> = [0.1, 0.2, -0.05];
    const TO: V3<f64> = [0.13, 0.24, 0.02];

    fn frame() -> Frame {
        let r = exponential([0.3, -0.8, 0.5]).0;
        Frame { point: [0.115, 0.22, 0.0], axes: std::array::from_fn(|i| std::array::from_fn(|j| r[i][j] + f64::from(i == j))) }
    }

    fn at<T: Num>(q: &[T; 12]) -> (Relative<T>, Pose<T>, Pose<T>) {
        let (a, b) = (Pose::new(&std::array::from_fn(|i| q[i])), Pose::new(&std::array::from_fn(|i| q[6 + i])));
        (Relative::new(&frame(), FROM, TO, &a, &b), a, b)
    }

    const Q: [f64; 12] = [0.01, -0.02, 0.03, 0.9, -0.4, 1.3, -0.01, 0.02, 0.015, 0.7, -0.1, 1.5];

    #[test]
    fn components_have_exact_first_and_second_derivatives() {
        let f = [3.0, -2.0, 1.0, 0.4, -0.7, 0.2];
        let (relative, a, b) = at(&Q);
        let k = relative.geometric(&f, &a, &b);
        for j in 0..12 {
            let (dual, ..) = at(&std::array::from_fn(|i| Dual64::new(Q[i], f64::from(i == j))));
            for c in 0..6 {
                assert!((relative.b[c][j] - dual.g[c].eps).abs() < 1e-13, "{c} {j}: {} {}", relative.b[c][j], dual.g[c].eps);
            }
            for i in 0..12 {
                let exact: f64 = (0..6).map(|c| f[c] * dual.b[c][i].eps).sum();
                assert!((k[i][j] - exact).abs() < 1e-12, "{i} {j}: {} {exact}", k[i][j]);
                assert!((k[i][j] - k[j][i]).abs() < 1e-12, "{i} {j}");
            }
        }
    }

    #[test]
    fn second_derivatives_along_a_path_are_accelerations() {
        let (v, a): ([f64; 12], [f64; 12]) = (std::array::from_fn(|i| (i as f64).sin()), std::array::from_fn(|i| (i as f64 + 0.3).cos()));
        let (path, ..) = at(&std::array::from_fn(|i| Dual2_64::new(Q[i], v[i], a[i])));
        let (here, ..) = at(&Q);
        for c in 0..6 {
            let velocity: f64 = (0..12).map(|i| here.b[c][i] * v[i]).sum();
            let acceleration: f64 = (0..12).map(|i| here.b[c][i] * a[i] + path.b[c][i].v1 * v[i]).sum();
            assert!((path.g[c].v1 - velocity).abs() < 1e-13 && (path.g[c].v2 - acceleration).abs() < 1e-12, "{c}");
        }
    }

    #[test]
    fn a_rigid_motion_of_both_strains_nothing() {
        let turn = [0.9, -1.4, 0.8];
        let (less_unit, _) = exponential(turn);
        let move_of = |origin: V3<f64>| add([0.3, -0.2, 0.1], times(&less_unit, origin));
        let (ua, ub) = (move_of(FROM), move_of(TO));
        let q = [ua[0], ua[1], ua[2], turn[0], turn[1], turn[2], ub[0], ub[1], ub[2], turn[0], turn[1], turn[2]];
        let (relative, ..) = at(&q);
        assert!(relative.g.iter().all(|g| g.abs() < 1e-15), "{:?}", relative.g);
    }
}
