//! Energies of a settled loop, with their deviations.
//!
//! Displacement and force as truncated Fourier series over the phase, x = sum c_m cos m p + d_m sin m p, F = sum a_m cos m p + b_m sin m p, give
//! W_D = loop integral of F dx = pi sum_m m (a_m d_m - b_m c_m), without the error of a polygon.
//! To it comes what the series leave out, averages and cut-off harmonics: the mean area of the recorded cycles, sample by sample, less the
//! same polygon of the series, W_m sin(2 pi m / N) / (2 pi m / N). The coefficients of n points with deviation s
//! and correlation rho_l between points l apart have the variance 2 s^2 / n (1 + 2 sum_l rho_l cos(2 pi m l / n)); first-order propagation gives the rest.

use super::{LoopChannel, SettledLoop};
use crate::data::{FourierInput, Role, StoredEnergy};
use std::f64::consts::{PI, TAU};

/// A value with its standard deviation, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    pub value: f64,
    pub sigma: f64,
}

/// Energies per cycle of a loop.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopEnergy {
    /// W_D, J.
    pub dissipated: Estimate,
    /// W_s = dF^2 / (2 k_s), J; none where the branches have no common slope above 0.
    pub stored_slope: Option<Estimate>,
    /// W_s = dF dx / 2, J.
    pub stored_product: Estimate,
    /// D = W_D / W_s, by the slope, else by the product.
    pub loss_ratio: Estimate,
    /// Ranges of displacement and force, SI.
    pub travel: Estimate,
    pub force_range: Estimate,
}

impl LoopEnergy {
    /// W_s in a reading.
    pub fn stored(&self, reading: StoredEnergy) -> Option<Estimate> {
        match reading {
            StoredEnergy::Slope => self.stored_slope,
            StoredEnergy::Product => Some(self.stored_product),
        }
    }
}

/// Points on which ranges and slopes are taken.
const GRID: usize = 720;
/// Part of the travel, in the middle, over which the slope of the branch mean is taken.
const MIDDLE: f64 = 0.6;

/// Fourier coefficients of a channel that stand out of its noise: (harmonic, cos, sin, variance of each).
pub(super) fn series(l: &SettledLoop, c: &LoopChannel) -> (f64, Vec<[f64; 4]>) {
    let fit = FourierInput::fit(&l.phase, &c.mean, |k| c.sigma_at(k), TAU * l.frequency);
    let kept = fit.cos.iter().zip(&fit.sin).enumerate().filter(|(_, (a, b))| **a != 0.0 || **b != 0.0);
    (fit.mean, kept.map(|(k, (a, b))| [(k + 1) as f64, *a, *b, variance(l, c, k + 1)]).collect())
}

/// Variance of each coefficient of harmonic m.
fn variance(l: &SettledLoop, c: &LoopChannel, m: usize) -> f64 {
    let tail: f64 = c.correlation.iter().enumerate().skip(1).map(|(k, r)| r * (TAU * (m * k) as f64 / l.n as f64).cos()).sum();
    2.0 * c.sigma_mean.powi(2) / l.n as f64 * (1.0 + 2.0 * tail).max(0.0)
}

/// cos and sin of the phases of the grid; a harmonic steps through them.
struct Waves {
    cos: Vec<f64>,
    sin: Vec<f64>,
}

impl Waves {
    fn new() -> Self {
        let angle = |k: usize| TAU * k as f64 / GRID as f64;
        Self { cos: (0..GRID).map(|k| angle(k).cos()).collect(), sin: (0..GRID).map(|k| angle(k).sin()).collect() }
    }

    /// Adds a cos m p + b sin m p to the samples.
    fn add(&self, out: &mut [f64], m: f64, a: f64, b: f64) {
        let m = m as usize;
        out.iter_mut().enumerate().for_each(|(k, v)| *v += a * self.cos[m * k % GRID] + b * self.sin[m * k % GRID]);
    }

    fn sample(&self, series: &[[f64; 4]]) -> Vec<f64> {
        let mut out = vec![0.0; GRID];
        series.iter().for_each(|[m, a, b, _]| self.add(&mut out, *m, *a, *b));
        out
    }
}

/// (harmonic, its part of W_D).
fn parts(x: &[[f64; 4]], f: &[[f64; 4]]) -> impl Iterator<Item = (f64, f64)> {
    x.iter().flat_map(|x| f.iter().filter(|f| f[0] == x[0]).map(|f| (x[0], PI * x[0] * (f[1] * x[2] - f[2] * x[1]))))
}

fn dissipated(x: &[[f64; 4]], f: &[[f64; 4]]) -> f64 {
    parts(x, f).map(|p| p.1).sum()
}

/// The same as a polygon of so many points per cycle.
fn polygon(x: &[[f64; 4]], f: &[[f64; 4]], samples: f64) -> f64 {
    let sinc = |u: f64| if u == 0.0 { 1.0 } else { u.sin() / u };
    parts(x, f).map(|(m, w)| w * sinc(TAU * m / samples)).sum()
}

/// Range of values, and the places of its ends.
fn range(v: &[f64]) -> (f64, usize, usize) {
    let by = |a: &usize, b: &usize| v[*a].total_cmp(&v[*b]);
    let (low, high) = ((0..v.len()).min_by(by).unwrap_or(0), (0..v.len()).max_by(by).unwrap_or(0));
    (v[high] - v[low], low, high)
}

