//! FRFs from histories of a hammer or a shaker.
//!
//! Blocks of the record are windowed and transformed; G_ff, G_xx and G_fx = mean of conj(F) X are averaged. H1 = G_fx / G_ff (noise on the response),
//! H2 = G_xx / conj(G_fx) (noise on the force), Hv = sqrt(H1 H2) with their common phase (noise on both). gamma^2 = |G_fx|^2 / (G_ff G_xx);
//! sigma = |H| sqrt((1 - gamma^2) / (2 n gamma^2)) of the real and of the imaginary part each (Bendat and Piersol, Random Data, 4th ed., eq. 9.90), n the
//! independent averages: overlapping windows count by their correlation (Welch, 1967).

mod hits;

pub use hits::{Rejected, clipped};

use super::Note;
use num_complex::Complex64;
use realfft::RealFftPlanner;
use std::f64::consts::{PI, TAU};

/// Which estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Estimator {
    H1,
    H2,
    Hv,
}

impl Estimator {
    pub const WORDS: [(&'static str, Estimator); 3] = [("H1", Estimator::H1), ("H2", Estimator::H2), ("Hv", Estimator::Hv)];
}

/// How blocks are cut and windowed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Excitation {
    /// Steady random or burst: Hann windows that overlap by this part.
    Random { overlap: f64 },
    /// Periodic, whole periods in a block: no window, no overlap.
    Periodic,
    /// Hammer: one block a hit; the force is cut off after its pulse, both channels are multiplied by exp(-decay t) (decay in 1/s, 0: none).
    Hammer { decay: f64 },
}

/// What is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    pub estimator: Estimator,
    pub excitation: Excitation,
    /// Samples of a block.
    pub block: usize,
    /// Level beyond which a channel is overloaded: force, response. None: recognised by clipping.
    pub overload: (Option<f64>, Option<f64>),
}

/// An estimated FRF.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Hz, from the first line above 0.
    pub frequency: Vec<f64>,
    pub h: Vec<Complex64>,
    pub coherence: Vec<f64>,
    /// Standard deviation of the real part, and of the imaginary part.
    pub sigma: Vec<f64>,
    /// Blocks averaged, and independent ones among them.
    pub blocks: usize,
    pub independent: f64,
    pub rejected: Vec<Rejected>,
    pub notes: Vec<Note>,
}

/// Why there is no estimate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EstimateError {
    #[error("channels of unlike length: force {force}, response {response}")]
    Length { force: usize, response: usize },
    #[error("a block of {block} samples in a record of {samples}")]
    Block { block: usize, samples: usize },
    #[error("{blocks} usable blocks ({rejected})")]
    Blocks { blocks: usize, rejected: String },
    #[error("no hits: the force does not rise out of its noise")]
    NoHits,
    #[error("the force is nothing at {frequency} Hz")]
    NoForce { frequency: f64 },
    #[error("a value that is not finite, sample {sample}")]
    Value { sample: usize },
}

impl EstimateError {
    pub fn accepted(&self) -> &'static str {
        match self {
            Self::Length { .. } => "force and response sampled together",
            Self::Block { .. } => "a block of at least 16 samples and at most half the record",
            Self::Blocks { .. } => "at least two blocks, or hits, that are neither overloaded nor double: one alone has no coherence",
            Self::NoHits => "hammer blows well above the noise of the force channel",
            Self::NoForce { .. } => "a band in which the force acts",
            Self::Value { .. } => "finite samples",
        }
    }
}

