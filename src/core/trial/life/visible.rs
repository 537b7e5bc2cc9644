//! How much of what is hidden can be seen beside everything that is not known.

use nalgebra::{DMatrix, DVector};

use super::super::bench::{Bench, Drive, Flaw, Part, Planted, Response, Test, averaged, shown};
use super::super::generate::Generated;
use super::{Life, SETTINGS};

/// Steps in which sizes come to the strength drawn for them, how near, and the largest change in one.
const STEPS: usize = 7;
const NEAR: f64 = 0.03;
const CHANGE: f64 = 8.0;
/// Largest size of an effect in its own measure, and of an error of an instrument.
const LARGEST: f64 = 1.0;
const LARGEST_FLAW: f64 = 0.3;
/// Relative difference by which slopes are taken.
const SLOPE: f64 = 1e-3;
/// How often, and how far in logarithms, parameters move to imitate what is hidden.
const MOVES: usize = 4;
const MOVE: f64 = 0.3;

/// The tests that are fitted or decide, with the whitening of what they show.
struct View {
    tests: Vec<Test>,
    reference: Vec<Response>,
    /// Factor on the rows of each test for the colour of its noise: the variance of the mean of a correlated row over that of a white one.
    colour: Vec<f64>,
    /// First row of each test, and the number of all.
    starts: Vec<usize>,
}

impl View {
    fn new(case: &Generated, life: &Life) -> View {
        let decides = |t: &&Test| t.split != "held_out";
        let tests: Vec<Test> = case.tests.iter().filter(decides).cloned().collect();
        let flaws: Vec<Flaw> = case.instrument.iter().cloned().collect();
        let read = |t: &Test| case.bench.read(&case.bench.params, &case.planted, &flaws, &tests, t);
        let reference: Vec<Response> = tests.iter().map(read).collect();
        let of =
            |(t, l): (&Test, &super::TestLife)| (t.split != "held_out").then(|| ((1.0 - l.correlation) / (1.0 + l.correlation)).sqrt());
        let colour = case.tests.iter().zip(&life.tests).filter_map(of).collect();
        let mut starts = vec![0];
        for (t, r) in tests.iter().zip(&reference) {
            starts.push(starts[starts.len() - 1] + r.channels.iter().map(|c| shown(t, c).len()).sum::<usize>());
        }
        View { tests, reference, colour, starts }
    }

    fn rows(&self) -> usize {
        self.starts[self.tests.len()]
    }

    /// What a model shows, in standard deviations of the noise.
    fn see(&self, bench: &Bench, params: &[f64], planted: &[Planted], flaws: &[Flaw]) -> DVector<f64> {
        let mut seen = DVector::from_vec(bench.seen(params, planted, flaws, &self.tests, &self.reference));
        self.weigh(&mut seen);
        seen
    }

    fn weigh(&self, rows: &mut DVector<f64>) {
        for (t, colour) in self.colour.iter().enumerate() {
            rows.rows_mut(self.starts[t], self.starts[t + 1] - self.starts[t]).scale_mut(*colour);
        }
    }

    /// The rows of test `t` alone.
    fn only(&self, rows: &DVector<f64>, t: usize) -> DVector<f64> {
        let mut own = DVector::zeros(rows.len());
        let (from, count) = (self.starts[t], self.starts[t + 1] - self.starts[t]);
        own.rows_mut(from, count).copy_from(&rows.rows(from, count));
        own
    }

    /// What a change of each value of channel `k` of the records in time shows.
    fn of_channel(&self, k: usize, change: &dyn Fn(f64) -> f64) -> DVector<f64> {
        let mut column = DVector::zeros(self.rows());
        for (t, (test, r)) in self.tests.iter().zip(&self.reference).enumerate() {
            let mut row = self.starts[t];
            for (j, (c, s)) in r.channels.iter().zip(&r.sigma).enumerate() {
                let (c, s) = (shown(test, c), shown(test, s));
                if j == k && !matches!(test.drive, Drive::Frf { .. }) {
                    let whitened = c.iter().zip(s).map(|(c, s)| change(*c) * averaged(test) / s);
                    column.rows_mut(row, c.len()).iter_mut().zip(whitened).for_each(|(a, b)| *a = b);
                }
                row += c.len();
            }
        }
        self.weigh(&mut column);
        column
    }
}

