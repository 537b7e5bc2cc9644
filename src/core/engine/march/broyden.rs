//! Broyden's method on kept factors: the steps of one time step make up for what the factors have lost.
//!
//! With `H` the factors at hand, steps `s_0, s_1, ...` and residuals `r` (Kelley, Iterative Methods for Linear and Nonlinear Equations, 1995,
//! sec. 7.3): `z = -H r`, then `z += s_(j+1) (s_j.z)/|s_j|^2` for the steps before, and `s = z / (1 - s_n.z/|s_n|^2)`. It costs a few inner
//! products, where each evaluation that it saves costs the whole model.

/// Steps that are remembered.
const MOST: usize = 12;
/// A divisor below this would leave the neighbourhood of the factors.
const LEAST: f64 = 0.2;

/// The steps so far.
#[derive(Debug, Default)]
pub(super) struct Broyden {
    steps: Vec<f64>,
    squares: Vec<f64>,
}

impl Broyden {
    /// Forgets the steps: other factors, another time step, a step that was not taken whole.
    pub fn clear(&mut self) {
        self.steps.clear();
        self.squares.clear();
    }

    /// Turns `z`, the step by the factors alone, into the quasi-Newton step, and remembers it.
    pub fn improve(&mut self, z: &mut [f64]) {
        let (n, count) = (z.len(), self.squares.len());
        let step = |j: usize| &self.steps[j * n..(j + 1) * n];
        let mut divisor = 1.0;
        if let Some(last) = count.checked_sub(1) {
            for j in 0..last {
                let share = inner(step(j), z) / self.squares[j];
                z.iter_mut().zip(step(j + 1)).for_each(|(z, s)| *z += share * s);
            }
            divisor -= inner(step(last), z) / self.squares[last];
        }
        if divisor.is_nan() || divisor < LEAST || count == MOST {
            self.clear();
        } else {
            z.iter_mut().for_each(|z| *z /= divisor);
        }
        let square = inner(z, z);
        if square > 0.0 {
            self.steps.extend_from_slice(z);
            self.squares.push(square);
        } else {
            self.clear();
        }
    }
}

/// Sum of the products. By index: an iterator's adapters are not inlined everywhere.
#[inline]
fn inner(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b, mut sum) = (&a[..n], &b[..n], 0.0);
    for k in 0..n {
        sum += a[k] * b[k];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Iterations of `x -> x + step` on a mildly nonlinear system whose factors are those of its linear part at rest.
    fn iterations(broyden: bool) -> usize {
        let residual = |x: &[f64; 3]| {
            [2.0 * x[0] + 0.3 * x[1] * x[1] - 1.0, 3.0 * x[1] + 0.4 * x[0] * x[2] - 1.2, 1.5 * x[2] + 0.2 * x[0].powi(3) - 0.8]
        };
        let (mut x, mut method) = ([0.0; 3], Broyden::default());
        for k in 0..100 {
            let r = residual(&x);
            if r.iter().all(|r| r.abs() < 1e-13) {
                return k;
            }
            let mut z = [-r[0] / 2.0, -r[1] / 3.0, -r[2] / 1.5];
            if broyden {
                method.improve(&mut z);
            }
            x.iter_mut().zip(z).for_each(|(x, z)| *x += z);
        }
        100
    }

    #[test]
    fn fewer_steps_than_with_the_factors_alone() {
        let (with, without) = (iterations(true), iterations(false));
        println!("{with} against {without}");
        assert!(with <= 9 && without >= 12, "{with} {without}");
    }

    #[test]
    fn a_step_that_would_leave_is_taken_by_the_factors_alone() {
        let mut method = Broyden::default();
        let mut z = [1.0, 0.0];
        method.improve(&mut z);
        let mut z = [0.95, 0.1];
        method.improve(&mut z);
        assert_eq!((z, method.squares.len()), ([0.95, 0.1], 1));
        let mut z = [0.0, 0.0];
        method.improve(&mut z);
        assert!(method.squares.is_empty());
    }
}
