//! The drive frequency of a record, by sine fit.

use nalgebra::{Cholesky, SMatrix, SVector};
use realfft::RealFftPlanner;
use std::f64::consts::TAU;

/// Mean, drift and three harmonics: enough that the curvature of a triangle or a flattened sine does not pull the frequency.
const COLUMNS: usize = 8;

/// A sine fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SineFit {
    /// Hz
    pub frequency: f64,
    /// Amplitude of the fundamental.
    pub amplitude: f64,
}

/// Estimates the fundamental frequency of x(t): the highest line of the spectrum, refined by least squares over
/// x = m + d t + sum_{k=1..3} (a_k cos k w t + b_k sin k w t), weighted by a Hann window so that neither higher harmonics nor a run-up at the
/// ends pull the frequency. None when x does not vary or holds fewer than 8 samples.
pub fn estimate(t: &[f64], x: &[f64]) -> Option<SineFit> {
    let n = t.len().min(x.len());
    if n < 8 {
        return None;
    }
    if n > LONG { long(&t[..n], &x[..n]) } else { short(&t[..n], &x[..n]) }
}

/// Samples beyond which the phase is followed piece by piece instead.
const LONG: usize = 1 << 17;
/// Samples of the part that gives a first estimate.
const PART: usize = 1 << 15;

/// Long records: a first estimate from a part (or from the record thinned by averaging, where a part holds too few cycles), then the phase of the
/// fundamental over pieces of whole cycles, whose slope is the rest. Cost linear in the samples.
fn long(t: &[f64], x: &[f64]) -> Option<SineFit> {
    let n = t.len();
    let middle = n / 2 - PART / 2;
    let part = short(&t[middle..middle + PART], &x[middle..middle + PART]);
    let enough = |f: &SineFit| f.frequency * (t[middle + PART - 1] - t[middle]) > 8.0;
    let first = match part.filter(enough) {
        Some(fit) => fit,
        None => {
            let by = n.div_ceil(PART);
            let mean = |v: &[f64]| v.chunks_exact(by).map(|c| c.iter().sum::<f64>() / by as f64).collect::<Vec<f64>>();
            short(&mean(t), &mean(x))?
        }
    };
    let span = t[n - 1] - t[0];
    let cycles = first.frequency * span;
    // Pieces of whole cycles, at most 256 of them: mean and drift fall out of whole cycles.
    let per_piece = (cycles / 256.0).ceil().max(1.0) / first.frequency;
    let pieces = (span / per_piece).floor() as usize;
    if pieces < 3 {
        return Some(first);
    }
    let (mut phases, mut amplitude, mut from) = (Vec::with_capacity(pieces), 0.0f64, 0);
    for k in 0..pieces {
        let end = t[0] + (k + 1) as f64 * per_piece;
        let to = from + t[from..].partition_point(|t| *t < end);
        let (mut a, mut b, mut m) = (0.0, 0.0, 0.0);
        for i in from..to {
            m += x[i];
        }
        m /= (to - from).max(1) as f64;
        for i in from..to {
            let (s, c) = (TAU * first.frequency * (t[i] - t[0])).sin_cos();
            a += (x[i] - m) * c;
            b += (x[i] - m) * s;
        }
        let size = 2.0 * a.hypot(b) / (to - from).max(1) as f64;
        amplitude = amplitude.max(size);
        phases.push((k as f64, a.atan2(b), size));
        from = to;
    }
    // Only pieces at full amplitude: run-up and run-down have a phase of their own.
    phases.retain(|p| p.2 > 0.9 * amplitude);
    let mut turns = 0.0;
    for k in 1..phases.len() {
        let step = phases[k].1 + turns - phases[k - 1].1;
        turns -= TAU * (step / TAU).round();
        phases[k].1 += turns;
    }
    let count = phases.len() as f64;
    let (mk, mp) = (phases.iter().map(|p| p.0).sum::<f64>() / count, phases.iter().map(|p| p.1).sum::<f64>() / count);
    let (above, below) = phases.iter().fold((0.0, 0.0), |(a, b), p| (a + (p.0 - mk) * (p.1 - mp), b + (p.0 - mk).powi(2)));
    let slope = if below > 0.0 { above / below } else { 0.0 };
    Some(SineFit { frequency: first.frequency + slope / per_piece / TAU, amplitude })
}

