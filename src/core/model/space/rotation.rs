//! Rotations by rotation vectors, over plain and dual numbers.
//!
//! `R(t) = exp(t~)`, where `t~` is the matrix of `t x`; the length of `t` is the angle, its direction the axis. The spin that belongs to
//! a change of `t` is `T(t) dt` in fixed axes and `T(t)' dt` in axes that turn along (Cardona and Geradin, Int. J. Numer. Methods Eng.
//! 26, 1988; Geradin and Rixen, Mechanical Vibrations). Everything is regular for angles below a full turn; below one radian the
//! coefficients are series, so that there is no small angle at which digits are lost.

use crate::effect::Num;

/// A vector.
pub type V3<T> = [T; 3];
/// A matrix, by rows.
pub type M3<T> = [[T; 3]; 3];

/// The unit matrix.
pub const UNIT: M3<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// `a x b`.
#[inline]
pub fn cross<T: Num>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
/// `a . b`.
#[inline]
pub fn dot<T: Num>(a: V3<T>, b: V3<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
/// `a + b`.
#[inline]
pub fn add<T: Num>(a: V3<T>, b: V3<T>) -> V3<T> {
    std::array::from_fn(|i| a[i] + b[i])
}
/// `a - b`.
#[inline]
pub fn sub<T: Num>(a: V3<T>, b: V3<T>) -> V3<T> {
    std::array::from_fn(|i| a[i] - b[i])
}
/// `m v`.
#[inline]
pub fn times<T: Num>(m: &M3<T>, v: V3<T>) -> V3<T> {
    std::array::from_fn(|i| dot(m[i], v))
}
/// `m' v`.
#[inline]
pub fn transposed_times<T: Num>(m: &M3<T>, v: V3<T>) -> V3<T> {
    std::array::from_fn(|i| m[0][i] * v[0] + m[1][i] * v[1] + m[2][i] * v[2])
}
/// `a b`.
#[inline]
pub fn product<T: Num>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j]))
}
/// `a' b`.
#[inline]
pub fn transposed_product<T: Num>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[2][i] * b[2][j]))
}
/// `m'`.
#[inline]
pub fn transposed<T: Num>(m: &M3<T>) -> M3<T> {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}
/// `v~`, the matrix of `v x`.
#[inline]
pub fn tilde<T: Num>(v: V3<T>) -> M3<T> {
    let o = T::from(0.0);
    [[o, -v[2], v[1]], [v[2], o, -v[0]], [-v[1], v[0], o]]
}
/// Constants as `T`.
#[inline]
pub fn vector<T: Num>(v: V3<f64>) -> V3<T> {
    v.map(T::from)
}
/// Constants as `T`.
#[inline]
pub fn matrix<T: Num>(m: &M3<f64>) -> M3<T> {
    m.map(|row| row.map(T::from))
}

/// Below this square of the angle the coefficients are series.
const SERIES: f64 = 1.0;

/// `(-1)^j / (2j + k)!` for k = 1, 2, 3.
const POWERS: [[f64; 10]; 3] = {
    let mut table = [[0.0; 10]; 3];
    let mut k = 1;
    while k <= 3 {
        let mut term = [1.0, 0.5, 1.0 / 6.0][k - 1];
        let mut j = 0;
        while j < 10 {
            table[k - 1][j] = term;
            term /= -(((2 * j + k + 1) * (2 * j + k + 2)) as f64);
            j += 1;
        }
        k += 1;
    }
    table
};

