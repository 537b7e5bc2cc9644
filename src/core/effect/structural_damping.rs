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
        equation: "F = sum_j g (s_j - w^2 tau_j^2/(1 + w^2 tau_j^2) x),  ds_j/dt = v - s_j/tau_j,  g = 2 h ln(r)/pi,  tau_j spaced by the ratio r over the band,  w = 2 pi f_ref",
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
        range: "constant within 2 % from 1.3 decades inside the default band on; at its ends 0.70 h. The storage modulus rises by (2/pi) h per e-fold of frequency, as causality demands, and is negative below f_ref; f_ref below 0 leaves it out, as finite-element programs do",
    };

    const SUPERPOSES: bool = true;
    const AT_DRIVE: Option<usize> = Some(F_REF);

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        let (g, tau) = series(p);
        let mut sum = T::from(0.0);
        for (state, tau) in s.iter_mut().zip(&tau) {
            let ratio = tau.recip() * dt;
            let decay = (-ratio).exp();
            *state = *state * decay - u.dx * (-ratio).exp_m1() / ratio;
            sum += *state;
        }
        p[0] * g * (sum - u.x * stored(&tau, magnitude(p[F_REF])))
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let (g, tau) = series(p);
        // Without storage the law is not analytic in s: it has the loss of the frequency, whatever the decay.
        let storing = p[F_REF].re() >= 0.0;
        let s = if storing { s } else { Complex::new(T::from(0.0), s.im) };
        let mut sum = Complex::new(-stored(&tau, p[F_REF]), T::from(0.0));
        for tau in tau {
            let st = s * tau;
            sum += st / (st + T::from(1.0));
        }
        if !storing {
            sum.re = T::from(0.0);
        }
        Ok(sum * (p[0] * g))
    }
}

/// Index of `f_ref`.
const F_REF: usize = 3;

/// Branches of the series. One to two per decade keep the loss modulus within 1 % inside the default band of six decades.
const BRANCHES: usize = 12;

/// The law as a series of branches, which store: where `f_ref` is below 0, nothing at `-f_ref`.
pub(super) fn prony(p: &[f64]) -> Prony {
    let (weight, tau) = series(p);
    Prony { spring: -weight * stored(&tau, p[F_REF].abs()), damper: 0.0, branches: tau.iter().map(|t| (weight, 1.0 / t)).collect() }
}

/// What the branches, of modulus 1 each, store at the frequency `f` [Hz].
fn stored<T: Num>(tau: &[T], f: T) -> T {
    let mut sum = T::from(0.0);
    for tau in tau {
        let turned = (*tau * f * std::f64::consts::TAU).powi(2);
        sum += turned / (turned + T::from(1.0));
    }
    sum
}

/// Modulus of each branch per unit of loss modulus, and the relaxation times.
///
/// Branches of equal modulus `g` at times spaced by the ratio `r` have the loss modulus `g pi / (2 ln r)` between the outermost.
fn series<T: Num>(p: &[T]) -> (T, [T; BRANCHES]) {
    let step = (p[2] / p[1]).ln() / (BRANCHES - 1) as f64;
    let longest = (p[1] * std::f64::consts::TAU).recip();
    let times = std::array::from_fn(|j| longest * (step * -(j as f64)).exp());
    (step * std::f64::consts::FRAC_2_PI, times)
}
