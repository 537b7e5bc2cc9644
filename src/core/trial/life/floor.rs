//! What the law that is true reaches on the held-out tests: its strengths and the free parameters fitted, its shapes known.

use nalgebra::{DMatrix, DVector};

use super::super::bench::{Bench, Drive, Flaw, Planted, Response, Test, averaged, rms, shown};
use super::super::generate::Generated;

/// Steps of Gauss and Newton, halvings of one, and the relative difference by which slopes are taken.
const STEPS: usize = 4;
const HALVINGS: usize = 3;
const SLOPE: f64 = 1e-3;
/// Error of the true law in a test that its fit reckons with beside the noise, relative to the channel: strengths and gains differ by so much,
/// and tests without noise must not outweigh all others.
const DISCREPANCY: f64 = 0.01;

/// What a channel of a record shows: the mean of the cycles that are kept, every line or sample.
fn recorded(test: &Test, channel: &[f64]) -> Vec<f64> {
    let Drive::Loop { .. } = test.drive else { return channel.to_vec() };
    let n = test.record.samples;
    let kept = &channel[channel.len() - n * test.record.kept..];
    (0..n).map(|j| kept.iter().skip(j).step_by(n).sum::<f64>() / test.record.kept as f64).collect()
}

struct Truth<'a> {
    case: &'a Generated,
    flaws: Vec<Flaw>,
}

impl Truth<'_> {
    /// What the truth reads in a test with these factors on parameters and strengths.
    fn read(&self, factors: &[f64], test: &Test) -> Response {
        let bench: &Bench = &self.case.bench;
        let params: Vec<f64> = bench.params.iter().zip(factors).map(|(p, f)| p * f).collect();
        let scaled = |(p, f): (&Planted, &f64)| Planted { size: p.size * f, ..p.clone() };
        let planted: Vec<Planted> = self.case.planted.iter().zip(&factors[params.len()..]).map(scaled).collect();
        bench.read(&params, &planted, &self.flaws, &self.case.tests, test)
    }

    /// Measured less computed of the tests that are fitted or decide, in standard deviations of noise and
    /// [`DISCREPANCY`].
    fn residuals(&self, factors: &[f64]) -> DVector<f64> {
        let mut all = Vec::new();
        for (test, m) in self.case.tests.iter().zip(&self.case.measured).filter(|(t, _)| t.split != "held_out") {
            let r = self.read(factors, test);
            for ((c, m), s) in r.channels.iter().zip(&m.channels).zip(&m.sigma) {
                let own = DISCREPANCY * rms(m);
                let rows = recorded(test, m).into_iter().zip(shown(test, c)).zip(shown(test, s));
                all.extend(rows.map(|((m, c), s)| (m - c) / (s / averaged(test)).hypot(own)));
            }
        }
        DVector::from_vec(all)
    }

    fn fitted(&self) -> Option<Vec<f64>> {
        let n = self.case.bench.params.len() + self.case.planted.len();
        let mut at = vec![1.0; n];
        let mut left = self.residuals(&at);
        for _ in 0..STEPS {
            let columns: Vec<DVector<f64>> = (0..n)
                .map(|j| {
                    let mut moved = at.clone();
                    moved[j] += SLOPE;
                    (&left - self.residuals(&moved)) / SLOPE
                })
                .collect();
            let step = DMatrix::from_columns(&columns).svd(true, true).solve(&left, 1e-12).ok()?;
            let halved = (0..HALVINGS).find_map(|k| {
                let next: Vec<f64> = at.iter().zip(step.iter()).map(|(a, s)| (a + s * 0.5f64.powi(k as i32)).max(0.05)).collect();
                let residuals = self.residuals(&next);
                (residuals.norm() < left.norm()).then_some((next, residuals))
            });
            let Some((next, residuals)) = halved else { break };
            let done = residuals.norm() > (1.0 - 1e-4) * left.norm();
            (at, left) = (next, residuals);
            if done {
                break;
            }
        }
        left.norm().is_finite().then_some(at)
    }
}

/// Error of the true law on the held-out tests, pooled and relative as a ladder states it; none before the case is measured.
pub fn floor(case: &Generated) -> Option<f64> {
    if case.measured.len() != case.tests.len() {
        return None;
    }
    let truth = Truth { case, flaws: case.instrument.iter().cloned().collect() };
    let factors = truth.fitted()?;
    let mut squares = Vec::new();
    for (test, m) in case.tests.iter().zip(&case.measured).filter(|(t, _)| t.split == "held_out") {
        let r = truth.read(&factors, test);
        let frf = matches!(test.drive, Drive::Frf { .. });
        let both: Vec<(Vec<f64>, Vec<f64>)> =
            r.channels.iter().zip(&m.channels).map(|(c, m)| (recorded(test, m), shown(test, c).to_vec())).collect();
        // Real and imaginary part are one channel.
        let channels: Vec<(Vec<f64>, Vec<f64>)> =
            if frf { vec![both.into_iter().reduce(|(m, c), (n, d)| ([m, n].concat(), [c, d].concat()))?] } else { both };
        let error = |(m, c): &(Vec<f64>, Vec<f64>)| {
            let square = |v: f64| v * v;
            let size = if frf { (m.iter().map(|m| m * m).sum::<f64>() / m.len() as f64).sqrt() } else { rms(m) };
            m.iter().zip(c).map(|(m, c)| square((m - c) / size)).sum::<f64>() / m.len() as f64
        };
        squares.push(channels.iter().map(error).sum::<f64>() / channels.len().max(1) as f64);
    }
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}
