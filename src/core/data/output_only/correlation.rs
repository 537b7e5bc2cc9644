//! Correlations of responses at lags from 0 on, and their transforms, part of the record by part.

use num_complex::Complex64;
use realfft::RealFftPlanner;

use crate::parallel;

/// Parts of a record that the scatter is told from.
pub(super) const PARTS: usize = 16;
/// The correlation at the last lag is weighted by exp of minus this: most of it is noise there.
const FADED: f64 = 3.0;
/// Lines on either side that the scatter of a line is averaged with: that of sixteen parts is itself uncertain by a fifth.
const BESIDE: usize = 2;

/// Half spectra of every response with every reference.
pub(super) struct HalfSpectra {
    pub outputs: usize,
    pub references: usize,
    /// Rate by which the weight of a lag decays [1/sample].
    pub decay: f64,
    /// `parts[p][o * references + r][l]`
    parts: Vec<Vec<Vec<Complex64>>>,
}

impl HalfSpectra {
    /// Those of responses of one length over `lags` lags, an even number; the first `references` of them are the references. Every part has as many products.
    pub fn of(responses: &[Vec<f64>], references: usize, lags: usize) -> HalfSpectra {
        let samples = responses.first().map_or(0, Vec::len);
        let length = samples.saturating_sub(lags) / PARTS;
        let decay = FADED / lags as f64;
        let weights: Vec<f64> = (0..lags).map(|k| (-decay * k as f64).exp() / length as f64 * if k == 0 { 0.5 } else { 1.0 }).collect();
        let parts = parallel::over(PARTS, |p| part(responses, references, p * length, length, &weights));
        HalfSpectra { outputs: responses.len(), references, decay, parts }
    }

    fn columns(&self) -> usize {
        self.outputs * self.references
    }

    /// Mean of those parts that count.
    fn mean_of(&self, counts: impl Fn(usize) -> bool) -> Vec<Vec<Complex64>> {
        let used: Vec<&Vec<Vec<Complex64>>> = self.parts.iter().enumerate().filter(|(p, _)| counts(*p)).map(|(_, s)| s).collect();
        let lines = self.parts[0][0].len();
        let mean = |column: usize, line: usize| used.iter().map(|s| s[column][line]).sum::<Complex64>() / used.len() as f64;
        (0..self.columns()).map(|c| (0..lines).map(|l| mean(c, l)).collect()).collect()
    }

    pub fn mean(&self) -> Vec<Vec<Complex64>> {
        self.mean_of(|_| true)
    }

    /// The mean without one part.
    pub fn without(&self, part: usize) -> Vec<Vec<Complex64>> {
        self.mean_of(|p| p != part)
    }

    /// Standard deviation of the real part, and of the imaginary part, of the mean, by the scatter of the parts about each line.
    pub fn sigma(&self) -> Vec<Vec<f64>> {
        let mean = self.mean();
        let count = PARTS as f64;
        let column = |c: usize| {
            let variance =
                |l: usize| self.parts.iter().map(|s| (s[c][l] - mean[c][l]).norm_sqr()).sum::<f64>() / (2.0 * count * (count - 1.0));
            let raw: Vec<f64> = (0..mean[c].len()).map(variance).collect();
            let near = |l: usize| &raw[l.saturating_sub(BESIDE)..(l + BESIDE + 1).min(raw.len())];
            let largest = raw.iter().fold(0.0, |a: f64, b| a.max(*b));
            let smooth = |l: usize| near(l).iter().sum::<f64>() / near(l).len() as f64;
            (0..raw.len()).map(|l| smooth(l).max(f64::EPSILON * largest).max(f64::MIN_POSITIVE).sqrt()).collect()
        };
        (0..self.columns()).map(column).collect()
    }
}

/// Half spectra of the products whose earlier sample lies in `length` samples from `from`.
fn part(responses: &[Vec<f64>], references: usize, from: usize, length: usize, weights: &[f64]) -> Vec<Vec<Complex64>> {
    let lags = weights.len();
    let size = (length + lags).next_power_of_two();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, back, last) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size), planner.plan_fft_forward(lags));
    let spectrum = |samples: &[f64]| {
        let mut padded = vec![0.0; size];
        padded[..samples.len()].copy_from_slice(samples);
        let mut out = forward.make_output_vec();
        // The lengths are those that the plan was made for.
        let done = forward.process(&mut padded, &mut out);
        debug_assert!(done.is_ok());
        out
    };
    let later: Vec<Vec<Complex64>> = responses.iter().map(|x| spectrum(&x[from..from + length + lags])).collect();
    let earlier: Vec<Vec<Complex64>> = responses[..references].iter().map(|x| spectrum(&x[from..from + length])).collect();
    let mut columns = Vec::with_capacity(later.len() * references);
    for later in &later {
        for earlier in &earlier {
            let mut product: Vec<Complex64> = later.iter().zip(earlier).map(|(a, b)| a * b.conj() / size as f64).collect();
            // Real by construction; the inverse transform refuses what rounding leaves of the imaginary part there.
            let end = product.len() - 1;
            (product[0].im, product[end].im) = (0.0, 0.0);
            let mut correlation = back.make_output_vec();
            let done = back.process(&mut product, &mut correlation);
            debug_assert!(done.is_ok());
            let mut weighted: Vec<f64> = correlation.iter().zip(weights).map(|(r, w)| r * w).collect();
            let mut out = last.make_output_vec();
            let done = last.process(&mut weighted, &mut out);
            debug_assert!(done.is_ok());
            columns.push(out);
        }
    }
    columns
}
