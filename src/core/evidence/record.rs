//! A test as the likelihood sees it, and a model in it.

use std::collections::HashMap;
use std::f64::consts::FRAC_1_SQRT_2;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::data::{TestKind, harmonic_of};
use crate::effect::{Kind, Role};
use crate::model::{FreeParam, System};
use crate::parallel;
use crate::response::{BlockKind, Coefficients, Computed, Instruments, Plan, Reach, resonances};

use super::facts::smooth;
use super::{Settings, beside};

/// One channel of a test.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Its coefficients.
    pub range: Range<usize>,
    /// `force at c1.x`.
    pub label: String,
    /// Kind of points.
    pub kind: BlockKind,
    /// Modes between the first and the last line of an FRF.
    pub modes: usize,
    /// Harmonic of each coefficient of a loop.
    pub harmonics: Vec<usize>,
    /// Relative error below which no model is claimed here.
    pub least: f64,
    /// What of that the study allows the model: 0 where it says nothing.
    pub allowed: f64,
    /// Dimensions that the model's error has for each coefficient: 1 where it is white, fewer where it is a smooth function of few.
    pub free: f64,
    /// Variance of a mean over many coefficients by noise, over that if neighbours were independent.
    pub colour: f64,
}

impl Channel {
    /// Logarithm of the true variance of noise over that seen.
    fn log_scale(&self, kappa: f64) -> f64 {
        if self.kind == BlockKind::Frf { 0.0 } else { 2.0 * kappa }
    }
}

/// What a coefficient varies by.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Variance by noise; infinite where it is not compared.
    pub noise: f64,
    /// Variance by the model's error.
    pub error: f64,
    /// See [`Channel::free`].
    pub free: f64,
    /// See [`Channel::colour`].
    pub colour: f64,
    /// True variance of noise over that seen.
    pub scale: f64,
}

/// Logarithms of the noise and of the scale of a [`Part`], where whoever asks for its level knows them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Logs {
    noise: f64,
    scale: f64,
}

impl Part {
    /// Variance in the directions in which the model may err: there the error of all coefficients together stands beside the noise of one, which is
    /// that of its slow part.
    fn whole(&self) -> f64 {
        self.colour * self.noise + self.error / self.free
    }

    /// One over the weight of a residual's square; infinite where it counts as nothing.
    pub fn variance(&self, z: f64) -> f64 {
        if z > 0.0 { self.whole() / z } else { f64::INFINITY }
    }

    /// What a coefficient adds to `-2 ln L` beside the square of its residual over [`Part::variance`]. With D the variance of `whole`:
    /// `z [free ln D + (1 - free) ln noise + (1 - free colour) (1 - noise / D)]`. The second part is that of the directions in which the model does not
    /// err, where the residual is noise of the size it is known to have: 1, of which noise / D stands in the square already. What does not count because
    /// it is the model's error, 1 - z, adds `ln scale + 1 / scale`: beside that error there is noise of the size that was seen. Without it a model
    /// whose coefficients count as few could call all it leaves noise of twice that size.
    pub fn level(&self, z: f64) -> f64 {
        if z == 0.0 || !self.noise.is_finite() {
            return 0.0;
        }
        let whole = self.whole();
        z * self.free * whole.ln() + self.beside_whole(z, whole, Logs { noise: self.noise.ln(), scale: self.scale.ln() })
    }

    /// The same of a coefficient that is compared, without `z free ln D`. The variances of a model are estimated from some hundred levels of every coefficient,
    /// and logarithms were half of their cost.
    fn beside_whole(&self, z: f64, whole: f64, logs: Logs) -> f64 {
        let known = (1.0 - self.free * self.colour).max(0.0) * (1.0 - self.noise / whole);
        let rough = if self.free < 1.0 { (1.0 - self.free) * logs.noise + known } else { 0.0 };
        z * rough + (1.0 - z) * (logs.scale + 1.0 / self.scale)
    }

    /// Fisher information of the logarithm of the model's error in a coefficient.
    pub fn known(&self, z: f64) -> f64 {
        if self.error > 0.0 && self.noise.is_finite() { 2.0 * z * self.free * (self.error / self.free / self.whole()).powi(2) } else { 0.0 }
    }

    /// Part of the variance that the model's error has.
    pub fn share(&self) -> f64 {
        if self.error > 0.0 { self.error / (self.noise + self.error) } else { 0.0 }
    }

    /// Independent facts that it is.
    pub fn facts(&self, z: f64) -> f64 {
        let whole = self.whole();
        if whole > 0.0 { z * (self.noise + self.error) / whole } else { z }
    }
}

