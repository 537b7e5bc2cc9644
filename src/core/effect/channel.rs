//! Effects of the measuring chain: they act on what is observed, not on the structure.

use num_complex::{Complex, Complex64};
use num_dual::DualSVec64;

use super::{Info, Num};

/// The moment of a reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// Acceleration of the driven end [m/s2 or rad/s2].
    pub acceleration: f64,
    /// Time from the middle of the record, or of the cycle [s].
    pub time: f64,
}

/// What a channel makes of the true signal. In the time domain first the shift, then [`ChannelLaw::reading`].
pub trait ChannelLaw: Send + Sync + 'static {
    /// What the effect says of itself.
    const INFO: Info;
    /// Whether it is seen in a frequency response.
    const IN_FREQUENCY: bool = true;
    /// The role whose readings alone it acts on, `force` or `response`.
    const READS: Option<&'static str> = None;
    /// Time by which the reading lags the signal [s].
    fn shift<T: Num>(_p: &[T]) -> T {
        T::from(0.0)
    }
    /// Reading of a signal `y`.
    fn reading<T: Num>(y: T, at: Moment, p: &[T]) -> T;
    /// Factor on the amplitude of the signal at the circular frequency `w` [rad/s]; `drive` is the accelerance at the driven end, of what
    /// acts on responses alone that at the place of the response.
    fn factor<T: Num>(w: f64, drive: Complex<T>, p: &[T]) -> Complex<T>;
}

/// A channel effect behind a pointer.
pub trait Channel: Send + Sync {
    /// What the effect says of itself.
    fn info(&self) -> &'static Info;
    /// [`ChannelLaw::IN_FREQUENCY`].
    fn in_frequency(&self) -> bool;
    /// [`ChannelLaw::READS`].
    fn reads(&self) -> Option<&'static str>;
    /// Time shift [s] and its derivatives with respect to the parameters.
    fn shift(&self, p: &[f64], dp: &mut [f64]) -> f64;
    /// Reading, its derivative with respect to the signal, and with respect to the parameters.
    fn reading(&self, y: f64, at: Moment, p: &[f64], dp: &mut [f64]) -> (f64, f64);
    /// Factor, its derivative with respect to the drive-point accelerance, and with respect to the parameters.
    fn factor(&self, w: f64, drive: Complex64, p: &[f64], dp: &mut [Complex64]) -> (Complex64, Complex64);
}

type D = DualSVec64<4>;

fn seeded(p: &[f64]) -> [D; 3] {
    let mut params = [D::from_re(0.0); 3];
    for (k, (to, from)) in params.iter_mut().zip(p).enumerate() {
        *to = D::from_re(*from).derivative(1 + k);
    }
    params
}

fn slope(d: &D, i: usize) -> f64 {
    d.eps.0.as_ref().map_or(0.0, |m| m[i])
}

impl<L: ChannelLaw> Channel for L {
    fn info(&self) -> &'static Info {
        &L::INFO
    }
    fn in_frequency(&self) -> bool {
        L::IN_FREQUENCY
    }
    fn reads(&self) -> Option<&'static str> {
        L::READS
    }
    fn shift(&self, p: &[f64], dp: &mut [f64]) -> f64 {
        let shift = L::shift(&seeded(p)[..p.len().min(3)]);
        dp.iter_mut().enumerate().for_each(|(k, out)| *out = slope(&shift, 1 + k));
        shift.re
    }
    fn reading(&self, y: f64, at: Moment, p: &[f64], dp: &mut [f64]) -> (f64, f64) {
        let reading = L::reading(D::from_re(y).derivative(0), at, &seeded(p)[..p.len().min(3)]);
        dp.iter_mut().enumerate().for_each(|(k, out)| *out = slope(&reading, 1 + k));
        (reading.re, slope(&reading, 0))
    }
    fn factor(&self, w: f64, drive: Complex64, p: &[f64], dp: &mut [Complex64]) -> (Complex64, Complex64) {
        // The factor is analytic in the accelerance, so its derivative along the real axis is the complex derivative.
        let drive = Complex::new(D::from_re(drive.re).derivative(0), D::from_re(drive.im));
        let f = L::factor(w, drive, &seeded(p)[..p.len().min(3)]);
        let d = |i: usize| Complex64::new(slope(&f.re, i), slope(&f.im, i));
        dp.iter_mut().enumerate().for_each(|(k, out)| *out = d(1 + k));
        (Complex64::new(f.re.re, f.im.re), d(0))
    }
}
