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

/// What is above zero of it.
#[inline]
pub fn positive<T: Num>(u: T) -> T {
    if u.re() > 0.0 { u } else { T::from(0.0) }
}

/// Absolute value; its derivative at 0 is 0, the mean of both sides.
#[inline]
pub fn magnitude<T: Num>(u: T) -> T {
    u * sign(u)
}

/// Direction: 1, -1, or 0 for exactly 0.
#[inline]
pub fn sign<T: Num>(u: T) -> f64 {
    if u.re() == 0.0 { 0.0 } else { u.re().signum() }
}

/// `base^n` of a base that is not negative, with derivatives in both. At 0 it is 1 for n = 0, else 0, without derivatives.
#[inline]
pub fn power<T: Num>(base: T, n: T) -> T {
    // Plain numbers have no derivative with respect to the exponent.
    if T::NDERIV == 0 && [0.0, 1.0, 2.0, 3.0].contains(&n.re()) && base.re() > 0.0 {
        return base.powi(n.re() as i32);
    }
    if base.re() > 0.0 { (n * base.ln()).exp() } else { T::from(if n.re() == 0.0 { 1.0 } else { 0.0 }) }
}

/// `(e^u - 1)/u`, 1 at 0.
#[inline]
pub fn phi1<T: Num>(u: T) -> T {
    if u.re().abs() < 0.1 {
        // Its series to rounding: the next term is below 3e-16.
        (2..=9).rev().fold(T::from(1.0), |sum, k| sum * u * (1.0 / f64::from(k)) + 1.0)
    } else {
        u.exp_m1() / u
    }
}

/// Hyperbolic tangent by one exponential, exactly +-1 where it is so to rounding: the quotient of sinh and cosh that dual numbers take has no
/// value far out.
#[inline]
pub fn saturating_tanh<T: Num>(u: T) -> T {
    let side = if u.re() < 0.0 { -1.0 } else { 1.0 };
    if u.re().abs() < 20.0 {
        let w = u * (-2.0 * side);
        // Away from 0 the exponential alone keeps all digits, and is the cheaper of the two.
        let t = if w.re() < -0.5 { w.exp() - 1.0 } else { w.exp_m1() };
        -t / (t + 2.0) * side
    } else {
        T::from(side)
    }
}

/// Hyperbolic sine and cosine by one exponential, to rounding everywhere: with `t = e^|w| - 1` they are `(t + t/(1 + t))/2` and
/// `1 + (t - t/(1 + t))/2`.
#[inline]
pub fn sinh_cosh(w: f64) -> (f64, f64) {
    let t = w.abs().exp_m1();
    if t.is_infinite() {
        return (t.copysign(w), t);
    }
    let r = t / (1.0 + t);
    ((0.5 * (t + r)).copysign(w), 1.0 + 0.5 * (t - r))
}

#[cfg(test)]
mod tests {
    use num_dual::Dual64;

    use super::*;

    /// Powers and the exponential quotient by their shortcuts and without, on both sides of where these end.
    #[test]
    fn shortcuts_are_the_functions() {
        for base in [1e-3, 0.7, 1.0, 3.0] {
            for n in [0.0, 1.0, 2.0, 3.0, 2.5] {
                approx::assert_relative_eq!(power(base, n), f64::powf(base, n), max_relative = 1e-14);
                let d = power(Dual64::from_re(base), Dual64::from_re(n).derivative());
                approx::assert_relative_eq!(d.eps, f64::powf(base, n) * base.ln(), max_relative = 1e-14);
            }
        }
        for k in -400i32..=400 {
            let u = f64::from(k.signum()) * 1e-8 * 10f64.powf(f64::from(k.abs()) / 400.0 * 9.5);
            let quotient = if u == 0.0 { 1.0 } else { u.exp_m1() / u };
            let d = phi1(Dual64::from_re(u).derivative());
            approx::assert_relative_eq!(d.re, quotient, max_relative = 1e-15);
            if u.abs() > 1e-3 {
                approx::assert_relative_eq!(d.eps, (u.exp() - quotient) / u, max_relative = 1e-12);
            }
        }
    }

    #[test]
    fn hyperbolic_functions_keep_their_digits_on_both_sides_of_zero() {
        for k in -300i32..=300 {
            // From 1e-12 to 40.
            let w = if k == 0 { 0.0 } else { f64::from(k.signum()) * 1e-12 * 10f64.powf(f64::from(k.abs()) / 300.0 * 13.6) };
            let (sinh, cosh) = sinh_cosh(w);
            approx::assert_relative_eq!(sinh, w.sinh(), max_relative = 4e-16);
            approx::assert_relative_eq!(cosh, w.cosh(), max_relative = 4e-16);
            let t = saturating_tanh(Dual64::from_re(w).derivative());
            approx::assert_relative_eq!(t.re, w.tanh(), max_relative = 1e-15);
            let slope = if w.abs() < 20.0 { 1.0 / (w.cosh() * w.cosh()) } else { 0.0 };
            approx::assert_relative_eq!(t.eps, slope, max_relative = 1e-14);
        }
    }
}
