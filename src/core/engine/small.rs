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

/// How the system changes with one coordinate of its operating point, or with the force of one element there. Few entries: a coordinate is seen by its
/// neighbours.
#[derive(Clone, Debug, Default)]
struct Moved {
    dx: Vec<(usize, f64)>,
    rows: Vec<(usize, Vec<(usize, f64)>)>,
    stiffness: Vec<Entry>,
    mass: Vec<Entry>,
}

impl Moved {
    fn is_empty(&self) -> bool {
        self.dx.is_empty() && self.rows.is_empty() && self.stiffness.is_empty() && self.mass.is_empty()
    }
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
    /// One for every coordinate and every element whose change changes the system.
    moved: Vec<Moved>,
    /// How far each of these moves with every free parameter, `by[k * moved + m]`.
    by: Vec<f64>,
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
            by: vec![],
        };
        if let Some(s) = &state {
            s.elements.iter().zip(&mut small.points).for_each(|(f, p)| p.f = *f);
        }
        match &model.space {
            None => small.linear(model, q),
            Some(space) => small.spatial(model, space, q),
        }
        if let Some(s) = state.as_ref().filter(|_| columns > 0) {
            small.follow(model, q, &s.state.dq, &s.d_elements, columns);
        }
        small.same = small.alike();
        Ok(small)
    }

    /// Number of the first element with the same stiffness as each.
    fn alike(&self) -> Vec<usize> {
        let (mut firsts, mut same) = (Vec::new(), Vec::new());
        for (i, e) in self.bound.elements.iter().enumerate() {
            let like = |&j: &usize| {
                self.bound.elements[j].same_law(e)
                    && (e.is_alike_everywhere() || (self.points[i].x == self.points[j].x && self.points[i].f == self.points[j].f))
            };
            let first = firsts.iter().copied().find(like);
            if first.is_none() {
                firsts.push(i);
            }
            same.push(first.unwrap_or(i));
        }
        same
    }

    /// The same with its elements strained and loaded otherwise: relative displacement and force of each, and how its displacement moves with the
    /// free parameters. What the parts turn by for it is left out.
    pub fn strained(mut self, points: impl Iterator<Item = (f64, f64)>, slopes: &[&[f64]]) -> Self {
        self.points.iter_mut().zip(points).for_each(|(point, (x, f))| *point = Point { x, f });
        self.same = self.alike();
        let moves = |(e, slopes): &(usize, &&[f64])| !self.bound.elements[*e].is_alike_everywhere() && slopes.iter().any(|s| *s != 0.0);
        let which: Vec<(usize, &&[f64])> = slopes.iter().enumerate().filter(moves).collect();
        let columns = slopes.first().map_or(0, |s| s.len());
        self.by = (0..columns).flat_map(|c| which.iter().map(move |(_, slopes)| slopes[c])).collect();
        self.moved = which.iter().map(|(e, _)| Moved { dx: vec![(*e, 1.0)], ..Moved::default() }).collect();
        self
    }

    /// The system about given coordinates, under given forces of the elements, without sensitivities.
    pub fn about(model: &Model, bound: &'a Bound, q: &[f64], forces: &[f64]) -> Self {
        let (n, count) = (model.dofs.len(), bound.elements.len());
        let mut small = Small {
            bound,
            n,
            mass: vec![],
            stiffness: vec![],
            rows: vec![vec![]; count],
            same: (0..count).collect(),
            points: forces.iter().map(|f| Point { x: 0.0, f: *f }).collect(),
            names: vec![],
            moved: vec![],
            by: vec![],
        };
        match &model.space {
            None => small.linear(model, q),
            Some(space) => small.spatial(model, space, q),
        }
        small
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
                f[c] += self.points[e].f;
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

    /// How the system moves with its operating point, and that with the free parameters: `dq` and `df` hold a row of sensitivities for every coordinate
    /// and for every element's force.
    fn follow(&mut self, model: &Model, q: &[f64], dq: &[f64], df: &[f64], columns: usize) {
        let count = self.rows.len();
        let directions = (0..self.n + count).map(|m| (m, self.along(model, q, m))).filter(|(_, moved)| !moved.is_empty());
        let (which, moved): (Vec<usize>, Vec<Moved>) = directions.unzip();
        let by = |c: usize, m: usize| if m < self.n { dq[m * columns + c] } else { df[(m - self.n) * columns + c] };
        self.by = (0..columns).flat_map(|c| which.iter().map(move |m| (c, *m))).map(|(c, m)| by(c, m)).collect();
        self.moved = moved;
    }

    /// Derivative of the system with respect to a coordinate, or beyond these to the force of an element.
    fn along(&self, model: &Model, q: &[f64], m: usize) -> Moved {
        let (dof, force) = if m < self.n { (Some(m), None) } else { (None, Some(m - self.n)) };
        let of_row = |(e, row): (usize, &Vec<(usize, f64)>)| row.iter().find(|(d, _)| Some(*d) == dof).map(|(_, b)| (e, *b));
        let mut moved = Moved { dx: self.rows.iter().enumerate().filter_map(of_row).collect(), ..Moved::default() };
        let Some(space) = &model.space else { return moved };
        for joint in joints(model, self.bound, space) {
            let here = |d: &Option<usize>| d.is_some() && *d == dof;
            if !joint.dofs.iter().any(here) && !joint.elements.iter().any(|(e, _)| Some(*e) == force) {
                continue;
            }
            let (q12, d12) = (joint.gather(q), joint.dofs.map(|d| f64::from(here(&d))));
            let (relative, a, b) = joint.relative_of(space, &std::array::from_fn(|i| Dual64::new(q12[i], d12[i])));
            let mut f = [Dual64::from_re(0.0); 6];
            for &(e, c) in &joint.elements {
                let turned: Vec<(usize, f64)> = row(&joint, &relative.b[c].map(|x| x.eps)).into_iter().filter(|r| r.1 != 0.0).collect();
                if !turned.is_empty() {
                    moved.rows.push((e, turned));
                }
                if model.attached.contains(&joint.connector) {
                    moved.dx.retain(|(other, _)| *other != e);
                }
                f[c] = Dual64::new(self.points[e].f, f64::from(Some(e) == force));
            }
            let k = relative.geometric(&f, &a, &b);
            entries(&joint.dofs, |i, j| k[i][j].eps, &mut moved.stiffness);
        }
        for (k, part) in space.parts.iter().enumerate() {
            let Some(c) = part.dofs.iter().position(|d| d.is_some() && *d == dof) else { continue };
            let q = space.coordinates(k, q);
            let m = part.mass_matrix(std::array::from_fn(|i| Dual64::new(q[3 + i], f64::from(3 + i == c))));
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

    /// Relative displacement of an element at the operating point.
    pub fn strain(&self, e: usize) -> f64 {
        self.points[e].x
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

    /// Dynamic stiffness of every element at `s`, and its derivative with respect to its displacement.
    pub fn laws(&self, s: Complex64) -> Result<Vec<(Complex64, Complex64)>, EngineError> {
        let (mut dp, mut laws) = (Vec::new(), Vec::with_capacity(self.rows.len()));
        for (e, first) in self.same.iter().enumerate() {
            let (z, by_x) = if *first < e { laws[*first] } else { self.law(e, s, &mut dp).map(|(z, _, by_x)| (z, by_x))? };
            laws.push((z, by_x));
        }
        Ok(laws)
    }

    /// Adds `u' (dZ/dp_k) v` at `s`, because of the operating point, to `out[k]`. `law`: of each element, as in [`Small::laws`].
    pub fn add_moved(
        &self,
        s: Complex64,
        law: impl Fn(usize) -> (Complex64, Complex64),
        u: &[Complex64],
        v: &[Complex64],
        out: &mut [Complex64],
    ) {
        if self.moved.is_empty() {
            return;
        }
        let along = |row: &[(usize, f64)], w: &[Complex64]| row.iter().map(|(d, b)| w[*d] * *b).sum::<Complex64>();
        let form = |m: &[Entry]| m.iter().map(|(i, j, x)| u[*i] * v[*j] * *x).sum::<Complex64>();
        let of = |moved: &Moved| {
            let mut sum = form(&moved.stiffness) + s * s * form(&moved.mass);
            for (e, dx) in &moved.dx {
                sum += law(*e).1 * *dx * self.relative(*e, u) * self.relative(*e, v);
            }
            for (e, row) in &moved.rows {
                sum += law(*e).0 * (along(row, u) * self.relative(*e, v) + self.relative(*e, u) * along(row, v));
            }
            sum
        };
        let values: Vec<Complex64> = self.moved.iter().map(of).collect();
        for (out, by) in out.iter_mut().zip(self.by.chunks_exact(self.moved.len())) {
            *out += by.iter().zip(&values).map(|(by, value)| value * *by).sum::<Complex64>();
        }
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
