//! Coefficients: a parameter of another effect as a function of a test condition.

use num_dual::DualSVec64;

use super::{Info, Num};

/// Which conditions the search offers a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// Every condition that is no setting of the test itself (frequency, amplitude, load).
    Any,
    /// The condition `load` and every other that is a force.
    Load,
    /// As [`Over::Any`], but no force.
    NoLoad,
}

/// A factor on the parameter it acts on, 1 at the reference condition and at the null value of the strength.
pub trait CoefficientLaw: Send + Sync + 'static {
    /// What the effect says of itself.
    const INFO: Info;
    /// The conditions that the search offers it. A study may state any.
    const OVER: Over = Over::Any;
    /// Factor at a condition that lies `offset` above the reference [SI unit of the condition].
    fn factor<T: Num>(offset: f64, p: &[T]) -> T;
}

/// A coefficient behind a pointer.
pub trait Coefficient: Send + Sync {
    /// What the effect says of itself.
    fn info(&self) -> &'static Info;
    /// [`CoefficientLaw::OVER`].
    fn over(&self) -> Over;
    /// Factor and its derivatives with respect to the parameters.
    fn factor(&self, offset: f64, p: &[f64], dp: &mut [f64]) -> f64;
}

impl<L: CoefficientLaw> Coefficient for L {
    fn info(&self) -> &'static Info {
        &L::INFO
    }
    fn over(&self) -> Over {
        L::OVER
    }
    fn factor(&self, offset: f64, p: &[f64], dp: &mut [f64]) -> f64 {
        let mut params = [DualSVec64::<4>::from_re(0.0); 4];
        for (k, (to, from)) in params.iter_mut().zip(p).enumerate() {
            *to = DualSVec64::from_re(*from).derivative(k);
        }
        let factor = L::factor(offset, &params[..p.len().min(4)]);
        for (k, out) in dp.iter_mut().enumerate() {
            *out = factor.eps.0.as_ref().map_or(0.0, |m| m[k]);
        }
        factor.re
    }
}
