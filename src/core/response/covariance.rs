//! The covariance of a test: what its readings may be off by, beside what the model says.
//!
//! A test is compared in its **coefficients** `y`: those of a loop are the orthonormal Fourier coefficients of its cycle up to harmonic 40
//! ([`crate::data::harmonics`]), in which the noise of the averaged cycle is independent whatever its spectrum; of an FRF the real and
//! imaginary parts of its lines, of a record its samples, of a table its rows. Their covariance is `V = diag(d) + B B'`: `d` the
//! variances of noise and of the model's own error, a column of `B` one standard deviation of an error that all coefficients share.
//! With `D^-1/2 B = U S W'` the coefficients are whitened by `V^-1/2 = (I + U diag((1 + s^2)^-1/2 - 1) U') D^-1/2`: the same as fitting
//! the shared errors under their priors, at no free parameter.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixViewMut, DVector};
use serde::Serialize;

use crate::data::{FourierInput, harmonic_of, harmonics};

use super::{Block, BlockKind, Plan};

/// What good instruments may err by: standard deviations, where no study states them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Gain of a channel in one test about 1: a load cell within its class.
    pub gain: f64,
    /// The same of an FRF, whose sensors are calibrated one by one.
    pub calibration: f64,
    /// Offset, in parts of the largest amplitude that the channel reads in any test: that of the sine of its rms, its mean with it, since the zero of a sensor is
    /// as good as its range, which is that of the largest test for all of them, and covers where it stands. Of a multisine the largest reading is several times
    /// as much, and what an instrument may err by must be little beside the rms in parts of which errors are told.
    pub offset: f64,
    /// Quadratic and cubic part of a sensor's characteristic at its largest reading in any test.
    pub linearity: f64,
    /// Delay, in parts of the period of a cycle or of the shortest period of an FRF: a tenth of a degree...
    pub delay: f64,
    /// ...or in seconds, where it is stated so.
    pub delay_time: Option<f64>,
}

impl Tolerances {
    /// Those of the instruments of a good bench.
    pub const GOOD: Tolerances =
        Tolerances { gain: 0.005, calibration: 0.005, offset: 0.002, linearity: 0.0015, delay: 3e-4, delay_time: None };
}

/// Standard deviation of a point beside a jump, in parts of the jump: it may lie on either side of it, or between where it is read while
/// the force turns over.
const BESIDE: f64 = 1.0;
/// A jump counts beyond so many standard deviations of its noise.
const JUMP: f64 = 3.0;
/// Points beside jumps of a loop that are granted this at most, those beside the largest: a cycle has two reversals.
const JUMPS: usize = 8;

/// Standard deviation of each point of a loop beside a jump, such as that of dry friction at a reversal, which sampling does not place; 0
/// elsewhere.
///
/// The jump about a point is what its neighbours differ by less the differences on the outer side of either. A corner, where one slope goes
/// over into another, makes no more of it than the steeper slope does in two steps; a jump, with the point on either side or within, does.
pub fn beside_jumps(signal: &[f64], sigma: &[f64]) -> Vec<f64> {
    let n = signal.len();
    let at = |i: usize, d: usize| signal[(i + n + d - 2) % n];
    let beside = |i: usize| -> f64 {
        let (before, after) = (at(i, 1) - at(i, 0), at(i, 4) - at(i, 3));
        let jump = (at(i, 3) - at(i, 1) - before - after).abs();
        let noise = JUMP * 10f64.sqrt() * sigma[i];
        if jump > 2.0 * before.abs().max(after.abs()) + noise { BESIDE * jump } else { 0.0 }
    };
    (0..n).map(|i| if n < 5 { 0.0 } else { beside(i) }).collect()
}

/// Rows of the plan, coefficients, and the basis of a loop.
type Part = (Range<usize>, Range<usize>, Option<Arc<DMatrix<f64>>>);

