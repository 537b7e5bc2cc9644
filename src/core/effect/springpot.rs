//! Springpot (fractional Kelvin element): force proportional to a fractional derivative of displacement.

use std::f64::consts::{FRAC_1_PI, PI, TAU};

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::power;
use super::prony::Prony;
use super::{Force, Inputs, Num};

/// Springpot (fractional Kelvin element): force proportional to a fractional derivative of displacement.
pub struct Springpot;

/// Branches of the series.
const BRANCHES: usize = 12;
/// The branches reach beyond the band by this factor on either side.
const BEYOND: f64 = 20.0;

impl Force for Springpot {
    const INFO: Info = Info {
        name: "springpot",
        role: Role::Force,
        claim: "between spring and damper: stiffness and loss both grow as one power of frequency, at a constant phase of alpha 90 deg",
        equation: "F = k (2 pi f_ref)^-alpha D^alpha x,  Z = k (i f/f_ref)^alpha for f_low < f < f_high",
        params: &[
            Param::strength("k", Dim::F_PER_X, Sign::NonNegative, "size of the dynamic stiffness at f_ref"),
            Param::shape("alpha", Dim::One, Grid::Values(&[0.2, 0.5, 0.8]), "order of the derivative: 0 spring, 1 damper")
                .within(0.01, 0.99),
            Param::setting("f_ref", Dim::PER_T, Sign::Positive, 1.0, "frequency at which k is the dynamic stiffness")
                .tried(Grid::OfLowest(&[1.0])),
            Param::setting("f_low", Dim::PER_T, Sign::Positive, 0.01, "lower end of the band; a spring below it")
                .tried(Grid::OfLowest(&[0.3])),
            Param::setting("f_high", Dim::PER_T, Sign::Positive, 1e4, "upper end of the band; a damper above it")
                .tried(Grid::OfHighest(&[10.0])),
        ],
        states: BRANCHES,
        ports: Ports::XVDX,
        family: "viscoelastic",
        source: "Koeller, J. Appl. Mech. 51 (1984) 299-307; series: trapezoidal rule over the logarithm of the relaxation rates, with exact tails",
        range: "inside the band: within 1 % of the power law where it is six decades wide, 0.1 % for three decades and a factor 3 from its ends",
    };

    const SUPERPOSES: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        let series = Series::new(p);
        let mut sum = u.x * series.spring + u.v * series.damper;
        for (state, (rate, weight)) in s.iter_mut().zip(series.branches()) {
            // As in maxwell: exact for a displacement that is linear over the step.
            let time = -rate * dt;
            let decay = time.exp_m1();
            *state += *state * decay + u.dx * decay / time;
            sum += *state * weight;
        }
        p[0] * sum
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let series = Series::new(p);
        let mut sum = s * series.damper + Complex::new(series.spring, T::from(0.0));
        for (rate, weight) in series.branches() {
            sum += s * weight / (s + Complex::new(rate, T::from(0.0)));
        }
        Ok(sum * p[0])
    }
}

/// The law as a series of branches.
pub(super) fn prony(p: &[f64]) -> Prony {
    let series = Series::new(p);
    Prony { spring: series.spring, damper: series.damper, branches: series.branches().map(|(rate, weight)| (weight, rate)).collect() }
}

/// `(s/w_ref)^alpha = sin(alpha pi)/pi integral of l^alpha s/(s + l) d ln(l)`, `l` the relaxation rate over `w_ref`, by the trapezoidal
/// rule in `ln(l)`. Branches slower than the slowest act as springs, faster ones as dampers: both tails are geometric series.
struct Series<T> {
    /// Rate and weight of the slowest branch.
    slowest: (T, T),
    /// Factors from one branch to the next.
    ratio: (T, T),
    spring: T,
    damper: T,
}

impl<T: Num> Series<T> {
    fn new(p: &[T]) -> Self {
        let (alpha, reference) = (p[1], p[2] * TAU);
        let slowest = p[3] * (TAU / BEYOND);
        let step = (p[4] / p[3] * BEYOND * BEYOND).ln() / (BRANCHES - 1) as f64;
        let weight = (alpha * PI).sin() * step * FRAC_1_PI * power(slowest / reference, alpha);
        // Weight over rate of the fastest branch: the part of it that a damper has.
        let fastest = weight * (step * (alpha - 1.0) * (BRANCHES - 1) as f64).exp() / slowest;
        Series {
            slowest: (slowest, weight),
            ratio: (step.exp(), (step * alpha).exp()),
            spring: weight / (step * alpha).exp_m1(),
            damper: fastest / (step * (-alpha + 1.0)).exp_m1(),
        }
    }

    /// Relaxation rate and weight of each branch.
    fn branches(&self) -> impl Iterator<Item = (T, T)> {
        let ratio = self.ratio;
        std::iter::successors(Some(self.slowest), move |(rate, weight)| Some((*rate * ratio.0, *weight * ratio.1))).take(BRANCHES)
    }
}
