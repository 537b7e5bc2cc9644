//! Connectors between parts that move in the xy plane alone: the components of [`super::joint`] by their closed forms.
//!
//! With `X`, `Y` the connector's axes turned with the first part, `a` and `r` the vectors to the second part's point from its own and from
//! the first part's origin, and the point's gap: `x = X.gap`, `y = Y.gap`, `psi = psi_b - psi_a`, and
//!
//! ```text
//! dx = -X.du_a + Y.r dpsi_a + X.du_b - Y.a dpsi_b         dy = -Y.du_a - X.r dpsi_a + Y.du_b + X.a dpsi_b
//! ```

use super::body::{Inertial, Part};
use super::joint::{Frame, Pose};
use super::rotation::V3;

type V2 = [f64; 2];

fn dot(a: V2, b: V2) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Columns of x, y, psi of the first and of the second part.
const A: [usize; 3] = [0, 1, 5];
const B: [usize; 3] = [6, 7, 11];

/// A connector in the plane: its axes and the arms to its point from either origin, in the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneJoint {
    axes: [V2; 2],
    arms: [V2; 2],
}

/// The same at the present poses.
#[derive(Clone, Copy, Debug, Default)]
pub struct InPlane {
    x: V2,
    y: V2,
    reach: V2,
    arm: V2,
}

impl PlaneJoint {
    /// The connector `frame` between origins `from` and `to`; `None` where its z axis is not that of the plane.
    pub fn new(frame: &Frame, from: V3<f64>, to: V3<f64>) -> Option<PlaneJoint> {
        let a = &frame.axes;
        let flat = a[2][2] == 1.0 && [a[0][2], a[1][2], a[2][0], a[2][1]].iter().all(|x| *x == 0.0);
        let arm = |origin: V3<f64>| [frame.point[0] - origin[0], frame.point[1] - origin[1]];
        flat.then(|| PlaneJoint { axes: [[a[0][0], a[1][0]], [a[0][1], a[1][1]]], arms: [arm(from), arm(to)] })
    }

    /// Components x, y, psi and their derivatives; what stands at other places is left alone.
    pub fn measure(&self, a: &Pose<f64>, b: &Pose<f64>, g: &mut [f64; 6], rows: &mut [[f64; 12]; 6]) -> InPlane {
        // R v - v from the pose, exact where the turn is small.
        let moved = |p: &Pose<f64>, v: V2| {
            let m = &p.less_unit;
            [m[0][0] * v[0] + m[0][1] * v[1], m[1][0] * v[0] + m[1][1] * v[1]]
        };
        let plus = |v: V2, w: V2| [v[0] + w[0], v[1] + w[1]];
        let (moved_a, moved_b) = (moved(a, self.arms[0]), moved(b, self.arms[1]));
        let gap = [b.u[0] + moved_b[0] - a.u[0] - moved_a[0], b.u[1] + moved_b[1] - a.u[1] - moved_a[1]];
        let x = plus(self.axes[0], moved(a, self.axes[0]));
        let y = plus(self.axes[1], moved(a, self.axes[1]));
        let (arm, reach) = (plus(self.arms[1], moved_b), plus(gap, plus(self.arms[0], moved_a)));
        (g[0], g[1], g[5]) = (dot(x, gap), dot(y, gap), b.turn[2] - a.turn[2]);
        let [row_x, row_y, .., row_psi] = rows;
        for k in 0..2 {
            (row_x[A[k]], row_x[B[k]]) = (-x[k], x[k]);
            (row_y[A[k]], row_y[B[k]]) = (-y[k], y[k]);
        }
        (row_x[A[2]], row_x[B[2]]) = (dot(y, reach), -dot(y, arm));
        (row_y[A[2]], row_y[B[2]]) = (-dot(x, reach), dot(x, arm));
        (row_psi[A[2]], row_psi[B[2]]) = (-1.0, 1.0);
        InPlane { x, y, reach, arm }
    }
}