/// `sin a/a, (1 - cos a)/a^2, (a - sin a)/a^3`, and `1/a d/da` of the last two; that of the first is the third less the second.
#[inline]
fn coefficients<T: Num>(s: T) -> [T; 5] {
    if s.re() < SERIES {
        // sum (-s)^j / (2j + k)!, and twice its derivative with respect to s.
        let (mut c, mut d) = ([T::from(0.0); 3], [T::from(0.0); 3]);
        for (k, series) in POWERS.iter().enumerate() {
            let (mut value, mut slope) = (T::from(0.0), T::from(0.0));
            for a in series.iter().rev() {
                slope = slope * s + value;
                value = value * s + *a;
            }
            (c[k], d[k]) = (value, slope * 2.0);
        }
        return [c[0], c[1], c[2], d[1], d[2]];
    }
    let a = s.sqrt();
    let (sin, cos) = a.sin_cos();
    let (c1, c2) = (sin / a, (-cos + 1.0) / s);
    let c3 = (-c1 + 1.0) / s;
    [c1, c2, c3, (c1 - c2 * 2.0) / s, (c2 - c3 * 3.0) / s]
}

/// `R - 1` and `T` of a rotation vector. The first keeps its digits at small angles.
#[inline]
pub fn exponential<T: Num>(t: V3<T>) -> (M3<T>, M3<T>) {
    let s = dot(t, t);
    let [c1, c2, c3, ..] = coefficients(s);
    let turn = |one: T, skew: T, dyad: T| -> M3<T> {
        let k = tilde(t);
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let v = k[i][j] * skew + t[i] * t[j] * dyad;
                if i == j { v + one } else { v }
            })
        })
    };
    // R - 1 = c1 t~ + c2 (t t' - s 1).
    (turn(-(c2 * s), c1, c2), turn(c1, c2, c3))
}

/// Derivative of `T(t)' v` with respect to `t` at a fixed `v`.
#[inline]
pub fn slope_of_transposed<T: Num>(t: V3<T>, v: V3<T>) -> M3<T> {
    let [_, c2, c3, d2, d3] = coefficients(dot(t, t));
    let (tv, along) = (cross(t, v), dot(t, v));
    let d1 = c3 - c2;
    let k = tilde(v);
    std::array::from_fn(|i| {
        let by_length = v[i] * d1 - tv[i] * d2 + t[i] * along * d3;
        std::array::from_fn(|j| {
            let d = by_length * t[j] + k[i][j] * c2 + t[i] * v[j] * c3;
            if i == j { d + along * c3 } else { d }
        })
    })
}

/// `e(s)` of `T(t)^-1 = 1 - t~/2 + e t~^2`, and `1/a de/da`.
#[inline]
fn inverse_coefficients<T: Num>(s: T) -> (T, T) {
    if s.re() < 0.1 {
        const E: [f64; 8] = [
            1.0 / 12.0,
            1.0 / 720.0,
            1.0 / 30240.0,
            1.0 / 1209600.0,
            1.0 / 47900160.0,
            691.0 / 1307674368000.0,
            1.0 / 74724249600.0,
            3617.0 / 10670622842880000.0,
        ];
        let (mut value, mut slope) = (T::from(0.0), T::from(0.0));
        for a in E.iter().rev() {
            slope = slope * s + value;
            value = value * s + *a;
        }
        return (value, slope * 2.0);
    }
    let [c1, c2, c3, d2, _] = coefficients(s);
    let d1 = c3 - c2;
    let h = c1 / c2 * 0.5;
    let e = (-h + 1.0) / s;
    let dh = (d1 * c2 - c1 * d2) / (c2 * c2) * 0.5;
    (e, -(dh + e * 2.0) / s)
}

/// `T(t)^-1`.
#[inline]
pub fn inverse_tangent<T: Num>(t: V3<T>) -> M3<T> {
    let s = dot(t, t);
    let (e, _) = inverse_coefficients(s);
    let k = tilde(t);
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let v = t[i] * t[j] * e - k[i][j] * 0.5;
            if i == j { v - s * e + 1.0 } else { v }
        })
    })
}

/// Derivative of `T(t)^-T f` with respect to `t` at a fixed `f`.
#[inline]
pub fn slope_of_inverse_transposed<T: Num>(t: V3<T>, f: V3<T>) -> M3<T> {
    let (e, d) = inverse_coefficients(dot(t, t));
    let (twice, along) = (cross(t, cross(t, f)), dot(t, f));
    let k = tilde(f);
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let v = twice[i] * t[j] * d + (t[i] * f[j] - f[i] * t[j] * 2.0) * e - k[i][j] * 0.5;
            if i == j { v + along * e } else { v }
        })
    })
}