/// What can be imitated: freely by the model's parameters, within their variance by everything that is not known. Columns of slopes, `q r` of them, below
/// the data a row for each variance.
struct Imitated {
    q: DMatrix<f64>,
    r: DMatrix<f64>,
    /// Parameters that can be seen, with the length of the column of each; they come first.
    free: Vec<(usize, f64)>,
}

impl Imitated {
    fn new(case: &Generated, life: &Life, view: &View) -> Imitated {
        let s = SETTINGS;
        let (bench, flaws) = (&case.bench, case.instrument.iter().cloned().collect::<Vec<Flaw>>());
        let whole = view.see(bench, &bench.params, &case.planted, &flaws);
        let free: Vec<DVector<f64>> = (0..bench.params.len())
            .map(|j| {
                let mut params = bench.params.clone();
                params[j] *= 1.0 + SLOPE;
                (view.see(bench, &params, &case.planted, &flaws) - &whole) / SLOPE
            })
            .collect();
        let mut known: Vec<DVector<f64>> = bench.tolerances(&view.tests, &view.reference).into_iter().map(DVector::from_vec).collect();
        known.iter_mut().for_each(|c| view.weigh(c));
        let own: Vec<&super::TestLife> =
            case.tests.iter().zip(&life.tests).filter(|(t, _)| t.split != "held_out").map(|(_, l)| l).collect();
        for (t, test) in view.tests.iter().enumerate() {
            let frf = matches!(test.drive, Drive::Frf { .. });
            if own[t].params.iter().any(|p| *p != 1.0) {
                let scatter = if frf { s.scatter_frf } else { s.scatter };
                known.extend(free.iter().map(|c| view.only(c, t) * scatter));
            }
            let gain = if own[t].gains.iter().any(|g| *g != 1.0) { s.gain } else { 0.0 };
            let gain = gain.hypot(own[t].cycles / (test.record.kept as f64).sqrt());
            if gain > 0.0 {
                known.push(view.only(&whole, t) * gain);
            }
        }
        for (k, ([square, cube], full)) in life.sensors.iter().zip(&life.full).enumerate().filter(|(_, (s, _))| **s != [0.0; 2]) {
            known.push(view.of_channel(k, &|c| square * full * (c / full).powi(2)));
            known.push(view.of_channel(k, &|c| cube * full * (c / full).powi(3)));
        }
        for quirk in &life.quirks {
            let there: Vec<Planted> = case.planted.iter().chain([quirk]).cloned().collect();
            known.push(view.see(bench, &bench.params, &there, &flaws) - &whole);
        }
        let one = Part { stiffness: 1.0, damping: 1.0, mass: 1.0 };
        for at in 0..life.parts.len() {
            for (part, width) in [
                (Part { stiffness: 1.0 + SLOPE, ..one }, s.stiffness),
                (Part { damping: 1.0 + SLOPE, ..one }, s.damping),
                (Part { mass: 1.0 + SLOPE, ..one }, s.mass),
            ] {
                let mut parts = vec![one; bench.bodies];
                parts[at] = part;
                let off = Bench { parts, ..bench.clone() };
                known.push((view.see(&off, &off.params, &case.planted, &flaws) - &whole) * (width / SLOPE));
            }
        }
        let (n, errors) = (view.rows(), known.len());
        let below = |c: DVector<f64>| c.resize_vertically(n + errors, 0.0);
        let mut all: Vec<DVector<f64>> = free.into_iter().map(below).collect();
        all.extend(known.into_iter().enumerate().map(|(k, c)| {
            let mut c = below(c);
            c[n + k] = 1.0;
            c
        }));
        let lengths: Vec<f64> = all.iter().take(bench.params.len()).map(|c| c.norm()).collect();
        let free = lengths.into_iter().enumerate().filter(|(_, length)| *length > 0.0).collect();
        let all: Vec<DVector<f64>> = all.into_iter().filter(|c| c.norm() > 0.0).map(|c| c.normalize()).collect();
        if all.is_empty() {
            return Imitated { q: DMatrix::zeros(n, 0), r: DMatrix::zeros(0, 0), free };
        }
        let (q, r) = DMatrix::from_columns(&all).qr().unpack();
        Imitated { q, r, free }
    }