/// Estimates the FRF of `response` over `force`, sampled every `dt` seconds.
pub fn estimate(dt: f64, force: &[f64], response: &[f64], request: &Request) -> Result<Estimate, EstimateError> {
    let n = request.block;
    if force.len() != response.len() {
        return Err(EstimateError::Length { force: force.len(), response: response.len() });
    }
    if n < 16 || n > force.len() {
        return Err(EstimateError::Block { block: n, samples: force.len() });
    }
    if let Some(sample) = force.iter().zip(response).position(|(f, x)| !(f.is_finite() && x.is_finite())) {
        return Err(EstimateError::Value { sample: sample + 1 });
    }
    let mut rejected = Vec::new();
    let mut notes = Vec::new();
    let starts = match request.excitation {
        Excitation::Hammer { .. } => hits::hits(force, response, request, &mut rejected)?,
        Excitation::Random { overlap } => steady(force, response, request, overlap.clamp(0.0, 0.9), &mut rejected),
        Excitation::Periodic => steady(force, response, request, 0.0, &mut rejected),
    };
    if starts.len() < 2 {
        let why: Vec<String> = rejected.iter().map(|r| r.to_string()).take(5).collect();
        let rejected = if why.is_empty() { "none rejected".to_string() } else { why.join("; ") };
        return Err(EstimateError::Blocks { blocks: starts.len(), rejected });
    }
    if !rejected.is_empty() {
        let why: Vec<String> = rejected.iter().map(|r| r.to_string()).collect();
        notes.push(Note::new("blocks", format!("{} of {} left out: {}", rejected.len(), rejected.len() + starts.len(), why.join("; "))));
    }
    let window = window(n, dt, request.excitation);
    let independent = independent(&window, &starts, request.excitation);
    let spectra = spectra(force, response, &starts, &window, request);
    let mut out = Estimate {
        frequency: Vec::new(),
        h: Vec::new(),
        coherence: Vec::new(),
        sigma: Vec::new(),
        blocks: starts.len(),
        independent,
        rejected,
        notes,
    };
    let strongest = spectra.ff.iter().copied().fold(0.0, f64::max);
    for k in 1..spectra.ff.len() {
        let frequency = k as f64 / (n as f64 * dt);
        let (ff, xx, fx) = (spectra.ff[k], spectra.xx[k], spectra.fx[k]);
        if ff.is_nan() || ff <= 1e-24 * strongest {
            return Err(EstimateError::NoForce { frequency });
        }
        let coherence = if xx > 0.0 { (fx.norm_sqr() / (ff * xx)).clamp(1e-12, 1.0) } else { 1e-12 };
        let h1 = fx / ff;
        let h = match request.estimator {
            Estimator::H1 => h1,
            Estimator::H2 => h1 / coherence,
            Estimator::Hv => h1 / coherence.sqrt(),
        };
        out.frequency.push(frequency);
        out.h.push(h);
        out.coherence.push(coherence);
        out.sigma.push(h.norm() * ((1.0 - coherence) / (2.0 * independent * coherence)).sqrt());
    }
    Ok(out)
}

struct Spectra {
    ff: Vec<f64>,
    xx: Vec<f64>,
    fx: Vec<Complex64>,
}

fn spectra(force: &[f64], response: &[f64], starts: &[usize], window: &[f64], request: &Request) -> Spectra {
    let n = window.len();
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let (mut f, mut x) = (vec![0.0; n], vec![0.0; n]);
    let (mut ff, mut xx) = (transform.make_output_vec(), transform.make_output_vec());
    let lines = ff.len();
    let mut sum = Spectra { ff: vec![0.0; lines], xx: vec![0.0; lines], fx: vec![Complex64::default(); lines] };
    let hammer = matches!(request.excitation, Excitation::Hammer { .. });
    for start in starts {
        let (a, b) = (&force[*start..*start + n], &response[*start..*start + n]);
        let (mean_f, mean_x) = if hammer { (hits::rest(a), hits::rest(b)) } else { (mean(a), mean(b)) };
        let pulse = if hammer { hits::pulse_end(a) } else { n };
        for k in 0..n {
            // Beyond the pulse the force channel holds only noise.
            f[k] = if k < pulse { (a[k] - mean_f) * window[k] } else { 0.0 };
            x[k] = (b[k] - mean_x) * window[k];
        }
        // The lengths are those of the plan: no error is possible.
        if transform.process(&mut f, &mut ff).is_err() || transform.process(&mut x, &mut xx).is_err() {
            continue;
        }
        for k in 0..lines {
            sum.ff[k] += ff[k].norm_sqr();
            sum.xx[k] += xx[k].norm_sqr();
            sum.fx[k] += ff[k].conj() * xx[k];
        }
    }
    sum
}

