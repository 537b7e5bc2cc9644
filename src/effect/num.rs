//! The number type that the laws are written over.

use num_dual::DualNum;

/// A real number or a dual number over it: what every law is generic over, so that one `advance` yields values, tangents and
/// sensitivities.
pub trait Num: DualNum<Primitive = f64> + Copy {}
impl<T: DualNum<Primitive = f64> + Copy> Num for T {}

/// A constant as `T`.
#[inline]
pub fn c<T: Num>(value: f64) -> T {
    T::from(value)
}

/// Rate of a quantity at the end of a uniform step by the second-order backward formula,
/// `(3 u - 4 u1 + u2) / (2 dt)`, with `u1`, `u2` its values one and two steps before.
#[inline]
pub fn bdf2<T: Num>(u: T, u1: T, u2: T, dt: f64) -> T {
    (u * 3.0 - u1 * 4.0 + u2) * (0.5 / dt)
}

/// A smooth sign, `u / sqrt(1 + u^2)`: odd, monotone, +-1 far out, slope 1 at 0.
#[inline]
pub fn smooth_sign<T: Num>(u: T) -> T {
    u / (u * u + 1.0).sqrt()
}

/// Hyperbolic tangent that is exactly +-1 where it is so to rounding: the quotient of sinh and cosh that dual numbers take has no value
/// far out.
#[inline]
pub fn saturating_tanh<T: Num>(u: T) -> T {
    if u.re().abs() < 20.0 { u.tanh() } else { T::from(u.re().signum()) }
}