impl InPlane {
    /// `sum_c F_c d2 g_c / dq dq` at held forces.
    pub fn geometric(&self, f: &[f64; 6], k: &mut [[f64; 12]; 12]) {
        let n = [f[0] * self.x[0] + f[1] * self.y[0], f[0] * self.x[1] + f[1] * self.y[1]];
        // n turned by a right angle.
        let m = [f[0] * self.y[0] - f[1] * self.x[0], f[0] * self.y[1] - f[1] * self.x[1]];
        for i in 0..2 {
            (k[A[i]][A[2]], k[A[2]][A[i]]) = (-m[i], -m[i]);
            (k[B[i]][A[2]], k[A[2]][B[i]]) = (m[i], m[i]);
        }
        let along = dot(n, self.arm);
        (k[A[2]][A[2]], k[B[2]][B[2]]) = (-dot(n, self.reach), -along);
        (k[A[2]][B[2]], k[B[2]][A[2]]) = (along, along);
    }

    /// Rates of the derivatives at velocities `v`.
    pub fn rates(&self, v: &[f64; 12], rate: &mut [[f64; 12]; 6]) {
        let (turn_a, turn_b) = (v[A[2]], v[B[2]]);
        let du = [v[B[0]] - v[A[0]], v[B[1]] - v[A[1]]];
        let (x, y) = (self.x, self.y);
        let [rate_x, rate_y, ..] = rate;
        for k in 0..2 {
            (rate_x[A[k]], rate_x[B[k]]) = (-y[k] * turn_a, y[k] * turn_a);
            (rate_y[A[k]], rate_y[B[k]]) = (x[k] * turn_a, -x[k] * turn_a);
        }
        let (x_arm, y_arm) = (dot(x, self.arm), dot(y, self.arm));
        rate_x[A[2]] = dot(y, du) - dot(x, self.reach) * turn_a + x_arm * turn_b;
        rate_x[B[2]] = x_arm * (turn_a - turn_b);
        rate_y[A[2]] = -dot(x, du) - dot(y, self.reach) * turn_a + y_arm * turn_b;
        rate_y[B[2]] = y_arm * (turn_a - turn_b);
    }
}

impl Part {
    /// Whether it moves in the xy plane alone, and its inertia does not take it out of it.
    pub fn in_plane(&self) -> bool {
        let j = &self.inertia;
        self.dofs[2..5].iter().all(Option::is_none)
            && self.centre[2] == 0.0
            && [j[0][2], j[1][2], j[2][0], j[2][1]].iter().all(|x| *x == 0.0)
    }

    /// Inertial forces of a part in the plane, with their derivatives: with the centre of mass `d` turned along, `w` and `e` the rates of
    /// psi, `p = m (u'' + e k x d - w^2 d)`, `p_psi = J e + m (d x u'')`.
    pub fn plane_inertial(&self, pose: &Pose<f64>, v: &[f64; 6], a: &[f64; 6], about_origin: f64, out: &mut Inertial) {
        let r = &pose.less_unit;
        let c = self.centre;
        let d = [c[0] + r[0][0] * c[0] + r[0][1] * c[1], c[1] + r[1][0] * c[0] + r[1][1] * c[1]];
        let (m, w, e) = (self.mass, v[5], a[5]);
        out.p = [
            m * (a[0] - e * d[1] - w * w * d[0]),
            m * (a[1] + e * d[0] - w * w * d[1]),
            0.0,
            0.0,
            0.0,
            about_origin * e + m * (d[0] * a[1] - d[1] * a[0]),
        ];
        (out.by_a[0][0], out.by_a[1][1], out.by_a[5][5]) = (m, m, about_origin);
        (out.by_a[0][5], out.by_a[5][0]) = (-m * d[1], -m * d[1]);
        (out.by_a[1][5], out.by_a[5][1]) = (m * d[0], m * d[0]);
        (out.by_v[0][5], out.by_v[1][5]) = (-2.0 * m * w * d[0], -2.0 * m * w * d[1]);
        out.by_q[0][5] = m * (w * w * d[1] - e * d[0]);
        out.by_q[1][5] = -m * (w * w * d[0] + e * d[1]);
        out.by_q[5][5] = -m * (d[1] * a[1] + d[0] * a[0]);
    }
}

#[cfg(test)]
mod tests {
    use num_dual::Dual64;