/// How the rows of a test become its coefficients.
#[derive(Clone, Debug)]
pub struct Coefficients {
    /// One for each block of the plan.
    blocks: Vec<Part>,
    /// Number of coefficients.
    pub count: usize,
}

impl Coefficients {
    /// Of a test.
    pub fn of(plan: &Plan) -> Coefficients {
        let (mut blocks, mut count) = (Vec::new(), 0);
        for b in &plan.blocks {
            let basis = (b.kind == BlockKind::Loop).then(|| harmonics(b.range.len()));
            let size = basis.as_ref().map_or(b.range.len(), |m| m.nrows());
            blocks.push((b.range.clone(), count..count + size, basis));
            count += size;
        }
        Coefficients { blocks, count }
    }

    /// Of a made-up test.
    #[cfg(test)]
    pub fn empty(count: usize) -> Coefficients {
        Coefficients { blocks: vec![], count }
    }

    /// The coefficients of each block.
    pub fn ranges(&self) -> impl Iterator<Item = Range<usize>> {
        self.blocks.iter().map(|b| b.1.clone())
    }

    /// Rows of the plan, one column or many, as coefficients.
    pub fn turned(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.count, rows.ncols());
        for (from, to, basis) in &self.blocks {
            let part = rows.rows(from.start, from.len());
            let mut into = out.rows_mut(to.start, to.len());
            match basis {
                Some(basis) => basis.mul_to(&part, &mut into),
                None => into.copy_from(&part),
            }
        }
        out
    }

    /// Variance of each coefficient by the noise of the test's points, without what is granted to the model: from the scatter between cycles where there is one, else the stated
    /// sigma; infinite for rows that are left out.
    pub fn noise(&self, plan: &Plan) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.count);
        for (k, (from, to, basis)) in self.blocks.iter().enumerate() {
            let granted = |row: usize| plan.granted.get(row).copied().unwrap_or(0.0);
            let variance = |row: usize| {
                if plan.left_out.contains(&row) {
                    f64::INFINITY
                } else {
                    (plan.sigma[row].powi(2) - granted(row)).max(f64::EPSILON * plan.sigma[row].powi(2))
                }
            };
            if basis.is_none() {
                out.extend(from.clone().map(variance));
                continue;
            }
            let white = from.clone().map(|row| plan.sigma[row].powi(2)).sum::<f64>() / from.len().max(1) as f64;
            match plan.scatter.get(k).map(|s| &s.variance).filter(|v| !v.is_empty() && repeats_with_noise(v, white)) {
                Some(v) => out.extend(harmonic_of(from.len()).into_iter().map(|h| v[h.min(v.len() - 1)])),
                None => out.extend(std::iter::repeat_n(white, to.len())),
            }
        }
        out
    }
}

/// Part of the stated variance below which a scatter between cycles is none: a record of one cycle that was repeated has the noise that is stated.
const REPEATED: f64 = 0.01;

fn repeats_with_noise(variance: &[f64], stated: f64) -> bool {
    variance.iter().sum::<f64>() > REPEATED * stated * variance.len() as f64
}

/// The scatter of a loop's channel between cycles.
#[derive(Clone, Debug, Default)]
pub struct Scatter {
    /// Variance of a coefficient of the mean cycle, harmonic by harmonic ([`crate::data::LoopChannel::scatter`]).
    pub variance: Vec<f64>,
    /// Cycles that it was seen in.
    pub cycles: usize,
    /// What the mean of the channel has gone by over all cycles of the record, those left out among them (drift); 0 where none is seen.
    pub crept: f64,
}

/// The covariance of a test, as what whitens its rows.
#[derive(Clone, Debug)]
pub struct Covariance {
    coefficients: Coefficients,
    /// `d^-1/2`.
    weight: DVector<f64>,
    /// Orthonormal columns U, and `(1 + s^2)^-1/2 - 1` of each.
    u: DMatrix<f64>,
    shrink: Vec<f64>,
}

