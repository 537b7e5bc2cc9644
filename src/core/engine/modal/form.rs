//! Products of shapes with the dynamic stiffness, which are wanted at many `s`.

use std::collections::HashMap;

use num_complex::Complex64;

use super::Problem;

/// Parts of a bilinear form `u' Z(s) v`: `s^2 inertia + stiffness + sum of z_e(s) elements_e`, elements of one law summed at the first of them.
pub(super) struct Form {
    inertia: Complex64,
    stiffness: Complex64,
    elements: Vec<Complex64>,
}

/// The number of each row among those that differ, and the first of each of these.
pub(super) fn alike(rows: &[Vec<(usize, f64)>]) -> (Vec<usize>, Vec<usize>) {
    let mut numbers: HashMap<Vec<(usize, u64)>, usize> = HashMap::new();
    let mut first = Vec::new();
    let number = rows.iter().enumerate().map(|(e, row)| {
        let bits = row.iter().map(|(d, b)| (*d, b.to_bits())).collect();
        *numbers.entry(bits).or_insert_with(|| {
            first.push(e);
            first.len() - 1
        })
    });
    (number.collect(), first)
}

impl Problem<'_> {
    /// What `u' Z(s) v` is made of at every `s`.
    pub(super) fn form(&self, u: &[Complex64], v: &[Complex64]) -> Form {
        let of = |m: &[(usize, usize, f64)]| m.iter().map(|(i, j, x)| u[*i] * v[*j] * *x).sum::<Complex64>();
        let mut elements = vec![Complex64::ZERO; self.acts_at.len()];
        for (e, first) in self.small.same.iter().enumerate() {
            let of_u = self.small.relative(e, u);
            elements[*first] += of_u * if std::ptr::eq(u, v) { of_u } else { self.small.relative(e, v) };
        }
        Form { inertia: of(&self.small.mass), stiffness: of(&self.small.stiffness), elements }
    }

    /// `u' Z(s) v` and `u' Z'(s) v` with the laws at `s` at hand.
    pub(super) fn at(&self, s: Complex64, form: &Form) -> (Complex64, Complex64) {
        let (mut value, mut slope) = (s * s * form.inertia + form.stiffness, s * form.inertia * 2.0);
        for ((z, dz), product) in self.z.iter().zip(&self.dz).zip(&form.elements) {
            value += z * product;
            slope += dz * product;
        }
        (value, slope)
    }
}