    /// What is left of `whole` beside a model without an effect, `without` at its parameters, once these have moved to where least is left: across a narrow
    /// resonance slopes say little of what a shift of it imitates.
    fn left(&self, whole: &DVector<f64>, params: &[f64], without: &dyn Fn(&[f64]) -> DVector<f64>) -> DVector<f64> {
        let (mut at, mut difference) = (params.to_vec(), whole - without(params));
        let mut least = self.beyond(difference.clone());
        for _ in 0..MOVES {
            let rows = difference.clone().resize_vertically(self.q.nrows(), 0.0);
            let Some(step) = self.r.solve_upper_triangular(&self.q.tr_mul(&rows)) else { break };
            for (k, (j, length)) in self.free.iter().enumerate() {
                at[*j] *= (step[k] / length).clamp(-MOVE, MOVE).exp();
            }
            difference = whole - without(&at);
            let left = self.beyond(difference.clone());
            if !left.norm().is_finite() {
                break;
            }
            if left.norm() < least.norm() {
                least = left;
            }
        }
        least
    }

    fn beyond(&self, rows: DVector<f64>) -> DVector<f64> {
        let rows = rows.resize_vertically(self.q.nrows(), 0.0);
        &rows - &self.q * self.q.tr_mul(&rows)
    }
}

/// Brings what is hidden to strengths drawn between those of [`SETTINGS`], and says how strong the weakest came out: standard deviations,
/// beyond what parameters, the other effect and everything unknown imitate.
pub fn strengths(case: &mut Generated, life: &Life) -> f64 {
    let count = case.planted.len() + usize::from(case.instrument.is_some());
    let (least, most) = SETTINGS.strength;
    let wanted: Vec<f64> = (0..count).map(|_| case.draw.log(least, most)).collect();
    if count == 0 {
        return 0.0;
    }
    let view = View::new(case, life);
    let imitated = Imitated::new(case, life, &view);
    let mut seen = of_each(case, &view, &imitated);
    for _ in 0..STEPS {
        if seen.iter().zip(&wanted).all(|(s, w)| (s / w - 1.0).abs() < NEAR) {
            break;
        }
        let change = |j: usize| (wanted[j] / seen[j].max(1e-9)).clamp(1.0 / CHANGE, CHANGE);
        for (j, p) in case.planted.iter_mut().enumerate() {
            p.size = (p.size * change(j)).clamp(-LARGEST, LARGEST);
        }
        if let Some(flaw) = &mut case.instrument {
            flaw.size = (flaw.size * change(count - 1)).clamp(-LARGEST_FLAW, LARGEST_FLAW);
        }
        seen = of_each(case, &view, &imitated);
    }
    // What cannot come to its strength within its largest size is drawn anew.
    let near = seen.iter().zip(&wanted).all(|(s, w)| s / w > 0.5 && s / w < 2.0);
    if near { seen.into_iter().fold(f64::INFINITY, f64::min) } else { 0.0 }
}

fn of_each(case: &Generated, view: &View, imitated: &Imitated) -> Vec<f64> {
    let (bench, flaws) = (&case.bench, case.instrument.iter().cloned().collect::<Vec<Flaw>>());
    let whole = view.see(bench, &bench.params, &case.planted, &flaws);
    let mut own: Vec<DVector<f64>> = (0..case.planted.len())
        .map(|j| {
            let others: Vec<Planted> = case.planted.iter().enumerate().filter(|(i, _)| *i != j).map(|(_, p)| p.clone()).collect();
            imitated.left(&whole, &bench.params, &|params| view.see(bench, params, &others, &flaws))
        })
        .collect();
    if !flaws.is_empty() {
        own.push(imitated.left(&whole, &bench.params, &|params| view.see(bench, params, &case.planted, &[])));
    }
    let left = |j: usize| {
        let mut rest = own[j].clone();
        for other in own.iter().enumerate().filter(|(i, o)| *i != j && o.norm() > 0.0).map(|(_, o)| o.normalize()) {
            rest -= &other * other.dot(&rest);
        }
        if rest.norm().is_finite() { rest.norm() } else { 0.0 }
    };
    (0..own.len()).map(left).collect()
}
