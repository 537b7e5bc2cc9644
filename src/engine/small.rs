//! Small motion about the operating point: what modes and frequency responses stand on.
//!
//! `Z(s) = s^2 M + K_g + sum_e z_e(s) b_e b_e'`; `z_e` is the dynamic stiffness of an element at its operating point (friction stuck),
//! `b_e` the row of its relative displacement there, `K_g = sum_c F_c d2 g_c/dq dq` the geometric stiffness of the forces present. Of a
//! linear model without loads, `b_e` has entries +-1, `M` is diagonal and `K_g` is zero.

use num_complex::Complex64;
use num_dual::Dual64;

use crate::model::space::Space;
use crate::model::{Bound, Model};

use super::EngineError;
use super::equilibrium::equilibrium;
use super::spatial::{Joint, joints};

/// An entry of a symmetric matrix; both triangles are listed.
type Entry = (usize, usize, f64);

/// The operating point of an element.
#[derive(Clone, Debug, Default)]
struct Point {
    x: f64,
    f: f64,
}

/// How the system changes with one free parameter because the operating point does.
#[derive(Clone, Debug, Default)]
struct Moved {
    dx: Vec<f64>,
    rows: Vec<Vec<(usize, f64)>>,
    stiffness: Vec<Entry>,
    mass: Vec<Entry>,
}

/// The system of small motion.
pub(super) struct Small<'a> {
    pub bound: &'a Bound,
    pub n: usize,
    pub mass: Vec<Entry>,
    pub stiffness: Vec<Entry>,
    /// Relative displacement of each element.
    pub rows: Vec<Vec<(usize, f64)>>,
    /// Number of the first element with the same stiffness.
    pub same: Vec<usize>,
    points: Vec<Point>,
    names: Vec<String>,
    moved: Vec<Moved>,
}

impl<'a> Small<'a> {
    pub fn new(model: &Model, bound: &'a Bound, sensitivities: bool) -> Result<Self, EngineError> {
        let n = model.dofs.len();
        let columns = if sensitivities { bound.n_free } else { 0 };
        let state = equilibrium(model, bound, &[], columns)?;
        let rest = vec![0.0; n];
        let q = state.as_ref().map_or(&rest, |s| &s.state.q);
        let mut small = Small {
            bound,
            n,
            mass: vec![],
            stiffness: vec![],
            rows: vec![vec![]; bound.elements.len()],
            same: vec![],
            points: vec![Point::default(); bound.elements.len()],
            names: (0..n).map(|d| model.dof_name(d)).collect(),
            moved: vec![],
        };
        if let Some(s) = &state {
            s.elements.iter().zip(&mut small.points).for_each(|(f, p)| p.f = *f);
        }
        match &model.space {
            None => small.linear(model, q),
            Some(space) => small.spatial(model, space, q),
        }
        if let Some(s) = state.as_ref().filter(|_| columns > 0) {
            let column = |rows: &[f64], c: usize| rows.iter().skip(c).step_by(columns).copied().collect::<Vec<f64>>();
            for c in 0..columns {
                let moved = small.along(model, q, &column(&s.state.dq, c), &column(&s.d_elements, c));
                small.moved.push(moved);
            }
        }
        let mut firsts: Vec<usize> = Vec::new();
        for (i, e) in bound.elements.iter().enumerate() {
            let like = |&j: &usize| {
                bound.elements[j].same_law(e)
                    && (e.is_alike_everywhere() || (small.points[i].x == small.points[j].x && small.points[i].f == small.points[j].f))
            };
            let first = firsts.iter().copied().find(like);
            if first.is_none() {
                firsts.push(i);
            }
            small.same.push(first.unwrap_or(i));
        }
        Ok(small)
    }

    fn linear(&mut self, model: &Model, q: &[f64]) {
        self.mass = model.dofs.iter().enumerate().filter(|(_, d)| d.mass != 0.0).map(|(d, dof)| (d, d, dof.mass)).collect();
        for (e, element) in self.bound.elements.iter().enumerate() {
            let ends = [(element.to, 1.0), (element.from, -1.0)];
            self.rows[e] = ends.iter().filter_map(|(d, sign)| Some(((*d)?, *sign))).collect();
            self.points[e].x = self.rows[e].iter().map(|(d, b)| q[*d] * b).sum();
        }
    }

    fn spatial(&mut self, model: &Model, space: &Space, q: &[f64]) {
        for joint in joints(model, self.bound, space) {
            let (relative, a, b) = joint.relative(space, q);
            let mut f = [0.0; 6];
            for &(e, c) in &joint.elements {
                self.rows[e] = row(&joint, &relative.b[c]);
                // What is attached under load is unstrained there.
                self.points[e].x = if model.attached.contains(&joint.connector) { 0.0 } else { relative.g[c] };
                f[c] = self.points[e].f;
            }
            if f.iter().any(|f| *f != 0.0) {
                let k = relative.geometric(&f, &a, &b);
                entries(&joint.dofs, |i, j| k[i][j], &mut self.stiffness);
            }
        }
        for (k, part) in space.parts.iter().enumerate() {
            let q = space.coordinates(k, q);
            let m = part.mass_matrix([q[3], q[4], q[5]]);
            entries(&part.dofs, |i, j| m[i][j], &mut self.mass);
        }
    }