fn mean(v: &[f64]) -> f64 {
    v.iter().sum::<f64>() / v.len().max(1) as f64
}

fn window(n: usize, dt: f64, excitation: Excitation) -> Vec<f64> {
    match excitation {
        Excitation::Random { .. } => (0..n).map(|k| 0.5 - 0.5 * (TAU * k as f64 / n as f64).cos()).collect(),
        Excitation::Periodic => vec![1.0; n],
        Excitation::Hammer { decay } => (0..n).map(|k| (-decay * dt * k as f64).exp()).collect(),
    }
}

/// Starts of overlapping blocks, overloaded ones left out.
fn steady(force: &[f64], response: &[f64], request: &Request, overlap: f64, rejected: &mut Vec<Rejected>) -> Vec<usize> {
    let step = ((request.block as f64 * (1.0 - overlap)).round() as usize).max(1);
    let clip = (hits::Clip::of(force, request.overload.0), hits::Clip::of(response, request.overload.1));
    (0..=force.len() - request.block)
        .step_by(step)
        .filter(|start| {
            let block = *start..*start + request.block;
            match hits::overloaded(&force[block.clone()], &response[block], &clip) {
                None => true,
                Some(reason) => {
                    rejected.push(Rejected { start: *start, reason });
                    false
                }
            }
        })
        .collect()
}

/// Blocks as independent averages: n / (1 + 2 sum (1 - k / n) rho_k^2), rho_k the correlation of windows k blocks apart (Welch, 1967).
fn independent(window: &[f64], starts: &[usize], excitation: Excitation) -> f64 {
    let n = starts.len() as f64;
    let Excitation::Random { overlap } = excitation else { return n };
    let step = ((window.len() as f64 * (1.0 - overlap.clamp(0.0, 0.9))).round() as usize).max(1);
    let power: f64 = window.iter().map(|w| w * w).sum();
    let sum: f64 = (1..starts.len())
        .take_while(|k| k * step < window.len())
        .map(|k| {
            let rho = window.iter().zip(&window[k * step..]).map(|(a, b)| a * b).sum::<f64>() / power;
            (1.0 - k as f64 / n) * rho * rho
        })
        .sum();
    n / (1.0 + 2.0 * sum)
}

/// FRF of the structure alone where a mass m (load cell, its stud) sits between force gauge and structure at the driven point:
/// H = H_measured / (1 - m A), A the measured accelerance of the driven point. Both at the same lines.
pub fn without_driven_mass(measured: &[Complex64], driving_accelerance: &[Complex64], mass: f64) -> Vec<Complex64> {
    measured.iter().zip(driving_accelerance).map(|(h, a)| h / (1.0 - mass * a)).collect()
}

/// Decay (1/s) that takes a window of so many seconds down to `end` of its beginning.
pub fn decay_to(end: f64, seconds: f64) -> f64 {
    if end > 0.0 && end < 1.0 && seconds > 0.0 { -end.ln() / seconds } else { 0.0 }
}

/// Damping ratio of a mode without what the exponential window added: (sigma - decay) over its |s|.
pub fn without_window(frequency: f64, damping: f64, decay: f64) -> (f64, f64) {
    let w = 2.0 * PI * frequency;
    let (re, im) = (damping * w - decay, w * (1.0 - damping * damping).max(0.0).sqrt());
    let true_w = re.hypot(im);
    (true_w / TAU, re / true_w)
}

#[cfg(test)]
mod tests;