/// The rotation vector of `1 + m`, for angles below half a turn.
#[inline]
pub fn logarithm<T: Num>(m: &M3<T>) -> V3<T> {
    let w = [(m[2][1] - m[1][2]) * 0.5, (m[0][2] - m[2][0]) * 0.5, (m[1][0] - m[0][1]) * 0.5];
    let s = dot(w, w);
    let cos = (m[0][0] + m[1][1] + m[2][2]) * 0.5 + 1.0;
    // w is sin(a) times the axis.
    let factor = if s.re() < 0.01 && cos.re() > 0.0 {
        const A: [f64; 8] = [1.0, 1.0 / 6.0, 3.0 / 40.0, 5.0 / 112.0, 35.0 / 1152.0, 63.0 / 2816.0, 231.0 / 13312.0, 143.0 / 10240.0];
        A.iter().rev().fold(T::from(0.0), |sum, a| sum * s + *a)
    } else {
        let sin = s.sqrt();
        sin.atan2(cos) / sin
    };
    w.map(|x| x * factor)
}

#[cfg(test)]
mod tests {
    use num_dual::Dual64;

    use super::*;

    fn along(t: V3<f64>, d: V3<f64>) -> V3<Dual64> {
        std::array::from_fn(|i| Dual64::new(t[i], d[i]))
    }

    #[test]
    fn spins_and_their_slopes_are_derivatives() {
        for size in [0.0, 1e-7, 1e-3, 0.3, 0.999, 1.001, 1.7, 2.9] {
            let t: V3<f64> = [0.48 * size, -0.6 * size, 0.64 * size];
            let (d, v) = ([0.3, 0.9, -0.5], [1.1, -0.4, 0.7]);
            let (r, tangent) = exponential(t);
            let r: M3<f64> = std::array::from_fn(|i| std::array::from_fn(|j| r[i][j] + f64::from(i == j)));
            let (dual, dual_tangent) = exponential(along(t, d));
            // dR R' = (T d)~.
            let rate = dual.map(|row| row.map(|x| x.eps));
            let spin = product(&rate, &transposed(&r));
            let expected = tilde(times(&tangent, d));
            let slope = times(&slope_of_transposed(t, v), d);
            let by_dual = transposed_times(&dual_tangent, vector(v)).map(|x| x.eps);
            let identity = product(&inverse_tangent(t), &tangent);
            let inverse = times(&slope_of_inverse_transposed(t, v), d);
            let inverse_dual = transposed_times(&inverse_tangent(along(t, d)), vector(v)).map(|x| x.eps);
            let back = logarithm(&exponential(t).0);
            for i in 0..3 {
                for j in 0..3 {
                    assert!((spin[i][j] - expected[i][j]).abs() < 1e-13, "{size}");
                    assert!((product(&r, &transposed(&r))[i][j] - UNIT[i][j]).abs() < 1e-14);
                    assert!((identity[i][j] - UNIT[i][j]).abs() < 1e-13, "{size}: {identity:?}");
                }
                assert!((slope[i] - by_dual[i]).abs() < 1e-12, "{size}: {slope:?} {by_dual:?}");
                assert!((inverse[i] - inverse_dual[i]).abs() < 1e-12, "{size}: {inverse:?} {inverse_dual:?}");
                assert!((back[i] - t[i]).abs() < 1e-13 * (1.0 + size), "{size}: {back:?} {t:?}");
            }
        }
    }

    #[test]
    fn a_small_rotation_keeps_its_digits() {
        let t: V3<f64> = [1e-9, -2e-9, 3e-9];
        let back = logarithm(&exponential(t).0);
        assert!((0..3).all(|i| (back[i] - t[i]).abs() < 1e-24), "{back:?}");
    }
}
