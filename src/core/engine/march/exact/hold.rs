//! What the linear part of a structure does over one step, exactly: free motion, and motion under forces that vary along the step as a polynomial.

use nalgebra::{Cholesky, DMatrix};

use crate::model::Bound;

/// Largest `h^2 k / m` and `h c / m` of a step: the exponential of a stiffer one is squared so often that its rounding adds up along a record.
const STIFFEST: f64 = 1e6;

/// Norm of the exponent over which Taylor's series is taken, and its terms: the next is below rounding, `0.5^17 / 17!`.
const SHORT: f64 = 0.5;
const TERMS: usize = 16;

/// Orders of the polynomial along a step: a cubic.
pub(super) const ORDERS: usize = 4;

/// `M u" + C u' + K u = F` of the free degrees of freedom, from all that is linear there.
pub(super) struct Structure {
    /// Free degrees of freedom.
    pub n: usize,
    stiffness: DMatrix<f64>,
    damping: DMatrix<f64>,
    /// Inverse of the mass matrix.
    pub flexible: DMatrix<f64>,
    /// Acceleration per displacement, then per velocity, at zero force: a row for every free degree of freedom.
    pub rates: Vec<f64>,
}

impl Structure {
    /// None where some motion has no mass, or a negative one.
    pub fn of(bound: &Bound, mass: &[f64], free: &[Option<usize>], n: usize) -> Option<Structure> {
        let [mut stiffness, mut damping, mut inertia] = [(); 3].map(|()| DMatrix::<f64>::zeros(n, n));
        for (d, at) in free.iter().enumerate() {
            if let Some(i) = at {
                inertia[(*i, *i)] += mass[d];
            }
        }
        for element in &bound.elements {
            let ends = [(element.to, 1.0), (element.from, -1.0)];
            let ends = || ends.iter().filter_map(|(d, sign)| Some((free[(*d)?]?, *sign)));
            for (i, a) in ends() {
                for (j, b) in ends() {
                    let [k, c, m] = element.linear_part().map(|part| a * b * part);
                    stiffness[(i, j)] += k;
                    damping[(i, j)] += c;
                    inertia[(i, j)] += m;
                }
            }
        }
        let flexible = Cholesky::new(inertia)?.inverse();
        let (by_q, by_v) = (&flexible * &stiffness, &flexible * &damping);
        let rates = (0..n).flat_map(|i| (0..2 * n).map(move |j| (i, j)));
        let rates: Vec<f64> = rates.map(|(i, j)| if j < n { -by_q[(i, j)] } else { -by_v[(i, j - n)] }).collect();
        rates.iter().all(|r| r.is_finite()).then_some(Structure { n, stiffness, damping, flexible, rates })
    }
}

/// One step of the structure: displacements, then velocities, at its end.
pub(super) struct Hold {
    /// Length of the step [s].
    pub dt: f64,
    /// By those at its start, `2n` rows of `2n`.
    pub free: Vec<f64>,
    /// By the coefficients of `F(s) = sum_j c_j s^j`, `s` from 0 to 1 along the step: `2n` rows of `n` for every order.
    pub forced: [Vec<f64>; ORDERS],
}

impl Hold {
    /// The exponential of the structure and its integrals over the forces, `W_j = integral of e^(A (1 - s)) B s^j ds`, in units of the step: Taylor's series over a
    /// part of it that is short enough, doubled up to the whole (Skaflestad and Wright, Appl. Numer. Math. 59 (2009) 783). None where the step is
    /// too long.
    pub fn new(structure: &Structure, dt: f64) -> Option<Hold> {
        let n = structure.n;
        let by_q = &structure.flexible * &structure.stiffness * (-dt * dt);
        let by_v = &structure.flexible * &structure.damping * -dt;
        // A comparison that numbers which are none fail as well.
        if !by_q.iter().chain(&by_v).all(|v| v.abs() <= STIFFEST) || !structure.flexible.iter().all(|v| (v * dt * dt).is_finite()) {
            return None;
        }
        let (mut a, mut b) = (DMatrix::<f64>::zeros(2 * n, 2 * n), DMatrix::<f64>::zeros(2 * n, n));
        a.view_mut((0, n), (n, n)).fill_with_identity();
        a.view_mut((n, 0), (n, n)).copy_from(&by_q);
        a.view_mut((n, n), (n, n)).copy_from(&by_v);
        b.view_mut((n, 0), (n, n)).copy_from(&(&structure.flexible * (dt * dt)));
        let size = a.column_iter().map(|c| c.lp_norm(1)).fold(0.0, f64::max);
        let doublings = (size / SHORT).log2().ceil().max(0.0) as i32;
        a *= 0.5f64.powi(doublings);
        b *= 0.5f64.powi(doublings);
        let (mut e, mut w) = series(&a, &b);
        for _ in 0..doublings {
            (e, w) = doubled(&e, &w);
        }
        // Velocities are counted per step in `a`.
        let unit = |i: usize| if i < n { 1.0 } else { dt };
        let free = (0..2 * n).flat_map(|i| (0..2 * n).map(move |j| (i, j))).map(|(i, j)| e[(i, j)] * unit(j) / unit(i)).collect();
        let rows = |w: &DMatrix<f64>| (0..2 * n).flat_map(|i| (0..n).map(move |j| (i, j))).map(|(i, j)| w[(i, j)] / unit(i)).collect();
        Some(Hold { dt, free, forced: [rows(&w[0]), rows(&w[1]), rows(&w[2]), rows(&w[3])] })
    }
}