/// Coefficients of a channel that vary alike.
pub(super) struct Alike {
    pub channel: usize,
    pub members: Vec<usize>,
    /// How often each of them counts.
    pub z: f64,
    /// Variance by noise as seen, its logarithm, and variance by a relative error of 1 of the model.
    noise: f64,
    log_noise: f64,
    size: f64,
}

impl Alike {
    /// What one of them varies by, where the model errs by `tau`.
    pub fn part(&self, channels: &[Varied], tau: f64) -> Part {
        let Varied { free, colour, scale, .. } = channels[self.channel];
        Part { noise: scale * self.noise, error: tau * tau * self.size, free, colour, scale }
    }

    /// What all of them add to `-2 ln L` beside their squares, see [`Part::level`], and beside what they add to `logs`.
    pub fn level(&self, part: &Part, channels: &[Varied], logs: &mut LogSum) -> f64 {
        let (scale, n, whole) = (channels[self.channel].log_scale, self.members.len() as f64, part.whole());
        logs.add(n * self.z * part.free, whole);
        n * part.beside_whole(self.z, whole, Logs { noise: self.log_noise + scale, scale })
    }
}

/// A sum of logarithms, each times a weight. Values of one weight that follow each other are multiplied, and the logarithm of their product is taken: one for
/// each of the thousand lines of an FRF took up to a tenth of a ladder's time.
pub(super) struct LogSum {
    sum: f64,
    weight: f64,
    product: f64,
}

/// Products beyond it, or below one over it, are not multiplied on.
const FAR: f64 = 1e150;

impl LogSum {
    pub fn add(&mut self, weight: f64, value: f64) {
        let product = self.product * value;
        if weight == self.weight && (1.0 / FAR..FAR).contains(&product) {
            self.product = product;
        } else {
            self.sum += self.weight * self.product.ln();
            (self.weight, self.product) = (weight, value);
        }
    }

    pub fn total(self) -> f64 {
        self.sum + self.weight * self.product.ln()
    }
}

impl Default for LogSum {
    fn default() -> Self {
        LogSum { sum: 0.0, weight: 0.0, product: 1.0 }
    }
}

/// What the coefficients of a channel have in common under a noise of scale `e^kappa`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Varied {
    free: f64,
    colour: f64,
    scale: f64,
    log_scale: f64,
}

/// A test.
#[derive(Clone, Debug)]
pub struct Record {
    /// Its kind.
    pub kind: TestKind,
    /// How its rows become coefficients.
    pub coefficients: Coefficients,
    /// Its channels.
    pub channels: Vec<Channel>,
    /// Variance of each coefficient by noise; infinite where it is not compared.
    pub noise: Vec<f64>,
    /// Variance of each coefficient by a relative error of 1 of the model.
    pub size: Vec<f64>,
    /// Its instruments within tolerance.
    pub instruments: Instruments,
    /// Whether strengths may be others in this test than in those that they are fitted to.
    pub scatters: bool,
    /// In how many directions of these the curvature of a record is told, and over which part of the strengths.
    pub curved: (usize, f64),
}

/// A model in a test.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Computed minus measured.
    pub r: DVector<f64>,
    /// Derivatives with respect to the free parameters, in the fit's variables.
    pub j: DMatrix<f64>,
    /// What one part of each strength would change.
    pub strengths: DMatrix<f64>,
    /// What the square of one part of the strengths would change by their curvature, along the directions in which they move the test most: along a record
    /// of many cycles half a radian of phase is no small angle.
    pub bends: DMatrix<f64>,
}

impl Record {
    /// What each coefficient varies by: noise of scale `e^kappa`, the model's error of each channel. Noise of FRFs is known by many averages.
    pub fn parts(&self, kappa: f64, errors: &[f64]) -> Vec<Part> {
        let mut parts: Vec<Part> = self.noise.iter().map(|n| Part { noise: *n, error: 0.0, free: 1.0, colour: 1.0, scale: 1.0 }).collect();
        for (b, channel) in self.channels.iter().enumerate() {
            channel.range.clone().for_each(|i| parts[i] = self.part(b, i, kappa, errors[b]));
        }
        parts
    }

    /// What a coefficient of a channel varies by, where the model errs by `tau`.
    fn part(&self, channel: usize, i: usize, kappa: f64, tau: f64) -> Part {
        let channel = &self.channels[channel];
        let scale = channel.log_scale(kappa).exp();
        Part { noise: scale * self.noise[i], error: tau * tau * self.size[i], free: channel.free, colour: channel.colour, scale }
    }