impl Covariance {
    /// `d`: variance of each coefficient; infinite where it is not compared. `shared`: the columns B.
    pub fn new(coefficients: Coefficients, d: &[f64], shared: &DMatrix<f64>) -> Covariance {
        let weight = DVector::from_iterator(d.len(), d.iter().map(|v| if *v > 0.0 { 1.0 / v.sqrt() } else { 0.0 }));
        let mut a = shared.clone();
        a.column_iter_mut().for_each(|mut c| c.component_mul_assign(&weight));
        // Columns that cannot be computed are no errors.
        a.column_iter_mut().filter(|c| c.iter().any(|v| !v.is_finite())).for_each(|mut c| c.fill(0.0));
        // A test without instruments and scatter has no shared errors, of which there is no decomposition.
        if a.ncols() == 0 {
            return Covariance { coefficients, weight, u: a, shrink: vec![] };
        }
        let svd = a.svd(true, false);
        let shrink = svd.singular_values.iter().map(|s| 1.0 / (1.0 + s * s).sqrt() - 1.0).collect();
        let u = svd.u.unwrap_or_else(|| DMatrix::zeros(d.len(), 0));
        Covariance { coefficients, weight, u, shrink }
    }

    /// The covariance of some rows of a test whose coefficients are its rows, each with the number of rows it stands for: their independent errors fall as
    /// in a mean of so many, and what they share stays.
    pub fn of_rows(&self, kept: &[(usize, f64)]) -> Covariance {
        let rows: Vec<usize> = kept.iter().map(|k| k.0).collect();
        let weight = |(row, count): &(usize, f64)| self.weight[*row] * count.sqrt();
        let mut shared = self.u.select_rows(&rows);
        for (mut column, shrink) in shared.column_iter_mut().zip(&self.shrink) {
            column *= (1.0 / (1.0 + shrink).powi(2) - 1.0).max(0.0).sqrt();
        }
        let d: Vec<f64> = kept.iter().map(|k| weight(k).powi(-2)).collect();
        // From parts of the standard deviations of the independent errors back to what was shared; rows that are not compared share nothing.
        for (mut row, k) in shared.row_iter_mut().zip(&rows) {
            row *= if self.weight[*k] > 0.0 { 1.0 / self.weight[*k] } else { 0.0 };
        }
        let all = 0..rows.len();
        Covariance::new(Coefficients { blocks: vec![(all.clone(), all, None)], count: rows.len() }, &d, &shared)
    }

    /// Whitens rows of the plan, one column or many: the whitened coefficients of a block stand in its first rows, zeros in the others.
    pub fn whiten(&self, mut rows: DMatrixViewMut<f64>) {
        let turned = self.coefficients.turned(&rows.clone_owned());
        self.whiten_coefficients(turned, &mut rows);
    }

    /// The same of coefficients, which are turned already, into as many rows as the test has.
    pub fn whiten_coefficients(&self, mut turned: DMatrix<f64>, rows: &mut DMatrixViewMut<f64>) {
        turned.column_iter_mut().for_each(|mut c| c.component_mul_assign(&self.weight));
        let mut along = self.u.tr_mul(&turned);
        for (mut row, shrink) in along.row_iter_mut().zip(&self.shrink) {
            row *= *shrink;
        }
        turned.gemm(1.0, &self.u, &along, 1.0);
        rows.fill(0.0);
        for (from, to, _) in &self.coefficients.blocks {
            rows.rows_mut(from.start, to.len()).copy_from(&turned.rows(to.start, to.len()));
        }
    }
}

/// How an instrument may misread.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Misreading {
    /// By a factor.
    Gain,
    /// By a constant, in parts of the amplitude.
    Offset,
    /// Late, in parts of the period (of the shortest one of an FRF).
    Delay,
    /// By a quadratic or a cubic part, in parts of the largest reading.
    Bend,
    /// A sample beside a jump.
    Jump,
    /// By a constant, in parts of the amplitude, of a channel that drifts from cycle to cycle: where it began is not known.
    Drift,
}