    /// Derivative of the system along a change of the coordinates and of the elements' forces.
    fn along(&self, model: &Model, q: &[f64], dq: &[f64], df: &[f64]) -> Moved {
        let mut moved = Moved { rows: vec![vec![]; self.rows.len()], dx: vec![0.0; self.rows.len()], ..Moved::default() };
        for (dx, row) in moved.dx.iter_mut().zip(&self.rows) {
            *dx = row.iter().map(|(d, b)| b * dq[*d]).sum();
        }
        let Some(space) = &model.space else { return moved };
        for joint in joints(model, self.bound, space) {
            let (q12, d12) = (joint.gather(q), joint.gather(dq));
            let (relative, a, b) = joint.relative_of(space, &std::array::from_fn(|i| Dual64::new(q12[i], d12[i])));
            let mut f = [Dual64::from_re(0.0); 6];
            for &(e, c) in &joint.elements {
                moved.rows[e] = row(&joint, &relative.b[c].map(|x| x.eps));
                if model.attached.contains(&joint.connector) {
                    moved.dx[e] = 0.0;
                }
                f[c] = Dual64::new(self.points[e].f, df[e]);
            }
            let k = relative.geometric(&f, &a, &b);
            entries(&joint.dofs, |i, j| k[i][j].eps, &mut moved.stiffness);
        }
        for (k, part) in space.parts.iter().enumerate() {
            let (q, d) = (space.coordinates(k, q), space.coordinates(k, dq));
            let m = part.mass_matrix(std::array::from_fn(|i| Dual64::new(q[3 + i], d[3 + i])));
            entries(&part.dofs, |i, j| m[i][j].eps, &mut moved.mass);
        }
        moved
    }

    /// Whether the system depends on parameters through its operating point.
    pub fn moves(&self) -> bool {
        !self.moved.is_empty()
    }

    /// Dynamic stiffness of an element, its derivative with respect to `s`, to its displacement, and to its parameters (`dp`).
    pub fn law(&self, e: usize, s: Complex64, dp: &mut Vec<Complex64>) -> Result<(Complex64, Complex64, Complex64), EngineError> {
        let point = &self.points[e];
        Ok(self.bound.elements[e].stiffness_about(s, point.x, point.f, dp)?)
    }

    /// The value of that alone.
    pub fn value(&self, e: usize, s: Complex64) -> Result<Complex64, EngineError> {
        Ok(self.bound.elements[e].stiffness_at(s, self.points[e].x, self.points[e].f)?)
    }

    /// Name of a degree of freedom.
    pub fn name(&self, dof: usize) -> String {
        self.names.get(dof).cloned().unwrap_or_default()
    }

    /// Relative displacement of an element.
    #[inline]
    pub fn relative(&self, e: usize, u: &[Complex64]) -> Complex64 {
        self.rows[e].iter().map(|(d, b)| u[*d] * *b).sum()
    }

    /// Pairs of degrees of freedom that the system couples, the diagonal included.
    pub fn pairs(&self) -> Vec<(usize, usize)> {
        let of_rows = self.rows.iter().flat_map(|row| row.iter().flat_map(move |(i, _)| row.iter().map(move |(j, _)| (*i, *j))));
        let of_entries = self.mass.iter().chain(&self.stiffness).map(|e| (e.0, e.1));
        let mut pairs: Vec<_> = of_rows.chain(of_entries).chain((0..self.n).map(|d| (d, d))).collect();
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// Adds `u' (dZ/dp_k) v` at `s`, because of the operating point, to `out[k]`.
    pub fn add_moved(&self, s: Complex64, u: &[Complex64], v: &[Complex64], out: &mut [Complex64]) -> Result<(), EngineError> {
        if self.moved.is_empty() {
            return Ok(());
        }
        let (mut dp, mut laws) = (Vec::new(), Vec::with_capacity(self.rows.len()));
        for (e, first) in self.same.iter().enumerate() {
            let (z, by_x) = if *first < e { laws[*first] } else { self.law(e, s, &mut dp).map(|(z, _, by_x)| (z, by_x))? };
            laws.push((z, by_x));
            let (bu, bv) = (self.relative(e, u), self.relative(e, v));
            for (out, moved) in out.iter_mut().zip(&self.moved) {
                let along = |w: &[Complex64]| moved.rows[e].iter().map(|(d, b)| w[*d] * *b).sum::<Complex64>();
                *out += by_x * moved.dx[e] * bu * bv;
                if !moved.rows[e].is_empty() {
                    *out += z * (along(u) * bv + bu * along(v));
                }
            }
        }
        for (out, moved) in out.iter_mut().zip(&self.moved) {
            let form = |m: &[Entry]| m.iter().map(|(i, j, x)| u[*i] * v[*j] * *x).sum::<Complex64>();
            *out += form(&moved.stiffness) + s * s * form(&moved.mass);
        }
        Ok(())
    }
}

fn row(joint: &Joint, b: &[f64; 12]) -> Vec<(usize, f64)> {
    joint.dofs.iter().zip(b).filter_map(|(d, b)| Some(((*d)?, *b))).collect()
}

fn entries(dofs: &[Option<usize>], value: impl Fn(usize, usize) -> f64, to: &mut Vec<Entry>) {
    for (i, di) in dofs.iter().enumerate() {
        for (j, dj) in dofs.iter().enumerate() {
            if let (Some(di), Some(dj)) = (di, dj) {
                let x = value(i, j);
                if x != 0.0 {
                    to.push((*di, *dj, x));
                }
            }
        }
    }
}
