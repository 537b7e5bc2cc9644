//! Everything that acts at one place, condensed to one law from the motion across it to the general force.
//!
//! Force effects act in parallel on the inner motion `y = x - e`; the opening `e` is the sum of the series effects under the common
//! force, `e = sum_j e_j(F(y))`, found by a safeguarded Newton iteration and differentiated by the implicit function theorem. The
//! inner velocity is `v - de/dt` with the second-order backward rate of `e`, so that an opening of zero is exactly no series effect.
//! Accelerations are those of the connector's ends: an inertial law inside an opening sees the outer acceleration.
//!
//! A *follower* is a candidate of the score test: its strength is at the null value, its states follow the motion, and only the
//! derivative with respect to the strength is formed.

use crate::effect::dispatch::{INPUTS, Wanted};
use crate::effect::{ForceLaw, Inputs, Series, Tangent};

use super::Model;
use super::bound::Chain;
use super::recurrence::{Recurrence, Recurrences};
use super::sensed::{Depth, Sensed};

mod followers;
mod history;
mod laws;
mod stiffness;

pub use history::Fading;

#[derive(Clone)]
struct ForcePiece {
    law: &'static dyn ForceLaw,
    /// Whether it has a [`Recurrence`].
    recurs: bool,
    p: std::ops::Range<usize>,
    s: std::ops::Range<usize>,
}

#[derive(Clone)]
struct SeriesPiece {
    law: &'static dyn Series,
    p: std::ops::Range<usize>,
    /// First of the two follower states that hold the opening per unit strength one and two steps ago.
    follower: Option<usize>,
}

/// The law of one place with its numbers.
#[derive(Clone)]
pub struct Element {
    /// Index of the place.
    pub place: usize,
    /// Degree of freedom at the `from` end.
    pub from: Option<usize>,
    /// Degree of freedom at the `to` end.
    pub to: Option<usize>,
    /// Derivatives of each parameter with respect to the free ones.
    pub chains: Vec<Chain>,
    p: Vec<f64>,
    active: Vec<bool>,
    forces: Vec<ForcePiece>,
    /// Linear laws, and what they sum up to per displacement, velocity and acceleration.
    linear: Vec<ForcePiece>,
    linear_sum: [f64; 3],
    followers: Vec<ForcePiece>,
    series: Vec<SeriesPiece>,
    n_states: usize,
    n_follower_states: usize,
    opening: bool,
}

/// Working memory of an element, kept by the engine so that no step allocates.
#[derive(Default)]
pub struct ElementScratch {
    piece: Tangent,
    old: Vec<f64>,
    row: Vec<f64>,
    params: Vec<f64>,
    slopes: Vec<f64>,
    recurrences: Recurrences,
    /// Where the opening of the next step may be, where the engine knows better than the two before it. The root is unique: from wherever it is looked for,
    /// the opening is the same to the accuracy of its Newton steps.
    pub opening: Option<f64>,
}

impl Element {
    /// An element without effects at a place.
    pub fn new(model: &Model, place: usize) -> Element {
        let at = &model.places[place];
        Element::empty(place, at.from, at.to)
    }

    fn empty(place: usize, from: Option<usize>, to: Option<usize>) -> Element {
        Element {
            place,
            from,
            to,
            chains: vec![],
            p: vec![],
            active: vec![],
            forces: vec![],
            linear: vec![],
            linear_sum: [0.0; 3],
            followers: vec![],
            series: vec![],
            n_states: 0,
            n_follower_states: 0,
            opening: false,
        }
    }

    fn push_params(&mut self, p: Vec<f64>, chains: Vec<Chain>) -> std::ops::Range<usize> {
        let start = self.p.len();
        self.p.extend(p);
        self.active.extend(chains.iter().map(|c| !c.is_empty()));
        self.chains.extend(chains);
        start..self.p.len()
    }

    pub(super) fn push_force(&mut self, law: &'static dyn ForceLaw, mut p: Vec<f64>, chains: Vec<Chain>, follower: bool) {
        let n = law.info().states;
        if follower {
            // Forces are proportional to the strength: the derivative at 0 is the force at 1.
            p[0] = 1.0;
            let p = self.push_params(p, chains);
            self.followers.push(ForcePiece {
                law,
                recurs: Recurrence::fits(law),
                p,
                s: self.n_follower_states..self.n_follower_states + n,
            });
            self.n_follower_states += n;
        } else if law.linear() {
            let mut t = Tangent::default();
            law.tangent(&Inputs::default(), 1.0, &mut [], &p, Wanted::Inputs, &mut t);
            add(&mut self.linear_sum, t.inputs(0), 1.0);
            let p = self.push_params(p, chains);
            self.linear.push(ForcePiece { law, recurs: false, p, s: 0..0 });
        } else {
            let p = self.push_params(p, chains);
            self.forces.push(ForcePiece { law, recurs: Recurrence::fits(law), p, s: self.n_states..self.n_states + n });
            self.n_states += n;
        }
    }

