//! Constant loss modulus over a band, as one Prony series in both domains.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::magnitude;
use super::prony::Prony;
use super::{Force, Inputs, Num};

/// Constant loss modulus over a band, as one Prony series in both domains.
pub struct StructuralDamping;

impl Force for StructuralDamping {
    const INFO: Info = Info {
        name: "structural_damping",
        role: Role::Force,
        claim: "loss per cycle nearly independent of frequency; flat modal damping",
        equation: "F = sum_j g_j (s_j - w^2 tau_j^2/(1 + w^2 tau_j^2) x),  ds_j/dt = v - s_j/tau_j,  g_j = 2 h ln(r)/pi,  tau_j spaced by the ratio r over the band and 0.6 decades on either side, the two outermost g_j larger by the factor 0.5 + 1.0855/ln(r),  w = 2 pi f_ref",
        params: &[
            Param::strength("h", Dim::F_PER_X, Sign::NonNegative, "loss modulus: h = eta k for a loss factor eta on a stiffness k"),
            Param::setting("f_low", Dim::PER_T, Sign::Positive, 0.01, "lower end of the band").tried(Grid::Between(0.01, &[0.5, 0.75])),
            Param::setting("f_high", Dim::PER_T, Sign::Positive, 1e4, "upper end of the band"),
            Param::setting(
                "f_ref",
                Dim::PER_T,
                Sign::Any,
                0.0,
                "frequency at which it adds loss alone, so that the spring beside it has its dynamic stiffness there; 0: at rest; below 0: at every frequency, a cycle at that of its drive",
            )
            .tried(Grid::OfMiddle(&[-1.0, 0.25, 0.5, 1.0, 2.0, 4.0])),
        ],
        states: BRANCHES,
        ports: Ports::XDX,
        family: "viscoelastic",
        source: "Biot (1958) continuous relaxation spectrum; Park and Schapery, Int. J. Solids Struct. 36 (1999)",
        range: "constant within 1.3 % over a band of up to six decades, its ends included (seven: 2.1 %). The storage modulus rises by (2/pi) h per e-fold of frequency, as causality demands, and is negative below f_ref; f_ref below 0 leaves it out, as finite-element programs do",
    };

    const SUPERPOSES: bool = true;
    const AT_DRIVE: Option<usize> = Some(F_REF);

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        let Series { g, end, tau } = Series::of(p);
        let mut sum = T::from(0.0);
        for (j, (state, tau)) in s.iter_mut().zip(&tau).enumerate() {
            let ratio = tau.recip() * dt;
            let decay = (-ratio).exp();
            *state = *state * decay - u.dx * (-ratio).exp_m1() / ratio;
            sum += if outermost(j) { *state * end } else { *state };
        }
        p[0] * g * (sum - u.x * stored(&tau, end, magnitude(p[F_REF])))
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let Series { g, end, tau } = Series::of(p);
        // Without storage the law is not analytic in s: it has the loss of the frequency, whatever the decay.
        let storing = p[F_REF].re() >= 0.0;
        let s = if storing { s } else { Complex::new(T::from(0.0), s.im) };
        let mut sum = Complex::new(-stored(&tau, end, p[F_REF]), T::from(0.0));
        for (j, tau) in tau.into_iter().enumerate() {
            let st = s * tau;
            let branch = st / (st + T::from(1.0));
            sum += if outermost(j) { branch * end } else { branch };
        }
        if !storing {
            sum.re = T::from(0.0);
        }
        Ok(sum * (p[0] * g))
    }
}

/// Index of `f_ref`.
const F_REF: usize = 3;

/// Branches of the series: two per decade of the default band.
const BRANCHES: usize = 12;
/// How far the outermost branches lie outside the band, in e-folds of frequency (0.6 decades), and what each of them carries beside its half of a step for all
/// that would follow beyond it, in e-folds. Both are where the loss modulus stays closest to h over bands of up to six decades.
const BEYOND: f64 = 1.405;
const TAIL: f64 = 1.0855;

/// The law as a series of branches, which store: where `f_ref` is below 0, nothing at `-f_ref`.
pub(super) fn prony(p: &[f64]) -> Prony {
    let Series { g, end, tau } = Series::of(p);
    let branch = |(j, t): (usize, &f64)| (if outermost(j) { g * end } else { g }, 1.0 / t);
    Prony { spring: -g * stored(&tau, end, p[F_REF].abs()), damper: 0.0, branches: tau.iter().enumerate().map(branch).collect() }
}

fn outermost(branch: usize) -> bool {
    branch == 0 || branch + 1 == BRANCHES
}

/// What the branches, of modulus 1 each and `end` at the ends, store at the frequency `f` [Hz].
fn stored<T: Num>(tau: &[T], end: T, f: T) -> T {
    let mut sum = T::from(0.0);
    for (j, tau) in tau.iter().enumerate() {
        let turned = (*tau * f * std::f64::consts::TAU).powi(2);
        let branch = turned / (turned + T::from(1.0));
        sum += if outermost(j) { branch * end } else { branch };
    }
    sum
}

/// The branches. Those of equal modulus `g` at times spaced by the ratio `r` have the loss modulus `g pi / (2 ln r)` between the outermost.
struct Series<T> {
    /// Modulus of each per unit of loss modulus.
    g: T,
    /// Factor on that of the outermost.
    end: T,
    /// Relaxation times [s].
    tau: [T; BRANCHES],
}

impl<T: Num> Series<T> {
    fn of(p: &[T]) -> Self {
        let step = ((p[2] / p[1]).ln() + 2.0 * BEYOND) / (BRANCHES - 1) as f64;
        let longest = (p[1] * std::f64::consts::TAU).recip() * BEYOND.exp();
        let tau = std::array::from_fn(|j| longest * (step * -(j as f64)).exp());
        Series { g: step * std::f64::consts::FRAC_2_PI, end: step.recip() * TAIL + 0.5, tau }
    }
}