/// `e^a = sum_k a^k / k!` and `W_j = sum_k a^k b j! / (k + j + 1)!` of a small `a`.
fn series(a: &DMatrix<f64>, b: &DMatrix<f64>) -> (DMatrix<f64>, [DMatrix<f64>; ORDERS]) {
    let n = a.nrows();
    let (mut power, mut driven) = (DMatrix::<f64>::identity(n, n), b.clone());
    let mut e = power.clone();
    // j! / (k + j + 1)!, from k = 0 on.
    let mut parts: [f64; ORDERS] = std::array::from_fn(|j| 1.0 / (j + 1) as f64);
    let mut w = parts.map(|part| b * part);
    for k in 1..=TERMS {
        power = a * &power / k as f64;
        driven = a * &driven;
        e += &power;
        for (j, w) in w.iter_mut().enumerate() {
            parts[j] /= (k + j + 1) as f64;
            *w += &driven * parts[j];
        }
    }
    (e, w)
}

/// The same of a step twice as long: `s^j` is `(t/2)^j` along its first half and `((1 + t)/2)^j` along its second.
fn doubled(e: &DMatrix<f64>, w: &[DMatrix<f64>; ORDERS]) -> (DMatrix<f64>, [DMatrix<f64>; ORDERS]) {
    const CHOOSE: [[f64; ORDERS]; ORDERS] = [[1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [1.0, 2.0, 1.0, 0.0], [1.0, 3.0, 3.0, 1.0]];
    let of = |j: usize| {
        let second = w.iter().zip(CHOOSE[j]).map(|(w, c)| w * c);
        second.fold(e * &w[j], |sum, w| sum + w) * 0.5f64.powi(j as i32)
    };
    (e * e, std::array::from_fn(of))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One mass on a spring and a damper under a cubic force, against the closed form: a particular solution that is a cubic, and a free decay beside it.
    #[test]
    fn a_step_of_an_oscillator_is_its_closed_form() {
        let (m, k, c, dt) = (2.0, 50.0, 3.0, 0.4);
        let structure = Structure {
            n: 1,
            stiffness: DMatrix::from_element(1, 1, k),
            damping: DMatrix::from_element(1, 1, c),
            flexible: DMatrix::from_element(1, 1, 1.0 / m),
            rates: vec![-k / m, -c / m],
        };
        let hold = Hold::new(&structure, dt).unwrap();
        let f = [4.0, -3.0, 7.0, 5.0];
        // In time: F = sum f_j (t / dt)^j, and the coefficients p of the cubic from the highest down.
        let g: Vec<f64> = (0..4).map(|j| f[j] / dt.powi(j as i32)).collect();
        let mut p = [0.0; 6];
        for j in (0..4).rev() {
            let (one, two) = ((j + 1) as f64, ((j + 1) * (j + 2)) as f64);
            p[j] = (g[j] - c * one * p[j + 1] - m * two * p[j + 2]) / k;
        }
        let cubic = |t: f64| (0..4).map(|j| p[j] * t.powi(j as i32)).sum::<f64>();
        let slope = |t: f64| (1..4).map(|j| j as f64 * p[j] * t.powi(j as i32 - 1)).sum::<f64>();
        let (q0, v0) = (0.3, -1.2);
        let (decay, w) = (c / (2.0 * m), (k / m - (c / (2.0 * m)).powi(2)).sqrt());
        let (a, b) = (q0 - cubic(0.0), (v0 - slope(0.0) + decay * (q0 - cubic(0.0))) / w);
        let (sin, cos) = (w * dt).sin_cos();
        let fade = (-decay * dt).exp();
        let q = cubic(dt) + fade * (a * cos + b * sin);
        let v = slope(dt) + fade * ((b * w - decay * a) * cos - (a * w + decay * b) * sin);
        let row = |i: usize| hold.free[2 * i] * q0 + hold.free[2 * i + 1] * v0 + (0..4).map(|j| hold.forced[j][i] * f[j]).sum::<f64>();
        assert!((row(0) - q).abs() < 1e-13 && (row(1) - v).abs() < 1e-12, "{} {q} {} {v}", row(0), row(1));
    }

    /// A spring a thousand times too stiff for its steps keeps its energy over as many of them as a record has, and a stiffer one is left to other steps.
    #[test]
    fn a_stiff_spring_keeps_its_energy_over_many_steps() {
        let of = |k: f64| Structure {
            n: 1,
            stiffness: DMatrix::from_element(1, 1, k),
            damping: DMatrix::zeros(1, 1),
            flexible: DMatrix::from_element(1, 1, 1.0),
            rates: vec![-k, 0.0],
        };
        let k = 0.9e6;
        let hold = Hold::new(&of(k), 1.0).unwrap();
        let (mut q, mut v) = (1.0, 0.0);
        for _ in 0..100_000 {
            (q, v) = (hold.free[0] * q + hold.free[1] * v, hold.free[2] * q + hold.free[3] * v);
        }
        let energy = (k * q * q + v * v) / k;
        assert!((energy - 1.0).abs() < 1e-4, "{energy}");
        for k in [2e6, f64::INFINITY, f64::NAN] {
            assert!(Hold::new(&of(k), 1.0).is_none(), "{k}");
        }
    }
}
