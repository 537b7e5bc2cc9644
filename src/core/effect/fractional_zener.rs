//! Spring and springpot in series: a relaxation spread over decades, with finite limits.

use std::f64::consts::{FRAC_1_PI, PI};

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::prony::Prony;
use super::{Force, Inputs, Num};

/// Spring and springpot in series: a relaxation spread over decades, with finite limits.
pub struct FractionalZener;

/// Branches of the series.
const BRANCHES: usize = 16;
/// The branches reach over this factor on either side of the relaxation time.
const REACH: f64 = 3e3;

impl Force for FractionalZener {
    const INFO: Info = Info {
        name: "fractional_zener",
        role: Role::Force,
        claim: "stiffens by k from slow to fast motion over several decades, with a broad peak of loss between: rubber and polymers",
        equation: "Z = k (i w tau)^alpha/(1 + (i w tau)^alpha)",
        params: &[
            Param::strength("k", Dim::F_PER_X, Sign::NonNegative, "stiffness of fast motion less that of slow motion"),
            Param::shape("tau", Dim::T, Grid::Time(3), "relaxation time: 1/tau is the circular frequency of the peak of loss"),
            Param::shape(
                "alpha",
                Dim::One,
                Grid::Values(&[0.3, 0.6]),
                "order: the smaller, the more decades it is spread over; beyond its bound maxwell",
            )
            .within(0.15, 0.75),
        ],
        states: BRANCHES,
        ports: Ports::XVDX,
        family: "viscoelastic",
        source: "Cole and Cole, J. Chem. Phys. 9 (1941) 341-351; Bagley and Torvik, AIAA J. 21 (1983) 741-748; spectrum by the trapezoidal rule over \
                 the logarithm of the relaxation rates, with what lies beyond as a spring and a damper",
        range: "beside linear_stiffness, the stiffness of slow motion; within 0.7 % of k for three decades on either side of tau",
    };

    const SUPERPOSES: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        let series = series(p);
        let mut sum = u.x * series.spring + u.v * series.damper;
        for (state, (rate, weight)) in s.iter_mut().zip(series.branches) {
            // As in maxwell: exact for a displacement that is linear over the step.
            let time = -rate * dt;
            let decay = time.exp_m1();
            *state += *state * decay + u.dx * decay / time;
            sum += *state * weight;
        }
        p[0] * sum
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let series = series(p);
        let mut sum = s * series.damper + Complex::new(series.spring, T::from(0.0));
        for (rate, weight) in series.branches {
            sum += s * weight / (s + Complex::new(rate, T::from(0.0)));
        }
        Ok(sum * p[0])
    }
}

/// The law as a series of branches.
pub(super) fn prony(p: &[f64]) -> Prony {
    let series = series(p);
    Prony { spring: series.spring, damper: series.damper, branches: series.branches.map(|(rate, weight)| (weight, rate)).to_vec() }
}

struct Series<T> {
    /// Rate and weight of each branch.
    branches: [(T, T); BRANCHES],
    spring: T,
    damper: T,
}

/// `Z/k = integral of H s/(s + l) d ln(l)` with `H = sin(alpha pi)/pi/((l tau)^alpha + (l tau)^-alpha + 2 cos(alpha pi))`, whose whole is 1.
/// The share of the branches slower than the slowest is a spring; those faster than the fastest are a damper, the integral of H/l.
fn series<T: Num>(p: &[T]) -> Series<T> {
    let (tau, alpha) = (p[1], p[2]);
    let (sin, cos) = ((alpha * PI).sin(), (alpha * PI).cos());
    let step = 2.0 * REACH.ln() / (BRANCHES - 1) as f64;
    let power = |place: f64| (alpha * place).exp();
    let branch = |j: usize| {
        let place = -REACH.ln() + step * j as f64;
        let up = power(place);
        ((tau.recip()) * place.exp(), sin * (FRAC_1_PI * step) / (up + up.recip() + cos * 2.0))
    };
    let end = REACH.ln() + 0.5 * step;
    // The integral of H up to ln(l tau) = y is 1/2 + atan(tan(alpha pi/2) tanh(alpha y/2))/(alpha pi).
    let half = alpha * (0.5 * end);
    let tail = -((alpha * (0.5 * PI)).tan() * half.tanh()).atan() / (alpha * PI) + 0.5;
    // Beyond the fastest branch H falls as (l tau)^-alpha: H/l integrates to H/(l (1 + alpha)).
    let up = power(end);
    let fast = sin * FRAC_1_PI / (up + up.recip() + cos * 2.0);
    Series { branches: std::array::from_fn(branch), spring: tail, damper: fast * tau * (-end).exp() / (alpha + 1.0) }
}
