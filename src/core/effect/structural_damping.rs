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
        equation: "F = sum_j g_j (s_j - w^2 tau_j^2/(1 + w^2 tau_j^2) x),  ds_j/dt = v - s_j/tau_j,  tau_j spaced by the ratio r from half a decade below the band to half a decade above it,  g_j = 2 h ln(r)/pi, the outermost two such that the loss at the ends of the band is h,  w = 2 pi f_ref",
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
        range: "constant within 0.7 % over a band of up to six decades and 2 % over seven; below and above it fading like that of one Maxwell branch. The storage modulus rises by (2/pi) h per e-fold of frequency, as causality demands, and is negative below f_ref; f_ref below 0 leaves it out, as finite-element programs do",
    };

    const SUPERPOSES: bool = true;
    const AT_DRIVE: Option<usize> = Some(F_REF);

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        let branches = Branches::new(p);
        let (mut inner, mut outer) = (T::from(0.0), T::from(0.0));
        for (j, (state, tau)) in s.iter_mut().zip(&branches.tau).enumerate() {
            let ratio = tau.recip() * dt;
            let decay = (-ratio).exp();
            *state = *state * decay - u.dx * (-ratio).exp_m1() / ratio;
            *(if is_outer(j) { &mut outer } else { &mut inner }) += *state;
        }
        p[0] * (branches.inner * inner + branches.outer * outer - branches.stored(magnitude(p[F_REF])) * u.x)
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let branches = Branches::new(p);
        // Without storage the law is not analytic in s: it has the loss of the frequency, whatever the decay.
        let storing = p[F_REF].re() >= 0.0;
        let s = if storing { s } else { Complex::new(T::from(0.0), s.im) };
        let mut sum = Complex::new(-branches.stored(p[F_REF]), T::from(0.0));
        for (j, tau) in branches.tau.into_iter().enumerate() {
            let st = s * tau;
            sum += st / (st + T::from(1.0)) * branches.modulus(j);
        }
        if !storing {
            sum.re = T::from(0.0);
        }
        Ok(sum * p[0])
    }
}

/// Index of `f_ref`.
const F_REF: usize = 3;

/// Branches of the series.
const BRANCHES: usize = 12;
/// How far the outermost lie beyond the ends of the band: half a decade. Where they lie on its ends, a third of the loss is missing there.
const BEYOND: f64 = 3.162_277_660_168_379_5;

/// The law as a series of branches, which store: where `f_ref` is below 0, nothing at `-f_ref`.
pub(super) fn prony(p: &[f64]) -> Prony {
    let branches = Branches::new(p);
    Prony {
        spring: -branches.stored(p[F_REF].abs()),
        damper: 0.0,
        branches: branches.tau.iter().enumerate().map(|(j, t)| (branches.modulus(j), 1.0 / t)).collect(),
    }
}

/// Per unit of loss modulus: the modulus of all branches but the outermost two, that of these, and the relaxation times, longest first.
///
/// Branches of equal modulus `g` without end at times spaced by the ratio `r` have the loss modulus `g pi / (2 ln r)`. The outermost make up at the ends of the band
/// for what is cut off beyond them.
struct Branches<T> {
    inner: T,
    outer: T,
    tau: [T; BRANCHES],
}

impl<T: Num> Branches<T> {
    fn new(p: &[T]) -> Self {
        let step = ((p[2] / p[1]).ln() + 2.0 * BEYOND.ln()) / (BRANCHES - 1) as f64;
        let longest = (p[1] * std::f64::consts::TAU).recip() * BEYOND;
        let ratio: [T; BRANCHES] = std::array::from_fn(|j| (step * -(j as f64)).exp());
        let inner = step * std::f64::consts::FRAC_2_PI;
        // Loss at the lower end of the band of the branches inside and of the outermost, of modulus 1 each; at the upper end it is the same.
        let mut loss = [T::from(0.0); 2];
        for (j, r) in ratio.iter().enumerate() {
            let turned = *r * BEYOND;
            loss[usize::from(is_outer(j))] += turned / (turned * turned + T::from(1.0));
        }
        Self { inner, outer: (T::from(1.0) - inner * loss[0]) / loss[1], tau: ratio.map(|r| longest * r) }
    }

    fn modulus(&self, j: usize) -> T {
        if is_outer(j) { self.outer } else { self.inner }
    }

    /// What the branches store at the frequency `f` [Hz].
    fn stored(&self, f: T) -> T {
        let mut sum = T::from(0.0);
        for (j, tau) in self.tau.iter().enumerate() {
            let turned = (*tau * f * std::f64::consts::TAU).powi(2);
            sum += turned / (turned + T::from(1.0)) * self.modulus(j);
        }
        sum
    }
}

fn is_outer(j: usize) -> bool {
    j == 0 || j == BRANCHES - 1
}