    /// Its channels under a noise of scale `e^kappa`.
    pub(super) fn varied(&self, kappa: f64) -> Vec<Varied> {
        let one = |c: &Channel| {
            let log_scale = c.log_scale(kappa);
            Varied { free: c.free, colour: c.colour, scale: log_scale.exp(), log_scale }
        };
        self.channels.iter().map(one).collect()
    }

    /// Coefficients that are compared, in lots that vary by the same under any variances, and count as the same.
    pub(super) fn alike(&self, z: &DVector<f64>) -> Vec<Alike> {
        let mut lots: Vec<Alike> = Vec::new();
        for (channel, c) in self.channels.iter().enumerate() {
            let mut known: HashMap<[u64; 3], usize> = HashMap::new();
            for i in c.range.clone().filter(|i| self.noise[*i].is_finite() && z[*i] > 0.0) {
                let (noise, size, z) = (self.noise[i], self.size[i], z[i]);
                let lot = *known.entry([noise, size, z].map(f64::to_bits)).or_insert(lots.len());
                if lot == lots.len() {
                    lots.push(Alike { channel, members: vec![], z, noise, log_noise: noise.ln(), size });
                }
                lots[lot].members.push(i);
            }
        }
        lots
    }

    /// The columns that coefficients share, strengths scattering by `w = e^omega`: instruments, `w df/ds`, and `w^2 / sqrt(2) d2f/ds2`, the standard deviation of
    /// `1/2 s^2 d2f/ds2`.
    pub fn shared(&self, seen: &Seen, omega: f64) -> DMatrix<f64> {
        let first = beside(&self.instruments.columns, &(&seen.strengths * omega.exp()));
        beside(&first, &(&seen.bends * ((2.0 * omega).exp() * FRAC_1_SQRT_2)))
    }

    /// The model in this test, from its response with derivatives.
    pub fn see(&self, plan: &Plan, computed: &Computed, system: &System, free: &[FreeParam]) -> Seen {
        let all = plan.turned(&self.coefficients, computed, free.len());
        let j = all.columns(1, free.len()).into_owned();
        let value = |f: &FreeParam| if f.log { 1.0 } else { system.instances[f.instance].params[f.param].value };
        let which: Vec<usize> = (0..free.len()).filter(|k| self.scatters && scatters(system, &free[*k])).collect();
        let strengths = DMatrix::from_fn(j.nrows(), which.len(), |i, k| j[(i, which[k])] * value(&free[which[k]]));
        let which: Vec<FreeParam> = which.into_iter().map(|k| free[k].clone()).collect();
        let r = all.column(0).into_owned();
        let bends = self.bends(plan, (&r, &strengths), system, &which).unwrap_or_else(|| DMatrix::zeros(r.len(), 0));
        Seen { r, j, strengths, bends }
    }

    /// Second differences of a record along the directions in the space of strengths in which these move it most. `None` where nothing scatters, of other
    /// tests, and where the record cannot be computed there.
    fn bends(
        &self,
        plan: &Plan,
        (r, strengths): (&DVector<f64>, &DMatrix<f64>),
        system: &System,
        which: &[FreeParam],
    ) -> Option<DMatrix<f64>> {
        if plan.kind != TestKind::Transient || which.is_empty() {
            return None;
        }
        let (directions, (count, step)) = (strengths.clone().svd(false, true).v_t?, self.curved);
        let moved = |by: f64, k: usize| {
            let mut moved = system.clone();
            for (f, part) in which.iter().zip(directions.row(k).iter()) {
                let p = &mut moved.instances[f.instance].params[f.param];
                p.value *= 1.0 + by * part;
            }
            let computed = plan.evaluate(&moved, &[], false).ok().filter(|c| c.values.iter().all(|v| v.is_finite()))?;
            Some(plan.turned(&self.coefficients, &computed, 0).column(0).into_owned())
        };
        let bend = |k: usize| Some((moved(step, k)? + moved(-step, k)? - r * 2.0) / (step * step));
        let columns = (0..count.min(directions.nrows())).map(bend).collect::<Option<Vec<_>>>()?;
        Some(DMatrix::from_columns(&columns))
    }
}

/// Whether a parameter differs a little from test to test: the strength of a force. A mass does not.
pub fn scatters(system: &System, f: &FreeParam) -> bool {
    let info = system.instances[f.instance].effect.info();
    let force = info.role == Role::Force && !["inertial", "deviation"].contains(&info.family);
    force && info.params.get(f.param).is_some_and(|p| p.kind == Kind::Strength)
}

