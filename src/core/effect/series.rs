//! Effects in series: an opening between the connector's end and what acts there.

use num_dual::{Dual64, DualSVec};

use super::{Info, Num};

/// Opening `e(F)` of a series effect: the connector's end stands at `x`, what acts there at `y = x - sum of e(F)`, and `F` is the
/// same on both sides. The element condenses `y` and differentiates by the implicit function theorem.
pub trait SeriesLaw: Send + Sync + 'static {
    /// What the effect says of itself.
    const INFO: Info;
    /// Whether the opening is proportional to the force.
    const LINEAR: bool = false;
    /// Opening [m or rad] under the general force `f`; non-decreasing in `f`, zero at the null value of the strength.
    fn opening<T: Num>(f: T, p: &[T]) -> T;
}

/// A series effect behind a pointer.
pub trait Series: Send + Sync {
    /// What the effect says of itself.
    fn info(&self) -> &'static Info;
    /// [`SeriesLaw::LINEAR`].
    fn linear(&self) -> bool;
    /// Opening and its derivative with respect to the force.
    fn opening(&self, f: f64, p: &[f64]) -> (f64, f64);
    /// Derivatives with respect to the parameters of the opening and of its slope `de/dF`.
    fn opening_params(&self, f: f64, p: &[f64], dp: &mut [f64], dslope: &mut [f64]);
}

impl<L: SeriesLaw> Series for L {
    fn info(&self) -> &'static Info {
        &L::INFO
    }
    fn linear(&self) -> bool {
        L::LINEAR
    }
    fn opening(&self, f: f64, p: &[f64]) -> (f64, f64) {
        let mut params = [Dual64::from_re(0.0); 4];
        for (to, from) in params.iter_mut().zip(p) {
            to.re = *from;
        }
        let e = L::opening(Dual64::from_re(f).derivative(), &params[..p.len().min(4)]);
        (e.re, e.eps)
    }
    fn opening_params(&self, f: f64, p: &[f64], dp: &mut [f64], dslope: &mut [f64]) {
        // Dual numbers in the parameters over dual numbers in the force: the mixed second derivative comes along.
        type Nested = DualSVec<Dual64, 4>;
        let mut params = [Nested::from_re(Dual64::from_re(0.0)); 4];
        for (k, (to, from)) in params.iter_mut().zip(p).enumerate() {
            *to = Nested::from_re(Dual64::from_re(*from)).derivative(k);
        }
        let e = L::opening(Nested::from_re(Dual64::from_re(f).derivative()), &params[..p.len().min(4)]);
        for (k, (out, slope)) in dp.iter_mut().zip(dslope).enumerate() {
            (*out, *slope) = e.eps.0.as_ref().map_or((0.0, 0.0), |m| (m[k].re, m[k].eps));
        }
    }
}