/// What instruments within tolerance add to the covariance of a test.
#[derive(Clone, Debug)]
pub struct Instruments {
    /// In the test's coefficients, one column for one standard deviation of each.
    pub columns: DMatrix<f64>,
    /// Of each column the block, the misreading, and its standard deviation.
    pub of: Vec<(usize, Misreading, f64)>,
}

impl Instruments {
    /// Those of a test. `signal`: what the channels read, computed: the noise of a measured one would stand in the columns and in the residuals, and the two
    /// would agree. `reach`: what the channel of each block reads in any test.
    pub fn new(plan: &Plan, coefficients: &Coefficients, signal: &[f64], reach: &[Reach]) -> Instruments {
        let (mut columns, mut of) = (Vec::<DVector<f64>>::new(), Vec::new());
        for (k, (block, reach)) in plan.blocks.iter().zip(reach).enumerate() {
            let crept = plan.scatter.get(k).map_or(0.0, |s| s.crept);
            for (misreading, std, values) in of_block(plan, block, crept, &signal[block.range.clone()], *reach) {
                let mut whole = DVector::zeros(plan.len());
                whole.rows_mut(block.range.start, block.range.len()).copy_from_slice(&values);
                columns.push(whole);
                of.push((k, misreading, std));
            }
        }
        let none = columns.is_empty();
        let columns = if none { DMatrix::zeros(coefficients.count, 0) } else { coefficients.turned(&DMatrix::from_columns(&columns)) };
        Instruments { columns, of }
    }

    /// A test without any.
    #[cfg(test)]
    pub fn none(count: usize) -> Instruments {
        Instruments { columns: DMatrix::zeros(count, 0), of: vec![] }
    }
}

/// What a channel reads in any test.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reach {
    /// Its largest reading.
    pub peak: f64,
    /// Amplitude of the sine of its largest rms.
    pub amplitude: f64,
}

impl Reach {
    /// That of one signal.
    pub fn of(signal: &[f64]) -> Reach {
        Reach { peak: signal.iter().fold(0.0, |m, v| m.max(v.abs())), amplitude: amplitude(signal) }
    }

    /// That of both.
    pub fn and(self, other: Reach) -> Reach {
        Reach { peak: self.peak.max(other.peak), amplitude: self.amplitude.max(other.amplitude) }
    }
}

/// Amplitude of the sine of this signal's rms.
fn amplitude(signal: &[f64]) -> f64 {
    let n = signal.len().max(1) as f64;
    (2.0 * signal.iter().map(|v| v * v).sum::<f64>() / n).sqrt()
}