/// What every channel reads in any test, block by block.
fn reaches(plans: &[&Plan]) -> Vec<Vec<Reach>> {
    let own: Vec<(&str, Reach)> =
        plans.iter().flat_map(|p| p.blocks.iter().zip(p.reach())).map(|(b, reach)| (b.label.as_str(), reach)).collect();
    let of = |label: &str| own.iter().filter(|(l, _)| *l == label).fold(Reach::default(), |all, (_, reach)| all.and(*reach));
    plans.iter().map(|p| p.blocks.iter().map(|b| of(&b.label)).collect()).collect()
}

pub(super) fn records(plans: &[&Plan], system: &System, settings: &Settings) -> Vec<Record> {
    let reaches = reaches(plans);
    let of = |t: usize| {
        let plan = plans[t];
        let computed = plan.evaluate(system, &[], false).ok().map(|c| c.values).filter(|v| v.iter().all(|v| v.is_finite()));
        let signal = computed.unwrap_or_else(|| plan.measured.clone());
        let coefficients = Coefficients::of(plan);
        let channels: Vec<Channel> =
            plan.blocks.iter().zip(coefficients.ranges()).map(|(b, range)| channel(plan, b, range, system, settings)).collect();
        let mut size = vec![0.0; coefficients.count];
        for (block, channel) in plan.blocks.iter().zip(&channels) {
            let (measured, computed) = (&plan.measured[block.range.clone()], &signal[block.range.clone()]);
            size[channel.range.clone()].copy_from_slice(&sizes(measured, computed, channel, settings.neighbours));
        }
        let noise = coefficients.noise(plan);
        let instruments = Instruments::new(plan, &coefficients, &signal, &reaches[t]);
        Record {
            kind: plan.kind,
            coefficients,
            channels,
            noise,
            size,
            instruments,
            scatters: true,
            curved: (settings.curved, settings.curved_over),
        }
    };
    let mut records = parallel::over(plans.len(), of);
    pool_noise(plans, &mut records, settings.noise_pool);
    smooth(&mut records, settings);
    let mut lines = Vec::new();
    for (plan, record) in plans.iter().zip(&records) {
        let frfs = plan.blocks.iter().zip(&record.channels).filter(|(_, c)| c.kind == BlockKind::Frf);
        lines.extend(frfs.map(|(b, c)| (&plan.measured[b.range.clone()], &record.noise[c.range.clone()])));
    }
    let colour = colour(&lines, settings);
    let frfs = records.iter_mut().flat_map(|r| &mut r.channels).filter(|c| c.kind == BlockKind::Frf);
    frfs.for_each(|c| c.colour = colour);
    records
}

fn channel(plan: &Plan, block: &crate::response::Block, range: Range<usize>, system: &System, s: &Settings) -> Channel {
    let measured = &plan.measured[block.range.clone()];
    let harmonics = if block.kind == BlockKind::Loop { harmonic_of(measured.len()) } else { vec![] };
    let line = block.kind == BlockKind::Frf;
    // Damped modes that are close to each other make one maximum.
    let modes = if line { resonances(measured, s.rises).max(plan.modes_within(system).unwrap_or(0)) } else { 0 };
    // What the study allows the model to be off by is its error, and no error of a law.
    let least = if line { s.frf_error_least.max(plan.allowed) } else { s.model_error_least };
    Channel {
        range,
        label: block.label.clone(),
        kind: block.kind,
        modes,
        harmonics,
        least,
        allowed: if line { plan.allowed } else { 0.0 },
        free: 1.0,
        colour: 1.0,
    }
}

/// What a relative error of 1, alike in all coefficients, is in each: of a loop and a record of their rms about the mean, of an FRF of its
/// size there, of a table of logarithms 1. The size of an FRF is that of the measured and of the computed one, rms: a mode at another frequency is an error
/// where it was measured and where it is computed. By the measured one alone a model that holds everything still is nowhere far off, and one
/// with a sharp peak beside the measured one is, by a factor of hundreds.
pub(super) fn sizes(measured: &[f64], computed: &[f64], channel: &Channel, neighbours: usize) -> Vec<f64> {
    let n = measured.len().max(1) as f64;
    let mean = measured.iter().sum::<f64>() / n;
    let square = measured.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    match channel.kind {
        BlockKind::Loop => vec![square * n / channel.range.len().max(1) as f64; channel.range.len()],
        BlockKind::Record => vec![square; channel.range.len()],
        BlockKind::Table => vec![1.0; channel.range.len()],
        BlockKind::Frf => {
            let squares = |lines: &[f64]| -> Vec<f64> { lines.chunks(2).map(|c| c.iter().map(|v| v * v).sum()).collect() };
            let h: Vec<f64> = squares(measured).iter().zip(squares(computed)).map(|(m, c)| 0.5 * (m + c)).collect();
            let near = |k: usize| {
                let part = &h[k.saturating_sub(neighbours)..(k + neighbours + 1).min(h.len())];
                0.5 * part.iter().sum::<f64>() / part.len() as f64
            };
            (0..h.len()).flat_map(|k| [near(k); 2]).collect()
        }
    }
}