    use super::super::joint::Relative;
    use super::*;

    /// The general form is another way to the same numbers.
    #[test]
    fn the_plane_agrees_with_space() {
        let (s, c) = 0.7f64.sin_cos();
        let frame = Frame { point: [0.115, 0.22, 0.0], axes: [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]] };
        let (from, to) = ([0.1, 0.2, 0.0], [0.13, 0.24, 0.0]);
        let (mut q, mut v) = ([0.0; 12], [0.0; 12]);
        for (k, (x, rate)) in [(0.01, 0.3), (-0.02, -0.7), (0.9, 1.1), (-0.015, 0.2), (0.03, 0.9), (1.4, -0.6)].iter().enumerate() {
            (q[[A, B].concat()[k]], v[[A, B].concat()[k]]) = (*x, *rate);
        }
        let at = |q: &[Dual64; 12]| {
            let (a, b) = (Pose::new(&std::array::from_fn(|i| q[i])), Pose::new(&std::array::from_fn(|i| q[6 + i])));
            (Relative::new(&frame, from, to, &a, &b), a, b)
        };
        let (full, a, b) = at(&std::array::from_fn(|i| Dual64::new(q[i], v[i])));
        let f = [3.0, -2.0, 0.0, 0.0, 0.0, 0.7];
        let stiffness = full.geometric(&f.map(Dual64::from_re), &a, &b);
        let (pa, pb) = (Pose::new(&std::array::from_fn(|i| q[i])), Pose::new(&std::array::from_fn(|i| q[6 + i])));
        let (mut g, mut rows, mut rates, mut k) = ([0.0; 6], [[0.0; 12]; 6], [[0.0; 12]; 6], [[0.0; 12]; 12]);
        let here = PlaneJoint::new(&frame, from, to).unwrap().measure(&pa, &pb, &mut g, &mut rows);
        here.geometric(&f, &mut k);
        here.rates(&v, &mut rates);
        for c in [0, 1, 5] {
            assert!((g[c] - full.g[c].re).abs() < 1e-15, "{c}: {} {}", g[c], full.g[c].re);
            for i in [A, B].concat() {
                assert!((rows[c][i] - full.b[c][i].re).abs() < 1e-15, "{c} {i}");
                assert!((rates[c][i] - full.b[c][i].eps).abs() < 1e-14, "{c} {i}: {} {}", rates[c][i], full.b[c][i].eps);
            }
        }
        for i in [A, B].concat() {
            for j in [A, B].concat() {
                assert!((k[i][j] - stiffness[i][j].re).abs() < 1e-14, "{i} {j}: {} {}", k[i][j], stiffness[i][j].re);
            }
        }
        let part = Part {
            origin: [0.0; 3],
            centre: [0.02, -0.01, 0.0],
            mass: 1.3,
            inertia: [[2e-3, 1e-4, 0.0], [1e-4, 3e-3, 0.0], [0.0, 0.0, 4e-3]],
            dofs: [Some(0), Some(1), None, None, None, Some(2)],
        };
        let (q, v, a) = ([0.1, 0.2, 0.0, 0.0, 0.0, 1.2], [1.0, -2.0, 0.0, 0.0, 0.0, 2.0], [4.0, 1.0, 0.0, 0.0, 0.0, 5.0]);
        let full = part.inertial_tangent(&q, &v, &a);
        let mut flat = Inertial::default();
        assert!(part.in_plane());
        part.plane_inertial(&Pose::new(&q), &v, &a, part.inertia_about_origin()[2][2], &mut flat);
        for i in [0, 1, 5] {
            assert!((full.p[i] - flat.p[i]).abs() < 1e-13, "{i}: {} {}", full.p[i], flat.p[i]);
            for j in [0, 1, 5] {
                let pairs = [(full.by_q, flat.by_q), (full.by_v, flat.by_v), (full.by_a, flat.by_a)];
                assert!(pairs.iter().all(|(f, p)| (f[i][j] - p[i][j]).abs() < 1e-12), "{i} {j}");
            }
        }
        let tilted = Frame { axes: [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]], ..frame };
        assert!(PlaneJoint::new(&tilted, from, to).is_none());
    }
}