fn of_block(plan: &Plan, block: &Block, crept: f64, signal: &[f64], reach: Reach) -> Vec<(Misreading, f64, Vec<f64>)> {
    let by = &plan.tolerances;
    // In parts of a period of this frequency.
    let delayed = |frequency: f64| by.delay_time.map_or(by.delay, |t| t * frequency);
    let gain = |by: f64| (Misreading::Gain, by, signal.iter().map(|v| by * v).collect::<Vec<f64>>());
    let (own, peak) = (amplitude(signal), reach.peak);
    // Told in parts of what the channel reads here, of which the zero of a sensor of a larger range is a larger part.
    let zero = by.offset * reach.amplitude.max(own);
    let constant = (Misreading::Offset, if own > 0.0 { zero / own } else { by.offset }, vec![zero; signal.len()]);
    match block.kind {
        BlockKind::Table => vec![],
        // A record's longest period is its length, of which a delay is no part.
        BlockKind::Record => vec![gain(by.gain), constant],
        BlockKind::Loop => {
            let sigma = &plan.sigma[block.range.clone()];
            // Over a period of 1, so that the derivative is per period.
            let noise = sigma.iter().sum::<f64>() / sigma.len().max(1) as f64;
            let wave = FourierInput::fit(&block.abscissa, signal, |_| noise, std::f64::consts::TAU);
            let late = delayed(plan.cycle_drive().map_or(1.0, |d| d.frequency));
            let delay = block.abscissa.iter().map(|p| -late * wave.at_phase(*p).1).collect();
            let bent = |power: i32| signal.iter().map(|v| by.linearity * peak * (v / peak).powi(power)).collect::<Vec<f64>>();
            let mut columns = vec![gain(by.gain), constant, (Misreading::Delay, late, delay)];
            if peak > 0.0 && block.role == "force" {
                columns.extend([2, 3].map(|power| (Misreading::Bend, by.linearity, bent(power))));
            }
            let jumps = jumps(&beside_jumps(&plan.measured[block.range.clone()], sigma));
            columns.extend(jumps.into_iter().map(|column| (Misreading::Jump, BESIDE, column)));
            if crept != 0.0 {
                columns.push((Misreading::Drift, crept.abs() / own.max(f64::MIN_POSITIVE), vec![crept.abs(); signal.len()]));
            }
            columns
        }
        BlockKind::Frf => {
            // H exp(-i w tau): a turn by -w tau.
            let top = block.abscissa.iter().fold(0.0f64, |m, f| m.max(*f));
            let turn = |f: f64| -std::f64::consts::TAU * delayed(top) * f / top;
            let delay = signal.chunks(2).zip(&block.abscissa).flat_map(|(h, f)| match h {
                [re, im] => [-turn(*f) * im, turn(*f) * re],
                _ => [0.0; 2],
            });
            vec![gain(by.calibration), (Misreading::Delay, delayed(top), delay.collect())]
        }
    }
}