    pub(super) fn push_series(&mut self, law: &'static dyn Series, p: Vec<f64>, chains: Vec<Chain>, follower: bool) {
        let p = self.push_params(p, chains);
        if !follower && !self.opening {
            // The opening one and two steps ago are states of the element, in front of those of its laws.
            self.opening = true;
            self.n_states += 2;
            self.forces.iter_mut().for_each(|f| f.s = f.s.start + 2..f.s.end + 2);
        }
        let follower = follower.then_some(self.n_follower_states);
        if follower.is_some() {
            self.n_follower_states += 2;
        }
        self.series.push(SeriesPiece { law, p, follower });
    }

    /// Whether an effect in series opens here; its opening is the first state then.
    pub fn opens(&self) -> bool {
        self.opening
    }
    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.n_states
    }
    /// Number of states of the followers.
    pub fn n_follower_states(&self) -> usize {
        self.n_follower_states
    }
    /// Number of parameters, `chains.len()`.
    pub fn n_params(&self) -> usize {
        self.p.len()
    }
    /// Whether small motion about any operating point is as about rest: linear laws, and those that remember, which are stuck where they are.
    pub fn is_alike_everywhere(&self) -> bool {
        self.series.is_empty() && self.forces.iter().chain(&self.followers).all(|f| f.law.linear() || f.law.info().states > 0)
    }

    /// Mass or moment of inertia of its linear laws; 0 where it stands behind an opening.
    pub fn inertia(&self) -> f64 {
        if self.opening { 0.0 } else { self.linear_sum[2] }
    }

    /// Whether a law here reads the velocity, the acceleration.
    pub fn reads_rates(&self) -> (bool, bool) {
        let of = |f: &ForcePiece| (f.law.info().ports.v, f.law.info().ports.a);
        let all = self.linear.iter().chain(&self.forces).chain(&self.followers).map(of);
        all.fold((false, false), |(v, a), (has_v, has_a)| (v | has_v, a | has_a))
    }

    fn linear_force(&self, u: &Inputs<f64>) -> f64 {
        self.linear_sum[0] * u.x + self.linear_sum[1] * u.v + self.linear_sum[2] * u.a
    }

    /// Force of all that acts in parallel at the end of the step; `s` leaves with the new states.
    fn parallel(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], scratch: &mut ElementScratch) -> f64 {
        let mut force = self.linear_force(u);
        for (k, piece) in self.forces.iter().enumerate() {
            force += self.advance(k, piece, u, dt, &mut s[piece.s.clone()], scratch);
        }
        force
    }

    /// Force of the `k`-th piece, followers after the forces.
    fn advance(&self, k: usize, piece: &ForcePiece, u: &Inputs<f64>, dt: f64, s: &mut [f64], scratch: &mut ElementScratch) -> f64 {
        let p = &self.p[piece.p.clone()];
        match piece.recurs {
            true => p[0] * scratch.recurrences.of((self.place, k), piece.law, p, dt).advance(u, s),
            false => piece.law.value(u, dt, s, p),
        }
    }

    /// General force at the end of the step; `s` leaves with the new states.
    pub fn value(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], scratch: &mut ElementScratch) -> f64 {
        if !self.opening {
            return self.parallel(u, dt, s, scratch);
        }
        let (e1, e2) = (s[0], s[1]);
        let e = self.solve_opening(u, dt, s, scratch);
        let inner = inside(u, dt, e, e1, e2);
        let force = self.parallel(&inner, dt, s, scratch);
        (s[0], s[1]) = (e, e1);
        force
    }

    /// Force and new states with the derivatives asked for. The followers' states `fs` advance only with [`Depth::Params`].
    pub fn tangent(
        &self,
        u: &Inputs<f64>,
        dt: f64,
        s: &mut [f64],
        fs: &mut [f64],
        depth: Depth,
        out: &mut Sensed,
        scratch: &mut ElementScratch,
    ) {
        // What an opening does to the force is found from the derivatives of all.
        let (full, narrow) = (depth == Depth::Params, depth == Depth::Inputs && !self.opening);
        out.reset(self.n_states, self.p.len(), if narrow { 1 } else { 1 + self.n_states });
        let (mut inner, mut e, mut old) = (*u, 0.0, (0.0, 0.0));
        if self.opening {
            old = (s[0], s[1]);
            e = self.solve_opening(u, dt, s, scratch);
            inner = inside(u, dt, e, old.0, old.1);
        }
        let row = out.row_mut(0);
        row[..3].copy_from_slice(&self.linear_sum);
        out.f = self.linear_force(&inner);
        for piece in self.linear.iter().filter(|_| full) {
            let (p, active) = (&self.p[piece.p.clone()], &self.active[piece.p.clone()]);
            piece.law.tangent(&inner, dt, &mut [], p, Wanted::Params(active), &mut scratch.piece);
            let row = out.row_mut(0);
            add(&mut row[INPUTS + self.n_states + piece.p.start..], scratch.piece.params(0), 1.0);
        }
        for (k, piece) in self.forces.iter().enumerate() {
            let (p, active) = (&self.p[piece.p.clone()], &self.active[piece.p.clone()]);
            if piece.recurs && !(full && active[1..].contains(&true)) {
                let r = scratch.recurrences.of((self.place, k), piece.law, p, dt);
                let unit = r.advance(&inner, &mut s[piece.s.clone()]);
                out.f += p[0] * unit;
                let row = out.row_mut(0);
                add(&mut row[..INPUTS], &r.force, p[0]);
                if narrow {
                    continue;
                }
                add(&mut row[INPUTS + piece.s.start..], &r.by_state, p[0]);
                if full && active[0] {
                    row[INPUTS + self.n_states + piece.p.start] += unit;
                }
                for (j, input) in r.input.iter().enumerate() {
                    out.row_mut(1 + piece.s.start + j)[..INPUTS].copy_from_slice(input);
                }
                for (j, c, v) in &r.entries {
                    out.row_mut(1 + piece.s.start + j)[INPUTS + piece.s.start + c] = *v;
                }
                continue;
            }
            let wanted = match depth {
                Depth::Params => Wanted::Params(active),
                _ if narrow => Wanted::Inputs,
                _ => Wanted::States,
            };
            piece.law.tangent(&inner, dt, &mut s[piece.s.clone()], p, wanted, &mut scratch.piece);
            let t = &scratch.piece;
            out.f += t.f;
            if narrow {
                add(&mut out.row_mut(0)[..INPUTS], t.inputs(0), 1.0);
                continue;
            }
            for k in 0..=piece.s.len() {
                let row = out.row_mut(if k == 0 { 0 } else { piece.s.start + k });
                add(&mut row[..INPUTS], t.inputs(k), 1.0);
                add(&mut row[INPUTS + piece.s.start..], t.states(k), 1.0);
                add(&mut row[INPUTS + self.n_states + piece.p.start..], t.params(k), 1.0);
            }
        }
        if full {
            for (k, piece) in self.followers.iter().enumerate() {
                let phi = self.advance(self.forces.len() + k, piece, &inner, dt, &mut fs[piece.s.clone()], scratch);
                out.row_mut(0)[INPUTS + self.n_states + piece.p.start] += phi;
            }
        }
        if self.opening {
            self.condense(dt, full, out, scratch);
        } else if full {
            self.follow_openings(dt, fs, out, scratch);
        }
        if self.opening {
            (s[0], s[1]) = (e, old.0);
        }
    }

    /// Openings of the followers where nothing is open: with `e = theta d(t)`, every derivative moves by
    /// `-(row_x d + row_v dd/dt + row_dx (d - d1))`.
    fn follow_openings(&self, dt: f64, fs: &mut [f64], out: &mut Sensed, scratch: &mut ElementScratch) {
        for piece in &self.series {
            let Some(at) = piece.follower else { continue };
            self.opening_slopes(piece, out.f, scratch);
            let (d, d1, d2) = (scratch.params[0], fs[at], fs[at + 1]);
            let column = INPUTS + self.n_states + piece.p.start;
            for r in 0..=self.n_states {
                let row = out.row_mut(r);
                row[column] -= row[0] * d + row[1] * (3.0 * d - 4.0 * d1 + d2) * (0.5 / dt) + row[3] * (d - d1);
            }
            (fs[at], fs[at + 1]) = (d, d1);
        }
    }

    fn opening_slopes(&self, piece: &SeriesPiece, force: f64, scratch: &mut ElementScratch) {
        let np = piece.p.len();
        scratch.params.resize(np, 0.0);
        scratch.slopes.resize(np, 0.0);
        piece.law.opening_params(force, &self.p[piece.p.clone()], &mut scratch.params, &mut scratch.slopes);
    }

    /// Chain rule through the opening: with `K = dF/dy` and `D' = de/dF`, `dF = (dF|e - K de_p dp) / (1 + D' K)`.
    fn condense(&self, dt: f64, full: bool, out: &mut Sensed, scratch: &mut ElementScratch) {
        let (n_states, force) = (self.n_states, out.f);
        let slope: f64 = self.series.iter().filter(|p| p.follower.is_none()).map(|p| p.law.opening(force, &self.p[p.p.clone()]).1).sum();
        let along = |row: &[f64]| row[0] + 1.5 / dt * row[1] + row[3];
        // Derivatives at a held opening: the old openings enter through the inner velocity and increment.
        for r in 0..=n_states {
            let row = out.row_mut(r);
            row[INPUTS] += row[1] * 2.0 / dt + row[3];
            row[INPUTS + 1] -= row[1] * 0.5 / dt;
        }
        let denominator = 1.0 + slope * along(out.row(0));
        // de with respect to every column.
        scratch.row.clear();
        scratch.row.extend(out.row(0).iter().map(|d| slope * d));
        for piece in self.series.iter().filter(|_| full) {
            self.opening_slopes(piece, force, scratch);
            for k in piece.p.clone().filter(|&k| self.active[k]) {
                scratch.row[INPUTS + n_states + k] += scratch.params[k - piece.p.start];
            }
        }
        scratch.row.iter_mut().for_each(|d| *d /= denominator);
        for r in 0..=n_states {
            let row = out.row_mut(r);
            let k = along(row);
            row.iter_mut().zip(&scratch.row).for_each(|(d, de)| *d -= k * de);
        }
        out.row_mut(1).copy_from_slice(&scratch.row);
        let row = out.row_mut(2);
        row.fill(0.0);
        row[INPUTS] = 1.0;
    }

    /// The opening `e` with `e = sum e_j(F(x - e))`. The force does not fall with `y`, so the residual rises with `e` and a bracket
    /// around the root keeps Newton safe.
    fn solve_opening(&self, u: &Inputs<f64>, dt: f64, s: &[f64], scratch: &mut ElementScratch) -> f64 {
        let (e1, e2) = (s[0], s[1]);
        let (mut lo, mut hi) = (f64::NEG_INFINITY, f64::INFINITY);
        // The line through the last two.
        let mut e = scratch.opening.take().unwrap_or(2.0 * e1 - e2);
        let mut reach = 0.0;
        for _ in 0..200 {
            let inner = inside(u, dt, e, e1, e2);
            let mut force = self.linear_force(&inner);
            let mut stiffness = self.linear_sum[0] + 1.5 / dt * self.linear_sum[1];
            for piece in &self.forces {
                scratch.old.clear();
                scratch.old.extend_from_slice(&s[piece.s.clone()]);
                let p = &self.p[piece.p.clone()];
                piece.law.tangent(&inner, dt, &mut scratch.old, p, Wanted::Inputs, &mut scratch.piece);
                force += scratch.piece.f;
                let d = scratch.piece.inputs(0);
                stiffness += d[0] + 1.5 / dt * d[1] + d[3];
            }
            let (mut opening, mut slope) = (0.0, 0.0);
            for piece in self.series.iter().filter(|p| p.follower.is_none()) {
                let (o, d) = piece.law.opening(force, &self.p[piece.p.clone()]);
                opening += o;
                slope += d;
            }
            let residual = e - opening;
            if residual == 0.0 || !residual.is_finite() {
                return if residual.is_finite() { e } else { f64::NAN };
            }
            if residual > 0.0 {
                hi = hi.min(e);
            } else {
                lo = lo.max(e);
            }
            let derivative = 1.0 + slope * stiffness;
            let mut next = if derivative > 0.0 { e - residual / derivative } else { f64::NAN };
            let bracketed = next > lo && next < hi;
            if !bracketed {
                reach = if reach == 0.0 { residual.abs() } else { 2.0 * reach };
                next = match (lo.is_finite(), hi.is_finite()) {
                    (true, true) => 0.5 * (lo + hi),
                    (true, false) => lo + reach,
                    _ => hi - reach,
                };
            }
            let step = next - e;
            e = next;
            // What a step of Newton's method leaves is its square.
            let settled = if bracketed { 1e-9 } else { 4e-16 };
            if step.abs() <= settled * (e.abs() + e1.abs()) || step == 0.0 {
                return e;
            }
        }
        e
    }
}

/// to += factor from.
#[inline]
fn add(to: &mut [f64], from: &[f64], factor: f64) {
    let n = to.len().min(from.len());
    for k in 0..n {
        to[k] += factor * from[k];
    }
}

/// Motion inside the opening.
fn inside(u: &Inputs<f64>, dt: f64, e: f64, e1: f64, e2: f64) -> Inputs<f64> {
    Inputs { x: u.x - e, v: u.v - (3.0 * e - 4.0 * e1 + e2) * (0.5 / dt), a: u.a, dx: u.dx - (e - e1) }
}