/// Least-squares slope of the branch-mean force over the middle of the travel.
fn slope(x: &[f64], f: &[f64]) -> Option<f64> {
    let (travel, low, high) = range(x);
    if travel.is_nan() || travel <= 0.0 {
        return None;
    }
    let n = x.len();
    // Force where a branch passes a displacement; both run once through the branch.
    let branch = |from: usize, to: usize, at: f64| {
        let len = (to + n - from) % n;
        (0..len).find_map(|k| {
            let (a, b) = ((from + k) % n, (from + k + 1) % n);
            ((x[a] - at) * (x[b] - at) <= 0.0 && x[a] != x[b]).then(|| f[a] + (f[b] - f[a]) * (at - x[a]) / (x[b] - x[a]))
        })
    };
    let points = 31;
    let (mut top, mut bottom) = (0.0, 0.0);
    for k in 0..points {
        let u = (k as f64 / (points - 1) as f64 - 0.5) * MIDDLE;
        let at = x[low] + travel * (0.5 + u);
        top += 0.5 * (branch(low, high, at)? + branch(high, low, at)?) * u;
        bottom += u * u;
    }
    Some(top / (travel * bottom))
}

/// W_D, W_s by slope, W_s by product, D, travel, force range.
fn all(w: f64, xs: &[f64], fs: &[f64]) -> [Option<f64>; 6] {
    let (travel, force) = (range(xs).0, range(fs).0);
    let stored = slope(xs, fs).filter(|k| *k > 0.0).map(|k| force * force / (2.0 * k));
    let product = 0.5 * force * travel;
    [Some(w), stored, Some(product), Some(w / stored.unwrap_or(product)), Some(travel), Some(force)]
}

impl SettledLoop {
    /// Energies of the loop at `at` (the place of the controlled channel where none is named); none without displacement and force there, or
    /// where one of them stands still.
    pub fn energy(&self, at: Option<&str>) -> Option<LoopEnergy> {
        let at = at.unwrap_or(self.channels.get(self.controlled)?.at.as_str());
        let channel = |role: Role| self.channels.iter().find(|c| c.role == role && c.at == at);
        let (x, f) = (series(self, channel(Role::Displacement)?).1, series(self, channel(Role::Force)?).1);
        let waves = Waves::new();
        let (xs, fs) = (waves.sample(&x), waves.sample(&f));
        let recorded = self.recorded.iter().find(|r| r.at == at);
        let area = dissipated(&x, &f) + recorded.map_or(0.0, |r| r.area - polygon(&x, &f, r.samples));
        let base = all(area, &xs, &fs);
        // Slopes by central differences over each coefficient, one deviation to each side.
        let mut variances = [0.0f64; 6];
        for (which, series) in [&x, &f].into_iter().enumerate() {
            for [m, _, _, v] in series.iter().copied() {
                for (a, b) in [(v.sqrt(), 0.0), (0.0, v.sqrt())] {
                    let moved = |sign: f64| {
                        let change = [[m, sign * a, sign * b, 0.0]];
                        let (mut xs, mut fs) = (xs.clone(), fs.clone());
                        waves.add(if which == 0 { &mut xs } else { &mut fs }, m, sign * a, sign * b);
                        // W_D is linear in either channel.
                        let w = if which == 0 { dissipated(&change, &f) } else { dissipated(&x, &change) };
                        all(area + w, &xs, &fs)
                    };
                    for (v, (a, b)) in variances.iter_mut().zip(moved(1.0).iter().zip(&moved(-1.0))) {
                        if let (Some(a), Some(b)) = (a, b) {
                            *v += (0.5 * (a - b)).powi(2);
                        }
                    }
                }
            }
        }
        if let (Some(r), Some(cx), Some(cf)) = (recorded, channel(Role::Displacement), channel(Role::Force)) {
            // The recorded cycles have the noise of one channel on every harmonic of the other, also where its own series has none.
            let on = |noisy: &LoopChannel, own: &[[f64; 4]], other: &[[f64; 4]]| -> f64 {
                let bare = other.iter().filter(|o| own.iter().all(|h| h[0] != o[0]));
                bare.map(|[m, a, b, _]| (PI * m).powi(2) * (a * a + b * b) * variance(self, noisy, *m as usize)).sum()
            };
            // White noise is averaged over every sample, of which the points of the loop are a part.
            let white = cx.correlation.len() + cf.correlation.len() == 2;
            let finer = if white { (self.n as f64 / r.samples).min(1.0) } else { 1.0 };
            // Noise on noise, in every cycle: N / 2 s_x^2 s_F^2.
            let both = 0.5 * r.samples / self.cycles as f64 * (cx.sigma_sample * cf.sigma_sample).powi(2);
            let more = finer * (on(cx, &x, &f) + on(cf, &f, &x)) + both;
            variances[0] = finer * variances[0] + more;
            variances[3] += more * (base[3].unwrap_or(0.0) / area).powi(2);
        }
        let get = |k: usize| base[k].map(|value| Estimate { value, sigma: variances[k].sqrt() });
        let travel = get(4).filter(|t| t.value > 0.0)?;
        Some(LoopEnergy {
            dissipated: get(0)?,
            stored_slope: get(1),
            stored_product: get(2)?,
            loss_ratio: get(3)?,
            travel,
            force_range: get(5).filter(|f| f.value > 0.0)?,
        })
    }
}