fn short(t: &[f64], x: &[f64]) -> Option<SineFit> {
    let n = t.len();
    let span = t[n - 1] - t[0];
    let guess = spectral_peak(t, x, span)?;
    // The cost is one valley within half a line of the peak: golden section.
    let line = 1.0 / span;
    let (mut low, mut high) = ((guess - 0.6 * line).max(0.2 * line), guess + 0.6 * line);
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let cost = |f: f64| fit(t, x, f).map_or(f64::INFINITY, |s| s.0);
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut cost_a, mut cost_b) = (cost(a), cost(b));
    // 0.618^36 of the valley is 4e-8 of a line: phase errors stay far below a sample.
    for _ in 0..36 {
        if cost_a < cost_b {
            (high, b, cost_b) = (b, a, cost_a);
            a = high - golden * (high - low);
            cost_a = cost(a);
        } else {
            (low, a, cost_a) = (a, b, cost_b);
            b = low + golden * (high - low);
            cost_b = cost(b);
        }
    }
    let frequency = 0.5 * (low + high);
    let (_, amplitude) = fit(t, x, frequency)?;
    (amplitude > 0.0).then_some(SineFit { frequency, amplitude })
}

/// Weighted residual sum of squares and amplitude of the fundamental at frequency `f`.
fn fit(t: &[f64], x: &[f64], f: f64) -> Option<(f64, f64)> {
    let n = t.len().min(x.len());
    let middle = 0.5 * (t[0] + t[n - 1]);
    let half = 0.5 * (t[n - 1] - t[0]);
    let scale = x[..n].iter().fold(0.0f64, |m, v| m.max(v.abs()));
    if scale == 0.0 || half <= 0.0 {
        return None;
    }
    let (mut ata, mut atx, mut xx) = (SMatrix::<f64, COLUMNS, COLUMNS>::zeros(), SVector::<f64, COLUMNS>::zeros(), 0.0);
    let mut row = SVector::<f64, COLUMNS>::zeros();
    for (t, x) in t.iter().zip(x) {
        let (s1, c1) = (TAU * f * (t - middle)).sin_cos();
        let (s2, c2) = (2.0 * s1 * c1, 2.0 * c1 * c1 - 1.0);
        let (s3, c3) = (s2 * c1 + c2 * s1, c2 * c1 - s2 * s1);
        row.copy_from_slice(&[1.0, (t - middle) / half, c1, s1, c2, s2, c3, s3]);
        let x = x / scale;
        let weight = 0.5 + 0.5 * (std::f64::consts::PI * (t - middle) / half).cos() + 1e-3;
        ata.ger(weight, &row, &row, 1.0);
        atx.axpy(weight * x, &row, 1.0);
        xx += weight * x * x;
    }
    let solution = Cholesky::new(ata)?.solve(&atx);
    let rest = (xx - solution.dot(&atx)).max(0.0) * scale * scale;
    Some((rest, solution[2].hypot(solution[3]) * scale))
}

/// The highest line of the spectrum above one cycle per record, with parabolic interpolation; the record is put on a uniform grid.
fn spectral_peak(t: &[f64], x: &[f64], span: f64) -> Option<f64> {
    let n = t.len().min(x.len());
    if !(span > 0.0 && span.is_finite()) {
        return None;
    }
    let length = (4 * n).next_power_of_two();
    let mean = x[..n].iter().sum::<f64>() / n as f64;
    let (mut input, mut j) = (vec![0.0; length], 0);
    let dt = span / (n - 1) as f64;
    for (i, value) in input.iter_mut().take(n).enumerate() {
        let at = t[0] + i as f64 * dt;
        while j + 2 < n && t[j + 1] < at {
            j += 1;
        }
        let part = ((at - t[j]) / (t[j + 1] - t[j])).clamp(0.0, 1.0);
        let window = 0.5 - 0.5 * (TAU * (i as f64 + 0.5) / n as f64).cos();
        *value = (x[j] + part * (x[j + 1] - x[j]) - mean) * window;
    }
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let mut spectrum = transform.make_output_vec();
    transform.process(&mut input, &mut spectrum).ok()?;
    let power: Vec<f64> = spectrum.iter().map(|c| c.norm_sqr()).collect();
    let per_hertz = length as f64 * dt;
    // Below one and a half cycles per record a line is drift, not drive.
    let from = ((1.5 / span * per_hertz) as usize).clamp(1, power.len().saturating_sub(2));
    let peak = (from..power.len() - 1).max_by(|a, b| power[*a].total_cmp(&power[*b]))?;
    let (l, c, r) = (power[peak - 1], power[peak], power[peak + 1]);
    let bend = l - 2.0 * c + r;
    let shift = if bend < 0.0 { (0.5 * (l - r) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    (c > 0.0).then_some((peak as f64 + shift) / per_hertz)
}