/// Colour of the noise along the lines of FRFs: windows and leakage make neighbours alike. Third differences of what was measured are noise alone where
/// the lines are close; for noise whose neighbours are correlated by rho (AR(1)) their mean square is `(20 - 30 rho + 12 rho^2 - 2 rho^3) / 20` of that
/// of independent lines, and `colour = (1 + rho) / (1 - rho)`. The median over the lines of all FRFs, since near a resonance they are more than noise.
/// `lines`: measured lines, real and imaginary part in turn, with the variances of both.
pub(super) fn colour(lines: &[(&[f64], &[f64])], s: &Settings) -> f64 {
    let mut rough = Vec::new();
    for (h, nu) in lines {
        for k in 3..h.len() / 2 {
            let part = |p: usize| (h[2 * k + p] - 3.0 * h[2 * k - 2 + p] + 3.0 * h[2 * k - 4 + p] - h[2 * k - 6 + p]).powi(2);
            let white: f64 = [1.0, 9.0, 9.0, 1.0].iter().enumerate().map(|(n, w)| w * (nu[2 * (k - n)] + nu[2 * (k - n) + 1])).sum();
            if white > 0.0 && white.is_finite() {
                rough.push((part(0) + part(1)) / white);
            }
        }
    }
    if rough.len() < s.colour_lines {
        return 1.0;
    }
    rough.sort_by(f64::total_cmp);
    // Squares of complex noise are exponential: their median is ln 2 of the mean.
    let seen = rough[rough.len() / 2] / std::f64::consts::LN_2;
    let of = |rho: f64| (20.0 - 30.0 * rho + 12.0 * rho * rho - 2.0 * rho.powi(3)) / 20.0;
    let (mut low, mut high) = (0.0, s.colour_most);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if of(middle) > seen { low = middle } else { high = middle }
    }
    (1.0 + low) / (1.0 - low)
}

/// Draws the noise spectrum of a loop that was seen in few cycles to the shape that those of its channel have in common.
fn pool_noise(plans: &[&Plan], records: &mut [Record], pool: f64) {
    let cycles = |t: usize, b: usize| plans[t].scatter.get(b).filter(|s| !s.variance.is_empty()).map(|s| s.cycles as f64);
    let all: Vec<(usize, usize)> = (0..records.len()).flat_map(|t| (0..records[t].channels.len()).map(move |b| (t, b))).collect();
    let seen: Vec<(usize, usize)> = all.into_iter().filter(|(t, b)| cycles(*t, *b).is_some()).collect();
    let noise = |(t, b): (usize, usize)| records[t].noise[records[t].channels[b].range.clone()].to_vec();
    let drawn: Vec<Vec<f64>> = seen
        .iter()
        .map(|&(t, b)| {
            let own = &records[t].channels[b];
            let alike = seen.iter().filter(|(u, c)| {
                let other = &records[*u].channels[*c];
                other.label == own.label && other.range.len() == own.range.len()
            });
            let mut shape = DVector::zeros(own.range.len());
            let mut count = 0.0;
            for other in alike {
                let n = DVector::from_vec(noise(*other));
                (shape, count) = (shape + &n / n.sum().max(f64::MIN_POSITIVE), count + 1.0);
            }
            shape /= count;
            // The mean and the first harmonic are two lines of a test each: not quieter than those next to them.
            let low: Vec<usize> = (0..own.range.len()).filter(|i| own.harmonics[*i] <= 3).collect();
            let least = low.iter().map(|i| shape[*i]).sum::<f64>() / low.len().max(1) as f64;
            low.iter().filter(|i| own.harmonics[**i] <= 1).for_each(|i| shape[*i] = shape[*i].max(least));
            let n = noise((t, b));
            let (total, w) = (n.iter().sum::<f64>(), cycles(t, b).unwrap_or(1.0) - 1.0);
            n.iter().zip(shape.iter()).map(|(n, s)| (w * n + pool * total * s) / (w + pool)).collect()
        })
        .collect();
    for ((t, b), noise) in seen.into_iter().zip(drawn) {
        let range = records[t].channels[b].range.clone();
        records[t].noise[range].copy_from_slice(&noise);
    }
}