/// One column for each of the points beside the largest jumps.
fn jumps(beside: &[f64]) -> Vec<Vec<f64>> {
    let mut points: Vec<usize> = (0..beside.len()).filter(|i| beside[*i] > 0.0).collect();
    points.sort_by(|a, b| beside[*b].total_cmp(&beside[*a]));
    points.truncate(JUMPS);
    let column = |i: usize| (0..beside.len()).map(|k| if k == i { beside[i] } else { 0.0 }).collect();
    points.into_iter().map(column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth loop has none; beside a jump a point may be off by the jump, elsewhere not.
    #[test]
    fn only_a_jump_is_known_no_better_than_its_samples() {
        let loop_of = |jump: f64| -> Vec<f64> {
            (0..128).map(|k| (std::f64::consts::TAU * f64::from(k) / 128.0).sin() + if k < 64 { jump } else { 0.0 }).collect()
        };
        let sigma = vec![0.002; 128];
        assert!(beside_jumps(&loop_of(0.0), &sigma).iter().all(|s| *s == 0.0));
        let wider = beside_jumps(&loop_of(1.0), &sigma);
        for (k, s) in wider.iter().enumerate() {
            assert_eq!([0, 63, 64, 127].contains(&k), *s > 0.8, "{k}: {s}");
            assert!([0, 63, 64, 127].contains(&k) || *s == 0.0);
        }
        assert_eq!(jumps(&wider).len(), 4);
        // A sample within the jump knows nothing; the corners of a triangle and of its clean sine are no jumps.
        let mut within = loop_of(1.0);
        within[64] = 0.5;
        assert!(beside_jumps(&within, &sigma)[64] > 0.8);
        let triangle: Vec<f64> = (0..128).map(|k| (f64::from(k) - 64.0).abs() / 64.0).collect();
        for clean in [triangle, loop_of(0.0)] {
            assert!(beside_jumps(&clean, &[1e-7; 128]).iter().all(|s| *s == 0.0));
        }
    }

    /// The amplitude of a sine is its own, however it is sampled; what it stands on is read by the same sensor; of a signal of few large readings it is
    /// little beside these.
    #[test]
    fn what_an_offset_is_part_of_is_the_amplitude_of_the_rms() {
        let about = |mean: f64| (0..64).map(|k| mean + 2.0 * (std::f64::consts::TAU * f64::from(k) / 64.0).sin()).collect::<Vec<f64>>();
        assert!((amplitude(&about(0.0)) - 2.0).abs() < 1e-12);
        assert!((amplitude(&about(7.0)) - (4.0f64 + 2.0 * 49.0).sqrt()).abs() < 1e-12);
        let rare: Vec<f64> = (0..200).map(|k| if k % 100 == 0 { 1.0 } else { 0.0 }).collect();
        assert!(amplitude(&rare) < 0.15);
    }

    /// Rows whitened by the square root of `(D + B B')^-1` have its inverse as their product, in the coefficients of a loop and of lines.
    #[test]
    fn whitened_rows_have_the_inverse_covariance() {
        let basis = harmonics(64);
        let (m, n) = (basis.nrows(), 64);
        let blocks = vec![(0..n, 0..m, Some(basis.clone())), (n..n + 10, m..m + 10, None)];
        let coefficients = Coefficients { blocks, count: m + 10 };
        let d: Vec<f64> = (0..m + 10).map(|i| if i == 3 { f64::INFINITY } else { 1.0 + (i as f64 * 0.3).sin().powi(2) }).collect();
        let b = DMatrix::from_fn(m + 10, 3, |i, k| ((i * (k + 2)) as f64 * 0.37).sin() * 10f64.powi(k as i32 - 1));
        let c = Covariance::new(coefficients.clone(), &d, &b);
        let r = DMatrix::from_fn(n + 10, 1, |i, _| (i as f64 * 1.7).cos());
        let mut w = DMatrix::from_columns(&[r.column(0).into_owned(), 2.0 * r.column(0)]);
        c.whiten(w.as_view_mut());
        let seen: Vec<usize> = (0..m + 10).filter(|i| *i != 3).collect();
        let (turned, b) = (coefficients.turned(&r).select_rows(&seen), b.select_rows(&seen));
        let full = DMatrix::from_diagonal(&DVector::from_iterator(seen.len(), seen.iter().map(|i| d[*i]))) + &b * b.transpose();
        let want = turned.column(0).dot(&full.lu().solve(&turned.column(0).into_owned()).unwrap());
        approx::assert_relative_eq!(w.column(0).norm_squared(), want, max_relative = 1e-10);
        approx::assert_relative_eq!(w.column(1).norm_squared(), 4.0 * want, max_relative = 1e-10);
    }

    #[test]
    fn some_rows_have_their_part_of_the_covariance() {
        let n = 12;
        let d: Vec<f64> = (0..n).map(|i| if i == 4 { f64::INFINITY } else { 1.0 + (i as f64 * 0.3).sin().powi(2) }).collect();
        let b = DMatrix::from_fn(n, 2, |i, k| ((i * (k + 2)) as f64 * 0.37).sin() * 3.0);
        let whole = Covariance::new(Coefficients { blocks: vec![(0..n, 0..n, None)], count: n }, &d, &b);
        let kept = [(0, 3.0), (3, 2.0), (4, 3.0), (7, 1.0), (11, 3.0)];
        let part = whole.of_rows(&kept);
        let mut r = DMatrix::from_fn(kept.len(), 1, |i, _| (i as f64 * 1.7).cos());
        let seen: Vec<usize> = vec![0, 1, 3, 4];
        let rows: Vec<usize> = seen.iter().map(|k| kept[*k].0).collect();
        let (of_seen, b) = (r.select_rows(&seen), b.select_rows(&rows));
        let full = DMatrix::from_diagonal(&DVector::from_iterator(4, seen.iter().map(|k| d[kept[*k].0] / kept[*k].1))) + &b * b.transpose();
        part.whiten(r.as_view_mut());
        let want = of_seen.column(0).dot(&full.lu().solve(&of_seen.column(0).into_owned()).unwrap());
        approx::assert_relative_eq!(r.column(0).norm_squared(), want, max_relative = 1e-10);
    }
}
